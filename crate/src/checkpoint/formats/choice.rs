//! Which of the tensors of a file are the weights of an SAE: training stacks put names and
//! dictionaries around them (`module.`, `_orig_mod.`, `model.`, `features_extractor.`), and some save
//! several sets of weights.

use std::collections::BTreeSet;

use crate::error::{Error, Result};

/// The first tensor of an SAE's encoder, of which an SAE has one.
const FIRST: [&str; 2] = ["encoder.block1.conv1.weight", "encoder.conv1.weight"];

/// Where training scripts put the weights in what they save; the authors' is the first.
pub const WEIGHTS: [&str; 4] = ["model_state_dict", "state_dict", "model", "weights"];

/// What is asked of a file.
#[derive(Debug, Clone, Copy)]
pub enum Wanted<'a> {
    /// The weights of an SAE, by what stands before `encoder.` in their names where there are
    /// several.
    Sae(Option<&'a str>),
    /// All tensors, whatever they belong to.
    Everything,
}

/// The tensors that are read.
#[derive(Debug)]
pub struct Choice {
    /// What stands before their names, which is taken away.
    prefix: String,
    /// What stands before the names of other sets of weights.
    pub others: Vec<String>,
}

impl Choice {
    /// Of tensors of these names.
    ///
    /// # Errors
    /// When the weights that are asked for are not there, and when there are several sets and none is
    /// asked for.
    pub fn of<'a>(names: impl Iterator<Item = &'a str>, wanted: Wanted) -> Result<Self> {
        let Wanted::Sae(key) = wanted else {
            return Ok(Self::everything());
        };
        let before = |name: &'a str| {
            let prefix = FIRST.iter().find_map(|first| name.strip_suffix(first))?;
            (prefix.is_empty() || prefix.ends_with('.')).then_some(prefix)
        };
        let found: BTreeSet<&str> = names.filter_map(before).collect();
        let listed = || {
            let all = found
                .iter()
                .map(|prefix| match prefix.trim_end_matches('.') {
                    "" => "none".to_owned(),
                    key => format!("`{key}`"),
                });
            all.collect::<Vec<_>>().join(", ")
        };
        let chosen = match key.map(|key| key.trim_end_matches('.')) {
            Some(key) => {
                let below = format!("{key}.");
                let mut fits = found
                    .iter()
                    .filter(|prefix| prefix.trim_end_matches('.') == key || prefix.starts_with(&below));
                match (fits.next(), fits.next()) {
                    (Some(prefix), None) => *prefix,
                    (found_one, _) => {
                        return Err(Error::input(format!(
                            "{} weights of an SAE under the key `{key}`; what stands before `encoder.` in this file: {}",
                            if found_one.is_some() { "several" } else { "no" },
                            if found.is_empty() { "nothing".to_owned() } else { listed() }
                        )));
                    }
                }
            }
            // Reading the names says what is missing.
            None if found.is_empty() => return Ok(Self::everything()),
            None => usual(&found).ok_or_else(|| {
                Error::input(format!(
                    "{} sets of weights of an SAE; say which by what stands before `encoder.` (key): {}",
                    found.len(),
                    listed()
                ))
            })?,
        };
        let others = found.iter().filter(|prefix| **prefix != chosen);
        Ok(Self {
            prefix: chosen.to_owned(),
            others: others
                .map(|prefix| prefix.trim_end_matches('.').to_owned())
                .collect(),
        })
    }

    fn everything() -> Self {
        Self {
            prefix: String::new(),
            others: Vec::new(),
        }
    }

    /// Whether there is no prefix.
    pub fn is_everything(&self) -> bool {
        self.prefix.is_empty()
    }

    /// The name of a tensor without what stands before; `None` for one of other weights.
    pub fn name<'n>(&self, name: &'n str) -> Option<&'n str> {
        name.strip_prefix(&self.prefix)
    }

    /// The key under which the weights lie, where there are others.
    pub fn told(&self) -> Option<String> {
        let key = self.prefix.trim_end_matches('.');
        let others = self.others.join(", ");
        (!others.is_empty()).then(|| format!("{key} (there are also: {others})"))
    }
}

/// The only set of weights, or the one where scripts usually have it, if it is the only one there.
fn usual<'a>(found: &BTreeSet<&'a str>) -> Option<&'a str> {
    let only = |mut fits: Vec<&'a str>| match fits.len() {
        1 => fits.pop(),
        _ => None,
    };
    let all = only(found.iter().copied().collect());
    let none = || found.get("").copied();
    let in_place = |key: &str| {
        let fits = found.iter().filter(|prefix| {
            let rest = prefix.strip_prefix(key);
            rest.is_some_and(|rest| rest.starts_with('.'))
        });
        only(fits.copied().collect())
    };
    all.or_else(none)
        .or_else(|| WEIGHTS.iter().find_map(|key| in_place(key)))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn chosen(prefixes: &[&str], key: Option<&str>) -> Result<(String, Vec<String>)> {
        let names: Vec<String> = prefixes
            .iter()
            .flat_map(|prefix| {
                [
                    "encoder.block1.conv1.weight",
                    "encoder.block1.conv2.weight",
                    "decoder.x",
                ]
                .map(|name| format!("{prefix}{name}"))
            })
            .collect();
        let choice = Choice::of(names.iter().map(String::as_str), Wanted::Sae(key))?;
        Ok((choice.prefix, choice.others))
    }

    #[test]
    fn any_prefix_is_taken_away_and_several_are_asked_about() {
        for prefix in [
            "",
            "module.",
            "_orig_mod.module.",
            "policy.features_extractor.",
        ] {
            assert_eq!(
                chosen(&[prefix], None).expect("one"),
                (prefix.to_owned(), vec![])
            );
        }
        let (prefix, others) = chosen(&["ema.", "model_state_dict."], None).expect("the usual one");
        assert_eq!(
            (prefix.as_str(), &others[..]),
            ("model_state_dict.", &["ema".to_owned()][..])
        );
        assert_eq!(
            chosen(&["ema.", "model."], Some("ema"))
                .expect("asked for")
                .0,
            "ema."
        );
        assert_eq!(
            chosen(&["a.module.", "b."], Some("a")).expect("below").0,
            "a.module."
        );
        let error = chosen(&["pi.", "vf."], None).expect_err("two").to_string();
        assert!(
            error.contains("2 sets of weights") && error.contains("`pi`, `vf`"),
            "{error}"
        );
        let error = chosen(&["pi."], Some("vf"))
            .expect_err("not there")
            .to_string();
        assert!(
            error.contains("no weights of an SAE under the key `vf`"),
            "{error}"
        );
        // Not at a boundary between parts of a name.
        assert_eq!(chosen(&["my_"], None).expect("none").0, "");
    }
}
