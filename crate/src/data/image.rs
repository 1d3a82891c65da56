//! Frames: the pixels of images.

use std::borrow::Cow;

#[cfg(feature = "jpeg-webp")]
use ::image::codecs::jpeg::JpegEncoder;
use ::image::codecs::png::PngEncoder;
use ::image::{ExtendedColorType, ImageEncoder as _};

use super::npy;
use super::resize::{Filter, resize_planar};
use crate::error::{Error, Result};

/// The smallest side of a frame, in pixels: less holds no image for an encoder that halves it three
/// times.
pub const MIN_SIDE: u32 = 16;

/// The largest side of a frame, in pixels.
pub const MAX_SIDE: u32 = 8192;

/// How far a float may lie outside [0, 1], from rounding or resampling.
pub const OVERSHOOT: f32 = 1e-3;

/// A decoded frame, RGB: 8 bits a channel, as images have, or floats in [0, 1], as recordings may
/// have.
#[derive(Debug, Clone, PartialEq)]
pub struct Frame {
    width: u32,
    height: u32,
    pixels: Pixels,
}

/// Pixels row by row, red, green and blue together.
#[derive(Debug, Clone, PartialEq)]
pub enum Pixels {
    /// 0 to 255.
    Bytes(Vec<u8>),
    /// 0 to 1, not quantised; resampling may have overshot by [`OVERSHOOT`].
    Floats(Vec<f32>),
}

impl Pixels {
    fn len(&self) -> usize {
        match self {
            Self::Bytes(bytes) => bytes.len(),
            Self::Floats(floats) => floats.len(),
        }
    }
}

impl Frame {
    /// A frame from `width * height * 3` bytes, row by row.
    ///
    /// # Errors
    /// As [`Frame::from_pixels`].
    pub fn new(width: u32, height: u32, rgb: Vec<u8>) -> Result<Self> {
        Self::from_pixels(width, height, Pixels::Bytes(rgb))
    }

    /// A frame from `width * height * 3` values, row by row.
    ///
    /// # Errors
    /// When the number of values is another one, or a float is not within [0, 1] (give or take
    /// [`OVERSHOOT`]).
    pub fn from_pixels(width: u32, height: u32, pixels: Pixels) -> Result<Self> {
        let expected = width as usize * height as usize * 3;
        if pixels.len() != expected {
            return Err(Error::input(format!(
                "{} values for a frame of {width} x {height}; expected {expected}",
                pixels.len()
            )));
        }
        if let Pixels::Floats(floats) = &pixels
            && let Some(at) = floats
                .iter()
                .position(|v| !(-OVERSHOOT..=1.0 + OVERSHOOT).contains(v))
        {
            return Err(Error::input(format!(
                "the value {} of pixel ({}, {}) is not within 0 to 1; expected floats in that range, or 8-bit integers",
                floats[at],
                at / 3 % width as usize,
                at / 3 / width as usize
            )));
        }
        Ok(Self {
            width,
            height,
            pixels,
        })
    }

    /// Width in pixels.
    pub fn width(&self) -> u32 {
        self.width
    }

    /// Height in pixels.
    pub fn height(&self) -> u32 {
        self.height
    }

    /// The pixels.
    pub fn pixels(&self) -> &Pixels {
        &self.pixels
    }

    /// The pixels in 8 bits, row by row, 3 bytes each. Floats are rounded, which changes them by
    /// 1/510 at most.
    pub fn rgb(&self) -> Cow<'_, [u8]> {
        match &self.pixels {
            Pixels::Bytes(bytes) => Cow::Borrowed(bytes),
            Pixels::Floats(floats) => floats.iter().map(|v| (v * 255.0).round() as u8).collect(),
        }
    }

    /// The frame as a PNG image, see [`Frame::rgb`].
    ///
    /// # Errors
    /// When the encoder fails, which it does not on a whole frame.
    pub fn to_png(&self) -> Result<Vec<u8>> {
        let mut png = Vec::new();
        PngEncoder::new(&mut png)
            .write_image(
                &self.rgb(),
                self.width,
                self.height,
                ExtendedColorType::Rgb8,
            )
            .map_err(|e| Error::input(format!("no PNG image can be made of the frame: {e}")))?;
        Ok(png)
    }

    /// The frame as a JPEG image of `quality` 1 to 100, shrunk so that no side is longer than
    /// `longest`.
    ///
    /// # Errors
    /// When the encoder fails, which it does not on a whole frame.
    #[cfg(feature = "jpeg-webp")]
    pub fn to_jpeg(&self, longest: u32, quality: u8) -> Result<Vec<u8>> {
        let scale = f64::from(longest) / f64::from(self.width.max(self.height));
        let side = |side: u32| match scale < 1.0 {
            true => (f64::from(side) * scale).round().max(1.0) as usize,
            false => side as usize,
        };
        let size = [side(self.width), side(self.height)];
        let planar = self.to_planar(Some(size), Filter::BilinearAntialias);
        let pixels = size[0] * size[1];
        let byte = |value: f32| (value.clamp(0.0, 1.0) * 255.0).round() as u8;
        let rgb: Vec<u8> = (0..3 * pixels)
            .map(|i| byte(planar[i % 3 * pixels + i / 3]))
            .collect();
        let mut jpeg = Vec::new();
        JpegEncoder::new_with_quality(&mut jpeg, quality)
            .write_image(
                &rgb,
                size[0] as u32,
                size[1] as u32,
                ExtendedColorType::Rgb8,
            )
            .map_err(|e| Error::input(format!("no JPEG image can be made of the frame: {e}")))?;
        Ok(jpeg)
    }

    /// The frame as a numpy array (`.npy`, `[H, W, 3]`, unsigned bytes), see [`Frame::rgb`];
    /// [`Frame::decode`] reads it.
    pub fn to_npy(&self) -> Vec<u8> {
        let mut array = npy::header("|u1", &[self.height as usize, self.width as usize, 3]);
        array.extend_from_slice(&self.rgb());
        array
    }

    /// The frame as a numpy array (`.npy`, `[H, W, 3]`) of unsigned bytes or 32-bit floats, as its
    /// pixels are; [`Frame::decode`] reads the same frame.
    pub fn to_array(&self) -> Vec<u8> {
        let shape = [self.height as usize, self.width as usize, 3];
        match &self.pixels {
            Pixels::Bytes(_) => self.to_npy(),
            Pixels::Floats(floats) => {
                let mut array = npy::header("<f4", &shape);
                array.extend(floats.iter().flat_map(|v| v.to_le_bytes()));
                array
            }
        }
    }

    /// The frame as planes of red, green and blue in [0, 1], 3 x height x width, resized to
    /// `[width, height]` with `filter` where that differs.
    pub fn to_planar(&self, size: Option<[usize; 2]>, filter: Filter) -> Vec<f32> {
        let planar = match &self.pixels {
            Pixels::Bytes(bytes) => planes(bytes, |v| f32::from(v) / 255.0),
            Pixels::Floats(floats) => planes(floats, |v| v),
        };
        let own = [self.width as usize, self.height as usize];
        match size {
            Some(size) if size != own => resize_planar(&planar, own, size, filter),
            _ => planar,
        }
    }
}

/// Interleaved values as planes.
pub(crate) fn planes<T: Copy, U>(interleaved: &[T], value: impl Fn(T) -> U) -> Vec<U> {
    let mut planes = Vec::with_capacity(interleaved.len());
    for channel in 0..3 {
        planes.extend(
            interleaved
                .chunks_exact(3)
                .map(|pixel| value(pixel[channel])),
        );
    }
    planes
}
