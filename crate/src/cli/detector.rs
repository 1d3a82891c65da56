//! Detectors that are ONNX models: what the options say of them, and what they are.

use std::io::IsTerminal as _;
use std::path::Path;

use clap::Args;
use serde::Serialize;

use super::terminal::{say_json, say_rows};
use crate::atomic;
use crate::detector::{
    Channels, Columns, Decoding, Graph, InputSize, Layout, Normalization, OnnxExtractor,
    OutputKind, Plan, Port, Settings, Unit,
};
use crate::error::{Error, Result};
use crate::weights::{model_settings, settings_path};

#[derive(Debug, Args)]
#[command(next_help_heading = "Detectors as ONNX models, where the model does not say it")]
pub(super) struct DetectorArguments {
    /// Size that frames are resized to: WxH, or `frame` for their own; default: that of the model
    #[arg(long, value_name = "SIZE", value_parser = parse_input_size)]
    input_size: Option<InputSize>,
    /// Where the channels of the input are: nchw or nhwc; default: what its shape says
    #[arg(long, value_name = "LAYOUT")]
    layout: Option<Layout>,
    /// What the channels are: rgb, bgr or gray; default: rgb, or gray where there is one
    #[arg(long, value_name = "ORDER")]
    channels: Option<Channels>,
    /// How pixels are scaled: fraction (0 to 1), symmetric (-1 to +1), bytes (0 to 255), or imagenet
    /// (its mean and standard deviation)
    #[arg(long, value_name = "SCALE", conflicts_with_all = ["mean", "std"])]
    normalize: Option<Normalization>,
    /// Subtracted from pixels of 0 to 1: red, green, blue, or one number for all
    #[arg(
        long,
        value_name = "NUMBERS",
        value_delimiter = ',',
        allow_hyphen_values = true
    )]
    mean: Option<Vec<f32>>,
    /// Pixels less the mean are divided by it
    #[arg(long, value_name = "NUMBERS", value_delimiter = ',')]
    std: Option<Vec<f32>>,
    /// What comes out: heatmaps, points or simcc (two profiles a keypoint); default: what the shapes
    /// say
    #[arg(long, value_name = "KIND")]
    output: Option<OutputKind>,
    /// The outputs that count; of SimCC that of x, then that of y
    #[arg(long, value_name = "NAMES", value_delimiter = ',')]
    output_names: Option<Vec<String>>,
    /// How a map becomes a point: argmax (with a parabola through its neighbours) or softargmax;
    /// default: argmax, or softargmax with --temperature
    #[arg(long, value_name = "HOW")]
    decode: Option<Decoding>,
    /// Maps are divided by it before the soft-argmax; default: 1
    #[arg(long, value_name = "T")]
    temperature: Option<f64>,
    /// Unit of points: px (of the input), fraction (0 to 1) or ndc (-1 to +1)
    #[arg(long, value_name = "UNIT")]
    unit: Option<Unit>,
    /// What the numbers of a point are: xy, yx, xyc, yxc (c: confidence) or xyz
    #[arg(long, value_name = "COLUMNS")]
    columns: Option<Columns>,
    /// Write what these options say to a file beside the model (model.onnx.json), which is read from
    /// then on
    #[arg(long)]
    remember: bool,
}

fn parse_input_size(text: &str) -> Result<InputSize> {
    match text {
        "frame" => Ok(InputSize::Frame),
        _ => {
            let size = super::values::parse_size(text)?;
            Ok(InputSize::Fixed(size.map(|side| side as usize)))
        }
    }
}

impl DetectorArguments {
    /// Opens the model `bytes` of `path` with these options and what lies beside it.
    pub fn open(&self, path: &Path, bytes: Vec<u8>, quiet: bool) -> Result<OnnxExtractor> {
        let beside = settings_path(path);
        let settings = model_settings(path, self.settings())?;
        if self.remember {
            atomic::check(&beside)?;
        }
        let extractor = OnnxExtractor::new(bytes, &settings).map_err(|e| e.at(path.display()))?;
        if !quiet {
            eprintln!("note: {}: {}", path.display(), extractor.plan());
        }
        if self.remember {
            let json = settings.to_json()?;
            atomic::write(&beside, format!("{json}\n").as_bytes())?;
            eprintln!("settings written to {}", beside.display());
        }
        Ok(extractor)
    }

    /// Checks that no option is given for a checkpoint that says everything itself.
    pub fn check_unused(&self) -> Result<()> {
        match self.settings() == Settings::default() && !self.remember {
            true => Ok(()),
            false => Err(Error::mismatch(
                "the options for ONNX models say nothing of a checkpoint of tracklens; leave them out",
            )),
        }
    }

    fn settings(&self) -> Settings {
        let [mean, std] = match self.normalize {
            Some(normalization) => normalization.numbers().map(Some),
            None => [self.mean.clone(), self.std.clone()],
        };
        Settings {
            input_size: self.input_size,
            layout: self.layout,
            channels: self.channels,
            mean,
            std,
            output: self.output,
            output_names: self.output_names.clone(),
            decode: self.decode,
            temperature: self.temperature,
            unit: self.unit,
            columns: self.columns,
        }
    }
}

/// What is printed of a model as JSON.
#[derive(Serialize)]
struct Inspection<'a> {
    format: &'static str,
    bytes: usize,
    #[serde(flatten)]
    graph: &'a Graph,
    /// How it is run on frames, in words.
    #[serde(skip_serializing_if = "Option::is_none")]
    runs: Option<String>,
    /// Why it cannot be run as it is, in words.
    #[serde(skip_serializing_if = "Option::is_none")]
    open: Option<String>,
}

/// Prints what the model `bytes` of `path` says of itself, and how it is run with what lies beside
/// it.
///
/// # Errors
/// When it is no model that can be run, whatever is said of it.
pub(super) fn inspect(path: &Path, bytes: &[u8], json: bool) -> Result<()> {
    let graph = Graph::read(bytes).map_err(|e| e.at(path.display()))?;
    let plan = Plan::new(&graph, &model_settings(path, Settings::default())?);
    let inspection = Inspection {
        format: "onnx",
        bytes: bytes.len(),
        runs: plan.as_ref().ok().map(Plan::to_string),
        open: plan.err().map(|e| e.to_string()),
        graph: &graph,
    };
    if json || !std::io::stdout().is_terminal() {
        say_json(&inspection, "summary")
    } else {
        say_rows(rows(&inspection))
    }
}

fn rows(inspection: &Inspection) -> [(&'static str, String); 8] {
    let graph = inspection.graph;
    let join = |texts: Vec<String>| texts.join(", ");
    [
        ("file", format!("ONNX, {} bytes", inspection.bytes)),
        ("operator set", graph.opset.to_string()),
        ("input", graph.input.to_string()),
        (
            "outputs",
            join(graph.outputs.iter().map(Port::to_string).collect()),
        ),
        ("operators", join(graph.operators.iter().cloned().collect())),
        ("metadata", join(graph.metadata.keys().cloned().collect())),
        ("runs", inspection.runs.clone().unwrap_or_default()),
        ("open", inspection.open.clone().unwrap_or_default()),
    ]
}
