//! A whole training and its folder.

use std::collections::BTreeMap;
use std::fs::{self, File, OpenOptions};
use std::io::{Read as _, Seek as _, SeekFrom, Write as _};
use std::path::Path;
use std::time::Instant;

use burn::prelude::Device;
use rand::rngs::StdRng;
use rand::seq::SliceRandom as _;
use rand::{Rng as _, SeedableRng as _};
use rand_distr::StandardNormal;
use serde::Serialize;
use serde_json::Value;
use sha2::{Digest as _, Sha256};

use super::dataset::Fingerprint;
use super::digest::hex;
use super::events::Events;
use super::lock::RunLock;
use super::state::{self, Header, Progress, State};
use super::targets::TargetMoments;
use super::validation::Validation;
use super::{Dataset, SNIPPET, Sequence, Trainer};
use crate::atomic;
use crate::checkpoint::{BACKGROUND, Checkpoint};
use crate::device::Adapter;
use crate::error::{Error, ErrorKind, Result};
use crate::evaluation::EvaluationReport;
use crate::event::{Cancel, Event};
use crate::model::{OpenDevice, open, pointwise_encoder};
use crate::run::{
    BackgroundStart, CHECKPOINT_BEST, CHECKPOINT_FINAL, CONFIG, ColorError, EncoderStart, EpochLog,
    LOG, Losses, RunConfig, STATE, SUMMARY, TrainConfig, TrainSummary, read_log,
};

/// What to do with a folder that holds a run already.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Existing {
    /// Leave it and say so.
    Refuse,
    /// Go on after its last whole epoch; start where there is none.
    Resume,
}

/// How a run is kept, which changes nothing of what it computes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct RunOptions {
    /// What to do with a folder that holds a run already.
    pub existing: Existing,
    /// Also writes a TensorBoard event file: every number of `log.jsonl` that is no time.
    pub tensorboard: bool,
}

/// What a resumed run may change without computing something else than an uninterrupted one.
const MAY_CHANGE: [&str; 7] = [
    "version", "git_hash", "burn", "target", "threads", "adapter", "epochs",
];

/// Trains and writes the run in the folder of `lock`: `config.json`, `log.jsonl` (a line an epoch),
/// `checkpoint_best.safetensors` and `checkpoint_final.safetensors` (every epoch anew),
/// `state.safetensors` (what a resumed run starts from) and `summary.json`, and an event file if
/// asked for. Each file is whole at any moment; a run that ends anywhere goes on with
/// [`Existing::Resume`] and comes to the same weights as one that was never interrupted, bit by
/// bit, on the same machine with the same number of threads.
///
/// `weights` are what an untrained SAE starts from, of the configuration in `config` with the data
/// set's input size. When cancelled, the summary says so, and everything of the last whole epoch is
/// kept. It runs on the configured device; a GPU does not promise the same weights bit by bit.
///
/// # Errors
/// When the configuration or the data set does not allow training, the device is not there, the
/// folder holds a run already or cannot be written, or the loss is not finite (with the epoch and
/// what to try). A run is not resumed when its state is damaged, or when the state belongs to
/// another run, other frames or another ground truth.
pub fn train(
    config: &TrainConfig,
    dataset: &Dataset,
    weights: &Checkpoint,
    lock: &RunLock,
    options: RunOptions,
    report: &mut dyn FnMut(Event),
    cancel: &Cancel,
) -> Result<TrainSummary> {
    config.validate()?;
    let mut rng = StdRng::seed_from_u64(config.seed);
    let (training, validation) = split(dataset, config, &mut rng)?;
    let snippets = snippets(&training);
    let steps = steps(&snippets, training.len(), config)?;
    let OpenDevice { device, adapter } = open(config.device)?;
    let run = described(config, dataset, adapter, &training, &validation);
    let mut folder = RunFolder::open(lock.folder(), options, &run, &dataset.fingerprint)?;
    let resumed = folder.resumed.take();
    let moments = moments_used(config, resumed.is_some())
        .then(|| TargetMoments::of(dataset, &training, cancel))
        .transpose()?;
    let training = Training {
        trainer: trainer(config, &device, weights, resumed, moments.as_ref())?,
        validation: Validation::new(validation, config),
        config,
        dataset,
        snippets,
        steps,
        folder,
    };
    training.run(report, cancel)
}

