//! Reads a variable chunk by chunk, each once.

use super::opener::Opener;
use super::{ArrayFile, Variable};
use std::fmt;
use std::ops::Range;
use std::path::Path;
use wavesplat_core::base::description::AxisRole;
use wavesplat_core::base::error::{Error, Result};
use wavesplat_core::base::stored::StoredType;
use wavesplat_core::source::Parsed;
use wavesplat_core::source::layout::{Axis, Layout};
use wavesplat_core::source::parts::{Decode, Stored};
use wavesplat_core::source::spill_buffer::SpillBuffer;

/// Frames of a variable that is not in chunks and has time as a faster axis than others: to be read together.
const MANY: usize = 32;

/// Takes frames from a variable of a file.
pub(crate) struct Chunks {
    path: String,
    sample: StoredType,
    axes: Vec<Axis>,
    /// Maps output frames to stored frames; empty if the orders agree.
    order: Vec<usize>,
    /// Frames that are in the same chunks.
    together: usize,
    /// The lengths of a piece that is read at once: whole chunks, as many as fit in memory.
    piece: Vec<usize>,
    opener: Opener,
}

/// Decoded chunks may use 1/16 of the memory budget.
const SHARE: usize = 16;

/// Copies of a piece in memory at once: the library's numbers, and the bytes.
const COPIES: usize = 2;

/// The error of a chunk that is too large.
fn too_large(path: &Path, bytes: usize) -> Error {
    let needed = bytes.saturating_mul(SHARE).div_ceil(1 << 20);
    Error::setting("memory", format!("{} is in chunks of {bytes} bytes, which need {needed}MiB", path.display()))
}

impl Chunks {
    pub(crate) fn new(variable: &Variable, axes: &[Axis], order: Vec<usize>, opener: &Opener) -> Result<Self> {
        let sample = variable.sample.clone().unwrap_or(StoredType::F64);
        let chunk = |axis: usize| variable.chunk.as_ref().map_or(1, |c| c[axis].clamp(1, axes[axis].len));
        let of_frames = axes.iter().position(|axis| axis.role == AxisRole::Frames);
        let is_slowest = of_frames.is_none_or(|at| axes[..at].iter().all(|axis| axis.role == AxisRole::Single));
        let together = match (of_frames, &variable.chunk) {
            _ if !order.is_empty() => 1,
            (Some(at), Some(_)) => chunk(at),
            (Some(at), None) if !is_slowest => MANY.min(axes[at].len),
            _ => 1,
        };
        let bytes = |lengths: &mut dyn Iterator<Item = usize>| lengths.fold(sample.size(), usize::saturating_mul);
        let (whole, memory) = (bytes(&mut (0..axes.len()).map(chunk)), opener.how.memory);
        if whole > memory {
            return Err(too_large(&opener.path, whole));
        }
        let length = |(number, axis): (usize, &Axis)| match axis.role {
            AxisRole::Frames => together,
            AxisRole::Single => 1,
            _ => chunk(number),
        };
        let mut piece: Vec<usize> = axes.iter().enumerate().map(length).collect();
        for axis in (0..axes.len()).rev().filter(|axis| axes[*axis].role.voxels().is_some()) {
            let others = bytes(&mut piece.iter().copied()) / piece[axis];
            let fits = (memory / COPIES / others).max(piece[axis]);
            piece[axis] = (fits / piece[axis] * piece[axis]).min(axes[axis].len);
        }
        let (path, axes) = (variable.path.clone(), axes.to_vec());
        Ok(Self { path, sample, axes, order, together, piece, opener: opener.clone() })
    }

    /// How the frames that are read together are held.
    pub(crate) fn stored(&self, layout: &Layout) -> Parsed<Stored> {
        Stored::new(&layout.clone().with_frames(self.together), self.sample, false)
    }

