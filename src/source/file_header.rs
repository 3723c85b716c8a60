//! The description of an input file, the same for every format.

use super::layout::{Layout, Shape, Strides};
use super::packing::Packing;
use super::spill_buffer::SpillBuffer;
use super::{Advised, Parsed};
use crate::base::error::{Error, Note, Remedy, Result};
use crate::base::grid::Grid;
use crate::base::mapped::{FileBytes, State};
use crate::base::sample::SampleType;
use std::fmt::Debug;
use std::ops::Range;
use std::path::{Path, PathBuf};

const FIRST_READ: usize = 4 << 10; // bytes of a header
const MAX_HEADER: usize = 16 << 20; // bytes; a list of data files may be long

/// Spacings and origins are equal if they differ by less than this part of the spacing.
const SAME_PLACE: f64 = 1e-6;

/// The files of an archive, in order.
#[derive(Debug, Default)]
pub(super) struct FrameFiles {
    /// The files, at least one, none twice.
    pub(super) paths: Vec<PathBuf>,
    /// Time of each where a list says so, else empty.
    pub(super) times: Vec<f64>,
    /// What a user should know about how they were found.
    pub(super) notes: Vec<Note>,
}

impl FrameFiles {
    /// Checks what a list says of files and times.
    pub(super) fn of_list(self) -> Parsed<Self> {
        if !self.times.is_empty() && self.times.len() != self.paths.len() {
            return Err("gives a time to some of its files only".into());
        }
        if let Some(at) = self.times.windows(2).position(|t| t[0] == t[1]) {
            return Err(format!("lists two files for the time {}; one is supported", self.times[at]));
        }
        Ok(self)
    }
}

/// Some frames in one file.
#[derive(Debug)]
pub(super) struct Part {
    /// The file.
    pub(super) path: PathBuf,
    /// Its state when it was checked.
    pub(super) state: State,
    /// Number of frames.
    pub(super) frames: usize,
    /// How they are stored, once they are decoded.
    pub(super) stored: Stored,
    /// Where they are.
    pub(super) at: DataLocation,
}

impl Part {
    /// Frames one after another from a byte of a file, x fastest.
    pub(super) fn plain(
        (path, state): (&Path, State),
        (shape, frames): (&Shape, usize),
        big_endian: bool,
        start: u64,
    ) -> Parsed<Self> {
        let stored = Stored::plain(shape, frames, big_endian)?;
        Ok(Self { path: path.into(), state, frames, stored, at: DataLocation::Byte(start) })
    }
}

/// How the samples of some frames are stored.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Stored {
    /// The type of the stored numbers.
    pub(super) sample: SampleType,
    /// Whether these have their most significant byte first.
    pub(super) big_endian: bool,
    /// Where they are.
    pub(super) strides: Strides,
    /// Bytes of all of them.
    pub(super) bytes: usize,
    /// How they become samples; None if they are the samples.
    pub(super) packing: Option<Packing>,
}

impl Stored {
    /// Samples in the order of an array, as they are.
    pub(super) fn new(layout: &Layout, sample: SampleType, big_endian: bool) -> Parsed<Self> {
        let (strides, bytes) = (layout.strides(sample.size())?, layout.bytes(sample.size())?);
        Ok(Self { sample, big_endian, strides, bytes, packing: None })
    }

    /// Frames one after another, x fastest.
    pub(super) fn plain(shape: &Shape, frames: usize, big_endian: bool) -> Parsed<Self> {
        Self::new(&Layout::plain(shape.dims(), frames), shape.sample(), big_endian)
    }
}

/// Where the bytes of a part are.
#[derive(Debug)]
pub(super) enum DataLocation {
    /// In the file as they are, from this byte.
    Byte(u64),
    /// In the file, but packed.
    Decoded(Box<dyn Decode>),
}

/// Frames that must be decoded before boxes can be read.
pub(super) trait Decode: Debug + Send {
    /// Frames whose bytes are packed together, counted from the part's first: they are decoded at once, and
    /// [`Part::stored`] is how so many lie together.
    fn together(&self) -> usize {
        1
    }

    /// Writes the bytes of `frames` that are packed together.
    ///
    /// # Errors
    /// What is wrong with the file.
    fn decode(&mut self, path: &Path, frames: Range<usize>, out: &mut SpillBuffer) -> Result<()>;

    /// Closes the file, since an archive may have more files than can be open. Decoding can still continue.
    fn rest(&mut self) {}
}

/// Units of samples, times and places, if the files have them.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Units {
    /// Unit of the samples.
    pub samples: Option<String>,
    /// Unit of times, perhaps since when.
    pub times: Option<String>,
    /// Unit of spacing and origin.
    pub space: Option<String>,
    /// The calendar of times, if it is not the usual one.
    pub calendar: Option<String>,
}

