//! A few values, one a coordinate.

use std::ops::{Deref, DerefMut};

use crate::track::MOST_AXES;

/// One value a coordinate, two or three in all: a slice that needs no allocation.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Axes<T> {
    /// The default behind the last coordinate.
    values: [T; MOST_AXES],
    count: usize,
}

impl<T: Copy + Default> Axes<T> {
    /// The values of `count` coordinates, at most [`MOST_AXES`].
    pub fn of(count: usize, mut value: impl FnMut(usize) -> T) -> Self {
        let mut axes = Self {
            values: [T::default(); MOST_AXES],
            count: count.min(MOST_AXES),
        };
        for (axis, at) in axes.iter_mut().enumerate() {
            *at = value(axis);
        }
        axes
    }
}

impl<T: Copy + Default, const N: usize> From<[T; N]> for Axes<T> {
    fn from(values: [T; N]) -> Self {
        const { assert!(N <= MOST_AXES, "more coordinates than points have") };
        Self::of(N, |axis| values[axis])
    }
}

impl<T> Deref for Axes<T> {
    type Target = [T];

    fn deref(&self) -> &[T] {
        &self.values[..self.count.min(MOST_AXES)]
    }
}

impl<T> DerefMut for Axes<T> {
    fn deref_mut(&mut self) -> &mut [T] {
        &mut self.values[..self.count.min(MOST_AXES)]
    }
}

#[cfg(feature = "data")]
impl<T: serde::Serialize> serde::Serialize for Axes<T> {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        (**self).serialize(serializer)
    }
}

#[cfg(feature = "data")]
impl<'de, T: serde::Deserialize<'de> + Copy + Default> serde::Deserialize<'de> for Axes<T> {
    fn deserialize<D: serde::Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let values = Vec::<T>::deserialize(deserializer)?;
        match values.len() {
            2..=MOST_AXES => Ok(Self::of(values.len(), |axis| values[axis])),
            other => Err(serde::de::Error::invalid_length(
                other,
                &"a value for each of two or three coordinates",
            )),
        }
    }
}
