//! Frames of a numpy array.

use ndarray::{ArrayView4, Axis, Ix4};
use numpy::{
    Element, PyArrayDescrMethods, PyArrayMethods, PyReadonlyArray4, PyUntypedArray,
    PyUntypedArrayMethods,
};
use pyo3::prelude::*;
use tracklens::data::{Frame, MAX_SIDE, MIN_SIDE, Pixels};
use tracklens::error::Error;

use crate::errors::{exception, input, wrong_type};

const EXPECTED: &str =
    "expected frames of shape [B, H, W, 3], uint8, or float32 or float64 within 0 to 1";

/// Frames as an array holds them, B x H x W x 3.
pub(crate) enum Batch<'py> {
    Bytes(PyReadonlyArray4<'py, u8>),
    Floats(PyReadonlyArray4<'py, f32>),
    Doubles(PyReadonlyArray4<'py, f64>),
}

/// The array that numpy makes of `value`, which may be one.
pub(crate) fn as_array<'py>(
    value: &Bound<'py, PyAny>,
    what: &str,
) -> PyResult<Bound<'py, PyUntypedArray>> {
    if let Ok(array) = value.cast::<PyUntypedArray>() {
        return Ok(array.clone());
    }
    let numpy = value.py().import("numpy")?;
    let array = numpy.call_method1("asarray", (value,));
    let array = array.map_err(|e| input(format!("{what} cannot be made an array: {e}")))?;
    Ok(array.cast_into::<PyUntypedArray>()?)
}

impl<'py> Batch<'py> {
    /// Checks the shape and the type of frames.
    pub fn parse(frames: &Bound<'py, PyAny>) -> PyResult<Self> {
        let array = as_array(frames, "the frames")?;
        check_shape(array.shape())?;
        let dtype = array.dtype();
        let py = frames.py();
        if dtype.is_equiv_to(&u8::get_dtype(py)) {
            return Ok(Self::Bytes(array.extract()?));
        }
        if dtype.is_equiv_to(&f32::get_dtype(py)) {
            return Ok(Self::Floats(array.extract()?));
        }
        if dtype.is_equiv_to(&f64::get_dtype(py)) {
            return Ok(Self::Doubles(array.extract()?));
        }
        Err(wrong_type(format!(
            "the frames have dtype {dtype}; {EXPECTED}"
        )))
    }

    /// The number of frames B.
    pub fn len(&self) -> usize {
        self.shape()[0]
    }

    /// Width and height of the frames.
    pub fn image_size(&self) -> [usize; 2] {
        let [_, height, width, _] = self.shape();
        [width, height]
    }

    fn shape(&self) -> [usize; 4] {
        let dim = match self {
            Self::Bytes(array) => array.dims(),
            Self::Floats(array) => array.dims(),
            Self::Doubles(array) => array.dims(),
        };
        let dim: Ix4 = dim;
        [dim[0], dim[1], dim[2], dim[3]]
    }

    /// A copy of frame `i`.
    pub fn frame(&self, i: usize) -> PyResult<Frame> {
        let pixels = match self {
            Self::Bytes(array) => Pixels::Bytes(values(array.as_array(), i, |v| v)),
            Self::Floats(array) => Pixels::Floats(values(array.as_array(), i, |v| v)),
            Self::Doubles(array) => Pixels::Floats(values(array.as_array(), i, |v| v as f32)),
        };
        let [width, height] = self.image_size().map(|side| side as u32);
        Frame::from_pixels(width, height, pixels)
            .map_err(|e: Error| exception(&e.at(format!("frame {i}"))))
    }
}

fn values<T: Copy, U>(frames: ArrayView4<T>, i: usize, value: impl Fn(T) -> U) -> Vec<U> {
    let frame = frames.index_axis(Axis(0), i);
    match frame.as_slice() {
        Some(slice) => slice.iter().copied().map(value).collect(),
        None => frame.iter().copied().map(value).collect(),
    }
}

fn check_shape(shape: &[usize]) -> PyResult<()> {
    let &[_, height, width, channels] = shape else {
        let single = match shape {
            [_, _, 3] => "; a single frame is frames[None]",
            _ => "",
        };
        return Err(input(format!(
            "the frames have shape {shape:?}, {} axes; {EXPECTED}{single}",
            shape.len()
        )));
    };
    if channels != 3 {
        let first = match height {
            3 => "; channels that come first are moved by frames.transpose(0, 2, 3, 1)",
            _ => "",
        };
        return Err(input(format!(
            "the frames have shape {shape:?}: axis 3 (channels) has {channels}; expected 3, red, \
             green and blue{first}"
        )));
    }
    let sides = [(1, "height", height), (2, "width", width)];
    let fits = |side: usize| u32::try_from(side).is_ok_and(|s| (MIN_SIDE..=MAX_SIDE).contains(&s));
    match sides.into_iter().find(|(_, _, side)| !fits(*side)) {
        Some((axis, name, side)) => Err(input(format!(
            "the frames have shape {shape:?}: axis {axis} ({name}) has {side} pixels; expected \
             {MIN_SIDE} to {MAX_SIDE}"
        ))),
        None => Ok(()),
    }
}
