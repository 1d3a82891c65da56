//! Encoded images to pixels.

use std::io::Cursor;

use ::image::{ImageDecoder, ImageReader, Limits};

use super::resize::{Filter, resize_planar};
use crate::error::{Error, Result};

/// The smallest side of a frame, in pixels: less holds no image for an encoder that halves it three times.
pub const MIN_SIDE: u32 = 16;

/// The largest side of a frame, in pixels.
pub const MAX_SIDE: u32 = 8192;

/// A decoded frame, 8 bits a channel, RGB.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Frame {
    width: u32,
    height: u32,
    rgb: Vec<u8>,
}

impl Frame {
    /// A frame from `width * height * 3` bytes, row by row.
    ///
    /// # Errors
    /// When the number of bytes is another one.
    pub fn new(width: u32, height: u32, rgb: Vec<u8>) -> Result<Self> {
        let expected = width as usize * height as usize * 3;
        if rgb.len() != expected {
            return Err(Error::input(format!(
                "{} bytes for a frame of {width} x {height}; expected {expected}",
                rgb.len()
            )));
        }
        Ok(Self { width, height, rgb })
    }

    /// Decodes a PNG, JPEG or WebP image, recognised by its content. Grey becomes RGB, transparency is dropped,
    /// 16 bits become 8.
    ///
    /// # Errors
    /// When the bytes are no such image or are cut short, and when a side is not within
    /// [`MIN_SIDE`] to [`MAX_SIDE`].
    pub fn decode(bytes: &[u8]) -> Result<Self> {
        let reader = ImageReader::new(Cursor::new(bytes))
            .with_guessed_format()
            .map_err(|e| Error::input(format!("not an image: {e}")))?;
        if reader.format().is_none() {
            return Err(Error::input(format!(
                "not a PNG, JPEG or WebP image ({} bytes)",
                bytes.len()
            )));
        }
        let damaged = |e: ::image::ImageError| {
            Error::input(format!(
                "the image cannot be decoded ({e}); is the file complete ({} bytes)?",
                bytes.len()
            ))
        };
        let mut decoder = reader.into_decoder().map_err(damaged)?;
        let (width, height) = decoder.dimensions();
        if width.max(height) > MAX_SIDE || width.min(height) < MIN_SIDE {
            return Err(Error::input(format!(
                "the image is {width} x {height} pixels; expected {MIN_SIDE} to {MAX_SIDE} a side"
            )));
        }
        let mut limits = Limits::default();
        limits.max_alloc = Some(u64::from(MAX_SIDE) * u64::from(MAX_SIDE) * 8);
        decoder.set_limits(limits).map_err(damaged)?;
        let image = ::image::DynamicImage::from_decoder(decoder).map_err(damaged)?;
        Self::new(width, height, image.into_rgb8().into_raw())
    }

    /// Width in pixels.
    pub fn width(&self) -> u32 {
        self.width
    }

    /// Height in pixels.
    pub fn height(&self) -> u32 {
        self.height
    }

    /// The pixels, row by row, 3 bytes each.
    pub fn rgb(&self) -> &[u8] {
        &self.rgb
    }

    /// The frame as planes of red, green and blue in [0, 1], 3 x height x width, resized to `[width, height]`
    /// with `filter` where that differs.
    pub fn to_planar(&self, size: Option<[usize; 2]>, filter: Filter) -> Vec<f32> {
        let pixels = self.width as usize * self.height as usize;
        let mut planar = vec![0.0; 3 * pixels];
        for (i, pixel) in self.rgb.chunks_exact(3).enumerate() {
            for (channel, value) in pixel.iter().enumerate() {
                planar[channel * pixels + i] = f32::from(*value) / 255.0;
            }
        }
        let own = [self.width as usize, self.height as usize];
        match size {
            Some(size) if size != own => resize_planar(&planar, own, size, filter),
            _ => planar,
        }
    }
}
