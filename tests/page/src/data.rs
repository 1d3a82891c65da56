//! Data sets in temporary folders, made from the example of the site.

use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use serde_json::Value;
use tempfile::TempDir;

/// A folder with frames, a ground truth and a checkpoint; removed with the value.
pub struct Dataset {
    folder: TempDir,
}

impl Dataset {
    /// The whole example.
    ///
    /// # Errors
    /// The example is not complete or cannot be copied.
    pub fn example() -> Result<Self> {
        Self::first_sequences(usize::MAX)
    }

    /// The frames of the first two sequences of the example, with the rows of all.
    ///
    /// # Errors
    /// As [`Dataset::example`].
    pub fn small() -> Result<Self> {
        Self::first_sequences(2)
    }

    fn first_sequences(count: usize) -> Result<Self> {
        let site = crate::given("TRACKLENS_SITE")?.join("example");
        let manifest = fs::read(site.join("manifest.json")).context("the site has no example")?;
        let manifest: Value = serde_json::from_slice(&manifest)?;
        let path = |value: &Value| value.as_str().map(PathBuf::from).context("the manifest lacks a path");
        let folder = TempDir::with_prefix("tracklens-data-")?;
        let dataset = Self { folder };
        fs::create_dir(dataset.frames())?;
        let mut sequences: Vec<String> = Vec::new();
        for frame in manifest["frames"].as_array().context("the manifest lists no frames")? {
            let frame = path(frame)?;
            let sequence = frame.parent().and_then(Path::file_name).context("a frame without a folder")?;
            let sequence = sequence.to_string_lossy().into_owned();
            if !sequences.contains(&sequence) {
                if sequences.len() == count {
                    break;
                }
                fs::create_dir(dataset.frames().join(&sequence))?;
                sequences.push(sequence.clone());
            }
            let file = frame.file_name().context("a frame without a name")?;
            fs::copy(site.join(&frame), dataset.frames().join(sequence).join(file))?;
        }
        fs::copy(site.join(path(&manifest["truth"])?), dataset.truth())?;
        fs::copy(site.join(path(&manifest["checkpoint"])?), dataset.checkpoint())?;
        Ok(dataset)
    }

    /// The folder with everything.
    pub fn path(&self) -> &Path {
        self.folder.path()
    }

    /// The folder of sequences.
    pub fn frames(&self) -> PathBuf {
        self.path().join("frames")
    }

    /// The ground truth.
    pub fn truth(&self) -> PathBuf {
        self.path().join("truth.csv")
    }

    /// The checkpoint.
    pub fn checkpoint(&self) -> PathBuf {
        self.path().join("weights.safetensors")
    }

    /// All frames, in order.
    ///
    /// # Errors
    /// A folder cannot be read.
    pub fn frame_files(&self) -> Result<Vec<PathBuf>> {
        let mut files = Vec::new();
        for sequence in fs::read_dir(self.frames())? {
            for file in fs::read_dir(sequence?.path())? {
                files.push(file?.path());
            }
        }
        files.sort();
        Ok(files)
    }

    /// Writes a further file and returns its path.
    ///
    /// # Errors
    /// It cannot be written.
    pub fn write(&self, name: &str, content: impl AsRef<[u8]>) -> Result<PathBuf> {
        let path = self.path().join(name);
        fs::write(&path, content)?;
        Ok(path)
    }
}

/// Rewrites a text file line by line; the line's number is from 1.
///
/// # Errors
/// The file cannot be read or written.
pub fn change(file: &Path, edit: impl Fn(usize, &str) -> String) -> Result<()> {
    let text = fs::read_to_string(file)?;
    let lines: Vec<String> = text.lines().enumerate().map(|(i, line)| edit(i + 1, line)).collect();
    fs::write(file, lines.join("\n") + "\n").with_context(|| format!("cannot write {}", file.display()))
}
