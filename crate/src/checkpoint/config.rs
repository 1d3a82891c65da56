//! What a spatial autoencoder looks like, independent of what runs it.

use serde::{Deserialize, Serialize};

use crate::error::{Error, Result};

/// The architecture and sizes of a spatial autoencoder (SAE). Written into every checkpoint.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SaeConfig {
    /// The family and its modifications, e.g. `keynet-vel-std-bg`.
    pub architecture: Architecture,
    /// The number of keypoints N.
    pub keypoints: usize,
    /// Output channels of the encoder: a count a block for Basic (32, 64, 128) and KeyNet (32, 64,
    /// 128, 256), a count a convolution for DSAE (64, 32), whose third one makes the N maps.
    pub encoder_channels: Vec<usize>,
    /// Kernel sizes of the encoder: one a block for Basic (3, 3, 3), one a convolution for DSAE (7,
    /// 5, 5), the first and all others for KeyNet (7, 3).
    #[serde(default = "three_by_three")]
    pub encoder_kernels: Vec<usize>,
    /// Strides of a KeyNet's encoder, one a block, each 1 or 2; empty for the paper's (1, 2, 2, 2),
    /// and for the other families, whose strides are fixed. Left out of a checkpoint when empty.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub encoder_strides: Vec<usize>,
    /// Output channels of the decoder: a count a convolution for Basic (64, 32, 16), a count a
    /// block for KeyNet (256, 128, 64), none for DSAE.
    pub decoder_channels: Vec<usize>,
    /// Kernel sizes of the decoder: one a convolution for Basic (3, 3, 3), one for all for KeyNet
    /// (3), none for DSAE.
    #[serde(default = "three_by_three")]
    pub decoder_kernels: Vec<usize>,
    /// Width and height that frames are resized to before the encoder; `None` takes them as they
    /// are.
    pub input_size: Option<[usize; 2]>,
    /// Width and height of the reconstruction.
    pub target_size: [usize; 2],
    /// The (initial) temperature of the softmax over feature maps.
    #[serde(default = "one")]
    pub temperature: f64,
    /// Whether the temperature is trained (DSAE).
    #[serde(default)]
    pub trained_temperature: bool,
    /// The (initial) standard deviation of the decoder's Gaussian maps, in latent units.
    pub sigma: f64,
    /// Whether every keypoint has a standard deviation of its own; it makes a difference only where
    /// they are trained.
    #[serde(default)]
    pub sigma_per_keypoint: bool,
    /// The number of standard deviations beyond which the Gaussian maps are 0; `None` leaves them
    /// unlimited.
    #[serde(default)]
    pub sigma_limit: Option<f64>,
}

/// A family of SAEs with the paper's modifications.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct Architecture {
    /// What encoder and decoder are made of.
    pub family: Family,
    /// `-vel`: the velocity loss with weight 0.1. DSAE always has it.
    pub velocity: bool,
    /// `-std`: the standard deviation of the Gaussian maps is trained.
    pub trained_sigma: bool,
    /// `-bg`: a bias image is added to the reconstruction.
    pub background: bool,
}

/// What encoder and decoder are made of (paper, appendix, "SAE Architectures").
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Family {
    /// Three blocks of two convolutions and a pool; Gaussian maps and three convolutions.
    Basic,
    /// Deep spatial autoencoder (Finn et al. 2016): three convolutions; one dense layer.
    Dsae,
    /// KeyNet (Jakab and Gupta et al. 2018): four blocks of two convolutions; Gaussian maps and
    /// three blocks with upsampling between them.
    KeyNet,
}

fn three_by_three() -> Vec<usize> {
    vec![3; 3]
}

fn one() -> f64 {
    1.0
}

