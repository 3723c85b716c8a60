//! Files as one archive: whatever the format, a file comes down to frames one after another at a known place.

use super::Parsed;
use super::frames::{Bytes, Frame, Frames, Shape};
use super::inputs::Files;
use super::{Archive, FrameSource, FrameWindow, OpenOptions, base64, format};
use crate::error::{Error, Result};
use crate::mapped::{Access, FileBytes};
use crate::volume::Grid;
use std::ops::Range;
use std::path::{Path, PathBuf};

/// Some frames in one file, one after another.
#[derive(Debug)]
pub(super) struct Part {
    /// The file.
    pub(super) path: PathBuf,
    /// Its length in bytes when it was checked.
    pub(super) len: u64,
    /// Number of frames.
    pub(super) frames: usize,
    /// Whether its samples have their most significant byte first.
    pub(super) big_endian: bool,
    /// Where the first frame starts.
    pub(super) at: At,
}

/// How a part's samples are stored.
#[derive(Debug, Clone, Copy)]
pub(super) enum At {
    /// As they are, from this byte of the file.
    Byte(u64),
    /// As base64 text.
    Base64(base64::Place),
}

/// What the header of one input file says.
#[derive(Debug)]
pub(super) struct Described {
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
    /// What a user should know about how the file is read.
    pub(super) notes: Vec<String>,
    /// Where the frames are.
    pub(super) parts: Vec<Part>,
}

impl Described {
    /// Frames of which no more is known than where they are.
    pub(super) fn plain(shape: Shape, parts: Vec<Part>) -> Self {
        let Grid { spacing, origin, .. } = Grid::unit(shape.dims());
        Self { shape, spacing, origin, times: Vec::new(), variable: None, notes: Vec::new(), parts }
    }

    fn grid(&self) -> Grid {
        Grid { dims: self.shape.dims(), spacing: self.spacing, origin: self.origin }
    }
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
    Some(format!("; that would be right for samples of {size} byte(s)"))
}

/// Files whose frames follow one another.
#[derive(Debug)]
pub(super) struct Series {
    archive: Archive,
    shape: Shape,
    access: Access,
    parts: Vec<Part>,
    starts: Vec<usize>, // the first frame of each part
}

impl Series {
    /// Reads the header of every file.
    pub(super) fn open(files: &Files, options: &OpenOptions) -> Result<Self> {
        let Some((first, rest)) = files.paths.split_first() else {
            return Err(Error::usage("no input was given"));
        };
        let mut series = Self::of(format::describe(first, options)?, options);
        for path in rest {
            series.append(format::describe(path, options)?, path, first)?;
        }
        series.finish(files, options)
    }

    fn of(first: Described, options: &OpenOptions) -> Self {
        let mut archive = Archive {
            grid: first.grid(),
            sample: first.shape.sample(),
            frames: Some(0),
            times: Vec::new(),
            variable: first.variable.clone(),
            notes: Vec::new(),
        };
        override_grid(&mut archive.grid, options);
        let shape = first.shape;
        let mut series = Self { archive, shape, access: options.access, parts: Vec::new(), starts: Vec::new() };
        series.take(first);
        series
    }

    fn take(&mut self, file: Described) {
        self.archive.times.extend(file.times);
        for note in file.notes {
            note_once(&mut self.archive.notes, note);
        }
        for part in file.parts {
            let frames = self.archive.frames.unwrap_or(0);
            self.starts.push(frames);
            self.archive.frames = frames.checked_add(part.frames);
            self.parts.push(part);
        }
    }

    fn append(&mut self, file: Described, path: &Path, first: &Path) -> Result<()> {
        let first = first.display();
        if file.shape != self.shape {
            let what = format!("has {}, but the first frame ({first}) has {}", file.shape, self.shape);
            return Err(Error::input(path, what));
        }
        if file.variable != self.archive.variable {
            let name = |v: &Option<String>| v.clone().unwrap_or_else(|| "without a name".into());
            let (its, theirs) = (name(&file.variable), name(&self.archive.variable));
            let what =
                format!("has the array {its}, but the first frame ({first}) has {theirs}; --variable chooses one");
            return Err(Error::input(path, what));
        }
        self.take(file);
        Ok(())
    }

