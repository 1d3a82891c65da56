//! What the numbers of a table or an array are: their unit, the order of the coordinates, the
//! number of the first frame, and what each of these rests on.

use std::fmt;
use std::str::FromStr;

use ndarray::Array3;
use serde::{Deserialize, Serialize};

use crate::error::{Error, Reason, Result, without_controls};

/// A table or an array that was parsed, with what a person should know of how it was read.
#[derive(Debug, Clone, PartialEq)]
pub struct Parsed<T> {
    /// The content.
    pub content: T,
    /// What its numbers were taken for.
    pub reading: Reading,
    /// E.g. that semicolons separate the fields, or how many points are missing.
    pub notices: Vec<Notice>,
}

/// Something a person should know of how a file was read.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Notice {
    /// In words.
    pub text: String,
    /// What a program needs to know to offer a remedy.
    pub reason: Option<Reason>,
}

impl Notice {
    pub(super) fn because(text: impl Into<String>, reason: Reason) -> Self {
        Self {
            text: text.into(),
            reason: Some(reason),
        }
    }
}

impl From<String> for Notice {
    fn from(text: String) -> Self {
        Self {
            text: without_controls(&text).into_owned(),
            reason: None,
        }
    }
}

impl fmt::Display for Notice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.text)
    }
}

/// What the numbers of a table were taken for, and what said so.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "camelCase")]
pub struct Reading {
    /// How the table is written.
    pub layout: Layout,
    /// The unit of the positions.
    pub space: Known<Space>,
    /// The order of the coordinates.
    #[serde(rename = "axisOrder")]
    pub axes: Known<AxisOrder>,
    /// The number of the first frame.
    pub index_base: Known<u64>,
    /// The number of the first keypoint in a tidy table.
    pub first_keypoint: u64,
    /// The axes that run the other way.
    pub flip: Known<Flip>,
    /// Whether positions of exactly (0, 0) mean that the point was not found.
    pub zero_is_missing: Known<bool>,
    /// Width and height of the images in pixels, where the file says them and they are all the same.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub image_size: Option<[u32; 2]>,
}

impl Reading {
    /// What a table of this layout is taken for.
    pub(super) fn new(layout: Layout, options: &TableOptions) -> Self {
        let (space, by) = match layout {
            Layout::Tidy | Layout::Wide => (Space::Ndc, Ground::Guess),
            Layout::DeepLabCut | Layout::Sleap | Layout::Mot | Layout::Coco => {
                (Space::Pixels, Ground::File)
            }
            Layout::Arrays | Layout::Extraction => (Space::Ndc, Ground::File),
        };
        Self {
            layout,
            space: Known::of(options.space, space, by),
            // All of these name their columns or say which number is which.
            axes: Known::of(options.axes, AxisOrder::Xy, Ground::File),
            index_base: Known::of(options.index_base, 0, Ground::Guess),
            first_keypoint: options.first_keypoint(),
            flip: Known::of(options.flip, Flip::None, Ground::Guess),
            zero_is_missing: Known::of(options.zero_is_missing, false, Ground::Guess),
            image_size: None,
        }
    }

    /// Takes the points for some in space, in the unit of their file.
    ///
    /// # Errors
    /// When a person said a unit of the image.
    pub(super) fn in_space(&mut self, options: &TableOptions) -> Result<()> {
        if let Some(said) = options.space {
            return Err(Error::input(format!(
                "positions have three coordinates and are read in the unit of the file; `{}` is a unit of positions in \
                 the image: leave it out, or score x and y alone (--xy-only)",
                said.name()
            )));
        }
        self.space = Known {
            value: Space::World,
            by: Ground::File,
        };
        Ok(())
    }

    /// Of points that were extracted here.
    pub fn of_extraction() -> Self {
        let mut reading = Self::new(Layout::Extraction, &TableOptions::default());
        reading.index_base.by = Ground::File;
        reading
    }
}

/// A value with its ground.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Known<T> {
    /// The value.
    pub value: T,
    /// What it rests on.
    pub by: Ground,
}

impl<T> Known<T> {
    /// What a person said; without that `otherwise`, on its own ground.
    pub(super) fn of(said: Option<T>, otherwise: T, by: Ground) -> Self {
        match said {
            Some(value) => Self {
                value,
                by: Ground::Said,
            },
            None => Self {
                value: otherwise,
                by,
            },
        }
    }
}

/// What a value rests on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Ground {
    /// A person said so.
    Said,
    /// The file says so, or its layout always has it so.
    File,
    /// Nothing: the usual case is taken.
    Guess,
}

impl Ground {
    /// `said`, `file` or `guess`.
    pub fn name(self) -> &'static str {
        match self {
            Self::Said => "said",
            Self::File => "file",
            Self::Guess => "guess",
        }
    }
}

/// The unit of a table's positions.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Space {
    /// -1 and +1 at the outer edges of the image.
    Ndc,
    /// Pixels, with the centre of the first one at (0, 0).
    #[serde(rename = "px")]
    Pixels,
    /// Shares of the width and the height: 0 and 1 at the outer edges of the image.
    Fraction,
    /// That of the file, of points with three coordinates.
    World,
}

