//! A row of cells in a slice: means and lengths, sixteen cells at a time, and the ways to combine the slices.

use super::GROUP;
use super::filter::{Sixteen, weighted_rows};
use super::units::Units;

/// One phase of a row of cells in a slice: sums of the kernel along a and b, to be summed along c.
pub(in crate::render) struct Row<'a> {
    /// Sums of values, from the first row of voxels on that the weights meet.
    pub(super) values: &'a [f32],
    /// Sums of the weights of present samples; `None` if none is missing.
    pub(super) present: Option<&'a [f32]>,
    pub(super) stride: usize,
    /// Weights along c.
    pub(super) weights: &'a [f32],
    /// The sum of weights along a and c that meet the region, and along b for each cell.
    pub(super) share: f32,
    pub(super) shares: &'a [f32],
    /// The kernel's density without missing samples and edges.
    pub(super) density: f32,
    /// Where the density is less, there is nothing.
    pub(super) least: f32,
    /// For each group, whether it is computed, and whether all its weights meet the region.
    pub(super) live: &'a [bool],
    pub(super) whole: &'a [bool],
    pub(super) slice: u32,
}

/// Densities this close to 1 count as 1.
const WHOLE: f32 = 2e-4;

impl Row<'_> {
    /// Whether the means of a group are plain sums.
    #[inline(always)]
    pub(super) fn is_whole(&self, group: usize) -> bool {
        self.present.is_none() && self.whole[group] && self.share > 1.0 - 1e-6 && (self.density - 1.0).abs() < WHOLE
    }

    /// The sums of a group.
    #[inline(always)]
    pub(super) fn sums(&self, group: usize) -> Sixteen {
        self.along_c(self.values, group)
    }

    /// The means of a group, and the lengths of its rays as shares of the distance of two slices. A length is 0 where
    /// almost nothing is present.
    #[inline(always)]
    pub(super) fn means(&self, group: usize) -> (Sixteen, Sixteen) {
        let (mut means, mut lengths) = (self.sums(group), [0.0; GROUP]);
        let present = match self.present {
            Some(present) => self.along_c(present, group),
            None => {
                let shares = self.shares[group * GROUP..].first_chunk::<GROUP>();
                shares.map_or([0.0; GROUP], |shares| shares.map(|share| share * self.share))
            }
        };
        for i in 0..GROUP {
            let length = present[i] * self.density;
            let is_there = length >= self.least;
            means[i] = if is_there { means[i] / present[i] } else { 0.0 };
            lengths[i] = if is_there { length } else { 0.0 };
        }
        (means, lengths)
    }

    #[inline(always)]
    fn along_c(&self, values: &[f32], group: usize) -> Sixteen {
        weighted_rows(values, self.stride, self.weights, group * GROUP)
    }
}

/// A way to combine the slices along the rays of cells.
pub(in crate::render) trait Blend: Sync {
    /// The state of sixteen cells.
    type Group: Copy + Send + Sync;
    /// The state of a finished cell.
    type Cell: Copy + Send + Sync;

    /// The state before the first slice.
    const EMPTY: Self::Group;
    const NOTHING: Self::Cell;
    /// The limit of a group before the first slice.
    const OPEN: f32;
    /// Whether units depend on a value near those of the frame.
    const CENTRED: bool;
    /// Where the density is less, there is nothing.
    const LEAST: f32;
    /// Numbers per pixel.
    const NUMBERS: usize;

    /// The units of values. `middle` is a value near those of the frame.
    fn units(&self, middle: f64) -> Units;

    /// Whether any value in this range is visible.
    fn shows(&self, range: (f32, f32)) -> bool;

    /// Whether cells with this limit hide all values in this range.
    fn hides(limit: f32, range: (f32, f32)) -> bool;

    /// Whether cells with this limit hide everything.
    fn is_closed(limit: f32) -> bool;

    /// Adds the live groups of a row behind the slices before, and updates their limits.
    fn add(&self, row: &Row<'_>, groups: &mut [Self::Group], limits: &mut [f32]);

    /// The cells of a group.
    fn cells(group: &Self::Group) -> [Self::Cell; GROUP];

    /// The numbers of a pixel, from the 4 x 4 cells around it and the weights of their columns and rows.
    fn pixel(units: &Units, cells: [&[Self::Cell; 4]; 4], weights: [[f32; 4]; 2], out: &mut [f32]);

    /// An exact ray.
    type Exact;

    /// An exact ray before its first step.
    fn exact(&self) -> Self::Exact;

    /// Adds a value behind the earlier ones: its density, over a share of the distance of two slices.
    fn step(&self, ray: &mut Self::Exact, value: f64, density: f64, share: f64);

    /// The difference of a pixel from an exact ray; `None` if one of them has no value.
    fn off(ray: &Self::Exact, pixel: &[f32]) -> Option<f64>;

    /// The numbers of a pixel that no ray meets.
    fn background(out: &mut [f32]);
}
