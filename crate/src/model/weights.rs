//! From a checkpoint's named tensors to the module tree.

use burn::module::{Param, ParamId, RunningState};
use burn::nn::PaddingConfig2d;
use burn::nn::conv::Conv2d;
use burn::prelude::{Device, Tensor, TensorData};

use super::BatchNorm;
use crate::checkpoint::{Checkpoint, ConvLayer};
use crate::error::{Error, Result};

/// Takes modules out of a checkpoint by name.
pub(super) struct Loader<'a> {
    checkpoint: &'a Checkpoint,
    device: &'a Device,
    /// The names of the state dict, in order.
    names: Vec<String>,
}

impl<'a> Loader<'a> {
    pub(super) fn new(checkpoint: &'a Checkpoint, device: &'a Device) -> Self {
        let shapes = checkpoint.config.tensor_shapes();
        Self {
            checkpoint,
            device,
            names: shapes.into_iter().map(|(name, _)| name).collect(),
        }
    }

    fn data<const D: usize>(&self, name: &str) -> Result<([usize; D], TensorData)> {
        let tensor = self.checkpoint.tensor(name)?;
        let shape: [usize; D] = tensor.shape.as_slice().try_into().map_err(|_| {
            Error::input(format!(
                "tensor `{name}` has shape {:?}; expected {D} axes",
                tensor.shape
            ))
        })?;
        Ok((shape, TensorData::new(tensor.data.clone(), shape)))
    }

    pub(super) fn parameter<const D: usize>(&self, name: &str) -> Result<Param<Tensor<D>>> {
        let (_, data) = self.data::<D>(name)?;
        Ok(self.identified(name, Param::from_data(data, self.device)))
    }

    /// All values of a tensor of any shape, as a vector.
    pub(super) fn vector(&self, name: &str) -> Result<Param<Tensor<1>>> {
        let values = self.checkpoint.tensor(name)?.data.clone();
        let count = values.len();
        let data = TensorData::new(values, [count]);
        Ok(self.identified(name, Param::from_data(data, self.device)))
    }

    /// Gives a parameter the number of its tensor in the state dict. By it the stored moments of an
    /// optimizer find the parameter again; burn's own numbers are drawn anew every time.
    fn identified<const D: usize>(
        &self,
        name: &str,
        mut parameter: Param<Tensor<D>>,
    ) -> Param<Tensor<D>> {
        if let Some(number) = self.names.iter().position(|n| n == name) {
            parameter.id = ParamId::from(number as u64);
        }
        parameter
    }

    fn buffer(&self, name: &str) -> Result<RunningState<Tensor<1>>> {
        let (_, data) = self.data::<1>(name)?;
        Ok(RunningState::new(Tensor::from_data(data, self.device)))
    }

    /// The convolution of a layer, with its bias where it has no batch norm.
    pub(super) fn conv(&self, layer: &ConvLayer) -> Result<Conv2d> {
        let bias = layer.norm.is_none().then(|| format!("{}.bias", layer.name));
        let padding = layer.padding;
        Ok(Conv2d {
            weight: self.parameter(&format!("{}.weight", layer.name))?,
            bias: bias.map(|name| self.parameter(&name)).transpose()?,
            stride: [layer.stride; 2],
            kernel_size: [layer.kernel; 2],
            dilation: [1, 1],
            groups: 1,
            padding: PaddingConfig2d::Explicit(padding, padding, padding, padding),
        })
    }

    pub(super) fn batch_norm(&self, name: &str) -> Result<BatchNorm> {
        Ok(BatchNorm {
            weight: self.parameter(&format!("{name}.weight"))?,
            bias: self.parameter(&format!("{name}.bias"))?,
            running_mean: self.buffer(&format!("{name}.running_mean"))?,
            running_var: self.buffer(&format!("{name}.running_var"))?,
        })
    }
}
