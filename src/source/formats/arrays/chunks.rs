//! Reads a variable chunk by chunk, each once.

use super::{ArrayFile, Opener, Variable};
use crate::error::{Error, Result};
use crate::sample::SampleType;
use crate::source::Parsed;
use crate::source::described::{Decode, Stored};
use crate::source::held::Held;
use crate::source::layout::{Counts, Layout};
use std::fmt;
use std::ops::Range;
use std::path::Path;

/// Frames of a variable that is not in chunks and has time as a faster axis than others: to be read together.
const MANY: usize = 32;

/// Takes frames from a variable of a file.
pub(super) struct Chunks {
    path: String,
    sample: SampleType,
    lengths: Vec<usize>,
    counts: Vec<Counts>,
    /// Which of the array's frames is which; empty if they are in order.
    order: Vec<usize>,
    /// Frames that are in the same chunks.
    together: usize,
    /// The axis that is cut, and into pieces of what length, so that one of them is no more than may be held.
    cut: (usize, usize),
    opener: Opener,
    /// The file, while frames are taken.
    file: Option<Box<dyn ArrayFile>>,
}

/// Of what a program may take, chunks as they are decoded have about this part.
const SHARE: usize = 16;

/// The error of a chunk that is too large.
fn too_large(path: &Path, bytes: usize) -> Error {
    let needed = bytes.saturating_mul(SHARE).div_ceil(1 << 20);
    Error::usage(format!("{}: is in chunks of {bytes} bytes: --memory {needed}MiB holds them", path.display()))
}

impl Chunks {
    pub(super) fn new(variable: &Variable, counts: &[Counts], order: Vec<usize>, opener: &Opener) -> Result<Self> {
        let sample = variable.sample.clone().unwrap_or(SampleType::F64);
        let chunk = |axis: usize| variable.chunk.as_ref().map_or(1, |c| c[axis].clamp(1, variable.lengths[axis]));
        let of_frames = counts.iter().position(|c| *c == Counts::Frames);
        let is_slowest = of_frames.is_none_or(|at| counts[..at].iter().all(|c| matches!(c, Counts::Only(_))));
        let together = match (of_frames, &variable.chunk) {
            _ if !order.is_empty() => 1,
            (Some(at), Some(_)) => chunk(at),
            (Some(at), None) if !is_slowest => MANY.min(variable.lengths[at]),
            _ => 1,
        };
        let is_long = |axis: &usize| matches!(counts[*axis], Counts::Voxels(_)) && variable.lengths[*axis] > 1;
        let axis = (0..counts.len()).find(is_long).unwrap_or(0);
        let of_axis = |axis: usize| match counts[axis] {
            Counts::Frames => together,
            Counts::Voxels(_) => variable.lengths[axis],
            Counts::Only(_) => 1,
        };
        let plane: usize = (0..counts.len()).filter(|i| *i != axis).map(of_axis).product::<usize>() * sample.size();
        let whole: usize = (0..counts.len()).map(chunk).product::<usize>() * sample.size();
        let memory = opener.how.memory;
        if whole > memory {
            return Err(too_large(&opener.path, whole));
        }
        let piece = (memory / plane.max(1)).next_multiple_of(chunk(axis)).max(chunk(axis));
        let (path, lengths, counts) = (variable.path.clone(), variable.lengths.clone(), counts.to_vec());
        Ok(Self {
            path,
            sample,
            lengths,
            counts,
            order,
            together,
            cut: (axis, piece),
            opener: opener.clone(),
            file: None,
        })
    }

    /// How the frames that are read together are held.
    pub(super) fn stored(&self, layout: &Layout) -> Parsed<Stored> {
        Stored::new(&layout.clone().with_frames(self.together), self.sample, false)
    }

    /// The box of a variable with some frames, and with a range of the axis that is cut.
    fn ranges(&self, frames: &Range<usize>, piece: &Range<usize>) -> Vec<Range<usize>> {
        let range = |(axis, counts): (usize, &Counts)| match counts {
            Counts::Only(index) => *index..index + 1,
            Counts::Frames => frames.clone(),
            Counts::Voxels(_) if axis == self.cut.0 => piece.clone(),
            Counts::Voxels(_) => 0..self.lengths[axis],
        };
        self.counts.iter().enumerate().map(range).collect()
    }

    /// Puts a box among the frames that are read together.
    fn put(&self, ranges: &[Range<usize>], bytes: &[u8], out: &mut Held) -> std::io::Result<()> {
        let axes = (0..ranges.len()).filter(|axis| !matches!(self.counts[*axis], Counts::Only(_)));
        let axis = |axis: usize| match self.counts[axis] {
            Counts::Frames => (self.together, 0..ranges[axis].len()),
            _ => (self.lengths[axis], ranges[axis].clone()),
        };
        put_box(&axes.map(axis).collect::<Vec<_>>(), self.sample.size(), bytes, 0, out)
    }
}

/// Writes a box into an array, both with the last axis fastest; each axis by its length in the array and the box's range.
fn put_box(
    axes: &[(usize, Range<usize>)],
    size: usize,
    bytes: &[u8],
    at: usize,
    out: &mut Held,
) -> std::io::Result<()> {
    let inner: usize = axes.iter().skip(1).map(|(len, _)| len).product::<usize>() * size;
    let Some((_, range)) = axes.first() else { return out.write_at(at as u64, bytes) };
    if axes[1..].iter().all(|(len, range)| range.len() == *len) {
        return out.write_at((at + range.start * inner) as u64, bytes);
    }
    let pieces = bytes.chunks(bytes.len() / range.len().max(1));
    range.clone().zip(pieces).try_for_each(|(index, bytes)| put_box(&axes[1..], size, bytes, at + index * inner, out))
}

impl Decode for Chunks {
    fn together(&self) -> usize {
        self.together
    }

    fn decode(&mut self, path: &Path, frames: Range<usize>, out: &mut Held) -> Result<()> {
        let file = match self.file.take() {
            Some(file) => file,
            None => self.opener.open()?,
        };
        let (axis, piece) = self.cut;
        let stored = self.order.get(frames.start).map_or(frames.clone(), |at| *at..*at + 1);
        for first in (0..self.lengths[axis]).step_by(piece) {
            let ranges = self.ranges(&stored, &(first..(first + piece).min(self.lengths[axis])));
            let bytes = file.read(&self.path, self.sample, &ranges);
            let bytes = bytes.map_err(|e| Error::input(path, format!("frames {frames:?} of {}: {e}", self.path)))?;
            let expected = ranges.iter().map(Range::len).product::<usize>() * self.sample.size();
            if bytes.len() != expected {
                let what = format!("frames {frames:?} of {} have {} bytes, not {expected}", self.path, bytes.len());
                return Err(Error::input(path, what));
            }
            self.put(&ranges, &bytes, out).map_err(|e| Error::io(path, format!("holding frames {frames:?}"), e))?;
        }
        self.file = Some(file);
        Ok(())
    }

    fn rest(&mut self) {
        self.file = None;
    }
}

impl fmt::Debug for Chunks {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Chunks").field("path", &self.path).field("counts", &self.counts).finish_non_exhaustive()
    }
}
