//! What training takes out of the module tree, by the names of the state dict: weights, buffers,
//! gradients.

use std::collections::BTreeMap;

use burn::module::{Module as _, ModuleVisitor, Param};
use burn::prelude::Tensor;
use burn::tensor::Gradients;

use super::{Sae, host_values};
use crate::checkpoint::{self, Checkpoint, SaeConfig, TEMPERATURE};
use crate::error::{Error, Result};

impl Sae {
    /// The weights as a checkpoint of `config` with `metadata`.
    ///
    /// # Errors
    /// When the device does not give the values back.
    pub fn to_checkpoint(
        &self,
        config: &SaeConfig,
        metadata: BTreeMap<String, String>,
    ) -> Result<Checkpoint> {
        Ok(Checkpoint {
            config: config.clone(),
            // Running statistics of the last batch are merged on this call; a visit alone would
            // miss them.
            tensors: Collector::new(config).visit(&self.valid(), config)?,
            metadata,
        })
    }

    /// The gradients of its weights by their names in the state dict; weights that got none are
    /// left out.
    ///
    /// # Errors
    /// When the device does not give the values back.
    pub fn gradients(
        &self,
        gradients: &Gradients,
        config: &SaeConfig,
    ) -> Result<BTreeMap<String, checkpoint::Tensor>> {
        Collector {
            gradients: Some(gradients),
            ..Collector::new(config)
        }
        .visit(self, config)
    }
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

    fn visit(
        mut self,
        sae: &Sae,
        config: &SaeConfig,
    ) -> Result<BTreeMap<String, checkpoint::Tensor>> {
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
                self.tensors
                    .insert(name, checkpoint::Tensor { shape, data });
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
