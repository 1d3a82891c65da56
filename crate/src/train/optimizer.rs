//! Adam as PyTorch has it, with a state that is read back wherever there is a CPU.

use burn::optim::{
    Adam, AdamConfig, AdamState, LearningRate, ModuleOptimizer, Optimizer, RecordState, StateSink,
    StateSource,
};
use burn::prelude::{Device, Tensor};

/// PyTorch's default; burn's is 1e-5, which is far from negligible against the small gradients
/// here.
const EPSILON: f32 = 1e-8;

/// Adam with PyTorch's defaults.
pub(super) fn adam() -> ModuleOptimizer {
    HostLoaded(AdamConfig::new().with_epsilon(EPSILON).build()).into()
}

/// burn loads the state of an optimizer on its default device, which is the GPU in a build that
/// knows one, whether the machine has one or not. This one loads it on the CPU; the next step moves
/// it to where the parameters are.
#[derive(Clone)]
struct HostLoaded(Adam);

#[derive(Clone)]
struct HostLoadedState<const D: usize>(AdamState<D>);

impl Optimizer for HostLoaded {
    type State<const D: usize> = HostLoadedState<D>;

    fn step<const D: usize>(
        &self,
        learning_rate: LearningRate,
        tensor: Tensor<D>,
        gradient: Tensor<D>,
        state: Option<Self::State<D>>,
    ) -> (Tensor<D>, Option<Self::State<D>>) {
        let state = state.map(|HostLoadedState(state)| state);
        let (tensor, state) = self.0.step(learning_rate, tensor, gradient, state);
        (tensor, state.map(HostLoadedState))
    }

    fn to_device<const D: usize>(state: Self::State<D>, device: &Device) -> Self::State<D> {
        HostLoadedState(Adam::to_device(state.0, device))
    }
}

impl<const D: usize> RecordState for HostLoadedState<D> {
    fn state_flatten(&self, prefix: &str, out: &mut StateSink) {
        self.0.state_flatten(prefix, out);
    }

    fn state_unflatten(prefix: &str, source: &mut StateSource, _default: &Device) -> Option<Self> {
        AdamState::state_unflatten(prefix, source, &Device::flex()).map(Self)
    }
}
