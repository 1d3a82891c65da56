//! Files that hold other files, in JavaScript: what lies where, so that a page reads no more than
//! it needs.

use serde::Serialize;
use wasm_bindgen::prelude::*;

use super::tables::{GroundTruthTable, KeypointTable, table_options};
use super::{JsResult, js_error, to_js};
use crate::data::{self, ArchiveEntry, ArchiveIndex, NpyArray, Recording, TableOptions};

/// Reads the directory of a ZIP archive of `size` bytes from the last ones.
///
/// # Errors
/// As [`ArchiveIndex::read`].
#[wasm_bindgen(js_name = readArchive)]
pub fn read_archive(tail: &[u8], size: f64, name: &str) -> JsResult<JsValue> {
    #[derive(Serialize)]
    struct Index {
        entries: Option<Vec<ArchiveEntry>>,
        needs: Option<u64>,
    }
    let read = ArchiveIndex::read(tail, size as u64).map_err(|e| js_error(&e.at(name)))?;
    to_js(&match read {
        ArchiveIndex::Needs(start) => Index {
            entries: None,
            needs: Some(start),
        },
        ArchiveIndex::Entries(entries) => Index {
            entries: Some(entries),
            needs: None,
        },
    })
}

/// The arrays of an NPZ file, of which only points need be in memory.
#[wasm_bindgen]
pub struct Arrays {
    name: String,
    arrays: Vec<NpyArray>,
}

#[wasm_bindgen]
impl Arrays {
    /// Of the file called `name`; arrays are added.
    #[wasm_bindgen(constructor)]
    pub fn new(name: String) -> Arrays {
        Self {
            name,
            arrays: Vec::new(),
        }
    }

    /// Whether an array of this name holds frames, points or their names.
    pub fn uses(name: &str) -> bool {
        NpyArray::holds_frames(name) || NpyArray::is_needed_whole(name)
    }

    /// How many bytes of an array of this name and size are to be added.
    #[wasm_bindgen(js_name = bytesNeeded)]
    pub fn bytes_needed(name: &str, size: f64) -> f64 {
        match NpyArray::is_needed_whole(name) {
            true => size,
            false => size.min(NpyArray::HEAD as f64),
        }
    }

    /// Adds an array by its name without `.npy`, its first bytes and its size.
    pub fn add(&mut self, name: String, bytes: Vec<u8>, size: f64) {
        self.arrays.push(NpyArray {
            name,
            bytes,
            size: size as u64,
        });
    }

    /// Whether there is an array of points.
    #[wasm_bindgen(getter, js_name = hasPoints)]
    pub fn has_points(&self) -> bool {
        self.arrays.iter().any(|a| NpyArray::holds_points(&a.name))
    }

    /// Whether there is an array of frames.
    #[wasm_bindgen(getter, js_name = hasFrames)]
    pub fn has_frames(&self) -> bool {
        self.arrays.iter().any(|a| NpyArray::holds_frames(&a.name))
    }

    /// Where the frames lie.
    ///
    /// # Errors
    /// When there are none, or their array is not understood.
    pub fn frames(&self) -> JsResult<JsValue> {
        #[derive(Serialize)]
        #[serde(rename_all = "camelCase")]
        struct Frames {
            array: String,
            paths: Vec<String>,
            width: u32,
            height: u32,
            start: u64,
            length: u64,
            header: Vec<u8>,
        }
        let frames = || {
            // Points that are wrong do not keep the frames from being used.
            let only = self
                .arrays
                .iter()
                .filter(|a| NpyArray::tells_frames(&a.name));
            let recording =
                Recording::from_arrays(only.cloned().collect(), &TableOptions::default())?;
            let [width, height] = recording.image_size();
            let (start, length) = recording.frame_place(0).unwrap_or_default();
            Ok(Frames {
                array: recording.frames_name().to_owned(),
                paths: recording.frame_paths(),
                width,
                height,
                start,
                length,
                header: recording.frame_header(),
            })
        };
        let found = frames().map_err(|e: crate::Error| js_error(&e.at(&self.name)))?;
        to_js(&found)
    }

    /// The points as a ground truth.
    ///
    /// # Errors
    /// As [`data::ground_truth_of_arrays`].
    #[wasm_bindgen(js_name = groundTruth)]
    pub fn ground_truth(&self, options: JsValue) -> JsResult<GroundTruthTable> {
        let options = table_options(options, "Arrays.groundTruth")?;
        let table = data::ground_truth_of_arrays(self.points(), &options);
        let table = table.map_err(|e| js_error(&e.at(&self.name)))?;
        let name = self.name.clone();
        Ok(GroundTruthTable::new(name, options.image_size, table))
    }

    /// The points as keypoints of a detector.
    ///
    /// # Errors
    /// As [`data::keypoints_of_arrays`].
    pub fn keypoints(&self, options: JsValue) -> JsResult<KeypointTable> {
        let options = table_options(options, "Arrays.keypoints")?;
        let table = data::keypoints_of_arrays(self.points(), &options);
        Ok(KeypointTable {
            name: self.name.clone(),
            table: table.map_err(|e| js_error(&e.at(&self.name)))?,
        })
    }

    fn points(&self) -> Vec<NpyArray> {
        let points = self
            .arrays
            .iter()
            .filter(|a| NpyArray::is_needed_whole(&a.name));
        points.cloned().collect()
    }
}
