//! What a model file does not say by itself.

use std::str::FromStr;

use serde::{Deserialize, Deserializer, Serialize, Serializer};

use crate::error::{Error, Result};

/// What is added to the name of a model for the file of its settings: `model.onnx.json`.
pub const SETTINGS_ENDING: &str = ".json";

/// How frames go into a model and keypoints come out of it. What is `None` follows from the graph,
/// or has to be asked.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Settings {
    /// The size that frames are resized to.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub input_size: Option<InputSize>,
    /// Where the channels are.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub layout: Option<Layout>,
    /// What the channels are.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub channels: Option<Channels>,
    /// Subtracted from pixels in [0, 1]: red, green, blue, or one number for all.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub mean: Option<Vec<f32>>,
    /// Pixels less `mean` are divided by it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub std: Option<Vec<f32>>,
    /// What the outputs are.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub output: Option<OutputKind>,
    /// Names of the outputs that count; of SimCC first that of x, then that of y.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub output_names: Option<Vec<String>>,
    /// How a map becomes a point.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub decode: Option<Decoding>,
    /// Of the soft-argmax: maps are divided by it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub temperature: Option<f64>,
    /// The unit of points.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub unit: Option<Unit>,
    /// What the numbers of a point are.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub columns: Option<Columns>,
}

/// The size of a model's input.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum InputSize {
    /// Width and height.
    Fixed([usize; 2]),
    /// That of each frame, which is not resized.
    Frame,
}