/// Every two frames in a row that a training is shown: a sequence, and the first of the frames.
type Snippet<'a> = (&'a Sequence, usize);

fn snippets<'a>(training: &[&'a Sequence]) -> Vec<Snippet<'a>> {
    training
        .iter()
        .flat_map(|s| (0..s.snippets()).map(move |start| (*s, start)))
        .collect()
}

/// The steps of an epoch, of which there must be one.
fn steps(snippets: &[Snippet<'_>], sequences: usize, config: &TrainConfig) -> Result<usize> {
    let steps = match config.drop_last {
        true => snippets.len() / config.batch,
        false => snippets.len().div_ceil(config.batch),
    };
    if steps == 0 {
        return Err(Error::mismatch(format!(
            "{sequences} training sequences hold {} snippets of {SNIPPET} frames; a batch needs {}: give more \
             sequences or a smaller batch, or keep the last, smaller one",
            snippets.len(),
            config.batch
        )));
    }
    Ok(steps)
}

/// What `config.json` says of a run.
fn described(
    config: &TrainConfig,
    dataset: &Dataset,
    adapter: Option<Adapter>,
    training: &[&Sequence],
    validation: &[&Sequence],
) -> RunConfig {
    let names = |part: &[&Sequence]| part.iter().map(|s| s.name.clone()).collect::<Vec<_>>();
    RunConfig {
        version: env!("CARGO_PKG_VERSION").to_owned(),
        git_hash: option_env!("TRACKLENS_GIT_HASH").map(str::to_owned),
        burn: "0.22.1".to_owned(),
        target: format!("{}-{}", std::env::consts::ARCH, std::env::consts::OS),
        threads: rayon::current_num_threads(),
        adapter,
        train: config.clone(),
        input_size: dataset.input_size,
        objects: dataset.objects.clone(),
        training_sequences: names(training),
        validation_sequences: names(validation),
    }
}

/// Whether a training starts from the mean of its targets, which one that goes on has done.
fn starts_at_mean(config: &TrainConfig, goes_on: bool) -> bool {
    config.background == BackgroundStart::Mean && !goes_on
}

/// Whether a training draws its encoder anew, which one that goes on has done.
fn starts_pointwise(config: &TrainConfig, goes_on: bool) -> bool {
    config.encoder_start == EncoderStart::Pointwise && !goes_on
}

fn moments_used(config: &TrainConfig, goes_on: bool) -> bool {
    config.color_error != ColorError::Plain
        || starts_at_mean(config, goes_on)
        || starts_pointwise(config, goes_on)
}

/// The trainer of a run that starts from `weights`, or goes on from `resumed`.
fn trainer(
    config: &TrainConfig,
    device: &Device,
    weights: &Checkpoint,
    resumed: Option<State>,
    moments: Option<&TargetMoments>,
) -> Result<Trainer> {
    let goes_on = resumed.is_some();
    let at_mean = starts_at_mean(config, goes_on);
    let trainer = match resumed {
        Some(state) => {
            let mut trainer = Trainer::on(device, &state.weights, config.learning_rate)?;
            trainer.load_optimizer(state.optimizer)?;
            trainer
        }
        None => {
            let mut started = match moments {
                Some(moments) if at_mean => on_background(weights, &moments.mean)?,
                _ => weights.clone(),
            };
            if let Some(moments) = moments.filter(|_| starts_pointwise(config, goes_on)) {
                pointwise_encoder(&mut started, &moments.whitening()?, config.seed)?;
            }
            Trainer::on(device, &started, config.learning_rate)?
        }
    }
    .with_velocity_weight(config.velocity_weight)
    .with_encoder_learning_rate(config.encoder_learning_rate);
    let Some(moments) = moments else {
        return Ok(trainer);
    };
    Ok(match config.color_error {
        ColorError::Plain => trainer,
        ColorError::Whitened => trainer.with_color_transform(moments.whitening()?),
        ColorError::HalfWhitened => trainer.with_color_transform(moments.half_whitening()?),
    })
}

/// A training at work.
struct Training<'a> {
    config: &'a TrainConfig,
    dataset: &'a Dataset,
    snippets: Vec<Snippet<'a>>,
    /// Of an epoch.
    steps: usize,
    trainer: Trainer,
    validation: Validation<'a>,
    folder: RunFolder<'a>,
}

