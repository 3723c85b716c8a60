//! The errors of reading and writing a coefficient file.

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
    /// Invalid bytes: the file is damaged, truncated or forged.
    #[error("damaged at byte {offset} ({place}): {what}")]
    Corrupt {
        /// Offset in the file.
        offset: u64,
        /// The structure at that offset, such as "footer" or "window 3 block 7 level 2".
        place: String,
        /// The problem.
        what: String,
    },
    /// A block whose data were missing or damaged when the file was recovered or merged.
    #[error("{0}: lost before the file was written")]
    Lost(BlockId),
    /// Written by a newer version, or with a feature that this reader lacks.
    #[error("not supported: {0}")]
    Unsupported(String),
    /// A size beyond the limits of the format.
    #[error("{what}: {size} is over the limit of {limit}")]
    TooLarge {
        /// The part that is too large.
        what: String,
        /// Its size.
        size: u64,
        /// The largest that the format allows.
        limit: u64,
    },
    /// The request or the given data are not valid for this file.
    #[error("not valid: {0}")]
    Invalid(String),
}

impl Error {
    /// Whether the storage failed, so that the file itself may be valid.
    pub fn is_io(&self) -> bool {
        matches!(self, Self::Io(_))
    }
}

/// The package's result.
pub type Result<T> = std::result::Result<T, Error>;
