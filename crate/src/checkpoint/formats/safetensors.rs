//! `.safetensors`.

use std::borrow::Cow;
use std::collections::{BTreeMap, HashMap};

use safetensors::tensor::{Dtype, SafeTensors, View};
use serde_json::Value;

use super::choice::{Choice, Wanted};
use super::contents::Contents;
use super::element::{Element, is_counter};
use crate::checkpoint::Tensor;
use crate::error::{Error, Result};

pub fn read(bytes: &[u8], wanted: Wanted) -> Result<Contents> {
    let not_readable = |e| {
        Error::input(format!(
            "not a complete .safetensors file ({} bytes: {e}); was the download or the copy cut short?",
            bytes.len()
        ))
    };
    let (_, header) = SafeTensors::read_metadata(bytes).map_err(not_readable)?;
    let file = SafeTensors::deserialize(bytes).map_err(not_readable)?;
    let choice = Choice::of(file.iter().map(|(name, _)| name), wanted)?;
    let (mut tensors, mut left_out) = (BTreeMap::new(), BTreeMap::new());
    for (name, view) in file.iter() {
        let Some(name) = choice.name(name) else {
            continue;
        };
        let element = match view.dtype() {
            Dtype::F64 => Element::F64,
            Dtype::F32 => Element::F32,
            Dtype::F16 => Element::F16,
            Dtype::BF16 => Element::Bf16,
            _ if is_counter(name) => continue,
            other => {
                left_out.insert(name.to_owned(), format!("{other:?}"));
                continue;
            }
        };
        let shape = view.shape().to_vec();
        let data = element.floats(view.data());
        tensors.insert(name.to_owned(), Tensor { shape, data });
    }
    let metadata = header
        .metadata()
        .iter()
        .flatten()
        .map(|(k, v)| (k.clone(), v.clone()))
        .collect();
    let contents = Contents {
        tensors,
        metadata,
        left_out,
    };
    Ok(contents.chosen(&choice))
}

pub fn write(contents: &Contents) -> Result<Vec<u8>> {
    let failed =
        |e: &dyn std::fmt::Display| Error::input(format!("the checkpoint cannot be written: {e}"));
    let metadata: HashMap<String, String> = contents.metadata.clone().into_iter().collect();
    let bytes =
        safetensors::serialize(&contents.tensors, Some(metadata)).map_err(|e| failed(&e))?;
    sorted(&bytes).map_err(|e| failed(&e))
}

/// The same file with its header in alphabetical order: `safetensors` writes the metadata in the
/// random order of a hash map, and equal checkpoints have to be equal files. A map of `serde_json`
/// would keep that order where another crate asks for it.
fn sorted(bytes: &[u8]) -> serde_json::Result<Vec<u8>> {
    const LENGTH: usize = size_of::<u64>();
    let (length, rest) = bytes.split_at(LENGTH);
    let length = length.iter().rev().fold(0, |n, b| n << 8 | usize::from(*b));
    let (header, data) = rest.split_at(length);
    let header: BTreeMap<String, BTreeMap<String, Value>> = serde_json::from_slice(header)?;
    let mut header = serde_json::to_vec(&header)?;
    header.resize(header.len().next_multiple_of(LENGTH), b' ');
    let length = (header.len() as u64).to_le_bytes();
    Ok([&length, header.as_slice(), data].concat())
}

impl View for &Tensor {
    fn dtype(&self) -> Dtype {
        Dtype::F32
    }

    fn shape(&self) -> &[usize] {
        &self.shape
    }

    fn data(&self) -> Cow<'_, [u8]> {
        Cow::Owned(self.to_le_bytes())
    }

    fn data_len(&self) -> usize {
        self.data.len() * 4
    }
}
