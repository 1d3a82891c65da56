//! Points as a file gives them, before they are arranged.

use std::collections::HashMap;

use crate::data::names::cleaned;
use crate::data::reading::{Layout, Notice};

/// Points as a file gives them.
pub struct Raw {
    pub layout: Layout,
    pub sequences: Vec<String>,
    /// The names of the points.
    pub points: Vec<String>,
    pub rows: Vec<Row>,
    pub notices: Vec<Notice>,
    /// Whether positions are in pixels of images of unknown size.
    pub lacks_size: bool,
}

impl Raw {
    /// Where a row is in the file, in words.
    pub fn place(&self, row: &Row) -> String {
        self.place_of(row.line)
    }

    /// As [`Raw::place`], of a row's `line`.
    pub fn place_of(&self, line: u64) -> String {
        match self.layout {
            Layout::Coco => format!("annotation {line}"),
            _ => format!("line {line}"),
        }
    }
}

/// One point.
pub struct Row {
    /// Where it is in the file; an annotation's position for JSON.
    pub line: u64,
    pub sequence: usize,
    pub frame: u64,
    pub point: usize,
    pub xy: [f64; 2],
    /// Of its image, where the file says so.
    pub image_size: Option<[u32; 2]>,
}

/// The names of sequences, numbered as they come.
#[derive(Default)]
pub struct Sequences {
    pub names: Vec<String>,
    /// By the names as the file writes them and as they are kept.
    numbers: HashMap<String, usize>,
}

impl Sequences {
    pub fn number(&mut self, name: &str) -> Result<usize, String> {
        if name.is_empty() {
            return Err("empty; expected the name or number of the sequence".to_owned());
        }
        if let Some(known) = self.numbers.get(name) {
            return Ok(*known);
        }
        let cleaned = cleaned(name).into_owned();
        let number = *self.numbers.entry(cleaned.clone()).or_insert_with(|| {
            self.names.push(cleaned);
            self.names.len() - 1
        });
        self.numbers.insert(name.to_owned(), number);
        Ok(number)
    }
}

/// Which points a table is to hold.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Content {
    GroundTruth,
    Keypoints,
}
