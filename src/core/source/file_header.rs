//! The description of an input file, the same for every format.

use super::layout::Shape;
use super::parts::Part;
use super::{Advised, Parsed};
use crate::base::description::{Description, Values, with_frames};
use crate::base::error::{Error, Note, Remedy, Result};
use crate::base::grid::Grid;
use crate::base::mapped::FileBytes;
use crate::base::stored::StoredType;

const FIRST_READ: usize = 4 << 10; // bytes of a header
const MAX_HEADER: usize = 16 << 20; // bytes; a list of data files may be long

/// Spacings and origins are equal if they differ by less than this part of the spacing.
const SAME_PLACE: f64 = 1e-6;

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
    pub const SETTINGS: [&'static str; 4] = ["units", "time-units", "space-units", "calendar"];

    /// The units that are known, as settings.
    pub fn settings(&self) -> impl Iterator<Item = (&'static str, &str)> {
        let units = [&self.samples, &self.times, &self.space, &self.calendar];
        Self::SETTINGS.into_iter().zip(units).filter_map(|(name, unit)| Some((name, unit.as_deref()?)))
    }
}

/// The content of the header of one input file.
#[derive(Debug)]
pub struct FileHeader {
    /// The name of the file's format.
    pub format: &'static str,
    /// Voxels and sample type of every frame.
    pub shape: Shape,
    /// World units between voxels along x, y, z.
    pub spacing: [f64; 3],
    /// World position of the first voxel.
    pub origin: [f64; 3],
    /// Time of each frame, or empty.
    pub times: Vec<f64>,
    /// Name of the variable, if the file says so.
    pub variable: Option<String>,
    /// The units of its samples, times and places.
    pub units: Units,
    /// The value of missing samples, NaN or another, if the file declares one.
    pub missing: Option<f64>,
    /// The file's description.
    pub description: Option<Description>,
    /// Notes for the user on how the file is read.
    pub notes: Vec<Note>,
    /// Where the frames are.
    pub parts: Vec<Part>,
}

impl FileHeader {
    /// A header with nothing but frames.
    pub fn plain(shape: Shape, parts: Vec<Part>) -> Self {
        let Grid { spacing, origin, .. } = Grid::unit(shape.dims());
        let (times, units, notes) = (Vec::new(), Units::default(), Vec::new());
        let (format, variable, missing, description) = ("headerless", None, None, None);
        Self { format, shape, spacing, origin, times, variable, units, missing, description, notes, parts }
    }

    /// Number of frames.
    pub(crate) fn frames(&self) -> usize {
        self.parts.iter().map(|part| part.frames).sum()
    }

    /// Leaves out the bounds of times, which are on the file's own clock.
    pub(crate) fn drop_bounds_of_times(&mut self) {
        let Some(description) = &mut self.description else { return };
        let of_times = description.variables.iter().filter(|variable| matches!(variable.values, Values::Times(_)));
        let bounds = of_times.flat_map(|times| &times.attributes).filter(|attribute| attribute.name == "bounds");
        let names: Vec<Values> = bounds.map(|attribute| attribute.value.clone()).collect();
        description.variables.retain(|variable| !names.contains(&Values::text(&variable.name)));
    }

    /// Describes the frames as those of an archive, in which others may follow.
    pub(crate) fn stack_frames(&mut self) {
        let frames = self.frames();
        self.description = self.description.take().map(|description| with_frames(description, frames));
    }

    /// The grid of every frame.
    pub(crate) fn grid(&self) -> Grid {
        Grid { dims: self.shape.dims(), spacing: self.spacing, origin: self.origin }
    }

    /// Checks that its frames can follow those of the first file, or of the first array of a file, which messages call
    /// `name`. Returns what else does not match.
    ///
    /// # Errors
    /// Frames of another shape, variable or unit of samples or places, or where other values stand for missing samples.
    pub(crate) fn follows(&self, first: &Self, name: &str) -> Advised<Mismatch> {
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
        let counts = |file: &Self| (file.units.times.clone(), file.units.calendar.clone());
        Ok(Mismatch { grid: !self.is_placed_as(first), times: is_timed && counts(self) != counts(first) })
    }

    /// Whether voxels have the same positions as in another file, up to a small fraction of their spacing.
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
pub(crate) struct Mismatch {
    /// Its spacing or origin.
    pub(crate) grid: bool,
    /// The unit, the reference date or the calendar of times.
    pub(crate) times: bool,
}

/// Checks that a file of `len` bytes holds `frames` frames of numbers of this type from byte `start` and nothing after
/// them.
pub fn check_size(len: u64, start: u64, shape: &Shape, ty: StoredType, frames: usize) -> Parsed<()> {
    let [x, y, z] = shape.dims();
    let frame = (x * y * z) as u64 * ty.size() as u64; // fits: a sample has at least half the bytes
    let payload = frame.checked_mul(frames as u64);
    let expected = payload.and_then(|n| n.checked_add(start)).ok_or("its sizes are too large for any file")?;
    if len == expected {
        return Ok(());
    }
    let found = len.saturating_sub(start);
    let mut hint = other_sample(found, (x * y * z) as u64, frames).unwrap_or_default();
    if found > 0 && found.is_multiple_of(frame) {
        hint += &format!("; it holds exactly {} whole frame(s) of that size", found / frame);
    }
    Err(format!(
        "expected {expected} bytes ({start} before {frames} frame(s) of {x}x{y}x{z} {ty} samples), found {len}{hint}"
    ))
}

/// The sample size with which the bytes would be the expected frames.
fn other_sample(found: u64, voxels: u64, frames: usize) -> Option<String> {
    let samples = voxels * frames as u64;
    let size = [1, 2, 4, 8].into_iter().find(|size| samples.checked_mul(*size) == Some(found))?;
    Some(format!("; this size fits samples of {size} byte(s)"))
}

/// The first bytes of a file, fewer if it is shorter.
pub fn head(file: &FileBytes, bytes: usize) -> Result<Vec<u8>> {
    let len = usize::try_from(file.len()).unwrap_or(usize::MAX).min(bytes);
    let mut head = vec![0; len];
    file.read_at(0, &mut head).map_err(|e| Error::io(file.path(), "reading the header", e))?;
    Ok(head)
}

/// Reads a header of unknown length: reads more until `parse` finds its end. The flag says whether it has the whole
/// file.
pub fn growing_head<T>(file: &FileBytes, parse: impl Fn(&[u8], bool) -> Parsed<Option<T>>) -> Result<T> {
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
