//! Frame files in: one source per format behind one trait.
//!
//! A source says what an archive holds ([`Archive`]) and hands out windows of frames in order; a window copies boxes
//! of samples out. Nothing here knows of wavelets or blocks. [`open`] chooses the source by name and content.

use crate::error::Result;
use crate::sample::SampleType;
use crate::volume::{Grid, Region};

/// What an archive holds, known before any frame is read.
#[derive(Debug, Clone)]
pub struct Archive {
    /// The lattice of every frame.
    pub grid: Grid,
    /// The type of every sample.
    pub sample: SampleType,
    /// Number of frames; unknown for a stream until it ends.
    pub frames: Option<usize>,
    /// Time of each frame where the files say so, else empty.
    pub times: Vec<f64>,
    /// Name of the variable where the files say so.
    pub variable: Option<String>,
    /// What a user should know about how the files are read.
    pub notes: Vec<String>,
}

/// Frames in order, a window at a time.
pub trait FrameSource: Send {
    /// What the archive holds.
    fn archive(&self) -> &Archive;

    /// The `count` frames from `first`; fewer only if a stream ends there, then possibly none.
    ///
    /// Streams can only go forward: `first` must be where the last window ended, or later.
    fn window(&mut self, first: usize, count: usize) -> Result<Box<dyn FrameWindow>>;
}

/// Some consecutive frames, readable from several threads.
pub trait FrameWindow: Send + Sync {
    /// Number of frames.
    fn frames(&self) -> usize;

    /// Copies the samples of a region of one frame (counted from the window's first) into `out`:
    /// little-endian, x fastest, `region.voxels() * sample.size()` bytes.
    fn read_box(&self, frame: usize, region: &Region, out: &mut [u8]) -> Result<()>;

    /// The name of a frame for messages: its file, and its place there.
    fn name(&self, frame: usize) -> String;

    /// An error if a file of the window is no longer what it was when opened.
    fn check_unchanged(&self) -> Result<()>;
}
