//! Tensors by name with their configuration: a checkpoint.

use std::collections::BTreeMap;

use super::authors::Said;
use super::formats::{self, Contents, Format};
use super::{SaeConfig, Tensor};
use crate::error::{Error, Result};
use crate::memory;

/// The metadata that holds the configuration.
pub(super) const CONFIG_KEY: &str = "tracklens.config";
/// The metadata that holds the authors' configuration, under the name it has in their files.
const AUTHORS_KEY: &str = "cfg";

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
    /// Reads a checkpoint of any [`Format`], recognised by its first bytes.
    ///
    /// # Errors
    /// When the bytes are not a complete file of a known format, when a tensor is missing, has another
    /// shape or a value that is not finite, or when the file holds another architecture.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self> {
        Self::from_bytes_at(bytes, None)
    }

    /// As [`Checkpoint::from_bytes`], of the weights whose names begin with `key` and a dot, where a
    /// file has several sets of weights: those of an average (`ema`), of an actor and a critic.
    ///
    /// # Errors
    /// As [`Checkpoint::from_bytes`], and when there are none under that key.
    pub fn from_bytes_at(bytes: &[u8], key: Option<&str>) -> Result<Self> {
        // The tensors are at least as large as what they are read from, but for doubles.
        memory::check(
            bytes.len() as u64 / 2,
            "tensors",
            "use a checkpoint with fewer channels",
        )?;
        Self::from_contents(formats::read(bytes, key)?)
    }

    /// Reads `.safetensors` files that hold the parts of one checkpoint.
    ///
    /// # Errors
    /// As [`Checkpoint::from_bytes`], and when a tensor is in two of them.
    pub fn from_shards(shards: &[Vec<u8>], key: Option<&str>) -> Result<Self> {
        Self::from_contents(formats::read_shards(shards, key)?)
    }

    /// Reads a `.safetensors` file.
    ///
    /// # Errors
    /// As [`Checkpoint::from_bytes`], and when the file has another format.
    pub fn from_safetensors(bytes: &[u8]) -> Result<Self> {
        Self::from_contents(formats::read_safetensors(bytes)?)
    }

    fn from_contents(
        Contents {
            tensors,
            metadata,
            left_out,
        }: Contents,
    ) -> Result<Self> {
        // What is missing may be there as something that cannot be read.
        let needed = left_out
            .iter()
            .find(|(name, _)| name.starts_with("encoder.") || name.starts_with("decoder."));
        Self::of_parts(tensors, metadata).map_err(|e| match needed {
            Some((name, what)) => formats::not_float(name, what),
            None => e,
        })
    }

    fn of_parts(
        tensors: BTreeMap<String, Tensor>,
        mut metadata: BTreeMap<String, String>,
    ) -> Result<Self> {
        let config = match metadata.remove(CONFIG_KEY) {
            Some(json) => serde_json::from_str(&json).map_err(|e| {
                Error::input(format!(
                    "the metadata `{CONFIG_KEY}` is not a configuration this version understands: {e}"
                ))
            })?,
            None => {
                let cfg = metadata.get(AUTHORS_KEY);
                let cfg = cfg.and_then(|json| serde_json::from_str(json).ok());
                SaeConfig::infer(&tensors, &cfg.as_ref().map(Said::read).unwrap_or_default())?
            }
        };
        let checkpoint = Self {
            config,
            tensors,
            metadata,
        };
        checkpoint.validate()?;
        Ok(checkpoint)
    }

    /// The bytes of a file with the configuration and the metadata in it.
    ///
    /// # Errors
    /// When the tensors do not fit the configuration.
    pub fn to_bytes(&self, format: Format) -> Result<Vec<u8>> {
        self.validate()?;
        let mut metadata = self.metadata.clone();
        metadata.insert(CONFIG_KEY.to_owned(), self.config_json()?);
        let tensors = self.tensors.clone();
        formats::write(
            format,
            &Contents {
                tensors,
                metadata,
                ..Contents::default()
            },
        )
    }

    /// The bytes of a `.safetensors` file with the configuration and the metadata in its header.
    ///
    /// # Errors
    /// As [`Checkpoint::to_bytes`].
    pub fn to_safetensors(&self) -> Result<Vec<u8>> {
        self.to_bytes(Format::Safetensors)
    }

    pub(super) fn config_json(&self) -> Result<String> {
        serde_json::to_string(&self.config)
            .map_err(|e| Error::input(format!("the configuration cannot be written: {e}")))
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

    /// The tensor `name`, to be changed.
    ///
    /// # Errors
    /// When there is none.
    pub fn tensor_mut(&mut self, name: &str) -> Result<&mut Tensor> {
        self.tensors
            .get_mut(name)
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
