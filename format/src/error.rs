//! What can be wrong with a coefficient file.

use crate::BlockId;
use std::io;

/// Why a file could not be read or written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The storage failed.
    #[error("{0}")]
    Io(#[from] io::Error),
    /// Not a coefficient file at all.
    #[error("not a wavesplat coefficient file: {0}")]
    Foreign(String),
    /// Bytes that cannot be right: damaged, cut, or forged.
    #[error("damaged at byte {offset} ({place}): {what}")]
    Corrupt {
        /// Where in the file.
        offset: u64,
        /// The structure there, as "footer" or "window 3 block 7 level 2".
        place: String,
        /// What is wrong.
        what: String,
    },
    /// A block whose data were gone when the file was recovered from a damaged one.
    #[error("{0}: lost before the file was recovered")]
    Lost(BlockId),
    /// Written by a newer version, or with a feature that this reader lacks.
    #[error("not supported: {0}")]
    Unsupported(String),
    /// A size beyond the limits of the format.
    #[error("{what}: {size} is over the limit of {limit}")]
    TooLarge {
        /// What is too large.
        what: String,
        /// Its size.
        size: u64,
        /// The largest that the format allows.
        limit: u64,
    },
    /// What was asked for or given cannot be in a file.
    #[error("not valid: {0}")]
    Invalid(String),
}

impl Error {
    /// Whether the storage failed, and nothing is said of the file.
    pub fn is_of_storage(&self) -> bool {
        matches!(self, Self::Io(_))
    }
}

/// The package's result.
pub type Result<T> = std::result::Result<T, Error>;
