//! Selects the level parts of a block to read under a looser tolerance, and bounds the resulting errors of its samples.
//!
//! A certified limit leaves out the finest parts of a block as long as the errors of its samples stay within the limit.
//! A limit on the expected error (eq 27) leaves out parts by their expected error per byte, up to the same price for
//! all blocks. No other choice of these steps reads fewer bytes for the same expected error
//! ([Shoham](wavesplat_core::bibliography)).

use crate::render::batches::{BlockInfluence, alike};
use crate::render::config::RenderConfig;
use crate::render::report::LeftOut;
use std::collections::BTreeMap;
use wavesplat_core::base::grid::Grid;
use wavesplat_core::base::sample::magnitude;
use wavesplat_core::base::sample::{self, SampleType};
use wavesplat_core::codec::WindowCodec;
use wavesplat_format::{Basis, BlockEntry, BlockStats, PartEntry, PartKind};

/// The parts of a block to read, and the errors of its samples.
#[derive(Debug)]
pub(super) struct KeptParts {
    /// The block's entry without the parts that are left out.
    pub(super) entry: BlockEntry,
    /// The errors of its samples: first the error that holds in every frame, then one for each level part, to be
    /// multiplied by [`BlockSelector::gains`] in each frame.
    pub(super) errors: Vec<f64>,
    /// Error bound of every sample.
    pub(super) certified: f64,
    /// The mean square over pixels of the error that the block is expected to cause.
    pub(super) expected: f64,
    pub(super) left_out: LeftOut,
}

/// Selects the parts to read of a window's blocks.
#[derive(Debug)]
pub(super) struct BlockSelector {
    /// `gains[part][frame]`: [`WindowCodec::part_gains`].
    pub(super) gains: Vec<Vec<f64>>,
    /// The largest of each part's gains.
    largest_gain: Vec<f64>,
    /// For each part, the energy of samples as a multiple of the energy of their coefficients.
    energy_gain: Vec<f64>,
    /// Numbers of voxels that count as one (F of eq 27): for the error of leaving out each part and all finer parts,
    /// and last for the file's own errors.
    alike: Vec<f64>,
    /// Whether the directory's statistics of a part include all finer parts.
    cumulative: bool,
    /// The tiers above tier 0, and an upper bound of the coefficients that blocks begin with.
    tiers: u8,
    above: f64,
    /// The largest sum of absolute terms of a series whose samples are at most 1; none if the functions are not orthonormal.
    norm_of_ones: Option<f64>,
    frames: usize,
    /// The type of the samples, if values go to the side of a kept value on which their samples are.
    sided: Option<SampleType>,
    pub(super) rule: Rule,
}

/// The rule for leaving out parts.
#[derive(Debug, Clone, Copy)]
pub(super) enum Rule {
    /// Leaves out nothing.
    Nothing,
    /// Leaves out parts, from the finest on, while the error of every sample of the block stays within this limit.
    Within(f64),
    /// Leaves out all steps up to this price.
    Cheap(Cost),
}

/// The price of a step: expected error per byte saved, as a logarithm to base 2 in sixteenths. If all blocks use the
/// same price, no other choice of steps reads fewer bytes for the same expected error.
type Cost = i32;

/// A number of level parts, from the finest on, that are left out together.
#[derive(Debug, Clone, Copy, Default)]
struct Step {
    /// How many of a block's level parts are left out, counting all earlier steps.
    parts: usize,
    /// Stored bytes of these parts.
    bytes: u64,
    /// The mean square over pixels of the change that they cause.
    change: f64,
    price: Cost,
}

/// A block's entry with its influence on a view.
#[derive(Debug, Clone, Copy)]
pub(super) struct BlockView<'a> {
    pub(super) entry: &'a BlockEntry,
    pub(super) voxels: usize,
    pub(super) influence: BlockInfluence,
}

/// The change that left-out level parts of a block cause.
#[derive(Debug, Clone, Copy, Default)]
struct Alternative {
    largest: f64,
    energy: f64,
    /// The mean square over pixels of the change of samples.
    change: f64,
}

