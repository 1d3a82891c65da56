//! The files that a Zarr hierarchy consists of: a folder, or the entries of a ZIP archive.

use std::collections::BTreeMap;
use std::io::{Read, Seek};
use std::sync::{Arc, Mutex, PoisonError};

use zip::ZipArchive;

use crate::error::{Error, Result};

/// The files of a Zarr hierarchy by their keys, paths from its root (`data/img/.zarray`).
pub trait ZarrStore: Send + Sync {
    /// All keys.
    fn keys(&self) -> Vec<String>;

    /// Whether there is a file at a key.
    fn has(&self, key: &str) -> bool;

    /// The bytes of the file at one of them.
    ///
    /// # Errors
    /// When it cannot be read.
    fn read(&self, key: &str) -> Result<Vec<u8>>;

    /// The bytes of all files as they lie there.
    fn size(&self) -> u64;
}

impl<S: ZarrStore + ?Sized> ZarrStore for Arc<S> {
    fn keys(&self) -> Vec<String> {
        (**self).keys()
    }

    fn has(&self, key: &str) -> bool {
        (**self).has(key)
    }

    fn read(&self, key: &str) -> Result<Vec<u8>> {
        (**self).read(key)
    }

    fn size(&self) -> u64 {
        (**self).size()
    }
}

/// What describes an array or a group: of version 3, and of version 2.
pub const DESCRIPTIONS: [&str; 3] = ["zarr.json", ".zarray", ".zgroup"];

/// A Zarr hierarchy in a ZIP archive, alone or with a folder around it.
pub struct ZipStore<R> {
    archive: Mutex<ZipArchive<R>>,
    /// By their keys the positions in the archive.
    entries: BTreeMap<String, usize>,
    size: u64,
}

impl<R: Read + Seek + Send> ZipStore<R> {
    /// The hierarchy in an archive; None where there is none.
    ///
    /// # Errors
    /// When the bytes are no whole ZIP archive.
    pub fn open(mut reader: R) -> Result<Option<Self>> {
        let size = reader.seek(std::io::SeekFrom::End(0));
        let size = size.map_err(|e| damaged(&e.to_string()))?;
        let archive = ZipArchive::new(reader).map_err(|e| damaged(&e.to_string()))?;
        let names = archive.file_names().filter(|name| !name.ends_with('/'));
        let names: Vec<String> = names.map(str::to_owned).collect();
        let Some(root) = root(&names) else {
            return Ok(None);
        };
        let keys = names.iter().filter_map(|name| {
            let key = name.strip_prefix(&root)?;
            Some((key.to_owned(), archive.index_for_name(name)?))
        });
        Ok(Some(Self {
            entries: keys.collect(),
            archive: Mutex::new(archive),
            size,
        }))
    }
}

/// The path of a hierarchy's root among these names, with the `/` behind it.
fn root(names: &[String]) -> Option<String> {
    let described = names.iter().filter_map(|name| {
        let (folder, file) = name.rsplit_once('/').unwrap_or(("", name));
        DESCRIPTIONS.contains(&file).then_some(folder)
    });
    let root = described.min_by_key(|folder| folder.len())?;
    Some(match root {
        "" => String::new(),
        folder => format!("{folder}/"),
    })
}

impl<R: Read + Seek + Send> ZarrStore for ZipStore<R> {
    fn keys(&self) -> Vec<String> {
        self.entries.keys().cloned().collect()
    }

    fn has(&self, key: &str) -> bool {
        self.entries.contains_key(key)
    }

    fn read(&self, key: &str) -> Result<Vec<u8>> {
        let position = self.entries.get(key);
        let position = *position.ok_or_else(|| damaged(&format!("there is no `{key}`")))?;
        // A thread that panicked while it held the archive left nothing half done: every entry is
        // read from its beginning.
        let mut archive = self.archive.lock().unwrap_or_else(PoisonError::into_inner);
        let entry = archive.by_index(position);
        let entry = entry.map_err(|e| damaged(&e.to_string()))?;
        // Chunks are packed already: an entry that unpacks to much more is none.
        let most = most_unpacked(self.size);
        let mut bytes = Vec::new();
        let read = entry.take(most + 1).read_to_end(&mut bytes);
        read.map_err(|e| damaged(&format!("`{key}`: {e}")))?;
        match bytes.len() as u64 > most {
            true => Err(damaged(&format!(
                "`{key}` unpacks to more than {most} bytes"
            ))),
            false => Ok(bytes),
        }
    }

    fn size(&self) -> u64 {
        self.size
    }
}

/// Bytes that a chunk of a file of `size` bytes may unpack to.
pub fn most_unpacked(size: u64) -> u64 {
    const SMALL: u64 = 8 << 20;
    const FOR_BYTE: u64 = 8;
    FOR_BYTE.saturating_mul(size).saturating_add(SMALL)
}

fn damaged(why: &str) -> Error {
    Error::input(format!(
        "not a whole Zarr archive ({why}); was it cut short?"
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_root_is_the_folder_of_the_first_description() {
        let of = |names: &[&str]| root(&names.iter().map(|n| (*n).to_owned()).collect::<Vec<_>>());
        assert_eq!(of(&["data/img/.zarray", ".zgroup"]).as_deref(), Some(""));
        let nested = ["a.zarr/data/zarr.json", "a.zarr/zarr.json"];
        assert_eq!(of(&nested).as_deref(), Some("a.zarr/"));
        assert_eq!(of(&["images.npy"]), None);
    }
}
