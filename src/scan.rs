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

/// Looks at every sample of a window; planes in parallel, joined in order.
pub(crate) fn scan(
    window: &dyn FrameWindow,
    grid: &Grid,
    ty: SampleType,
    is_missing: impl Fn(f64) -> bool + Sync,
) -> Result<Scan> {
    let plane_voxels = grid.dims[0] * grid.dims[1];
    let planes: Result<Vec<Scan>> = (0..window.frames() * grid.dims[2])
        .into_par_iter()
        .map_init(Vec::new, |bytes, index| {
            let (frame, z) = (index / grid.dims[2], index % grid.dims[2]);
            let plane = Region { start: [0, 0, z], end: [grid.dims[0], grid.dims[1], z + 1] };
            bytes.resize(plane_voxels * ty.size(), 0);
            window.read_box(frame, &plane, bytes)?;
            Ok(scan_plane(bytes, ty, &is_missing, (frame, z * plane_voxels)))
        })
        .collect();
    Ok(planes?.into_iter().fold(Scan::NOTHING, Scan::then))
}

fn scan_plane(bytes: &[u8], ty: SampleType, is_missing: impl Fn(f64) -> bool, (frame, at): (usize, usize)) -> Scan {
    const CHUNK: usize = 512;
    let mut seen = Scan { digest: xxh3_64_with_seed(bytes, 0), ..Scan::NOTHING };
    let mut values = [0.0; CHUNK];
    for (chunk, bytes) in bytes.chunks(CHUNK * ty.size()).enumerate() {
        let values = &mut values[..bytes.len() / ty.size()];
        sample::load(ty, bytes, values);
        for (i, v) in values.iter().enumerate() {
            if is_missing(*v) {
                seen.missing += 1;
                seen.first_missing.get_or_insert((frame, at + chunk * CHUNK + i));
            } else {
                seen.range = (seen.range.0.min(*v), seen.range.1.max(*v));
            }
        }
    }
    seen
}