/// Finds the parts of a window that are cheapest to leave out.
#[derive(Debug)]
pub(super) struct RateAllocator<'a> {
    selector: &'a BlockSelector,
    /// The mean square of the file's own errors.
    own: f64,
    /// The summed change of all steps of each price.
    changes: BTreeMap<Cost, f64>,
}

impl<'a> RateAllocator<'a> {
    pub(super) fn new(selector: &'a BlockSelector) -> Self {
        Self { selector, own: 0.0, changes: BTreeMap::new() }
    }

    /// Adds the steps of a block.
    pub(super) fn add(&mut self, block: &BlockView<'_>) {
        self.own += self.selector.own(block);
        let mut before = 0.0;
        for step in self.selector.steps(block) {
            *self.changes.entry(step.price).or_default() += step.change - before;
            before = step.change;
        }
    }

    /// The rule that takes the cheapest steps, as long as they and the file's own errors have an expected mean square
    /// over pixels of at most `allowed`.
    pub(super) fn within(&self, allowed: f64) -> Rule {
        let mut sum = self.own;
        let affordable = self.changes.iter().take_while(|(_, change)| {
            sum += **change;
            sum <= allowed
        });
        affordable.last().map_or(Rule::Nothing, |(price, _)| Rule::Cheap(*price))
    }
}

impl BlockSelector {
    /// A selector that leaves out nothing yet. Blocks begin with coefficients of at most `above`.
    pub(super) fn new(codec: &WindowCodec, above: f64, config: &RenderConfig, grid: &Grid) -> Self {
        let gains = codec.part_gains();
        let largest_gain = gains.iter().map(|g| g.iter().copied().fold(0.0, f64::max)).collect();
        let cumulative = codec.scheme.pyramid.is_some();
        let alike = codec.sides_alike().into_iter().map(|side| alike(config, grid, side)).collect();
        let (energy_gain, frames) = (codec.energy_gains(), codec.frames());
        let (tiers, rule) = (codec.tiers(), Rule::Nothing);
        let norm_of_ones = match codec.scheme.basis {
            Basis::Samples => Some(1.0),
            Basis::Haar | Basis::Learned => Some((frames as f64).sqrt()),
            Basis::Multi => None,
        };
        let sided = (!codec.sides.is_empty()).then_some(codec.sample);
        Self { gains, largest_gain, energy_gain, alike, cumulative, tiers, above, norm_of_ones, frames, sided, rule }
    }

    /// The parts of a block to read: all but those that the rule leaves out. If zeros are within the limit, only the
    /// mask of missing samples is read.
    pub(super) fn keep(&self, block: &BlockView<'_>) -> KeptParts {
        let (entry, stats) = (block.entry, block.entry.stats);
        let mut kept = KeptParts {
            entry: entry.clone(),
            errors: vec![0.0; 1 + self.gains.len()],
            certified: stats.reached,
            expected: self.own(block),
            left_out: LeftOut::default(),
        };
        kept.errors[0] = stats.reached;
        match self.rule {
            Rule::Nothing => {}
            Rule::Within(allowed) if as_zero(entry) <= allowed => self.leave_all_out(block, &mut kept),
            Rule::Within(allowed) => self.leave_out_within(allowed, block, &mut kept),
            Rule::Cheap(price) => {
                let parts = self.steps(block).iter().take_while(|s| s.price <= price).last().map_or(0, |s| s.parts);
                let levels = levels(entry);
                levels[..parts].iter().fold(Alternative::default(), |without, part| {
                    let more = self.with(without, part, block);
                    self.leave_out(part, more, block, &mut kept);
                    more
                });
            }
        }
        kept.left_out = self.left_out(entry, &kept.entry);
        kept
    }

