//! The one error type of the crate.

use std::borrow::Cow;
use std::fmt;

/// Why something could not be done: what was wrong, where, and what to do about it.
///
/// The message is for a person. [`Error::kind`] and [`Error::reason`] are for programs: the command
/// line derives its exit code from the kind, and both the command line and the page offer a remedy
/// that fits the reason.
#[derive(Debug, Clone, thiserror::Error)]
#[error("{}{message}", Place(.place))]
pub struct Error {
    kind: ErrorKind,
    place: Option<String>,
    message: String,
    reason: Option<Reason>,
}

/// What a program needs to know of an [`Error`] or a notice to offer a remedy. The message says the
/// same in words; the remedy (an option, a button) is up to whoever shows it.
///
/// In JavaScript it is a plain object, `error.reason`, with the name of the variant in `type`:
/// `{ type: "missingImageSize" }`, `{ type: "nonFinite", keypoint: 3 }`.
#[derive(Debug, Clone, PartialEq, Eq)]
#[cfg_attr(feature = "data", derive(serde::Serialize))]
#[cfg_attr(
    feature = "data",
    serde(
        tag = "type",
        rename_all = "camelCase",
        rename_all_fields = "camelCase"
    )
)]
#[non_exhaustive]
pub enum Reason {
    /// The positions are in pixels and nothing gives the size of the images. It is the last thing
    /// that is checked: with a size, the same file can be read.
    MissingImageSize,
    /// Nothing says in which unit the positions are. With it, the same file can be read.
    UnknownUnit,
    /// A keypoint is missing or not finite in some frame. It can be scored without such frames.
    NonFinite {
        /// The keypoint.
        keypoint: usize,
    },
    /// Positions are missing.
    MissingPoints {
        /// How many.
        missing: usize,
        /// How many there would be without gaps.
        points: usize,
    },
    /// Coordinates read as ndc lie far outside the image, as pixels would.
    LooksLikePixels {
        /// How many of them.
        coordinates: usize,
    },
    /// All coordinates lie in the first corner of the image, as ndc read as pixels would.
    LooksLikeNdc,
    /// No coordinate is negative, as in a unit that goes from 0 to 1 across the image.
    LooksLikeFractions,
    /// Points lie at exactly (0, 0) with the least confidence, where some programs write what they
    /// lost.
    LostPoints {
        /// How many.
        points: usize,
    },
    /// The keypoints of a table count from 1.
    KeypointsFromOne,
    /// The file does not say in which order the coordinates are; the usual order was assumed.
    AssumedAxisOrder,
    /// No frame has a row, and most have one when this is added to the numbers of the rows.
    OtherNumbers {
        /// To the numbers of the frames.
        frames: i64,
        /// To the numbers in the names of the sequences.
        sequences: i64,
    },
    /// Points have three coordinates, and those in space are not compiled in.
    InSpace,
    /// A file holds no frames; it may hold points.
    NoFrames,
    /// A table has columns, but not those that are needed; they may have other names.
    OtherColumns {
        /// The columns that are needed and missing.
        missing: Vec<String>,
    },
    /// A file of arrays holds no points by their usual names; it may hold positions by others.
    NoPoints,
    /// A recording holds the frames of several cameras. With the name of one, it can be read.
    SeveralCameras {
        /// Their names.
        names: Vec<String>,
    },
    /// The model of a detector leaves settings open; with them, the same file can be run.
    DetectorSettings {
        /// Their names: `inputSize`, `layout`, `normalization`, `output`, `outputNames`, `columns`,
        /// `unit`.
        missing: Vec<String>,
    },
}

/// What sort of failure an [`Error`] is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ErrorKind {
    /// The input is not what it should be: a table, an image, a checkpoint.
    Input,
    /// The inputs are fine by themselves and do not fit each other.
    Mismatch,
    /// The numbers do not allow an answer, e.g. no frame has a ground truth.
    Numeric,
    /// Reading or writing failed.
    Io,
    /// The caller cancelled.
    Cancelled,
}

/// `Result` with [`Error`].
pub type Result<T, E = Error> = std::result::Result<T, E>;

impl Error {
    /// An error of `kind` with a message that says what was wrong, what was expected and what to
    /// do.
    pub fn new(kind: ErrorKind, message: impl Into<String>) -> Self {
        Self {
            kind,
            place: None,
            message: without_controls(&message.into()).into_owned(),
            reason: None,
        }
    }

    /// Bad input.
    pub fn input(message: impl Into<String>) -> Self {
        Self::new(ErrorKind::Input, message)
    }

    /// Inputs that do not fit each other.
    pub fn mismatch(message: impl Into<String>) -> Self {
        Self::new(ErrorKind::Mismatch, message)
    }

    /// Numbers that allow no answer.
    pub fn numeric(message: impl Into<String>) -> Self {
        Self::new(ErrorKind::Numeric, message)
    }

    /// A failed read or write of `path`.
    pub fn io(path: impl fmt::Display, error: &std::io::Error) -> Self {
        Self::new(ErrorKind::Io, error.to_string()).at(path)
    }

    /// The error of a call that was cancelled.
    pub fn cancelled() -> Self {
        Self::new(ErrorKind::Cancelled, "cancelled")
    }

    /// The same error with the place (file, line, frame) it happened at, outermost first.
    #[must_use]
    pub fn at(mut self, place: impl fmt::Display) -> Self {
        let place = place.to_string();
        let place = without_controls(&place);
        self.place = Some(match self.place {
            Some(inner) => format!("{place}: {inner}"),
            None => place.into_owned(),
        });
        self
    }

    /// The same error with the reason, for programs that offer a remedy.
    #[must_use]
    pub fn because(mut self, reason: Reason) -> Self {
        self.reason = Some(reason);
        self
    }

    /// The reason, where there is a remedy for it.
    pub fn reason(&self) -> Option<&Reason> {
        self.reason.as_ref()
    }

    /// What sort of failure this is.
    pub fn kind(&self) -> ErrorKind {
        self.kind
    }
}

/// `text` with U+FFFD for control characters other than line breaks and tabs: what comes from a file
/// must not give orders to a terminal.
pub(crate) fn without_controls(text: &str) -> Cow<'_, str> {
    let is_bad = |c: char| c.is_control() && c != '\n' && c != '\t';
    match text.contains(is_bad) {
        true => Cow::Owned(text.replace(is_bad, "\u{fffd}")),
        false => Cow::Borrowed(text),
    }
}

struct Place<'a>(&'a Option<String>);

impl fmt::Display for Place<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.0 {
            Some(place) => write!(f, "{place}: "),
            None => Ok(()),
        }
    }
}
