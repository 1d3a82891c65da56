//! The configuration of a checkpoint from the names and shapes of its tensors, and back.

use std::collections::BTreeMap;

use super::{Architecture, SaeConfig, Tensor};
use crate::error::{Error, Result};

impl SaeConfig {
    /// The configuration that a state dict of the authors' Basic SAE has.
    ///
    /// What names and shapes do not tell is set to the paper's value: `-vel` (a loss, it leaves no tensor) is
    /// off, sigma is 0.1 unless trained, the target is 64 x 64 unless a background bias gives it.
    pub(super) fn infer(tensors: &BTreeMap<String, Tensor>) -> Result<Self> {
        let shape = |name: &str| {
            tensors.get(name).map(|t| t.shape.as_slice()).ok_or_else(|| {
                Error::input(format!(
                    "not a checkpoint of a Basic SAE: tensor `{name}` is missing (the file holds {})",
                    summary(tensors)
                ))
            })
        };
        let first = |name: &str| {
            let shape = shape(name)?;
            shape
                .first()
                .copied()
                .ok_or_else(|| Error::input(format!("tensor `{name}` is a scalar; expected a filter bank")))
        };
        let mut encoder_channels = [0; 3];
        let mut decoder_channels = [64, 32, 16];
        for block in 0..3 {
            encoder_channels[block] = first(&format!("encoder.block{}.conv1.weight", block + 1))?;
        }
        if tensors.keys().any(|name| name.starts_with("decoder.")) {
            for conv in 0..3 {
                decoder_channels[conv] = first(&format!("decoder.conv{}.weight", conv + 1))?;
            }
        }
        let background = tensors.get("decoder.background_bias.bias");
        let sigma = tensors.get("decoder.gaussian_sampling.std");
        Ok(Self {
            architecture: Architecture {
                velocity: false,
                trained_sigma: sigma.is_some(),
                background: background.is_some(),
            },
            keypoints: first("encoder.aggregate_conv.weight")?,
            encoder_channels,
            decoder_channels,
            input_size: None,
            target_size: match background.map(|t| t.shape.as_slice()) {
                Some([_, height, width]) => [*width, *height],
                _ => [64, 64],
            },
            sigma: 0.1,
        })
    }

    /// Every tensor of the state dict with its shape, encoder first. Counters are left out.
    pub fn tensor_shapes(&self) -> Vec<(String, Vec<usize>)> {
        let mut shapes = Vec::new();
        let mut input = 3;
        for (i, &channels) in self.encoder_channels.iter().enumerate() {
            let block = format!("encoder.block{}", i + 1);
            for (conv, from) in [(1, input), (2, channels)] {
                shapes.push((format!("{block}.conv{conv}.weight"), vec![channels, from, 3, 3]));
                batch_norm(&mut shapes, &format!("{block}.bn{conv}"), channels);
            }
            input = channels;
        }
        aggregation(&mut shapes, "encoder.aggregate_conv", input, self.keypoints);
        if self.architecture.trained_sigma {
            shapes.push(("decoder.gaussian_sampling.std".to_owned(), vec![1]));
        }
        let mut input = self.keypoints;
        for (i, &channels) in self.decoder_channels.iter().enumerate() {
            shapes.push((
                format!("decoder.conv{}.weight", i + 1),
                vec![channels, input, 3, 3],
            ));
            batch_norm(&mut shapes, &format!("decoder.bn{}", i + 1), channels);
            input = channels;
        }
        aggregation(&mut shapes, "decoder.aggregate_conv", input, 3);
        if self.architecture.background {
            let [width, height] = self.target_size;
            shapes.push(("decoder.background_bias.bias".to_owned(), vec![3, height, width]));
        }
        shapes
    }
}

fn batch_norm(shapes: &mut Vec<(String, Vec<usize>)>, name: &str, channels: usize) {
    for part in ["weight", "bias", "running_mean", "running_var"] {
        shapes.push((format!("{name}.{part}"), vec![channels]));
    }
}

fn aggregation(shapes: &mut Vec<(String, Vec<usize>)>, name: &str, from: usize, to: usize) {
    shapes.push((format!("{name}.weight"), vec![to, from, 1, 1]));
    shapes.push((format!("{name}.bias"), vec![to]));
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
