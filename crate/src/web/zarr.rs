//! Zarr hierarchies in JavaScript: folders and ZIP archives.

use std::collections::BTreeMap;
use std::io::{self, Read, Seek, SeekFrom};
use std::sync::Arc;

use js_sys::Function;
use wasm_bindgen::prelude::*;

use super::recording::{Opened, recording_file};
use super::slices::{Reader, Slices};
use super::{JsResult, js_error};
use crate::data::{PointFile, Recording, TableOptions, ZarrStore, ZipStore};
use crate::error::{Error, Result};

/// The files of a hierarchy, each a file of its own.
struct Folder {
    reader: Reader,
    /// By their keys their numbers and sizes.
    files: BTreeMap<String, (usize, u64)>,
}

impl ZarrStore for Folder {
    fn keys(&self) -> Vec<String> {
        self.files.keys().cloned().collect()
    }

    fn has(&self, key: &str) -> bool {
        self.files.contains_key(key)
    }

    fn read(&self, key: &str) -> Result<Vec<u8>> {
        let file = self.files.get(key);
        let bytes = file.and_then(|(number, size)| self.reader.call(*number as f64, *size as f64));
        bytes.ok_or_else(|| {
            Error::input("it cannot be read; is the file still there?").at(format!("`{key}`"))
        })
    }

    fn size(&self) -> u64 {
        self.files.values().map(|(_, size)| size).sum()
    }
}

/// A file of slices, read from one place to the next.
struct Cursor {
    file: Slices,
    at: u64,
}

impl Read for Cursor {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let left = self.file.size().saturating_sub(self.at);
        let length = buffer
            .len()
            .min(usize::try_from(left).unwrap_or(usize::MAX));
        let bytes = self.file.range(self.at, length).map_err(io::Error::other)?;
        buffer[..length].copy_from_slice(&bytes);
        self.at += length as u64;
        Ok(length)
    }
}

impl Seek for Cursor {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        let at = match to {
            SeekFrom::Start(at) => Some(at),
            SeekFrom::End(by) => self.file.size().checked_add_signed(by),
            SeekFrom::Current(by) => self.at.checked_add_signed(by),
        };
        self.at = at.ok_or_else(|| io::Error::other("a place before the file"))?;
        Ok(self.at)
    }
}

/// A Zarr hierarchy of which JavaScript reads what is asked for.
#[wasm_bindgen]
pub struct ZarrFile {
    opened: Opened,
}

#[wasm_bindgen]
impl ZarrFile {
    /// Opens a folder by the paths of its files from its root and their sizes; `read(i, size)`
    /// gives the bytes of one of them. `camera` names the array of frames, where there are several;
    /// without it, it is the first.
    pub fn open(
        read: Function,
        paths: Vec<String>,
        sizes: Vec<f64>,
        name: String,
        camera: Option<String>,
    ) -> ZarrFile {
        let files = paths.into_iter().zip(sizes).enumerate();
        let store = Folder {
            reader: Reader::new(read),
            files: files
                .map(|(i, (path, size))| (path, (i, size as u64)))
                .collect(),
        };
        Self::of(Arc::new(store), name, camera.as_deref())
    }

    /// Opens a ZIP archive of `size` bytes; `read(start, length)` gives some of them.
    ///
    /// # Errors
    /// When the archive is not whole, or holds no hierarchy.
    #[wasm_bindgen(js_name = openArchive)]
    pub fn open_archive(
        read: Function,
        size: f64,
        name: String,
        camera: Option<String>,
    ) -> JsResult<ZarrFile> {
        let file = Slices::new(read, size as u64);
        let none = || Error::input("there is no Zarr array in the archive");
        let store = ZipStore::open(Cursor { file, at: 0 })
            .and_then(|store| store.ok_or_else(none))
            .map_err(|e| js_error(&e.at(&name)))?;
        Ok(Self::of(Arc::new(store), name, camera.as_deref()))
    }
}

impl ZarrFile {
    fn of(store: Arc<dyn ZarrStore>, name: String, camera: Option<&str>) -> Self {
        let options = TableOptions::default();
        let open = |camera: Option<&str>| {
            Recording::from_zarr(Box::new(Arc::clone(&store)), camera, &options)
        };
        let points = {
            let store = Arc::clone(&store);
            move || PointFile::from_zarr(Box::new(Arc::clone(&store)))
        };
        let opened = Opened::new(name, camera, open, points);
        Self { opened }
    }
}

recording_file!(ZarrFile);
