//! `tracklens convert`, `tracklens inspect` and `tracklens export`.

use std::io::IsTerminal as _;
use std::path::{Path, PathBuf};

use clap::Args;
use comfy_table::presets::NOTHING;
use serde::Serialize;

use super::terminal::{say_json, say_rows};
use super::{detector, files};
use crate::atomic;
use crate::checkpoint::{Checkpoint, Format, SaeConfig, Summary, Training};
use crate::engine::{CpuEncoder, PlannedLayer};
use crate::error::{Error, Result};
use crate::weights::{Weights, read_checkpoint, read_onnx, read_weights};

#[derive(Debug, Args)]
pub(super) struct ConvertArguments {
    /// The checkpoint to read: .safetensors, PyTorch's .pth or burn's .bpk
    #[arg(value_name = "IN")]
    from: PathBuf,
    /// Which weights, where a file has several sets: what stands before `encoder.` in their names,
    /// e.g. ema or policy.pi_features_extractor; default: the only ones, or those under
    /// model_state_dict, state_dict, model or weights
    #[arg(long, value_name = "KEY")]
    key: Option<String>,
    /// The file to write; its extension gives the format
    #[arg(value_name = "OUT")]
    to: PathBuf,
}

#[derive(Debug, Args)]
pub(super) struct InspectArguments {
    /// The checkpoint: .safetensors, PyTorch's .pth or burn's .bpk; or a detector as an ONNX model
    #[arg(value_name = "FILE")]
    file: PathBuf,
    /// Which weights, where a file has several sets: what stands before `encoder.` in their names,
    /// e.g. ema or policy.pi_features_extractor; default: the only ones, or those under
    /// model_state_dict, state_dict, model or weights
    #[arg(long, value_name = "KEY")]
    key: Option<String>,
    /// Also show how the CPU engine computes frames of this size, layer by layer
    #[arg(long, value_name = "WxH", value_parser = super::values::parse_size)]
    plan: Option<[u32; 2]>,
    /// Print JSON (the default when the output is not a terminal)
    #[arg(long)]
    json: bool,
}

#[derive(Debug, Args)]
pub(super) struct ExportArguments {
    /// The checkpoint: .safetensors, PyTorch's .pth or burn's .bpk
    #[arg(long, value_name = "W.safetensors")]
    checkpoint: PathBuf,
    /// Which weights, where a file has several sets: what stands before `encoder.` in their names,
    /// e.g. ema or policy.pi_features_extractor; default: the only ones, or those under
    /// model_state_dict, state_dict, model or weights
    #[arg(long, value_name = "KEY")]
    key: Option<String>,
    /// Where to write the encoder as an ONNX model (operator set 17)
    #[arg(long, value_name = "ENCODER.onnx", value_parser = super::values::parse_onnx_path)]
    onnx: PathBuf,
}

pub(super) fn convert(arguments: &ConvertArguments) -> Result<()> {
    let extension = arguments
        .to
        .extension()
        .unwrap_or_default()
        .to_string_lossy();
    let format = Format::from_extension(&extension).ok_or_else(|| {
        Error::input(format!(
            "unknown checkpoint format `.{extension}`; expected .safetensors, .pth or .bpk"
        ))
        .at(arguments.to.display())
    })?;
    atomic::check(&arguments.to)?;
    if files::is_same(&arguments.from, &arguments.to) {
        return Err(
            Error::input("the output is the input file; give another path")
                .at(arguments.to.display()),
        );
    }
    let checkpoint = read_checkpoint(&arguments.from, arguments.key.as_deref())?;
    atomic::write(&arguments.to, &checkpoint.to_bytes(format)?)?;
    report_written(&checkpoint, &arguments.to);
    Ok(())
}

pub(super) fn export(arguments: &ExportArguments) -> Result<()> {
    atomic::check(&arguments.onnx)?;
    let checkpoint = read_checkpoint(&arguments.checkpoint, arguments.key.as_deref())?;
    let model = checkpoint
        .to_onnx()
        .map_err(|e| e.at(arguments.checkpoint.display()))?;
    atomic::write(&arguments.onnx, &model)?;
    report_written(&checkpoint, &arguments.onnx);
    Ok(())
}

fn report_written(checkpoint: &Checkpoint, path: &Path) {
    eprintln!("{} written to {}", checkpoint.config.name(), path.display());
}

/// What is printed as JSON.
#[derive(Serialize)]
struct Inspection {
    format: Format,
    bytes: usize,
    #[serde(flatten)]
    summary: Summary,
    #[serde(skip_serializing_if = "Option::is_none")]
    plan: Option<Vec<PlannedLayer>>,
}

