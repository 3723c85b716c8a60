//! Adds slices to a band of the lattice: the kernel along a, then along b and c for each phase, then a blend.

use super::bricks::Ranges;
use super::filter::{AxisSums, Sixteen, Strip, mix, mix_present};
use super::layer::Layers;
use super::row::{Blend, LastMeans, Row, RowGroups, RowSums};
use super::stops::are_over;
use super::taps::Taps;
use super::view::{Slab, Slice, SlicedView};
use super::{BRICK_ROWS, GROUP, LEAST};
use std::ops::Range;
use wavesplat_core::base::vectors::dispatch;

/// A band of rows of the lattice of one frame.
pub(super) struct Band<'a, B: Blend> {
    pub(super) view: &'a SlicedView,
    pub(super) blend: &'a B,
    /// Rows in voxels; each has `cells` rows of cells, and these have `cells` phases each.
    pub(super) rows: Range<usize>,
    /// Groups of cells and their limits: row by row, phase by phase.
    pub(super) groups: &'a mut [B::Group],
    pub(super) limits: &'a mut [f32],
    /// The last means of these groups; none if every slab is one slice.
    pub(super) last: &'a mut [LastMeans],
    /// The stops of these groups; none if no ray ends early.
    pub(super) stops: &'a [Sixteen],
    pub(super) scratch: SweepScratch,
}

/// The sums of the slice in work. The derivatives are those that the gradient needs, if the blend is shaded.
pub(super) struct SweepScratch {
    /// Sums along a, and their derivatives along a; each row with a rim of zeros.
    along_a: Vec<AxisSums>,
    /// Sums along a and b, for each phase along b: plain ones, and the derivatives along b and a.
    along_b: Vec<Vec<AxisSums>>,
    /// For each group of the band, whether it is to be computed.
    live: Vec<bool>,
    /// Whether the sums along a of each brick are needed.
    needed_along_a: Vec<bool>,
    /// Whether the sums along a and b of each group are needed, for each phase and row of bricks.
    needed_along_b: Vec<Vec<bool>>,
}

impl SweepScratch {
    /// For a band of `band_rows` rows.
    pub(super) fn new(view: &SlicedView, band_rows: usize, is_shaded: bool) -> Self {
        let ([of_a, of_b], rows) = (Self::kinds(is_shaded), Self::rows(view, band_rows));
        let along_a = (0..of_a).map(|_| AxisSums::zeros(rows * Self::width(view))).collect();
        let phase = |_| (0..of_b).map(|_| AxisSums::zeros(rows * view.extent[0])).collect();
        let (bricks, groups) = (rows.div_ceil(BRICK_ROWS), view.extent[0] / GROUP);
        Self {
            along_a,
            along_b: (0..view.cells).map(phase).collect(),
            live: vec![false; band_rows * view.cells * view.cells * groups],
            needed_along_a: vec![false; bricks * view.count[0].div_ceil(GROUP)],
            needed_along_b: vec![vec![false; bricks * groups]; view.cells],
        }
    }

    /// Zeros before and behind each row of sums along a. A group is live if its cells in the middle of a slab are within the margin
    /// of voxels; those in a slice may be farther away by as much.
    fn rim(view: &SlicedView) -> usize {
        2 * (view.reach[0] + view.margin[0]) + GROUP
    }

    /// The kinds of sums along a, and along a and b.
    fn kinds(is_shaded: bool) -> [usize; 2] {
        if is_shaded { [2, 3] } else { [1, 1] }
    }

    /// The most rows of voxels, in whole bricks, that a band of `rows` rows needs.
    fn rows(view: &SlicedView, rows: usize) -> usize {
        let reached = rows + 2 * (view.reach[1] + view.margin[1]) + 1;
        (reached + 2 * BRICK_ROWS).min(view.count[1]).next_multiple_of(BRICK_ROWS)
    }

    fn width(view: &SlicedView) -> usize {
        view.count[0].next_multiple_of(GROUP) + 2 * Self::rim(view)
    }

    /// Bytes, if samples are missing.
    pub(super) fn bytes(view: &SlicedView, rows: usize, is_shaded: bool) -> usize {
        let [of_a, of_b] = Self::kinds(is_shaded);
        let row = of_a * Self::width(view) + of_b * view.cells * view.extent[0];
        let live = rows * view.cells * view.cells * view.extent[0] / GROUP;
        2 * size_of::<f32>() * Self::rows(view, rows) * row + live
    }
}

