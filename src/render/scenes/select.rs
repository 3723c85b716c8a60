//! Which level parts of a block are read under a looser tolerance, and how far its samples may then be off.
//!
//! A certified limit leaves out the finest parts of a block for as long as none of its samples is further off. A limit
//! on the expected error (eq 27) leaves out parts by their expected error per byte, up to the same price for all
//! blocks: no other choice of these steps reads fewer bytes for the same expected error
//! ([Shoham](crate::bibliography)).

use crate::base::grid::Grid;
use crate::base::sample::magnitude;
use crate::codec::WindowCodec;
use crate::render::config::RenderConfig;
use crate::render::expectation::{BlockInfluence, alike};
use crate::render::scene::LeftOut;
use std::collections::BTreeMap;
use wavesplat_format::{BlockEntry, PartEntry, PartKind};

/// What is read of a block.
#[derive(Debug)]
pub(super) struct KeptParts {
    /// Its entry, without the parts that are left out.
    pub(super) entry: BlockEntry,
    /// The error of its samples: first what holds in every frame, then for each level part what counts
    /// [`BlockSelector::gains`] times in a frame.
    pub(super) errors: Vec<f64>,
    /// No sample is further off.
    pub(super) certified: f64,
    /// What its errors are expected to come to in the mean square over pixels.
    pub(super) expected: f64,
    pub(super) left_out: LeftOut,
}

/// Decides what of a window's blocks is read.
#[derive(Debug)]
pub(super) struct BlockSelector {
    /// `gains[part][frame]`: [`WindowCodec::part_gains`].
    pub(super) gains: Vec<Vec<f64>>,
    /// The largest of each part's gains.
    largest_gain: Vec<f64>,
    /// Of each part: what the energy of samples is as a multiple of that of their coefficients.
    energy_gain: Vec<f64>,
    /// How many voxels err as one: in what a part and finer ones change, and last in the file's own errors.
    alike: Vec<f64>,
    /// Whether what the directory says of a part counts all finer ones, too.
    cumulative: bool,
    frames: usize,
    pub(super) rule: Rule,
}

/// What may be left out.
#[derive(Debug, Clone, Copy)]
pub(super) enum Rule {
    /// Nothing.
    Nothing,
    /// All parts, from the finest on, with which no sample of their block is further off.
    Within(f64),
    /// Steps of at most this price.
    Cheap(Cost),
}

/// What a step costs in expected error for each byte that need not be read, in sixteenths of powers of two. With the
/// same for all blocks, no other choice of steps reads fewer bytes for the same expected error.
type Cost = i32;

/// Some level parts, from the finest on, of which none is left out without all before it.
#[derive(Debug, Clone, Copy, Default)]
struct Step {
    /// How many of a block's level parts are left out with it.
    parts: usize,
    /// What is then not read.
    bytes: u64,
    /// The mean square of what they change.
    change: f64,
    price: Cost,
}

/// A block as its entry and the view have it.
#[derive(Debug, Clone, Copy)]
pub(super) struct BlockView<'a> {
    pub(super) entry: &'a BlockEntry,
    pub(super) voxels: usize,
    pub(super) influence: BlockInfluence,
}

/// What some level parts of a block come to where they are left out.
#[derive(Debug, Clone, Copy, Default)]
struct Alternative {
    largest: f64,
    energy: f64,
    /// Of the samples, in the mean square over pixels.
    change: f64,
}

/// Finds what is cheapest to leave out of a window.
#[derive(Debug)]
pub(super) struct RateAllocator<'a> {
    selector: &'a BlockSelector,
    /// The mean square of the file's own errors.
    own: f64,
    /// What the steps of each price come to.
    changes: BTreeMap<Cost, f64>,
}

impl<'a> RateAllocator<'a> {
    pub(super) fn new(selector: &'a BlockSelector) -> Self {
        Self { selector, own: 0.0, changes: BTreeMap::new() }
    }

    /// Goes on to a further block.
    pub(super) fn add(&mut self, block: &BlockView<'_>) {
        self.own += self.selector.own(block);
        let mut before = 0.0;
        for step in self.selector.steps(block) {
            *self.changes.entry(step.price).or_default() += step.change - before;
            before = step.change;
        }
    }

    /// The steps, those first that cost least for each byte, that together with the file's own errors are expected to
    /// come to at most `allowed` in the mean square over pixels.
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
    /// Leaves nothing out yet.
    pub(super) fn new(codec: &WindowCodec, config: &RenderConfig, grid: &Grid) -> Self {
        let gains = codec.part_gains();
        let largest_gain = gains.iter().map(|g| g.iter().copied().fold(0.0, f64::max)).collect();
        let cumulative = codec.scheme.pyramid.is_some();
        let alike = codec.sides_alike().into_iter().map(|side| alike(config, grid, side)).collect();
        let (energy_gain, frames) = (codec.energy_gains(), codec.frames());
        Self { gains, largest_gain, energy_gain, alike, cumulative, frames, rule: Rule::Nothing }
    }

