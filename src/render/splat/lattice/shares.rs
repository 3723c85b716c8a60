//! The shares of a block's kernels that lie in a slab (eq 29).

use super::Shear;
use crate::render::splat::slab::Slab;
use std::ops::Range;

/// The shares of a block's kernels that lie in a slab, row by row.
#[derive(Debug)]
pub(super) struct Shares {
    slab: Slab,
    /// Rows of a slice.
    rows: usize,
    /// For each row of each slice, the first voxel along b with a share, and the range of the row's shares.
    runs: Vec<(usize, Range<usize>)>,
    shares: Vec<f64>,
    /// For each slice, the ranges along b and c that hold all voxels with a share.
    reached: Vec<[Range<usize>; 2]>,
}

impl Shares {
    /// The shares of a box of voxels that begins at `start`. The counts are along b, c and a.
    pub(super) fn new(slab: &Slab, shear: &Shear, start: [usize; 3], [along, rows, slices]: [usize; 3]) -> Self {
        let (runs, shares, reached) = (Vec::new(), Vec::new(), Vec::new());
        let mut all = Self { slab: *slab, rows, runs, shares, reached };
        for k in 0..slices {
            let mut reached = [along..0, rows..0];
            for c in 0..rows {
                let run = all.push(depth_of_row(shear, start, [c, k]), shear.depths[0], along);
                if !run.is_empty() {
                    reached = [hull(&reached[0], &run), hull(&reached[1], &(c..c + 1))];
                }
            }
            all.reached.push(reached);
        }
        all
    }

    /// Adds a row of `count` voxels: the first at `depth`, each next one deeper by `deeper`. Returns the voxels with a
    /// share.
    fn push(&mut self, depth: f64, deeper: f64, count: usize) -> Range<usize> {
        let (run, first) = (within(self.slab.reached_from(), depth, deeper, count), self.shares.len());
        self.shares.extend(run.clone().map(|n| self.slab.share(depth + deeper * n as f64)));
        self.runs.push((run.start, first..self.shares.len()));
        run
    }

    /// The first voxel of row c of slice k that has a share, and the shares from there on.
    pub(super) fn of_row(&self, k: usize, c: usize) -> (usize, &[f64]) {
        let (first, run) = &self.runs[k * self.rows + c];
        (*first, &self.shares[run.clone()])
    }

    /// The ranges along b and c that hold all voxels of slice k with a share.
    pub(super) fn reached(&self, k: usize) -> &[Range<usize>; 2] {
        &self.reached[k]
    }

    /// The share of a voxel at depth `z`.
    pub(super) fn of_depth(&self, z: f64) -> f64 {
        self.slab.share(z)
    }
}

/// The depth of the first voxel of row c of slice k.
fn depth_of_row(shear: &Shear, start: [usize; 3], [c, k]: [usize; 2]) -> f64 {
    let mut voxel = start;
    voxel[shear.axes[1]] += c;
    voxel[shear.axes[2]] += k;
    shear.depth(voxel)
}

/// The indices of the numbers first + n step between `from` and `to`, possibly with a neighbour on each side.
fn within([from, to]: [f64; 2], first: f64, step: f64, count: usize) -> Range<usize> {
    let (a, b) = ((from - first) / step, (to - first) / step);
    let (low, high) = if a.is_nan() || b.is_nan() || step == 0.0 {
        (0.0, if (from..=to).contains(&first) { count as f64 } else { 0.0 })
    } else {
        (a.min(b).floor(), a.max(b).ceil() + 1.0)
    };
    let end = high.clamp(0.0, count as f64) as usize;
    (low.clamp(0.0, count as f64) as usize).min(end)..end
}

fn hull(a: &Range<usize>, b: &Range<usize>) -> Range<usize> {
    a.start.min(b.start)..a.end.max(b.end)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges_hold_all_numbers_between_the_ends() {
        for (first, step) in [(0.0, 1.0), (5.0, -0.25), (-3.0, 0.0), (2.5, 0.0), (2.0, 1e-12), (1e6, -3.0)] {
            let found = within([2.0, 3.0], first, step, 40);
            for n in 0..40 {
                let inside = (2.0..=3.0).contains(&(first + step * n as f64));
                assert!(!inside || found.contains(&n), "{first} {step} {n}: {found:?}");
            }
            assert!(found.end <= 40 && (step.abs() < 0.1 || found.len() <= 8), "{first} {step}: {found:?}");
        }
    }
}
