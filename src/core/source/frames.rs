//! A window of frames whose bytes are at known places. All formats copy boxes with it.

use super::FrameWindow;
use super::int64;
use super::layout::Shape;
use super::parts::Stored;
use super::spill_buffer::SpillBuffer;
use crate::base::error::{Error, Result};
use crate::base::grid::Region;
use crate::base::mapped::{FileBytes, State};
use crate::base::output::STANDARD;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Reads with smaller gaps are joined, since the system reads whole pages anyway.
const SMALL_GAP: usize = 4096;
/// A joined read may be at most this many times as long as the bytes that are needed.
const WASTE: usize = 8;
/// No joined read is longer than this.
const MAX_JOINED: usize = 4 << 20;
/// The same limit for separate samples if small reads are cheap, so that the bytes stay in the processor's cache.
const MAX_SPAN: usize = 64 << 10;

/// Where the bytes of some frames are.
#[derive(Debug)]
pub enum Bytes {
    /// Directly in a file.
    File(FileBytes),
    /// Copied from a stream, or decoded from a file of this state. The file is closed: a window may have many files.
    SpillBuffer {
        /// The bytes.
        data: Arc<SpillBuffer>,
        /// The file that they were decoded from.
        file: Option<(PathBuf, State)>,
    },
}

impl Bytes {
    fn read_at(&self, offset: u64, out: &mut [u8]) -> io::Result<()> {
        match self {
            Self::File(file) => file.read_at(offset, out),
            Self::SpillBuffer { data, .. } => data.read_at(offset, out),
        }
    }

    fn small_reads_are_cheap(&self) -> bool {
        match self {
            Self::File(file) => file.is_mapped(),
            Self::SpillBuffer { data, .. } => matches!(**data, SpillBuffer::Memory(_)),
        }
    }

    fn path(&self) -> &Path {
        match self {
            Self::File(file) => file.path(),
            Self::SpillBuffer { file, .. } => file.as_ref().map_or(Path::new(STANDARD), |(path, _)| path),
        }
    }

    fn check_unchanged(&self) -> Result<()> {
        match self {
            Self::File(file) => file.check_unchanged(),
            Self::SpillBuffer { file, .. } => file.as_ref().map_or(Ok(()), |(path, state)| state.check_path(path)),
        }
    }
}

/// One frame: its place in the bytes of a window.
#[derive(Debug)]
pub struct Frame {
    /// Which of the window's bytes hold it.
    pub bytes: usize,
    /// Where its voxel (0, 0, 0) is there.
    pub offset: u64,
    /// Its name for messages.
    pub name: String,
}

/// Some consecutive frames.
#[derive(Debug)]
pub struct Frames {
    /// Voxels and sample type of each.
    pub shape: Shape,
    /// Where their samples are, and how they are stored there.
    pub bytes: Vec<(Bytes, Stored)>,
    /// The frames, in order.
    pub frames: Vec<Frame>,
}

impl FrameWindow for Frames {
    fn frames(&self) -> usize {
        self.frames.len()
    }

    fn read_box(&self, frame: usize, region: &Region, out: &mut [u8]) -> Result<()> {
        let (dims, sample) = (self.shape.dims(), self.shape.sample());
        assert!(Region { start: [0; 3], end: dims }.contains(region), "{region:?} is not inside {dims:?}");
        assert_eq!(out.len(), region.voxels() * sample.size(), "bytes of {region:?}");
        let Stored { ty, packing, .. } = &self.bytes[self.frames[frame].bytes].1;
        if packing.is_none() && !ty.is_64_bit() {
            return self.read_stored(frame, region, out);
        }
        let mut numbers = vec![0; region.voxels() * ty.size()];
        self.read_stored(frame, region, &mut numbers)?;
        let converted = match packing {
            Some(packing) => packing.unpack(*ty, &numbers, out),
            None => int64::narrow(*ty, &numbers, out),
        };
        converted.map_err(|unfit| {
            let voxel = region.iter().nth(unfit.index).unwrap_or_default();
            Error::input(&self.frames[frame].name, unfit.message(voxel, sample))
        })
    }

