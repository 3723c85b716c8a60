//! The sizes that a block's parts can have, from the metadata.

use crate::block::PartKind;
use crate::bytes::{Check, ensure};
use crate::directory::PartEntry;
use crate::planes::bitmap_len;

/// The sizes of one block.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct BlockGeometry<'a> {
    /// Voxels of its box, clipped at the volume's far faces.
    pub voxels: usize,
    /// Frames of its window.
    pub frames: usize,
    /// Coefficients of one voxel in each level part, coarse to fine.
    pub levels: &'a [u32],
    /// Bytes of one sample.
    pub sample_size: usize,
}

impl BlockGeometry<'_> {
    /// Frames x voxels.
    pub fn samples(&self) -> usize {
        self.frames.saturating_mul(self.voxels)
    }

    /// Codes in the part of a level; none for a level that the window lacks.
    pub fn codes(&self, level: u8) -> Option<usize> {
        self.levels.get(usize::from(level)).map(|&k| (k as usize).saturating_mul(self.voxels))
    }

    /// The largest `count` of a part.
    fn max_count(&self, kind: PartKind) -> u64 {
        match kind {
            PartKind::Level(level) => self.codes(level).unwrap_or(0) as u64,
            _ => self.samples() as u64,
        }
    }

    /// Bytes before compression of a part with `count` things of `width` bytes; `width` matters to levels alone.
    fn raw_len(&self, kind: PartKind, count: u64, width: u64) -> u64 {
        let size = self.sample_size as u64;
        match kind {
            PartKind::Level(level) => {
                1 + bitmap_len(self.codes(level).unwrap_or(0)) as u64 + count.saturating_mul(width)
            }
            PartKind::Outliers => count.saturating_mul(4 + size),
            PartKind::Missing => (bitmap_len(self.samples()) as u64).saturating_add(count.saturating_mul(size)),
            PartKind::Exact => count.saturating_mul(size),
        }
    }

    /// The largest possible payload of a part before compression, in bytes.
    pub fn max_raw_len(&self, kind: PartKind) -> u64 {
        self.raw_len(kind, self.max_count(kind), 4)
    }

    /// Whether a part can have its count and its length here.
    pub(crate) fn check(&self, part: &PartEntry) -> Check {
        let (kind, count, raw_len) = (part.kind, part.stats.count, u64::from(part.raw_len));
        if let PartKind::Level(level) = kind {
            ensure(self.codes(level).is_some(), || format!("{kind} of {} levels", self.levels.len()))?;
        }
        let most = self.max_count(kind);
        let least = if kind == PartKind::Exact { most } else { 1 };
        ensure((least..=most).contains(&count), || format!("{kind}: a count of {count}, at most {most}"))?;
        let widths = if matches!(kind, PartKind::Level(_)) { 1..=4 } else { 1..=1 };
        let possible = widths.into_iter().any(|width| self.raw_len(kind, count, width) == raw_len);
        ensure(possible, || format!("{kind}: {raw_len} bytes do not fit a count of {count}"))
    }
}
