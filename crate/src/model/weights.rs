//! Between the module tree and a checkpoint's named tensors.

use std::collections::BTreeMap;

use burn::module::{Module as _, ModuleVisitor, Param, ParamId, RunningState};
use burn::nn::PaddingConfig2d;
use burn::nn::conv::Conv2d;
use burn::prelude::{Device, Tensor, TensorData};
use burn::tensor::Gradients;

use super::{BatchNorm, Sae, host_values};
use crate::checkpoint::{self, Checkpoint, ConvLayer, SaeConfig, TEMPERATURE};
use crate::error::{Error, Result};

/// Takes modules out of a checkpoint by name.
pub(super) struct Loader<'a> {
    checkpoint: &'a Checkpoint,
    device: &'a Device,
    /// Of the state dict, in order.
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

    /// Gives a parameter the number of its tensor in the state dict. By it the stored moments of an optimizer find the
    /// parameter again; burn's own numbers are drawn anew every time.
    fn identified<const D: usize>(&self, name: &str, mut parameter: Param<Tensor<D>>) -> Param<Tensor<D>> {
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

/// Every weight and buffer of an SAE by its name in the state dict.
pub(super) fn collect(sae: &Sae, config: &SaeConfig) -> Result<BTreeMap<String, checkpoint::Tensor>> {
    // Running statistics of the last batch are merged on this call; a visit alone would miss them.
    Collector::new(config).visit(&sae.valid(), config)
}

/// The gradients of the weights of an SAE by their names in the state dict.
pub(super) fn gradients(
    sae: &Sae,
    gradients: &Gradients,
    config: &SaeConfig,
) -> Result<BTreeMap<String, checkpoint::Tensor>> {
    let collector = Collector {
        gradients: Some(gradients),
        ..Collector::new(config)
    };
    collector.visit(sae, config)
}

/// The modules of the state dict by their path in the module tree, where the two differ.
fn names(config: &SaeConfig) -> BTreeMap<String, String> {
    let mut names = BTreeMap::from([("encoder.temperature".to_owned(), TEMPERATURE.to_owned())]);
    for (part, layers) in [
        ("encoder", config.encoder_layers()),
        ("decoder", config.decoder_layers()),
    ] {
        for (i, layer) in layers.into_iter().enumerate() {
            for module in ["weight", "bias"] {
                names.insert(
                    format!("{part}.layers.{i}.conv.{module}"),
                    format!("{}.{module}", layer.name),
                );
            }
            for module in ["weight", "bias", "running_mean", "running_var"] {
                if let Some(norm) = &layer.norm {
                    names.insert(
                        format!("{part}.layers.{i}.norm.{module}"),
                        format!("{norm}.{module}"),
                    );
                }
            }
        }
    }
    names
}

struct Collector<'a> {
    names: BTreeMap<String, String>,
    path: Vec<String>,
    gradients: Option<&'a Gradients>,
    tensors: BTreeMap<String, checkpoint::Tensor>,
    failure: Option<Error>,
}

impl Collector<'_> {
    fn new(config: &SaeConfig) -> Self {
        Self {
            names: names(config),
            path: Vec::new(),
            gradients: None,
            tensors: BTreeMap::new(),
            failure: None,
        }
    }

    fn visit(mut self, sae: &Sae, config: &SaeConfig) -> Result<BTreeMap<String, checkpoint::Tensor>> {
        sae.visit(&mut self);
        if let Some(error) = self.failure {
            return Err(error);
        }
        // The module may hold a tensor of the same values in another shape.
        for (name, shape) in config.tensor_shapes() {
            if let Some(tensor) = self.tensors.get_mut(&name) {
                tensor.shape = shape;
            }
        }
        Ok(self.tensors)
    }
}

impl ModuleVisitor for Collector<'_> {
    fn visit_float<const D: usize>(&mut self, param: &Param<Tensor<D>>) {
        let path = self.path.join(".");
        let name = self.names.get(&path).cloned().unwrap_or(path);
        let values = match self.gradients {
            None => param.val(),
            Some(gradients) => match param.val().grad(gradients) {
                Some(gradient) => gradient,
                None => return,
            },
        };
        let shape = values.dims().to_vec();
        match host_values(values) {
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