    fn finish(mut self, files: &Files, options: &OpenOptions) -> Result<Self> {
        for note in &files.notes {
            note_once(&mut self.archive.notes, note.clone());
        }
        let Some(frames) = self.archive.frames else {
            return Err(Error::usage("the inputs have too many frames to count"));
        };
        if frames == files.times.len() {
            self.archive.times.clone_from(&files.times);
        }
        if self.archive.times.len() != frames {
            self.archive.times.clear();
        }
        check_grid(&self.archive.grid, options, &files.paths[0])?;
        Ok(self)
    }

    /// The bytes of one part, opened for a window that is done with them soon.
    fn bytes(&self, part: &Part) -> Result<Bytes> {
        let access = if matches!(part.at, At::Byte(_)) { self.access } else { Access::Read };
        let file = FileBytes::open(&part.path, access)?;
        if file.len() != part.len {
            let what = format!("had {} bytes when it was first looked at, now {}", part.len, file.len());
            return Err(Error::Changed { path: part.path.clone(), what });
        }
        match part.at {
            At::Byte(_) => Ok(Bytes::File(file)),
            At::Base64(place) => {
                let data = place.decode(&file, self.shape.frame_bytes())?;
                Ok(Bytes::Decoded { file, data })
            }
        }
    }

    fn frame(&self, part: &Part, index: usize, bytes: usize) -> Frame {
        let start = if let At::Byte(start) = part.at { start } else { 0 };
        let offset = start + (index * self.shape.frame_bytes()) as u64;
        let path = part.path.display();
        let name = if part.frames == 1 { path.to_string() } else { format!("{path}, frame {index}") };
        Frame { bytes, offset, big_endian: part.big_endian, name }
    }

    /// The parts that hold frames of a range.
    fn parts_of(&self, frames: &Range<usize>) -> Range<usize> {
        let first = self.starts.partition_point(|s| *s <= frames.start).saturating_sub(1);
        first..self.starts.partition_point(|s| *s < frames.end).max(first)
    }
}

impl FrameSource for Series {
    fn archive(&self) -> &Archive {
        &self.archive
    }

    fn window(&mut self, first: usize, count: usize) -> Result<Box<dyn FrameWindow>> {
        let all = self.archive.frames.unwrap_or(0);
        let Some(end) = first.checked_add(count).filter(|end| *end <= all) else {
            return Err(Error::usage(format!("{count} frame(s) from {first} were asked for, but there are {all}")));
        };
        let mut window = Frames { shape: self.shape, bytes: Vec::new(), frames: Vec::new() };
        let parts = if count == 0 { 0..0 } else { self.parts_of(&(first..end)) };
        for (part, start) in self.parts[parts.clone()].iter().zip(&self.starts[parts]) {
            let wanted = first.saturating_sub(*start)..(end - start).min(part.frames);
            window.frames.extend(wanted.map(|i| self.frame(part, i, window.bytes.len())));
            window.bytes.push(self.bytes(part)?);
        }
        Ok(Box::new(window))
    }
}

fn note_once(notes: &mut Vec<String>, note: String) {
    if !notes.contains(&note) {
        notes.push(note);
    }
}

/// Puts the user's spacing and origin in place of the files'.
pub(super) fn override_grid(grid: &mut Grid, options: &OpenOptions) {
    grid.spacing = options.spacing.unwrap_or(grid.spacing);
    grid.origin = options.origin.unwrap_or(grid.origin);
}

/// Refuses a grid that cannot be drawn.
pub(super) fn check_grid(grid: &Grid, options: &OpenOptions, path: &Path) -> Result<()> {
    if grid.spacing.iter().any(|s| !(s.is_finite() && *s > 0.0)) {
        let what = format!("the spacing {:?} is not positive", grid.spacing);
        return Err(match options.spacing {
            Some(_) => Error::usage(what),
            None => Error::input(path, format!("{what}; --spacing gives another")),
        });
    }
    if grid.origin.iter().any(|o| !o.is_finite()) {
        let what = format!("the origin {:?} is not finite", grid.origin);
        return Err(match options.origin {
            Some(_) => Error::usage(what),
            None => Error::input(path, format!("{what}; --origin gives another")),
        });
    }
    Ok(())
}

#[cfg(test)]
mod tests;
