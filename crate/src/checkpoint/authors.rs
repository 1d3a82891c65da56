//! What the configuration of the authors' training code says about an autoencoder.

use serde_json::Value;

/// What the `cfg` saved with the weights says that their names and shapes do not.
#[derive(Debug, Default)]
pub(super) struct Said {
    /// Width and height of the reconstruction.
    pub target_size: Option<[usize; 2]>,
    /// Whether the velocity loss has a weight.
    pub velocity: Option<bool>,
    pub temperature: Option<f64>,
    pub sigma: Option<f64>,
    pub sigma_limit: Option<f64>,
}

impl Said {
    /// Reads the configuration, tolerant of everything that is missing or something else than
    /// expected: it comes from a script that people change.
    pub fn read(cfg: &Value) -> Self {
        let number = |path: &str| cfg.pointer(path).and_then(Value::as_f64);
        let decoder = |name: &str| number(&format!("/model/decoder/settings/{name}"));
        let target_size = match cfg
            .pointer("/dataset/target_shape")
            .and_then(Value::as_array)
        {
            // Channels, height, width.
            Some(shape) => match shape.iter().map(Value::as_u64).collect::<Vec<_>>()[..] {
                [Some(_), Some(height), Some(width)] => usize::try_from(width)
                    .ok()
                    .zip(usize::try_from(height).ok()),
                _ => None,
            },
            None => None,
        };
        Self {
            target_size: target_size.map(|(width, height)| [width, height]),
            velocity: number("/training/loss_weights/velocity").map(|weight| weight != 0.0),
            temperature: number("/model/encoder/settings/softmax_temperature"),
            sigma: decoder("gaussian_std"),
            sigma_limit: decoder("limit_gaussian_std"),
        }
    }
}