macro_rules! words {
    ($(#[$doc:meta])* $name:ident, $what:literal { $($(#[$variant_doc:meta])* $variant:ident = $word:literal,)+ }) => {
        $(#[$doc])*
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
        pub enum $name {
            $($(#[$variant_doc])* #[serde(rename = $word)] $variant,)+
        }

        impl FromStr for $name {
            type Err = Error;

            fn from_str(text: &str) -> Result<Self> {
                match text {
                    $($word => Ok(Self::$variant),)+
                    _ => Err(Error::input(format!(
                        concat!("`{}` is no ", $what, "; expected {}"),
                        text,
                        [$($word),+].join(", ")
                    ))),
                }
            }
        }

        impl std::fmt::Display for $name {
            fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                f.write_str(match self {
                    $(Self::$variant => $word,)+
                })
            }
        }
    };
}

words! {
    /// Where the channels of an image are.
    Layout, "layout" {
        /// Batch, channels, height, width, as PyTorch has it.
        ChannelsFirst = "nchw",
        /// Batch, height, width, channels, as TensorFlow has it. Heat maps are then last, too.
        ChannelsLast = "nhwc",
    }
}

words! {
    /// What the channels of an image are.
    Channels, "order of channels" {
        /// Red, green, blue.
        Rgb = "rgb",
        /// Blue, green, red, as OpenCV reads images.
        Bgr = "bgr",
        /// One channel: 0.299 red + 0.587 green + 0.114 blue (ITU-R BT.601).
        Gray = "gray",
    }
}

words! {
    /// Usual ways to scale pixels.
    Normalization, "way to scale pixels" {
        /// From 0 to 1.
        Fraction = "fraction",
        /// From -1 to +1.
        Symmetric = "symmetric",
        /// From 0 to 255.
        Bytes = "bytes",
        /// By the mean and the standard deviation of the pixels of ImageNet.
        ImageNet = "imagenet",
    }
}

impl Normalization {
    /// Mean and standard deviation of pixels in [0, 1].
    pub fn numbers(self) -> [Vec<f32>; 2] {
        match self {
            Self::Fraction => [vec![0.0], vec![1.0]],
            Self::Symmetric => [vec![0.5], vec![0.5]],
            Self::Bytes => [vec![0.0], vec![1.0 / 255.0]],
            Self::ImageNet => [vec![0.485, 0.456, 0.406], vec![0.229, 0.224, 0.225]],
        }
    }
}

words! {
    /// What the outputs of a model are.
    OutputKind, "kind of output" {
        /// A map a keypoint: `[B, K, H, W]`, or `[B, H, W, K]` where channels are last.
        HeatMaps = "heatmaps",
        /// Points: `[B, K, 2]` or `[B, K, 3]`, or all numbers of a frame in a row.
        Points = "points",
        /// Two outputs, `[B, K, X]` and `[B, K, Y]`: a profile along each axis (SimCC).
        SimCc = "simcc",
    }
}

words! {
    /// How a heat map, or a profile of SimCC, becomes a coordinate.
    Decoding, "decoding" {
        /// The largest value, moved to the vertex of a parabola through it and its neighbours.
        Argmax = "argmax",
        /// The mean of all cells, weighted with the softmax of their values.
        SoftArgmax = "softargmax",
    }
}

words! {
    /// The unit of points.
    Unit, "unit" {
        /// Pixels of the model's input; 0 is the centre of the first one.
        Pixels = "px",
        /// 0 to 1 from edge to edge of the image.
        Fraction = "fraction",
        /// -1 to +1 from edge to edge of the image.
        Ndc = "ndc",
    }
}

words! {
    /// What the numbers of a point are: x, y, c (a confidence), z (a depth, which is left out).
    Columns, "order of the numbers of a point" {
        /// x, y.
        Xy = "xy",
        /// y, x.
        Yx = "yx",
        /// x, y, confidence.
        Xyc = "xyc",
        /// y, x, confidence.
        Yxc = "yxc",
        /// x, y, depth.
        Xyz = "xyz",
    }
}

impl Columns {
    /// How many numbers a point has.
    pub fn count(self) -> usize {
        match self {
            Self::Xy | Self::Yx => 2,
            Self::Xyc | Self::Yxc | Self::Xyz => 3,
        }
    }

    /// The places of x and y.
    pub(super) fn axes(self) -> [usize; 2] {
        match self {
            Self::Xy | Self::Xyc | Self::Xyz => [0, 1],
            Self::Yx | Self::Yxc => [1, 0],
        }
    }

    /// Whether the third number is a confidence.
    pub(super) fn has_confidence(self) -> bool {
        matches!(self, Self::Xyc | Self::Yxc)
    }
}

impl Settings {
    /// Reads the JSON of a settings file or of a model's metadata. There, `normalize` may stand for
    /// `mean` and `std`: a [`Normalization`].
    ///
    /// # Errors
    /// When it is not JSON, or has a key or a value that is not known.
    pub fn from_json(json: &[u8]) -> Result<Self> {
        #[derive(Deserialize)]
        struct Written {
            normalize: Option<Normalization>,
            #[serde(flatten)]
            others: serde_json::Map<String, serde_json::Value>,
        }
        let read = || {
            let written: Written = serde_json::from_slice(json)?;
            let settings: Self = serde_json::from_value(written.others.into())?;
            Ok((written.normalize, settings))
        };
        let (normalize, settings) = read().map_err(|e: serde_json::Error| {
            Error::input(format!(
                "these are no settings of a detector: {e}; expected JSON such as {{\"input_size\": [256, 256], \
                 \"normalize\": \"imagenet\", \"output\": \"heatmaps\"}}"
            ))
        })?;
        let settings = match normalize {
            Some(normalize) => settings.normalized(normalize)?,
            None => settings,
        };
        settings.validate()?;
        Ok(settings)
    }

    /// These settings with a mean and a standard deviation by name.
    ///
    /// # Errors
    /// When they have numbers for them.
    fn normalized(self, by: Normalization) -> Result<Self> {
        if self.mean.is_some() || self.std.is_some() {
            return Err(Error::input(format!(
                "`normalize` is {by}, and a `mean` or a `std` is given as well; expected one of both ways"
            )));
        }
        let [mean, std] = by.numbers().map(Some);
        Ok(Self { mean, std, ..self })
    }

    /// The JSON that [`Settings::from_json`] reads.
    ///
    /// # Errors
    /// When a number is not finite.
    pub fn to_json(&self) -> Result<String> {
        self.validate()?;
        serde_json::to_string_pretty(self)
            .map_err(|e| Error::input(format!("the settings cannot be written: {e}")))
    }

    /// These settings, and what they leave open from `others`.
    #[must_use]
    pub fn or(self, others: Self) -> Self {
        Self {
            input_size: self.input_size.or(others.input_size),
            layout: self.layout.or(others.layout),
            channels: self.channels.or(others.channels),
            mean: self.mean.or(others.mean),
            std: self.std.or(others.std),
            output: self.output.or(others.output),
            output_names: self.output_names.or(others.output_names),
            decode: self.decode.or(others.decode),
            temperature: self.temperature.or(others.temperature),
            unit: self.unit.or(others.unit),
            columns: self.columns.or(others.columns),
        }
    }

    /// Checks what can be checked without a model.
    ///
    /// # Errors
    /// When a number is not finite, of no use, or there are too many.
    pub fn validate(&self) -> Result<()> {
        for (name, numbers) in [("mean", &self.mean), ("std", &self.std)] {
            let Some(numbers) = numbers else { continue };
            if !matches!(numbers.len(), 1 | 3) || numbers.iter().any(|v| !v.is_finite()) {
                return Err(Error::input(format!(
                    "{name} {numbers:?} is not usable; expected one number, or three for red, green and blue"
                )));
            }
        }
        if let Some(std) = &self.std
            && std.contains(&0.0)
        {
            return Err(Error::input(
                "a std of 0 would divide pixels by 0; expected other numbers",
            ));
        }
        if let Some(temperature) = self.temperature
            && !(temperature.is_finite() && temperature > 0.0)
        {
            return Err(Error::input(format!(
                "the temperature {temperature} is not usable; expected a number above 0"
            )));
        }
        Ok(())
    }
}

impl Serialize for InputSize {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            Self::Fixed(size) => size.serialize(serializer),
            Self::Frame => "frame".serialize(serializer),
        }
    }
}

impl<'de> Deserialize<'de> for InputSize {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        #[derive(Deserialize)]
        #[serde(untagged)]
        enum Written {
            Size([usize; 2]),
            Word(String),
        }
        let expected = "expected [width, height] in pixels, or \"frame\"";
        match Written::deserialize(deserializer) {
            Ok(Written::Size(size)) if size.iter().all(|side| *side > 0) => Ok(Self::Fixed(size)),
            Ok(Written::Word(word)) if word == "frame" => Ok(Self::Frame),
            _ => Err(serde::de::Error::custom(format!(
                "the input size is not one; {expected}"
            ))),
        }
    }
}
