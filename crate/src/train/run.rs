//! A whole training and its folder.

use std::collections::BTreeMap;
use std::fs::{self, File};
use std::io::Write as _;
use std::path::Path;
use std::time::Instant;

use rand::rngs::StdRng;
use rand::seq::SliceRandom as _;
use rand::{Rng as _, SeedableRng as _};
use rand_distr::StandardNormal;
use serde::{Deserialize, Serialize};

use super::{Dataset, Losses, SNIPPET, Sequence, TrainConfig, Trainer};
use crate::atomic;
use crate::error::{Error, ErrorKind, Result};
use crate::event::{Cancel, Event};
use crate::metric::{Accumulator, NonFinite, Object, Settings};
use crate::model::{fresh_weights, points_xy};
use crate::report::EvaluationReport;

/// Snippets of the validation sequences that pass the encoder together.
const VALIDATION_BATCH: usize = 32;

/// One line of `log.jsonl`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct EpochLog {
    /// Counted from 1.
    pub epoch: u32,
    /// Wall time of the epoch, training and validation.
    pub seconds: f64,
    /// Means over the steps.
    pub training: Losses,
    /// On the validation sequences.
    pub validation: Losses,
    /// Tracking capability on the validation sequences (affine map, fitted and scored on the same frames).
    pub tc: f64,
    /// Tracking error of the best keypoint of every object there; null when it is visible nowhere.
    pub errors: BTreeMap<String, Option<f64>>,
}

/// What a training came to; `summary.json`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct TrainSummary {
    /// The version that trained.
    pub version: String,
    /// Whether it was cancelled before its last epoch.
    pub interrupted: bool,
    /// Whole epochs done.
    pub epochs: u32,
    /// The epoch with the lowest validation loss: `checkpoint_best.safetensors`.
    pub best_epoch: u32,
    /// Wall time.
    pub seconds: f64,
    /// The last epoch: `checkpoint_final.safetensors`.
    pub last: Option<EpochLog>,
    /// The metric of the last epoch in full.
    pub evaluation: Option<EvaluationReport>,
}

#[derive(Serialize)]
struct RunConfig<'a> {
    version: &'static str,
    #[serde(flatten)]
    train: &'a TrainConfig,
    input_size: [usize; 2],
    objects: &'a [String],
    training_sequences: Vec<&'a str>,
    validation_sequences: Vec<&'a str>,
}

