//! Points over time, and the spaces they live in.
//!
//! Everything is in *ndc* unless a name says otherwise: (x, y), x to the right, y down, -1 and +1
//! at the outer edges of the image. The centre of pixel `(col, row)` of a `W x H` image is at `x =
//! (2 col + 1) / W - 1`, `y = (2 row + 1) / H - 1`.
//!
//! Points may be in space as well, (x, y, z): in the unit of their file, whatever it is.

use std::collections::HashSet;

use ndarray::{Array2, Array3, ArrayView2, Axis};

use crate::error::{Error, Result};

/// The most coordinates that a point has: three where points in space are compiled in (feature
/// `space`).
pub const MOST_AXES: usize = if cfg!(feature = "space") { 3 } else { 2 };

/// Identifies a frame: the sequence it belongs to and its number there.
#[derive(Debug, Clone, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct FrameKey {
    /// The name of the sequence, as the folder or the table gives it.
    pub sequence: String,
    /// The number of the frame in its sequence.
    pub frame: u64,
}

impl std::fmt::Display for FrameKey {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "sequence {}, frame {}", self.sequence, self.frame)
    }
}

/// Keypoints `z_n` of a detector over time: T frames, N keypoints, (x, y) or (x, y, z).
#[derive(Debug, Clone, PartialEq)]
pub struct KeypointTrack {
    keys: Vec<FrameKey>,
    points: Array3<f64>,
    confidence: Option<Array2<f64>>,
}

/// Ground-truth positions `x_k` of objects over time: T frames, K objects, (x, y) in ndc, or (x, y,
/// z) in the unit of the file.
///
/// NaN means that the object is not visible in that frame.
#[derive(Debug, Clone, PartialEq)]
pub struct GroundTruth {
    keys: Vec<FrameKey>,
    names: Vec<String>,
    points_ndc: Array3<f64>,
    confidence: Option<Array2<f64>>,
}

fn check_shape(what: &str, keys: &[FrameKey], points: &Array3<f64>) -> Result<()> {
    let (t, _, axes) = points.dim();
    if !(2..=MOST_AXES).contains(&axes) || t != keys.len() {
        return Err(Error::input(format!(
            "{what} has shape {:?} for {} frames; expected (frames, points, {})",
            points.shape(),
            keys.len(),
            if MOST_AXES == 2 { "2" } else { "2 or 3" }
        )));
    }
    Ok(())
}

fn check_confidence(confidence: Option<&Array2<f64>>, points: &Array3<f64>) -> Result<()> {
    let (t, n, _) = points.dim();
    match confidence.filter(|confidence| confidence.dim() != (t, n)) {
        Some(confidence) => Err(Error::input(format!(
            "the confidence has shape {:?}; expected one number for each of {n} points in {t} frames",
            confidence.shape()
        ))),
        None => Ok(()),
    }
}

impl KeypointTrack {
    /// A track of `points` (T x N x 2, latent space or ndc, or T x N x 3), one row a key.
    ///
    /// # Errors
    /// When the shape is not (number of keys, N, 2 or 3).
    pub fn new(keys: Vec<FrameKey>, points: Array3<f64>) -> Result<Self> {
        check_shape("a keypoint track", &keys, &points)?;
        Ok(Self {
            keys,
            points,
            confidence: None,
        })
    }

    /// The same with the detector's `confidence` in each point, T x N; NaN where it gives none.
    ///
    /// # Errors
    /// When the shape is another one.
    pub fn with_confidence(self, confidence: Option<Array2<f64>>) -> Result<Self> {
        check_confidence(confidence.as_ref(), &self.points)?;
        Ok(Self { confidence, ..self })
    }

    /// How sure the detector is of each point, T x N, in its own unit; NaN where it does not say.
    pub fn confidence(&self) -> Option<&Array2<f64>> {
        self.confidence.as_ref()
    }

    /// The frames, in order.
    pub fn keys(&self) -> &[FrameKey] {
        &self.keys
    }

    /// T x N x 2, or 3 in space.
    pub fn points(&self) -> &Array3<f64> {
        &self.points
    }