impl Training<'_> {
    fn run(mut self, report: &mut dyn FnMut(Event), cancel: &Cancel) -> Result<TrainSummary> {
        let start = Instant::now();
        let before = self.summary().seconds;
        let first = self.summary().epochs + 1;
        report(Event::Started {
            what: format!("training {}", self.config.sae.name()),
            total: u64::from(self.config.epochs) * self.steps as u64,
        });
        for epoch in first..=self.config.epochs {
            match self.epoch(epoch, report, cancel) {
                Ok((entry, evaluation)) => {
                    self.summary().seconds = before + start.elapsed().as_secs_f64();
                    self.folder
                        .finish_epoch(&self.trainer, self.config, entry, evaluation)?;
                }
                Err(e) if e.kind() == ErrorKind::Cancelled => {
                    self.summary().interrupted = true;
                    report(Event::Warning(format!(
                        "stopped in epoch {epoch}; what was reached after epoch {} is kept, and a resumed run goes \
                         on from there",
                        epoch - 1
                    )));
                    break;
                }
                Err(e) => return Err(e),
            }
        }
        self.summary().seconds = before + start.elapsed().as_secs_f64();
        let path = self.folder.path.join(SUMMARY);
        let summary = self.folder.header.progress.summary;
        write_json(&path, &summary)?;
        report(Event::Done);
        Ok(summary)
    }

    fn summary(&mut self) -> &mut TrainSummary {
        &mut self.folder.header.progress.summary
    }

    /// Trains and validates one epoch.
    fn epoch(
        &mut self,
        epoch: u32,
        report: &mut dyn FnMut(Event),
        cancel: &Cancel,
    ) -> Result<(EpochLog, EvaluationReport)> {
        let start = Instant::now();
        let training = self.steps_of(epoch, report, cancel)?;
        let outcome = self.validation.run(&self.trainer, self.dataset, cancel)?;
        let entry = EpochLog {
            epoch,
            seconds: start.elapsed().as_secs_f64(),
            training,
            validation: outcome.losses,
            tc: outcome.tc,
            errors: outcome.errors,
        };
        Ok((entry, outcome.evaluation))
    }

    /// The steps of an epoch, and their mean losses.
    fn steps_of(
        &mut self,
        epoch: u32,
        report: &mut dyn FnMut(Event),
        cancel: &Cancel,
    ) -> Result<Losses> {
        let config = self.config;
        let tracked = match &self.summary().last {
            Some(last) => format!(", TC {:.2}", last.tc),
            None => String::new(),
        };
        // A stream of its own for every epoch: what an epoch draws does not hang on how many came
        // before.
        let mut rng = StdRng::seed_from_u64(config.seed ^ (u64::from(epoch) << 32));
        let mut order = self.snippets.clone();
        order.shuffle(&mut rng);
        let mut sum = Losses::default();
        let first = u64::from(epoch - 1) * self.steps as u64 + 1;
        for (done, batch) in (first..).zip(order.chunks(config.batch).take(self.steps)) {
            cancel.check()?;
            let (inputs, targets) = gather(self.dataset, batch, config.noise, &mut rng)?;
            let losses = self
                .trainer
                .step(inputs, targets, self.dataset.input_size)
                .map_err(|e| diagnose(&e, epoch, config))?;
            sum.total += losses.total;
            sum.reconstruction += losses.reconstruction;
            sum.velocity += losses.velocity;
            let note = format!(
                "epoch {epoch}/{}, loss {:.5}{tracked}",
                config.epochs, losses.total
            );
            report(Event::Progress { done, note });
        }
        cancel.check()?;
        let mean = |v: f64| v / self.steps as f64;
        Ok(Losses {
            total: mean(sum.total),
            reconstruction: mean(sum.reconstruction),
            velocity: mean(sum.velocity),
        })
    }
}

