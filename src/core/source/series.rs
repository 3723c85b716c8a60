//! Several files of any format as one archive.

mod builder;

use super::file_header::FileHeader;
use super::frames::{Bytes, Frame, Frames};
use super::layout::Shape;
use super::parts::{DataLocation, Part};
use super::spill_buffer::{SpillBuffer, Spool};
use super::{Archive, Extent, FrameSource, FrameWindow, OpenOptions, Parsed, times};
use crate::base::description::{Description, Values, extended, is_of, joined};
use crate::base::error::{Error, Note, Remedy, Result};
use crate::base::grid::Grid;
use crate::base::mapped::{Access, FileBytes};
pub use builder::SeriesBuilder;
use rayon::prelude::*;
use std::mem;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// The files of an archive, in order.
#[derive(Debug, Default, Clone)]
pub struct FrameFiles {
    /// The files, at least one, none twice.
    pub paths: Vec<PathBuf>,
    /// Time of each where a list says so, else empty.
    pub times: Vec<f64>,
    /// Notes for the user on how the files were found.
    pub notes: Vec<Note>,
}

impl FrameFiles {
    /// An error if a list contradicts itself in its times.
    pub fn checked(self) -> Parsed<Self> {
        if !self.times.is_empty() && self.times.len() != self.paths.len() {
            return Err("gives a time to some of its files only".into());
        }
        if let Some(at) = self.times.windows(2).position(|t| t[0] == t[1]) {
            return Err(format!("lists two files for the time {}; one is supported", self.times[at]));
        }
        Ok(self)
    }
}

/// Files whose frames follow one another.
#[derive(Debug)]
pub struct Series {
    archive: Archive,
    shape: Shape,
    access: Access,
    memory: usize, // that a window may hold of what is decoded
    kept: usize,   // bytes of it that may stay for the next window
    parts: Vec<Part>,
    starts: Vec<usize>, // the first frame of each part
    last: Option<Decoded>,
}

/// The frames that were decoded last. The next window may have frames of the same group.
#[derive(Debug)]
struct Decoded {
    part: usize,
    /// The first of its frames, counted from the part's.
    first: usize,
    data: Arc<SpillBuffer>,
}

/// Frames of a part, and the bytes that they are in.
struct Found {
    from: PartStart,
    frames: Vec<usize>,
    bytes: FoundBytes,
}

enum FoundBytes {
    File(FileBytes),
    Decoded(Arc<SpillBuffer>),
    /// Empty: the frames from the first on that are packed together go there.
    ToDecode(SpillBuffer),
}

/// The most parts that are decoded at a time: each takes some memory for it.
const TOGETHER: usize = 4;

/// A frame of a part, and the byte at which it begins where its samples are.
#[derive(Clone, Copy)]
struct PartStart {
    frame: usize,
    byte: u64,
}

impl Series {
    /// Reads the header of every file by `describe`.
    pub fn open(
        files: &FrameFiles,
        options: &OpenOptions,
        describe: impl Fn(&Path, Extent) -> Result<FileHeader>,
    ) -> Result<Self> {
        let Some((first, rest)) = files.paths.split_first() else {
            return Err(Error::setting("inputs", "no input was given"));
        };
        let mut series = SeriesBuilder::begin(first, describe(first, Extent::Whole)?, rest.is_empty(), options);
        for path in rest {
            series.add(path, describe(path, Extent::AlongTime)?)?;
        }
        series.finish(files)
    }

    /// The frames that one header describes. Messages call where they are from `name`.
    pub fn single(mut header: FileHeader, name: &Path, options: &OpenOptions) -> Result<Self> {
        if header.parts.len() > 1 {
            header.stack_frames();
        }
        header = on_grid_of_user(header, options);
        let files = FrameFiles { paths: vec![name.into()], times: Vec::new(), notes: Vec::new() };
        Self::starting_with(&mut header, options).finish(&files, None, options)
    }

    fn starting_with(first: &mut FileHeader, options: &OpenOptions) -> Self {
        let archive = Archive {
            variable: first.variable.clone(),
            units: first.units.clone(),
            missing: first.missing,
            format: first.format,
            description: first.description.take(),
            ..Archive::new(first.grid(), first.shape.sample(), Some(0))
        };
        let (shape, parts, starts) = (first.shape, Vec::new(), Vec::new());
        let (access, sample) = (options.access, first.shape.sample());
        let (memory, kept) = (options.for_window(sample), options.for_next_window(sample));
        let mut series = Self { archive, shape, access, memory, kept, parts, starts, last: None };
        series.take(first);
        series
    }