    fn leave_all_out(&self, block: &BlockView<'_>, kept: &mut KeptParts) {
        let as_zero = as_zero(block.entry);
        (kept.errors[0], kept.certified) = (as_zero, as_zero);
        let all = levels(block.entry).iter().fold(Alternative::default(), |w, part| self.with(w, part, block));
        // The directory does not have the energy of exact samples, nor of the nodes above.
        kept.expected = if block.entry.is_exact() || block.entry.begins_above(self.tiers) {
            finite(as_zero * as_zero * block.influence.for_alike(f64::INFINITY))
        } else {
            kept.expected + all.change
        };
        kept.entry.parts.retain(|p| p.kind == PartKind::Missing);
        kept.entry.stats.step = 0.0; // so that it does not begin with the nodes above
    }

    fn leave_out_within(&self, allowed: f64, block: &BlockView<'_>, kept: &mut KeptParts) {
        let mut without = Alternative::default();
        for part in levels(block.entry) {
            let more = self.with(without, &part, block);
            if self.certified(block, more.largest) <= allowed {
                self.leave_out(&part, more, block, kept);
                without = more;
            } else if self.cumulative {
                break;
            }
        }
    }

    /// Leaves out a part. `without` is the change caused by all left-out parts, this one included.
    fn leave_out(&self, part: &LevelPart, without: Alternative, block: &BlockView<'_>, kept: &mut KeptParts) {
        kept.certified = self.certified(block, without.largest);
        kept.errors[0] = self.certified(block, 0.0);
        kept.expected = self.own(block) + without.change;
        if self.cumulative {
            kept.errors[1..].fill(0.0);
        }
        kept.errors[1 + part.level] = part.entry.stats.largest;
        // Sides and sums say how fully decoded samples change.
        let changes = [part.entry.kind, PartKind::Sides, PartKind::Sums];
        kept.entry.parts.retain(|p| !changes.contains(&p.kind));
    }

    /// The error of samples that leaving out parts changes by at most `largest`. Values beside a kept value become samples, rounded to their
    /// type.
    fn certified(&self, block: &BlockView<'_>, largest: f64) -> f64 {
        let stats = &block.entry.stats;
        let magnitude = magnitude((stats.min, stats.max)) + stats.reached + largest;
        let rounding = self.sided.map_or(0.0, |ty| sample::rounding(ty, magnitude));
        (stats.reached + largest + rounding).next_up()
    }

    /// The change caused by the parts of `without` and one more part.
    fn with(&self, without: Alternative, part: &LevelPart, block: &BlockView<'_>) -> Alternative {
        let (level, stats) = (part.level, part.entry.stats);
        let energy = stats.energy * self.energy_gain[level];
        let largest = stats.largest * self.largest_gain[level];
        let (largest, energy, more) = if self.cumulative {
            (largest, energy, (energy - without.energy).max(0.0))
        } else {
            (without.largest + largest, without.energy + energy, energy)
        };
        let change = finite(without.change + self.in_pixels(more, self.alike[level], block));
        Alternative { largest: largest.next_up(), energy, change }
    }

    /// The mean square over pixels of the file's own errors.
    fn own(&self, block: &BlockView<'_>) -> f64 {
        self.in_pixels(block.entry.stats.squared_error, self.alike[self.alike.len() - 1], block)
    }

    fn in_pixels(&self, energy: f64, alike: f64, block: &BlockView<'_>) -> f64 {
        finite(energy / (self.frames * block.voxels) as f64 * block.influence.for_alike(alike))
    }

    /// The steps of leaving out a block's parts, by ascending price per byte; none for a block that influences no
    /// pixel.
    fn steps(&self, block: &BlockView<'_>) -> Vec<Step> {
        let (mut steps, mut at, mut without) = (vec![Step::default()], Step::default(), Alternative::default());
        for part in levels(block.entry) {
            without = self.with(without, &part, block);
            at = Step {
                parts: at.parts + 1,
                bytes: at.bytes + u64::from(part.entry.stored_len),
                change: without.change,
                price: 0,
            };
            while let [.., before, last] = steps[..]
                && price(&before, &at) <= last.price
            {
                steps.pop();
            }
            at.price = price(&steps[steps.len() - 1], &at);
            steps.push(at);
        }
        steps.remove(0);
        steps.retain(|_| !block.influence.is_nothing());
        steps
    }

