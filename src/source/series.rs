//! Files as one archive: whatever the format, a file comes down to frames one after another at a known place.

use super::described::{At, Described, Files, Part};
use super::frames::{Bytes, Frame, Frames, Shape};
use super::{Archive, FrameSource, FrameWindow, OpenOptions, format};
use crate::error::{Error, Result};
use crate::mapped::{Access, FileBytes};
use crate::volume::Grid;
use std::ops::Range;
use std::path::Path;

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
        part.state.check(&part.path, &file.state())?;
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
