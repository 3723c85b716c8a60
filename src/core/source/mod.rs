//! Frames in order behind one trait, [`FrameSource`], wherever they come from.
//!
//! A source describes its [`Archive`] and returns windows of frames in order. A window copies boxes of samples. A file's
//! header says where its frames are or how to decode them (`parts`), in any order of axes (`layout`). Nothing here
//! depends on formats, wavelets or blocks: `formats` reads headers and opens files.

mod array;
mod colour_transform;
pub mod extremes;
pub mod file_header;
pub mod follow;
pub mod frames;
mod int64;
pub mod layout;
pub mod packing;
pub mod parts;
pub mod scan;
mod select;
pub mod series;
pub mod spill_buffer;
#[doc(hidden)]
pub mod testing;
pub mod times;
pub mod variables;

pub use array::ArraySource;
pub use colour_transform::ColourWindow;
pub use colour_transform::{CHANNELS, ColourTransform};
pub use file_header::Units;
pub use scan::value_range;
pub use select::{Selection, select};
pub use times::{GivenTimes, RegularTimes, with_times};
pub use variables::{VariableAxis, VariableInfo};

use crate::base::description::Description;
use crate::base::error::{Note, Result};
use crate::base::grid::{Grid, Region};
use crate::base::mapped::Access;
use crate::base::sample::SampleType;
use crate::base::time_labels::TimeLabels;
use follow::Follow;
use std::ops::Range;

/// A result for one file. The error is a text that follows the file's name.
pub type Parsed<T> = std::result::Result<T, String>;

/// As [`Parsed`], with a remedy in the error.
pub type Advised<T> = std::result::Result<T, Note>;

/// What is read of a header, besides samples and times.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Extent {
    /// Everything.
    Whole,
    /// What differs between frames: the file is not the first of an archive.
    AlongTime,
}

/// Options for opening inputs.
#[derive(Debug, Clone)]
pub struct OpenOptions {
    /// How the bytes of files are reached.
    pub access: Access,
    /// Voxels along x, y, z and, for several frames in one file, the number of frames; for headerless data only.
    pub dims: Option<Vec<usize>>,
    /// The type of the samples; for headerless data only.
    pub sample: Option<SampleType>,
    /// Whether the samples have their most significant byte first; for headerless data only.
    pub big_endian: bool,
    /// Bytes before the first sample of each file; for headerless data only.
    pub offset: u64,
    /// Whether `dims`, `sample`, `big_endian` and `offset` are those of an earlier archive. Then files with a header
    /// ignore them, and the frames of headerless data are counted again.
    pub dims_are_remembered: bool,
    /// The array of a file, or a component of one: `velocity[0]`.
    pub variable: Option<String>,
    /// Whether `variable` is that of an earlier archive. Then files with one array without a name ignore it.
    pub variable_is_remembered: bool,
    /// Variables whose squares are summed, and the sum's square root taken: the length of a vector. Empty for one
    /// variable.
    pub magnitude: Vec<String>,
    /// The meaning of each axis of an array, slowest first: letters of t z y x, or another letter for another axis.
    pub axes: Option<String>,
    /// World units between voxels along x, y, z, instead of those in the files.
    pub spacing: Option<[f64; 3]>,
    /// World position of the first voxel, instead of those in the files.
    pub origin: Option<[f64; 3]>,
    /// Times of frames, instead of those in the files.
    pub times: Option<GivenTimes>,
    /// The unit of times, perhaps since a date, instead of that in the files.
    pub time_unit: Option<String>,
    /// The calendar of `times`, if it is not the usual one.
    pub calendar: Option<String>,
    /// Units and calendar of an earlier archive. Times are converted to them where possible.
    pub clock: Option<Units>,
    /// Whether irregular numbers in the names of frame files are accepted.
    pub allow_gaps: bool,
    /// Bytes of memory for one window of a stream or of decoded frames. More go to a temporary file.
    pub memory: usize,
    /// The run that writes the inputs, if it goes on. Then frames are read as they appear, and their number is known at the end.
    pub follow: Option<Follow>,
    /// The number of sources that are read in turn, and share `memory`. 1 for one that is read alone.
    pub in_turn: usize,
}

impl Default for OpenOptions {
    /// Maps, files that describe themselves, and 256 MiB for a stream's window.
    fn default() -> Self {
        Self {
            access: Access::Map,
            dims: None,
            sample: None,
            big_endian: false,
            offset: 0,
            dims_are_remembered: false,
            variable: None,
            variable_is_remembered: false,
            magnitude: Vec::new(),
            axes: None,
            spacing: None,
            origin: None,
            times: None,
            time_unit: None,
            calendar: None,
            clock: None,
            allow_gaps: false,
            memory: 256 << 20,
            follow: None,
            in_turn: 1,
        }
    }
}

impl OpenOptions {
    /// Bytes of `memory` for the frames of a window. Those of wide samples get less, since their blocks need more of a budget; sources
    /// that are read in turn leave room for what the others keep.
    pub fn for_window(&self, sample: SampleType) -> usize {
        let memory = if self.in_turn > 1 { self.memory / 2 } else { self.memory };
        memory / (sample.size() / 2).max(1)
    }

    /// Bytes of `memory` for decoded frames that a source keeps for its next window.
    pub fn for_next_window(&self, sample: SampleType) -> usize {
        self.for_window(sample) / self.in_turn.max(1)
    }

    /// Without the options for headerless data.
    pub fn for_headers(&self) -> Self {
        Self { dims: None, sample: None, big_endian: false, offset: 0, ..self.clone() }
    }
}

