//! The one error type of the crate.

use std::fmt;

/// Why something could not be done: what was wrong, where, and what to do about it.
///
/// The message is made for a person. [`Error::kind`] is for programs: the command line derives its
/// exit code from it, the page decides with it what to keep.
#[derive(Debug, Clone, thiserror::Error)]
#[error("{}{message}", Place(.place))]
pub struct Error {
    kind: ErrorKind,
    place: Option<String>,
    message: String,
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
            message: message.into(),
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
        self.place = Some(match self.place {
            Some(inner) => format!("{place}: {inner}"),
            None => place.to_string(),
        });
        self
    }

    /// What sort of failure this is.
    pub fn kind(&self) -> ErrorKind {
        self.kind
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
