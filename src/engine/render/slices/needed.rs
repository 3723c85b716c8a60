//! The blocks that a batch must read: those near which a value may be visible.

use super::row::Blend;
use super::view::SlicedView;
use crate::render::batches::{Selection, Units};
use wavesplat_core::base::grid::{BlockGrid, Region};

/// Facts about the blocks of a batch, known before any block is read.
pub(super) struct Known<'a> {
    view: &'a SlicedView,
    blocks: BlockGrid,
    /// A range that holds the samples of each block; inverted if all are missing.
    ranges: Vec<(f64, f64)>,
    /// The same of each block together with the blocks that the kernel reaches.
    wide: Vec<(f64, f64)>,
    /// Whether a block has values other than zero.
    has_values: Vec<bool>,
}

/// What to do with a block.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Need {
    Read,
    /// All samples have this value; or none is visible, and this is some value of the block's range.
    Fill(f64),
    /// The same for a block that no open cell needs.
    Hidden(f64),
    /// All samples are missing.
    Missing,
}

const INVERTED: (f64, f64) = (f64::INFINITY, f64::NEG_INFINITY);

impl<'a> Known<'a> {
    /// The facts; a block is needed also for cells up to so many voxels along b and c from those that it reaches.
    pub(super) fn new(view: &'a SlicedView, blocks: BlockGrid, selection: &Selection, [b, c]: [usize; 2]) -> Self {
        let (mut ranges, mut has_values) = (vec![INVERTED; blocks.len()], vec![false; blocks.len()]);
        selection.ranges.iter().for_each(|known| ranges[known.block] = known.range);
        selection.blocks.iter().for_each(|block| has_values[*block] = true);
        // Cells that a block reaches are also reached by others.
        let beside = [b, c, 0];
        let wide = around(view, blocks, ranges.clone(), |i| 2 * (view.reach[i] + view.margin[i]) - 1 + beside[i]);
        Self { view, blocks, ranges, wide, has_values }
    }

    /// The middle of all values, if it is known.
    pub(super) fn middle(&self) -> Option<f64> {
        let all = self.ranges.iter().fold(INVERTED, |all, range| (all.0.min(range.0), all.1.max(range.1)));
        let middle = all.0 / 2.0 + all.1 / 2.0;
        if all.0 > all.1 { Some(0.0) } else { Some(middle).filter(|middle| middle.is_finite()) }
    }

    /// What to do with a block. `limits` are those of all frames.
    pub(super) fn need<B: Blend>(&self, blend: &B, units: &Units, limits: &[&[f32]], block: usize) -> Need {
        let (own, wide) = (self.ranges[block], self.wide[block]);
        if own.0 > own.1 {
            return Need::Missing;
        }
        let any = self.any(block);
        if !self.has_values[block] {
            return Need::Fill(0.0);
        }
        if !blend.shows((units.number(wide.0), units.number(wide.1))) {
            return Need::Fill(any);
        }
        let open = limits.iter().any(|limits| self.is_open::<B>(limits, block));
        if open { Need::Read } else { Need::Hidden(any) }
    }

    /// Whether an open cell of a frame needs a block.
    fn is_open<B: Blend>(&self, limits: &[f32], block: usize) -> bool {
        let view = self.view;
        let [columns, mut rows] = view.reached(&self.blocks.region(block).intersect(&view.clip));
        let of_row = view.cells * view.cells;
        let width = view.extent[0] / super::GROUP;
        rows.any(|row| {
            let phase = |phase: usize| &limits[(row * of_row + phase) * width..][columns.clone()];
            (0..of_row).any(|n| phase(n).iter().any(|limit| !B::is_closed(*limit)))
        })
    }

    /// The blocks that are read for other frames of the batch but hidden in this one, and the value that takes the place of their
    /// samples. So a frame is the same in every batch.
    pub(super) fn hidden<B: Blend>(&self, limits: &[f32], needs: &[(usize, Need)]) -> Vec<(Region, f64)> {
        let read = needs.iter().filter(|(_, need)| *need == Need::Read).map(|(block, _)| *block);
        let hidden = read.filter(|block| !self.is_open::<B>(limits, *block));
        hidden.map(|block| (self.blocks.region(block), self.any(block))).collect()
    }

    /// Some value of a block's range.
    fn any(&self, block: usize) -> f64 {
        self.ranges[block].0.max(f64::MIN).min(self.ranges[block].1)
    }
}

/// The ranges of every block together with those of the blocks within so many voxels along b, c and a.
pub(super) fn around(
    view: &SlicedView,
    blocks: BlockGrid,
    mut ranges: Vec<(f64, f64)>,
    voxels: impl Fn(usize) -> usize,
) -> Vec<(f64, f64)> {
    for (i, axis) in view.shear.axes.into_iter().enumerate() {
        widen(&mut ranges, blocks, axis, voxels(i).div_ceil(blocks.edges[axis]));
    }
    ranges
}

/// Joins the ranges of every block with those of the `reach` blocks before and behind it along an axis.
fn widen(ranges: &mut [(f64, f64)], blocks: BlockGrid, axis: usize, reach: usize) {
    let (counts, before) = (blocks.counts(), ranges.to_vec());
    let stride: usize = counts[..axis].iter().product();
    for (block, range) in ranges.iter_mut().enumerate() {
        let at = block / stride % counts[axis];
        for other in at.saturating_sub(reach)..(at + reach + 1).min(counts[axis]) {
            let (lo, hi) = before[block - at * stride + other * stride];
            *range = (range.0.min(lo), range.1.max(hi));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges_widen_to_the_blocks_around() {
        let blocks = BlockGrid::cubes([20, 12, 8], 4);
        let mut ranges: Vec<(f64, f64)> = (0..blocks.len()).map(|n| (n as f64, n as f64)).collect();
        (0..3).for_each(|axis| widen(&mut ranges, blocks, axis, 1));
        for (block, found) in ranges.into_iter().enumerate() {
            let at = |n: usize| [n % 5, n / 5 % 3, n / 15];
            let near = |n: &usize| (0..3).all(|a| at(*n)[a].abs_diff(at(block)[a]) <= 1);
            let all: Vec<usize> = (0..blocks.len()).filter(near).collect();
            assert_eq!(found, (all[0] as f64, all[all.len() - 1] as f64));
        }
    }
}
