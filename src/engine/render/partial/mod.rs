//! Files of partial sums, each over some of the voxels or frames; and pictures made from such files.
//!
//! A file of partial sums is small, however large its archive is: a number or two for each pixel and frame. Numbers are
//! little-endian.
//!
//! ```text
//! 8 bytes      89 57 50 41 52 54 0d 0a, the magic
//! records      zstd frames one after another: 64-bit floats, plane after plane, row by row
//! head         a zstd frame of JSON: Head. It says where the records lie, and the XXH3-64 of each
//! 40 bytes     offset of the head, its packed bytes, its bytes, the XXH3-64 of its packed bytes; the magic again
//! ```
//!
//! A record holds the weights of a view; or of a picture the emissions of each channel, each followed by the weights of its
//! missing samples if there are any. Parts are added in the order of their voxels, in whatever order they are given.

mod head;
mod write;
mod read;
mod total;

pub use head::{Head, PartialSource, PictureSetup};
pub use read::{PartialFile, is_partial};
pub use total::PartialTotal;
pub use write::PartialWriter;

const MAGIC: [u8; 8] = *b"\x89WPART\r\n";

/// Bytes after the head.
const END: usize = 40;