    /// The N x 2 (in space 3) points of frame `t`.
    pub fn frame(&self, t: usize) -> ArrayView2<'_, f64> {
        self.points.index_axis(Axis(0), t)
    }

    /// The number of keypoints N.
    pub fn keypoints(&self) -> usize {
        self.points.dim().1
    }

    /// The number of coordinates of a keypoint: 2 in the image, 3 in space.
    pub fn axes(&self) -> usize {
        self.points.dim().2
    }
}

impl GroundTruth {
    /// A ground truth of `points_ndc` (T x K x 2, or T x K x 3 in any unit), one row a key, one
    /// column a name.
    ///
    /// # Errors
    /// When the shape is not (number of keys, number of names, 2 or 3), and when two objects have one
    /// name.
    pub fn new(keys: Vec<FrameKey>, names: Vec<String>, points_ndc: Array3<f64>) -> Result<Self> {
        check_shape("a ground truth", &keys, &points_ndc)?;
        if points_ndc.dim().1 != names.len() {
            return Err(Error::input(format!(
                "a ground truth of {} objects has {} names",
                points_ndc.dim().1,
                names.len()
            )));
        }
        let mut seen = HashSet::new();
        if let Some(name) = names.iter().find(|name| !seen.insert(*name)) {
            return Err(Error::input(format!(
                "two objects are named `{name}`; expected a name of its own for each"
            )));
        }
        Ok(Self {
            keys,
            names,
            points_ndc,
            confidence: None,
        })
    }

    /// The same with a `confidence` in each position, T x K; NaN where there is none.
    ///
    /// # Errors
    /// When the shape is another one.
    pub fn with_confidence(self, confidence: Option<Array2<f64>>) -> Result<Self> {
        check_confidence(confidence.as_ref(), &self.points_ndc)?;
        Ok(Self { confidence, ..self })
    }

    /// How sure each position is, T x K, in the unit of the file (COCO's v: 1 hidden by something, 2
    /// visible); NaN where it does not say.
    pub fn confidence(&self) -> Option<&Array2<f64>> {
        self.confidence.as_ref()
    }

    /// Only the objects `names`, in that order.
    ///
    /// # Errors
    /// When there is no object of a name, or a name stands twice.
    pub fn select(&self, names: &[String]) -> Result<Self> {
        let position = |name: &String| {
            self.names.iter().position(|n| n == name).ok_or_else(|| {
                Error::mismatch(format!(
                    "there is no object `{name}`; the objects are {}",
                    self.names.join(", ")
                ))
            })
        };
        let positions = names.iter().map(position).collect::<Result<Vec<usize>>>()?;
        let confidence = self.confidence.as_ref();
        Self::new(
            self.keys.clone(),
            names.to_vec(),
            self.points_ndc.select(Axis(1), &positions),
        )?
        .with_confidence(confidence.map(|confidence| confidence.select(Axis(1), &positions)))
    }

    /// The frames, in order.
    pub fn keys(&self) -> &[FrameKey] {
        &self.keys
    }

    /// The names of the objects, in order.
    pub fn names(&self) -> &[String] {
        &self.names
    }

    /// The number of coordinates of a position: 2 in the image, 3 in space.
    pub fn axes(&self) -> usize {
        self.points_ndc.dim().2
    }

    /// The ground truth, if it is in the image.
    ///
    /// # Errors
    /// When it is in space; the message says that `purpose` needs it in the image.
    pub fn in_image(self, purpose: &str) -> Result<Self> {
        match self.axes() {
            2 => Ok(self),
            _ => Err(Error::mismatch(format!(
                "the ground truth has three coordinates, and {purpose} needs positions in the image; expected x and \
                 y: leave z out (--xy-only), or project it with the camera first"
            ))),
        }
    }

    /// T x K x 2, or 3 in space, then in the unit of the file.
    pub fn points_ndc(&self) -> &Array3<f64> {
        &self.points_ndc
    }

    /// The K x 2 (in space 3) positions of frame `t`.
    pub fn frame(&self, t: usize) -> ArrayView2<'_, f64> {
        self.points_ndc.index_axis(Axis(0), t)
    }
}
