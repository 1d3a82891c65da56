//! What an epoch is judged by: losses and metric on the validation sequences.

use std::collections::BTreeMap;

use rand::SeedableRng as _;
use rand::rngs::StdRng;
use rand::seq::SliceRandom as _;

use super::{Dataset, SNIPPET, Sequence, Trainer};
use crate::error::{Error, Result};
use crate::evaluation::EvaluationReport;
use crate::event::Cancel;
use crate::metric::{Accumulator, NonFinite, Object, Settings, Transform};
use crate::model::points_xy;
use crate::run::{Losses, TrainConfig, ValidationFrames};

/// Frames that pass the autoencoder together.
const BATCH: usize = 32;

/// The frames that count, and how often.
pub(super) struct Validation<'a> {
    sequences: Vec<&'a Sequence>,
    /// The snippets that count for the losses, by sequence and first frame.
    snippets: Vec<(usize, usize)>,
    frames: ValidationFrames,
    velocity_weight: f64,
}

/// The outcome of one epoch.
pub(super) struct Outcome {
    pub losses: Losses,
    /// By the map, then by the object.
    pub errors: BTreeMap<String, BTreeMap<String, Option<f64>>>,
    /// The TC with the affine map.
    pub tc: f64,
    /// With the affine map.
    pub evaluation: EvaluationReport,
}

impl<'a> Validation<'a> {
    /// The snippets of `sequences`. With `drop_last` as many as fill whole batches, drawn once by
    /// the seed: the authors' loader shuffles them in an order that stays the same from epoch to
    /// epoch.
    pub fn new(sequences: Vec<&'a Sequence>, config: &TrainConfig) -> Self {
        let mut snippets: Vec<(usize, usize)> = sequences
            .iter()
            .enumerate()
            .flat_map(|(i, s)| (0..s.snippets()).map(move |start| (i, start)))
            .collect();
        let whole = snippets.len() / config.batch * config.batch;
        if config.drop_last && whole > 0 {
            snippets.shuffle(&mut StdRng::seed_from_u64(config.seed));
            snippets.truncate(whole);
            snippets.sort_unstable();
        }
        Self {
            sequences,
            snippets,
            frames: config.validation_frames,
            velocity_weight: config.velocity_weight,
        }
    }

    /// Runs every frame once. A frame's loss counts once for each snippet it is in, as if they ran
    /// one by one.
    pub fn run(&self, trainer: &Trainer, dataset: &Dataset, cancel: &Cancel) -> Result<Outcome> {
        let sae = trainer.valid();
        let keypoints = trainer.config().keypoints;
        let mut metric = Accumulator::new(keypoints, dataset.objects.len(), NonFinite::Error);
        let (mut reconstruction, mut velocity) = (0.0, 0.0);
        for (s, sequence) in self.sequences.iter().enumerate() {
            cancel.check()?;
            let starts: Vec<usize> = self
                .snippets
                .iter()
                .filter(|(owner, _)| *owner == s)
                .map(|(_, start)| *start)
                .collect();
            let all: Vec<(&Sequence, usize)> =
                (0..sequence.len()).map(|t| (*sequence, t)).collect();
            let (mut points, mut losses) = (Vec::new(), Vec::new());
            for batch in all.chunks(BATCH) {
                let (inputs, targets) = dataset.gather(batch)?;
                let (output, loss) = trainer.evaluate(&sae, inputs, targets, dataset.input_size)?;
                points.extend(points_xy(output.latent)?.outer_iter().map(|p| p.to_owned()));
                losses.extend(loss);
            }
            for &start in &starts {
                reconstruction +=
                    losses[start..start + SNIPPET].iter().sum::<f64>() / SNIPPET as f64;
                let [a, b, c] = [0, 1, 2].map(|t| &points[start + t]);
                let change = c + a - 2.0 * b;
                velocity += change.mapv(|v| v * v).mean().unwrap_or_default();
            }
            let scored: Vec<usize> = match self.frames {
                ValidationFrames::First => starts,
                ValidationFrames::All => (0..sequence.len()).collect(),
            };
            for t in scored {
                metric.push(points[t].view(), sequence.truth_ndc(t))?;
            }
        }
        if self.snippets.is_empty() {
            return Err(Error::numeric("there is no snippet to validate on"));
        }
        let count = self.snippets.len() as f64;
        let losses = Losses::new(
            reconstruction / count,
            velocity / count,
            self.velocity_weight,
        );

        let objects: Vec<Object> = dataset
            .objects
            .iter()
            .map(Object::with_default_threshold)
            .collect();
        let moments = metric.finish();
        let mut errors = BTreeMap::new();
        for &transform in Transform::ALL {
            let settings = Settings {
                transform,
                ..Settings::default()
            };
            let report = EvaluationReport::new(&moments.evaluate(&objects, &settings)?, None, None);
            let by_object = report.objects.iter().map(|o| (o.name.clone(), o.error));
            errors.insert(transform.name().to_owned(), by_object.collect());
        }
        let evaluation = moments.evaluate(&objects, &Settings::default())?;
        Ok(Outcome {
            losses,
            errors,
            tc: evaluation.tracking_capability,
            evaluation: EvaluationReport::new(&evaluation, None, None),
        })
    }
}
