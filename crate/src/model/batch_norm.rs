use burn::module::{Module, Param, RunningState};
use burn::prelude::Tensor;
use burn::tensor::activation::relu;
use burn::tensor::module::batch_norm;

use crate::checkpoint::BATCH_NORM_EPSILON;

/// Batch normalization with PyTorch's running statistics.
///
/// burn's own layer feeds the *biased* variance of a batch to its running variance; PyTorch, and
/// with it every published checkpoint, feeds the unbiased one. Batches themselves are normalized by
/// the biased variance in both.
#[derive(Module, Debug)]
pub struct BatchNorm {
    /// Scale a channel: `[C]`.
    pub weight: Param<Tensor<1>>,
    /// Offset a channel: `[C]`.
    pub bias: Param<Tensor<1>>,
    /// Running mean: `[C]`.
    pub running_mean: RunningState<Tensor<1>>,
    /// Running unbiased variance: `[C]`.
    pub running_var: RunningState<Tensor<1>>,
}

impl BatchNorm {
    /// Normalizes every channel: by the statistics of the batch, which also enter the running ones,
    /// on an autodiff device, otherwise by the running statistics. Then the ReLU that follows every
    /// batch norm here.
    ///
    /// # Shapes
    /// - `input`: `[B, C, H, W]`
    /// - output: `[B, C, H, W]`
    pub fn forward_relu(&self, input: Tensor<4>) -> Tensor<4> {
        #[cfg(not(target_arch = "wasm32"))]
        if input.device().is_autodiff() {
            return self.train(input);
        }
        relu(batch_norm(
            input,
            self.weight.val(),
            self.bias.val(),
            self.running_mean.value_sync(),
            self.running_var.value_sync(),
            BATCH_NORM_EPSILON,
        ))
    }
}

#[cfg(not(target_arch = "wasm32"))]
mod training {
    use burn::module::RunningState;
    use burn::prelude::Tensor;

    use super::BatchNorm;
    use crate::checkpoint::BATCH_NORM_EPSILON;
    use crate::model::kernels::batch_norm_relu;

    /// Weight of a new batch in the running statistics.
    const MOMENTUM: f64 = 0.1;

    impl BatchNorm {
        pub(super) fn train(&self, input: Tensor<4>) -> Tensor<4> {
            let [batch, _, height, width] = input.dims();
            let samples = (batch * height * width) as f64;
            let result = batch_norm_relu(
                input,
                self.weight.val(),
                self.bias.val(),
                BATCH_NORM_EPSILON,
            );
            let unbiased = result.variance * (samples / (samples - 1.0).max(1.0));
            update(&self.running_mean, result.mean);
            update(&self.running_var, unbiased);
            result.output
        }
    }

    fn update(state: &RunningState<Tensor<1>>, batch: Tensor<1>) {
        let running = state.value_sync() * (1.0 - MOMENTUM) + batch.detach() * MOMENTUM;
        state.update(running.detach());
    }
}
