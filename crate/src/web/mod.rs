//! The JavaScript face: parse, call, translate. Types are documented in `pkg/index.d.ts`.
//!
//! It is built in parts, each a WebAssembly module of its own that is loaded when it is needed:
//! scoring first, which a larger one takes the place of with the first points in space, the doctor
//! with the first ground truth, extraction in the workers, images with the first JPEG or WebP image,
//! formats with the first HDF5 file or pickle, Zarr and Parquet with the first of theirs, detectors
//! with the first ONNX model, measures over time when they are looked at, figures once there is
//! something to draw, comparison with the first runs, extraction on the GPU where there is one.
//! Objects of one part mean nothing to another one.

#[cfg(feature = "web-space")]
mod camera;
#[cfg(feature = "web-scoring")]
mod command;
#[cfg(feature = "web-comparison")]
mod comparison;
#[cfg(feature = "web-scoring")]
mod containers;
#[cfg(feature = "web-extraction")]
mod decoder;
#[cfg(feature = "web-onnx")]
mod detector;
#[cfg(feature = "web-doctor")]
mod doctor;
#[cfg(feature = "web-extraction")]
mod encoder;
#[cfg(feature = "web-figures")]
mod evaluation;
#[cfg(feature = "web-figures")]
mod figure;
#[cfg(feature = "web-scoring")]
mod files;
#[cfg(feature = "web-formats")]
mod formats;
#[cfg(feature = "web-scoring")]
mod frames;
#[cfg(feature = "web-gpu")]
mod gpu;
#[cfg(feature = "web-formats")]
mod hdf5;
#[cfg(feature = "web-images")]
mod images;
#[cfg(feature = "web-scoring")]
mod join;
#[cfg(any(
    feature = "web-scoring",
    feature = "web-doctor",
    feature = "web-temporal"
))]
mod matching;
#[cfg(any(
    feature = "web-scoring",
    feature = "web-doctor",
    feature = "web-temporal"
))]
mod object;
#[cfg(any(
    feature = "web-scoring",
    feature = "web-doctor",
    feature = "web-temporal",
    feature = "web-comparison"
))]
mod options;
#[cfg(feature = "web-parquet")]
mod parquet;
#[cfg(any(feature = "web-formats", feature = "web-zarr"))]
mod recording;
#[cfg(any(feature = "web-scoring", feature = "web-temporal"))]
mod request;
#[cfg(feature = "web-scoring")]
mod runs;
#[cfg(feature = "web-scoring")]
mod scoring;
#[cfg(any(feature = "web-formats", feature = "web-zarr"))]
mod slices;
#[cfg(any(feature = "web-formats", feature = "web-parquet", feature = "web-zarr"))]
mod table;
#[cfg(feature = "web-scoring")]
mod tables;
#[cfg(feature = "web-temporal")]
mod temporal;
#[cfg(any(
    feature = "web-scoring",
    feature = "web-temporal",
    feature = "web-comparison"
))]
mod thresholds;
#[cfg(feature = "web-zarr")]
mod zarr;

use js_sys::{Error as JsError, Reflect};
use wasm_bindgen::prelude::*;

use crate::error::{Error, ErrorKind};

type JsResult<T> = Result<T, JsValue>;

#[global_allocator]
static MEMORY: crate::memory::Memory = crate::memory::Memory;

#[wasm_bindgen(start)]
fn start() {
    console_error_panic_hook::set_once();
}

/// Bytes of memory of this instance.
#[cfg(any(
    feature = "web-extraction",
    feature = "web-images",
    feature = "web-onnx"
))]
fn memory() -> f64 {
    const PAGE: usize = 64 * 1024;
    (core::arch::wasm32::memory_size::<0>() * PAGE) as f64
}

/// A JavaScript `Error` with the message, `kind`, and `reason` where there is one.
fn js_error(error: &Error) -> JsValue {
    let kind = match error.kind() {
        ErrorKind::Input => "input",
        ErrorKind::Mismatch => "mismatch",
        ErrorKind::Numeric => "numeric",
        ErrorKind::Io => "io",
        ErrorKind::Cancelled => "cancelled",
    };
    let js = JsError::new(&error.to_string());
    // Setting a property of a fresh object cannot fail.
    let _ = Reflect::set(&js, &"kind".into(), &kind.into());
    if let Some(reason) = error.reason().and_then(|reason| to_js(reason).ok()) {
        let _ = Reflect::set(&js, &"reason".into(), &reason);
    }
    js.into()
}

/// Plain JavaScript objects; `None` becomes null.
fn to_js<T: serde::Serialize>(value: &T) -> JsResult<JsValue> {
    let serializer = serde_wasm_bindgen::Serializer::json_compatible();
    value.serialize(&serializer).map_err(Into::into)
}
