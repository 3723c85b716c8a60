//! A window of frames as bytes at known places: the one way in which every format copies boxes out.

use super::FrameWindow;
use super::Parsed;
use crate::error::{Error, Result};
use crate::mapped::FileBytes;
use crate::output::STANDARD;
use crate::sample::{SampleType, swap_endian};
use crate::volume::Region;
use std::fs::File;
use std::io;
use std::os::unix::fs::FileExt;
use std::path::Path;

/// Reads that lie closer together than this are joined, since the system reads whole pages anyway.
const SMALL_GAP: usize = 4096;
/// A joined read may be this many times as long as what is wanted of it.
const WASTE: usize = 8;
/// No joined read is longer than this.
const MAX_JOINED: usize = 4 << 20;

/// The voxels and the sample type of every frame of an archive.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Shape {
    dims: [usize; 3],
    sample: SampleType,
    frame_bytes: usize,
}

impl Shape {
    /// Refuses empty frames and those whose bytes cannot be addressed, with the reason.
    pub(super) fn new(dims: [usize; 3], sample: SampleType) -> Parsed<Self> {
        let [x, y, z] = dims;
        if dims.contains(&0) {
            return Err(format!("a frame of {x}x{y}x{z} voxels is empty"));
        }
        let voxels = x.checked_mul(y).and_then(|n| n.checked_mul(z));
        let bytes = voxels.and_then(|n| n.checked_mul(sample.size())).filter(|n| isize::try_from(*n).is_ok());
        let frame_bytes = bytes.ok_or_else(|| format!("a frame of {x}x{y}x{z} voxels is too large"))?;
        Ok(Self { dims, sample, frame_bytes })
    }

    /// Voxels along x, y, z.
    pub(super) fn dims(&self) -> [usize; 3] {
        self.dims
    }

    /// The type of the samples.
    pub(super) fn sample(&self) -> SampleType {
        self.sample
    }

    /// Bytes of one frame.
    pub(super) fn frame_bytes(&self) -> usize {
        self.frame_bytes
    }
}

impl std::fmt::Display for Shape {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let [x, y, z] = self.dims;
        write!(f, "{x}x{y}x{z} {} samples", self.sample)
    }
}

/// Where the bytes of some frames are.
#[derive(Debug)]
pub(super) enum Bytes {
    /// In a file as they are.
    File(FileBytes),
    /// Decoded from a file.
    Decoded { file: FileBytes, data: Vec<u8> },
    /// Taken from a stream.
    Memory(Vec<u8>),
    /// Taken from a stream and too many to hold: a temporary file without a name.
    Spool(File),
}

impl Bytes {
    fn read_at(&self, offset: u64, out: &mut [u8]) -> io::Result<()> {
        match self {
            Self::File(file) => file.read_at(offset, out),
            Self::Decoded { data, .. } | Self::Memory(data) => {
                wavesplat_format::Storage::read_at(data.as_slice(), offset, out)
            }
            Self::Spool(file) => file.read_exact_at(out, offset),
        }
    }

    fn small_reads_are_cheap(&self) -> bool {
        match self {
            Self::File(file) => file.is_mapped(),
            Self::Decoded { .. } | Self::Memory(_) => true,
            Self::Spool(_) => false,
        }
    }

    fn file(&self) -> Option<&FileBytes> {
        match self {
            Self::File(file) | Self::Decoded { file, .. } => Some(file),
            Self::Memory(_) | Self::Spool(_) => None,
        }
    }
}

/// One frame: its place in the bytes of a window.
#[derive(Debug)]
pub(super) struct Frame {
    /// Which of the window's bytes hold it.
    pub(super) bytes: usize,
    /// Where it starts there.
    pub(super) offset: u64,
    /// Whether its samples have their most significant byte first.
    pub(super) big_endian: bool,
    /// Its name for messages.
    pub(super) name: String,
}

/// Some consecutive frames.
#[derive(Debug)]
pub(super) struct Frames {
    /// Voxels and sample type of each.
    pub(super) shape: Shape,
    /// Where their samples are.
    pub(super) bytes: Vec<Bytes>,
    /// The frames, in order.
    pub(super) frames: Vec<Frame>,
}

impl FrameWindow for Frames {
    fn frames(&self) -> usize {
        self.frames.len()
    }

    fn read_box(&self, frame: usize, region: &Region, out: &mut [u8]) -> Result<()> {
        let Shape { dims, sample, .. } = self.shape;
        assert!(Region { start: [0; 3], end: dims }.contains(region), "{region:?} is not inside {dims:?}");
        assert_eq!(out.len(), region.voxels() * sample.size(), "bytes of {region:?}");
        let frame = &self.frames[frame];
        let bytes = &self.bytes[frame.bytes];
        let rows = Rows::new(dims, region, sample.size());
        rows.copy(bytes, frame.offset, out).map_err(|e| {
            let path = bytes.file().map_or(Path::new(STANDARD), FileBytes::path);
            Error::io(path, format!("reading {}", frame.name), e)
        })?;
        if frame.big_endian {
            swap_endian(sample, out);
        }
        Ok(())
    }

    fn name(&self, frame: usize) -> String {
        self.frames[frame].name.clone()
    }

    fn check_unchanged(&self) -> Result<()> {
        self.bytes.iter().filter_map(Bytes::file).try_for_each(FileBytes::check_unchanged)
    }
}

/// The bytes of a box as equally long rows, in planes: rows as long as they lie together in the frame.
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
    use std::io::Write;

    /// Large enough that some boxes are read row by row and some joined.
    const LARGE: [usize; 3] = [300, 40, 20];

    fn spool(bytes: &[u8]) -> Bytes {
        let mut file = tempfile::tempfile().expect("temporary file");
        file.write_all(bytes).expect("writing");
        Bytes::Spool(file)
    }

    #[test]
    fn joined_reads_copy_the_same_as_single_ones() {
        let shape = Shape::new(LARGE, SampleType::U32).expect("shape");
        let voxels: Vec<u8> = (0..240_000_u32).flat_map(u32::to_le_bytes).collect();
        let name = || "frame".to_string();
        let frame = |bytes| Frame { bytes, offset: 3, big_endian: false, name: name() };
        let stored = [b"abc", voxels.as_slice()].concat();
        let bytes = vec![spool(&stored), Bytes::Memory(stored)];
        let frames = Frames { shape, bytes, frames: vec![frame(0), frame(1)] };
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
        for bytes in [spool(&stored), Bytes::Memory(stored.clone())] {
            let frame = |offset| Frame { bytes: 0, offset, big_endian: true, name: String::new() };
            let frames = vec![frame(0), frame(shape.frame_bytes() as u64)];
            check_window(&Frames { shape, bytes: vec![bytes], frames }, ty, 0);
        }
    }

    #[test]
    fn bytes_that_are_not_there_are_an_error() {
        let shape = Shape::new([2, 2, 2], SampleType::U8).expect("shape");
        for bytes in [spool(&[0; 7]), Bytes::Memory(vec![0; 7])] {
            let frame = Frame { bytes: 0, offset: 0, big_endian: false, name: "frame 9".into() };
            let frames = Frames { shape, bytes: vec![bytes], frames: vec![frame] };
            let whole = Region { start: [0; 3], end: [2; 3] };
            let error = frames.read_box(0, &whole, &mut [0; 8]).expect_err("too short");
            assert!(error.to_string().contains("reading frame 9"), "{error}");
        }
    }
}
