//! The containers that weights come in, one file a format, behind one way in: bytes to tensors by
//! name.
//!
//! All are read here rather than with `pytorch-reader` and `burn-pack`: those add 170 KB and 120 KB
//! (gzipped) to the page's module, and neither gives the configuration that the authors save with
//! the weights. The tests hold these readers against them.

mod burnpack;
mod choice;
mod contents;
mod element;
mod json;
mod pytorch;
mod safetensors;

use std::collections::BTreeMap;

use choice::{Choice, Wanted};
pub(super) use contents::Contents;
pub(super) use element::not_float;

use super::Tensor;
use crate::error::{Error, Result};
use crate::pickle;

/// The container that weights are stored in.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Format {
    /// `.safetensors`.
    Safetensors,
    /// What `torch.save` writes: `.pth`, `.pt`.
    PyTorch,
    /// burn's `.bpk`.
    Burnpack,
}

impl Format {
    /// The format that a file has by its first bytes (as many as there are; 64 are enough).
    pub fn of(head: &[u8]) -> Option<Self> {
        if head.starts_with(b"PK\x03\x04") {
            // The pickle is the first entry of what torch.save writes; other archives are something
            // else.
            let name = &head[head.len().min(30)..head.len().min(512)];
            let is_torch = name.windows(8).any(|part| part == b"data.pkl");
            return is_torch.then_some(Self::PyTorch);
        }
        if pytorch::is_legacy(head) {
            return Some(Self::PyTorch);
        }
        if head.starts_with(burnpack::MAGIC) {
            return Some(Self::Burnpack);
        }
        // The length of a JSON header, then the header. The format limits it to 100 MB.
        let length = head.first_chunk().map(|b| u64::from_le_bytes(*b))?;
        (length <= 100_000_000 && head.get(8) == Some(&b'{')).then_some(Self::Safetensors)
    }

    /// The format of files with this ending (without the dot).
    pub fn from_extension(extension: &str) -> Option<Self> {
        match extension.to_ascii_lowercase().as_str() {
            "safetensors" => Some(Self::Safetensors),
            "pth" | "pt" => Some(Self::PyTorch),
            "bpk" => Some(Self::Burnpack),
            _ => None,
        }
    }
}

impl std::fmt::Display for Format {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Safetensors => "safetensors",
            Self::PyTorch => "PyTorch",
            Self::Burnpack => "burnpack",
        })
    }
}

/// The tensors of a file of any [`Format`], whatever network they belong to, as f32. Counters and
/// other tensors that are no floating-point numbers are left out, and so is the prefix that a
/// wrapper such as `DataParallel` puts before every name.
///
/// # Errors
/// When the file is of another format, damaged, or holds a tensor that cannot be represented.
pub fn read_tensors(bytes: &[u8]) -> Result<BTreeMap<String, Tensor>> {
    let mut contents = read_wanted(bytes, Wanted::Everything)?;
    if let (true, Some((name, what))) = (
        contents.tensors.is_empty(),
        contents.left_out.first_key_value(),
    ) {
        return Err(not_float(name, what));
    }
    for prefix in ["module.", "_orig_mod."] {
        if !contents.tensors.is_empty()
            && contents.tensors.keys().all(|name| name.starts_with(prefix))
        {
            let strip =
                |(name, tensor): (String, Tensor)| (name[prefix.len()..].to_owned(), tensor);
            contents.tensors = contents.tensors.into_iter().map(strip).collect();
        }
    }
    Ok(contents.tensors)
}

/// The weights of an SAE in a file; `key` says which, by what stands before `encoder.`, where there
/// are several.
pub(super) fn read(bytes: &[u8], key: Option<&str>) -> Result<Contents> {
    read_wanted(bytes, Wanted::Sae(key))
}

fn read_wanted(bytes: &[u8], wanted: Wanted) -> Result<Contents> {
    match Format::of(bytes) {
        Some(Format::Safetensors) => safetensors::read(bytes, wanted),
        // The policy in an archive begins like a checkpoint of its own, soon after the archive does.
        Some(Format::PyTorch) => match pytorch::read_policy(bytes, wanted)? {
            Some(policy) => Ok(policy),
            None => pytorch::read(bytes, wanted),
        },
        Some(Format::Burnpack) => burnpack::read(bytes, wanted),
        None => pytorch::read_policy(bytes, wanted)?.ok_or_else(|| unknown(bytes)),
    }
}

/// The weights of an SAE in `.safetensors` files that hold its parts.
pub(super) fn read_shards(shards: &[Vec<u8>], key: Option<&str>) -> Result<Contents> {
    let mut all = Contents::default();
    for shard in shards {
        let contents = safetensors::read(shard, Wanted::Everything)?;
        for (name, tensor) in contents.tensors {
            if all.tensors.insert(name.clone(), tensor).is_some() {
                return Err(Error::input(format!(
                    "tensor `{name}` is in two of the files; expected the parts of one checkpoint"
                )));
            }
        }
        all.metadata.extend(contents.metadata);
        all.left_out.extend(contents.left_out);
    }
    let choice = Choice::of(all.tensors.keys().map(String::as_str), Wanted::Sae(key))?;
    let named = |(name, tensor): (String, Tensor)| Some((choice.name(&name)?.to_owned(), tensor));
    all.tensors = all.tensors.into_iter().filter_map(named).collect();
    Ok(all.chosen(&choice))
}

pub(super) fn read_safetensors(bytes: &[u8]) -> Result<Contents> {
    safetensors::read(bytes, Wanted::Sae(None))
}

pub(super) fn write(format: Format, contents: &Contents) -> Result<Vec<u8>> {
    match format {
        Format::Safetensors => safetensors::write(contents),
        Format::PyTorch => pytorch::write(contents),
        Format::Burnpack => burnpack::write(contents),
    }
}

fn unknown(bytes: &[u8]) -> Error {
    if pickle::is_pickle(bytes) {
        return Error::input(
            "a pickle that torch.save did not write; expected a checkpoint: .safetensors, PyTorch's .pth or burn's .bpk",
        );
    }
    if bytes.starts_with(b"PK") {
        return Error::input(
            "a ZIP archive that torch.save did not write; expected a checkpoint: .safetensors, PyTorch's .pth or \
             burn's .bpk",
        );
    }
    Error::input(format!(
        "not a checkpoint ({} bytes); expected .safetensors, PyTorch's .pth or burn's .bpk",
        bytes.len()
    ))
}
