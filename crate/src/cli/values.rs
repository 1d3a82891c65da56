//! Parsers of option values.

use std::path::PathBuf;

use crate::error::{Error, Result};

/// The size of an image, `256x256`.
pub(super) fn parse_size(text: &str) -> Result<[u32; 2]> {
    let sides = text
        .split_once('x')
        .and_then(|(w, h)| Some([w.parse().ok()?, h.parse().ok()?]));
    sides
        .filter(|sides: &[u32; 2]| sides.iter().all(|s| *s > 0))
        .ok_or_else(|| {
            Error::input(format!(
                "`{text}` is not a size; expected WIDTHxHEIGHT, e.g. 256x256"
            ))
        })
}

/// A finite number.
pub(super) fn parse_finite(text: &str) -> Result<f64> {
    let number = text.parse().ok().filter(|n: &f64| n.is_finite());
    number.ok_or_else(|| Error::input(format!("`{text}` is no number; expected e.g. 0.5")))
}

/// The path of a page that is to be written.
pub(super) fn parse_html_path(text: &str) -> Result<PathBuf> {
    with_ending(text, &["html", "htm"])
}

/// The path of an ONNX model that is to be written.
pub(super) fn parse_onnx_path(text: &str) -> Result<PathBuf> {
    with_ending(text, &["onnx"])
}

/// A path whose ending says the format that is written.
fn with_ending(text: &str, endings: &[&str]) -> Result<PathBuf> {
    let path = PathBuf::from(text);
    let ending = path
        .extension()
        .unwrap_or_default()
        .to_string_lossy()
        .to_lowercase();
    if endings.contains(&ending.as_str()) {
        return Ok(path);
    }
    let what = match ending.as_str() {
        "" => "has no ending".to_owned(),
        ending => format!("ends in .{ending}"),
    };
    Err(Error::input(format!(
        "`{text}` {what}, and the format that is written is another one; expected a name that ends in .{}",
        endings.join(" or .")
    )))
}
