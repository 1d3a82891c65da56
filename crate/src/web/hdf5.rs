//! HDF5 files in JavaScript.

use std::sync::Arc;

use js_sys::Function;
use wasm_bindgen::prelude::*;

use super::JsResult;
use super::recording::{Opened, recording_file};
use super::slices::Slices;
use crate::data::{PointFile, Ranges, Recording, TableOptions};
use crate::error::Result;

impl Ranges for Slices {
    fn size(&self) -> u64 {
        self.size()
    }

    fn range(&self, start: u64, length: usize) -> Result<Vec<u8>> {
        self.range(start, length)
    }
}

/// An HDF5 file that is read by slices.
#[wasm_bindgen]
pub struct Hdf5File {
    opened: Opened,
}

#[wasm_bindgen]
impl Hdf5File {
    /// Opens a file of `size` bytes; `read(start, length)` gives some of them. `camera` names the
    /// array of frames, where there are several; without it, it is the first.
    pub fn open(read: Function, size: f64, name: String, camera: Option<String>) -> Hdf5File {
        let file = Arc::new(Slices::new(read, size as u64));
        let options = TableOptions::default();
        let open =
            |camera: Option<&str>| Recording::from_hdf5_ranges(file.clone(), camera, &options);
        let points = {
            let file = file.clone();
            move || PointFile::from_hdf5_ranges(file.clone())
        };
        let opened = Opened::new(name, camera.as_deref(), open, points);
        Self { opened }
    }
}

recording_file!(Hdf5File);