impl SaeConfig {
    /// The paper's configuration of an architecture (appendix, "SAE Architectures").
    pub fn new(architecture: Architecture) -> Self {
        let basic = Self {
            architecture,
            keypoints: architecture.family.default_keypoints(),
            encoder_channels: vec![32, 64, 128],
            encoder_kernels: vec![3; 3],
            encoder_strides: Vec::new(),
            decoder_channels: vec![64, 32, 16],
            decoder_kernels: vec![3; 3],
            input_size: None,
            target_size: [64, 64],
            temperature: 1.0,
            trained_temperature: false,
            sigma: 0.1,
            sigma_per_keypoint: false,
            sigma_limit: None,
        };
        match architecture.family {
            Family::Basic => basic,
            Family::Dsae => Self {
                encoder_channels: vec![64, 32],
                encoder_kernels: vec![7, 5, 5],
                decoder_channels: Vec::new(),
                decoder_kernels: Vec::new(),
                trained_temperature: true,
                ..basic
            },
            Family::KeyNet => Self {
                encoder_channels: vec![32, 64, 128, 256],
                encoder_kernels: vec![7, 3],
                decoder_channels: vec![256, 128, 64],
                decoder_kernels: vec![3],
                ..basic
            },
        }
    }

    /// The paper's configuration of the architecture with this name: `basic`, `dsae` or `keynet`,
    /// then `-kpN` for another number of keypoints than the family's, then `-vel`, `-std`, `-bg`:
    /// `basic-kp32`, `keynet-vel-std-bg`.
    ///
    /// # Errors
    /// When there is no such architecture.
    pub fn named(name: &str) -> Result<Self> {
        let mut parts: Vec<&str> = name.split('-').collect();
        let keypoints = match parts.get(1).and_then(|part| part.strip_prefix("kp")) {
            Some(count) => {
                let count = count.parse().map_err(|_| unknown(name))?;
                parts.remove(1);
                Some(count)
            }
            None => None,
        };
        let mut config = Self::new(parts.join("-").parse().map_err(|_: Error| unknown(name))?);
        if let Some(keypoints) = keypoints {
            config.keypoints = keypoints;
            config.validate()?;
        }
        Ok(config)
    }

    /// The name that [`SaeConfig::named`] takes. It tells family, modifications and keypoints, not
    /// the other sizes.
    pub fn name(&self) -> String {
        let name = self.architecture.to_string();
        if self.keypoints == self.architecture.family.default_keypoints() {
            return name;
        }
        let family = self.architecture.family.name();
        name.replacen(family, &format!("{family}-kp{}", self.keypoints), 1)
    }

    /// Checks that every size makes sense.
    ///
    /// # Errors
    /// Names the field, its value and what is allowed.
    pub fn validate(&self) -> Result<()> {
        let within = |name: &str, value: usize, low: usize, high: usize| {
            if (low..=high).contains(&value) {
                return Ok(());
            }
            Err(Error::input(format!(
                "{name} is {value}; expected {low} to {high}"
            )))
        };
        let family = self.architecture.family;
        let list = |name: &str, values: &[usize], count: usize, high: usize| {
            if values.len() != count {
                return Err(Error::input(format!(
                    "{} {name} given; a {family} has {count}",
                    values.len()
                )));
            }
            values.iter().try_for_each(|v| within(name, *v, 1, high))
        };
        let [channels, kernels, decoder_channels, decoder_kernels] = match family {
            Family::Basic => [3, 3, 3, 3],
            Family::Dsae => [2, 3, 0, 0],
            Family::KeyNet => [4, 2, 3, 1],
        };
        within("keypoints", self.keypoints, 1, 4096)?;
        list("encoder channels", &self.encoder_channels, channels, 8192)?;
        list("encoder kernel sizes", &self.encoder_kernels, kernels, 31)?;
        if !self.encoder_strides.is_empty() {
            if family != Family::KeyNet {
                return Err(Error::input(format!(
                    "encoder strides are given for a {family}; only a KeyNet takes them"
                )));
            }
            list("encoder strides", &self.encoder_strides, channels, 2)?;
        }
        list(
            "decoder channels",
            &self.decoder_channels,
            decoder_channels,
            8192,
        )?;
        list(
            "decoder kernel sizes",
            &self.decoder_kernels,
            decoder_kernels,
            31,
        )?;
        // DSAE pads nothing; the others pad half a kernel on either side, which keeps the size for
        // odd ones only.
        let padded = self.decoder_kernels.iter().chain(match family {
            Family::Dsae => [].iter(),
            _ => self.encoder_kernels.iter(),
        });
        if let Some(even) = padded.into_iter().find(|k| *k % 2 == 0) {
            return Err(Error::input(format!(
                "a kernel size is {even}; expected an odd one, which keeps the size of its input"
            )));
        }
        for s in self.input_size.iter().flatten() {
            within("a side of the input size", *s, 16, 4096)?;
        }
        for s in self.target_size {
            within("a side of the target size", s, 4, 1024)?;
            if family == Family::KeyNet && s % 4 != 0 {
                return Err(Error::input(format!(
                    "a side of the target size is {s}; expected a multiple of 4, since a KeyNet paints its maps at a \
                     quarter of it"
                )));
            }
        }
        let positive = |name: &str, value: f64| {
            if value.is_finite() && value > 0.0 {
                return Ok(());
            }
            Err(Error::input(format!(
                "{name} is {value}; expected a positive number"
            )))
        };
        positive("the temperature", self.temperature)?;
        positive("sigma", self.sigma)?;
        self.sigma_limit
            .map_or(Ok(()), |limit| positive("the limit of sigma", limit))
    }
}

