//! What input files say of themselves, in the same words for every format.

use super::frames::Shape;
use super::{Parsed, base64};
use crate::error::{Error, Result};
use crate::mapped::{FileBytes, State};
use crate::volume::Grid;
use std::path::PathBuf;

/// The files of an archive, in order.
#[derive(Debug, Default)]
pub(super) struct Files {
    /// The files, at least one, none twice.
    pub(super) paths: Vec<PathBuf>,
    /// Time of each where a list says so, else empty.
    pub(super) times: Vec<f64>,
    /// What a user should know about how they were found.
    pub(super) notes: Vec<String>,
}

/// Some frames in one file, one after another.
#[derive(Debug)]
pub(super) struct Part {
    /// The file.
    pub(super) path: PathBuf,
    /// Its state when it was checked.
    pub(super) state: State,
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

    /// The lattice of every frame.
    pub(super) fn grid(&self) -> Grid {
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

/// The first bytes of a file, fewer if it is shorter.
pub(super) fn head(file: &FileBytes, bytes: usize) -> Result<Vec<u8>> {
    let len = usize::try_from(file.len()).unwrap_or(usize::MAX).min(bytes);
    let mut head = vec![0; len];
    file.read_at(0, &mut head).map_err(|e| Error::io(file.path(), "reading the header", e))?;
    Ok(head)
}
