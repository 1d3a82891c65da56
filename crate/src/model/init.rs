use std::collections::BTreeMap;

use rand::rngs::StdRng;
use rand::{Rng, SeedableRng};

use crate::checkpoint::{Checkpoint, SIGMA, SaeConfig, TEMPERATURE, Tensor};

/// The weights of an untrained SAE, drawn on the host: the same seed gives the same weights on every device.
///
/// The distributions are PyTorch's defaults: convolutions, dense layers and their biases uniform in ±1/√(fan-in), batch
/// norm scale 1 and offset 0. σ and temperature start at the configured value, the background at 0 (paper, appendix,
/// "Modifications"). The first convolution of a DSAE, which the paper takes from a DenseNet-201, is drawn as the
/// others.
pub fn fresh_weights(config: &SaeConfig, seed: u64) -> Checkpoint {
    let mut rng = StdRng::seed_from_u64(seed);
    let mut tensors = BTreeMap::new();
    let mut fan_in = 1;
    for (name, shape) in config.tensor_shapes() {
        let count = shape.iter().product();
        // A bias has the fan-in of its weight, which comes right before it.
        let is_weight = matches!(shape.len(), 2 | 4);
        let is_drawn_bias = name.ends_with("aggregate_conv.bias") || name.ends_with("dense.bias");
        if is_weight {
            fan_in = shape[1..].iter().product();
        }
        let data = if is_weight || is_drawn_bias {
            let bound = 1.0 / (fan_in as f32).sqrt();
            (0..count).map(|_| rng.random_range(-bound..=bound)).collect()
        } else if name == SIGMA {
            vec![config.sigma as f32; count]
        } else if name == TEMPERATURE {
            vec![config.temperature as f32; count]
        } else if name.ends_with(".bias") || name.ends_with(".running_mean") {
            vec![0.0; count]
        } else {
            vec![1.0; count]
        };
        tensors.insert(name, Tensor { shape, data });
    }
    Checkpoint {
        config: config.clone(),
        tensors,
        metadata: BTreeMap::new(),
    }
}
