//! What is read of a block under a looser tolerance, and how far its samples may then be from the source's.

use super::scene::LeftOut;
use crate::codec::WindowCodec;
use crate::sample::magnitude;
use wavesplat_format::{BlockEntry, PartEntry, PartKind};

/// What is read of a block.
#[derive(Debug)]
pub(super) struct Kept {
    /// Its entry, without the parts that are left out.
    pub(super) entry: BlockEntry,
    /// The error of its samples: first what holds in every frame, then for each level part what counts
    /// [`Allowance::gains`] times in a frame.
    pub(super) errors: Vec<f64>,
    pub(super) left_out: LeftOut,
}

/// Decides what of a window's blocks is read.
#[derive(Debug)]
pub(super) struct Allowance {
    /// `gains[part][frame]`: [`WindowCodec::part_gains`].
    pub(super) gains: Vec<Vec<f64>>,
    /// The largest of each part's gains.
    largest_gain: Vec<f64>,
    /// Whether a part's largest counts all finer ones, too.
    cumulative: bool,
    /// How far a sample may be from the source's; none: leave nothing out.
    allowed: Option<f64>,
}

impl Allowance {
    pub(super) fn new(codec: &WindowCodec, allowed: Option<f64>) -> Self {
        let gains = codec.part_gains();
        let largest_gain = gains.iter().map(|g| g.iter().copied().fold(0.0, f64::max)).collect();
        Self { gains, largest_gain, cumulative: codec.scheme.pyramid.is_some(), allowed }
    }

    /// What is read of a block: of one that is as good as zero nothing but what is missing, else all but the parts, from
    /// the finest on, whose largest effect fits in what is allowed.
    pub(super) fn keep(&self, entry: &BlockEntry) -> Kept {
        let mut errors = vec![0.0; 1 + self.gains.len()];
        errors[0] = entry.stats.reached;
        let mut kept = entry.clone();
        let as_zero = (magnitude((entry.stats.min, entry.stats.max)) + entry.stats.reached).next_up();
        match self.allowed {
            Some(allowed) if as_zero <= allowed => {
                errors[0] = as_zero;
                kept.parts.retain(|p| p.kind == PartKind::Missing);
            }
            Some(allowed) => self.leave_out_levels(allowed, &mut kept, &mut errors),
            None => {}
        }
        let left_out = left_out(entry, &kept);
        Kept { entry: kept, errors, left_out }
    }

    fn leave_out_levels(&self, allowed: f64, kept: &mut BlockEntry, errors: &mut [f64]) {
        let mut total = errors[0];
        let levels: Vec<(usize, PartEntry)> = kept.parts.iter().rev().filter_map(level_of).collect();
        for (level, part) in levels {
            let before = if self.cumulative { errors[0] } else { total };
            let with = (before + part.stats.largest * self.largest_gain[level]).next_up();
            if with <= allowed {
                total = with;
                if self.cumulative {
                    errors[1..].fill(0.0);
                }
                errors[1 + level] = part.stats.largest;
                kept.parts.retain(|p| p.kind != part.kind);
            } else if self.cumulative {
                break;
            }
        }
    }

    /// An upper bound of the sum of absolute terms c_k u_k(t) of any sample of a block.
    pub(super) fn absolute_sum(&self, entry: &BlockEntry) -> f64 {
        let levels = entry.parts.iter().filter_map(level_of);
        let each = levels.map(|(level, part)| part.stats.largest * self.largest_gain[level]);
        if self.cumulative { each.fold(0.0, f64::max) } else { each.sum() }
    }
}

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
