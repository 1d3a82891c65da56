//! Points of files of other kinds, in JavaScript: as tables, or as arrays.

use js_sys::{Array, Object, Reflect, Uint8Array};
use wasm_bindgen::prelude::*;

use super::JsResult;
use crate::data::Export;
#[cfg(any(feature = "web-formats", feature = "web-zarr"))]
use crate::data::{NpyArray, StoredPoints};

/// `FormatPoints` of the package.
#[cfg(any(feature = "web-formats", feature = "web-zarr"))]
pub(super) fn stored_to_js(points: &StoredPoints) -> JsResult<JsValue> {
    match points {
        StoredPoints::Table(table) => table_to_js(table),
        StoredPoints::Arrays { arrays, has_frames } => arrays_to_js(arrays, *has_frames),
    }
}

#[cfg(any(feature = "web-formats", feature = "web-zarr"))]
fn arrays_to_js(arrays: &[NpyArray], has_frames: bool) -> JsResult<JsValue> {
    let list = Array::new();
    for NpyArray { name, bytes, .. } in arrays {
        list.push(&object([
            ("name", name.into()),
            ("bytes", Uint8Array::from(&bytes[..]).into()),
        ])?);
    }
    object([
        ("table", JsValue::NULL),
        ("space", JsValue::NULL),
        ("notices", Array::new().into()),
        ("arrays", list.into()),
        ("hasFrames", has_frames.into()),
    ])
}

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
