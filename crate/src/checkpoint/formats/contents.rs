//! What every format holds.

use std::collections::BTreeMap;

use super::choice::Choice;
use crate::checkpoint::Tensor;

/// What a file holds: weights by name, and what it says about itself.
#[derive(Debug, Default)]
pub struct Contents {
    pub tensors: BTreeMap<String, Tensor>,
    pub metadata: BTreeMap<String, String>,
    /// Tensors that are no floating-point weights, and what they are instead. Nothing is wrong with
    /// them unless they are needed.
    pub left_out: BTreeMap<String, String>,
}

/// The metadata that says which of several sets of weights was read.
const WEIGHTS_KEY: &str = "tracklens.weights";

impl Contents {
    /// Notes which weights were read, where there are others.
    pub fn chosen(mut self, choice: &Choice) -> Self {
        if let Some(told) = choice.told() {
            self.metadata.insert(WEIGHTS_KEY.to_owned(), told);
        }
        self
    }
}
