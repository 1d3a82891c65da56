//! What the errors of the HDF5 reader are in words.

use crate::error::Error;

/// The error of an array that cannot be read.
pub fn unreadable(name: &str, error: &hdf5_reader::error::Error) -> Error {
    Error::input(format!(
        "`{name}` cannot be read ({error}); is the file complete, and packed with gzip or not at all?"
    ))
}

/// The error of a file that is none.
pub fn broken(error: &hdf5_reader::error::Error) -> Error {
    Error::input(format!(
        "not a whole HDF5 file ({error}); was it cut short?"
    ))
}
