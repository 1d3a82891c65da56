//! Tables as plain objects: one part of the package writes them, another one reads them.

use js_sys::{BigUint64Array, Float64Array, Reflect, Uint32Array};
use serde::{Deserialize, Serialize};
use wasm_bindgen::prelude::*;

use super::JsResult;
use crate::data::Reading;

/// What a table says beside its numbers.
#[derive(Serialize, Deserialize)]
pub(super) struct Head {
    /// The names of the sequences, in the order of their first frames.
    pub sequences: Vec<String>,
    /// The names of the objects; empty for keypoints.
    pub names: Vec<String>,
    /// Of the images in pixels, where it was said.
    pub image_size: Option<[u32; 2]>,
    /// How many coordinates a point has.
    pub axes: usize,
    /// `None` where a camera made the positions.
    pub reading: Option<Reading>,
}

const HEAD: &str = "head";
/// For each frame, the position of its sequence among the names.
const SEQUENCE: &str = "sequence";
/// For each frame, its number in the sequence.
const FRAME: &str = "frame";
/// Frames x points x 2, or 3 in space.
const POINTS: &str = "points";
/// Frames x points, where points say how sure they are.
const CONFIDENCE: &str = "confidence";

#[cfg(feature = "web-scoring")]
pub(super) mod write {
    use std::collections::HashMap;

    use js_sys::Object;
    use ndarray::{Array2, Array3};

    use super::*;
    use crate::track::FrameKey;
    use crate::web::to_js;

    /// A table over frames; `names` of objects and the size of the images, where it has any.
    pub fn table(
        keys: &[FrameKey],
        points: &Array3<f64>,
        confidence: Option<&Array2<f64>>,
        reading: Option<&Reading>,
        (names, image_size): (&[String], Option<[u32; 2]>),
    ) -> JsResult<JsValue> {
        let mut sequences: Vec<String> = Vec::new();
        let mut positions: HashMap<&str, u32> = HashMap::new();
        let mut of_frame = Vec::with_capacity(keys.len());
        for key in keys {
            let position = *positions.entry(&key.sequence).or_insert_with(|| {
                sequences.push(key.sequence.clone());
                sequences.len() as u32 - 1
            });
            of_frame.push(position);
        }
        let frames: Vec<u64> = keys.iter().map(|key| key.frame).collect();
        let head = Head {
            sequences,
            names: names.to_vec(),
            image_size,
            axes: points.dim().2,
            reading: reading.copied(),
        };
        let object = Object::new();
        let set = |name: &str, value: JsValue| Reflect::set(&object, &name.into(), &value);
        set(HEAD, to_js(&head)?)?;
        set(SEQUENCE, Uint32Array::from(&of_frame[..]).into())?;
        set(FRAME, BigUint64Array::from(&frames[..]).into())?;
        set(POINTS, numbers(points.iter()))?;
        if let Some(confidence) = confidence {
            set(CONFIDENCE, numbers(confidence.iter()))?;
        }
        Ok(object.into())
    }

    fn numbers<'a>(of: impl Iterator<Item = &'a f64>) -> JsValue {
        let numbers: Vec<f64> = of.copied().collect();
        Float64Array::from(&numbers[..]).into()
    }
}

#[cfg(any(feature = "web-doctor", feature = "web-temporal"))]
pub(super) mod read {
    use ndarray::{Array2, Array3};

    use super::*;
    use crate::error::{Error, Result};
    use crate::track::{FrameKey, GroundTruth, KeypointTrack};
    use crate::web::js_error;

    /// A table that [`write`](super::write) wrote.
    pub struct Table {
        pub head: Head,
        keys: Vec<FrameKey>,
        points: Array3<f64>,
        confidence: Option<Array2<f64>>,
    }

    impl Table {
        pub fn from_js(object: &JsValue) -> JsResult<Self> {
            let parts = Parts::from_js(object)?;
            parts.table().map_err(|e| js_error(&e))
        }

        pub fn truth(self) -> JsResult<GroundTruth> {
            GroundTruth::new(self.keys, self.head.names, self.points)
                .and_then(|truth| truth.with_confidence(self.confidence))
                .map_err(|e| js_error(&e))
        }

        pub fn keypoints(self) -> JsResult<KeypointTrack> {
            KeypointTrack::new(self.keys, self.points)
                .and_then(|track| track.with_confidence(self.confidence))
                .map_err(|e| js_error(&e))
        }
    }

    /// The numbers of a table, one after the other.
    struct Parts {
        head: Head,
        sequence: Vec<u32>,
        frame: Vec<u64>,
        points: Vec<f64>,
        confidence: Option<Vec<f64>>,
    }

    impl Parts {
        fn from_js(object: &JsValue) -> JsResult<Self> {
            let get = |name: &str| Reflect::get(object, &name.into());
            let numbers = |value: JsValue| value.dyn_ref().map(Float64Array::to_vec);
            let head = serde_wasm_bindgen::from_value(get(HEAD)?);
            Ok(Self {
                head: head.map_err(|e| js_error(&Error::input(format!("the table: {e}"))))?,
                sequence: get(SEQUENCE)?
                    .dyn_ref()
                    .map(Uint32Array::to_vec)
                    .unwrap_or_default(),
                frame: get(FRAME)?
                    .dyn_ref()
                    .map(BigUint64Array::to_vec)
                    .unwrap_or_default(),
                points: numbers(get(POINTS)?).unwrap_or_default(),
                confidence: numbers(get(CONFIDENCE)?),
            })
        }

        fn table(self) -> Result<Table> {
            let expected = || Error::input("this is no table of toObject()");
            let frames = self.frame.len();
            let sequences = &self.head.sequences;
            let keys = self
                .sequence
                .iter()
                .zip(self.frame)
                .map(|(sequence, frame)| {
                    let sequence = sequences.get(*sequence as usize).ok_or_else(expected)?;
                    Ok(FrameKey {
                        sequence: sequence.clone(),
                        frame,
                    })
                });
            let keys = keys.collect::<Result<Vec<_>>>()?;
            let axes = self.head.axes.max(1);
            let count = self.points.len() / frames.max(1) / axes;
            let points = Array3::from_shape_vec((frames, count, axes), self.points);
            let confidence = self
                .confidence
                .map(|numbers| Array2::from_shape_vec((frames, count), numbers))
                .transpose();
            Ok(Table {
                keys,
                points: points.map_err(|_| expected())?,
                confidence: confidence.map_err(|_| expected())?,
                head: self.head,
            })
        }
    }
}