    fn name(&self, frame: usize) -> String {
        self.frames[frame].name.clone()
    }

    fn check_unchanged(&self) -> Result<()> {
        self.bytes.iter().try_for_each(|(bytes, _)| bytes.check_unchanged())
    }
}

impl Frames {
    /// Bytes of memory that hold what was decoded.
    pub(crate) fn memory(&self) -> usize {
        let held = |(bytes, _): &(Bytes, Stored)| match bytes {
            Bytes::SpillBuffer { data, .. } => data.memory(),
            Bytes::File(_) => 0,
        };
        self.bytes.iter().map(held).sum()
    }

    /// The stored numbers of a box, little-endian, x fastest.
    fn read_stored(&self, frame: usize, region: &Region, out: &mut [u8]) -> Result<()> {
        let frame = &self.frames[frame];
        let (bytes, stored) = &self.bytes[frame.bytes];
        let (dims, size) = (self.shape.dims(), stored.ty.size());
        let read = if stored.strides.is_plain(dims, size) {
            Rows::new(dims, region, size).copy(bytes, frame.offset, out)
        } else {
            copy_strided(bytes, frame.offset, &stored.strides.voxel, region, size, out)
        };
        read.map_err(|e| Error::io(bytes.path(), format!("reading {}", frame.name), e))?;
        if stored.big_endian {
            stored.ty.swap_endian(out);
        }
        Ok(())
    }
}

/// Copies a box from an array in any order: along the axis on which neighbours are nearest, a line at a time.
fn copy_strided(
    bytes: &Bytes,
    frame: u64,
    strides: &[i64; 3],
    region: &Region,
    size: usize,
    out: &mut [u8],
) -> io::Result<()> {
    if out.is_empty() {
        return Ok(());
    }
    let dims = region.dims();
    let mut axes = [0, 1, 2];
    axes.sort_by_key(|axis| (dims[*axis] == 1, strides[*axis].unsigned_abs()));
    let [axis, rows, planes] = axes;
    let out_strides = [size, size * dims[0], size * dims[0] * dims[1]];
    let place = |axis: usize, index: usize| strides[axis] * (region.start[axis] + index) as i64;
    let line = SampleLine { samples: dims[axis], size, stride: strides[axis], out_stride: out_strides[axis] };
    let mut span = line.span(bytes);
    for (k, j) in (0..dims[planes]).flat_map(|k| (0..dims[rows]).map(move |j| (k, j))) {
        let from = frame.wrapping_add_signed(place(planes, k) + place(rows, j) + place(axis, 0));
        let to = k * out_strides[planes] + j * out_strides[rows];
        line.copy(bytes, from, &mut span, &mut out[to..])?;
    }
    Ok(())
}

/// Samples of a box along one axis.
struct SampleLine {
    samples: usize,
    size: usize, // of a sample, in bytes
    stride: i64, // bytes from a sample to the next one
    out_stride: usize,
}

impl SampleLine {
    fn pitch(&self) -> usize {
        self.stride.unsigned_abs() as usize
    }

    /// A buffer for one read: as many samples, with the gaps between them, as the limits allow, at least one.
    fn span(&self, bytes: &Bytes) -> Vec<u8> {
        let (pitch, most) = (self.pitch(), self.size * WASTE);
        let (gap, longest) =
            if bytes.small_reads_are_cheap() { (most, MAX_SPAN) } else { (most.max(SMALL_GAP), MAX_JOINED) };
        let joined = if pitch > gap { 1 } else { (longest / pitch.max(1)).clamp(1, self.samples) };
        vec![0; (joined - 1) * pitch + self.size]
    }

