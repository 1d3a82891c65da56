//! Reads sweep files, and says in which line something is wrong.

use std::ops::Range;
use std::path::Path;

use toml::Spanned;
use toml::de::{DeTable, DeValue};

use crate::error::{Error, Result};

/// An option of a run that a sweep file may give.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Setting {
    /// Its name on the command line, without the dashes.
    pub name: String,
    /// What its value is.
    pub kind: SettingKind,
}

/// What the value of a [`Setting`] is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SettingKind {
    /// There or not.
    Switch,
    /// A number, a text or a list of them.
    Value,
    /// A file, relative to the sweep file.
    Path,
}

/// A sweep file, whose paths are relative to `folder`.
#[derive(Clone, Copy)]
pub(super) struct Reader<'a> {
    pub text: &'a str,
    pub folder: &'a Path,
    pub settings: &'a [Setting],
}

pub(super) type Value<'i> = Spanned<DeValue<'i>>;

impl<'a> Reader<'a> {
    /// The file's table.
    pub(super) fn top(&self) -> Result<DeTable<'a>> {
        let table = DeTable::parse(self.text).map_err(|e| {
            let message = e.message().to_owned();
            match e.span() {
                Some(span) => self.wrong(&span, message),
                None => Error::input(message),
            }
        })?;
        Ok(table.into_inner())
    }

    /// Refuses keys of a table that are not known.
    pub(super) fn check_keys(&self, table: &DeTable, known: &[&str]) -> Result<()> {
        for key in table.keys() {
            if !known.contains(&key.get_ref().as_ref()) {
                return Err(self.unknown("key", key, known.iter().copied()));
            }
        }
        Ok(())
    }

    /// `"0-23"`, one number, or a list of numbers.
    pub(super) fn seeds(&self, value: &Value) -> Result<Vec<u64>> {
        let wrong = || {
            self.wrong(
                &value.span(),
                "expected seeds such as \"0-23\" or [0, 1, 2], none of them twice",
            )
        };
        let number = |value: &Value| integer(value).ok_or_else(wrong);
        let mut seeds = match value.get_ref() {
            DeValue::Array(values) => values.iter().map(number).collect::<Result<Vec<u64>>>()?,
            DeValue::String(range) => {
                let (first, last) = range.split_once('-').ok_or_else(wrong)?;
                let parse = |digits: &str| digits.trim().parse::<u64>().map_err(|_| wrong());
                let (first, last) = (parse(first)?, parse(last)?);
                if last.saturating_sub(first) >= 1_000_000 {
                    return Err(wrong());
                }
                (first..=last).collect()
            }
            _ => vec![number(value)?],
        };
        let count = seeds.len();
        seeds.sort_unstable();
        seeds.dedup();
        if seeds.is_empty() || seeds.len() < count {
            return Err(wrong());
        }
        Ok(seeds)
    }

    /// The options in a table, as arguments; those in `besides` mean something else.
    pub(super) fn arguments(&self, value: &Value, besides: &[&str]) -> Result<Vec<String>> {
        let mut arguments = Vec::new();
        for (key, value) in self.table(value)? {
            let name = key.get_ref().as_ref();
            if besides.contains(&name) {
                continue;
            }
            let Some(setting) = self.settings.iter().find(|setting| setting.name == name) else {
                let known = self.settings.iter().map(|setting| setting.name.as_str());
                return Err(self.unknown("option", key, known));
            };
            let flag = format!("--{name}");
            match setting.kind {
                SettingKind::Switch => match value.get_ref().as_bool() {
                    Some(true) => arguments.push(flag),
                    Some(false) => {}
                    None => {
                        return Err(self.wrong(&value.span(), format!("`{name}` is true or false")));
                    }
                },
                SettingKind::Path => {
                    let path = self.folder.join(self.string(value)?);
                    arguments.extend([flag, path.to_string_lossy().into_owned()]);
                }
                // `=` keeps a negative number from being taken for an option.
                SettingKind::Value => {
                    arguments.push(format!("{flag}={}", self.value(name, value)?))
                }
            }
        }
        Ok(arguments)
    }

    pub(super) fn value(&self, name: &str, value: &Value) -> Result<String> {
        Ok(match value.get_ref() {
            DeValue::String(text) => text.to_string(),
            DeValue::Integer(number) => number.as_str().to_owned(),
            DeValue::Float(number) => number.as_str().to_owned(),
            DeValue::Boolean(switch) => switch.to_string(),
            DeValue::Array(values) => {
                let parts = values.iter().map(|value| self.value(name, value));
                parts.collect::<Result<Vec<String>>>()?.join(",")
            }
            DeValue::Datetime(_) | DeValue::Table(_) => {
                return Err(self.wrong(
                    &value.span(),
                    format!(
                        "`{name}` is {}; expected a number, a text or a list",
                        value.get_ref().type_str()
                    ),
                ));
            }
        })
    }

    pub(super) fn string<'v>(&self, value: &'v Value) -> Result<&'v str> {
        let found = value.get_ref();
        found.as_str().ok_or_else(|| {
            self.wrong(
                &value.span(),
                format!("found {}; expected a text in quotes", found.type_str()),
            )
        })
    }

    pub(super) fn array<'v, 'i>(&self, value: &'v Value<'i>) -> Result<Vec<&'v Value<'i>>> {
        let found = value.get_ref();
        let array = found.as_array();
        array.map(|values| values.iter().collect()).ok_or_else(|| {
            self.wrong(
                &value.span(),
                format!("found {}; expected a list", found.type_str()),
            )
        })
    }

    pub(super) fn table<'v, 'i>(&self, value: &'v Value<'i>) -> Result<&'v DeTable<'i>> {
        let found = value.get_ref();
        found.as_table().ok_or_else(|| {
            self.wrong(
                &value.span(),
                format!("found {}; expected a table", found.type_str()),
            )
        })
    }

    pub(super) fn unknown<'k>(
        &self,
        what: &str,
        key: &Spanned<std::borrow::Cow<'_, str>>,
        known: impl Iterator<Item = &'k str> + Clone,
    ) -> Error {
        let name = key.get_ref();
        let nearest = nearest(name, known.clone());
        let known: Vec<&str> = known.collect();
        let message = format!(
            "unknown {what} `{name}`{nearest} (known: {})",
            known.join(", ")
        );
        self.wrong(&key.span(), message)
    }

    pub(super) fn wrong(&self, span: &Range<usize>, message: impl Into<String>) -> Error {
        let before = self.text.get(..span.start).unwrap_or(self.text);
        Error::input(message).at(format!("line {}", before.matches('\n').count() + 1))
    }
}

