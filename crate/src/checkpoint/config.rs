//! What a spatial autoencoder looks like, independent of what runs it.

use serde::{Deserialize, Serialize};

use crate::error::{Error, Result};

/// The architecture and sizes of a spatial autoencoder (SAE). Written into every checkpoint.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SaeConfig {
    /// The family and its modifications, e.g. `basic-vel-std-bg`.
    pub architecture: Architecture,
    /// The number of keypoints N.
    pub keypoints: usize,
    /// Output channels of the encoder's three blocks (Basic: 32, 64, 128).
    pub encoder_channels: [usize; 3],
    /// Output channels of the decoder's three convolutions (Basic: 64, 32, 16).
    pub decoder_channels: [usize; 3],
    /// Width and height that frames are resized to before the encoder; `None` takes them as they are.
    pub input_size: Option<[usize; 2]>,
    /// Width and height of the reconstruction.
    pub target_size: [usize; 2],
    /// Initial (or fixed) standard deviation of the decoder's Gaussian maps, in latent units.
    pub sigma: f64,
}

/// A family of SAEs with the paper's modifications.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct Architecture {
    /// `-vel`: the velocity loss with weight 0.1.
    pub velocity: bool,
    /// `-std`: the standard deviation of the Gaussian maps is trained.
    pub trained_sigma: bool,
    /// `-bg`: a bias image is added to the reconstruction.
    pub background: bool,
}

impl SaeConfig {
    /// The paper's Basic SAE (appendix, "SAE Architectures"): N = 16, 64 x 64 target, sigma 0.1.
    pub fn basic(architecture: Architecture) -> Self {
        Self {
            architecture,
            keypoints: 16,
            encoder_channels: [32, 64, 128],
            decoder_channels: [64, 32, 16],
            input_size: None,
            target_size: [64, 64],
            sigma: 0.1,
        }
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
        within("keypoints", self.keypoints, 1, 4096)?;
        for c in self.encoder_channels {
            within("an encoder channel count", c, 1, 8192)?;
        }
        for c in self.decoder_channels {
            within("a decoder channel count", c, 1, 8192)?;
        }
        for s in self.input_size.iter().flatten() {
            within("a side of the input size", *s, 16, 4096)?;
        }
        for s in self.target_size {
            within("a side of the target size", s, 4, 1024)?;
        }
        if !(self.sigma.is_finite() && self.sigma > 0.0) {
            return Err(Error::input(format!(
                "sigma is {}; expected a positive number",
                self.sigma
            )));
        }
        Ok(())
    }
}

impl Architecture {
    /// Basic without modifications.
    pub const BASIC: Self = Self {
        velocity: false,
        trained_sigma: false,
        background: false,
    };

    /// The weight of the velocity loss: 0.1 with `-vel`, otherwise 0 (paper, appendix, "Modifications").
    pub fn velocity_weight(self) -> f64 {
        if self.velocity { 0.1 } else { 0.0 }
    }
}

impl std::fmt::Display for Architecture {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("basic")?;
        for (on, suffix) in [
            (self.velocity, "-vel"),
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
        let unknown = || {
            Error::input(format!(
                "unknown architecture `{name}`; expected `basic`, with any of -vel, -std, -bg in this order \
                 (e.g. basic-vel-std-bg)"
            ))
        };
        let mut rest = name.strip_prefix("basic").ok_or_else(unknown)?;
        let mut take = |suffix: &str| match rest.strip_prefix(suffix) {
            Some(tail) => {
                rest = tail;
                true
            }
            None => false,
        };
        let architecture = Self {
            velocity: take("-vel"),
            trained_sigma: take("-std"),
            background: take("-bg"),
        };
        if rest.is_empty() {
            Ok(architecture)
        } else {
            Err(unknown())
        }
    }
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
