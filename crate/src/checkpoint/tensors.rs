//! Reading and writing `.safetensors`.

use std::borrow::Cow;
use std::collections::{BTreeMap, HashMap};

use safetensors::tensor::{Dtype, SafeTensors, View};

use super::SaeConfig;
use crate::error::{Error, Result};

const CONFIG_KEY: &str = "tracklens.config";

/// A dense f32 tensor in row-major order.
#[derive(Debug, Clone, PartialEq)]
pub struct Tensor {
    /// The extent of every axis.
    pub shape: Vec<usize>,
    /// The values, row-major.
    pub data: Vec<f32>,
}

/// The weights of an SAE under the authors' tensor names, its configuration and free-form metadata.
#[derive(Debug, Clone, PartialEq)]
pub struct Checkpoint {
    /// The architecture and sizes.
    pub config: SaeConfig,
    /// Weights and buffers by name. Integer counters (`num_batches_tracked`) are left out.
    pub tensors: BTreeMap<String, Tensor>,
    /// Whatever else the file says about itself, e.g. the training configuration.
    pub metadata: BTreeMap<String, String>,
}

impl Checkpoint {
    /// Reads a `.safetensors` file.
    ///
    /// # Errors
    /// When the bytes are not a complete safetensors file, when a tensor is missing, has another shape or a
    /// value that is not finite, or when the file holds another architecture.
    pub fn from_safetensors(bytes: &[u8]) -> Result<Self> {
        let (_, header) = SafeTensors::read_metadata(bytes).map_err(|e| not_readable(bytes, &e))?;
        let file = SafeTensors::deserialize(bytes).map_err(|e| not_readable(bytes, &e))?;
        let mut tensors = BTreeMap::new();
        for (name, view) in file.iter() {
            if view.dtype() == Dtype::F32 {
                let data = view
                    .data()
                    .chunks_exact(4)
                    .map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]]))
                    .collect();
                let shape = view.shape().to_vec();
                tensors.insert(name.to_owned(), Tensor { shape, data });
            } else if !name.ends_with("num_batches_tracked") {
                return Err(Error::input(format!(
                    "tensor `{name}` is {:?}; expected F32 weights",
                    view.dtype()
                )));
            }
        }
        let mut metadata: BTreeMap<String, String> = header
            .metadata()
            .iter()
            .flatten()
            .map(|(k, v)| (k.clone(), v.clone()))
            .collect();
        let config = match metadata.remove(CONFIG_KEY) {
            Some(json) => serde_json::from_str(&json).map_err(|e| {
                Error::input(format!(
                    "the metadata `{CONFIG_KEY}` is not a configuration this version understands: {e}"
                ))
            })?,
            None => SaeConfig::infer(&tensors)?,
        };
        let checkpoint = Self {
            config,
            tensors,
            metadata,
        };
        checkpoint.validate()?;
        Ok(checkpoint)
    }

    /// The bytes of a `.safetensors` file with the configuration and the metadata in its header.
    ///
    /// # Errors
    /// When the tensors do not fit the configuration.
    pub fn to_safetensors(&self) -> Result<Vec<u8>> {
        self.validate()?;
        let failed =
            |e: &dyn std::fmt::Display| Error::input(format!("the checkpoint cannot be written: {e}"));
        let mut header: HashMap<String, String> = self.metadata.clone().into_iter().collect();
        let config = serde_json::to_string(&self.config).map_err(|e| failed(&e))?;
        header.insert(CONFIG_KEY.to_owned(), config);
        safetensors::serialize(&self.tensors, Some(header)).map_err(|e| failed(&e))
    }

    /// The tensor `name`.
    ///
    /// # Errors
    /// When there is none.
    pub fn tensor(&self, name: &str) -> Result<&Tensor> {
        self.tensors
            .get(name)
            .ok_or_else(|| Error::input(format!("the checkpoint has no tensor `{name}`")))
    }

    fn validate(&self) -> Result<()> {
        self.config.validate()?;
        for (name, shape) in self.config.tensor_shapes() {
            let is_encoder = name.starts_with("encoder.");
            let Some(tensor) = self.tensors.get(&name) else {
                // An encoder alone is a useful file: extraction needs nothing else.
                if is_encoder || self.has_decoder() {
                    return Err(Error::input(format!(
                        "tensor `{name}` is missing; expected shape {shape:?} for a {} with {} keypoints",
                        self.config.architecture, self.config.keypoints
                    )));
                }
                continue;
            };
            if tensor.shape != shape {
                return Err(Error::input(format!(
                    "tensor `{name}` has shape {:?}; expected {shape:?} for a {} with {} keypoints",
                    tensor.shape, self.config.architecture, self.config.keypoints
                )));
            }
            if let Some(i) = tensor.data.iter().position(|v| !v.is_finite()) {
                return Err(Error::input(format!(
                    "tensor `{name}` holds {} at position {i}; the weights are damaged or the training \
                     diverged",
                    tensor.data[i]
                )));
            }
        }
        Ok(())
    }

    /// Whether the decoder's weights are there too.
    pub fn has_decoder(&self) -> bool {
        self.tensors.keys().any(|name| name.starts_with("decoder."))
    }
}

fn not_readable(bytes: &[u8], error: &dyn std::fmt::Display) -> Error {
    Error::input(format!(
        "not a complete .safetensors file ({} bytes: {error}); was the download or the copy cut short?",
        bytes.len()
    ))
}

impl View for &Tensor {
    fn dtype(&self) -> Dtype {
        Dtype::F32
    }

    fn shape(&self) -> &[usize] {
        &self.shape
    }

    fn data(&self) -> Cow<'_, [u8]> {
        Cow::Owned(self.data.iter().flat_map(|v| v.to_le_bytes()).collect())
    }

    fn data_len(&self) -> usize {
        self.data.len() * 4
    }
}
