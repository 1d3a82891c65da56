//! The Python face: parse, call, translate. What it offers is documented in `package/tracklens`,
//! which wraps it, and typed in `package/tracklens/_tracklens.pyi`.

mod encoder;
mod errors;
mod evaluation;
mod frames;
mod points;
mod scoring;

use pyo3::prelude::*;

/// The compiled part of the package `tracklens`.
#[pymodule]
mod _tracklens {
    #[pymodule_export]
    use super::encoder::Encoder;
    #[pymodule_export]
    use super::evaluation::Evaluation;
    #[pymodule_export]
    use super::scoring::score;

    /// The version of the package.
    #[pymodule_export]
    const VERSION: &str = env!("CARGO_PKG_VERSION");
}