    /// Takes the frames of a file, with their times and the notes on them.
    fn take(&mut self, file: &mut FileHeader) {
        self.archive.times.extend(&file.times);
        for note in mem::take(&mut file.notes) {
            note_once(&mut self.archive.notes, note);
        }
        for part in mem::take(&mut file.parts) {
            let frames = self.archive.frames.unwrap_or(0);
            self.starts.push(frames);
            self.archive.frames = self.archive.frames.and_then(|_| frames.checked_add(part.frames));
            if matches!(part.at, DataLocation::Decoded(_)) {
                self.archive.memory = self.memory;
            }
            self.parts.push(part);
        }
    }

    /// Adds what later files say of their frames, one for each file.
    fn describe_more(&mut self, more: Vec<Option<Description>>) {
        if more.is_empty() {
            return;
        }
        let Some(first) = self.archive.description.take() else { return };
        let (all, lost) = match more.into_iter().collect::<Option<Vec<_>>>() {
            Some(more) => joined(first, &more),
            None => extended(first, self.archive.frames.unwrap_or(0) as u64),
        };
        self.archive.description = Some(all);
        for name in lost {
            note_once(
                &mut self.archive.notes,
                format!("{name} is not kept: not every file has it in the same form, or it is too large"),
            );
        }
    }

    fn finish(mut self, files: &FrameFiles, timed_otherwise: Option<String>, options: &OpenOptions) -> Result<Self> {
        for note in &files.notes {
            note_once(&mut self.archive.notes, note.clone());
        }
        let Some(frames) = self.archive.frames else {
            return Err(Error::setting("inputs", "they have too many frames to count"));
        };
        if frames == files.times.len() {
            self.archive.times.clone_from(&files.times);
        } else if let Some(why) = timed_otherwise.filter(|_| options.times.is_none()) {
            self.drop_times(&why);
        }
        if self.archive.times.len() != frames {
            if !self.archive.times.is_empty() && options.times.is_none() {
                note_once(&mut self.archive.notes, "some frames have no time: frames are numbered");
            }
            self.archive.times.clear();
        }
        times::settle(&mut self.archive, options)?;
        self.check_times();
        let are_of_files = !self.archive.times.is_empty() && options.times.is_none() && options.time_unit.is_none();
        if let Some(description) = self.archive.description.as_mut().filter(|_| !are_of_files) {
            description.variables.retain(|variable| !matches!(variable.values, Values::Times(_)));
        }
        self.check_description();
        check_grid(&self.archive.grid, options, &files.paths[0])?;
        Ok(self)
    }

    /// Drops a description that is too large for a coefficient file, or of an array with other axes than the archive.
    fn check_description(&mut self) {
        let (dims, frames) = (self.archive.grid.dims, self.archive.frames.unwrap_or(0));
        if self.archive.description.as_ref().is_some_and(|description| !is_of(description, dims, frames)) {
            self.archive.description = None;
            note_once(
                &mut self.archive.notes,
                "coordinates and attributes are not kept: frames are not those of the array",
            );
        }
        if let Some(Err(error)) = self.archive.description.as_ref().map(Description::check_size) {
            self.archive.description = None;
            note_once(&mut self.archive.notes, format!("coordinates and attributes are not kept: {error}"));
        }
    }

    /// Drops times that are not finite, and adds a note on times that do not ascend.
    fn check_times(&mut self) {
        let times = &self.archive.times;
        if !times.iter().all(|t| t.is_finite()) {
            self.drop_times("times are not all finite");
        } else if times.windows(2).any(|t| t[1] <= t[0]) {
            let what = "the times do not ascend; frames are taken in the order of the files, or of the list of them";
            note_once(&mut self.archive.notes, what);
        }
    }

    /// Drops the times and their unit.
    fn drop_times(&mut self, why: &str) {
        self.archive.times.clear();
        (self.archive.units.times, self.archive.units.calendar) = (None, None);
        note_once(&mut self.archive.notes, format!("{why}: frames are numbered"));
    }