    /// The boxes of some frames, one after another.
    fn boxes(&self, frames: &Range<usize>) -> Vec<Vec<Range<usize>>> {
        let mut boxes = vec![Vec::new()];
        for (&Axis { role, len, index, .. }, piece) in self.axes.iter().zip(&self.piece) {
            let ranges: Vec<Range<usize>> = match role {
                AxisRole::Single => std::iter::once(index..index + 1).collect(),
                AxisRole::Frames => std::iter::once(frames.clone()).collect(),
                _ => (0..len).step_by(*piece).map(|at| at..(at + piece).min(len)).collect(),
            };
            let longer = |found: Vec<Range<usize>>| {
                ranges.iter().map(move |range| [found.clone(), vec![range.clone()]].concat()).collect::<Vec<_>>()
            };
            boxes = boxes.into_iter().flat_map(longer).collect();
        }
        boxes
    }

    /// Reads one box.
    fn read(&self, file: &dyn ArrayFile, path: &Path, ranges: &[Range<usize>]) -> Result<Vec<u8>> {
        let what = || format!("{} at {ranges:?}", self.path.trim_start_matches('/'));
        let bytes = file.read(&self.path, self.sample, ranges);
        let bytes = bytes.map_err(|e| Error::input(path, format!("{}: {e}", what())))?;
        let expected = ranges.iter().map(Range::len).product::<usize>() * self.sample.size();
        if bytes.len() != expected {
            return Err(Error::input(path, format!("{}: has {} bytes, not {expected}", what(), bytes.len())));
        }
        Ok(bytes)
    }

    /// Puts a box among the frames that are read together.
    fn put(&self, ranges: &[Range<usize>], bytes: &[u8], out: &mut SpillBuffer) -> std::io::Result<()> {
        let axes = self.axes.iter().zip(ranges).filter(|(axis, _)| axis.role != AxisRole::Single);
        let axis = |(axis, range): (&Axis, &Range<usize>)| match axis.role {
            AxisRole::Frames => (self.together, 0..range.len()),
            _ => (axis.len, range.clone()),
        };
        put_box(&axes.map(axis).collect::<Vec<_>>(), self.sample.size(), bytes, 0, out)
    }
}

/// Writes a box into an array, both with the last axis fastest; each axis by its length in the array and the box's
/// range.
fn put_box(
    axes: &[(usize, Range<usize>)],
    size: usize,
    bytes: &[u8],
    at: usize,
    out: &mut SpillBuffer,
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
    fn frames_per_chunk(&self) -> usize {
        self.together
    }

    fn decode(&mut self, path: &Path, frames: Range<usize>, out: &mut SpillBuffer) -> Result<()> {
        let stored = self.order.get(frames.start).map_or(frames.clone(), |at| *at..*at + 1);
        self.opener.with_file(|file| {
            for ranges in self.boxes(&stored) {
                let bytes = self.read(file, path, &ranges)?;
                self.put(&ranges, &bytes, out).map_err(|e| Error::io(path, format!("holding frames {frames:?}"), e))?;
            }
            Ok(())
        })
    }

    fn close_file(&mut self) {
        self.opener.close();
    }
}

impl fmt::Debug for Chunks {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Chunks").field("path", &self.path).field("axes", &self.axes).finish_non_exhaustive()
    }
}

#[cfg(test)]
mod tests {
    use super::super::Attributes;
    use super::super::opener::ReadConfig;
    use super::*;
    use std::sync::{Arc, Mutex};
    use wavesplat_core::base::description::{Attribute, NumberType, Values};
    use wavesplat_core::base::mapped::Access;

    const LENGTHS: [usize; 5] = [7, 2, 5, 4, 6]; // t, one of two, z, y, x
    const CHUNK: [usize; 5] = [3, 1, 2, 4, 5];

    /// How often each sample was read.
    static READS: Mutex<Vec<u8>> = Mutex::new(Vec::new());

    /// An array whose samples are their own numbers.
    struct Counted;

