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
        let found = Found(tensors);
        let family = found.family();
        let mut config = Self::new(Architecture {
            family,
            velocity: family == Family::Dsae || said.velocity == Some(true),
            trained_sigma: found.has(SIGMA),
            background: found.has(BACKGROUND),
        });
        match family {
            Family::Basic => found.sizes_of_basic(&mut config)?,
            Family::Dsae => found.sizes_of_dsae(&mut config)?,
            Family::KeyNet => found.sizes_of_keynet(&mut config)?,
        }
        config.trained_temperature = found.has(TEMPERATURE);
        config.sigma_per_keypoint = tensors
            .get(SIGMA)
            .is_some_and(|sigma| sigma.shape.len() == 3);
        config.temperature = said.temperature.unwrap_or(config.temperature);
        config.sigma = said.sigma.unwrap_or(config.sigma);
        config.sigma_limit = said.sigma_limit;
        config.target_size = found.target_size(said.target_size)?;
        Ok(config)
    }
}

const AGGREGATED: &str = "encoder.aggregate_conv.weight";

/// The tensors of a checkpoint, asked for what the authors' names and shapes tell.
struct Found<'a>(&'a BTreeMap<String, Tensor>);

impl Found<'_> {
    fn has(&self, name: &str) -> bool {
        self.0.contains_key(name)
    }

    fn has_decoder(&self) -> bool {
        self.0.keys().any(|name| name.starts_with("decoder."))
    }

    fn family(&self) -> Family {
        if self.has("encoder.conv1.weight") {
            Family::Dsae
        } else if self.has("encoder.block4.conv1.weight") {
            Family::KeyNet
        } else {
            Family::Basic
        }
    }

    fn sizes_of_basic(&self, config: &mut SaeConfig) -> Result<()> {
        (config.encoder_channels, config.encoder_kernels) =
            self.numbered("encoder.block", ".conv1", 3)?;
        config.keypoints = self.filters(AGGREGATED)?[0];
        if self.has_decoder() {
            (config.decoder_channels, config.decoder_kernels) =
                self.numbered("decoder.conv", "", 3)?;
        }
        Ok(())
    }

    fn sizes_of_dsae(&self, config: &mut SaeConfig) -> Result<()> {
        (config.encoder_channels, config.encoder_kernels) = self.numbered("encoder.conv", "", 3)?;
        config.keypoints = config.encoder_channels.pop().unwrap_or_default();
        Ok(())
    }

    fn sizes_of_keynet(&self, config: &mut SaeConfig) -> Result<()> {
        let (channels, kernels) = self.numbered("encoder.block", ".conv1", 4)?;
        config.encoder_channels = channels;
        config.encoder_kernels = vec![kernels[0], kernels[1]];
        config.keypoints = self.filters(AGGREGATED)?[0];
        if self.has_decoder() {
            let (channels, kernels) = self.numbered("decoder.block", ".conv1", 3)?;
            config.decoder_channels = channels;
            config.decoder_kernels = vec![kernels[0]];
        }
        Ok(())
    }

    /// Output channels and kernel sizes of the convolutions `{prefix}1{suffix}` to `count`.
    fn numbered(
        &self,
        prefix: &str,
        suffix: &str,
        count: usize,
    ) -> Result<(Vec<usize>, Vec<usize>)> {
        let shapes = (1..=count)
            .map(|i| self.filters(&format!("{prefix}{i}{suffix}.weight")))
            .collect::<Result<Vec<_>>>()?;
        Ok(shapes.iter().map(|s| (s[0], s[3])).unzip())
    }

    /// The shape of a bank of filters: outputs, inputs, height, width.
    fn filters(&self, name: &str) -> Result<[usize; 4]> {
        let found = self.0.get(name).ok_or_else(|| {
            Error::input(format!(
                "not a checkpoint of a Basic, DSAE or KeyNet SAE: tensor `{name}` is missing (the file holds {})",
                summary(self.0)
            ))
        })?;
        found.shape.as_slice().try_into().map_err(|_| {
            Error::input(format!(
                "tensor `{name}` has shape {:?}; expected the four axes of a filter bank",
                found.shape
            ))
        })
    }

    /// Width and height of the reconstruction: those of a background bias, or of a dense decoder,
    /// which tells only their product.
    fn target_size(&self, said: Option<[usize; 2]>) -> Result<[usize; 2]> {
        let background = self.0.get(BACKGROUND).map(|t| t.shape.as_slice());
        if let Some([_, height, width]) = background {
            return Ok([*width, *height]);
        }
        let Some(dense) = self.0.get(&format!("{DENSE}.bias")) else {
            return Ok(said.unwrap_or([64, 64]));
        };
        let values = dense.data.len();
        let product = |[width, height]: &[usize; 2]| width.checked_mul(*height)?.checked_mul(3);
        if let Some(size) = said.filter(|size| product(size) == Some(values)) {
            return Ok(size);
        }
        let side = (values as f64 / 3.0).sqrt().round() as usize;
        if 3 * side * side != values {
            return Err(Error::input(format!(
                "tensor `{DENSE}.bias` has {values} values; expected 3 x height x width of a square image"
            )));
        }
        Ok([side, side])
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
