//! The bytes of a wavesplat coefficient file (`.wspl`).
//!
//! `FORMAT.md` beside this package specifies the format. This package handles bytes only: it starts no threads, opens
//! no paths and maps no memory. It reads through [`Storage`] and writes to any `std::io::Write` without seeking.
#![forbid(unsafe_code)]

mod arithmetic;
mod bits;
mod block;
mod bytes;
mod codes;
mod description;
mod directory;
mod error;
mod file_id;
mod footer;
mod geometry;
mod header;
mod keep;
mod leaf;
pub mod limits;
mod listed;
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
mod sides;
mod storage;
mod structure;
mod sums;
#[cfg(test)]
mod testing;
#[cfg(test)]
mod tests;
mod prefix;
mod window;
mod writer;
mod bare;

pub use arithmetic::{BitDecoder, BitEncoder, Chance};
pub use bare::{from_bare, to_bare};
pub use block::{BlockId, BlockStats, Compressor, EncodedBlock, EncodedPart, PartKind, PartStats};
pub use codes::max_packed;
pub use codes::sparse::{CodeBox, DenseCodes, Places, SparseCodes};
pub use description::{
    ArrayAxis, Attribute, AxisRole, Description, Dimension, NumberType, Numbers, Orientation, Values, Variable,
};
pub use directory::{BlockEntry, PartEntry};
pub use error::{Error, Result};
pub use file_id::FileId;
pub use geometry::BlockGeometry;
pub use header::Features;
pub use keep::{Derivative, DerivativeBound, Keep, RelativeBound};
pub use leaf::LeafEntry;
pub use listed::{Listed, unpack_listed};
pub use metadata::{Bound, Metadata};
pub use payload::{
    Outliers, pack_codes, pack_exact, pack_missing, pack_outliers, unpack_codes, unpack_exact, unpack_missing,
    unpack_outliers,
};
pub use prefix::CompletePrefix;
pub use pyramid::{Axis, Packing, Pass, PassBox, Pyramid, Stencil};
pub use reader::Reader;
pub use recovery::{Recovered, Recovery};
pub use sample::SampleType;
pub use sides::{Side, SideCodes, SideSet, pack_sides, unpack_sides};
pub use storage::Storage;
pub use sums::{SumCodes, most_unshifted, pack_sums, unpack_sums};
pub use window::{Basis, Window, WindowEnd, WindowRecord};
pub use writer::{Summary, Writer};