/// What a slab needs in a band.
struct Near {
    /// The rows of bricks. Sums begin with the first of them.
    bricks: Range<usize>,
    /// The ranges of bricks in all layers that the kernel meets.
    ranges: Ranges,
}

impl Near {
    fn new(view: &SlicedView, band: &Range<usize>, middle: &Slice, layers: &Layers) -> Self {
        let (first, met) = middle.along.within(0, view.count[2]);
        let met = first.saturating_sub(view.margin[2])..(first + met.len() + view.margin[2]).min(view.count[2]);
        let columns = layers.stride / GROUP;
        let ranges = Ranges::joint(met.map(|layer| layers.ranges(layer)), columns, layers.rows.div_ceil(BRICK_ROWS));
        let firsts = middle.across[1].iter().map(|taps| taps.first);
        let (least, most) = (firsts.clone().min().unwrap_or(0), firsts.max().unwrap_or(0));
        let reached = [band.start as i64, (band.end + 2 * view.reach[1]) as i64];
        let rows = [least + reached[0] - view.margin[1] as i64, most + reached[1] + view.margin[1] as i64];
        let rows = rows.map(|row| row.clamp(0, layers.rows as i64) as usize);
        Self { bricks: rows[0] / BRICK_ROWS..rows[1].div_ceil(BRICK_ROWS), ranges }
    }

    /// The first row of voxels of the sums.
    fn start(&self) -> usize {
        self.bricks.start * BRICK_ROWS
    }
}

/// A slice where it meets voxels.
struct Part<'a> {
    slice: &'a Slice,
    /// The layers that the kernel meets, with their weights.
    layers: Vec<&'a [f32]>,
    weights: &'a [f32],
    slopes: &'a [f32],
    /// The sum of these weights, and its derivative.
    share: f32,
    share_slope: f32,
    has_missing: bool,
}

impl<'a> Part<'a> {
    fn new(view: &SlicedView, slice: &'a Slice, layers: &'a Layers) -> Self {
        let (first, met) = slice.along.within(0, view.count[2]);
        let numbers = first..first + met.len();
        Self {
            slice,
            layers: numbers.clone().map(|layer| layers.layer(layer)).collect(),
            weights: &slice.along.weights[met.clone()],
            slopes: &slice.along.slopes[met],
            share: slice.along.presence(0, view.count[2]),
            share_slope: slice.along.presence_slope(0, view.count[2]),
            has_missing: numbers.into_iter().any(|layer| layers.is_missing(layer)),
        }
    }
}