    /// Copies the line whose first sample is at `from`.
    fn copy(&self, bytes: &Bytes, from: u64, span: &mut [u8], out: &mut [u8]) -> io::Result<()> {
        let Self { samples, size, stride, out_stride } = *self;
        let (pitch, backwards) = (self.pitch(), stride < 0);
        let joined = (span.len() - size).checked_div(pitch).unwrap_or(0) + 1;
        for first in (0..samples).step_by(joined) {
            let count = joined.min(samples - first);
            let nearest = if backwards { first + count - 1 } else { first };
            let span = &mut span[..(count - 1) * pitch + size];
            bytes.read_at(from.wrapping_add_signed(stride * nearest as i64), span)?;
            let out = &mut out[first * out_stride..];
            if pitch == size && out_stride == size && !backwards {
                out[..span.len()].copy_from_slice(span);
                continue;
            }
            for i in 0..count {
                let stored = if backwards { count - 1 - i } else { i };
                out[i * out_stride..][..size].copy_from_slice(&span[stored * pitch..][..size]);
            }
        }
        Ok(())
    }
}

/// The bytes of a box as rows of equal length, in planes. A row is contiguous in the frame.
struct Rows {
    row: usize,       // bytes
    pitch: usize,     // bytes from a row to the next one of its plane
    rows: usize,      // in a plane
    planes: Vec<u64>, // where each starts in the frame
}

impl Rows {
    fn new(dims: [usize; 3], region: &Region, size: usize) -> Self {
        let (dims, region) = flattened(dims, region);
        let (dims, region) = flattened(dims, &region);
        let [row, rows, _] = region.dims();
        let [x, y, _] = region.start;
        let start = |z| (((z * dims[1] + y) * dims[0] + x) * size) as u64;
        let planes = (region.start[2]..region.end[2]).map(start).collect();
        Self { row: row * size, pitch: dims[0] * size, rows, planes }
    }

    /// How many rows to read at once.
    fn joined(&self, bytes: &Bytes) -> usize {
        let gap = self.pitch - self.row;
        if bytes.small_reads_are_cheap() || gap > SMALL_GAP.max((WASTE - 1) * self.row) {
            return 1;
        }
        (MAX_JOINED / self.pitch).clamp(1, self.rows.max(1))
    }

    fn copy(&self, bytes: &Bytes, frame: u64, out: &mut [u8]) -> io::Result<()> {
        if out.is_empty() {
            return Ok(());
        }
        let joined = self.joined(bytes);
        let mut buffer = vec![0; if joined == 1 { 0 } else { (joined - 1) * self.pitch + self.row }];
        for (plane, out) in self.planes.iter().zip(out.chunks_mut(self.rows * self.row)) {
            for (i, out) in out.chunks_mut(joined * self.row).enumerate() {
                let start = frame + plane + (i * joined * self.pitch) as u64;
                self.copy_rows(bytes, start, out, &mut buffer)?;
            }
        }
        Ok(())
    }

    /// Copies rows of one plane with one read.
    fn copy_rows(&self, bytes: &Bytes, start: u64, out: &mut [u8], buffer: &mut [u8]) -> io::Result<()> {
        if out.len() == self.row {
            return bytes.read_at(start, out);
        }
        let rows = out.len() / self.row;
        let span = &mut buffer[..(rows - 1) * self.pitch + self.row];
        bytes.read_at(start, span)?;
        for (out, row) in out.chunks_mut(self.row).zip(span.chunks(self.pitch)) {
            out.copy_from_slice(&row[..self.row]);
        }
        Ok(())
    }
}

/// The same voxels of the same array with x and y as one axis, if the region has all of x; else unchanged.
fn flattened(dims: [usize; 3], region: &Region) -> ([usize; 3], Region) {
    if region.start[0] != 0 || region.end[0] != dims[0] {
        return (dims, *region);
    }
    let flat = |at: [usize; 3], z| [at[1] * dims[0], at[2], z];
    ([dims[0] * dims[1], dims[2], 1], Region { start: flat(region.start, 0), end: flat(region.end, 1) })
}

