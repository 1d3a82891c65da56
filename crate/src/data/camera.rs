//! A camera, which puts positions in space into its image.

use ndarray::{Array3, s};
use serde::Deserialize;

use super::reading::ndc_from_pixels;
use crate::error::{Error, Result};
use crate::track::GroundTruth;

/// How far the rows of a rotation may be from unit vectors at right angles: files have few digits.
const ROUNDED: f64 = 1e-3;

/// A pinhole camera with lens distortion, as OpenCV has it: x right, y down, z forward, the centre
/// of the first pixel at (0, 0).
///
/// A position X in the world is at `R X + t` in front of the camera; over its z, distorted and times
/// the intrinsics it is a pixel.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Camera {
    /// Width and height of the images in pixels.
    pub image_size: [u32; 2],
    /// `[[fx, skew, cx], [0, fy, cy], [0, 0, 1]]`, pixels.
    pub intrinsics: [[f64; 3]; 3],
    /// `camera_from_world`, row by row.
    pub rotation: [[f64; 3]; 3],
    /// Where the origin of the world is from the camera, in the unit of the positions.
    pub translation: [f64; 3],
    /// `[k1, k2, p1, p2, k3]`: radial and tangential, as OpenCV orders them; none where it is left
    /// out.
    #[serde(default)]
    pub distortion: [f64; 5],
}

/// A ground truth in the image of a camera.
#[derive(Debug, Clone, PartialEq)]
pub struct Projected {
    /// In ndc; what is behind the camera is not visible.
    pub truth: GroundTruth,
    /// Positions in front of the camera.
    pub projected: u64,
    /// Positions behind it, or in its plane.
    pub behind: u64,
}

impl Camera {
    /// Parses the JSON of a camera; `name` is that of the file.
    ///
    /// # Errors
    /// When it is not such JSON, and when its numbers are not those of a camera; the message says
    /// which and what was expected.
    pub fn parse(bytes: &[u8], name: &str) -> Result<Self> {
        let camera: Self = serde_json::from_slice(bytes).map_err(|e| {
            Error::input(format!(
                "not the JSON of a camera ({e}); expected `image_size` [width, height], `intrinsics` and `rotation` of \
                 three rows of three numbers, `translation` of three, and where the lens distorts `distortion` [k1, k2, \
                 p1, p2, k3]"
            ))
            .at(name)
        })?;
        camera.check().map_err(|e| e.at(name))?;
        Ok(camera)
    }

    fn check(&self) -> Result<()> {
        let wrong = |text: String| Err(Error::input(text));
        if self.image_size.contains(&0) {
            return wrong(format!(
                "`image_size` is {:?}; expected [width, height] in pixels",
                self.image_size
            ));
        }
        let [[fx, _, _], [below, fy, _], last] = self.intrinsics;
        if !(fx > 0.0 && fy > 0.0 && below == 0.0 && last == [0.0, 0.0, 1.0]) {
            return wrong(format!(
                "`intrinsics` are {:?}; expected [[fx, skew, cx], [0, fy, cy], [0, 0, 1]] with fx and fy above 0, in \
                 pixels",
                self.intrinsics
            ));
        }
        let [a, b, c] = self.rotation;
        let products = [
            dot(a, a),
            dot(b, b),
            dot(c, c),
            dot(a, b),
            dot(b, c),
            dot(c, a),
        ];
        let is_right_angled = (products.iter().zip([1.0, 1.0, 1.0, 0.0, 0.0, 0.0]))
            .all(|(product, expected)| (product - expected).abs() < ROUNDED);
        let turned = [
            a[1] * b[2] - a[2] * b[1],
            a[2] * b[0] - a[0] * b[2],
            a[0] * b[1] - a[1] * b[0],
        ];
        if !is_right_angled || dot(turned, c) < 0.0 {
            return wrong(format!(
                "`rotation` is {:?}; expected the rotation from the world to the camera: three rows of length 1 at right \
                 angles, not mirrored",
                self.rotation
            ));
        }
        Ok(())
    }

    /// Where a position is in the image, in ndc; None where it is not in front of the camera.
    pub fn ndc_from_world(&self, world: [f64; 3]) -> Option<[f64; 2]> {
        let [x, y, z] = [0, 1, 2].map(|row| dot(self.rotation[row], world) + self.translation[row]);
        if z <= 0.0 {
            return None;
        }
        let [x, y] = self.distorted([x / z, y / z]);
        let [[fx, skew, cx], [_, fy, cy], _] = self.intrinsics;
        let px = [fx * x + skew * y + cx, fy * y + cy];
        Some(ndc_from_pixels(px, self.image_size))
    }

    fn distorted(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        let [k1, k2, p1, p2, k3] = self.distortion;
        let r = x * x + y * y;
        let radial = 1.0 + r * (k1 + r * (k2 + r * k3));
        [
            x * radial + 2.0 * p1 * x * y + p2 * (r + 2.0 * x * x),
            y * radial + p1 * (r + 2.0 * y * y) + 2.0 * p2 * x * y,
        ]
    }

    /// Puts a ground truth in space into the image.
    ///
    /// # Errors
    /// When it is in the image already.
    pub fn project(&self, truth: &GroundTruth) -> Result<Projected> {
        let (frames, objects, axes) = truth.points_ndc().dim();
        if axes != 3 {
            return Err(Error::mismatch(
                "the ground truth has two coordinates, and a camera projects three; leave the camera out, or give the \
                 positions with z",
            ));
        }
        let mut points = Array3::from_elem((frames, objects, 2), f64::NAN);
        let (mut projected, mut behind) = (0, 0);
        for t in 0..frames {
            for k in 0..objects {
                let at = truth.points_ndc().slice(s![t, k, ..]);
                if at.iter().any(|v| !v.is_finite()) {
                    continue;
                }
                match self.ndc_from_world([at[0], at[1], at[2]]) {
                    Some(ndc) => {
                        projected += 1;
                        points[[t, k, 0]] = ndc[0];
                        points[[t, k, 1]] = ndc[1];
                    }
                    None => behind += 1,
                }
            }
        }
        let image = GroundTruth::new(truth.keys().to_vec(), truth.names().to_vec(), points)?;
        Ok(Projected {
            truth: image.with_confidence(truth.confidence().cloned())?,
            projected,
            behind,
        })
    }
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}