pub(super) fn inspect(arguments: &InspectArguments) -> Result<()> {
    let place = |e: Error| e.at(arguments.file.display());
    if let Some(model) = read_onnx(&arguments.file)? {
        if arguments.key.is_some() || arguments.plan.is_some() {
            let error = "--key and --plan are for checkpoints of tracklens, and this is an ONNX model; leave them out";
            return Err(place(Error::mismatch(error)));
        }
        return detector::inspect(&arguments.file, &model, arguments.json);
    }
    let Weights {
        checkpoint,
        format,
        bytes,
    } = read_weights(&arguments.file, arguments.key.as_deref())?;
    let plan = |size: [u32; 2]| CpuEncoder::new(&checkpoint)?.plan(size.map(|side| side as usize));
    let inspection = Inspection {
        format,
        bytes,
        summary: checkpoint.summary(),
        plan: arguments.plan.map(plan).transpose().map_err(place)?,
    };
    if arguments.json || !std::io::stdout().is_terminal() {
        say_json(&inspection, "summary")
    } else {
        print_table(&inspection)
    }
}

fn print_table(inspection: &Inspection) -> Result<()> {
    say_rows(rows(inspection))?;
    let Some(plan) = &inspection.plan else {
        return Ok(());
    };
    let mut table = comfy_table::Table::new();
    table.load_preset(NOTHING);
    table.set_header(["layer", "kernel", "gives", "multiplications", "done"]);
    for layer in plan {
        let millions = |count: u64| format!("{:.1} M", count as f64 * 1e-6);
        table.add_row([
            layer.name.clone(),
            layer.kernel.clone(),
            size(layer.size),
            millions(layer.defined),
            millions(layer.done),
        ]);
    }
    say!("\n{table}");
    Ok(())
}

fn size([width, height]: [usize; 2]) -> String {
    format!("{width} x {height}")
}

fn list(values: &[usize]) -> String {
    let values: Vec<String> = values.iter().map(usize::to_string).collect();
    values.join(", ")
}

fn rows(inspection: &Inspection) -> [(&'static str, String); 12] {
    let summary = &inspection.summary;
    let config = &summary.config;
    let input = config.input_size.map(size);
    let epoch = summary.epoch.map(|epoch| epoch.to_string());
    let parameters = &summary.parameters;
    [
        (
            "file",
            format!("{}, {} bytes", inspection.format, inspection.bytes),
        ),
        (
            "architecture",
            format!("{} ({})", summary.name, config.architecture.family),
        ),
        ("keypoints", config.keypoints.to_string()),
        ("modifications", modifications(config)),
        (
            "input",
            input.unwrap_or_else(|| "the size of the frames".to_owned()),
        ),
        ("target", size(config.target_size)),
        ("encoder", encoder(config)),
        ("decoder", decoder(summary)),
        (
            "parameters",
            format!(
                "{} (encoder {}, decoder {}), and {} statistics of batch norms",
                parameters.encoder + parameters.decoder,
                parameters.encoder,
                parameters.decoder,
                summary.buffers
            ),
        ),
        ("epoch", epoch.unwrap_or_default()),
        ("training", training(&summary.training)),
        ("other tensors", summary.other_tensors.join(", ")),
    ]
}

fn modifications(config: &SaeConfig) -> String {
    let modifications = [
        (config.architecture.velocity, "velocity loss"),
        (config.architecture.trained_sigma, "trained sigma"),
        (config.architecture.background, "background bias"),
        (config.trained_temperature, "trained temperature"),
    ];
    let on: Vec<&str> = modifications
        .iter()
        .filter(|(on, _)| *on)
        .map(|(_, name)| *name)
        .collect();
    match on.is_empty() {
        true => "none".to_owned(),
        false => on.join(", "),
    }
}

fn encoder(config: &SaeConfig) -> String {
    let [channels, kernels] = [&config.encoder_channels, &config.encoder_kernels].map(|v| list(v));
    let strides = match &config.encoder_strides[..] {
        [] => String::new(),
        strides => format!("; strides {}", list(strides)),
    };
    format!("channels {channels}; kernels {kernels}{strides}")
}

fn decoder(summary: &Summary) -> String {
    let config = &summary.config;
    if summary.parameters.decoder == 0 || config.decoder_channels.is_empty() {
        return String::new();
    }
    let [channels, kernels] = [&config.decoder_channels, &config.decoder_kernels].map(|v| list(v));
    format!("channels {channels}; kernels {kernels}")
}

fn training(training: &Training) -> String {
    let numbers = [
        ("epochs", training.epochs.map(|v| v.to_string())),
        ("batch", training.batch.map(|v| v.to_string())),
        (
            "learning rate",
            training.learning_rate.map(|v| v.to_string()),
        ),
        (
            "velocity weight",
            training.velocity_weight.map(|v| v.to_string()),
        ),
        ("noise", training.noise.map(|v| v.to_string())),
        ("seed", training.seed.map(|v| v.to_string())),
    ];
    let numbers: Vec<String> = numbers
        .into_iter()
        .filter_map(|(name, value)| Some(format!("{name} {}", value?)))
        .collect();
    numbers.join(", ")
}
