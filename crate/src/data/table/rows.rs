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
    /// The z of every row; none where points are in the image.
    pub heights: Vec<f64>,
    /// Sizes of images that the file gives.
    pub sizes: Vec<[u32; 2]>,
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
    pub fn place_of(&self, line: u32) -> String {
        match self.layout {
            Layout::Coco => format!("annotation {line}"),
            _ => format!("line {line}"),
        }
    }
}

/// One point. Small, since a short line of text becomes many of them.
pub struct Row {
    pub frame: u64,
    pub xy: [f64; 2],
    /// NaN where the file gives none.
    pub confidence: f64,
    /// Where it is in the file; an annotation's position for JSON.
    pub line: u32,
    pub sequence: u32,
    pub point: u32,
    /// The size of its image among [`Raw::sizes`], where the file says so.
    pub size: Option<NonMaxU32>,
}

/// An index that leaves room for none.
#[derive(Clone, Copy)]
pub struct NonMaxU32(std::num::NonZeroU32);

impl NonMaxU32 {
    pub fn new(index: usize) -> Option<Self> {
        let number = u32::try_from(index).ok()?.checked_add(1)?;
        std::num::NonZeroU32::new(number).map(Self)
    }

    pub fn get(self) -> usize {
        self.0.get() as usize - 1
    }
}

/// The names of sequences, numbered as they come.
#[derive(Default)]
pub struct Sequences {
    pub names: Vec<String>,
    /// By the names as the file writes them and as they are kept.
    numbers: HashMap<String, u32>,
}

impl Sequences {
    pub fn number(&mut self, name: &str) -> Result<u32, String> {
        if name.is_empty() {
            return Err("empty; expected the name or number of the sequence".to_owned());
        }
        if let Some(known) = self.numbers.get(name) {
            return Ok(*known);
        }
        let cleaned = cleaned(name).into_owned();
        let number = *self.numbers.entry(cleaned.clone()).or_insert_with(|| {
            self.names.push(cleaned);
            self.names.len() as u32 - 1
        });
        self.numbers.insert(name.to_owned(), number);
        Ok(number)
    }
}

/// The names of points, numbered as they come.
#[derive(Default)]
pub struct Points {
    pub names: Vec<String>,
    numbers: HashMap<String, u32>,
}

impl Points {
    /// The number of the point of this name, which is cleaned.
    pub fn number(&mut self, name: &str) -> u32 {
        if let Some(known) = self.numbers.get(name) {
            return *known;
        }
        let number = self.names.len() as u32;
        self.names.push(name.to_owned());
        self.numbers.insert(name.to_owned(), number);
        number
    }
}

/// Which points a table is to hold.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Content {
    GroundTruth,
    Keypoints,
}