impl Space {
    /// `ndc`, `px`, `fraction` or `world`.
    pub fn name(self) -> &'static str {
        match self {
            Self::Ndc => "ndc",
            Self::Pixels => "px",
            Self::Fraction => "fraction",
            Self::World => "world",
        }
    }

    /// A position in this unit in ndc; None where it takes the size of the image and there is none.
    pub(super) fn to_ndc(self, at: [f64; 2], image_size: Option<[u32; 2]>) -> Option<[f64; 2]> {
        match self {
            Self::Ndc | Self::World => Some(at),
            Self::Pixels => image_size.map(|size| ndc_from_pixels(at, size)),
            Self::Fraction => Some(at.map(|v| 2.0 * v - 1.0)),
        }
    }
}

impl FromStr for Space {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        match text {
            "ndc" => Ok(Self::Ndc),
            "px" => Ok(Self::Pixels),
            "fraction" => Ok(Self::Fraction),
            _ => Err(Error::input(format!(
                "`{text}` is no space; expected ndc, px or fraction"
            ))),
        }
    }
}

/// What the last axis of an array of points holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum AxisOrder {
    /// (x, y)
    Xy,
    /// (y, x)
    Yx,
}

impl AxisOrder {
    /// `xy` or `yx`.
    pub fn name(self) -> &'static str {
        match self {
            Self::Xy => "xy",
            Self::Yx => "yx",
        }
    }
}

impl FromStr for AxisOrder {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        match text {
            "xy" => Ok(Self::Xy),
            "yx" => Ok(Self::Yx),
            _ => Err(Error::input(format!(
                "`{text}` is no axis order; expected xy or yx"
            ))),
        }
    }
}

impl fmt::Display for AxisOrder {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Xy => "(x, y)",
            Self::Yx => "(y, x)",
        })
    }
}

/// How a table is written.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Layout {
    /// One row a point.
    #[serde(rename = "one row a point")]
    Tidy,
    /// One row a frame, two columns a point.
    #[serde(rename = "one row a frame")]
    Wide,
    /// DeepLabCut's CSV.
    #[serde(rename = "DeepLabCut")]
    DeepLabCut,
    /// SLEAP's CSV of an analysis.
    #[serde(rename = "SLEAP")]
    Sleap,
    /// Boxes in rows without a header, as the MOT challenge has them.
    #[serde(rename = "MOT boxes")]
    Mot,
    /// COCO keypoints, JSON.
    #[serde(rename = "COCO keypoints")]
    Coco,
    /// Arrays of a recording, NPZ or HDF5.
    #[serde(rename = "arrays of a recording")]
    Arrays,
    /// None: the points were extracted here.
    #[serde(rename = "an extraction")]
    Extraction,
}

impl fmt::Display for Layout {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Tidy => "one row a point",
            Self::Wide => "one row a frame",
            Self::DeepLabCut => "DeepLabCut",
            Self::Sleap => "SLEAP",
            Self::Mot => "MOT boxes",
            Self::Coco => "COCO keypoints",
            Self::Arrays => "arrays of a recording",
            Self::Extraction => "an extraction",
        })
    }
}

/// What a person knows about a table and the file does not say.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct TableOptions {
    /// The unit of the positions; default: pixels for DeepLabCut, SLEAP, MOT and COCO, otherwise
    /// ndc.
    pub space: Option<Space>,
    /// The order of the two coordinates under the names x and y; default: (x, y).
    pub axes: Option<AxisOrder>,
    /// The number of the first frame; default: 0.
    pub index_base: Option<u64>,
    /// The number of the first keypoint in a tidy table; default: that of the first frame.
    pub first_keypoint: Option<u64>,
    /// `[width, height]` of the images; needed for positions in pixels, but for COCO.
    pub image_size: Option<[u32; 2]>,
    /// Which axes run the other way, as where y points up; default: none.
    pub flip: Option<Flip>,
    /// Whether a position of exactly (0, 0), as the file has it, means that the point was not
    /// found; default: no.
    pub zero_is_missing: Option<bool>,
    /// Whether z is left out of points with three coordinates; default: no, they are in space.
    pub xy_only: bool,
}

impl TableOptions {
    /// The number of the first keypoint in a tidy table.
    pub(super) fn first_keypoint(&self) -> u64 {
        self.first_keypoint.or(self.index_base).unwrap_or_default()
    }

    /// A position of a file, whose coordinates are in the order (x, y), in ndc; not finite where
    /// it means that the point is missing, and None where it takes the size of the image and there
    /// is none.
    pub(super) fn place(
        &self,
        at: [f64; 2],
        space: Space,
        image_size: Option<[u32; 2]>,
    ) -> Option<[f64; 2]> {
        if self.zero_is_missing == Some(true) && at == [0.0, 0.0] {
            return Some([f64::NAN; 2]);
        }
        let mut placed = space.to_ndc(at, image_size)?;
        self.flip(&mut placed);
        Some(placed)
    }

