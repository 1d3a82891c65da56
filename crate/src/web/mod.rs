//! The JavaScript face: parse, call, translate. Types are documented in `pkg/index.d.ts`.

mod encoder;
mod evaluation;
mod figure;
mod frames;
mod scoring;
mod tables;

use js_sys::{Error as JsError, Object, Reflect};
use serde::Serialize;
use serde::de::DeserializeOwned;
use wasm_bindgen::prelude::*;

use crate::data::{self, Role};
use crate::error::{Error, ErrorKind};

type JsResult<T> = Result<T, JsValue>;

#[wasm_bindgen(start)]
fn start() {
    console_error_panic_hook::set_once();
}

/// The version of the package.
#[wasm_bindgen]
pub fn version() -> String {
    env!("CARGO_PKG_VERSION").to_owned()
}

/// Guesses what a file is from its path and first bytes.
///
/// # Errors
/// When the translation to JavaScript fails.
#[wasm_bindgen]
pub fn classify(path: &str, head: &[u8]) -> JsResult<JsValue> {
    #[derive(Serialize)]
    struct Classification {
        role: &'static str,
        reason: String,
    }
    let found = data::classify(path, head);
    let role = match found.role {
        Role::Image => "image",
        Role::GroundTruth => "ground-truth",
        Role::Keypoints => "keypoints",
        Role::Checkpoint => "checkpoint",
        Role::Unknown => "unknown",
    };
    to_js(&Classification {
        role,
        reason: found.reason,
    })
}

/// A JavaScript `Error` with the message and the kind.
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
    js.into()
}

/// Plain JavaScript objects; `None` becomes null.
fn to_js<T: Serialize>(value: &T) -> JsResult<JsValue> {
    let serializer = serde_wasm_bindgen::Serializer::json_compatible();
    value.serialize(&serializer).map_err(Into::into)
}

/// An options object with no other than the given `keys`; undefined and null mean all defaults.
fn from_js<T: DeserializeOwned + Default>(value: JsValue, what: &str, keys: &[&str]) -> JsResult<T> {
    if value.is_undefined() || value.is_null() {
        return Ok(T::default());
    }
    if let Some(object) = value.dyn_ref::<Object>() {
        // A misspelt option would silently be a default.
        let names: Vec<String> = Object::keys(object)
            .iter()
            .filter_map(|key| key.as_string())
            .collect();
        if let Some(other) = names.iter().find(|name| !keys.contains(&name.as_str())) {
            let expected = keys.join(", ");
            return Err(js_error(&Error::input(format!(
                "{what}: unknown field `{other}`; expected {expected}"
            ))));
        }
    }
    serde_wasm_bindgen::from_value(value).map_err(|e| js_error(&Error::input(format!("{what}: {e}"))))
}

#[derive(Serialize)]
struct Sequence {
    name: String,
    start: usize,
    length: usize,
}

fn sequences_to_js(ranges: Vec<data::SequenceRange>) -> JsResult<JsValue> {
    let plain = |r: data::SequenceRange| Sequence {
        name: r.name,
        start: r.start,
        length: r.length,
    };
    to_js(&ranges.into_iter().map(plain).collect::<Vec<_>>())
}
