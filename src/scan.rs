//! One look at all samples of a window before it is coded: value range, missing samples, a digest.

use crate::error::Result;
use crate::sample::{self, SampleType};
use crate::source::FrameWindow;
use crate::volume::{Grid, Region};
use rayon::prelude::*;
use xxhash_rust::xxh3::xxh3_64_with_seed;

/// What was seen.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Scan {
    /// Range of the samples that are not missing; (inf, -inf) if all are.
    pub(crate) range: (f64, f64),
    /// Missing samples.
    pub(crate) missing: u64,
    /// The first of them: frame within the window, and index of the voxel within the frame.
    pub(crate) first_missing: Option<(usize, usize)>,
    /// A digest of all samples, the same for every way in which they can be stored.
    pub(crate) digest: u64,
}

impl Scan {
    const NOTHING: Self =
        Self { range: (f64::INFINITY, f64::NEG_INFINITY), missing: 0, first_missing: None, digest: 0 };

    /// What two consecutive stretches hold together.
    fn then(self, next: Self) -> Self {
        let mut digests = [0; 16];
        digests[..8].copy_from_slice(&self.digest.to_le_bytes());
        digests[8..].copy_from_slice(&next.digest.to_le_bytes());
        Self {
            range: join_ranges(self.range, next.range),
            missing: self.missing + next.missing,
            first_missing: self.first_missing.or(next.first_missing),
            digest: xxh3_64_with_seed(&digests, 0),
        }
    }
}

/// The smallest range that holds both.
pub(crate) fn join_ranges(a: (f64, f64), b: (f64, f64)) -> (f64, f64) {
    (a.0.min(b.0), a.1.max(b.1))
}

/// Looks at every sample of a window; planes in parallel, joined in order. `declared` stands for a missing sample.
pub(crate) fn scan(window: &dyn FrameWindow, grid: &Grid, ty: SampleType, declared: Option<f64>) -> Result<Scan> {
    let plane_voxels = grid.dims[0] * grid.dims[1];
    let planes: Result<Vec<Scan>> = (0..window.frames() * grid.dims[2])
        .into_par_iter()
        .map_init(Vec::new, |bytes, index| {
            let (frame, z) = (index / grid.dims[2], index % grid.dims[2]);
            let plane = Region { start: [0, 0, z], end: [grid.dims[0], grid.dims[1], z + 1] };
            bytes.resize(plane_voxels * ty.size(), 0);
            window.read_box(frame, &plane, bytes)?;
            Ok(scan_plane(bytes, ty, declared, (frame, z * plane_voxels)))
        })
        .collect();
    Ok(planes?.into_iter().fold(Scan::NOTHING, Scan::then))
}

fn scan_plane(bytes: &[u8], ty: SampleType, declared: Option<f64>, (frame, at): (usize, usize)) -> Scan {
    let mut seen = Scan { digest: xxh3_64_with_seed(bytes, 0), ..Scan::NOTHING };
    sample::for_each_run(ty, bytes, |first, values| {
        if let Some(range) = sample::range_unless_missing(values, declared) {
            seen.range = join_ranges(seen.range, range);
            return;
        }
        for (i, v) in values.iter().enumerate() {
            if sample::is_missing(*v, declared) {
                seen.missing += 1;
                seen.first_missing.get_or_insert((frame, at + first + i));
            } else {
                seen.range = join_ranges(seen.range, (*v, *v));
            }
        }
    });
    seen
}
