//! Positions that look like another unit than the one they were read in.

use ndarray::{Array3, Axis};

use super::blocks::Blocks;
use super::finding::{Evidence, Finding, Problem, Remedy, Side};
use super::subject::Subject;
use crate::data::{Ground, Layout, Reading, Space};

/// Fewer coordinates say nothing about their unit.
const LEAST: usize = 20;
/// Coordinates beyond this, in ndc, lie far outside the image: half its width away.
const FAR: f64 = 2.0;
/// How far points may lie outside the image, in its width, and how many of the coordinates.
const OUTSIDE: f64 = 0.25;
const MANY_OUTSIDE: f64 = 0.1;
/// The share of coordinates that may be an exception.
const FEW: f64 = 0.02;
/// The part of the width and the height that positions from 0 to 1 must take up, so that they are
/// not simply in one quarter of the image.
const SPAN: f64 = 0.6;
/// Up to which pixel positions in another unit than pixels lie, read as pixels.
const FIRST_PIXEL: f64 = 1.1;
/// The share of its variance up to which an object is followed.
const FOLLOWED: f64 = 0.2;
/// Points of which it is not likely that all are in one quarter of the image.
const MANY: usize = 3;
/// How far pixels may lie outside the image, relative to the largest coordinates.
const OUTSIDE_PIXELS: f64 = 0.2;

pub(super) fn examine(subject: &Subject, blocks: &Blocks) -> Vec<Finding> {
    [Side::Truth, Side::Keypoints]
        .into_iter()
        .filter_map(|side| of(subject, side, blocks))
        .collect()
}

fn of(subject: &Subject, side: Side, blocks: &Blocks) -> Option<Finding> {
    let reading = subject.reading(side)?;
    if subject.is_said(side, |reading| reading.space) || reading.layout == Layout::Extraction {
        return None;
    }
    let points = Coordinates::of(points(subject, side), reading, subject.image_size);
    let all = points.values.len();
    if all < LEAST {
        return None;
    }
    let (count, what, spaces) = match reading.space.value {
        Space::Ndc | Space::World => {
            if points.are_far() {
                let count = points.count_where(|v| v > FAR);
                let of = subject
                    .image_size
                    .map_or_else(String::new, |[w, h]| format!(" of {w} x {h}"));
                (count, format!("look like pixels{of}"), vec![Space::Pixels])
            } else if points.are_fractions() && is_fraction(subject, side, &points, blocks) {
                let count = points.count_where(|v| v >= 0.0);
                (
                    count,
                    "look like shares of the image, 0 to 1".to_owned(),
                    vec![Space::Fraction],
                )
            } else {
                return None;
            }
        }
        Space::Pixels if points.are_in_first_pixel() => {
            let negative = points.count_where(|v| v < 0.0) as f64;
            let spaces = match negative > FEW * all as f64 {
                true => vec![Space::Ndc],
                false => vec![Space::Fraction, Space::Ndc],
            };
            (
                all,
                "are all within a pixel of the image's first one and look like another unit"
                    .to_owned(),
                spaces,
            )
        }
        Space::Pixels | Space::Fraction => return None,
    };
    Some(Finding {
        problem: Problem::Unit,
        text: format!(
            "the positions of {} {what} ({count} of {all} coordinates, {:.3} to {:.3}), and were read as {}",
            side.words(),
            points.lowest,
            points.highest,
            match reading.space.value {
                Space::Ndc | Space::World => "ndc, -1 to +1 across the image",
                Space::Pixels => "pixels",
                Space::Fraction => "shares of the image, 0 to 1",
            }
        ),
        evidence: Evidence {
            count,
            of: all,
            ..Evidence::default()
        },
        remedies: spaces
            .into_iter()
            .map(|space| Remedy::Unit { side, space })
            .collect(),
    })
}

fn points<'a>(subject: &Subject<'a>, side: Side) -> &'a Array3<f64> {
    match side {
        Side::Truth => subject.truth.points_ndc(),
        Side::Keypoints => subject.keypoints.points(),
    }
}