/// The description of an archive, known before any frame is read.
#[derive(Debug, Clone)]
pub struct Archive {
    /// Name of the format.
    pub format: &'static str,
    /// The grid of every frame.
    pub grid: Grid,
    /// The type of every sample.
    pub sample: SampleType,
    /// Number of frames; unknown for a stream until it ends.
    pub frames: Option<usize>,
    /// Time of each frame where the files say so, else empty.
    pub times: Vec<f64>,
    /// The times of a stream whose number of frames is not known.
    pub regular_times: Option<RegularTimes>,
    /// Name of the variable where the files say so.
    pub variable: Option<String>,
    /// Units of samples, times and places.
    pub units: Units,
    /// The value of missing samples, if the files declare one: NaN, or another value.
    pub missing: Option<f64>,
    /// The files' description, if it has more than the fields above.
    pub description: Option<Description>,
    /// Bytes of [`OpenOptions::memory`] that the source takes for a window.
    pub memory: usize,
    /// Notes for the user on how the files are read.
    pub notes: Vec<Note>,
}

impl Archive {
    /// An archive without times, names and units.
    pub fn new(grid: Grid, sample: SampleType, frames: Option<usize>) -> Self {
        let (times, units, notes) = (Vec::new(), Units::default(), Vec::new());
        let (format, regular_times, variable) = ("frames", None, None);
        let (missing, description, memory) = (None, None, 0);
        Self {
            format,
            grid,
            sample,
            frames,
            times,
            regular_times,
            variable,
            units,
            missing,
            description,
            memory,
            notes,
        }
    }

    /// Whether frames have times.
    pub fn has_times(&self) -> bool {
        !self.times.is_empty() || self.regular_times.is_some()
    }

    /// The times of some frames; empty if they have none.
    pub fn times_of(&self, frames: Range<usize>) -> Vec<f64> {
        match self.regular_times {
            Some(times) => times.times(frames),
            None => self.times.get(frames).unwrap_or_default().to_vec(),
        }
    }

    /// Whether the times of its first `frames` frames, as far as they are known, are these; true if neither has times.
    pub fn begins_with_times(&self, times: &[f64], frames: usize) -> bool {
        let count = frames.min(self.frames.unwrap_or(usize::MAX));
        let own = self.times_of(0..count);
        let times = &times[..times.len().min(count)];
        let is_long = match self.frames {
            Some(_) => own.len() == times.len(),
            None => own.is_empty() == times.is_empty(), // more may come
        };
        is_long && own.iter().zip(times).all(|(own, time)| own.to_bits() == time.to_bits())
    }

    /// The times of the frames, and how they are written.
    pub fn time_labels(&self) -> TimeLabels {
        let Units { times, calendar, .. } = &self.units;
        let all = self.frames.map_or_else(|| self.times.clone(), |frames| self.times_of(0..frames));
        TimeLabels::new(all, times.as_deref(), calendar.as_deref())
    }

    /// The value that stands for missing samples besides NaN and infinities: the one that is `given`, or that of the
    /// files.
    pub fn missing_value(&self, given: Option<f64>) -> Option<f64> {
        given.or(self.missing.filter(|value| value.is_finite()))
    }
}

/// Frames in order, a window at a time.
pub trait FrameSource: Send {
    /// The description of the archive. Of one that grows, it is complete once a window ends before it is full.
    fn archive(&self) -> &Archive;

    /// The `count` frames from `first`; fewer only if a stream ends there, then possibly none.
    ///
    /// Streams can only go forward: `first` must be where the last window ended, or later.
    fn window(&mut self, first: usize, count: usize) -> Result<Box<dyn FrameWindow>>;

    /// As [`Self::window`], of every `step`-th frame from `first`, `count` of them. Most sources do not read the
    /// frames between them.
    fn window_of(&mut self, first: usize, count: usize, step: usize) -> Result<Box<dyn FrameWindow>> {
        let window = self.window(first, (count.max(1) - 1) * step + 1)?;
        Ok(select::stepped(window, count, step))
    }
}

/// The samples of a region of some frames of a window, frame after frame, each of `ty.size()` bytes. `ty` must be the
/// sample type of the window's archive.
///
/// # Errors
/// The source cannot be read, or changed while it was read.
pub fn read_frames(
    window: &dyn FrameWindow,
    frames: impl ExactSizeIterator<Item = usize>,
    region: &Region,
    ty: SampleType,
) -> Result<Vec<u8>> {
    let frame_bytes = region.voxels() * ty.size();
    let mut samples = vec![0; frame_bytes * frames.len()];
    read_frames_into(window, frames, region, &mut samples)?;
    Ok(samples)
}

/// As [`read_frames`], into `samples`, which must have the length of its result.
pub fn read_frames_into(
    window: &dyn FrameWindow,
    frames: impl ExactSizeIterator<Item = usize>,
    region: &Region,
    samples: &mut [u8],
) -> Result<()> {
    if samples.is_empty() {
        return Ok(());
    }
    let frame_bytes = samples.len() / frames.len();
    for (frame, bytes) in frames.zip(samples.chunks_exact_mut(frame_bytes)) {
        window.read_box(frame, region, bytes)?;
    }
    Ok(())
}

/// Copies a region of a frame on `grid`, whose samples of `size` bytes are in memory, x fastest: what [`FrameWindow::read_box`] does.
pub fn copy_box(frame: &[u8], grid: &Grid, size: usize, region: &Region, out: &mut [u8]) {
    let (whole, row) = (grid.whole(), (region.dims()[0] * size).max(1));
    for ((y, z), out) in region.rows().zip(out.chunks_exact_mut(row)) {
        let start = whole.index([region.start[0], y, z]) * size;
        out.copy_from_slice(&frame[start..start + row]);
    }
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

    /// An error if a file of the window has changed since it was opened.
    fn check_unchanged(&self) -> Result<()>;
}
