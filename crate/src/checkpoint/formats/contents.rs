//! What every format holds.

use std::collections::BTreeMap;

use crate::checkpoint::Tensor;

/// What a file holds: weights by name, and what it says about itself.
#[derive(Debug)]
pub struct Contents {
    pub tensors: BTreeMap<String, Tensor>,
    pub metadata: BTreeMap<String, String>,
}
