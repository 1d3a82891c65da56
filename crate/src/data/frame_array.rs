//! Frames in an array.

use super::arrays::{ArrayInfo, Kind, Values, check_frames, count};
use super::image::{Frame, MAX_SIDE, MIN_SIDE, Pixels};
use crate::error::{Error, Result};

/// Where frames lie in their array.
pub(super) struct FrameArray {
    pub name: String,
    pub dtype: String,
    pub shape: Vec<u64>,
    pub kind: Kind,
    pub sequences: usize,
    pub frames: usize,
    pub width: u32,
    pub height: u32,
    pub channels_first: bool,
    /// Whether there is no axis of sequences.
    single: bool,
    /// What floats are at full brightness.
    full: f32,
}

impl FrameArray {
    pub fn new(name: &str, info: &ArrayInfo) -> Result<Self> {
        let place = || format!("`{name}` ({}, shape {:?})", info.dtype, info.shape);
        let Some(kind) = info.kind.filter(|kind| kind.holds_frames()) else {
            return Err(Error::input(format!(
                "{} is of a type that holds no frames; expected uint8, or float32 or float64 in [0, 1]",
                place()
            )));
        };
        let (single, (sequences, frames, image)) = match info.shape[..] {
            [s, t, a, b, c] => (false, (s, t, [a, b, c])),
            [t, a, b, c] => (true, (1, t, [a, b, c])),
            _ => (true, (0, 0, [0; 3])),
        };
        let (channels_first, [height, width]) = match image {
            [h, w, 3] => (false, [h, w]),
            [3, h, w] => (true, [h, w]),
            _ => {
                return Err(Error::input(format!(
                    "{} is no array of RGB frames; expected [S, T, H, W, 3] or [T, H, W, 3], or with the 3 channels \
                     before H and W",
                    place()
                )));
            }
        };
        let side = |side: u64| {
            u32::try_from(side)
                .ok()
                .filter(|s| (MIN_SIDE..=MAX_SIDE).contains(s))
        };
        let (Some(width), Some(height)) = (side(width), side(height)) else {
            return Err(Error::input(format!(
                "{} has frames of {width} x {height} pixels; expected {MIN_SIDE} to {MAX_SIDE} a side",
                place()
            )));
        };
        let (sequences, frames) = (
            count(sequences, name, &info.shape)?,
            count(frames, name, &info.shape)?,
        );
        check_frames(sequences, frames, name, &info.shape)?;
        Ok(Self {
            name: name.to_owned(),
            dtype: info.dtype.clone(),
            shape: info.shape.clone(),
            kind,
            sequences,
            frames,
            width,
            height,
            channels_first,
            single,
            full: 1.0,
        })
    }

    /// As a replay buffer of diffusion policy has them: floats are 0 to 255.
    pub fn in_bytes(self) -> Self {
        Self {
            full: 255.0,
            ..self
        }
    }

    pub fn leading(&self, i: usize) -> Vec<u64> {
        let (sequence, frame) = ((i / self.frames) as u64, (i % self.frames) as u64);
        match self.single {
            true => vec![frame],
            false => vec![sequence, frame],
        }
    }

    pub fn frame(&self, values: Values) -> Result<Frame> {
        let pixels = match values {
            Values::U8(values) => Pixels::Bytes(self.interleave(values)),
            Values::F32(values) => Pixels::Floats(self.floats(values)),
            Values::F64(values) => {
                Pixels::Floats(self.floats(values.into_iter().map(|v| v as f32).collect()))
            }
        };
        Frame::from_pixels(self.width, self.height, pixels)
    }

    fn floats(&self, mut values: Vec<f32>) -> Vec<f32> {
        if self.full != 1.0 {
            values.iter_mut().for_each(|value| *value /= self.full);
        }
        self.interleave(values)
    }

    fn interleave<T: Copy>(&self, values: Vec<T>) -> Vec<T> {
        if !self.channels_first {
            return values;
        }
        let plane = self.width as usize * self.height as usize;
        let at = |i: usize| values[i % 3 * plane + i / 3];
        (0..3 * plane).map(at).collect()
    }
}