/// The files of a run.
struct RunFolder<'a> {
    path: &'a Path,
    log: File,
    /// Of what is in the log so far.
    log_hash: Sha256,
    events: Option<Events>,
    header: Header,
    /// What a run that goes on starts from.
    resumed: Option<State>,
}

impl<'a> RunFolder<'a> {
    fn open(
        path: &'a Path,
        options: RunOptions,
        run: &RunConfig,
        data: &Fingerprint,
    ) -> Result<Self> {
        let has_state = path.join(STATE).exists();
        if options.existing == Existing::Refuse
            && (has_state || path.join(CHECKPOINT_FINAL).exists())
        {
            return Err(Error::input(format!(
                "{} holds a run already; resume it (--resume), give another folder, or delete it",
                path.display()
            )));
        }
        fs::create_dir_all(path).map_err(|e| Error::io(path.display(), &e))?;
        let resumed = match has_state {
            true => Some(state::load(path)?),
            false => None,
        };
        let progress = match &resumed {
            Some(state) => {
                same_run(path, &state.header, run, data)?;
                let mut progress = state.header.progress.clone();
                progress.summary.interrupted = false;
                progress
            }
            None => Progress {
                summary: TrainSummary {
                    version: env!("CARGO_PKG_VERSION").to_owned(),
                    interrupted: false,
                    epochs: 0,
                    best_epoch: 0,
                    seconds: 0.0,
                    last: None,
                    evaluation: None,
                },
                best: None,
                log_bytes: 0,
                log_sha256: hex(Sha256::new()),
            },
        };
        let (log, log_hash) = open_log(path, &progress)?;
        write_json(&path.join(CONFIG), run)?;
        let events = match options.tensorboard {
            true => {
                let log_path = path.join(LOG);
                let log = fs::read(&log_path).map_err(|e| Error::io(log_path.display(), &e))?;
                let (past, broken) = read_log(&log);
                if let Some(error) = broken {
                    return Err(error.at(log_path.display()));
                }
                Some(Events::create(path, &past)?)
            }
            false => None,
        };
        Ok(Self {
            path,
            log,
            log_hash,
            events,
            header: Header {
                run: as_value(run)?,
                data: data.clone(),
                progress,
            },
            resumed,
        })
    }