    /// Where some frames of a part, ascending, are or will be decoded to. `used` bytes of memory are taken.
    fn find(&mut self, part: usize, wanted: &[usize], used: &mut usize, spool: &mut Spool) -> Result<Vec<Found>> {
        let Part { path, state, at, .. } = &self.parts[part];
        let together = match at {
            DataLocation::Byte(start) => {
                let file = FileBytes::open(path, self.access)?;
                state.check(path, &file.state())?;
                let from = PartStart { frame: 0, byte: *start };
                return Ok(vec![Found { from, frames: wanted.to_vec(), bytes: FoundBytes::File(file) }]);
            }
            DataLocation::Decoded(decoder) => decoder.frames_per_chunk(),
        };
        state.check_path(path)?;
        let groups = wanted.chunk_by(|a, b| a / together == b / together);
        groups.map(|frames| self.find_decoded(part, frames, together, used, spool)).collect()
    }

    /// Where some of the frames that are packed together are decoded to: in memory if there is room.
    fn find_decoded(
        &mut self,
        part: usize,
        frames: &[usize],
        together: usize,
        used: &mut usize,
        spool: &mut Spool,
    ) -> Result<Found> {
        let first = frames[0] - frames[0] % together;
        let (from, frames) = (PartStart { frame: first, byte: 0 }, frames.to_vec());
        if let Some(last) = self.last.as_ref().filter(|last| (last.part, last.first) == (part, first)) {
            *used += last.data.memory();
            return Ok(Found { from, frames, bytes: FoundBytes::Decoded(last.data.clone()) });
        }
        self.last = None;
        let Part { path, stored, .. } = &self.parts[part];
        let data = SpillBuffer::within(stored.bytes, self.memory.saturating_sub(*used), spool, path)?;
        *used += data.memory();
        Ok(Found { from, frames, bytes: FoundBytes::ToDecode(data) })
    }

    /// Adds frames of some parts, ascending, to a window. Packed ones are decoded on all threads.
    fn add(&mut self, parts: &[(usize, Vec<usize>)], window: &mut Frames, spool: &mut Spool) -> Result<()> {
        let mut used = window.memory();
        let find = |(part, wanted): &(usize, Vec<usize>)| self.find(*part, wanted, &mut used, spool);
        let mut found = parts.iter().map(find).collect::<Result<Vec<_>>>()?;
        let is_one = |(part, _): &(usize, &mut Part)| parts.binary_search_by_key(part, |(part, _)| *part).is_ok();
        let theirs: Vec<_> = self.parts.iter_mut().enumerate().filter(is_one).collect();
        let decoded: Vec<Result<()>> =
            theirs.into_par_iter().zip(&mut found).map(|((_, part), found)| decode(part, found)).collect();
        decoded.into_iter().collect::<Result<()>>()?;
        for ((part, _), found) in parts.iter().zip(found) {
            found.into_iter().for_each(|found| self.push(*part, found, window));
        }
        Ok(())
    }

    /// An error if a file has changed since its header was read.
    pub fn check_unchanged(&self) -> Result<()> {
        self.parts.iter().try_for_each(|part| part.state.check_path(&part.path))
    }

    /// Adds frames that were found.
    fn push(&mut self, part: usize, Found { from, frames, bytes }: Found, window: &mut Frames) {
        let Part { path, stored, frames: all, state, at } = &self.parts[part];
        for index in frames {
            let path = path.display();
            let name = if *all == 1 { path.to_string() } else { format!("{path}, frame {index}") };
            let offset = from.byte + stored.strides.first + (index - from.frame) as u64 * stored.strides.frame;
            window.frames.push(Frame { bytes: window.bytes.len(), offset, name });
        }
        let file = Some((path.clone(), *state));
        let bytes = match bytes {
            FoundBytes::File(file) => Bytes::File(file),
            FoundBytes::Decoded(data) => Bytes::SpillBuffer { data, file },
            FoundBytes::ToDecode(data) => {
                let data = Arc::new(data);
                let is_group = matches!(at, DataLocation::Decoded(decoder) if decoder.frames_per_chunk() > 1);
                if is_group && data.memory() <= self.kept {
                    self.last = Some(Decoded { part, first: from.frame, data: data.clone() });
                }
                Bytes::SpillBuffer { data, file }
            }
        };
        window.bytes.push((bytes, stored.clone()));
    }

    /// Closes the decoders of parts that the next window does not need.
    fn close_files(&mut self, parts: Range<usize>) {
        for part in &mut self.parts[parts] {
            if let DataLocation::Decoded(decoder) = &mut part.at {
                decoder.close_file();
            }
        }
    }

