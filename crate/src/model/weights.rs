//! Between the module tree and a checkpoint's named tensors.

use std::collections::BTreeMap;

use burn::module::{Module, ModuleVisitor, Param, RunningState};
use burn::nn::PaddingConfig2d;
use burn::nn::conv::Conv2d;
use burn::prelude::{Device, Tensor, TensorData};

use super::{BatchNorm, host_values};
use crate::checkpoint::{self, Checkpoint};
use crate::error::{Error, Result};

/// Takes modules out of a checkpoint by name.
pub(super) struct Loader<'a> {
    checkpoint: &'a Checkpoint,
    device: &'a Device,
}

impl<'a> Loader<'a> {
    pub(super) fn new(checkpoint: &'a Checkpoint, device: &'a Device) -> Self {
        Self { checkpoint, device }
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
        Ok(Param::from_data(data, self.device))
    }

    fn buffer(&self, name: &str) -> Result<RunningState<Tensor<1>>> {
        let (_, data) = self.data::<1>(name)?;
        Ok(RunningState::new(Tensor::from_data(data, self.device)))
    }

    /// A convolution that keeps the size of its input, with the kernel the weight has; with a bias when there is
    /// one.
    pub(super) fn conv(&self, name: &str) -> Result<Conv2d> {
        let weight = format!("{name}.weight");
        let bias = format!("{name}.bias");
        let ([_, _, height, width], data) = self.data::<4>(&weight)?;
        let (pad_y, pad_x) = (height / 2, width / 2);
        Ok(Conv2d {
            weight: Param::from_data(data, self.device),
            bias: self
                .checkpoint
                .tensors
                .contains_key(&bias)
                .then(|| self.parameter(&bias))
                .transpose()?,
            stride: [1, 1],
            kernel_size: [height, width],
            dilation: [1, 1],
            groups: 1,
            padding: PaddingConfig2d::Explicit(pad_y, pad_x, pad_y, pad_x),
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

/// Every weight and buffer of a module by its path in the module tree.
pub(super) fn collect(module: &impl Module) -> Result<BTreeMap<String, checkpoint::Tensor>> {
    let mut collector = Collector::default();
    // Running statistics of the last batch are merged on this call; a visit alone would miss them.
    module.valid().visit(&mut collector);
    match collector.failure {
        Some(error) => Err(error),
        None => Ok(collector.tensors),
    }
}

#[derive(Default)]
struct Collector {
    path: Vec<String>,
    tensors: BTreeMap<String, checkpoint::Tensor>,
    failure: Option<Error>,
}

impl ModuleVisitor for Collector {
    fn visit_float<const D: usize>(&mut self, param: &Param<Tensor<D>>) {
        let name = self.path.join(".");
        let shape = param.dims().to_vec();
        match host_values(param.val().into_data()) {
            Ok(data) => {
                self.tensors.insert(name, checkpoint::Tensor { shape, data });
            }
            Err(error) => self.failure = Some(error.at(format!("tensor `{name}`"))),
        }
    }

    fn enter_module(&mut self, name: &str, _container: &str) {
        self.path.push(name.to_owned());
    }

    fn exit_module(&mut self, _name: &str, _container: &str) {
        self.path.pop();
    }
}