    /// What is read of a block: of one that is as good as zero nothing but what is missing, else all but the parts that
    /// the rule leaves out.
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
        kept.left_out = left_out(entry, &kept.entry);
        kept
    }

    fn leave_all_out(&self, block: &BlockView<'_>, kept: &mut KeptParts) {
        let as_zero = as_zero(block.entry);
        (kept.errors[0], kept.certified) = (as_zero, as_zero);
        let all = levels(block.entry).iter().fold(Alternative::default(), |w, part| self.with(w, part, block));
        let exact = block.entry.part(PartKind::Exact).is_some();
        kept.expected = if exact {
            finite(as_zero * as_zero * block.influence.of(f64::INFINITY))
        } else {
            kept.expected + all.change
        };
        kept.entry.parts.retain(|p| p.kind == PartKind::Missing);
    }

    fn leave_out_within(&self, allowed: f64, block: &BlockView<'_>, kept: &mut KeptParts) {
        let mut without = Alternative::default();
        for part in levels(block.entry) {
            let more = self.with(without, &part, block);
            if (block.entry.stats.reached + more.largest).next_up() <= allowed {
                self.leave_out(&part, more, block, kept);
                without = more;
            } else if self.cumulative {
                break;
            }
        }
    }

    /// Leaves out a part, with which all that is left out comes to `without`.
    fn leave_out(&self, part: &LevelPart, without: Alternative, block: &BlockView<'_>, kept: &mut KeptParts) {
        kept.certified = (block.entry.stats.reached + without.largest).next_up();
        kept.expected = self.own(block) + without.change;
        if self.cumulative {
            kept.errors[1..].fill(0.0);
        }
        kept.errors[1 + part.level] = part.entry.stats.largest;
        kept.entry.parts.retain(|p| p.kind != part.entry.kind);
    }

    /// What parts come to with one more.
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

    /// What the file's own errors come to in the mean square over pixels.
    fn own(&self, block: &BlockView<'_>) -> f64 {
        self.in_pixels(block.entry.stats.squared_error, self.alike[self.alike.len() - 1], block)
    }

    fn in_pixels(&self, energy: f64, alike: f64, block: &BlockView<'_>) -> f64 {
        finite(energy / (self.frames * block.voxels) as f64 * block.influence.of(alike))
    }

    /// The ways to leave out parts of a block, of which each costs more for a byte than the one before; none of a block
    /// that is not seen.
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

    /// An upper bound of the sum of absolute terms c_k u_k(t) of any sample of a block.
    pub(super) fn absolute_sum(&self, entry: &BlockEntry) -> f64 {
        let levels = levels(entry).into_iter();
        let each = levels.map(|part| part.entry.stats.largest * self.largest_gain[part.level]);
        if self.cumulative { each.fold(0.0, f64::max) } else { each.sum() }
    }
}

/// What it costs to go from one step to the next.
fn price(from: &Step, to: &Step) -> Cost {
    let bytes = to.bytes.saturating_sub(from.bytes).max(1) as f64;
    let each = ((to.change - from.change).max(0.0) / bytes).clamp(f64::MIN_POSITIVE, f64::MAX);
    (16.0 * libm::log2(each)).floor() as Cost
}

/// No sample of a block is further from zero.
fn as_zero(entry: &BlockEntry) -> f64 {
    (magnitude((entry.stats.min, entry.stats.max)) + entry.stats.reached).next_up()
}

/// Energies may be infinite, and nothing of them may be seen.
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
    let of = |entry: &PartEntry| match entry.kind {
        PartKind::Level(level) => Some(LevelPart { level: level.into(), entry: *entry }),
        _ => None,
    };
    entry.parts.iter().rev().filter_map(of).collect()
}

/// The difference between a whole entry and what is kept of it.
pub(super) fn left_out(entry: &BlockEntry, kept: &BlockEntry) -> LeftOut {
    let parts = || entry.parts.iter().filter(|p| kept.part(p.kind).is_none());
    LeftOut {
        blocks: u64::from(kept.parts.is_empty() && !entry.parts.is_empty()),
        parts: parts().count() as u64,
        coefficients: parts().filter(|p| matches!(p.kind, PartKind::Level(_))).map(|p| p.stats.count).sum(),
        bytes: parts().map(|p| u64::from(p.stored_len)).sum(),
    }
}