/// Trains and writes the run folder `out`: `config.json`, `log.jsonl` (a line an epoch), `checkpoint_best.safetensors`
/// and `checkpoint_final.safetensors` (every epoch anew, each whole or not at all), `summary.json`.
///
/// When cancelled, the weights of that moment are saved as the final checkpoint and the summary says so.
///
/// # Errors
/// When the configuration or the data set does not allow training, the folder holds a run already or cannot be written,
/// or the loss is not finite (with the epoch and what to try).
pub fn train(
    config: &TrainConfig,
    dataset: &Dataset,
    out: &Path,
    report: &mut dyn FnMut(Event),
    cancel: &Cancel,
) -> Result<TrainSummary> {
    config.validate()?;
    let mut rng = StdRng::seed_from_u64(config.seed);
    let (training, validation) = split(dataset, config, &mut rng)?;
    let snippets: Vec<(&Sequence, usize)> = training
        .iter()
        .flat_map(|s| (0..s.snippets()).map(move |start| (*s, start)))
        .collect();
    let steps = snippets.len() / config.batch;
    if steps == 0 {
        return Err(Error::mismatch(format!(
            "{} training sequences hold {} snippets of {SNIPPET} frames; a batch needs {}: give more sequences or a \
             smaller batch",
            training.len(),
            snippets.len(),
            config.batch
        )));
    }
    create_folder(out)?;
    write_json(
        &out.join("config.json"),
        &RunConfig {
            version: env!("CARGO_PKG_VERSION"),
            train: config,
            input_size: dataset.input_size,
            objects: &dataset.objects,
            training_sequences: training.iter().map(|s| s.name.as_str()).collect(),
            validation_sequences: validation.iter().map(|s| s.name.as_str()).collect(),
        },
    )?;
    let log_path = out.join("log.jsonl");
    let mut log = File::create(&log_path).map_err(|e| Error::io(log_path.display(), &e))?;

    // The input size belongs to the weights from here on: extraction resizes to it.
    let mut sae = config.sae.clone();
    sae.input_size = Some(dataset.input_size);
    let mut trainer = Trainer::new(&fresh_weights(&sae, config.seed), config.learning_rate)?;
    let training_json = serde_json::to_string(config).map_err(|e| unwritable(&e))?;
    let save = |trainer: &Trainer, name: &str, epoch: u32| {
        let metadata = BTreeMap::from([
            ("tracklens.training".to_owned(), training_json.clone()),
            (
                "tracklens.version".to_owned(),
                env!("CARGO_PKG_VERSION").to_owned(),
            ),
            ("tracklens.epoch".to_owned(), epoch.to_string()),
        ]);
        atomic::write(&out.join(name), &trainer.checkpoint(metadata)?.to_safetensors()?)
    };

    let start = Instant::now();
    let total = u64::from(config.epochs) * steps as u64;
    report(Event::Started {
        what: format!("training {}", config.sae.architecture),
        total,
    });
    let mut summary = TrainSummary {
        version: env!("CARGO_PKG_VERSION").to_owned(),
        interrupted: false,
        epochs: 0,
        best_epoch: 0,
        seconds: 0.0,
        last: None,
        evaluation: None,
    };
    let mut best = f64::INFINITY;
    let mut done = 0;
    for epoch in 1..=config.epochs {
        let epoch_start = Instant::now();
        // A stream of its own for every epoch: what an epoch draws does not hang on how many came before.
        let mut rng = StdRng::seed_from_u64(config.seed ^ (u64::from(epoch) << 32));
        let mut order = snippets.clone();
        order.shuffle(&mut rng);
        let mut sum = Losses::default();
        for batch in order.chunks_exact(config.batch) {
            if cancel.is_cancelled() {
                summary.interrupted = true;
                break;
            }
            let (inputs, targets) = gather(dataset, batch, Some((config.noise, &mut rng)))?;
            let losses = trainer
                .step(inputs, targets, dataset.input_size)
                .map_err(|e| diagnose(&e, epoch, config))?;
            sum.total += losses.total;
            sum.reconstruction += losses.reconstruction;
            sum.velocity += losses.velocity;
            done += 1;
            let tracked = summary
                .last
                .as_ref()
                .map(|l| format!(", TC {:.2}", l.tc))
                .unwrap_or_default();
            let note = format!(
                "epoch {epoch}/{}, loss {:.5}{tracked}",
                config.epochs, losses.total
            );
            report(Event::Progress { done, note });
        }
        if summary.interrupted {
            report(Event::Warning(format!(
                "stopped in epoch {epoch}; the weights of this moment are saved"
            )));
            save(&trainer, "checkpoint_final.safetensors", summary.epochs)?;
            break;
        }
        let mean = |v: f64| v / steps as f64;
        let (validation_losses, evaluation) = validate(&trainer, dataset, &validation)?;
        let entry = EpochLog {
            epoch,
            seconds: epoch_start.elapsed().as_secs_f64(),
            training: Losses {
                total: mean(sum.total),
                reconstruction: mean(sum.reconstruction),
                velocity: mean(sum.velocity),
            },
            validation: validation_losses,
            tc: evaluation.tc,
            errors: evaluation
                .objects
                .iter()
                .map(|o| (o.name.clone(), o.error))
                .collect(),
        };
        save(&trainer, "checkpoint_final.safetensors", epoch)?;
        if entry.validation.total < best {
            best = entry.validation.total;
            summary.best_epoch = epoch;
            save(&trainer, "checkpoint_best.safetensors", epoch)?;
        }
        let line = serde_json::to_string(&entry).map_err(|e| unwritable(&e))?;
        writeln!(log, "{line}")
            .and_then(|()| log.sync_data())
            .map_err(|e| Error::io(log_path.display(), &e))?;
        summary.epochs = epoch;
        summary.last = Some(entry);
        summary.evaluation = Some(evaluation);
    }
    summary.seconds = start.elapsed().as_secs_f64();
    write_json(&out.join("summary.json"), &summary)?;
    report(Event::Done);
    Ok(summary)
}

