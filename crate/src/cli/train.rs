//! `tracklens train`.

use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};

use clap::Args;
use serde::de::DeserializeOwned;

use super::device::open_and_tell;
use super::extract::{cancel_on_interrupt, progress_bar, show};
use super::files::{EPISODES, TruthArguments};
use crate::checkpoint::{Checkpoint, SaeConfig};
use crate::data::parse_episodes;
use crate::device::DeviceKind;
use crate::error::{Error, Result};
use crate::event::{Cancel, Event};
use crate::metric::Transform;
use crate::model::{fresh_weights, load_first_layer, load_weights};
use crate::run::{
    BackgroundStart, ColorError, EncoderStart, FirstLayer, Preset, Split, SplitBy, StartWeights,
    TargetFilter, TrainConfig, TrainSummary, ValidationFrames,
};
use crate::sweep::architecture_named;
use crate::train::{Dataset, Existing, RunLock, RunOptions, train};
use crate::weights::read;

#[derive(Debug, Args)]
pub(super) struct TrainArguments {
    /// Folder of image sequences, one folder a sequence (PNG, JPEG, WebP), or a recording (.npz,
    /// .hdf5, .zarr)
    #[arg(long, value_name = "PATH")]
    data: PathBuf,
    /// Ground truth for the metric of every epoch; default: ground_truth.csv in the data folder, or
    /// the points of the recording
    #[arg(long, value_name = "GT.csv")]
    truth: Option<PathBuf>,
    #[command(flatten)]
    reading: TruthArguments,
    /// Memory for decoded frames, e.g. 512MiB or 16GiB; what does not fit is decoded again whenever
    /// it is needed
    #[arg(long, value_name = "SIZE", default_value = "4GiB", value_parser = parse_bytes)]
    cache: u64,
    /// Options that are known to work: `small-cpu`, a small keynet-vel-std-bg that two cores train
    /// to track small coloured objects (docs/training-log.md). It splits by episode, 0.9,0.1.
    /// Options that are given count more; the defaults below are those without a preset
    #[arg(long, value_name = "NAME", value_parser = named::<Preset>)]
    preset: Option<Preset>,
    /// Architecture: basic, basic-kp32, dsae, keynet; basic and keynet with any of -vel, -std, -bg
    /// (e.g. keynet-vel-std-bg); default: basic
    #[arg(long, value_name = "NAME", value_parser = architecture_named)]
    arch: Option<SaeConfig>,
    /// Run folder to write; must not hold a run yet, unless it is resumed
    #[arg(long, value_name = "RUN_DIR")]
    out: PathBuf,
    /// Passes over the training sequences; default: 500
    #[arg(long)]
    epochs: Option<u32>,
    /// Seeds weights, split, order and noise
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// Snippets of three frames a step; default: 32
    #[arg(long)]
    batch: Option<usize>,
    /// Adam's learning rate; default: 0.001
    #[arg(long)]
    learning_rate: Option<f64>,
    /// Adam's learning rate for the encoder, which keeps what it sees from the start when it is
    /// smaller; default: that of the decoder
    #[arg(long)]
    encoder_learning_rate: Option<f64>,
    /// Standard deviation of the noise on the input; default: 0.001
    #[arg(long)]
    noise: Option<f32>,
    /// Shares of the sequences for training and validation (the rest stays unseen), or `reference`:
    /// the authors' numpy split into half, quarter and quarter (`reference:SEED` for another numpy
    /// seed than 0); default: 0.5,0.25
    #[arg(long, value_name = "TRAIN,VAL")]
    split: Option<Split>,
    /// What the split keeps together: the frames of a `sequence`, or the sequences of an `episode`,
    /// as sequences.csv with the data has them (columns sequence and episode); default: sequence
    #[arg(long, value_name = "UNIT", value_parser = named::<SplitBy>)]
    split_by: Option<SplitBy>,
    /// Weight of the velocity loss; default: 0.1 with -vel and for dsae, otherwise 0
    #[arg(long, value_name = "WEIGHT")]
    velocity_weight: Option<f64>,
    /// Also train and validate on the snippets that do not fill a batch; the authors' code leaves
    /// them out
    #[arg(long)]
    keep_last: bool,
    /// Frames of the validation sequences for the metric: `first` of every snippet, as in the
    /// authors' code, or `all`; default: first
    #[arg(long, value_name = "WHICH", value_parser = named::<ValidationFrames>)]
    validation_frames: Option<ValidationFrames>,
    /// How targets are resized: `bilinear` (no antialiasing, as the authors' torchvision), or
    /// `bilinear-antialias`; default: bilinear
    #[arg(long, value_name = "FILTER", value_parser = named::<TargetFilter>)]
    target_filter: Option<TargetFilter>,
    /// How colours are compared: `plain`, the mean squared error of the paper, `whitened`, by the
    /// covariance of the colours that move, in which small coloured objects count as much as large
    /// grey ones, or `half-whitened`, between the two; default: plain
    #[arg(long, value_name = "ERROR", value_parser = named::<ColorError>)]
    color_error: Option<ColorError>,
    /// What the background of -bg starts from: `zero`, as in the paper, or the `mean` of the
    /// training targets, which small networks need to find small objects; default: zero
    #[arg(long, value_name = "START", value_parser = named::<BackgroundStart>)]
    background: Option<BackgroundStart>,
    /// How the encoder is drawn: `drawn`, as the authors' code, or `pointwise`, as a random filter of
    /// colours that sees one pixel at a time, which finds objects of few pixels; default: drawn
    #[arg(long, value_name = "START", value_parser = named::<EncoderStart>)]
    encoder_start: Option<EncoderStart>,
    /// Start from the first convolution of a trained network (.safetensors, .pth, .bpk), as the
    /// authors' DSAE starts from that of torchvision's DenseNet-201; default: drawn as the other
    /// layers
    #[arg(long, value_name = "WEIGHTS", conflicts_with = "encoder_start")]
    first_layer: Option<PathBuf>,
    /// Start from all weights of a checkpoint with encoder and decoder (.safetensors, .pth, .bpk)
    /// of the same architecture and sizes, e.g. of a run on other recordings; default: drawn from
    /// the seed
    #[arg(long, value_name = "CHECKPOINT", conflicts_with_all = ["first_layer", "background", "encoder_start"])]
    weights: Option<PathBuf>,
    /// Also write a TensorBoard event file into the run folder
    #[arg(long)]
    tensorboard: bool,
    /// Go on after the last whole epoch of the run in the folder; start one where there is none
    #[arg(long)]
    resume: bool,
    #[command(flatten)]
    sizes: SizeArguments,
    /// What computes; gpu needs a build with the feature `gpu`
    #[arg(long, value_enum, default_value_t = DeviceKind::Cpu)]
    device: DeviceKind,
    /// Threads; default: all cores
    #[arg(long, value_name = "N")]
    threads: Option<NonZeroUsize>,
    /// No progress bar
    #[arg(long)]
    quiet: bool,
}

