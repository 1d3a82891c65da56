//! What figures and pages are made of: colours, axes, text of a known size, line figures, and
//! documents.

mod canvas;
mod decades;
mod document;
mod lines;
mod measured;

use std::collections::BTreeSet;

pub(super) use canvas::{
    Area, Done, anchored, canvas, fitted, ink_on, legend, place, short, width_of,
};
pub use canvas::{Drawn, Theme};
pub(super) use decades::{Decades, above, below, power, tick};
pub(super) use document::{document, figure, part};
pub use lines::{Color, LineFigure, LineSeries, PlotArea, draw_lines, lines_to_svg};
pub(super) use measured::Measured;

/// One figure in a file or on a page.
#[derive(Debug, Clone, PartialEq, Eq, serde::Serialize)]
pub struct Figure {
    /// The name of its files, without the ending.
    pub name: String,
    /// What it shows, in one sentence.
    pub caption: String,
    /// The SVG document.
    pub svg: String,
}

/// Names of files that every file system takes, no two alike.
#[derive(Debug, Default)]
pub struct FileNames {
    /// In lower case: some file systems do not tell cases apart.
    taken: BTreeSet<String>,
}

impl FileNames {
    /// Characters of a name, so that it stays far below what file systems take.
    const LONGEST: usize = 120;

    /// A name like `name`, with a number at its end where it was given out before.
    pub fn unique(&mut self, name: &str) -> String {
        let plain = |c: char| match c {
            c if c.is_ascii_alphanumeric() => c,
            '-' | '.' => c,
            _ => '_',
        };
        let name: String = name.chars().map(plain).take(Self::LONGEST).collect();
        let numbered = (2..).map(|n| format!("{name}-{n}"));
        let mut candidates = std::iter::once(name.clone()).chain(numbered);
        candidates
            .find(|candidate| self.taken.insert(candidate.to_lowercase()))
            .unwrap_or(name)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_files_are_unique_whatever_they_are_made_of() {
        let mut names = FileNames::default();
        let unique = ["m1_nose", "m1 nose", "M1_Nose", "m1_nose-2", "../x", "鼻"]
            .map(|name| names.unique(name));
        assert_eq!(
            unique,
            [
                "m1_nose",
                "m1_nose-2",
                "M1_Nose-3",
                "m1_nose-2-2",
                ".._x",
                "_"
            ]
        );
        assert_eq!(names.unique(&"a".repeat(1000)).len(), 120);
    }
}
