//! Options from JavaScript.

use js_sys::Object;
use serde::de::DeserializeOwned;
use wasm_bindgen::prelude::*;

use super::{JsResult, js_error};
use crate::error::Error;

/// An options object with no other than the given `keys`; undefined and null mean all defaults.
pub fn from_js<T: DeserializeOwned + Default>(
    value: JsValue,
    what: &str,
    keys: &[&str],
) -> JsResult<T> {
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
    serde_wasm_bindgen::from_value(value)
        .map_err(|e| js_error(&Error::input(format!("{what}: {e}"))))
}
