//! `tracklens train`.

use std::num::NonZeroUsize;
use std::path::PathBuf;

use clap::Args;

use super::extract::{cancel_on_interrupt, progress_bar, show};
use super::files::TruthArguments;
use crate::checkpoint::{Architecture, SaeConfig};
use crate::error::{Error, Result};
use crate::event::Event;
use crate::train::{Dataset, Split, TrainConfig, train};

#[derive(Debug, Args)]
pub(super) struct TrainArguments {
    /// Folder of image sequences, one folder a sequence (PNG, JPEG, WebP), or a recording (.npz, .hdf5)
    #[arg(long, value_name = "PATH")]
    data: PathBuf,
    /// Ground truth for the metric of every epoch; default: ground_truth.csv in the data folder, or the points of the
    /// recording
    #[arg(long, value_name = "GT.csv")]
    truth: Option<PathBuf>,
    #[command(flatten)]
    reading: TruthArguments,
    /// Memory for decoded frames, e.g. 512MiB or 16GiB; what does not fit is decoded again whenever it is needed
    #[arg(long, value_name = "SIZE", default_value = "4GiB", value_parser = parse_bytes)]
    cache: u64,
    /// Architecture: basic, with any of -vel, -std, -bg (e.g. basic-vel-std-bg)
    #[arg(long, default_value = "basic")]
    arch: Architecture,
    /// Run folder to write; must not hold a run yet
    #[arg(long, value_name = "RUN_DIR")]
    out: PathBuf,
    /// Passes over the training sequences
    #[arg(long, default_value_t = 500)]
    epochs: u32,
    /// Seeds weights, split, order and noise
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// Snippets of three frames a step
    #[arg(long, default_value_t = 32)]
    batch: usize,
    /// Adam's learning rate
    #[arg(long, default_value_t = 1e-3)]
    learning_rate: f64,
    /// Standard deviation of the noise on the input
    #[arg(long, default_value_t = 1e-3)]
    noise: f32,
    /// Shares of the sequences for training and validation (the rest stays unseen), or `reference`: the authors'
    /// numpy split into half, quarter and quarter (`reference:SEED` for another numpy seed than 0)
    #[arg(long, value_name = "TRAIN,VAL", default_value = "0.5,0.25")]
    split: Split,
    /// Number of keypoints
    #[arg(long, default_value_t = 16)]
    keypoints: usize,
    /// Output channels of the encoder's blocks
    #[arg(long, value_name = "A,B,C", default_value = "32,64,128", value_parser = parse_channels)]
    encoder_channels: [usize; 3],
    /// Output channels of the decoder's convolutions
    #[arg(long, value_name = "A,B,C", default_value = "64,32,16", value_parser = parse_channels)]
    decoder_channels: [usize; 3],
    /// Side that frames are resized to before the encoder; default: their own size
    #[arg(long, value_name = "PIXELS")]
    input_size: Option<usize>,
    /// Side of the reconstruction
    #[arg(long, value_name = "PIXELS", default_value_t = 64)]
    target_size: usize,
    /// Standard deviation of the decoder's Gaussian maps (initial value with -std)
    #[arg(long, default_value_t = 0.1)]
    sigma: f64,
    /// Threads; default: all cores
    #[arg(long, value_name = "N")]
    threads: Option<NonZeroUsize>,
    /// No progress bar
    #[arg(long)]
    quiet: bool,
}

fn parse_channels(text: &str) -> Result<[usize; 3]> {
    let counts: Option<Vec<usize>> = text.split(',').map(|c| c.trim().parse().ok()).collect();
    counts.and_then(|c| c.try_into().ok()).ok_or_else(|| {
        Error::input(format!(
            "`{text}` is no list of channel counts; expected three, e.g. 32,64,128"
        ))
    })
}

/// A number of bytes, with a unit of 1024 or none.
fn parse_bytes(text: &str) -> Result<u64> {
    let units = [("KiB", 10), ("MiB", 20), ("GiB", 30), ("TiB", 40), ("", 0)];
    let found = units.iter().find_map(|(unit, bits)| {
        let number: f64 = text.strip_suffix(unit)?.trim().parse().ok()?;
        (0.0..1e6)
            .contains(&number)
            .then_some((number * f64::from(*bits).exp2()) as u64)
    });
    found.ok_or_else(|| Error::input(format!("`{text}` is no size; expected e.g. 512MiB or 4GiB")))
}

impl TrainArguments {
    fn config(&self) -> TrainConfig {
        TrainConfig {
            sae: SaeConfig {
                architecture: self.arch,
                keypoints: self.keypoints,
                encoder_channels: self.encoder_channels,
                decoder_channels: self.decoder_channels,
                input_size: self.input_size.map(|side| [side, side]),
                target_size: [self.target_size, self.target_size],
                sigma: self.sigma,
            },
            epochs: self.epochs,
            seed: self.seed,
            batch: self.batch,
            learning_rate: self.learning_rate,
            noise: self.noise,
            split: self.split,
        }
    }
}

pub(super) fn run(arguments: &TrainArguments) -> Result<()> {
    let config = arguments.config();
    config.validate()?;
    if let Some(threads) = arguments.threads {
        rayon::ThreadPoolBuilder::new()
            .num_threads(threads.get())
            .build_global()
            .map_err(|e| Error::input(format!("{threads} threads cannot be started: {e}")))?;
    }
    let frames = arguments.reading.open(&arguments.data)?;
    let truth = arguments.reading.need(
        arguments.truth.as_deref(),
        &arguments.data,
        &*frames,
        "the metric of every epoch",
    )?;
    let cancel = cancel_on_interrupt()?;
    eprintln!("reading {} frames", frames.index().keys().len());
    let dataset = Dataset::load(frames, &truth, &config.sae, arguments.cache, &cancel)?;
    for notice in &dataset.notices {
        eprintln!("note: {notice}");
    }
    let bar = progress_bar(arguments.quiet);
    let mut report = |event: Event| show(&bar, &event);
    let summary = train(&config, &dataset, &arguments.out, &mut report, &cancel)?;
    for warning in summary.evaluation.iter().flat_map(|e| &e.warnings) {
        eprintln!("warning: on the validation sequences, {warning}");
    }
    if let Some(last) = &summary.last {
        let errors: Vec<String> = last
            .errors
            .iter()
            .map(|(name, error)| match error {
                Some(error) => format!("{name} {error:.4}"),
                None => format!("{name} not visible"),
            })
            .collect();
        eprintln!(
            "epoch {}: TC {:.3} on the validation sequences; errors: {}",
            last.epoch,
            last.tc,
            errors.join(", ")
        );
    }
    eprintln!("written to {}", arguments.out.display());
    if summary.interrupted {
        return Err(Error::cancelled().at(format!("after {} whole epochs", summary.epochs)));
    }
    Ok(())
}
