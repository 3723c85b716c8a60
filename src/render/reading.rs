//! What is read of a block under a looser tolerance, and how far its samples may then be from the source's.

use super::SampleError;
use super::scene::{LeftOut, SampleErrorReport};
use crate::codec::WindowCodec;
use crate::sample::magnitude;
use wavesplat_format::{Basis, BlockEntry, PartEntry, PartKind};

/// What is read of a block.
#[derive(Debug)]
pub(super) struct Kept {
    /// Its entry, without the parts that are left out.
    pub(super) entry: BlockEntry,
    /// The error of its samples: first what holds in every frame, then for each level part what counts
    /// [`Allowance::gains`] times in a frame.
    pub(super) errors: Vec<f64>,
    /// What that comes to.
    pub(super) samples: SampleErrorReport,
    pub(super) left_out: LeftOut,
}

/// Decides what of a window's blocks is read.
#[derive(Debug)]
pub(super) struct Allowance {
    /// `gains[part][frame]`: [`WindowCodec::part_gains`].
    pub(super) gains: Vec<Vec<f64>>,
    /// The largest of each part's gains.
    largest_gain: Vec<f64>,
    /// Whether what the directory says of a part counts all finer ones, too.
    cumulative: bool,
    /// The energy of samples is at most so many times that of their coefficients.
    energy_gain: f64,
    frames: usize,
    /// How far a sample may be from the source's, and by which measure; none: leave nothing out.
    allowed: Option<(f64, SampleError)>,
}

/// What some level parts of a block come to where they are left out.
#[derive(Debug, Clone, Copy, Default)]
struct Without {
    largest: f64,
    energy: f64,
}

impl Allowance {
    pub(super) fn new(codec: &WindowCodec, allowed: Option<(f64, SampleError)>) -> Self {
        let gains = codec.part_gains();
        let largest_gain = gains.iter().map(|g| g.iter().copied().fold(0.0, f64::max)).collect();
        let cumulative = codec.scheme.pyramid.is_some();
        let energy_gain = if codec.scheme.basis == Basis::Multi { MULTI_ENERGY } else { 1.0 };
        Self { gains, largest_gain, cumulative, energy_gain, frames: codec.frames(), allowed }
    }

    /// What is read of a block of so many voxels: of one that is as good as zero nothing but what is missing, else all but
    /// the parts, from the finest on, whose effect fits in what is allowed.
    pub(super) fn keep(&self, entry: &BlockEntry, voxels: usize) -> Kept {
        let stats = entry.stats;
        let as_zero = (magnitude((stats.min, stats.max)) + stats.reached).next_up();
        let mut kept = Kept {
            entry: entry.clone(),
            errors: vec![0.0; 1 + self.gains.len()],
            samples: self.errors(entry, voxels, Without::default()),
            left_out: LeftOut::default(),
        };
        kept.errors[0] = stats.reached;
        match self.allowed {
            Some((allowed, _)) if as_zero <= allowed => {
                kept.errors[0] = as_zero;
                kept.samples = SampleErrorReport { certified_sample_error: as_zero, expected_sample_error: as_zero };
                kept.entry.parts.retain(|p| p.kind == PartKind::Missing);
            }
            Some((allowed, measure)) => self.leave_out_levels(allowed, measure, voxels, &mut kept),
            None => {}
        }
        kept.left_out = left_out(entry, &kept.entry);
        kept
    }

    fn leave_out_levels(&self, allowed: f64, measure: SampleError, voxels: usize, kept: &mut Kept) {
        let levels: Vec<(usize, PartEntry)> = kept.entry.parts.iter().rev().filter_map(level_of).collect();
        let mut without = Without::default();
        for (level, part) in levels {
            let more = self.with(without, level, &part);
            let samples = self.errors(&kept.entry, voxels, more);
            let error = match measure {
                SampleError::Certified => samples.certified_sample_error,
                SampleError::Expected => samples.expected_sample_error,
            };
            if error <= allowed {
                (without, kept.samples) = (more, samples);
                if self.cumulative {
                    kept.errors[1..].fill(0.0);
                }
                kept.errors[1 + level] = part.stats.largest;
                kept.entry.parts.retain(|p| p.kind != part.kind);
            } else if self.cumulative {
                break;
            }
        }
    }

    /// What parts come to with one more.
    fn with(&self, without: Without, level: usize, part: &PartEntry) -> Without {
        let before = if self.cumulative { Without::default() } else { without };
        let largest = (before.largest + part.stats.largest * self.largest_gain[level]).next_up();
        Without { largest, energy: before.energy + part.stats.energy * self.energy_gain }
    }

    /// The errors of a block's samples without some parts. The root of a mean square is at most the sum of those of the
    /// file's own errors and of what is left out.
    fn errors(&self, entry: &BlockEntry, voxels: usize, without: Without) -> SampleErrorReport {
        let missing = entry.part(PartKind::Missing).map_or(0, |part| part.stats.count as usize);
        let samples = (self.frames * voxels).saturating_sub(missing).max(1) as f64;
        let rms = |squares: f64| (squares / samples).sqrt();
        let certified = (entry.stats.reached + without.largest).next_up();
        let expected = rms(entry.stats.squared_error) + rms(without.energy);
        SampleErrorReport { certified_sample_error: certified, expected_sample_error: expected.min(certified) }
    }

    /// An upper bound of the sum of absolute terms c_k u_k(t) of any sample of a block.
    pub(super) fn absolute_sum(&self, entry: &BlockEntry) -> f64 {
        let levels = entry.parts.iter().filter_map(level_of);
        let each = levels.map(|(level, part)| part.stats.largest * self.largest_gain[level]);
        if self.cumulative { each.fold(0.0, f64::max) } else { each.sum() }
    }
}

/// Multiwavelets are orthonormal as functions, not as samples: 4.03 for three frames, less for more (method.md section 3).
const MULTI_ENERGY: f64 = 4.1;

fn level_of(part: &PartEntry) -> Option<(usize, PartEntry)> {
    if let PartKind::Level(level) = part.kind { Some((level.into(), *part)) } else { None }
}

/// The difference between a whole entry and what is kept of it.
fn left_out(entry: &BlockEntry, kept: &BlockEntry) -> LeftOut {
    let parts = || entry.parts.iter().filter(|p| kept.part(p.kind).is_none());
    LeftOut {
        blocks: u64::from(kept.parts.is_empty() && !entry.parts.is_empty()),
        parts: parts().count() as u64,
        coefficients: parts().filter_map(level_of).map(|(_, p)| p.stats.count).sum(),
        bytes: parts().map(|p| u64::from(p.stored_len)).sum(),
    }
}
