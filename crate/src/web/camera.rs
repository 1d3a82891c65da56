//! A camera in JavaScript.

use wasm_bindgen::prelude::*;

use super::tables::GroundTruthTable;
use super::{JsResult, js_error};
use crate::data::{self, Parsed};
use crate::evaluation::CameraReport;

/// A camera, which puts positions in space into its image.
#[wasm_bindgen]
pub struct Camera {
    name: String,
    camera: data::Camera,
}

#[wasm_bindgen]
impl Camera {
    /// Parses the JSON of a camera.
    ///
    /// # Errors
    /// As [`data::Camera::parse`].
    pub fn parse(bytes: &[u8], name: String) -> JsResult<Camera> {
        let camera = data::Camera::parse(bytes, &name).map_err(|e| js_error(&e))?;
        Ok(Self { name, camera })
    }

    /// Width and height of its images.
    #[wasm_bindgen(getter, js_name = imageSize)]
    pub fn image_size(&self) -> Vec<u32> {
        self.camera.image_size.to_vec()
    }
}

#[wasm_bindgen]
impl GroundTruthTable {
    /// The positions in the image of a camera, which projects those in space.
    ///
    /// # Errors
    /// As [`Camera::project`](data::Camera::project).
    pub fn projected(&self, camera: &Camera) -> JsResult<GroundTruthTable> {
        let image = camera.camera.project(&self.table.content);
        let image = image.map_err(|e| js_error(&e.at(&camera.name)))?;
        let report = CameraReport::from(&image);
        let table = Parsed {
            content: image.truth,
            reading: self.table.reading,
            notices: self.table.notices.clone(),
        };
        Ok(Self {
            camera: Some(report),
            ..Self::new(self.name.clone(), Some(camera.camera.image_size), table)
        })
    }
}
