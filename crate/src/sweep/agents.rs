//! Sweeps of agents: sweep files with `[rl]`, and the plans that are made of them.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use fastrand::Rng;
use serde::Deserialize;
use toml::de::DeTable;

use super::plan::{Plan, PlannedRun, digits_of};
use super::reader::{Reader, Setting, SettingKind, Value, find, integer, nearest, need};
use crate::error::{Error, Result};
use crate::run::{
    CHECKPOINT_BEST, CHECKPOINT_FINAL, CONFIG, PARTIAL, RunFiles, RunKind, SUMMARY, TrainSummary,
};

const TOP: [&str; 2] = ["out", "rl"];
/// What `[rl]` has besides the options of the program.
const OWN: [&str; 5] = ["python", "script", "states", "seeds", "encoders"];
const ENCODERS: [&str; 5] = ["files", "runs", "each", "seed", "weights"];
/// Folders below the given one that are searched for trainings.
const DEPTH: usize = 6;

/// What the program that trains agents says of itself (`train_rl.py --options`).
#[derive(Debug, Clone, PartialEq, Eq, Deserialize)]
pub struct AgentOptions {
    /// What an agent can see.
    pub states: Vec<String>,
    /// Options with a value that a sweep file may give, without the dashes.
    pub values: Vec<String>,
    /// Options that are there or not.
    pub switches: Vec<String>,
}

/// The program that trains agents.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct AgentProgram {
    /// The interpreter: a path, or a name that is looked for on the `PATH`.
    pub python: String,
    /// `train_rl.py`.
    pub script: PathBuf,
}

/// What a sweep file with `[rl]` asks for.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct AgentSweep {
    /// The folder of the sweep.
    pub out: PathBuf,
    program: AgentProgram,
    states: Vec<String>,
    seeds: Vec<u64>,
    encoders: Option<Encoders>,
    /// Arguments for every run.
    arguments: Vec<String>,
}

/// The encoders of the states with keypoints.
#[derive(Debug, Clone, PartialEq, Eq)]
enum Encoders {
    Files(Vec<PathBuf>),
    /// Those of complete trainings below a folder.
    Trained {
        runs: PathBuf,
        /// How many are drawn of every family; all without it.
        each: Option<usize>,
        /// Seeds what is drawn.
        seed: u64,
        /// The file of the checkpoint.
        weights: &'static str,
    },
}

/// An encoder's checkpoint, and what runs with it are called by.
type Named = (String, PathBuf);

impl AgentSweep {
    /// Reads a sweep file (TOML), whose paths are relative to `folder`; `None` for one without
    /// `[rl]`, which is of trainings. `options` asks the program what it can do.
    ///
    /// # Errors
    /// As [`SweepFile::parse`](super::SweepFile::parse), and those of `options`.
    pub fn parse(
        text: &str,
        folder: &Path,
        options: impl FnOnce(&AgentProgram) -> Result<AgentOptions>,
    ) -> Result<Option<Self>> {
        let reader = Reader {
            text,
            folder,
            settings: &[],
        };
        let table = &reader.top()?;
        let Some(rl) = find(table, "rl") else {
            return Ok(None);
        };
        reader.check_keys(table, &TOP)?;
        let values = reader.table(rl)?;
        let program = reader.program(values)?;
        let known = options(&program)?;
        let settings = settings(&known);
        let reader = Reader {
            settings: &settings,
            ..reader
        };
        let states = reader.states(need(values, "states", "states = [\"points\"]")?, &known)?;
        need(values, "steps", "steps = 10000")?;
        let encoders = find(values, "encoders").map(|value| reader.encoders(value));
        let encoders = encoders.transpose()?;
        if encoders.is_none() && states.iter().any(|state| sees_by_encoder(state)) {
            return Err(Error::input(
                "`[rl.encoders]` is missing, which states with keypoints need; expected e.g. runs = \
                 \"encoders\"",
            ));
        }
        let out = find(table, "out").map(|value| reader.string(value));
        Ok(Some(Self {
            out: folder.join(out.transpose()?.unwrap_or("runs")),
            program,
            states,
            seeds: reader.seeds(need(values, "seeds", "seeds = \"0-1\"")?)?,
            encoders,
            arguments: reader.arguments(rl, &OWN)?,
        }))
    }

