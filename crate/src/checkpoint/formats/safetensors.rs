//! `.safetensors`.

use std::borrow::Cow;
use std::collections::{BTreeMap, HashMap};

use safetensors::tensor::{Dtype, SafeTensors, View};

use super::{Contents, Element, is_counter, not_float};
use crate::checkpoint::Tensor;
use crate::error::{Error, Result};

pub fn read(bytes: &[u8]) -> Result<Contents> {
    let not_readable = |e| {
        Error::input(format!(
            "not a complete .safetensors file ({} bytes: {e}); was the download or the copy cut short?",
            bytes.len()
        ))
    };
    let (_, header) = SafeTensors::read_metadata(bytes).map_err(not_readable)?;
    let file = SafeTensors::deserialize(bytes).map_err(not_readable)?;
    let mut tensors = BTreeMap::new();
    for (name, view) in file.iter() {
        let element = match view.dtype() {
            Dtype::F64 => Element::F64,
            Dtype::F32 => Element::F32,
            Dtype::F16 => Element::F16,
            Dtype::BF16 => Element::Bf16,
            _ if is_counter(name) => continue,
            other => return Err(not_float(name, &format_args!("{other:?}"))),
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
    Ok(Contents { tensors, metadata })
}

pub fn write(contents: &Contents) -> Result<Vec<u8>> {
    let header: HashMap<String, String> = contents.metadata.clone().into_iter().collect();
    safetensors::serialize(&contents.tensors, Some(header))
        .map_err(|e| Error::input(format!("the checkpoint cannot be written: {e}")))
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
