//! Thresholds from JavaScript.

use std::collections::BTreeMap;

use crate::error::Result;
use crate::evaluation::{Threshold, Thresholds};

/// Thresholds by the name of the object.
pub fn thresholds(given: BTreeMap<String, f64>) -> Result<Thresholds> {
    let given = given.into_iter();
    let given = given.map(|(object, value)| Threshold::new(object, value));
    Thresholds::new(given.collect::<Result<Vec<_>>>()?)
}
