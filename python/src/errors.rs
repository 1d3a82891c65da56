//! Errors as Python exceptions, with the same text.

use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use pyo3::types::PyType;
use tracklens::error::{Error, ErrorKind, Reason};

/// Where the exceptions are defined, in Python.
const MODULE: &str = "tracklens._errors";

static CLASSES: [PyOnceLock<Py<PyType>>; 5] = [const { PyOnceLock::new() }; 5];

/// The exception of an error.
pub(crate) fn exception(error: &Error) -> PyErr {
    Python::attach(|py| made(py, error).unwrap_or_else(|failed| failed))
}

/// Bad input of the caller, as the library says it.
pub(crate) fn input(message: impl Into<String>) -> PyErr {
    exception(&Error::input(message))
}

/// Something of another type than the one that is expected.
pub(crate) fn wrong_type(message: impl Into<String>) -> PyErr {
    PyTypeError::new_err(message.into())
}

fn made(py: Python<'_>, error: &Error) -> PyResult<PyErr> {
    let (place, name) = match error.kind() {
        ErrorKind::Input => (0, "InputError"),
        ErrorKind::Mismatch => (1, "MismatchError"),
        ErrorKind::Numeric => (2, "NumericError"),
        ErrorKind::Io => (3, "FileError"),
        ErrorKind::Cancelled => (4, "CancelledError"),
    };
    let class = CLASSES[place].import(py, MODULE, name)?;
    let value = class.call1((error.to_string(),))?;
    if let Some(reason) = error.reason() {
        value.setattr("reason", to_python(py, reason)?)?;
        if let Some(hint) = hint(reason) {
            value.setattr("hint", hint)?;
        }
    }
    Ok(PyErr::from_value(value))
}

/// What helps, in the words of this package.
fn hint(reason: &Reason) -> Option<&'static str> {
    match reason {
        Reason::MissingImageSize => {
            Some("give image_size=(width, height), or space=\"ndc\" where the positions are in ndc")
        }
        Reason::NonFinite { .. } => Some("non_finite=\"exclude-frame\" leaves such frames out"),
        Reason::DetectorSettings { .. } => {
            Some("say it with settings={...} (docs/detectors.md), or in a file beside the model")
        }
        _ => None,
    }
}

/// Plain Python objects: dictionaries, lists, numbers, texts, None.
pub(crate) fn to_python<'py>(
    py: Python<'py>,
    value: &impl serde::Serialize,
) -> PyResult<Bound<'py, PyAny>> {
    let text = serde_json::to_string(value).map_err(|e| input(e.to_string()))?;
    py.import("json")?.call_method1("loads", (text,))
}