    /// Writes what an epoch came to. The state comes last: until it is there, the epoch has not
    /// happened.
    fn finish_epoch(
        &mut self,
        trainer: &Trainer,
        config: &TrainConfig,
        entry: EpochLog,
        evaluation: EvaluationReport,
    ) -> Result<()> {
        let mut line = serde_json::to_vec(&entry).map_err(|e| unwritable(&e))?;
        line.push(b'\n');
        self.log
            .write_all(&line)
            .and_then(|()| self.log.sync_data())
            .map_err(|e| Error::io(self.path.join(LOG).display(), &e))?;
        if let Some(events) = &mut self.events {
            events.write(&entry)?;
        }
        let progress = &mut self.header.progress;
        progress.log_bytes += line.len() as u64;
        self.log_hash.update(&line);
        progress.log_sha256 = hex(self.log_hash.clone());
        let is_best = progress
            .best
            .is_none_or(|best| entry.validation.total < best);
        if is_best {
            progress.best = Some(entry.validation.total);
            progress.summary.best_epoch = entry.epoch;
        }
        let metadata = BTreeMap::from([
            (
                "tracklens.training".to_owned(),
                serde_json::to_string(config).map_err(|e| unwritable(&e))?,
            ),
            (
                "tracklens.version".to_owned(),
                env!("CARGO_PKG_VERSION").to_owned(),
            ),
            ("tracklens.epoch".to_owned(), entry.epoch.to_string()),
        ]);
        let checkpoint = trainer.checkpoint(metadata)?.to_safetensors()?;
        if is_best {
            atomic::write(&self.path.join(CHECKPOINT_BEST), &checkpoint)?;
        }
        atomic::write(&self.path.join(CHECKPOINT_FINAL), &checkpoint)?;
        progress.summary.epochs = entry.epoch;
        progress.summary.last = Some(entry);
        progress.summary.evaluation = Some(evaluation);
        state::save(self.path, trainer, &self.header)
    }
}

/// The log, ready for the next line, and the hash of what is in it. A line of an epoch that was not
/// finished is cut off; the epoch runs again.
fn open_log(folder: &Path, progress: &Progress) -> Result<(File, Sha256)> {
    let path = folder.join(LOG);
    let failed = |e: std::io::Error| Error::io(path.display(), &e);
    let mut log = OpenOptions::new()
        .create(true)
        .truncate(false)
        .read(true)
        .write(true)
        .open(&path)
        .map_err(failed)?;
    let mut past = Vec::new();
    (&log)
        .take(progress.log_bytes)
        .read_to_end(&mut past)
        .map_err(failed)?;
    if (past.len() as u64) < progress.log_bytes {
        return Err(Error::input(format!(
            "the log has {} bytes, {} when its last epoch ended; was it edited? Start again in \
             another folder",
            past.len(),
            progress.log_bytes
        ))
        .at(path.display()));
    }
    let hash = Sha256::new_with_prefix(&past);
    if hex(hash.clone()) != progress.log_sha256 {
        return Err(Error::input(format!(
            "the log is not the one that {} belongs to: it was edited, or one of them comes from \
             another run; start again in another folder",
            STATE
        ))
        .at(path.display()));
    }
    log.set_len(progress.log_bytes).map_err(failed)?;
    log.seek(SeekFrom::End(0)).map_err(failed)?;
    Ok((log, hash))
}

/// `config.json` as it is read. Through text: an f32 turns into the digits that are in the file.
fn as_value(run: &RunConfig) -> Result<Value> {
    serde_json::to_string(run)
        .and_then(|json| serde_json::from_str(&json))
        .map_err(|e| unwritable(&e))
}

/// Checks that a state belongs to a run that computes the same as `run`, on the same data.
fn same_run(folder: &Path, state: &Header, run: &RunConfig, data: &Fingerprint) -> Result<()> {
    let mut differences = Vec::new();
    compare("", &state.run, &as_value(run)?, &mut differences);
    let refused = |what: String| Err(Error::mismatch(what).at(folder.join(STATE).display()));
    if !differences.is_empty() {
        return refused(format!(
            "is of another run: {}; resume with what it was started with",
            differences.join(", ")
        ));
    }
    for (name, there, here) in [
        ("frames", &state.data.frames, &data.frames),
        ("ground truth", &state.data.truth, &data.truth),
    ] {
        if there != here {
            return refused(format!(
                "the {name} changed since the run was started; resume with the data it was started \
                 with, or start again in another folder"
            ));
        }
    }
    let reached = state.progress.summary.epochs;
    if reached > run.train.epochs {
        return Err(Error::mismatch(format!(
            "{} has come to epoch {reached}; expected at least as many epochs, not {}",
            folder.display(),
            run.train.epochs
        )));
    }
    Ok(())
}

