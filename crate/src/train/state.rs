//! What a run needs to go on after an epoch.

use std::collections::{BTreeMap, HashMap};
use std::fs;
use std::path::Path;

use safetensors::tensor::{Dtype, SafeTensors, TensorView};
use serde::{Deserialize, Serialize};

use super::Trainer;
use crate::atomic;
use crate::checkpoint::Checkpoint;
use crate::error::{Error, ErrorKind, Result};
use crate::run::{STATE, TrainSummary};

/// The tensors of bytes that hold the optimizer's state and the weights: both are files of their
/// own, kept in one, so that they belong together whenever the process ends.
const OPTIMIZER: &str = "optimizer.bpk";
const WEIGHTS: &str = "weights.safetensors";
const PROGRESS: &str = "tracklens.progress";

/// How far a run has come. Random numbers are drawn anew from seed and epoch, so they need no
/// state.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct Progress {
    /// As it stands after the epoch.
    pub summary: TrainSummary,
    /// The lowest total validation loss so far; null before the first epoch.
    pub best: Option<f64>,
    /// Length of `log.jsonl` in bytes: what comes after it belongs to an epoch that was not
    /// finished.
    pub log_bytes: u64,
}

/// Writes the state of a run after an epoch, whole or not at all.
pub(super) fn save(folder: &Path, trainer: &Trainer, progress: &Progress) -> Result<()> {
    let weights = trainer.checkpoint(BTreeMap::new())?.to_safetensors()?;
    let optimizer = trainer.optimizer_bytes()?;
    let failed =
        |e: &dyn std::fmt::Display| Error::new(ErrorKind::Io, format!("the state of the run: {e}"));
    let json = serde_json::to_string(progress).map_err(|e| failed(&e))?;
    let view =
        |bytes| TensorView::new(Dtype::U8, vec![<[u8]>::len(bytes)], bytes).map_err(|e| failed(&e));
    let tensors = [(WEIGHTS, view(&weights)?), (OPTIMIZER, view(&optimizer)?)];
    let header = HashMap::from([(PROGRESS.to_owned(), json)]);
    let bytes = safetensors::serialize(tensors, Some(header)).map_err(|e| failed(&e))?;
    atomic::write(&folder.join(STATE), &bytes)
}

/// Reads the state of a run: its progress, its weights, and the state of its optimizer.
pub(super) fn load(folder: &Path) -> Result<(Progress, Checkpoint, Vec<u8>)> {
    let path = folder.join(STATE);
    let bytes = fs::read(&path).map_err(|e| Error::io(path.display(), &e))?;
    let read = || {
        let damaged = |e: &dyn std::fmt::Display| {
            Error::input(format!(
                "the state of the run is damaged ({e}); start again in another folder"
            ))
        };
        let (_, header) = SafeTensors::read_metadata(&bytes).map_err(|e| damaged(&e))?;
        let json = header.metadata().as_ref().and_then(|m| m.get(PROGRESS));
        let json = json.ok_or_else(|| damaged(&"no progress in its header"))?;
        let progress = serde_json::from_str(json).map_err(|e| damaged(&e))?;
        let file = SafeTensors::deserialize(&bytes).map_err(|e| damaged(&e))?;
        let part = |name| file.tensor(name).map(|t| t.data()).map_err(|e| damaged(&e));
        let weights = Checkpoint::from_safetensors(part(WEIGHTS)?)?;
        Ok((progress, weights, part(OPTIMIZER)?.to_vec()))
    };
    read().map_err(|e: Error| e.at(path.display()))
}