    /// The parts of a whole entry that `kept` lacks.
    pub(super) fn left_out(&self, entry: &BlockEntry, kept: &BlockEntry) -> LeftOut {
        let parts = || entry.parts.iter().filter(|p| kept.part(p.kind).is_none());
        LeftOut {
            blocks: u64::from(self.is_nothing(kept) && !self.is_nothing(entry)),
            parts: parts().count() as u64,
            coefficients: parts().filter(|p| matches!(p.kind, PartKind::Level(_))).map(|p| p.stats.count).sum(),
            bytes: parts().map(|p| u64::from(p.stored_len)).sum(),
        }
    }

    /// Whether all samples of a block are zero and none is missing.
    pub(super) fn is_nothing(&self, entry: &BlockEntry) -> bool {
        entry.parts.is_empty() && !entry.begins_above(self.tiers)
    }

    /// An upper bound of the sum of absolute terms c_k u_k(t) of any sample of a block: from the changes that its parts cause, or
    /// from its samples.
    pub(super) fn absolute_sum(&self, entry: &BlockEntry) -> f64 {
        let levels = levels(entry).into_iter();
        let each = levels.map(|part| part.entry.stats.largest * self.largest_gain[part.level]);
        let changes = if self.cumulative { each.fold(0.0, f64::max) } else { each.sum() };
        let of_above = if entry.begins_above(self.tiers) { self.above * self.largest_gain[0] } else { 0.0 };
        changes + self.bound_by_samples(entry).map_or(of_above, |bound| bound.min(of_above))
    }

    /// As [`Self::absolute_sum`], from the samples, for blocks without outliers, missing or exact samples: with orthonormal functions,
    /// the sum is at most the norm of the series.
    fn bound_by_samples(&self, entry: &BlockEntry) -> Option<f64> {
        let stored = [PartKind::Outliers, PartKind::Missing, PartKind::Exact, PartKind::Listed, PartKind::Sides];
        let is_decoded = stored.iter().all(|kind| entry.part(*kind).is_none());
        let BlockStats { min, max, reached, .. } = entry.stats;
        // Neither what is splatted nor the source is farther from the stored range than the error.
        let largest = magnitude((min, max)) + 2.0 * reached;
        self.norm_of_ones.filter(|_| is_decoded && min <= max).map(|norm| norm * largest * ORTHONORMAL)
    }
}

/// Allows for functions that are orthonormal only up to rounding.
const ORTHONORMAL: f64 = 1.0 + 1e-9;

/// The price of going from one step to the next.
fn price(from: &Step, to: &Step) -> Cost {
    let bytes = to.bytes.saturating_sub(from.bytes).max(1) as f64;
    let each = ((to.change - from.change).max(0.0) / bytes).clamp(f64::MIN_POSITIVE, f64::MAX);
    (16.0 * libm::log2(each)).floor() as Cost
}

/// The largest absolute value of a block's samples, errors included.
fn as_zero(entry: &BlockEntry) -> f64 {
    (magnitude((entry.stats.min, entry.stats.max)) + entry.stats.reached).next_up()
}

/// Maps infinite energies to the largest number, and infinite energies without influence (NaN) to 0.
fn finite(change: f64) -> f64 {
    if change.is_nan() { 0.0 } else { change.min(f64::MAX) }
}

/// A level part of a block.
#[derive(Debug, Clone, Copy)]
struct LevelPart {
    level: usize,
    entry: PartEntry,
}

/// The level parts of a block, finest first.
fn levels(entry: &BlockEntry) -> Vec<LevelPart> {
    let level = |entry: &PartEntry| match entry.kind {
        PartKind::Level(level) => Some(LevelPart { level: level.into(), entry: *entry }),
        _ => None,
    };
    entry.parts.iter().rev().filter_map(level).collect()
}