    /// Every state with every encoder, where it sees by one, and every seed: seeds change fastest.
    ///
    /// # Errors
    /// When there are fewer encoders than are to be drawn, or files cannot be read.
    pub fn plan(&self) -> Result<Plan> {
        let checkpoints = self.encoders.as_ref().map(Encoders::checkpoints);
        let checkpoints = checkpoints.transpose()?.unwrap_or_default();
        let digits = digits_of(&self.seeds);
        let mut runs = Vec::new();
        for state in &self.states {
            let seen: Vec<Option<&Named>> = match sees_by_encoder(state) {
                true => checkpoints.iter().map(Some).collect(),
                false => vec![None],
            };
            for encoder in seen {
                for seed in &self.seeds {
                    let mut arguments = vec![format!("--state={state}"), format!("--seed={seed}")];
                    let group = match encoder {
                        Some((name, path)) => {
                            arguments.push(format!("--checkpoint={}", path.display()));
                            format!("{state}/{name}")
                        }
                        None => state.clone(),
                    };
                    arguments.extend(self.arguments.iter().cloned());
                    runs.push(PlannedRun {
                        run: format!("{group}/seed-{seed:0digits$}"),
                        program: self.program.command(),
                        arguments,
                    });
                }
            }
        }
        Ok(Plan { runs })
    }
}

impl AgentProgram {
    /// The program and its first argument.
    fn command(&self) -> Vec<String> {
        vec![
            self.python.clone(),
            self.script.to_string_lossy().into_owned(),
        ]
    }
}

fn sees_by_encoder(state: &str) -> bool {
    state.starts_with("keypoints")
}

fn settings(options: &AgentOptions) -> Vec<Setting> {
    let of = |names: &[String], kind: SettingKind| {
        let setting = |name: &String| Setting {
            name: name.clone(),
            kind,
        };
        names.iter().map(setting).collect::<Vec<_>>()
    };
    [
        of(&options.values, SettingKind::Value),
        of(&options.switches, SettingKind::Switch),
    ]
    .concat()
}

impl Reader<'_> {
    fn program(&self, rl: &DeTable) -> Result<AgentProgram> {
        let text = |name: &str| find(rl, name).map(|value| self.string(value)).transpose();
        let python = match text("python")? {
            Some(path) if path.contains('/') => {
                self.folder.join(path).to_string_lossy().into_owned()
            }
            Some(name) => name.to_owned(),
            None => "python3".to_owned(),
        };
        let script = need(rl, "script", "script = \"tools/rl/train_rl.py\"")?;
        Ok(AgentProgram {
            python,
            script: self.folder.join(self.string(script)?),
        })
    }

    fn states(&self, value: &Value, known: &AgentOptions) -> Result<Vec<String>> {
        let mut states: Vec<String> = Vec::new();
        for value in self.array(value)? {
            let state = self.string(value)?;
            if !known.states.iter().any(|known| known == state) {
                let names = known.states.iter().map(String::as_str);
                let message = format!(
                    "unknown state `{state}`{} (known: {})",
                    nearest(state, names),
                    known.states.join(", ")
                );
                return Err(self.wrong(&value.span(), message));
            }
            if states.iter().any(|other| other == state) {
                return Err(self.wrong(&value.span(), format!("`{state}` is there twice")));
            }
            states.push(state.to_owned());
        }
        match states.is_empty() {
            true => Err(self.wrong(&value.span(), "no state is given")),
            false => Ok(states),
        }
    }

    fn encoders(&self, value: &Value) -> Result<Encoders> {
        let table = self.table(value)?;
        self.check_keys(table, &ENCODERS)?;
        if let Some(files) = find(table, "files") {
            if table.len() > 1 {
                return Err(self.wrong(
                    &value.span(),
                    "`files` are taken as they are; leave the rest out",
                ));
            }
            let files = self.array(files)?.into_iter();
            let files = files.map(|file| Ok(self.folder.join(self.string(file)?)));
            return Ok(Encoders::Files(files.collect::<Result<_>>()?));
        }
        let runs = self.string(need(table, "runs", "runs = \"encoders\"")?)?;
        let number = |name: &str| {
            let wrong =
                |value: &Value| self.wrong(&value.span(), format!("`{name}` is a whole number"));
            let value = find(table, name);
            value
                .map(|value| integer(value).ok_or_else(|| wrong(value)))
                .transpose()
        };
        let weights = match find(table, "weights") {
            None => CHECKPOINT_BEST,
            Some(value) => match self.string(value)? {
                "best" => CHECKPOINT_BEST,
                "final" => CHECKPOINT_FINAL,
                _ => {
                    return Err(self.wrong(&value.span(), "`weights` are \"best\" or \"final\""));
                }
            },
        };
        Ok(Encoders::Trained {
            runs: self.folder.join(runs),
            each: number("each")?.map(|each| each as usize),
            seed: number("seed")?.unwrap_or(0),
            weights,
        })
    }
}

