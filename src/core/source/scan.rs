//! Reads all samples of a window before it is coded: value range, missing samples, a digest.

use crate::base::error::Result;
use crate::base::grid::{Grid, Region};
use crate::base::progress::Progress;
use crate::base::sample::{self, SampleType, join_ranges};
use crate::source::extremes::ExtremeCounts;
use crate::source::{FrameSource, FrameWindow};
use rayon::prelude::*;
use std::cell::Cell;
use xxhash_rust::xxh3::xxh3_64_with_seed;

/// The result of a scan.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Scan {
    /// Range of the samples that are not missing; (inf, -inf) if all are.
    pub range: (f64, f64),
    /// How often the smallest and the largest value occur, and the next values.
    pub extremes: ExtremeCounts,
    /// Missing samples.
    pub missing: u64,
    /// The first missing sample: frame within the window, and index of the voxel within the frame.
    pub first_missing: Option<(usize, usize)>,
    /// A digest of all samples, the same for every way in which they can be stored.
    pub digest: u64,
}

impl Scan {
    /// No samples yet.
    pub const NOTHING: Self = Self {
        range: (f64::INFINITY, f64::NEG_INFINITY),
        extremes: ExtremeCounts::NONE,
        missing: 0,
        first_missing: None,
        digest: 0,
    };

    /// The results of two consecutive runs as one.
    fn then(self, next: Self) -> Self {
        let mut digests = [0; 16];
        digests[..8].copy_from_slice(&self.digest.to_le_bytes());
        digests[8..].copy_from_slice(&next.digest.to_le_bytes());
        Self {
            range: join_ranges(self.range, next.range),
            extremes: self.extremes.join(next.extremes),
            missing: self.missing + next.missing,
            first_missing: self.first_missing.or(next.first_missing),
            digest: xxh3_64_with_seed(&digests, 0),
        }
    }
}

/// Bytes of the rows that are looked at together. Fixed, since the digest depends on it.
const RUN_BYTES: usize = 256 << 10;

thread_local! {
    /// The bytes of a run. Fresh memory for every frame would take longer than looking at it.
    static BYTES: Cell<Vec<u8>> = const { Cell::new(Vec::new()) };
}

/// Looks at every sample of a window. `declared` stands for a missing sample.
pub fn scan(window: &dyn FrameWindow, grid: &Grid, ty: SampleType, declared: Option<f64>) -> Result<Scan> {
    (0..window.frames()).try_fold(Scan::NOTHING, |seen, frame| scan_frame(seen, window, frame, grid, ty, declared))
}

/// The range of all samples of an archive whose frames can be read again; none if all are missing. `declared` stands
/// for a missing sample.
///
/// # Errors
/// Frames that cannot be read.
pub fn value_range(
    source: &mut dyn FrameSource,
    declared: Option<f64>,
    progress: &dyn Progress,
) -> Result<Option<(f64, f64)>> {
    let (grid, ty, frames) = (source.archive().grid, source.archive().sample, source.archive().frames.unwrap_or(0));
    let declared = sample::missing_value(ty, declared);
    progress.start(Some(frames as u64));
    let mut range = Scan::NOTHING.range;
    for frame in 0..frames {
        progress.check()?;
        let window = source.window(frame, 1)?;
        range = join_ranges(range, scan(window.as_ref(), &grid, ty, declared)?.range);
        window.check_unchanged()?;
        progress.advance(1);
    }
    progress.finish();
    Ok(Some(range).filter(|(lo, hi)| lo <= hi))
}

/// Scans every sample of a frame, and adds the result to `seen`. Runs of rows are scanned in parallel, unless the frame is small, and joined in order.
pub fn scan_frame(
    seen: Scan,
    window: &dyn FrameWindow,
    frame: usize,
    grid: &Grid,
    ty: SampleType,
    declared: Option<f64>,
) -> Result<Scan> {
    let [nx, ny, nz] = grid.dims;
    let rows = (RUN_BYTES / (nx * ty.size())).clamp(1, ny);
    let runs_in_plane = ny.div_ceil(rows);
    let scanned = |index| {
        let (z, y) = (index / runs_in_plane, index % runs_in_plane * rows);
        let run = Region { start: [0, y, z], end: [nx, (y + rows).min(ny), z + 1] };
        let mut bytes = BYTES.take();
        bytes.resize(run.voxels() * ty.size(), 0);
        window.read_box(frame, &run, &mut bytes)?;
        let found = scan_run(&bytes, ty, declared, &seen.extremes, frame, (z * ny + y) * nx);
        BYTES.set(bytes);
        Ok(found)
    };
    let all = 0..nz * runs_in_plane;
    let runs: Result<Vec<Scan>> = match nx * ny * nz * ty.size() {
        ..=RUN_BYTES => all.map(scanned).collect(), // waking a thread takes longer
        _ => all.into_par_iter().map(scanned).collect(),
    };
    Ok(runs?.into_iter().fold(seen, Scan::then))
}

/// Looks at a run of a frame's samples; `at` is the index of its first voxel. The result is to be joined with what was `seen`.
fn scan_run(
    bytes: &[u8],
    ty: SampleType,
    declared: Option<f64>,
    seen: &ExtremeCounts,
    frame: usize,
    at: usize,
) -> Scan {
    let mut seen = Scan { digest: xxh3_64_with_seed(bytes, 0), extremes: seen.none_beside(), ..Scan::NOTHING };
    let (mut range, mut extremes) = (seen.range, seen.extremes);
    let missing = |i| {
        seen.missing += 1;
        seen.first_missing.get_or_insert((frame, at + i));
    };
    sample::for_each_present(ty, bytes, declared, missing, |values, run| {
        range = join_ranges(range, run);
        extremes.add(values, run.0, run.1);
    });
    Scan { range, extremes, ..seen }
}
