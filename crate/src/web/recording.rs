//! Recordings that stay in their files, in JavaScript.

use js_sys::Array;
use wasm_bindgen::prelude::*;

use super::table::{object, stored_to_js, table_to_js};
use super::{JsResult, js_error};
use crate::data::{FrameSource as _, PointFile, Recording};
use crate::error::{Error, Reason, Result};

/// An open recording.
pub struct Opened {
    name: String,
    recording: Result<Recording>,
    cameras: Vec<String>,
    points: Box<dyn Fn() -> Result<PointFile>>,
}

impl Opened {
    /// Opens a recording by `open`, which takes the name of a camera where one has to be chosen: the
    /// one that is asked for, or else the first.
    pub fn new(
        name: String,
        camera: Option<&str>,
        open: impl Fn(Option<&str>) -> Result<Recording>,
        points: impl Fn() -> Result<PointFile> + 'static,
    ) -> Self {
        let mut recording = open(None);
        let reason = recording.as_ref().err().and_then(Error::reason);
        let cameras = match reason {
            Some(Reason::SeveralCameras { names }) => names.clone(),
            _ => Vec::new(),
        };
        if let Some(first) = cameras.first() {
            recording = open(camera.or(Some(first)));
        }
        Self {
            name,
            recording,
            cameras,
            points: Box::new(points),
        }
    }

    /// The points, as `readPoints` gives them; `null` where there are frames and no points.
    ///
    /// # Errors
    /// When there are neither, or the points cannot be read.
    pub fn points(&self) -> JsResult<JsValue> {
        let points = (self.points)().and_then(|file| file.stored());
        match (points, &self.recording) {
            (Ok(points), _) => stored_to_js(&points),
            (Err(_), Ok(_)) => Ok(JsValue::NULL),
            (Err(error), Err(_)) => Err(js_error(&error.at(&self.name))),
        }
    }

    /// The arrays that may hold the positions of objects: `{ name, shape }`.
    ///
    /// # Errors
    /// As [`PointFile::candidates`].
    pub fn candidates(&self) -> JsResult<JsValue> {
        let found = (self.points)().and_then(|file| file.candidates());
        let found = found.map_err(|e| js_error(&e.at(&self.name)))?;
        let list = Array::new();
        for (name, shape) in found {
            let shape: Array = shape.iter().map(|n| JsValue::from(*n as f64)).collect();
            list.push(&object([("name", name.into()), ("shape", shape.into())])?);
        }
        Ok(list.into())
    }

    /// The positions of the objects that `columns` names, as `readPoints` gives a table.
    ///
    /// # Errors
    /// As [`PointFile::named`].
    pub fn named(&self, columns: &str) -> JsResult<JsValue> {
        let columns = columns.parse();
        let table = columns.and_then(|columns| (self.points)()?.named(&columns));
        table_to_js(&table.map_err(|e: Error| js_error(&e.at(&self.name)))?)
    }

    /// The cameras that have frames, where one has to be chosen.
    pub fn cameras(&self) -> Vec<String> {
        self.cameras.clone()
    }

    /// Why the frames cannot be used, with the file's name; empty where they can, and where there are
    /// none.
    pub fn problem(&self) -> String {
        match &self.recording {
            Err(error) if error.reason() != Some(&Reason::NoFrames) => {
                error.clone().at(&self.name).to_string()
            }
            _ => String::new(),
        }
    }

    /// The frames, each in the folder of its sequence.
    pub fn paths(&self) -> Vec<String> {
        let recording = self.recording.as_ref();
        recording.map(Recording::frame_paths).unwrap_or_default()
    }

    /// A frame as a `.npy` array.
    ///
    /// # Errors
    /// When there is none, or it cannot be read.
    pub fn frame(&self, i: usize) -> JsResult<Vec<u8>> {
        let frame = || match &self.recording {
            Ok(recording) if i < recording.index().keys().len() => recording.read(i),
            Ok(_) => Err(Error::input(format!("there is no frame {i}"))),
            Err(error) => Err(error.clone()),
        };
        let frame = frame().map_err(|e| js_error(&e.at(&self.name)))?;
        Ok(frame.to_array())
    }
}

/// The face of a file whose `opened` is a recording.
macro_rules! recording_file {
    ($file:ident) => {
        #[wasm_bindgen]
        impl $file {
            /// As [`Opened::points`].
            ///
            /// # Errors
            /// As [`Opened::points`].
            pub fn points(&self) -> JsResult<JsValue> {
                self.opened.points()
            }

            /// As [`Opened::candidates`].
            ///
            /// # Errors
            /// As [`Opened::candidates`].
            pub fn candidates(&self) -> JsResult<JsValue> {
                self.opened.candidates()
            }

            /// As [`Opened::named`].
            ///
            /// # Errors
            /// As [`Opened::named`].
            pub fn named(&self, columns: &str) -> JsResult<JsValue> {
                self.opened.named(columns)
            }

            /// As [`Opened::cameras`].
            #[wasm_bindgen(getter)]
            pub fn cameras(&self) -> Vec<String> {
                self.opened.cameras()
            }

            /// As [`Opened::problem`].
            #[wasm_bindgen(getter)]
            pub fn problem(&self) -> String {
                self.opened.problem()
            }

            /// As [`Opened::paths`].
            #[wasm_bindgen(getter)]
            pub fn paths(&self) -> Vec<String> {
                self.opened.paths()
            }

            /// As [`Opened::frame`].
            ///
            /// # Errors
            /// As [`Opened::frame`].
            pub fn frame(&self, i: usize) -> JsResult<Vec<u8>> {
                self.opened.frame(i)
            }
        }
    };
}
pub(super) use recording_file;
