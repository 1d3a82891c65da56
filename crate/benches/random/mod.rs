//! Checkpoints that nobody trained, for benchmarks: their values do not matter for the time.

use std::collections::BTreeMap;

use tracklens::checkpoint::{Checkpoint, SaeConfig, Tensor};

/// A checkpoint of `config` with weights that keep activations in range, the same ones every time.
pub fn checkpoint(config: SaeConfig) -> Checkpoint {
    let mut state = 0x2545_f491_4f6c_dd1d_u64;
    let mut uniform = || {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        (state >> 40) as f32 / (1u64 << 24) as f32
    };
    let mut tensors = BTreeMap::new();
    for (name, shape) in config.tensor_shapes() {
        let fan_in: usize = shape.iter().skip(1).product();
        let bound = 1.0 / (fan_in as f32).sqrt();
        let mut value = || match shape.len() {
            1 => 0.5 + uniform(),
            _ => bound * (2.0 * uniform() - 1.0),
        };
        let data = (0..shape.iter().product()).map(|_| value()).collect();
        tensors.insert(name, Tensor { shape, data });
    }
    Checkpoint {
        config,
        tensors,
        metadata: BTreeMap::new(),
    }
}