impl Family {
    const ALL: [Self; 3] = [Self::Basic, Self::Dsae, Self::KeyNet];

    fn name(self) -> &'static str {
        match self {
            Self::Basic => "basic",
            Self::Dsae => "dsae",
            Self::KeyNet => "keynet",
        }
    }

    /// The paper's number of keypoints.
    fn default_keypoints(self) -> usize {
        match self {
            Self::Basic | Self::Dsae => 16,
            Self::KeyNet => 30,
        }
    }
}

impl std::fmt::Display for Family {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Basic => "Basic",
            Self::Dsae => "DSAE",
            Self::KeyNet => "KeyNet",
        })
    }
}

impl Architecture {
    /// Basic without modifications.
    pub const BASIC: Self = Self {
        family: Family::Basic,
        velocity: false,
        trained_sigma: false,
        background: false,
    };

    /// The paper's weight of the velocity loss: 0.1 with `-vel` and for DSAE, otherwise 0
    /// (appendix, "Modifications"; the authors' configuration of DSAE).
    pub fn velocity_weight(self) -> f64 {
        if self.velocity { 0.1 } else { 0.0 }
    }
}

impl std::fmt::Display for Architecture {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.family.name())?;
        for (on, suffix) in [
            (self.velocity && self.family != Family::Dsae, "-vel"),
            (self.trained_sigma, "-std"),
            (self.background, "-bg"),
        ] {
            if on {
                f.write_str(suffix)?;
            }
        }
        Ok(())
    }
}

impl std::str::FromStr for Architecture {
    type Err = Error;

    fn from_str(name: &str) -> Result<Self> {
        let family = Family::ALL
            .into_iter()
            .find(|family| name.starts_with(family.name()))
            .ok_or_else(|| unknown(name))?;
        let mut rest = &name[family.name().len()..];
        let mut take = |suffix: &str| match rest.strip_prefix(suffix) {
            Some(tail) => {
                rest = tail;
                true
            }
            None => false,
        };
        // DSAE has no Gaussian maps, and always the velocity loss.
        let is_dsae = family == Family::Dsae;
        let architecture = Self {
            family,
            velocity: is_dsae || take("-vel"),
            trained_sigma: !is_dsae && take("-std"),
            background: take("-bg"),
        };
        if rest.is_empty() {
            Ok(architecture)
        } else {
            Err(unknown(name))
        }
    }
}

fn unknown(name: &str) -> Error {
    Error::input(format!(
        "unknown architecture `{name}`; expected `basic` or `keynet` with any of -vel, -std, -bg in this order (e.g. \
         keynet-vel-std-bg), or `dsae`; -kpN after the family sets the number of keypoints (e.g. basic-kp32)"
    ))
}

impl TryFrom<String> for Architecture {
    type Error = Error;

    fn try_from(name: String) -> Result<Self> {
        name.parse()
    }
}

impl From<Architecture> for String {
    fn from(architecture: Architecture) -> Self {
        architecture.to_string()
    }
}
