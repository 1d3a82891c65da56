//! Points of numpy arrays: one array of all sequences, or a list with an array a sequence.

use ndarray::{ArrayView2, ArrayView3, Axis, Dimension, Ix2, Ix3};
use numpy::{PyArrayDyn, PyArrayMethods, PyReadonlyArrayDyn, PyUntypedArrayMethods};
use pyo3::prelude::*;
use pyo3::types::{PyList, PyTuple};

use crate::errors::{input, wrong_type};
use crate::frames::as_array;

/// Arrays of points or of their confidences, held for as long as they are read.
pub(crate) struct Sequences<'py> {
    arrays: Vec<PyReadonlyArrayDyn<'py, f64>>,
    /// Whether one array holds all sequences.
    stacked: bool,
}

impl<'py> Sequences<'py> {
    /// `axes` names those of one sequence, e.g. `T, N, 2`.
    pub fn parse(given: &Bound<'py, PyAny>, name: &str, axes: &str) -> PyResult<Self> {
        let dimensions = axes.split(',').count();
        if let Some(parts) = parts(given)? {
            let parts = parts.iter().map(|part| floats(part, name));
            let arrays = parts.collect::<PyResult<Vec<_>>>()?;
            if arrays.iter().all(|array| array.shape().len() == dimensions) {
                let stacked = false;
                return Ok(Self { arrays, stacked });
            }
        }
        let array = floats(given, name)?;
        let found = array.shape().len();
        if found != dimensions && found != dimensions + 1 {
            return Err(input(format!(
                "`{name}` has shape {:?}, {found} axes; expected [S, {axes}], [{axes}] of one \
                 sequence, or a list of [{axes}]",
                array.shape()
            )));
        }
        Ok(Self {
            arrays: vec![array],
            stacked: found == dimensions + 1,
        })
    }

    /// T x N x 2 of every sequence, or T x N x 3.
    pub fn points(&self) -> PyResult<Vec<ArrayView3<'_, f64>>> {
        self.views::<Ix3>()
    }

    /// T x N of every sequence.
    pub fn confidences(&self) -> PyResult<Vec<ArrayView2<'_, f64>>> {
        self.views::<Ix2>()
    }

    fn views<D: Dimension>(&self) -> PyResult<Vec<ndarray::ArrayView<'_, f64, D>>> {
        let mut views = Vec::new();
        for array in &self.arrays {
            let array = array.as_array();
            match self.stacked {
                true => views.extend(
                    (0..array.len_of(Axis(0))).map(|s| array.clone().index_axis_move(Axis(0), s)),
                ),
                false => views.push(array),
            }
        }
        let views = views.into_iter().map(|view| view.into_dimensionality());
        views
            .collect::<Result<_, _>>()
            .map_err(|e| input(e.to_string()))
    }
}

/// The elements of a list or a tuple.
fn parts<'py>(given: &Bound<'py, PyAny>) -> PyResult<Option<Vec<Bound<'py, PyAny>>>> {
    let is_list = given.is_instance_of::<PyList>() || given.is_instance_of::<PyTuple>();
    match is_list {
        true => given.try_iter()?.collect::<PyResult<_>>().map(Some),
        false => Ok(None),
    }
}

/// An array of numbers as f64.
fn floats<'py>(given: &Bound<'py, PyAny>, name: &str) -> PyResult<PyReadonlyArrayDyn<'py, f64>> {
    let array = as_array(given, &format!("`{name}`"))?;
    let dtype = array.dtype();
    let kind: String = dtype.getattr("kind")?.extract()?;
    if !["f", "i", "u"].contains(&kind.as_str()) {
        return Err(wrong_type(format!(
            "`{name}` has dtype {dtype}; expected numbers: floats or integers"
        )));
    }
    let array = array.call_method1("astype", ("float64",))?;
    Ok(array.cast_into::<PyArrayDyn<f64>>()?.readonly())
}