#[cfg(test)]
mod tests {
    use super::super::testing::{DIMS, check_window, payload};
    use super::*;
    use crate::base::description::AxisRole;
    use crate::base::sample::SampleType;
    use crate::source::layout::{Axis, Layout, Strides};
    use crate::source::packing::Packing;

    /// Large enough that some boxes are read row by row and some joined.
    const LARGE: [usize; 3] = [300, 40, 20];

    /// The same bytes in a temporary file and in memory.
    fn both(bytes: &[u8]) -> [Bytes; 2] {
        [0, bytes.len()].map(|memory| {
            let mut data = SpillBuffer::new(bytes.len(), memory, Path::new(STANDARD)).expect("room");
            data.write_at(0, bytes).expect("writing");
            Bytes::SpillBuffer { data: Arc::new(data), file: None }
        })
    }

    fn window(shape: Shape, bytes: impl IntoIterator<Item = Bytes>, stored: &Stored, offsets: &[u64]) -> Frames {
        let bytes: Vec<_> = bytes.into_iter().map(|bytes| (bytes, stored.clone())).collect();
        let frame = |bytes, offset: &u64| Frame { bytes, offset: *offset, name: "frame 9".into() };
        let frames = (0..bytes.len()).flat_map(|i| offsets.iter().map(move |o| frame(i, o))).collect();
        Frames { shape, bytes, frames }
    }

    #[test]
    fn joined_reads_copy_the_same_as_single_ones() {
        let shape = Shape::new(LARGE, SampleType::U32).expect("shape");
        let voxels: Vec<u8> = (0..240_000_u32).flat_map(u32::to_le_bytes).collect();
        let plain = Stored::plain(shape.dims(), 1, shape.sample(), false).expect("small");
        let frames = window(shape, both(&[b"abc", voxels.as_slice()].concat()), &plain, &[3]);
        for (start, end) in
            [([0; 3], LARGE), ([5, 3, 2], [7, 40, 20]), ([0, 7, 0], [300, 9, 20]), ([1, 0, 0], [299, 40, 20])]
        {
            let region = Region { start, end };
            let mut found = [vec![0; region.voxels() * 4], vec![0; region.voxels() * 4]];
            for (i, found) in found.iter_mut().enumerate() {
                frames.read_box(i, &region, found).expect("reading");
            }
            assert_eq!(found[0], found[1], "{region:?}");
            let index = |[x, y, z]: [usize; 3]| (((z * LARGE[1] + y) * LARGE[0] + x) as u32).to_le_bytes();
            assert_eq!(found[0], region.iter().flat_map(index).collect::<Vec<_>>(), "{region:?}");
        }
    }

    #[test]
    fn every_place_of_bytes_serves_frames() {
        let ty = SampleType::F16;
        let shape = Shape::new(DIMS, ty).expect("shape");
        let stored = payload(ty, 0..2, true);
        let plain = Stored::plain(shape.dims(), 1, shape.sample(), true).expect("small");
        for bytes in both(&stored) {
            check_window(&window(shape, [bytes], &plain, &[0, shape.frame_bytes() as u64]), ty, 0);
        }
    }

    #[test]
    fn axes_of_any_order_and_direction_are_read() {
        let ty = SampleType::U16;
        let shape = Shape::new(DIMS, ty).expect("shape");
        let voxels = payload(ty, 0..1, false);
        for order in [[0, 1, 2], [0, 2, 1], [1, 0, 2], [1, 2, 0], [2, 0, 1], [2, 1, 0]] {
            for turned in 0..8 {
                let axis = |of: usize| Axis {
                    backwards: turned >> of & 1 == 1,
                    ..Axis::new(AxisRole::of_voxels(of), DIMS[of])
                };
                let layout = Layout([vec![Axis::single(1, 2)], order.map(axis).to_vec()].concat());
                let stored = Stored::new(&layout, ty, false).expect("small");
                let mut bytes = vec![0; stored.bytes];
                for (i, [x, y, z]) in (Region { start: [0; 3], end: DIMS }).iter().enumerate() {
                    let Strides { first, voxel, .. } = stored.strides;
                    let at = first as i64 + voxel[0] * x as i64 + voxel[1] * y as i64 + voxel[2] * z as i64;
                    bytes[at as usize..][..2].copy_from_slice(&voxels[2 * i..][..2]);
                }
                let first = stored.strides.first;
                both(&bytes).into_iter().for_each(|b| check_window(&window(shape, [b], &stored, &[first]), ty, 0));
            }
        }
    }

