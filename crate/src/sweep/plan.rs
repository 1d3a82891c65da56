//! Sweep files, and the plans that are made of them.

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::reader::{Reader, Setting, Value, find, nearest, need};
use crate::checkpoint::SaeConfig;
use crate::error::{Error, Result};

const TOP: [&str; 7] = [
    "data",
    "out",
    "architectures",
    "seeds",
    "train",
    "architecture",
    "variants",
];

/// What a sweep file asks for.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SweepFile {
    /// The data set, absolute or as seen from the working directory.
    pub data: PathBuf,
    /// The folder of the sweep.
    pub out: PathBuf,
    architectures: Vec<String>,
    seeds: Vec<u64>,
    /// Arguments for every run.
    train: Vec<String>,
    /// Arguments for the runs of one architecture.
    architecture: Vec<(String, Vec<String>)>,
    /// Name and arguments; one without a name where the file has none.
    variants: Vec<(Option<String>, Vec<String>)>,
}

/// One run of a plan: a line of `plan.jsonl`.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PlannedRun {
    /// Its name, and its folder in the folder of the sweep: `basic/seed-03`.
    pub run: String,
    /// The program that trains an agent, with its first arguments; empty for `tracklens train`.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub program: Vec<String>,
    /// The arguments of `tracklens train` or of the program, but for `--out`.
    pub arguments: Vec<String>,
}

/// The runs of a sweep, in the order of `plan.jsonl`, counted from 1.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Plan {
    /// One a line.
    pub runs: Vec<PlannedRun>,
}

/// How many digits a seed has in the name of a run, two at least, so that the names sort.
pub(super) fn digits_of(seeds: &[u64]) -> usize {
    let most = seeds.iter().max();
    most.map_or(1, |seed| seed.to_string().len()).max(2)
}

impl SweepFile {
    /// Reads a sweep file (TOML), whose paths are relative to `folder`.
    ///
    /// # Errors
    /// When the text is not TOML, a key or an architecture is unknown, a value is not what the key
    /// takes, or one that is needed is missing; with the line, and the nearest name that is known.
    pub fn parse(text: &str, folder: &Path, settings: &[Setting]) -> Result<Self> {
        Reader {
            text,
            folder,
            settings,
        }
        .file()
    }

    /// Every architecture with every variant and every seed: seeds change fastest.
    pub fn plan(&self) -> Plan {
        let digits = digits_of(&self.seeds);
        let mut runs = Vec::new();
        for architecture in &self.architectures {
            let own = self
                .architecture
                .iter()
                .filter(|(name, _)| name == architecture);
            let own: Vec<String> = own.flat_map(|(_, arguments)| arguments.clone()).collect();
            for (variant, more) in &self.variants {
                for seed in &self.seeds {
                    let group = match variant {
                        Some(variant) => format!("{architecture}-{variant}"),
                        None => architecture.clone(),
                    };
                    let mut arguments = vec![
                        "--data".to_owned(),
                        self.data.to_string_lossy().into_owned(),
                        "--arch".to_owned(),
                        architecture.clone(),
                        "--seed".to_owned(),
                        seed.to_string(),
                    ];
                    // What is more special comes later, and the later of two counts.
                    for argument in self.train.iter().chain(&own).chain(more) {
                        arguments.push(argument.clone());
                    }
                    runs.push(PlannedRun {
                        run: format!("{group}/seed-{seed:0digits$}"),
                        program: Vec::new(),
                        arguments: deduplicated(arguments),
                    });
                }
            }
        }
        Plan { runs }
    }
}

/// Keeps the last one of an option that is given several times. Every argument is `--name`, or a value
/// after it.
fn deduplicated(arguments: Vec<String>) -> Vec<String> {
    let mut options: Vec<Vec<String>> = Vec::new();
    for argument in arguments {
        match options.last_mut() {
            Some(option) if option.len() == 1 && !argument.starts_with("--") => {
                option.push(argument)
            }
            _ => options.push(vec![argument]),
        }
    }
    let name = |option: &[String]| option[0].split('=').next().unwrap_or_default().to_owned();
    let mut kept: Vec<Vec<String>> = Vec::new();
    for option in options {
        kept.retain(|k| name(k) != name(&option));
        kept.push(option);
    }
    kept.concat()
}

impl Plan {
    /// The text of `plan.jsonl`.
    ///
    /// # Errors
    /// When a run cannot be written as JSON.
    pub fn to_jsonl(&self) -> Result<String> {
        let mut text = String::new();
        for run in &self.runs {
            text += &serde_json::to_string(run)
                .map_err(|e| Error::input(format!("{}: {e}", run.run)))?;
            text.push('\n');
        }
        Ok(text)
    }

