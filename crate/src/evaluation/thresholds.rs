//! Thresholds on tracking errors, by object.

use std::fmt;
use std::str::FromStr;

use crate::error::{Error, Result};
use crate::metric::{Object, default_threshold};

const EXPECTED: &str = "expected NAME=VALUE with a number above 0, e.g. cube=0.015";

/// The threshold of one object, `NAME=VALUE` as text. A name may hold anything; in double quotes it
/// is taken as it is.
#[derive(Debug, Clone, PartialEq)]
pub struct Threshold {
    object: String,
    value: f64,
}

impl Threshold {
    /// A threshold on the mean squared distance (ndc) of `object`.
    ///
    /// # Errors
    /// When `value` is not a positive number.
    pub fn new(object: impl Into<String>, value: f64) -> Result<Self> {
        let object = object.into();
        if !(value.is_finite() && value > 0.0) {
            return Err(Error::input(format!(
                "the threshold of object `{object}` is {value}; expected a positive number"
            )));
        }
        Ok(Self { object, value })
    }

    /// The name of the object.
    pub fn object(&self) -> &str {
        &self.object
    }
}

impl FromStr for Threshold {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        let name_and_value = |text: &str| {
            let (name, value) = text.rsplit_once('=')?;
            let (name, value) = (name.trim().to_owned(), value.trim().to_owned());
            (!name.is_empty()).then_some((name, value))
        };
        let is_threshold = |part: &str| {
            name_and_value(part).is_some_and(|(_, value)| value.parse::<f64>().is_ok())
        };
        let (name, value) = name_and_value(text)
            .ok_or_else(|| Error::input(format!("`{text}` is not a threshold; {EXPECTED}")))?;
        let quoted = name
            .strip_prefix('"')
            .and_then(|rest| rest.strip_suffix('"'));
        if quoted.is_none() && text.contains(',') && text.split(',').all(is_threshold) {
            return Err(Error::input(format!(
                "`{text}` gives more than one threshold; {EXPECTED}, and --threshold once for every object: --threshold \
                 cube=0.015 --threshold eef=0.1"
            )));
        }
        let object = quoted.unwrap_or(&name);
        let wrong = |value: &str, why: &str| {
            Error::input(format!(
                "the threshold of `{object}` is {value}, which is {why}; {EXPECTED}"
            ))
        };
        let number = value
            .parse()
            .map_err(|_| wrong(&format!("`{value}`"), "not a number"))?;
        Self::new(object, number).map_err(|_| wrong(&value, "not a finite number above 0"))
    }
}

impl fmt::Display for Threshold {
    /// Text that parses to the same threshold.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let plain = format!("{}={}", self.object, self.value);
        let again: Result<Self> = plain.parse();
        match again {
            Ok(again) if again == *self => f.write_str(&plain),
            _ => write!(f, "\"{}\"={}", self.object, self.value),
        }
    }
}

/// The thresholds of an evaluation: those that are given, and the default of every other object.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Thresholds(Vec<Threshold>);

impl Thresholds {
    /// The given thresholds, in their order.
    ///
    /// # Errors
    /// When two are given for one object.
    pub fn new(given: impl IntoIterator<Item = Threshold>) -> Result<Self> {
        let mut thresholds: Vec<Threshold> = Vec::new();
        for threshold in given {
            let object = &threshold.object;
            if thresholds.iter().any(|other| other.object == *object) {
                return Err(Error::input(format!(
                    "two thresholds are given for `{object}`; expected one"
                )));
            }
            thresholds.push(threshold);
        }
        Ok(Self(thresholds))
    }

    /// The thresholds that are given.
    pub fn given(&self) -> &[Threshold] {
        &self.0
    }

    /// The threshold of `object`: the given one, or its default ([`default_threshold`]).
    pub fn of(&self, object: &str) -> f64 {
        let given = self.0.iter().find(|given| given.object == object);
        given.map_or_else(|| default_threshold(object), |given| given.value)
    }

    /// The objects `names` with their thresholds; `unit` is what the defaults are times, 1 for
    /// positions in ndc. `owner` says whose objects they are, e.g. `the ground truth has`.
    ///
    /// # Errors
    /// When a threshold is given for an object that is not among them.
    pub fn objects(&self, names: &[String], owner: &str, unit: f64) -> Result<Vec<Object>> {
        if let Some(unknown) = self.0.iter().find(|given| !names.contains(&given.object)) {
            return Err(Error::mismatch(format!(
                "a threshold is given for `{}`; {owner} the objects {}",
                unknown.object,
                names.join(", ")
            )));
        }
        let object = |name: &String| {
            let is_given = self.0.iter().any(|given| given.object == *name);
            Object::new(name, self.of(name) * if is_given { 1.0 } else { unit })
        };
        Ok(names.iter().map(object).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn any_object_name_survives_as_text() {
        for name in [
            "cube",
            "a=b",
            "a,b",
            "cube=1,eef",
            " cube",
            "__proto__",
            "\"cube\"",
            "\"",
            "",
            "é\n,",
        ] {
            let threshold = Threshold::new(name, 0.1).expect("a threshold");
            let again: Threshold = threshold.to_string().parse().expect("a threshold");
            assert_eq!(again, threshold, "{threshold}");
        }
        let spaced: Threshold = "cube = 0.02".parse().expect("a threshold");
        assert_eq!(spaced.to_string(), "cube=0.02");
    }

    #[test]
    fn objects_without_a_threshold_keep_their_default() {
        let thresholds = Thresholds::new(["cube=0.2".parse().expect("a threshold")]);
        let thresholds = thresholds.expect("thresholds");
        assert_eq!(
            ["cube", "eef", "target", "__proto__"].map(|name| thresholds.of(name)),
            [0.2, 0.1, 0.015, 0.015]
        );
    }
}
