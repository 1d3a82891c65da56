//! The planes that moments of points in space are made of.
//!
//! The moments of a keypoint (x, y, z) with an object are those of all pairs of coordinates. So the
//! accumulator of points in the image serves space as well, one a pair of coordinates of the
//! keypoint and of the object; nothing of it is written twice, and nothing of the plane changes.

#[cfg(feature = "space")]
use super::moments::Moments;

/// Which two coordinates of a keypoint and of an object.
pub type Plane = [[usize; 2]; 2];

/// The planes of keypoints and objects of `axes` coordinates, the one of the first two first.
pub fn planes(axes: [usize; 2]) -> Vec<Plane> {
    // Products of all coordinates of a keypoint are needed; of an object the squares alone.
    let of_keypoint: &[[usize; 2]] = match axes[0] {
        3 => &[[0, 1], [1, 2], [2, 0]],
        _ => &[[0, 1]],
    };
    let of_object: &[[usize; 2]] = match axes[1] {
        3 => &[[0, 1], [1, 2]],
        _ => &[[0, 1]],
    };
    let pairs = of_keypoint.iter();
    pairs
        .flat_map(|z| of_object.iter().map(move |x| [*z, *x]))
        .collect()
}

#[cfg(feature = "space")]
impl Moments {
    /// The moments of every plane with its coordinates.
    pub(super) fn planes(&self) -> impl Iterator<Item = (Plane, &Self)> {
        let all = std::iter::once(self).chain(&self.others);
        planes(self.axes).into_iter().zip(all)
    }
}
