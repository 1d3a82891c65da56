//! Tables that files of other kinds were turned into, in JavaScript.

use js_sys::{Array, Object, Reflect, Uint8Array};
use wasm_bindgen::prelude::*;

use super::JsResult;
use crate::data::Export;

/// `FormatPoints` of the package.
pub(super) fn table_to_js(export: &Export) -> JsResult<JsValue> {
    let Export {
        table,
        space,
        notices,
    } = export;
    let space = space.map(|space| JsValue::from(space.name()));
    let told: Array = notices
        .iter()
        .map(|notice| JsValue::from(&notice.text))
        .collect();
    object([
        ("table", Uint8Array::from(&table[..]).into()),
        ("space", space.unwrap_or(JsValue::NULL)),
        ("notices", told.into()),
        ("arrays", JsValue::NULL),
        ("hasFrames", false.into()),
    ])
}

pub(super) fn object<const N: usize>(entries: [(&str, JsValue); N]) -> JsResult<JsValue> {
    let object = Object::new();
    for (name, value) in entries {
        Reflect::set(&object, &name.into(), &value)?;
    }
    Ok(object.into())
}
