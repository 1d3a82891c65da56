//! Weights and models by their paths: what a file of either needs from the files beside it.

use std::collections::{BTreeMap, BTreeSet};
use std::ffi::OsString;
use std::fs::File;
use std::io::Read as _;
use std::path::{Path, PathBuf};

use crate::checkpoint::{Checkpoint, Format};
use crate::detector::{Graph, SETTINGS_ENDING, Settings};
use crate::error::{Error, Result};
use crate::memory;

/// The most bytes that are read of what is not a regular file, whose size is not known before.
const MAX_STREAM: u64 = 1 << 30;

/// Reads a whole file; of what is no regular file, such as a pipe, at most 1 GiB.
///
/// # Errors
/// When it cannot be read or is larger than the free memory; names the path.
pub fn read(path: &Path) -> Result<Vec<u8>> {
    let failed = |e: std::io::Error| Error::io(path.display(), &e);
    let found = std::fs::metadata(path).map_err(failed)?;
    if found.is_file() {
        memory::check(
            found.len(),
            "file",
            "close other programs, or use a smaller file",
        )
        .map_err(|e| e.at(path.display()))?;
        return std::fs::read(path).map_err(failed);
    }
    // A pipe, such as a shell makes of another program's output; a device may have no end.
    let mut bytes = Vec::new();
    let stream = File::open(path).map_err(failed)?;
    stream
        .take(MAX_STREAM + 1)
        .read_to_end(&mut bytes)
        .map_err(failed)?;
    match bytes.len() as u64 > MAX_STREAM {
        true => Err(Error::input(format!(
            "not a regular file, and more than {} MiB came from it; expected a file",
            MAX_STREAM >> 20
        ))
        .at(path.display())),
        false => Ok(bytes),
    }
}

/// Reads an ONNX model, which a file is by its name, or by its content where the name tells nothing;
/// `None` for other files.
///
/// # Errors
/// As [`read`].
pub fn read_onnx(path: &Path) -> Result<Option<Vec<u8>>> {
    let ending = path.extension().unwrap_or_default();
    let ending = ending.to_string_lossy().to_ascii_lowercase();
    let named = ending == "onnx";
    // A pipe can be read once.
    if !named && (ending == "json" || Format::from_extension(&ending).is_some() || !path.is_file())
    {
        return Ok(None);
    }
    let bytes = read(path)?;
    let is_model = Format::of(&bytes).is_none() && (named || Graph::is_onnx(&bytes));
    Ok(Some(bytes).filter(|_| is_model))
}

/// As [`read_weights`], without what they were read from.
///
/// # Errors
/// As [`read_weights`].
pub fn read_checkpoint(path: &Path, key: Option<&str>) -> Result<Checkpoint> {
    read_weights(path, key).map(|weights| weights.checkpoint)
}

/// A checkpoint and what it was read from.
pub struct Weights {
    /// The checkpoint.
    pub checkpoint: Checkpoint,
    /// The container that it was in.
    pub format: Format,
    /// The size of all its files together.
    pub bytes: usize,
}

/// What the index of a checkpoint in several files says.
#[derive(serde::Deserialize)]
struct ShardIndex {
    /// By the name of a tensor its file, which lies beside.
    weight_map: BTreeMap<String, String>,
}

/// Reads a checkpoint of one file, or of several that an index (`….safetensors.index.json`) names.
/// `key` says which weights, where there are several sets.
///
/// # Errors
/// As [`read`] and [`Checkpoint::from_bytes_at`]; when the index leads to something else than files
/// beside it.
pub fn read_weights(path: &Path, key: Option<&str>) -> Result<Weights> {
    let placed = |e: Error| e.at(path.display());
    let bytes = read(path)?;
    let is_index = path
        .extension()
        .is_some_and(|e| e.eq_ignore_ascii_case("json"));
    if !is_index {
        let checkpoint = Checkpoint::from_bytes_at(&bytes, key).map_err(placed)?;
        let format = Format::of(&bytes).unwrap_or(Format::PyTorch);
        let bytes = bytes.len();
        return Ok(Weights {
            checkpoint,
            format,
            bytes,
        });
    }
    let index: ShardIndex = serde_json::from_slice(&bytes).map_err(|e| {
        placed(Error::input(format!(
            "not the index of a checkpoint in several files ({e}); expected `weight_map` with the file of every tensor"
        )))
    })?;
    let files: BTreeSet<&String> = index.weight_map.values().collect();
    let mut shards = Vec::new();
    for file in files {
        // A name leads nowhere but to a file beside.
        let is_beside = Path::new(file).components().count() == 1 && !file.contains(['/', '\\']);
        if !is_beside || file == ".." {
            return Err(placed(Error::input(format!(
                "the part `{file}` is not the name of a file beside the index"
            ))));
        }
        shards.push(read(&path.with_file_name(file))?);
    }
    Ok(Weights {
        checkpoint: Checkpoint::from_shards(&shards, key).map_err(placed)?,
        format: Format::Safetensors,
        bytes: shards.iter().map(Vec::len).sum(),
    })
}

/// The file of what is known of a model beside its graph: `model.onnx.json` for `model.onnx`.
pub fn settings_path(model: &Path) -> PathBuf {
    let mut name = OsString::from(model);
    name.push(SETTINGS_ENDING);
    PathBuf::from(name)
}

/// The settings `given` of the ONNX model at `path`, and what they leave open from the file beside
/// it, where there is one.
///
/// # Errors
/// When that file cannot be read or holds no settings.
pub fn model_settings(path: &Path, given: Settings) -> Result<Settings> {
    let beside = settings_path(path);
    if !beside.is_file() {
        return Ok(given);
    }
    let remembered = Settings::from_json(&read(&beside)?).map_err(|e| e.at(beside.display()))?;
    Ok(given.or(remembered))
}
