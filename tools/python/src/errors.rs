//! The library's errors as exceptions of Python, with the library's words.

use crate::advice;
use pyo3::create_exception;
use pyo3::exceptions::{PyException, PyRuntimeError, PyValueError};
use pyo3::prelude::*;
use std::io;
use wavesplat::Error;
use wavesplat::format::Error as FormatError;

create_exception!(wavesplat, WavesplatError, PyException, "The base of the exceptions of wavesplat.");
create_exception!(wavesplat, InputError, WavesplatError, "Frames cannot be read, or contradict their description.");
create_exception!(
    wavesplat,
    DamagedError,
    WavesplatError,
    "A coefficient file is damaged, truncated or not one at all."
);
create_exception!(wavesplat, UnsupportedError, WavesplatError, "A coefficient file needs a newer version.");
create_exception!(wavesplat, ChangedError, WavesplatError, "A file changed while it was open.");
create_exception!(wavesplat, BoundMissedError, WavesplatError, "Samples are outside the promised bound.");

/// The exception of an error.
pub(crate) fn raised(error: Error) -> PyErr {
    let words = advice::of_error(&error);
    match error {
        Error::Io { source, .. } => of_system(&source, words),
        Error::CoefficientFile { source, .. } => match source {
            FormatError::Io(source) => of_system(&source, words),
            FormatError::Unsupported(_) => UnsupportedError::new_err(words),
            FormatError::Invalid(_) | FormatError::TooLarge { .. } => PyValueError::new_err(words),
            _ => DamagedError::new_err(words),
        },
        Error::Setting { .. } | Error::Path { .. } | Error::Usage(_) => PyValueError::new_err(words),
        Error::Input { .. } => InputError::new_err(words),
        Error::Changed { .. } => ChangedError::new_err(words),
        Error::BoundMissed { .. } => BoundMissedError::new_err(words),
        Error::Cancelled => PyRuntimeError::new_err(words),
        _ => WavesplatError::new_err(words),
    }
}

/// An `OSError`, such as `FileNotFoundError`; or the exception of an object of Python that was read.
fn of_system(source: &io::Error, words: String) -> PyErr {
    if let Some(raised) = source.get_ref().and_then(|source| source.downcast_ref::<PyErr>()) {
        return Python::attach(|py| raised.clone_ref(py));
    }
    io::Error::new(source.kind(), words).into()
}

/// The exception of an array that another thread is writing.
#[allow(clippy::needless_pass_by_value, reason = "it is passed to map_err")]
pub(crate) fn borrowed(error: numpy::BorrowError) -> PyErr {
    PyValueError::new_err(format!("an array is in use: {error}"))
}