    /// The frames that are in a part, counted from its first.
    fn wanted(&self, part: usize, frames: impl Iterator<Item = usize>) -> Vec<usize> {
        let (start, held) = (self.starts[part], self.parts[part].frames);
        frames.filter_map(|frame| frame.checked_sub(start)).take_while(|index| *index < held).collect()
    }

    /// The parts that hold frames of a range.
    fn parts_of(&self, frames: &Range<usize>) -> Range<usize> {
        let first = self.starts.partition_point(|s| *s <= frames.start).saturating_sub(1);
        first..self.starts.partition_point(|s| *s < frames.end).max(first)
    }
}

/// Decodes what was not decoded yet of some frames of a part.
fn decode(Part { path, frames, at, .. }: &mut Part, found: &mut [Found]) -> Result<()> {
    let DataLocation::Decoded(decoder) = at else { return Ok(()) };
    let together = decoder.frames_per_chunk();
    for Found { from, bytes, .. } in found {
        if let FoundBytes::ToDecode(data) = bytes {
            decoder.decode(path, from.frame..(from.frame + together).min(*frames), data)?;
        }
    }
    Ok(())
}

/// The error of a window that ends after the last of `all` frames.
pub fn too_many_frames(first: usize, count: usize, all: usize) -> Error {
    Error::setting("frames", format!("{count} from {first} were asked for, but there are {all}"))
}

impl FrameSource for Series {
    fn archive(&self) -> &Archive {
        &self.archive
    }

    fn window(&mut self, first: usize, count: usize) -> Result<Box<dyn FrameWindow>> {
        self.window_of(first, count, 1)
    }

    fn window_of(&mut self, first: usize, count: usize, step: usize) -> Result<Box<dyn FrameWindow>> {
        let all = self.archive.frames.unwrap_or(0);
        let span = count.checked_sub(1).map_or(Some(0), |gaps| gaps.checked_mul(step)?.checked_add(1));
        let Some(end) = span.and_then(|span| first.checked_add(span)).filter(|end| *end <= all) else {
            return Err(too_many_frames(first, count, all));
        };
        let mut window = Frames { shape: self.shape, bytes: Vec::new(), frames: Vec::new() };
        let mut spool = Spool::default();
        let parts = if count == 0 { 0..0 } else { self.parts_of(&(first..end)) };
        let wanted = |part| (part, self.wanted(part, (first..end).step_by(step)));
        let all: Vec<_> = parts.clone().map(wanted).filter(|(_, wanted)| !wanted.is_empty()).collect();
        for some in all.chunks(TOGETHER) {
            self.add(some, &mut window, &mut spool)?;
        }
        self.close_files(parts.start..parts.end.saturating_sub(1).max(parts.start));
        Ok(Box::new(window))
    }
}

/// A header with the spacing and origin of the user.
fn on_grid_of_user(mut header: FileHeader, options: &OpenOptions) -> FileHeader {
    header.spacing = options.spacing.unwrap_or(header.spacing);
    header.origin = options.origin.unwrap_or(header.origin);
    header
}

fn note_once(notes: &mut Vec<Note>, note: impl Into<Note>) {
    let note = note.into();
    if !notes.contains(&note) {
        notes.push(note);
    }
}

/// Replaces the spacing and origin by those of the user.
pub fn override_grid(grid: &mut Grid, options: &OpenOptions) {
    grid.spacing = options.spacing.unwrap_or(grid.spacing);
    grid.origin = options.origin.unwrap_or(grid.origin);
}

/// Refuses a grid that cannot be drawn.
pub fn check_grid(grid: &Grid, options: &OpenOptions, path: &Path) -> Result<()> {
    if grid.spacing.iter().any(|s| !(s.is_finite() && *s > 0.0)) {
        let what = format!("{:?} is not positive", grid.spacing);
        return Err(match options.spacing {
            Some(_) => Error::setting("spacing", what),
            None => Error::input(path, Note::with(format!("the spacing {what}"), Remedy::Set("spacing"))),
        });
    }
    if grid.origin.iter().any(|o| !o.is_finite()) {
        let what = format!("{:?} is not finite", grid.origin);
        return Err(match options.origin {
            Some(_) => Error::setting("origin", what),
            None => Error::input(path, Note::with(format!("the origin {what}"), Remedy::Set("origin"))),
        });
    }
    Ok(())
}

#[cfg(test)]
mod tests;
