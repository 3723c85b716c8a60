//! Errors of JSON as errors of the library.

use std::path::Path;
use wavesplat::base::error::Error;

/// An error of serde as an error about a file.
pub(super) fn bad_json(path: &Path, error: &serde_json::Error) -> Error {
    Error::input(path, error.to_string())
}