impl Units {
    /// Names of settings that units are kept under.
    pub(crate) const SETTINGS: [&'static str; 4] = ["units", "time-units", "space-units", "calendar"];

    /// The units that are known, as settings.
    pub(crate) fn settings(&self) -> impl Iterator<Item = (&'static str, &str)> {
        let units = [&self.samples, &self.times, &self.space, &self.calendar];
        Self::SETTINGS.into_iter().zip(units).filter_map(|(name, unit)| Some((name, unit.as_deref()?)))
    }
}

/// The content of the header of one input file.
#[derive(Debug)]
pub(super) struct FileHeader {
    /// What the file is, by name.
    pub(super) format: &'static str,
    /// Voxels and sample type of every frame.
    pub(super) shape: Shape,
    /// World units between voxels along x, y, z.
    pub(super) spacing: [f64; 3],
    /// World position of the first voxel.
    pub(super) origin: [f64; 3],
    /// Time of each frame, or empty.
    pub(super) times: Vec<f64>,
    /// Name of the variable, if the file says so.
    pub(super) variable: Option<String>,
    /// What its numbers are measured in.
    pub(super) units: Units,
    /// What stands for missing samples, if the file says that some may be: NaN, or another value.
    pub(super) missing: Option<f64>,
    /// What a user should know about how the file is read.
    pub(super) notes: Vec<Note>,
    /// Where the frames are.
    pub(super) parts: Vec<Part>,
}

impl FileHeader {
    /// A header with nothing but frames.
    pub(super) fn plain(shape: Shape, parts: Vec<Part>) -> Self {
        let Grid { spacing, origin, .. } = Grid::unit(shape.dims());
        let (times, units, notes) = (Vec::new(), Units::default(), Vec::new());
        Self { format: "headerless", shape, spacing, origin, times, variable: None, units, missing: None, notes, parts }
    }

    /// The lattice of every frame.
    pub(super) fn grid(&self) -> Grid {
        Grid { dims: self.shape.dims(), spacing: self.spacing, origin: self.origin }
    }

    /// Whether its frames can follow those of the first file, or of the first array of a file, which messages call
    /// `name`.
    ///
    /// # Errors
    /// Frames of another shape, variable or unit of samples or places, or where other values stand for missing samples.
    pub(super) fn follows(&self, first: &Self, name: &str) -> Advised<Mismatch> {
        let said = |text: &Option<String>| text.clone().unwrap_or_else(|| "none".into());
        let value = |missing: Option<f64>| missing.map_or_else(|| "none".into(), |value| value.to_string());
        let same = |what: &str, own: String, theirs: String| {
            if own == theirs { Ok(()) } else { Err(format!("has {what}{own}, but {name} has {theirs}")) }
        };
        same("", self.shape.to_string(), first.shape.to_string())?;
        same("the array ", said(&self.variable), said(&first.variable))
            .map_err(|e: String| Note::with(e, Remedy::ChooseVariable))?;
        same("samples in the unit ", said(&self.units.samples), said(&first.units.samples))?;
        same("places in the unit ", said(&self.units.space), said(&first.units.space))?;
        same("the missing value ", value(self.missing), value(first.missing))?;
        let is_timed = !self.times.is_empty() && !first.times.is_empty();
        Ok(Mismatch { grid: !self.is_placed_as(first), times: is_timed && self.units.times != first.units.times })
    }

    /// Whether voxels are where those of another file are, but for a small part of their distance.
    fn is_placed_as(&self, other: &Self) -> bool {
        let is_near = |a: f64, b: f64, axis: usize| (a - b).abs() <= SAME_PLACE * other.spacing[axis].abs();
        let is_same = |axis: usize| {
            is_near(self.spacing[axis], other.spacing[axis], axis)
                && is_near(self.origin[axis], other.origin[axis], axis)
        };
        (0..3).all(is_same)
    }
}

/// Differences from the first file that are allowed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Mismatch {
    /// Its spacing or origin.
    pub(super) grid: bool,
    /// What its times are measured in, or since when.
    pub(super) times: bool,
}

/// Checks that a file of `len` bytes holds `frames` frames from byte `start` and nothing after them.
pub(super) fn check_size(len: u64, start: u64, shape: &Shape, frames: usize) -> Parsed<()> {
    let frame = shape.frame_bytes() as u64;
    let payload = frame.checked_mul(frames as u64);
    let expected = payload.and_then(|n| n.checked_add(start)).ok_or("its sizes are too large for any file")?;
    if len == expected {
        return Ok(());
    }
    let found = len.saturating_sub(start);
    let mut hint = other_sample(found, shape, frames).unwrap_or_default();
    if found > 0 && found.is_multiple_of(frame) {
        hint += &format!("; it holds exactly {} whole frame(s) of that size", found / frame);
    }
    Err(format!("expected {expected} bytes ({start} before {frames} frame(s) of {shape}), found {len}{hint}"))
}

/// The sample size with which the bytes would be the expected frames.
fn other_sample(found: u64, shape: &Shape, frames: usize) -> Option<String> {
    let samples = (shape.frame_bytes() / shape.sample().size()) as u64 * frames as u64;
    let size = [1, 2, 4, 8].into_iter().find(|size| samples.checked_mul(*size) == Some(found))?;
    Some(format!("; this size fits samples of {size} byte(s)"))
}

/// The first bytes of a file, fewer if it is shorter.
pub(super) fn head(file: &FileBytes, bytes: usize) -> Result<Vec<u8>> {
    let len = usize::try_from(file.len()).unwrap_or(usize::MAX).min(bytes);
    let mut head = vec![0; len];
    file.read_at(0, &mut head).map_err(|e| Error::io(file.path(), "reading the header", e))?;
    Ok(head)
}

/// Reads a header of unknown length: reads more until `parse` finds its end. The flag says whether it has the whole
/// file.
pub(super) fn growing_head<T>(file: &FileBytes, parse: impl Fn(&[u8], bool) -> Parsed<Option<T>>) -> Result<T> {
    let mut len = FIRST_READ;
    loop {
        let bytes = head(file, len)?;
        let whole = bytes.len() as u64 == file.len();
        if let Some(header) = parse(&bytes, whole).map_err(|e| Error::input(file.path(), e))? {
            return Ok(header);
        }
        if len >= MAX_HEADER {
            return Err(Error::input(file.path(), format!("its header does not end within {MAX_HEADER} bytes")));
        }
        len *= 4;
    }
}