impl<B: Blend> Band<'_, B> {
    /// Adds a slab behind the earlier ones: as one slice the groups whose light hardly changes within it, then the
    /// others slice by slice.
    pub(super) fn add(&mut self, slab: &Slab, layers: &Layers) {
        self.add_visible(slab, layers);
        let next = slab.middle.number + self.view.parts() as u32;
        let ended = self.limits.iter_mut().zip(self.stops).filter(|(_, stops)| are_over(stops, next));
        ended.for_each(|(limit, _)| *limit = B::OVER);
    }

    fn add_visible(&mut self, slab: &Slab, layers: &Layers) {
        let near = Near::new(self.view, &self.rows, &slab.middle, layers);
        let all = near.ranges.joined(near.bricks.clone(), 0..near.ranges.columns);
        if !self.blend.shows(all) || !self.find_live(&near, &slab.middle) {
            return;
        }
        if slab.is_met {
            self.add_slice(&slab.middle, &near, layers);
        }
        for slice in &slab.slices {
            let live = self.scratch.live.iter_mut().zip(&*self.limits);
            live.for_each(|(live, limit)| *live &= !B::is_closed(*limit));
            self.add_slice(slice, &near, layers);
        }
    }

    /// Adds a slice to the live groups.
    fn add_slice(&mut self, slice: &Slice, near: &Near, layers: &Layers) {
        let part = Part::new(self.view, slice, layers);
        if self.find_needed(slice, near) {
            self.along_a(&part, near, layers);
            (0..self.view.cells).for_each(|phase| self.along_b(&part, near, phase));
            self.along_c(&part, near);
        }
    }

    /// The groups of a row of cells, of one phase along b.
    fn groups_at(&self, row: usize, down: usize, phase: usize) -> Range<usize> {
        let (view, count) = (self.view, self.view.extent[0] / GROUP);
        let at = (((row - self.rows.start) * view.cells + down) * view.cells + phase) * count;
        at..at + count
    }

    /// Marks the groups that are visible in a slab and not hidden. Returns whether there are any.
    fn find_live(&mut self, near: &Near, middle: &Slice) -> bool {
        let view = self.view;
        let (mut visible, mut any) = (vec![Visible::default(); view.cells], false);
        for row in self.rows.clone() {
            for (down, taps) in middle.across[1].iter().enumerate() {
                let bricks = bricks_of(view, taps, row, view.margin[1]);
                visible[down].update(view, near, middle, bricks, |range| self.blend.shows(range));
                for phase in 0..view.cells {
                    let groups = self.groups_at(row, down, phase);
                    let (limits, live) = (&self.limits[groups.clone()], &mut self.scratch.live[groups]);
                    any |= visible[down].live::<B>(phase, limits, live);
                }
            }
        }
        any
    }

    /// Marks the bricks and groups of sums that the live groups of a slice need. Returns whether there are any.
    fn find_needed(&mut self, slice: &Slice, near: &Near) -> bool {
        let view = self.view;
        self.scratch.needed_along_a.fill(false);
        self.scratch.needed_along_b.iter_mut().for_each(|needed| needed.fill(false));
        for row in self.rows.clone() {
            for (down, taps) in slice.across[1].iter().enumerate() {
                let bricks = bricks_of(view, taps, row, 0);
                for phase in 0..view.cells {
                    let live = &self.scratch.live[self.groups_at(row, down, phase)];
                    for brick in bricks.clone() {
                        let needed = &mut self.scratch.needed_along_b[phase];
                        let needed = &mut needed[(brick - near.bricks.start) * live.len()..];
                        needed.iter_mut().zip(live).for_each(|(needed, live)| *needed |= *live);
                    }
                }
            }
        }
        self.find_needed_along_a(slice, near.ranges.columns)
    }

    /// Marks the bricks of sums along a that those along b need. Returns whether there are any of these.
    fn find_needed_along_a(&mut self, slice: &Slice, columns: usize) -> bool {
        let (view, count, mut any) = (self.view, self.view.extent[0] / GROUP, false);
        for (taps, needed) in slice.across[0].iter().zip(&self.scratch.needed_along_b) {
            let bricks = self.scratch.needed_along_a.chunks_exact_mut(columns.max(1));
            for (bricks, needed) in bricks.zip(needed.chunks_exact(count)) {
                for group in (0..count).filter(|group| needed[*group]) {
                    bricks[columns_of(view, taps.first, group, 0)].fill(true);
                    any = true;
                }
            }
        }
        any
    }

    /// Sums along a, for all bricks that are needed.
    fn along_a(&mut self, part: &Part<'_>, near: &Near, layers: &Layers) {
        let (view, columns) = (self.view, near.ranges.columns);
        let (rim, stride) = (SweepScratch::rim(view), SweepScratch::width(view));
        if part.has_missing {
            self.scratch.along_a.iter_mut().for_each(AxisSums::with_present);
        }
        for row in near.bricks.clone() {
            for column in 0..columns {
                if !self.scratch.needed_along_a[(row - near.bricks.start) * columns + column] {
                    continue;
                }
                let (first, rows) = rows_of(row, layers.rows);
                let from = Strip { at: first * layers.stride + column * GROUP, stride: layers.stride };
                let to = Strip { at: (first - near.start()) * stride + rim + column * GROUP, stride };
                for (sums, weights) in self.scratch.along_a.iter_mut().zip([part.weights, part.slopes]) {
                    if part.has_missing {
                        let mask = std::array::from_fn(|i| f32::from(u8::from(column * GROUP + i < view.count[0])));
                        dispatch!(mix_present(&part.layers[..], weights, from, &mask, rows, to, sums));
                    } else {
                        dispatch!(mix(&part.layers[..], weights, from, rows, (to, &mut sums.values[..])));
                    }
                }
            }
        }
    }

    /// Sums along b of one phase, for all groups that are needed.
    fn along_b(&mut self, part: &Part<'_>, near: &Near, phase: usize) {
        let (view, rim, count) = (self.view, SweepScratch::rim(self.view), self.view.extent[0] / GROUP);
        let taps = &part.slice.across[0][phase];
        let (from, to) = (SweepScratch::width(view), view.extent[0]);
        let sums = &mut self.scratch.along_b[phase];
        if part.has_missing {
            sums.iter_mut().for_each(AxisSums::with_present);
        }
        // Plain sums, and the derivatives along b and along a.
        let kinds = [(0, &taps.weights), (0, &taps.slopes), (1, &taps.weights)];
        let shifted = |sums| shifted(sums, taps.weights.len());
        let sources: Vec<[Vec<&[f32]>; 2]> =
            self.scratch.along_a.iter().map(|sums| [shifted(&sums.values), shifted(&sums.present)]).collect();
        let needed = self.scratch.needed_along_b[phase].chunks_exact(count);
        for (row, needed) in near.bricks.clone().zip(needed) {
            let (first, rows) = rows_of(row, view.count[1]);
            let first = first - near.start();
            for group in (0..count).filter(|group| needed[*group]) {
                let at = rim as i64 + taps.first + (group * GROUP) as i64;
                let strip = Strip { at: first * from + at as usize, stride: from };
                let out = Strip { at: first * to + group * GROUP, stride: to };
                for (sums, (source, weights)) in sums.iter_mut().zip(kinds) {
                    let [values, present] = &sources[source];
                    dispatch!(mix(&values[..], weights, strip, rows, (out, &mut sums.values[..])));
                    if part.has_missing {
                        dispatch!(mix(&present[..], weights, strip, rows, (out, &mut sums.present[..])));
                    }
                }
            }
        }
    }

    /// Sums along c, and blends.
    fn along_c(&mut self, part: &Part<'_>, near: &Near) {
        let view = self.view;
        let phases: Vec<Across> = part.slice.across[0].iter().map(|taps| Across::new(view, taps)).collect();
        for row in self.rows.clone() {
            for (down, taps) in part.slice.across[1].iter().enumerate() {
                let Some(meets) = Down::new(view, part, row, taps) else { continue };
                for (phase, across) in phases.iter().enumerate() {
                    let groups = self.groups_at(row, down, phase);
                    let live = &mut self.scratch.live[groups.clone()];
                    if !live.contains(&true) || meets.least_density(across) < LEAST {
                        continue;
                    }
                    let (states, limits) = (&mut self.groups[groups.clone()], &mut self.limits[groups.clone()]);
                    let stops = self.stops.get(groups.clone()).unwrap_or_default();
                    let last = self.last.get_mut(groups).unwrap_or_default();
                    let sums = &self.scratch.along_b[phase];
                    let row = Row { least: self.blend.least(), stops, ..meets.row(view, part, near, sums, across) };
                    self.blend.add(&row, RowGroups { states, limits, live, last });
                }
            }
        }
    }
}

