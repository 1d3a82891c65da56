//! Which sequences are for training, validation and testing.

use std::collections::HashSet;
use std::str::FromStr;

use rand_mt::Mt;
use serde::{Deserialize, Serialize};

use crate::error::{Error, Result};

/// What a split keeps together.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum SplitBy {
    /// The frames of a sequence.
    #[default]
    Sequence,
    /// The sequences of an episode, which share what the episode drew once, e.g. its target.
    Episode,
}

impl SplitBy {
    /// Whether it is [`SplitBy::Sequence`].
    pub fn is_sequence(&self) -> bool {
        *self == Self::Sequence
    }
}

/// How sequences are divided: always whole sequences, since frames of one are too alike.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub enum Split {
    /// As the authors' `loading.py`: the order of `np.random.seed(seed); np.random.choice(n, n,
    /// replace=False)`, of which the first half is for training, the next quarter for validation
    /// and the rest for testing. Of the paper's 1000 sequences these are 500, 250 and 250, with
    /// seed 0.
    #[serde(rename = "reference")]
    Reference {
        /// numpy's seed; the authors' `dataset.seed`.
        seed: u32,
    },
    /// Shares of the sequences, drawn by the seed of the training; what is left is for testing.
    #[serde(untagged)]
    Shares {
        /// Share for training, above 0.
        training: f64,
        /// Share for validation, above 0.
        validation: f64,
    },
}

/// Positions of sequences, divided.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Parts {
    /// To train on.
    pub training: Vec<usize>,
    /// To look at during training.
    pub validation: Vec<usize>,
    /// Never looked at.
    pub testing: Vec<usize>,
}

impl Split {
    /// Checks that the shares make sense.
    ///
    /// # Errors
    /// Says what is allowed.
    pub fn validate(&self) -> Result<()> {
        match *self {
            Self::Shares {
                training,
                validation,
            } if !(training > 0.0 && validation > 0.0 && training + validation <= 1.0 + 1e-9) => {
                Err(Error::input(format!(
                    "the split is {training}, {validation}; expected two positive shares that add up to at most 1"
                )))
            }
            _ => Ok(()),
        }
    }

    /// Divides `sequences` sequences. `shuffle` orders them where shares are drawn.
    ///
    /// # Errors
    /// When there are fewer than two.
    pub fn divide(&self, sequences: usize, shuffle: impl FnOnce(&mut [usize])) -> Result<Parts> {
        let small = u32::try_from(sequences).ok().filter(|n| *n >= 2);
        let Some(small) = small else {
            return Err(Error::mismatch(format!(
                "{sequences} sequence to train and validate on; expected at least 2, since frames of one sequence are \
                 too alike"
            )));
        };
        let (mut order, training, validation) = match *self {
            Self::Reference { seed } => {
                let order = numpy_permutation(small, seed);
                // Of 2 or 3 sequences a quarter is none.
                (order, sequences / 2, (sequences / 4).max(1))
            }
            Self::Shares {
                training,
                validation,
            } => {
                let mut order: Vec<usize> = (0..sequences).collect();
                shuffle(&mut order);
                let count = |share: f64| (share * sequences as f64).round() as usize;
                let training = count(training).clamp(1, sequences - 1);
                (
                    order,
                    training,
                    count(validation).clamp(1, sequences - training),
                )
            }
        };
        let testing = order.split_off(training + validation);
        let mut validation = order.split_off(training);
        if matches!(self, Self::Shares { .. }) {
            validation.sort_unstable();
        }
        Ok(Parts {
            training: order,
            validation,
            testing,
        })
    }
}

impl FromStr for Split {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        let wrong = || {
            Error::input(format!(
                "`{text}` is no split; expected two shares, e.g. 0.5,0.25, or `reference` (the authors' split, numpy \
                 seed 0) or `reference:SEED`"
            ))
        };
        match text.trim().split_once(':') {
            None if text.trim() == "reference" => return Ok(Self::Reference { seed: 0 }),
            Some(("reference", seed)) => {
                let seed = seed.trim().parse().map_err(|_| wrong())?;
                return Ok(Self::Reference { seed });
            }
            _ => {}
        }
        let (training, validation) = text.split_once(',').ok_or_else(wrong)?;
        let share = |text: &str| text.trim().parse::<f64>().map_err(|_| wrong());
        Ok(Self::Shares {
            training: share(training)?,
            validation: share(validation)?,
        })
    }
}

/// Parses `sequences.csv`, the columns `sequence` and `episode`: the names of both, a sequence a row.
///
/// # Errors
/// When a column is missing, a row is damaged or a sequence has two rows.
pub fn parse_episodes(bytes: &[u8]) -> Result<Vec<(String, String)>> {
    let mut reader = csv::ReaderBuilder::new()
        .trim(csv::Trim::All)
        .from_reader(bytes);
    let damaged = |e: csv::Error| Error::input(format!("not a readable CSV file: {e}"));
    let header = reader.headers().map_err(damaged)?.clone();
    let column = |name: &str| {
        header
            .iter()
            .position(|field| field == name)
            .ok_or_else(|| {
                Error::input(format!(
                    "there is no column `{name}`; expected the columns `sequence` and `episode`"
                ))
            })
    };
    let (sequence, episode) = (column("sequence")?, column("episode")?);
    let mut rows: Vec<(String, String)> = Vec::new();
    let mut seen = HashSet::new();
    for record in reader.records() {
        let record = record.map_err(damaged)?;
        let [sequence, episode] = [sequence, episode].map(|i| record[i].to_owned());
        if !seen.insert(sequence.clone()) {
            return Err(Error::input(format!(
                "sequence `{sequence}` has two rows; expected one"
            )));
        }
        rows.push((sequence, episode));
    }
    Ok(rows)
}

/// The order of `np.random.seed(seed); np.random.permutation(count)`, bit for bit, in any version
/// of numpy: its legacy generator is frozen. `np.random.choice(count, size, replace=False)` is its
/// first `size`.
pub fn numpy_permutation(count: u32, seed: u32) -> Vec<usize> {
    let mut generator = Mt::new(seed);
    let mut order: Vec<usize> = (0..count as usize).collect();
    for last in (1..count).rev() {
        // numpy's `random_interval`: masked 32-bit draws, those above are thrown away.
        let mask = u32::MAX >> last.leading_zeros();
        let other = loop {
            let drawn = generator.next_u32() & mask;
            if drawn <= last {
                break drawn;
            }
        };
        order.swap(last as usize, other as usize);
    }
    order
}