pub(super) fn integer(value: &Value) -> Option<u64> {
    let number = value.get_ref().as_integer()?;
    u64::from_str_radix(&number.as_str().replace('_', ""), number.radix()).ok()
}

/// `; did you mean …?`, when there is a name that is near.
pub(super) fn nearest<'a>(name: &str, known: impl Iterator<Item = &'a str>) -> String {
    let near = known
        .map(|candidate| (strsim::jaro_winkler(name, candidate), candidate))
        .filter(|(likeness, _)| *likeness > 0.75)
        .max_by(|a, b| a.0.total_cmp(&b.0));
    near.map(|(_, candidate)| format!("; did you mean `{candidate}`?"))
        .unwrap_or_default()
}

/// The value of a key.
pub(super) fn find<'v, 'i>(table: &'v DeTable<'i>, name: &str) -> Option<&'v Value<'i>> {
    let found = table.iter().find(|(key, _)| key.get_ref() == name);
    found.map(|(_, value)| value)
}

/// The value of a key that has to be there, e.g. as `example`.
pub(super) fn need<'v, 'i>(
    table: &'v DeTable<'i>,
    name: &str,
    example: &str,
) -> Result<&'v Value<'i>> {
    let missing = || Error::input(format!("`{name}` is missing; expected e.g. {example}"));
    find(table, name).ok_or_else(missing)
}
