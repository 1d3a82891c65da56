//! The configuration of a checkpoint from the names and shapes of its tensors.

use std::collections::BTreeMap;

use super::authors::Said;
use super::layers::{BACKGROUND, DENSE, SIGMA, TEMPERATURE};
use super::{Architecture, Family, SaeConfig, Tensor};
use crate::error::{Error, Result};

impl SaeConfig {
    /// The configuration that a state dict of the authors' SAEs has.
    ///
    /// What names and shapes do not tell is as the authors' configuration says, else the paper's
    /// value: `-vel` (a loss, it leaves no tensor) is off but for DSAE, sigma and temperature are
    /// 0.1 and 1 unless trained, the target is 64 x 64 unless a background bias or a dense decoder
    /// gives it.
    pub(super) fn infer(tensors: &BTreeMap<String, Tensor>, said: &Said) -> Result<Self> {
        let shape = |name: &str| -> Result<[usize; 4]> {
            let found = tensors.get(name).ok_or_else(|| {
                Error::input(format!(
                    "not a checkpoint of a Basic, DSAE or KeyNet SAE: tensor `{name}` is missing (the file holds {})",
                    summary(tensors)
                ))
            })?;
            found.shape.as_slice().try_into().map_err(|_| {
                Error::input(format!(
                    "tensor `{name}` has shape {:?}; expected the four axes of a filter bank",
                    found.shape
                ))
            })
        };
        let has = |name: &str| tensors.contains_key(name);
        let family = if has("encoder.conv1.weight") {
            Family::Dsae
        } else if has("encoder.block4.conv1.weight") {
            Family::KeyNet
        } else {
            Family::Basic
        };
        let mut config = Self::new(Architecture {
            family,
            velocity: family == Family::Dsae || said.velocity == Some(true),
            trained_sigma: has(SIGMA),
            background: has(BACKGROUND),
        });
        let has_decoder = tensors.keys().any(|name| name.starts_with("decoder."));
        // (channels, kernel) of one convolution a block or layer.
        let list = |names: &[String]| -> Result<(Vec<usize>, Vec<usize>)> {
            let shapes = names
                .iter()
                .map(|name| shape(name))
                .collect::<Result<Vec<_>>>()?;
            Ok(shapes.iter().map(|s| (s[0], s[3])).unzip())
        };
        let numbered = |prefix: &str, suffix: &str, count: usize| -> Vec<String> {
            (1..=count)
                .map(|i| format!("{prefix}{i}{suffix}.weight"))
                .collect()
        };
        let aggregated = "encoder.aggregate_conv.weight";
        match family {
            Family::Basic => {
                (config.encoder_channels, config.encoder_kernels) =
                    list(&numbered("encoder.block", ".conv1", 3))?;
                config.keypoints = shape(aggregated)?[0];
                if has_decoder {
                    (config.decoder_channels, config.decoder_kernels) =
                        list(&numbered("decoder.conv", "", 3))?;
                }
            }
            Family::Dsae => {
                (config.encoder_channels, config.encoder_kernels) =
                    list(&numbered("encoder.conv", "", 3))?;
                config.keypoints = config.encoder_channels.pop().unwrap_or_default();
            }
            Family::KeyNet => {
                let (channels, kernels) = list(&numbered("encoder.block", ".conv1", 4))?;
                config.encoder_channels = channels;
                config.encoder_kernels = vec![kernels[0], kernels[1]];
                config.keypoints = shape(aggregated)?[0];
                if has_decoder {
                    let (channels, kernels) = list(&numbered("decoder.block", ".conv1", 3))?;
                    config.decoder_channels = channels;
                    config.decoder_kernels = vec![kernels[0]];
                }
            }
        }
        config.trained_temperature = has(TEMPERATURE);
        config.sigma_per_keypoint = tensors
            .get(SIGMA)
            .is_some_and(|sigma| sigma.shape.len() == 3);
        config.temperature = said.temperature.unwrap_or(config.temperature);
        config.sigma = said.sigma.unwrap_or(config.sigma);
        config.sigma_limit = said.sigma_limit;
        let dense = tensors.get(&format!("{DENSE}.bias"));
        let background = tensors.get(BACKGROUND).map(|t| t.shape.as_slice());
        config.target_size = match (background, dense, said.target_size) {
            (Some([_, height, width]), _, _) => [*width, *height],
            (_, Some(bias), Some([width, height]))
                if width.checked_mul(height).and_then(|n| n.checked_mul(3))
                    == Some(bias.data.len()) =>
            {
                [width, height]
            }
            (_, Some(bias), _) => {
                let side = (bias.data.len() as f64 / 3.0).sqrt().round() as usize;
                if 3 * side * side != bias.data.len() {
                    return Err(Error::input(format!(
                        "tensor `{DENSE}.bias` has {} values; expected 3 x height x width of a square image",
                        bias.data.len()
                    )));
                }
                [side, side]
            }
            (_, None, Some(size)) => size,
            (_, None, None) => [64, 64],
        };
        Ok(config)
    }
}

fn summary(tensors: &BTreeMap<String, Tensor>) -> String {
    let mut names: Vec<&str> = tensors.keys().map(String::as_str).take(3).collect();
    if names.is_empty() {
        return "no tensors".to_owned();
    }
    if tensors.len() > names.len() {
        names.push("…");
    }
    format!("{} tensors: {}", tensors.len(), names.join(", "))
}
