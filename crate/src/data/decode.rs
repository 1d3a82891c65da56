//! Encoded images, and numpy arrays of one frame, to pixels.

use std::io::Cursor;

use ::image::{ImageDecoder, ImageFormat, ImageReader, Limits};

use super::frame_array::FrameArray;
use super::image::{Frame, MAX_SIDE, MIN_SIDE};
use super::npy::{self, Header};
use crate::error::{Error, Result};
use crate::memory;

impl Frame {
    /// Decodes a PNG image, or with the feature `jpeg-webp` a JPEG or WebP image, recognised by its
    /// content. Grey becomes RGB, transparency is dropped, 16 bits become 8. A numpy array (`.npy`,
    /// `[H, W, 3]` or `[3, H, W]`), as recordings hold them, is a frame too.
    ///
    /// # Errors
    /// When the bytes are no such image or are cut short, and when a side is not within
    /// [`MIN_SIDE`] to [`MAX_SIDE`].
    pub fn decode(bytes: &[u8]) -> Result<Self> {
        if bytes.starts_with(npy::MAGIC) {
            return decode_array(bytes);
        }
        let reader = ImageReader::new(Cursor::new(bytes))
            .with_guessed_format()
            .map_err(|e| Error::input(format!("not an image: {e}")))?;
        if reader.format().is_none() {
            return Err(Error::input(format!(
                "not a PNG, JPEG or WebP image ({} bytes)",
                bytes.len()
            )));
        }
        let format = reader.format();
        if format == Some(ImageFormat::Jpeg) && !is_whole_jpeg(bytes) {
            return Err(Error::input(format!(
                "the JPEG image ends before its end marker; is the file complete ({} bytes)?",
                bytes.len()
            )));
        }
        let damaged = |e: ::image::ImageError| {
            if let ::image::ImageError::Unsupported(e) = &e {
                let is_left_out = !cfg!(feature = "jpeg-webp")
                    && matches!(format, Some(ImageFormat::Jpeg | ImageFormat::WebP));
                let advice = if is_left_out {
                    "decode it with `imageToArray` of the part `images` (feature `jpeg-webp`), or save it as PNG"
                } else {
                    "save it as PNG"
                };
                return Error::input(format!("the image cannot be decoded ({e}); {advice}"));
            }
            // Some reasons end with a line break.
            let reason = e.to_string();
            Error::input(format!(
                "the image cannot be decoded ({}); is the file complete ({} bytes)?",
                reason.trim_end(),
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
        // A few bytes can stand for an image of the largest size.
        memory::check(
            decoder.total_bytes() + u64::from(width) * u64::from(height) * 3,
            &format!("pixels of an image of {width} x {height}"),
            "use smaller images, or close other programs",
        )?;
        let mut limits = Limits::default();
        limits.max_alloc = Some(u64::from(MAX_SIDE) * u64::from(MAX_SIDE) * 8);
        decoder.set_limits(limits).map_err(damaged)?;
        let image = ::image::DynamicImage::from_decoder(decoder).map_err(damaged)?;
        Self::new(width, height, image.into_rgb8().into_raw())
    }

    /// Width and height of an image that [`Frame::decode`] takes, without its pixels; None where its
    /// head cannot be read.
    pub fn size_of(bytes: &[u8]) -> Option<[u32; 2]> {
        if bytes.starts_with(npy::MAGIC) {
            let frame = decode_array(bytes).ok()?;
            return Some([frame.width(), frame.height()]);
        }
        let reader = ImageReader::new(Cursor::new(bytes));
        let (width, height) = reader.with_guessed_format().ok()?.into_dimensions().ok()?;
        Some([width, height])
    }
}

/// Whether a JPEG image goes on to its end marker: the decoder makes grey of what is missing and
/// says nothing.
fn is_whole_jpeg(bytes: &[u8]) -> bool {
    // The start marker has no content.
    let mut rest = bytes.get(2..).unwrap_or_default();
    loop {
        // Behind the head of a scan are its data, in which 0xff is followed by 0 or a restart
        // marker.
        let is_marker = |pair: &[u8]| pair[0] == 0xff && !matches!(pair[1], 0 | 0xd0..=0xd7 | 0xff);
        let Some(at) = rest.windows(2).position(is_marker) else {
            return false;
        };
        if rest[at + 1] == 0xd9 {
            return true;
        }
        rest = &rest[at + 2..];
        let Some([high, low]) = rest.first_chunk() else {
            return false;
        };
        let length = usize::from(u16::from_be_bytes([*high, *low]));
        rest = rest.get(length..).unwrap_or_default();
    }
}

/// The frame of a `.npy` array of shape `[H, W, 3]` or `[3, H, W]`.
fn decode_array(bytes: &[u8]) -> Result<Frame> {
    let size = bytes.len() as u64;
    let header = Header::read(&mut &*bytes)?;
    header.check("frame", size)?;
    let mut info = header.info();
    info.shape.insert(0, 1);
    let values = header.values("frame", &bytes[header.length as usize..])?;
    FrameArray::new("frame", &info)?.frame(values)
}