/// A value by its name in `config.json`.
fn named<T: DeserializeOwned>(name: &str) -> Result<T> {
    serde_json::from_value(name.into()).map_err(|e| Error::input(e.to_string()))
}

/// What differs from the paper's configuration of the architecture.
#[derive(Debug, Args)]
#[command(next_help_heading = "Sizes (default: the paper's for the architecture)")]
struct SizeArguments {
    /// Number of keypoints
    #[arg(long, value_name = "N")]
    keypoints: Option<usize>,
    /// Output channels of the encoder: basic 32,64,128; dsae 64,32; keynet 32,64,128,256
    #[arg(long, value_name = "A,B,…", value_delimiter = ',')]
    encoder_channels: Option<Vec<usize>>,
    /// Kernel sizes of the encoder: basic 3,3,3 (one a block); dsae 7,5,5; keynet 7,3 (the first,
    /// all others)
    #[arg(long, value_name = "A,B,…", value_delimiter = ',')]
    encoder_kernels: Option<Vec<usize>>,
    /// Strides of the encoder's blocks, each 1 or 2; keynet 1,2,2,2 (basic and dsae take none)
    #[arg(long, value_name = "A,B,…", value_delimiter = ',')]
    encoder_strides: Option<Vec<usize>>,
    /// Output channels of the decoder: basic 64,32,16; keynet 256,128,64
    #[arg(long, value_name = "A,B,…", value_delimiter = ',')]
    decoder_channels: Option<Vec<usize>>,
    /// Kernel sizes of the decoder: basic 3,3,3; keynet 3
    #[arg(long, value_name = "A,B,…", value_delimiter = ',')]
    decoder_kernels: Option<Vec<usize>>,
    /// Side that frames are resized to before the encoder; default: their own size
    #[arg(long, value_name = "PIXELS")]
    input_size: Option<usize>,
    /// Side of the reconstruction; default: 64
    #[arg(long, value_name = "PIXELS")]
    target_size: Option<usize>,
    /// (Initial) temperature of the softmax; default: 1
    #[arg(long, value_name = "T")]
    temperature: Option<f64>,
    /// Train the temperature (dsae does)
    #[arg(long, value_name = "BOOL", num_args = 0..=1, default_missing_value = "true")]
    train_temperature: Option<bool>,
    /// (Initial) standard deviation of the decoder's Gaussian maps; default: 0.1
    #[arg(long)]
    sigma: Option<f64>,
    /// A standard deviation for every keypoint; with -std
    #[arg(long)]
    sigma_per_keypoint: bool,
    /// Standard deviations beyond which Gaussian maps are 0; default: no limit
    #[arg(long, value_name = "FACTOR")]
    sigma_limit: Option<f64>,
}