    /// A position in space, which stays in the unit of its file; not finite where it means that the
    /// point is missing.
    pub(super) fn place_in_space(&self, at: [f64; 3]) -> [f64; 3] {
        if self.zero_is_missing == Some(true) && at == [0.0; 3] {
            return [f64::NAN; 3];
        }
        let mut placed = at;
        self.flip(&mut placed);
        placed
    }

    fn flip(&self, point: &mut [f64]) {
        for (value, is_flipped) in point.iter_mut().zip(self.flip.unwrap_or_default().axes()) {
            if is_flipped {
                *value = -*value;
            }
        }
    }
}

/// The axes of positions that run the other way than here, where x points right and y down.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Flip {
    /// None.
    #[default]
    None,
    /// x points left.
    X,
    /// y points up.
    Y,
    /// Both.
    Xy,
}

impl Flip {
    /// Of the axes that are to be flipped.
    pub fn of([x, y]: [bool; 2]) -> Self {
        match (x, y) {
            (false, false) => Self::None,
            (true, false) => Self::X,
            (false, true) => Self::Y,
            (true, true) => Self::Xy,
        }
    }

    /// Whether x and y are flipped.
    pub fn axes(self) -> [bool; 2] {
        [
            matches!(self, Self::X | Self::Xy),
            matches!(self, Self::Y | Self::Xy),
        ]
    }

    /// `none`, `x`, `y` or `xy`.
    pub fn name(self) -> &'static str {
        match self {
            Self::None => "none",
            Self::X => "x",
            Self::Y => "y",
            Self::Xy => "xy",
        }
    }
}

impl FromStr for Flip {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        let all = [Self::None, Self::X, Self::Y, Self::Xy];
        all.into_iter()
            .find(|flip| flip.name() == text)
            .ok_or_else(|| {
                Error::input(format!("`{text}` names no axes; expected x, y, xy or none"))
            })
    }
}

/// A position in pixels, the centre of the first one at (0, 0), in ndc.
pub(super) fn ndc_from_pixels(px: [f64; 2], image_size: [u32; 2]) -> [f64; 2] {
    [0, 1].map(|axis| (2.0 * px[axis] + 1.0) / f64::from(image_size[axis]) - 1.0)
}

/// A position in ndc in pixels, the centre of the first one at (0, 0).
pub(super) fn px_from_ndc(ndc: [f64; 2], image_size: [u32; 2]) -> [f64; 2] {
    [0, 1].map(|axis| ((ndc[axis] + 1.0) * f64::from(image_size[axis]) - 1.0) / 2.0)
}

/// The error of `positions` in pixels of images of unknown size; `by` says why they are in pixels.
pub(super) fn missing_image_size(positions: &str, by: Ground) -> Error {
    let why = match by {
        Ground::Said => "as given",
        Ground::File | Ground::Guess => "as always in this layout",
    };
    Error::input(format!(
        "{positions} are in pixels ({why}), and the size of the images is not known; expected the frames, or their size"
    ))
    .because(Reason::MissingImageSize)
}

/// How many points are missing, in the words of `missing`, and what looks like another unit than
/// ndc.
pub(super) fn point_notices(points: &Array3<f64>, missing: &str) -> Vec<Notice> {
    let hidden: usize = points.outer_iter().map(|frame| hidden(&frame)).sum();
    let (frames, count, _) = points.dim();
    let points_in_all = frames * count;
    let notice = (hidden > 0).then(|| {
        Notice::because(
            format!("{hidden} of {points_in_all} {missing}"),
            Reason::MissingPoints {
                missing: hidden,
                points: points_in_all,
            },
        )
    });
    // What is in space is in the unit of its file.
    let unit = match points.dim().2 {
        2 => unit_notice(points),
        _ => None,
    };
    notice.into_iter().chain(unit).collect()
}

/// What looks like another unit than ndc.
fn unit_notice(points: &Array3<f64>) -> Option<Notice> {
    let seen = || points.iter().filter(|v| v.is_finite());
    let far = seen().filter(|v| v.abs() > 16.0).count();
    if far > 0 {
        return Some(Notice::because(
            format!(
                "{far} coordinates lie beyond ±16: are these pixels? Expected ndc, -1 to +1 across the image"
            ),
            Reason::LooksLikePixels { coordinates: far },
        ));
    }
    // A pixel of 256 x 256 is 1/128 wide.
    if seen().count() >= 20 && seen().all(|v| *v < -0.97) {
        return Some(Notice::because(
            "all coordinates lie in the first corner of the image: are they ndc already, and read as pixels?",
            Reason::LooksLikeNdc,
        ));
    }
    let none_negative = seen().count() >= 20 && seen().all(|v| *v >= 0.0);
    none_negative.then(|| {
        Notice::because(
            "no coordinate is negative: is this another unit, e.g. 0 to 1 across the image? Expected ndc, -1 to +1",
            Reason::LooksLikeFractions,
        )
    })
}

fn hidden(points: &ndarray::ArrayView2<f64>) -> usize {
    let unseen = |p: &ndarray::ArrayView1<f64>| p.iter().any(|v| !v.is_finite());
    points.rows().into_iter().filter(|p| unseen(p)).count()
}