/// The weights along b of one phase, for all cells of a row.
struct Across {
    /// The position of the first cell.
    position: f64,
    density: f64,
    /// The sums of weights that meet the region, and their derivatives.
    shares: Vec<f32>,
    slopes: Vec<f32>,
    /// For each group, whether all weights of all its cells meet the region.
    whole: Vec<bool>,
}

impl Across {
    fn new(view: &SlicedView, taps: &Taps) -> Self {
        let cells = || 0..view.extent[0] as i64;
        let shares: Vec<f32> = cells().map(|cell| taps.presence(cell, view.count[0])).collect();
        let slopes = cells().map(|cell| taps.presence_slope(cell, view.count[0])).collect();
        let whole = shares.chunks_exact(GROUP).map(|group| group.iter().all(|share| *share == 1.0)).collect();
        Self { position: taps.position, density: taps.density, shares, slopes, whole }
    }
}

/// The weights along c of a row of cells, combined with the weights along a.
struct Down<'a> {
    /// The positions along c and a.
    position: [f64; 2],
    /// The first row of voxels that the weights meet.
    first: usize,
    weights: &'a [f32],
    slopes: &'a [f32],
    density: f64,
    /// The sum of weights along a and c that meet the region, and its derivatives along c and a.
    share: f32,
    share_slopes: [f32; 2],
}

impl<'a> Down<'a> {
    /// `None` if no weight meets the region.
    fn new(view: &SlicedView, part: &Part<'_>, row: usize, taps: &'a Taps) -> Option<Self> {
        let (first, met) = taps.within(row as i64, view.count[1]);
        if met.is_empty() {
            return None;
        }
        let (of_row, slope) =
            (taps.presence(row as i64, view.count[1]), taps.presence_slope(row as i64, view.count[1]));
        Some(Self {
            position: [taps.position + row as f64, part.slice.along.position],
            first,
            weights: &taps.weights[met.clone()],
            slopes: &taps.slopes[met],
            density: part.slice.along.density * part.slice.filling * taps.density,
            share: part.share * of_row,
            share_slopes: [part.share * slope, part.share_slope * of_row],
        })
    }

