//! Where the frames of a file are: stored uncompressed, or to be decoded first.

use super::Parsed;
use super::layout::{Layout, Strides};
use super::packing::Packing;
use super::spill_buffer::SpillBuffer;
use crate::base::error::Result;
use crate::base::mapped::State;
use crate::base::stored::StoredType;
use std::fmt::Debug;
use std::ops::Range;
use std::path::{Path, PathBuf};

/// Some frames in one file.
#[derive(Debug)]
pub struct Part {
    /// The file.
    pub path: PathBuf,
    /// Its state when it was checked.
    pub state: State,
    /// Number of frames.
    pub frames: usize,
    /// How they are stored, once they are decoded.
    pub stored: Stored,
    /// Where the bytes begin.
    pub at: DataLocation,
}

/// How the samples of some frames are stored.
#[derive(Debug, Clone, PartialEq)]
pub struct Stored {
    /// The type of the stored numbers.
    pub ty: StoredType,
    /// Whether these have their most significant byte first.
    pub big_endian: bool,
    /// Byte steps between voxels and frames.
    pub strides: Strides,
    /// Bytes of all of them.
    pub bytes: usize,
    /// How they become samples; None if they are the samples.
    pub packing: Option<Packing>,
}

impl Stored {
    /// Samples in the order of an array, not packed.
    pub fn new(layout: &Layout, ty: impl Into<StoredType>, big_endian: bool) -> Parsed<Self> {
        let ty = ty.into();
        let (strides, bytes) = (layout.strides(ty.size())?, layout.bytes(ty.size())?);
        Ok(Self { ty, big_endian, strides, bytes, packing: None })
    }

    /// Frames one after another, x fastest.
    pub fn plain(dims: [usize; 3], frames: usize, ty: impl Into<StoredType>, big_endian: bool) -> Parsed<Self> {
        Self::new(&Layout::plain(dims, frames), ty, big_endian)
    }
}

/// Where the bytes of a part are.
#[derive(Debug)]
pub enum DataLocation {
    /// Uncompressed in the file, from this byte.
    Byte(u64),
    /// In the file, but packed.
    Decoded(Box<dyn Decode>),
}

/// Frames that must be decoded before boxes can be read.
pub trait Decode: Debug + Send {
    /// Frames that are packed together and decoded at once, counted from the part's first. [`Part::stored`] describes
    /// this many.
    fn frames_per_chunk(&self) -> usize {
        1
    }

    /// Writes the bytes of `frames` that are packed together.
    ///
    /// # Errors
    /// What is wrong with the file.
    fn decode(&mut self, path: &Path, frames: Range<usize>, out: &mut SpillBuffer) -> Result<()>;

    /// Closes the file, since an archive may have more files than can be open. Decoding can still continue.
    fn close_file(&mut self) {}
}