/// Collects in words where two configurations differ.
fn compare(at: &str, there: &Value, here: &Value, differences: &mut Vec<String>) {
    if let (Value::Object(there), Value::Object(here)) = (there, here) {
        for key in there
            .keys()
            .chain(here.keys().filter(|k| !there.contains_key(*k)))
        {
            if !(at.is_empty() && MAY_CHANGE.contains(&key.as_str())) {
                let at = if at.is_empty() {
                    key.clone()
                } else {
                    format!("{at}.{key}")
                };
                let value = |map: &serde_json::Map<String, Value>| {
                    map.get(key).cloned().unwrap_or_default()
                };
                compare(&at, &value(there), &value(here), differences);
            }
        }
    } else if there != here {
        differences.push(match (there, here) {
            (Value::Array(_), _) | (_, Value::Array(_)) => format!("`{at}` differs"),
            _ => format!("`{at}` is {there} there and {here} here"),
        });
    }
}

/// Training and validation sequences.
fn split<'a>(
    dataset: &'a Dataset,
    config: &TrainConfig,
    rng: &mut StdRng,
) -> Result<(Vec<&'a Sequence>, Vec<&'a Sequence>)> {
    let groups = dataset.groups(config.split_by)?;
    let parts = config
        .split
        .divide(groups.len(), |order| order.shuffle(rng))?;
    let take = |part: &[usize]| {
        let members = part.iter().flat_map(|group| &groups[*group]);
        members.map(|i| &dataset.sequences[*i]).collect()
    };
    Ok((take(&parts.training), take(&parts.validation)))
}

/// `weights` with a background that, with the bias of the decoder's last convolution, is `mean`.
fn on_background(weights: &Checkpoint, mean: &[f64]) -> Result<Checkpoint> {
    let mut weights = weights.clone();
    let layers = weights.config.decoder_layers();
    let last = layers
        .last()
        .ok_or_else(|| Error::input("the decoder has no convolution"))?;
    let bias = weights.tensor(&format!("{}.bias", last.name))?.data.clone();
    let background = weights.tensor_mut(BACKGROUND)?;
    let plane = mean.len() / bias.len();
    for ((value, mean), i) in background.data.iter_mut().zip(mean).zip(0..) {
        *value = (mean - f64::from(bias[i / plane])) as f32;
    }
    Ok(weights)
}

/// Inputs, with noise, and targets of snippets.
fn gather(
    dataset: &Dataset,
    snippets: &[(&Sequence, usize)],
    noise: f32,
    rng: &mut StdRng,
) -> Result<(Vec<f32>, Vec<f32>)> {
    let frames: Vec<(&Sequence, usize)> = snippets
        .iter()
        .flat_map(|(sequence, start)| (*start..start + SNIPPET).map(move |t| (*sequence, t)))
        .collect();
    let (mut inputs, targets) = dataset.gather(&frames)?;
    if noise > 0.0 {
        for value in &mut inputs {
            *value += noise * rng.sample::<f32, _>(StandardNormal);
        }
    }
    Ok((inputs, targets))
}

fn diagnose(error: &Error, epoch: u32, config: &TrainConfig) -> Error {
    if error.kind() != ErrorKind::Numeric {
        return error.clone();
    }
    let kept = match epoch {
        1 => "No epoch was finished",
        _ => "The checkpoints of the last whole epoch are kept",
    };
    Error::numeric(format!(
        "in epoch {epoch} {error}: the training diverged at learning rate {:e}; try a smaller one (the paper's is 1e-3) \
         or a larger batch than {}. {kept}",
        config.learning_rate, config.batch
    ))
}

fn write_json(path: &Path, value: &impl Serialize) -> Result<()> {
    let mut json = serde_json::to_vec_pretty(value).map_err(|e| unwritable(&e))?;
    json.push(b'\n');
    atomic::write(path, &json)
}

fn unwritable(error: &serde_json::Error) -> Error {
    Error::new(ErrorKind::Io, format!("not to be written as JSON: {error}"))
}