    /// Reads a `plan.jsonl`.
    ///
    /// # Errors
    /// Names the line that is not a run, or whose name leads out of the sweep's folder or is there
    /// twice.
    pub fn parse(text: &str) -> Result<Self> {
        let mut runs: Vec<PlannedRun> = Vec::new();
        for (i, line) in text.lines().enumerate() {
            let run: PlannedRun = serde_json::from_str(line)
                .map_err(|e| Error::input(e.to_string()).at(format!("line {}", i + 1)))?;
            let is_plain = |part: &str| !matches!(part, "" | "." | "..") && !part.contains('\\');
            if !run.run.split('/').all(is_plain) || runs.iter().any(|r| r.run == run.run) {
                return Err(Error::input(format!(
                    "line {}: `{}` is not a valid name of a run, or not the first of this name; write the plan anew with \
                     `tracklens sweep plan`",
                    i + 1,
                    run.run
                )));
            }
            runs.push(run);
        }
        if runs.is_empty() {
            return Err(Error::input(
                "holds no run; write it with `tracklens sweep plan`",
            ));
        }
        Ok(Self { runs })
    }

    /// The run of a line, counted from 1.
    ///
    /// # Errors
    /// When there is no such line.
    pub fn line(&self, line: usize) -> Result<&PlannedRun> {
        line.checked_sub(1)
            .and_then(|i| self.runs.get(i))
            .ok_or_else(|| {
                Error::input(format!(
                    "there is no line {line}; expected 1 to {}",
                    self.runs.len()
                ))
            })
    }
}

impl Reader<'_> {
    fn file(&self) -> Result<SweepFile> {
        let table = &self.top()?;
        self.check_keys(table, &TOP)?;
        let data = need(table, "data", "data = \"recording\"")?;
        let architectures = need(table, "architectures", "architectures = [\"basic\"]")?;
        let seeds = need(table, "seeds", "seeds = \"0-23\"")?;
        let architectures = self.architectures(architectures)?;
        let mut architecture = Vec::new();
        if let Some(value) = find(table, "architecture") {
            for (key, value) in self.table(value)? {
                let name = key.get_ref().as_ref();
                if !architectures.iter().any(|a| a == name) {
                    return Err(self.unknown(
                        "architecture",
                        key,
                        architectures.iter().map(String::as_str),
                    ));
                }
                architecture.push((name.to_owned(), self.arguments(value, &[])?));
            }
        }
        let variants = match find(table, "variants") {
            Some(value) => self.variants(value)?,
            None => vec![(None, Vec::new())],
        };
        Ok(SweepFile {
            data: self.folder.join(self.string(data)?),
            out: self.folder.join(match find(table, "out") {
                Some(value) => self.string(value)?,
                None => "runs",
            }),
            architectures,
            seeds: self.seeds(seeds)?,
            train: match find(table, "train") {
                Some(value) => self.arguments(value, &[])?,
                None => Vec::new(),
            },
            architecture,
            variants,
        })
    }

    fn architectures(&self, value: &Value) -> Result<Vec<String>> {
        let mut names: Vec<String> = Vec::new();
        for value in self.array(value)? {
            let name = self.string(value)?;
            architecture_named(name).map_err(|e| self.wrong(&value.span(), e.to_string()))?;
            if names.iter().any(|n| n == name) {
                return Err(self.wrong(&value.span(), format!("`{name}` is there twice")));
            }
            names.push(name.to_owned());
        }
        if names.is_empty() {
            return Err(self.wrong(&value.span(), "no architecture is given"));
        }
        Ok(names)
    }

    fn variants(&self, value: &Value) -> Result<Vec<(Option<String>, Vec<String>)>> {
        let mut variants: Vec<(Option<String>, Vec<String>)> = Vec::new();
        for value in self.array(value)? {
            let table = self.table(value)?;
            let name = table.iter().find(|(key, _)| key.get_ref() == "name");
            let Some((_, name)) = name else {
                return Err(self.wrong(
                    &value.span(),
                    "a variant needs a `name`, which its runs are called by",
                ));
            };
            let text = self.string(name)?;
            let is_plain = |c: char| c.is_ascii_alphanumeric() || matches!(c, '-' | '_' | '.');
            let is_new = !variants.iter().any(|(n, _)| n.as_deref() == Some(text));
            if text.is_empty() || text.starts_with('.') || !text.chars().all(is_plain) || !is_new {
                return Err(self.wrong(
                    &name.span(),
                    format!("`{text}` cannot name a variant; expected letters, digits, `-`, `_`, `.`, and every name once"),
                ));
            }
            variants.push((Some(text.to_owned()), self.arguments(value, &["name"])?));
        }
        if variants.is_empty() {
            return Err(self.wrong(&value.span(), "no variant is given"));
        }
        Ok(variants)
    }
}

/// As [`SaeConfig::named`]; the error names the nearest architecture.
///
/// # Errors
/// When there is no such architecture.
pub fn architecture_named(name: &str) -> Result<SaeConfig> {
    SaeConfig::named(name).map_err(|e| {
        let nearest = nearest(name, architecture_names().iter().map(String::as_str));
        Error::input(format!("{e}{nearest}"))
    })
}

/// Every name that an architecture can have.
fn architecture_names() -> Vec<String> {
    let mut names = vec!["dsae".to_owned()];
    for family in ["basic", "basic-kp32", "keynet"] {
        for modification in 0..8 {
            let parts = ["-vel", "-std", "-bg"].iter().enumerate();
            let chosen = parts.filter(|(bit, _)| modification >> bit & 1 == 1);
            names.push(chosen.fold(family.to_owned(), |name, (_, part)| name + part));
        }
    }
    names
}