    #[test]
    fn samples_far_apart_are_read_alone_and_near_ones_in_bounded_pieces() {
        let line = |samples, stride| SampleLine { samples, size: 2, stride, out_stride: 2 };
        let [file, memory] = both(&[0]);
        for bytes in [&file, &memory] {
            assert_eq!(line(1 << 30, 1 << 20).span(bytes).len(), 2, "one sample");
            assert!(line(1 << 30, -8).span(bytes).len() <= MAX_JOINED, "a piece");
            assert_eq!(line(5, 8).span(bytes).len(), 34, "the line");
            assert_eq!(line(1, 0).span(bytes).len(), 2);
        }
        assert_eq!(line(1 << 30, 100).span(&memory).len(), 2, "small reads are cheap there");
        assert!(line(1 << 30, 100).span(&file).len() > MAX_JOINED / 2);
    }

    #[test]
    fn lines_are_the_same_read_in_pieces_or_sample_by_sample() {
        const SAMPLES: usize = 50_000; // more than a piece where they are 8 bytes apart
        for pitch in [2, 8, 20] {
            let numbers = |i: usize| (i as u16).to_le_bytes().into_iter().chain([0; 18]).take(pitch);
            let stored: Vec<u8> = (0..SAMPLES).flat_map(numbers).collect();
            let forwards: Vec<u8> = (0..SAMPLES).flat_map(|i| (i as u16).to_le_bytes()).collect();
            let backwards: Vec<u8> = (0..SAMPLES).rev().flat_map(|i| (i as u16).to_le_bytes()).collect();
            let last = ((SAMPLES - 1) * pitch) as u64;
            for bytes in both(&stored) {
                for (from, stride, expected) in [(0, pitch as i64, &forwards), (last, -(pitch as i64), &backwards)] {
                    let line = SampleLine { samples: SAMPLES, size: 2, stride, out_stride: 2 };
                    let mut found = vec![0; 2 * SAMPLES];
                    line.copy(&bytes, from, &mut line.span(&bytes), &mut found).expect("reading");
                    assert!(found == *expected, "{pitch} bytes apart, from {from}");
                }
            }
        }
    }

    #[test]
    fn packed_numbers_are_samples_when_they_are_read() {
        let shape = Shape::new(DIMS, SampleType::F32).expect("shape");
        let plain = Stored::plain(DIMS, 1, SampleType::I16, true).expect("small");
        let stored = Stored { packing: Some(Packing::scaled(0.25, -3.0)), ..plain };
        for bytes in both(&payload(SampleType::I16, 0..1, true)) {
            check_window(&window(shape, [bytes], &stored, &[0]), SampleType::F32, 0);
        }
    }

    #[test]
    fn bytes_that_are_not_there_are_an_error() {
        let shape = Shape::new([2, 2, 2], SampleType::U8).expect("shape");
        let plain = Stored::plain(shape.dims(), 1, shape.sample(), false).expect("small");
        for bytes in both(&[0; 7]) {
            let frames = window(shape, [bytes], &plain, &[0]);
            let whole = Region { start: [0; 3], end: [2; 3] };
            let error = frames.read_box(0, &whole, &mut [0; 8]).expect_err("too short");
            assert!(error.to_string().contains("reading frame 9"), "{error}");
        }
    }
}