/// Finite coordinates in the unit they were read in.
struct Coordinates {
    values: Vec<f64>,
    /// How far they reach along x and along y.
    spans: [f64; 2],
    lowest: f64,
    highest: f64,
    /// The number of points.
    count: usize,
}

impl Coordinates {
    fn of(points: &Array3<f64>, reading: &Reading, image_size: Option<[u32; 2]>) -> Self {
        let flip = reading.flip.value.axes();
        // Of images of unknown size a pixel is taken for as large as in one of 64, which only tells
        // positions near the first pixel from others.
        let size = image_size.unwrap_or([64; 2]);
        let mut values = Vec::with_capacity(points.len());
        let mut ends = [[f64::INFINITY, f64::NEG_INFINITY]; 2];
        for (i, along) in points.axis_iter(Axis(2)).enumerate() {
            for value in along.iter().filter(|v| v.is_finite()) {
                let ndc = if flip[i] { -value } else { *value };
                let value = match reading.space.value {
                    Space::Ndc | Space::World => ndc,
                    Space::Pixels => ((ndc + 1.0) * f64::from(size[i]) - 1.0) / 2.0,
                    Space::Fraction => (ndc + 1.0) / 2.0,
                };
                values.push(value);
                ends[i] = [ends[i][0].min(value), ends[i][1].max(value)];
            }
        }
        Self {
            values,
            spans: ends.map(|[low, high]| high - low),
            lowest: ends[0][0].min(ends[1][0]),
            highest: ends[0][1].max(ends[1][1]),
            count: points.dim().1,
        }
    }

    fn count_where(&self, is: impl Fn(f64) -> bool) -> usize {
        self.values.iter().filter(|v| is(**v)).count()
    }

    fn share(&self, is: impl Fn(f64) -> bool) -> f64 {
        self.count_where(is) as f64 / self.values.len() as f64
    }

    /// Read as ndc, as pixels would lie: most far outside, few far outside at the top or left.
    fn are_far(&self) -> bool {
        let outside = FAR.max(OUTSIDE_PIXELS * self.highest);
        self.share(|v| v > FAR) >= 0.5 && self.share(|v| v < -outside) <= FEW
    }

    /// Read as ndc, as shares of the image would lie.
    fn are_fractions(&self) -> bool {
        self.lowest >= -OUTSIDE
            && self.highest <= 1.0 + OUTSIDE
            && self.share(|v| !(0.0..=1.0).contains(&v)) <= MANY_OUTSIDE
    }

    /// Read as pixels, as ndc or shares of the image would lie.
    fn are_in_first_pixel(&self) -> bool {
        self.lowest >= -FIRST_PIXEL && self.highest <= FIRST_PIXEL
    }
}

/// Whether positions from 0 to 1 are shares of the image, rather than ndc in one quarter of it.
///
/// Where the other side is ndc and a keypoint follows an object, its map says so: the centre of the
/// image is the origin of ndc, and 0.5 in shares of the image.
fn is_fraction(subject: &Subject, side: Side, points: &Coordinates, blocks: &Blocks) -> bool {
    let other = match side {
        Side::Truth => Side::Keypoints,
        Side::Keypoints => Side::Truth,
    };
    let of_other = subject.reading(other).map(|reading| {
        let points = Coordinates::of(self::points(subject, other), reading, subject.image_size);
        let is_open = reading.space.value == Space::Ndc && reading.space.by != Ground::Said;
        let is_ndc = !is_open || !(points.are_far() || points.are_fractions());
        (points, is_ndc)
    });
    let is_spread = |points: &Coordinates| points.spans.iter().all(|span| *span >= SPAN);
    match of_other {
        Some((other, false)) => is_spread(points) && is_spread(&other),
        _ => match blocks.origin(FOLLOWED) {
            // In ndc `x = z`; with shares in place of the object `x = z / 2 + 1 / 2`, in place of the
            // keypoint `x = 2 z - 1`.
            Some(origin) if side == Side::Truth => origin > 0.25,
            Some(origin) => origin < -0.5,
            None => is_spread(points) && points.count >= MANY,
        },
    }
}
