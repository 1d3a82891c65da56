//! `rten`: loads a model that [`Graph`](super::Graph) let through, and runs it.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;

use rten::{Model, ModelOptions, NodeId, RunOptions, ThreadPool, Value};
use rten_tensor::Tensor;
use rten_tensor::prelude::*;

use super::graph::Element;
use super::operators::registry;
use crate::error::{Error, Result};

/// Threads for one run at a time.
pub(super) type Threads = Arc<ThreadPool>;

/// `count` threads.
#[cfg(not(target_arch = "wasm32"))]
pub(super) fn threads(count: usize) -> Threads {
    Arc::new(ThreadPool::with_num_threads(count))
}

/// A model, ready to run.
pub(super) struct Session {
    model: Model,
    input: NodeId,
    outputs: Vec<NodeId>,
}

impl Session {
    /// Loads a model to compute its outputs `outputs` from its input `input`.
    ///
    /// # Errors
    /// When the runtime does not take it.
    pub fn new(bytes: Vec<u8>, input: &str, outputs: &[&str]) -> Result<Self> {
        let load = || {
            let mut options = ModelOptions::with_ops(registry());
            let model = options.prepack_weights(true).load(bytes);
            let model = model.map_err(|e| Error::input(format!("the model does not load: {e}")))?;
            let node = |name: &str| {
                model.node_id(name).map_err(|e| {
                    Error::input(format!("nothing in the model computes `{name}`: {e}"))
                })
            };
            let input = node(input)?;
            let outputs = outputs
                .iter()
                .map(|name| node(name))
                .collect::<Result<_>>()?;
            Ok(Self {
                model,
                input,
                outputs,
            })
        };
        guard("load", load)
    }

    /// The shapes and values of the outputs for an input of `shape`.
    ///
    /// # Errors
    /// When an operator fails, or an output is not of floats.
    pub fn run(
        &self,
        values: Vec<f32>,
        shape: [usize; 4],
        element: Element,
        threads: Option<&Threads>,
    ) -> Result<Vec<(Vec<usize>, Vec<f32>)>> {
        let input: Value = match element {
            Element::Byte => {
                let bytes: Vec<u8> = values.into_iter().map(|v| v as u8).collect();
                Tensor::from_data(&shape, bytes).into()
            }
            Element::Integer => {
                let integers: Vec<i32> = values.into_iter().map(|v| v as i32).collect();
                Tensor::from_data(&shape, integers).into()
            }
            Element::Float | Element::Other => Tensor::from_data(&shape, values).into(),
        };
        let options = RunOptions::default().with_thread_pool(threads.cloned());
        let run = || {
            let found = self.model.run(
                vec![(self.input, input.into())],
                &self.outputs,
                Some(options),
            );
            let found = found.map_err(|e| Error::input(format!("the model does not run: {e}")))?;
            found.into_iter().map(floats).collect()
        };
        guard("run", run)
    }
}

fn floats(value: Value) -> Result<(Vec<usize>, Vec<f32>)> {
    let tensor: Tensor<f32> = value.into_tensor().ok_or_else(|| {
        Error::mismatch("an output of the model is not of floats; expected heat maps or points")
    })?;
    Ok((tensor.shape().to_vec(), tensor.to_vec()))
}

/// Models are programs, and the runtime ends at some that make no sense by a panic. A page loses a
/// worker then and says so; everything else goes on with an error.
fn guard<T>(what: &str, work: impl FnOnce() -> Result<T>) -> Result<T> {
    catch_unwind(AssertUnwindSafe(work)).unwrap_or_else(|panic| {
        let message = panic.downcast_ref::<&str>().map(|text| (*text).to_owned());
        let message = message.or_else(|| panic.downcast_ref::<String>().cloned());
        Err(Error::input(format!(
            "the runtime gave up trying to {what} the model: {}; `onnx.checker.check_model` may know more",
            message.unwrap_or_default()
        )))
    })
}
