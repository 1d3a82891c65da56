//! Which runs are of one data set, so that their errors can be compared.

use std::sync::Arc;

use super::run::Run;
use crate::run::{RunConfig, Split};

/// Runs of one data set, and why they are kept apart from those before.
#[derive(Debug, Clone)]
pub struct DataSet {
    /// The runs.
    pub runs: Vec<Arc<Run>>,
    /// Two runs, and why their errors cannot be compared; `None` for the first data set.
    pub reason: Option<String>,
}

/// Puts runs of one data set together: the same objects and sequences, as far as their
/// configurations show.
pub fn data_sets(runs: Vec<Arc<Run>>) -> Vec<DataSet> {
    let mut sets: Vec<DataSet> = Vec::new();
    for run in runs {
        let mut reason = None;
        let place = sets.iter().position(|set| {
            // The first stands for all; those of its seed can be compared name by name.
            let (first, rest) = (&set.runs[..1], &set.runs[1..]);
            let alike = rest.iter().filter(|other| other.seed == run.seed);
            let found = first.iter().chain(alike).find_map(|other| {
                let why = other.differs(&run)?;
                Some(format!("{} and {}: {why}", other.name, run.name))
            });
            let belongs = found.is_none();
            reason = found.or(reason.take());
            belongs
        });
        match place {
            Some(place) => sets[place].runs.push(run),
            None => sets.push(DataSet {
                runs: vec![run],
                reason,
            }),
        }
    }
    sets
}

impl Run {
    /// Why the errors of two runs cannot be compared, if so.
    fn differs(&self, other: &Self) -> Option<String> {
        if self.objects != other.objects {
            let [a, b] = [self, other].map(|run| run.objects.join(", "));
            return Some(format!("they are of different objects: {a}, and {b}"));
        }
        let (a, b) = match (&self.config, &other.config) {
            (Some(a), Some(b)) => (a, b),
            (None, None) => {
                let map = |run: &Self| run.evaluation.as_ref().map(|e| e.transform.clone());
                let (a, b) = (map(self)?, map(other)?);
                return (a != b)
                    .then(|| format!("one is scored under the map `{a}`, the other under `{b}`"));
            }
            _ => {
                return Some(
                    "one is scored on its validation sequences, the other on the frames here"
                        .to_owned(),
                );
            }
        };
        let sizes = |c: &RunConfig| [c.training_sequences.len(), c.validation_sequences.len()];
        if sizes(a) != sizes(b) {
            let [a, b] = [a, b].map(|c| sizes(c).map(|n| n.to_string()).join(" + "));
            return Some(format!(
                "their counts of training and validation sequences differ: {a}, and {b}"
            ));
        }
        // One seed splits one data set in one way.
        let split = |c: &RunConfig| {
            let seed = matches!(c.train.split, Split::Shares { .. }).then_some(c.train.seed);
            (seed, c.train.split, c.version.clone())
        };
        let names = |c: &RunConfig| (c.training_sequences.clone(), c.validation_sequences.clone());
        if split(a) == split(b) && names(a) != names(b) {
            return Some("with one seed and split they are of different sequences".to_owned());
        }
        let known =
            |c: &RunConfig| [c.training_sequences.clone(), c.validation_sequences.clone()].concat();
        let (a, b) = (known(a), known(b));
        let shared = a.is_empty() || a.iter().any(|name| b.contains(name));
        (!shared).then(|| "they have no sequence in common".to_owned())
    }
}
