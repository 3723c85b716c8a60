//! The bytes of a wavesplat coefficient file (`.wspl`).
//!
//! `FORMAT.md` beside this package specifies them. This package knows bytes only: it starts no thread, opens no path
//! and maps no memory; it reads through [`Storage`] and writes to any `std::io::Write` without a seek.
#![forbid(unsafe_code)]

mod bits;
mod block;
mod bytes;
mod cells;
mod directory;
mod error;
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
mod salvage;
mod sample;
mod section;
mod segments;
mod storage;
mod structure;
#[cfg(test)]
mod testing;
#[cfg(test)]
mod tests;
mod unfinished;
mod window;
mod writer;

pub use block::{BlockId, BlockStats, Compressor, EncodedBlock, EncodedPart, PartKind, PartStats};
pub use cells::{estimate_cells, max_packed, pack_cells, unpack_cells};
pub use directory::{BlockEntry, PartEntry};
pub use error::{Error, Result};
pub use geometry::BlockGeometry;
pub use header::FileId;
pub use leaf::LeafEntry;
pub use metadata::{Bound, Metadata};
pub use payload::{
    Outliers, pack_codes, pack_exact, pack_missing, pack_outliers, unpack_codes, unpack_exact, unpack_missing,
    unpack_outliers,
};
pub use pyramid::{Axis, Pass, Pyramid, Stencil};
pub use reader::Reader;
pub use salvage::{Salvage, Salvaged};
pub use sample::SampleType;
pub use storage::{ReadAhead, Storage, read_joined};
pub use unfinished::Unfinished;
pub use window::{Basis, Window, WindowEnd, WindowRecord};
pub use writer::{Summary, Writer};
