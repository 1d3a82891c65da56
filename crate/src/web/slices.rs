//! HDF5 files of any size, of which JavaScript reads what is asked for.

use std::cell::RefCell;
use std::collections::{HashMap, VecDeque};
use std::sync::{Arc, Mutex, PoisonError};

use js_sys::{Function, Uint8Array};
use wasm_bindgen::prelude::*;

use super::formats::points_to_js;
use super::{JsResult, js_error};
use crate::data::{FrameSource as _, Hdf5Points, Ranges, Recording, TableOptions};
use crate::error::{Error, Reason, Result};

/// What is read at once where less is asked for: the structures of a file lie close together.
const BLOCK: u64 = 1 << 16;
/// So many blocks are kept.
const KEPT: usize = 32;

thread_local! {
    /// What reads each open file. A value of JavaScript stays in its thread.
    static READERS: RefCell<HashMap<u32, Function>> = RefCell::default();
}

/// An open file.
struct Slices {
    id: u32,
    size: u64,
    /// The blocks that were read last, each with its number, the newest at the end.
    blocks: Mutex<VecDeque<(u64, Vec<u8>)>>,
}

impl Slices {
    fn new(read: Function, size: u64) -> Self {
        let id = READERS.with_borrow_mut(|readers| {
            let id = readers.keys().max().map_or(0, |last| last + 1);
            readers.insert(id, read);
            id
        });
        Self {
            id,
            size,
            blocks: Mutex::default(),
        }
    }

    fn read(&self, start: u64, length: u64) -> Result<Vec<u8>> {
        let failed = || {
            Error::input(format!(
                "{length} bytes from {start} on cannot be read; is the file still there?"
            ))
        };
        let read = READERS.with_borrow(|readers| readers.get(&self.id).cloned());
        let bytes = read.ok_or_else(failed)?.call2(
            &JsValue::NULL,
            &(start as f64).into(),
            &(length as f64).into(),
        );
        let bytes = bytes.ok().and_then(|bytes| bytes.dyn_into().ok());
        let bytes = bytes.map(|bytes: Uint8Array| bytes.to_vec());
        bytes
            .filter(|bytes| bytes.len() as u64 == length)
            .ok_or_else(failed)
    }

    /// A part of one block.
    fn within(&self, block: u64, from: usize, length: usize) -> Result<Vec<u8>> {
        let mut blocks = self.blocks.lock().unwrap_or_else(PoisonError::into_inner);
        let place = blocks.iter().position(|(number, _)| *number == block);
        let kept = match place.and_then(|place| blocks.remove(place)) {
            Some(kept) => kept,
            None => {
                let start = block * BLOCK;
                (block, self.read(start, BLOCK.min(self.size - start))?)
            }
        };
        let part = kept.1.get(from..from + length).map(<[u8]>::to_vec);
        blocks.push_back(kept);
        if blocks.len() > KEPT {
            blocks.pop_front();
        }
        part.ok_or_else(|| Error::input("the file ends before what it declares"))
    }
}

impl Drop for Slices {
    fn drop(&mut self) {
        READERS.with_borrow_mut(|readers| readers.remove(&self.id));
    }
}

impl Ranges for Slices {
    fn size(&self) -> u64 {
        self.size
    }

    fn range(&self, start: u64, length: usize) -> Result<Vec<u8>> {
        let (block, from) = (start / BLOCK, (start % BLOCK) as usize);
        match from + length <= BLOCK as usize {
            true => self.within(block, from, length),
            false => self.read(start, length as u64),
        }
    }
}

/// An HDF5 file that is read by slices.
#[wasm_bindgen]
pub struct Hdf5File {
    name: String,
    file: Arc<Slices>,
    recording: Result<Recording>,
}

#[wasm_bindgen]
impl Hdf5File {
    /// Opens a file of `size` bytes; `read(start, length)` gives some of them. `camera` names the
    /// array of frames, where there are several.
    pub fn open(read: Function, size: f64, name: String, camera: Option<String>) -> Hdf5File {
        let file = Arc::new(Slices::new(read, size as u64));
        let options = TableOptions::default();
        let recording = Recording::from_hdf5_ranges(file.clone(), camera.as_deref(), &options);
        Self {
            name,
            file,
            recording,
        }
    }

    /// The points, as `readPoints` gives them; `null` where there are frames and no points.
    ///
    /// # Errors
    /// When there are neither, or the points cannot be read.
    pub fn points(&self) -> JsResult<JsValue> {
        match (Hdf5Points::of_ranges(self.file.clone()), &self.recording) {
            (Ok(points), _) => points_to_js(&points),
            (Err(_), Ok(_)) => Ok(JsValue::NULL),
            (Err(error), Err(_)) => Err(js_error(&error.at(&self.name))),
        }
    }

    /// The cameras that have frames, where one has to be chosen.
    #[wasm_bindgen(getter)]
    pub fn cameras(&self) -> Vec<String> {
        let error = self.recording.as_ref().err();
        match error.and_then(Error::reason) {
            Some(Reason::SeveralCameras { names }) => names.clone(),
            _ => Vec::new(),
        }
    }

    /// Why the frames cannot be used; empty where they can, and where there are none.
    #[wasm_bindgen(getter)]
    pub fn problem(&self) -> String {
        match &self.recording {
            Err(error) if error.reason() != Some(&Reason::NoFrames) => error.to_string(),
            _ => String::new(),
        }
    }

    /// The frames, each in the folder of its sequence.
    #[wasm_bindgen(getter)]
    pub fn paths(&self) -> Vec<String> {
        self.recording
            .as_ref()
            .map(Recording::frame_paths)
            .unwrap_or_default()
    }

    /// A frame as a `.npy` array.
    ///
    /// # Errors
    /// When there is none, or it cannot be read.
    pub fn frame(&self, i: usize) -> JsResult<Vec<u8>> {
        let frame = || match &self.recording {
            Ok(recording) if i < recording.index().keys().len() => recording.read(i),
            Ok(_) => Err(Error::input(format!("there is no frame {i}"))),
            Err(error) => Err(Error::input(error.to_string())),
        };
        let frame = frame().map_err(|e| js_error(&e.at(&self.name)))?;
        Ok(frame.to_array())
    }
}