/// Training and validation sequences.
fn split<'a>(
    dataset: &'a Dataset,
    config: &TrainConfig,
    rng: &mut StdRng,
) -> Result<(Vec<&'a Sequence>, Vec<&'a Sequence>)> {
    let parts = config
        .split
        .divide(dataset.sequences.len(), |order| order.shuffle(rng))?;
    let take = |part: &[usize]| part.iter().map(|i| &dataset.sequences[*i]).collect();
    Ok((take(&parts.training), take(&parts.validation)))
}

/// Inputs and targets of snippets, with noise on the inputs where it is given.
fn gather(
    dataset: &Dataset,
    batch: &[(&Sequence, usize)],
    noise: Option<(f32, &mut StdRng)>,
) -> Result<(Vec<f32>, Vec<f32>)> {
    let (mut inputs, targets) = dataset.gather(batch)?;
    if let Some((deviation, rng)) = noise
        && deviation > 0.0
    {
        for value in &mut inputs {
            *value += deviation * rng.sample::<f32, _>(StandardNormal);
        }
    }
    Ok((inputs, targets))
}

/// Losses over all snippets, and the metric over the first frame of each (as the authors evaluate).
fn validate(
    trainer: &Trainer,
    dataset: &Dataset,
    sequences: &[&Sequence],
) -> Result<(Losses, EvaluationReport)> {
    let sae = trainer.valid();
    let snippets: Vec<(&Sequence, usize)> = sequences
        .iter()
        .flat_map(|s| (0..s.snippets()).map(move |start| (*s, start)))
        .collect();
    let mut sum = Losses::default();
    let mut accumulator: Option<Accumulator> = None;
    for batch in snippets.chunks(VALIDATION_BATCH) {
        let (inputs, targets) = gather(dataset, batch, None)?;
        let (output, losses) = trainer.evaluate(&sae, inputs, targets, dataset.input_size)?;
        let share = batch.len() as f64 / snippets.len() as f64;
        sum.total += share * losses.total;
        sum.reconstruction += share * losses.reconstruction;
        sum.velocity += share * losses.velocity;
        let points = points_xy(output.latent)?;
        let accumulator = accumulator
            .get_or_insert_with(|| Accumulator::new(points.dim().1, dataset.objects.len(), NonFinite::Error));
        for ((sequence, start), keypoints) in batch.iter().zip(points.outer_iter().step_by(SNIPPET)) {
            accumulator.push(keypoints, sequence.truth_ndc(*start))?;
        }
    }
    let accumulator = accumulator.ok_or_else(|| Error::numeric("there is no snippet to validate on"))?;
    let objects: Vec<Object> = dataset
        .objects
        .iter()
        .map(Object::with_default_threshold)
        .collect();
    let evaluation = accumulator.finish().evaluate(&objects, &Settings::default())?;
    Ok((sum, EvaluationReport::new(&evaluation, None, None)))
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
        "{error} in epoch {epoch}: the training diverged at learning rate {:e}; try a smaller one (the paper's is 1e-3) \
         or a larger batch than {}. {kept}",
        config.learning_rate, config.batch
    ))
}

fn create_folder(out: &Path) -> Result<()> {
    if out.join("checkpoint_final.safetensors").exists() {
        return Err(Error::input(format!(
            "{} holds a run already; give another folder, or delete it",
            out.display()
        )));
    }
    fs::create_dir_all(out).map_err(|e| Error::io(out.display(), &e))
}

fn write_json(path: &Path, value: &impl Serialize) -> Result<()> {
    let mut json = serde_json::to_vec_pretty(value).map_err(|e| unwritable(&e))?;
    json.push(b'\n');
    atomic::write(path, &json)
}

fn unwritable(error: &serde_json::Error) -> Error {
    Error::new(ErrorKind::Io, format!("not to be written as JSON: {error}"))
}