    impl ArrayFile for Counted {
        fn variables(&self) -> Parsed<Vec<Variable>> {
            Ok(Vec::new())
        }

        fn read(&self, _: &str, _: StoredType, ranges: &[Range<usize>]) -> Parsed<Vec<u8>> {
            let mut reads = READS.lock().expect("no panic");
            reads.resize(LENGTHS.iter().product(), 0);
            let mut found = vec![0_usize];
            for (range, len) in ranges.iter().zip(LENGTHS) {
                found = found.iter().flat_map(|at| range.clone().map(move |i| at * len + i)).collect();
            }
            found.iter().for_each(|at| reads[*at] += 1);
            Ok(found.iter().flat_map(|at| (*at as u16).to_le_bytes()).collect())
        }

        fn described(&self, _: &str) -> Vec<Attribute> {
            Vec::new()
        }

        fn values(&self, _: &str) -> Parsed<Values> {
            Ok(Values::floats(&[]))
        }

        fn number_type(&self, _: &str) -> Parsed<NumberType> {
            Ok(NumberType::U16)
        }
    }

    #[test]
    fn every_sample_is_read_once_and_put_in_its_place() {
        let (dims, attributes) = (vec![String::new(); 5], Attributes::new());
        let (lengths, chunk) = (LENGTHS.to_vec(), Some(CHUNK.to_vec()));
        let variable = Variable {
            path: "a".into(),
            sample: Ok(StoredType::U16),
            lengths,
            dims,
            scales: Vec::new(),
            chunk,
            attributes,
        };
        let [t, _, z, y, x] = LENGTHS;
        let voxels = [Axis::new(AxisRole::Z, z), Axis::new(AxisRole::Y, y), Axis::new(AxisRole::X, x)];
        let axes = [vec![Axis::new(AxisRole::Frames, t), Axis::single(1, 2)], voxels.to_vec()].concat();
        for memory in [240, 500, 1 << 20] {
            READS.lock().expect("no panic").clear();
            let how = ReadConfig { access: Access::Read, memory };
            let opener =
                Opener { path: "a".into(), how, open: Arc::new(|_, _| Ok(Box::new(Counted))), opened: Arc::default() };
            let mut chunks = Chunks::new(&variable, &axes, Vec::new(), &opener).expect("small chunks");
            let stored = chunks.stored(&Layout::plain([6, 4, 5], 7)).expect("small");
            assert_eq!((chunks.frames_per_chunk(), stored.bytes), (3, 3 * 120 * 2));
            for first in (0..7).step_by(3) {
                let mut held = SpillBuffer::new(stored.bytes, 1 << 20, Path::new("a")).expect("room");
                chunks.decode(Path::new("a"), first..7.min(first + 3), &mut held).expect("reading");
                let mut bytes = vec![0; 120 * 2 * 3.min(7 - first)];
                held.read_at(0, &mut bytes).expect("what was put there");
                let of_frame = |t: usize| (0..120).map(move |i| ((t * 2 + 1) * 120 + i) as u16);
                let expected = (first..7.min(first + 3)).flat_map(of_frame).flat_map(u16::to_le_bytes);
                assert!(expected.eq(bytes), "frames from {first}");
            }
            let reads = READS.lock().expect("no panic").clone();
            let expected = (0..LENGTHS.iter().product()).map(|i: usize| u8::from(i / 120 % 2 == 1));
            assert!(expected.eq(reads), "{memory} bytes");
        }
        let how = ReadConfig { access: Access::Read, memory: 200 };
        let opener =
            Opener { path: "a".into(), how, open: Arc::new(|_, _| Ok(Box::new(Counted))), opened: Arc::default() };
        let refused = Chunks::new(&variable, &axes, Vec::new(), &opener).expect_err("chunks of 240 bytes");
        assert!(matches!(refused, Error::Setting { setting: "memory", .. }), "{refused}");
    }
}