impl SizeArguments {
    fn apply(&self, to: &SaeConfig) -> SaeConfig {
        let square = |side: usize| [side, side];
        let list = |given: &Option<Vec<usize>>, default: &Vec<usize>| {
            given.as_ref().unwrap_or(default).clone()
        };
        SaeConfig {
            architecture: to.architecture,
            keypoints: self.keypoints.unwrap_or(to.keypoints),
            encoder_channels: list(&self.encoder_channels, &to.encoder_channels),
            encoder_kernels: list(&self.encoder_kernels, &to.encoder_kernels),
            encoder_strides: list(&self.encoder_strides, &to.encoder_strides),
            decoder_channels: list(&self.decoder_channels, &to.decoder_channels),
            decoder_kernels: list(&self.decoder_kernels, &to.decoder_kernels),
            input_size: self.input_size.map(square).or(to.input_size),
            target_size: self.target_size.map_or(to.target_size, square),
            temperature: self.temperature.unwrap_or(to.temperature),
            trained_temperature: self.train_temperature.unwrap_or(to.trained_temperature),
            sigma: self.sigma.unwrap_or(to.sigma),
            sigma_per_keypoint: self.sigma_per_keypoint || to.sigma_per_keypoint,
            sigma_limit: self.sigma_limit.or(to.sigma_limit),
        }
    }
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
    found.ok_or_else(|| {
        Error::input(format!(
            "`{text}` is not a size; expected e.g. 512MiB or 4GiB"
        ))
    })
}

/// The sequences and their episodes, from the file in a folder of frames or next to a recording.
pub(super) fn episodes(data: &Path) -> Result<Vec<(String, String)>> {
    let folder = match data.is_dir() {
        true => data,
        false => data.parent().unwrap_or(data),
    };
    let path = folder.join(EPISODES);
    if !path.is_file() {
        return Err(Error::input(format!(
            "a split by episode needs the file {}; expected a table with the columns `sequence` and `episode`, as \
             tools/panda_push/record.py writes it, or `--split-by sequence` where no two sequences share an episode",
            path.display()
        )));
    }
    parse_episodes(&read(&path)?).map_err(|e| e.at(path.display()))
}

impl TrainArguments {
    /// What to train: the paper's settings or those of the preset, but for what is given.
    ///
    /// # Errors
    /// When the preset has no settings for the architecture, or a value is not allowed.
    pub(super) fn config(&self) -> Result<TrainConfig> {
        let sae = match (&self.arch, self.preset) {
            (Some(sae), _) => sae.clone(),
            (None, Some(preset)) => SaeConfig::named(preset.architecture())?,
            (None, None) => SaeConfig::named("basic")?,
        };
        let base = match self.preset {
            Some(preset) => preset.config(&sae)?,
            None => TrainConfig::new(sae),
        };
        // Weights of another network take the place of what a preset starts from.
        let background = match &self.weights {
            Some(_) => BackgroundStart::Zero,
            None => base.background,
        };
        let encoder_start = match self.weights.as_ref().or(self.first_layer.as_ref()) {
            Some(_) => EncoderStart::Drawn,
            None => base.encoder_start,
        };
        let config = TrainConfig {
            sae: self.sizes.apply(&base.sae),
            epochs: self.epochs.unwrap_or(base.epochs),
            seed: self.seed,
            batch: self.batch.unwrap_or(base.batch),
            learning_rate: self.learning_rate.unwrap_or(base.learning_rate),
            encoder_learning_rate: self.encoder_learning_rate.or(base.encoder_learning_rate),
            noise: self.noise.unwrap_or(base.noise),
            split: self.split.unwrap_or(base.split),
            split_by: self.split_by.unwrap_or(base.split_by),
            drop_last: !self.keep_last,
            validation_frames: self.validation_frames.unwrap_or(base.validation_frames),
            target_filter: self.target_filter.unwrap_or(base.target_filter),
            velocity_weight: self.velocity_weight.unwrap_or(base.velocity_weight),
            color_error: self.color_error.unwrap_or(base.color_error),
            background: self.background.unwrap_or(background),
            encoder_start: self.encoder_start.unwrap_or(encoder_start),
            first_layer: None,
            weights: None,
            device: self.device,
        };
        config.validate()?;
        Ok(config)
    }

