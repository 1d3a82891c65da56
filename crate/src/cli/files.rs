//! Files and folders: everything that knows paths.

use std::path::{Path, PathBuf};

use crate::checkpoint::Checkpoint;
use crate::data::{FrameIndex, Table, parse_ground_truth, parse_keypoints};
use crate::error::{Error, Result};
use crate::track::{GroundTruth, KeypointTrack};

/// Folders below the given one that are searched for frames.
const DEPTH: usize = 8;

/// The frames of a folder.
pub(super) struct Folder {
    pub index: FrameIndex,
    paths: Vec<PathBuf>,
}

impl Folder {
    /// Finds the frames below `folder`: one folder a sequence, or the images of the folder itself.
    pub fn open(folder: &Path) -> Result<Self> {
        let mut paths = Vec::new();
        walk(folder, DEPTH, &mut paths)?;
        // With the folder's own name: images that lie in it directly are the sequence of that name.
        let own = folder
            .canonicalize()
            .map_err(|e| Error::io(folder.display(), &e))?;
        let own = own.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let relative = |path: &PathBuf| {
            let below = path.strip_prefix(folder).unwrap_or(path);
            let parts = below.iter().map(|part| part.to_string_lossy().into_owned());
            std::iter::once(own.clone())
                .chain(parts)
                .collect::<Vec<_>>()
                .join("/")
        };
        let names: Vec<String> = paths.iter().map(relative).collect();
        let index = FrameIndex::new(&names).map_err(|e| e.at(folder.display()))?;
        Ok(Self { index, paths })
    }

    /// The path of frame `i`, in order.
    pub fn path(&self, i: usize) -> &Path {
        &self.paths[self.index.order()[i]]
    }

    /// The files that are no images.
    pub fn ignored(&self) -> Vec<&Path> {
        self.index
            .ignored()
            .iter()
            .map(|i| self.paths[*i].as_path())
            .collect()
    }

    /// The number of frames.
    pub fn len(&self) -> usize {
        self.index.keys().len()
    }
}

fn walk(folder: &Path, depth: usize, out: &mut Vec<PathBuf>) -> Result<()> {
    let failed = |e: std::io::Error| Error::io(folder.display(), &e);
    for entry in std::fs::read_dir(folder).map_err(failed)? {
        let entry = entry.map_err(failed)?;
        let path = entry.path();
        // Follows links, so that a data set may be linked together.
        let is_folder = std::fs::metadata(&path)
            .map_err(|e| Error::io(path.display(), &e))?
            .is_dir();
        if !is_folder {
            out.push(path);
        } else if depth > 0 {
            walk(&path, depth - 1, out)?;
        }
    }
    Ok(())
}

pub(super) fn read(path: &Path) -> Result<Vec<u8>> {
    std::fs::read(path).map_err(|e| Error::io(path.display(), &e))
}

pub(super) fn read_ground_truth(path: &Path) -> Result<GroundTruth> {
    Ok(told(
        parse_ground_truth(&read(path)?, &path.to_string_lossy())?,
        path,
    ))
}

pub(super) fn read_keypoints(path: &Path) -> Result<KeypointTrack> {
    Ok(told(
        parse_keypoints(&read(path)?, &path.to_string_lossy())?,
        path,
    ))
}

pub(super) fn read_checkpoint(path: &Path) -> Result<Checkpoint> {
    Checkpoint::from_bytes(&read(path)?).map_err(|e| e.at(path.display()))
}

fn told<T>(table: Table<T>, path: &Path) -> T {
    for notice in &table.notices {
        eprintln!("note: {}: {notice}", path.display());
    }
    table.content
}
