//! An open coefficient file: the format's reader over a mapped file, in this library's terms.

use crate::codec::WindowCodec;
use crate::codec::decode::Block;
use crate::error::{Error, Result};
use crate::mapped::{Access, FileBytes};
use crate::sample::SampleType;
use crate::scan::join_ranges;
use crate::volume::{BlockGrid, Grid, Region};
use std::ops::Range;
use std::path::{Path, PathBuf};
use wavesplat_format::{BlockEntry, FileId, LeafEntry, Metadata, Reader};

/// An open file; several threads may read it.
#[derive(Debug)]
pub struct CoefficientFile {
    path: PathBuf,
    reader: Reader<FileBytes>,
    /// The lattice.
    pub grid: Grid,
    /// How it is cut into blocks.
    pub blocks: BlockGrid,
}

impl CoefficientFile {
    /// Opens a file: checks header, footer, metadata and directory, not yet the blocks.
    pub fn open(path: &Path, access: Access) -> Result<Self> {
        let failed = |source| Error::CoefficientFile { path: path.into(), source };
        let reader = Reader::open(FileBytes::open(path, access)?).map_err(failed)?;
        let m = reader.metadata();
        let dims = m.dims.map(|n| n as usize);
        let grid = Grid { dims, spacing: m.spacing, origin: m.origin };
        let blocks = BlockGrid { dims, edge: m.block_edge as usize };
        if m.channels != 1 {
            let what = format!("{} channels", m.channels);
            return Err(failed(wavesplat_format::Error::Unsupported(what)));
        }
        Ok(Self { path: path.into(), grid, blocks, reader })
    }

    /// Its path.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Its identity.
    pub fn id(&self) -> FileId {
        self.reader.id()
    }

    /// Its length in bytes.
    pub fn bytes(&self) -> u64 {
        self.reader.storage().len()
    }

    /// Everything about the archive but its samples.
    pub fn metadata(&self) -> &Metadata {
        self.reader.metadata()
    }

    /// The type of the samples.
    pub fn sample(&self) -> SampleType {
        self.metadata().sample
    }

    /// Number of frames.
    pub fn frames(&self) -> usize {
        self.metadata().frames as usize
    }

    /// Range of the decoded samples of all windows; (0, 0) if all are missing.
    pub fn value_range(&self) -> (f64, f64) {
        let ranges = self.metadata().windows.iter().map(|w| (w.min, w.max));
        let range = ranges.fold((f64::INFINITY, f64::NEG_INFINITY), join_ranges);
        if range.0 <= range.1 { range } else { (0.0, 0.0) }
    }

    /// Samples or coefficients, whichever are more, of the largest block.
    pub fn largest_block(&self) -> usize {
        let windows = &self.metadata().windows;
        let longest = windows.iter().map(|w| w.coefficients.max(w.frames) as usize).max().unwrap_or(0);
        self.blocks.region(0).voxels() * longest
    }

    /// Bytes that the largest block takes as it is read and refined: payload, codes, coefficients, what is missing, and
    /// what is stored exactly.
    pub fn block_bytes(&self) -> usize {
        let payload = 5;
        self.largest_block() * (payload + size_of::<i32>() + size_of::<f64>() + 1 + self.sample().size())
    }

    /// The window that holds a frame.
    pub fn window_of(&self, frame: usize) -> u32 {
        self.metadata().windows.partition_point(|w| w.first_frame as usize <= frame) as u32 - 1
    }

    /// The frames of a window.
    pub fn window_range(&self, window: u32) -> Range<usize> {
        let w = &self.metadata().windows[window as usize];
        w.first_frame as usize..w.first_frame as usize + w.frames as usize
    }

    /// What decoding a window's blocks takes.
    pub fn codec(&self, window: u32) -> Result<WindowCodec> {
        WindowCodec::of_file(self.metadata(), &self.metadata().windows[window as usize]).map_err(|e| self.failed(e))
    }

    /// The directory's leaves of a window.
    pub fn leaves(&self, window: u32) -> &[LeafEntry] {
        self.reader.leaves(window)
    }

    /// The entries of a leaf's blocks.
    pub fn leaf(&self, leaf: &LeafEntry) -> Result<Vec<BlockEntry>> {
        self.reader.leaf(leaf).map_err(|e| self.failed(e))
    }

    /// The entries of a window's blocks that touch a region, in order, a leaf of the directory at a time.
    pub fn entries<'a>(
        &'a self,
        window: u32,
        region: &'a Region,
    ) -> impl Iterator<Item = Result<Vec<BlockEntry>>> + use<'a> {
        let touches = |block: u32| !self.blocks.region(block as usize).intersect(region).is_empty();
        let leaves = self.leaves(window).iter();
        let reached = leaves.filter(move |l| (l.first_block..).take(l.count.into()).any(touches));
        reached.map(move |l| Ok(self.leaf(l)?.into_iter().filter(|entry| touches(entry.id.block)).collect()))
    }

    /// Reads the block of a directory entry, of its coefficients those that `wanted` marks.
    pub fn block(&self, codec: &WindowCodec, entry: &BlockEntry, wanted: &[bool]) -> Result<Block> {
        let size = self.blocks.region(entry.id.block as usize).dims();
        Block::read(&self.reader, codec, entry, size, wanted).map_err(|e| self.failed(e))
    }

    /// Checks that every byte of the file outside the parts is accounted for.
    pub fn check_structure(&self) -> Result<()> {
        self.reader.check_structure().map_err(|e| self.failed(e))
    }

    /// An error if the file is no longer what it was when opened.
    pub fn check_unchanged(&self) -> Result<()> {
        self.reader.storage().check_unchanged()
    }

    /// The error of a file whose parts contradict each other.
    pub fn contradiction(&self, what: String) -> Error {
        self.failed(wavesplat_format::Error::Invalid(what))
    }

    fn failed(&self, source: wavesplat_format::Error) -> Error {
        Error::CoefficientFile { path: self.path.clone(), source }
    }
}