    /// Frames and truth, read as the training needs them.
    fn dataset(&self, config: &TrainConfig, cancel: &Cancel) -> Result<Dataset> {
        let frames = self.reading.open(&self.data)?;
        let truth = self.reading.need_in_image(
            self.truth.as_deref(),
            &self.data,
            &*frames,
            "the metric of every epoch",
        )?;
        eprintln!("reading {} frames", frames.index().keys().len());
        let dataset = Dataset::load(frames, &truth.points, config, self.cache, cancel)?;
        let dataset = match config.split_by {
            SplitBy::Episode => dataset.with_episodes(&episodes(&self.data)?)?,
            SplitBy::Sequence => dataset,
        };
        for notice in &dataset.notices {
            eprintln!("note: {notice}");
        }
        Ok(dataset)
    }

    /// The weights to start from; `config` learns which files they come from.
    fn start(&self, config: &mut TrainConfig, input_size: [usize; 2]) -> Result<Checkpoint> {
        // The input size belongs to the weights from here on: extraction resizes to it.
        let mut sae = config.sae.clone();
        sae.input_size = Some(input_size);
        let mut weights = fresh_weights(&sae, config.seed);
        if let Some(path) = &self.first_layer {
            let bytes = read(path)?;
            let tensor =
                load_first_layer(&mut weights, &bytes).map_err(|e| e.at(path.display()))?;
            eprintln!(
                "note: the first layer starts from `{tensor}` of {}",
                path.display()
            );
            config.first_layer = Some(FirstLayer {
                tensor,
                crc32: crc32fast::hash(&bytes),
            });
        }
        if let Some(path) = &self.weights {
            let bytes = read(path)?;
            load_weights(&mut weights, &bytes).map_err(|e| e.at(path.display()))?;
            eprintln!("note: the weights start from those of {}", path.display());
            config.weights = Some(StartWeights {
                crc32: crc32fast::hash(&bytes),
            });
        }
        Ok(weights)
    }
}

pub(super) fn run(arguments: &TrainArguments) -> Result<()> {
    arguments.config()?;
    run_in(&RunLock::take(&arguments.out)?, arguments)
}

/// Trains in a folder that nobody else works in.
pub(super) fn run_in(lock: &RunLock, arguments: &TrainArguments) -> Result<()> {
    let mut config = arguments.config()?;
    // Before the long work: a GPU that is not there should not cost minutes.
    open_and_tell(config.device)?;
    if let Some(threads) = arguments.threads {
        rayon::ThreadPoolBuilder::new()
            .num_threads(threads.get())
            .build_global()
            .map_err(|e| Error::input(format!("{threads} threads cannot be started: {e}")))?;
    }
    let cancel = cancel_on_interrupt()?;
    let dataset = arguments.dataset(&config, &cancel)?;
    let weights = arguments.start(&mut config, dataset.input_size)?;
    let bar = progress_bar(arguments.quiet);
    let summary = train(
        &config,
        &dataset,
        &weights,
        lock,
        RunOptions {
            existing: match arguments.resume {
                true => Existing::Resume,
                false => Existing::Refuse,
            },
            tensorboard: arguments.tensorboard,
        },
        &mut |event: Event| show(&bar, &event),
        &cancel,
    )?;
    tell(&summary);
    eprintln!("written to {}", lock.folder().display());
    if summary.interrupted {
        return Err(Error::cancelled().at(format!("after {} whole epochs", summary.epochs)));
    }
    Ok(())
}

/// Says on the terminal what a training came to.
fn tell(summary: &TrainSummary) {
    for warning in summary.evaluation.iter().flat_map(|e| &e.warnings) {
        eprintln!("warning: on the validation sequences, {warning}");
    }
    let Some(last) = &summary.last else {
        return;
    };
    let errors: Vec<String> = last
        .errors
        .get(Transform::Affine.name())
        .into_iter()
        .flatten()
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