impl Encoders {
    /// The checkpoints by name.
    fn checkpoints(&self) -> Result<Vec<Named>> {
        let named = match self {
            Self::Files(files) => files
                .iter()
                .map(|file| {
                    let name = file.file_stem().unwrap_or_default().to_string_lossy();
                    (name.into_owned(), file.clone())
                })
                .collect(),
            Self::Trained {
                runs,
                each,
                seed,
                weights,
            } => drawn(runs, trained(runs, weights)?, *each, *seed)?,
        };
        for (i, (name, path)) in named.iter().enumerate() {
            if let Some((_, other)) = named[..i].iter().find(|(other, _)| other == name) {
                return Err(Error::input(format!(
                    "the checkpoints {} and {} have one name; give one of them another",
                    other.display(),
                    path.display()
                )));
            }
            if !path.is_file() {
                return Err(Error::input("the checkpoint is not there").at(path.display()));
            }
        }
        Ok(named)
    }
}

/// The complete trainings below a folder that have the checkpoint, by their paths in it.
fn trained(root: &Path, weights: &str) -> Result<Vec<Named>> {
    let mut found = Vec::new();
    let mut folders = vec![(root.to_owned(), DEPTH)];
    while let Some((folder, depth)) = folders.pop() {
        let failed = |e: std::io::Error| Error::io(folder.display(), &e);
        for entry in fs::read_dir(&folder).map_err(failed)? {
            let path = entry.map_err(failed)?.path();
            if path.is_dir() && depth > 0 && path.extension().is_none_or(|e| e != PARTIAL) {
                folders.push((path, depth - 1));
            }
        }
        let checkpoint = folder.join(weights);
        if checkpoint.is_file() && is_complete_training(&folder) {
            let name = folder.strip_prefix(root).unwrap_or(&folder);
            found.push((name.to_string_lossy().replace('\\', "/"), checkpoint));
        }
    }
    found.sort();
    Ok(found)
}

fn is_complete_training(folder: &Path) -> bool {
    let read = |name: &str| fs::read(folder.join(name)).ok();
    let (config, summary) = (read(CONFIG), read(SUMMARY));
    let files = RunFiles {
        config: config.as_deref(),
        ..RunFiles::default()
    };
    let summary = summary.and_then(|bytes| serde_json::from_slice::<TrainSummary>(&bytes).ok());
    let whole = summary.is_some_and(|summary| !summary.interrupted);
    config.is_some() && whole && files.kind() == RunKind::Encoder
}

/// Of every family, which is the folder that trainings lie in, as many as are to be drawn. What is
/// drawn of one does not depend on the others.
fn drawn(root: &Path, all: Vec<Named>, each: Option<usize>, seed: u64) -> Result<Vec<Named>> {
    if all.is_empty() {
        return Err(
            Error::input("holds no complete training with such a checkpoint").at(root.display()),
        );
    }
    let mut families: BTreeMap<String, Vec<Named>> = BTreeMap::new();
    for (name, path) in all {
        let family = name
            .rsplit_once('/')
            .map_or(name.as_str(), |(family, _)| family);
        let members = families.entry(family.to_owned()).or_default();
        members.push((name.replace('/', "-"), path));
    }
    let mut chosen = Vec::new();
    for (family, mut members) in families {
        if let Some(each) = each {
            if members.len() < each {
                return Err(Error::input(format!(
                    "{each} encoders are to be drawn of {family}, and {} are complete; train more, or \
                     ask for fewer",
                    members.len()
                ))
                .at(root.display()));
            }
            Rng::with_seed(seed).shuffle(&mut members);
            members.truncate(each);
            members.sort();
        }
        chosen.extend(members);
    }
    Ok(chosen)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn encoders_are_drawn_by_family_and_seed() {
        let all = || {
            let families = ["basic", "keynet"].into_iter();
            let names = families.flat_map(|f| (0..8).map(move |i| format!("{f}/seed-0{i}")));
            names
                .map(|name| (name.clone(), PathBuf::from(name)))
                .collect::<Vec<Named>>()
        };
        let draw = |all, seed| drawn(Path::new("runs"), all, Some(5), seed).expect("enough");
        let chosen = draw(all(), 1);
        assert_eq!(chosen.len(), 10);
        assert!(chosen.is_sorted() && chosen[0].0.starts_with("basic-seed-0"));
        let keynet = all().split_off(8);
        assert_eq!(
            draw(keynet, 1),
            chosen[5..],
            "whatever other families there are"
        );
        assert!((2..9).any(|seed| draw(all(), seed) != chosen));
        assert_eq!(
            drawn(Path::new("runs"), all(), None, 0).expect("all").len(),
            16
        );
        let told = drawn(Path::new("runs"), all(), Some(9), 0)
            .expect_err("too few")
            .to_string();
        assert!(
            told.contains("9 encoders are to be drawn of basic, and 8 are complete"),
            "{told}"
        );
    }
}
