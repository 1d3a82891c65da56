//! What a run needs to go on after an epoch.
//!
//! The state is a safetensors file of two tensors of bytes, the weights and the optimizer's state,
//! each a file of its own; they are kept in one so that they belong together whenever the process
//! ends. Its metadata hold a [`Header`] and a SHA-256 of all three: a state of which anything was
//! changed is refused, and so is one that belongs to another run, to other data or to another log.

use std::collections::{BTreeMap, HashMap};
use std::fs;
use std::path::Path;

use safetensors::tensor::{Dtype, SafeTensors, TensorView};
use serde::{Deserialize, Serialize};
use serde_json::Value;
use sha2::{Digest as _, Sha256};

use super::Trainer;
use super::dataset::Fingerprint;
use super::hash::hex;
use crate::atomic;
use crate::checkpoint::Checkpoint;
use crate::error::{Error, ErrorKind, Result};
use crate::run::{STATE, TrainSummary};

/// The tensors.
const OPTIMIZER: &str = "optimizer.bpk";
const WEIGHTS: &str = "weights.safetensors";
/// In the metadata: a [`Header`] as JSON, and the checksum of header, weights and optimizer.
const HEADER: &str = "tracklens.state";
const CHECKSUM: &str = "tracklens.sha256";
/// In the metadata of states that were written before they had a checksum.
const UNCHECKED: &str = "tracklens.progress";

/// What a state says of itself.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(super) struct Header {
    /// `config.json` of the run.
    pub run: Value,
    /// The data that it trains on.
    pub data: Fingerprint,
    pub progress: Progress,
}

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
    /// SHA-256 of these bytes. They hold wall times, so no two runs have the same.
    pub log_sha256: String,
}

/// Everything that a resumed run starts from.
pub(super) struct State {
    pub header: Header,
    pub weights: Checkpoint,
    /// As [`Trainer::optimizer_bytes`] gave it.
    pub optimizer: Vec<u8>,
}

fn checksum(header: &str, weights: &[u8], optimizer: &[u8]) -> String {
    let mut hash = Sha256::new();
    for part in [header.as_bytes(), weights, optimizer] {
        hash.update((part.len() as u64).to_le_bytes());
        hash.update(part);
    }
    hex(hash)
}

/// Writes the state of a run after an epoch, whole or not at all.
pub(super) fn save(folder: &Path, trainer: &Trainer, header: &Header) -> Result<()> {
    let weights = trainer.checkpoint(BTreeMap::new())?.to_safetensors()?;
    let optimizer = trainer.optimizer_bytes()?;
    let failed =
        |e: &dyn std::fmt::Display| Error::new(ErrorKind::Io, format!("the state of the run: {e}"));
    let header = serde_json::to_string(header).map_err(|e| failed(&e))?;
    let view =
        |bytes| TensorView::new(Dtype::U8, vec![<[u8]>::len(bytes)], bytes).map_err(|e| failed(&e));
    let tensors = [(WEIGHTS, view(&weights)?), (OPTIMIZER, view(&optimizer)?)];
    let checksum = checksum(&header, &weights, &optimizer);
    let metadata = HashMap::from([(HEADER.to_owned(), header), (CHECKSUM.to_owned(), checksum)]);
    let bytes = safetensors::serialize(tensors, Some(metadata)).map_err(|e| failed(&e))?;
    atomic::write(&folder.join(STATE), &bytes)
}

/// Reads the state of a run and checks that it is what [`save`] wrote.
pub(super) fn load(folder: &Path) -> Result<State> {
    let path = folder.join(STATE);
    let bytes = fs::read(&path).map_err(|e| Error::io(path.display(), &e))?;
    parse(&bytes).map_err(|e| e.at(path.display()))
}

fn parse(bytes: &[u8]) -> Result<State> {
    let damaged = |e: &dyn std::fmt::Display| {
        Error::input(format!(
            "the state of the run is damaged ({e}); start again in another folder"
        ))
    };
    let (_, found) = SafeTensors::read_metadata(bytes).map_err(|e| damaged(&e))?;
    let metadata = found.metadata().as_ref();
    let value = |key| metadata.and_then(|m| m.get(key));
    let (Some(header), Some(expected)) = (value(HEADER), value(CHECKSUM)) else {
        return Err(match value(UNCHECKED) {
            Some(_) => Error::input(
                "an earlier version of tracklens wrote the state of the run, without a checksum; go \
                 on with that version, or start again in another folder",
            ),
            None => damaged(&"its checksum is missing"),
        });
    };
    let file = SafeTensors::deserialize(bytes).map_err(|e| damaged(&e))?;
    let part = |name| file.tensor(name).map(|t| t.data()).map_err(|e| damaged(&e));
    let (weights, optimizer) = (part(WEIGHTS)?, part(OPTIMIZER)?);
    if checksum(header, weights, optimizer) != *expected {
        return Err(damaged(&"its checksum does not match its content"));
    }
    Ok(State {
        header: serde_json::from_str(header).map_err(|e| damaged(&e))?,
        weights: Checkpoint::from_safetensors(weights)?,
        optimizer: optimizer.to_vec(),
    })
}