    /// No cell has more density where samples are missing along a and c.
    fn least_density(&self, across: &Across) -> f32 {
        self.share * (self.density * across.density) as f32
    }

    fn row<'r>(
        &'r self,
        view: &SlicedView,
        part: &Part<'_>,
        near: &Near,
        sums: &'r [AxisSums],
        across: &'r Across,
    ) -> Row<'r> {
        let from = (self.first - near.start()) * view.extent[0];
        let from_first = |sums: &'r AxisSums| RowSums {
            values: &sums.values[from..],
            present: part.has_missing.then(|| &sums.present[from..]),
        };
        Row {
            sums: from_first(&sums[0]),
            slopes: sums.get(1..3).map(|slopes| [from_first(&slopes[0]), from_first(&slopes[1])]),
            stride: view.extent[0],
            weights: self.weights,
            weight_slopes: self.slopes,
            share: self.share,
            shares: &across.shares,
            share_slopes: self.share_slopes,
            shares_slopes: &across.slopes,
            density: (self.density * across.density) as f32,
            least: LEAST,
            whole: &across.whole,
            slice: part.slice.number,
            thickness: part.slice.thickness,
            place: [across.position, self.position[0], self.position[1]].map(|at| at as f32),
            stops: &[],
        }
    }
}

/// The ranges of the groups of a row of cells, for each phase along b; `None` for groups that are not visible.
#[derive(Debug, Clone, Default)]
struct Visible {
    /// The rows of bricks that decide.
    bricks: Option<Range<usize>>,
    ranges: Vec<Vec<Option<(f32, f32)>>>,
}

impl Visible {
    /// Finds the ranges for rows that need these rows of bricks.
    fn update(
        &mut self,
        view: &SlicedView,
        near: &Near,
        middle: &Slice,
        bricks: Range<usize>,
        shows: impl Fn((f32, f32)) -> bool,
    ) {
        if self.bricks.as_ref() == Some(&bricks) {
            return;
        }
        let range = |first: i64, group: usize| {
            let columns = columns_of(view, first, group, view.margin[0]);
            Some(near.ranges.joined(bricks.clone(), columns)).filter(|range| shows(*range))
        };
        let of_phase = |first: i64| (0..view.extent[0] / GROUP).map(|group| range(first, group)).collect();
        self.ranges = middle.across[0].iter().map(|taps| of_phase(taps.first)).collect();
        self.bricks = Some(bricks);
    }

    /// Marks the groups of a phase that are visible and not hidden. Returns whether there are any.
    fn live<B: Blend>(&self, phase: usize, limits: &[f32], live: &mut [bool]) -> bool {
        let mut any = false;
        for ((live, range), limit) in live.iter_mut().zip(&self.ranges[phase]).zip(limits) {
            *live = range.is_some_and(|range| !B::hides(*limit, range));
            any |= *live;
        }
        any
    }
}

/// The first row of a row of bricks, and the number of its rows.
fn rows_of(brick: usize, rows: usize) -> (usize, usize) {
    (brick * BRICK_ROWS, BRICK_ROWS.min(rows - brick * BRICK_ROWS))
}

/// The rows of bricks within `margin` voxels of those that a row of cells needs.
fn bricks_of(view: &SlicedView, taps: &Taps, row: usize, margin: usize) -> Range<usize> {
    let (from, margin) = (taps.first + row as i64, margin as i64);
    let ends = [from - margin, from + taps.weights.len() as i64 + margin];
    let [from, to] = ends.map(|row| row.clamp(0, view.count[1] as i64) as usize);
    if from < to { from / BRICK_ROWS..to.div_ceil(BRICK_ROWS) } else { 0..0 }
}

/// The columns of bricks within `margin` voxels of those that the cells of a group need, if the taps of the lattice's first
/// cell start at `first`.
fn columns_of(view: &SlicedView, first: i64, group: usize, margin: usize) -> Range<usize> {
    let (from, margin) = (first + (group * GROUP) as i64, margin as i64);
    let ends = [from - margin, from + (GROUP + 2 * view.reach[0] - 1) as i64 + margin];
    let [from, to] = ends.map(|column| column.clamp(0, view.count[0] as i64) as usize);
    if from < to { from / GROUP..to.div_ceil(GROUP) } else { 0..0 }
}

/// The same numbers from the first, the second and so on.
fn shifted(numbers: &[f32], count: usize) -> Vec<&[f32]> {
    (0..count).map(|n| numbers.get(n..).unwrap_or_default()).collect()
}
