//! Transfer functions from files.

use super::TransferFunction;
use crate::error::{Error, Result};

/// From a file by its name.
pub(super) fn read(name: &str) -> Result<TransferFunction> {
    Err(Error::input(name, "not yet"))
}
