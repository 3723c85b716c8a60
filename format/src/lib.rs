//! The bytes of a wavesplat coefficient file (`.wspl`).
//!
//! `FORMAT.md` beside this package specifies the format. This package handles bytes only: it starts no threads, opens
//! no paths and maps no memory. It reads through [`Storage`] and writes to any `std::io::Write` without seeking.
#![forbid(unsafe_code)]

mod bits;
mod block;
mod bytes;
mod cells;
mod directory;
mod error;
mod file_id;
mod footer;
mod geometry;
mod header;
mod leaf;
pub mod limits;
mod metadata;
pub mod payload;
mod planes;
mod pyramid;
mod rans;
mod reader;
mod record;
mod recovery;
mod sample;
mod section;
mod segments;
mod structure;
#[cfg(test)]
mod testing;
#[cfg(test)]
mod tests;
mod prefix;
mod window;
mod writer;

pub use block::{BlockId, BlockStats, Compressor, EncodedBlock, EncodedPart, PartKind, PartStats};
pub use cells::{estimate_cells, max_packed, pack_cells, unpack_cells};
pub use directory::{BlockEntry, PartEntry};
pub use error::{Error, Result};
pub use file_id::FileId;
pub use geometry::BlockGeometry;
pub use leaf::LeafEntry;
pub use metadata::{Bound, Metadata};
pub use payload::{
    Outliers, pack_codes, pack_exact, pack_missing, pack_outliers, unpack_codes, unpack_exact, unpack_missing,
    unpack_outliers,
};
pub use prefix::CompletePrefix;
pub use pyramid::{Axis, Pass, Pyramid, Stencil};
pub use reader::Reader;
pub use recovery::{Recovered, Recovery};
pub use sample::SampleType;
pub use window::{Basis, Window, WindowEnd, WindowRecord};
pub use writer::{Summary, Writer};

use std::io;

/// The bytes of a file: a source of known length that can be read at any offset.
pub trait Storage {
    /// Length in bytes.
    fn len(&self) -> u64;

    /// Whether there are no bytes.
    fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Copies `out.len()` bytes starting at `offset`.
    ///
    /// # Errors
    /// The bytes end before `offset + out.len()`, or the storage fails.
    fn read_at(&self, offset: u64, out: &mut [u8]) -> io::Result<()>;
}

impl Storage for [u8] {
    fn len(&self) -> u64 {
        <[u8]>::len(self) as u64
    }

    fn read_at(&self, offset: u64, out: &mut [u8]) -> io::Result<()> {
        let bytes = usize::try_from(offset).ok().and_then(|o| self.get(o..)?.get(..out.len()));
        let Some(bytes) = bytes else { return Err(io::ErrorKind::UnexpectedEof.into()) };
        out.copy_from_slice(bytes);
        Ok(())
    }
}

impl Storage for Vec<u8> {
    fn len(&self) -> u64 {
        Storage::len(self.as_slice())
    }

    fn read_at(&self, offset: u64, out: &mut [u8]) -> io::Result<()> {
        self.as_slice().read_at(offset, out)
    }
}

impl<S: Storage + ?Sized> Storage for &S {
    fn len(&self) -> u64 {
        S::len(self)
    }

    fn read_at(&self, offset: u64, out: &mut [u8]) -> io::Result<()> {
        S::read_at(self, offset, out)
    }
}
