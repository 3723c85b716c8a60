//! Adds slices to a band of the lattice: the kernel along a, then along b and c for each phase, then a blend.

use super::bricks::Ranges;
use super::filter::{AxisSums, Sixteen, Strip, mix, mix_present};
use super::layer::Layers;
use super::row::{Blend, Row, RowSums};
use super::stops::are_over;
use super::taps::Taps;
use super::view::{Slice, SlicedView};
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
    /// The stops of these groups; none if no ray ends early.
    pub(super) stops: &'a [Sixteen],
    pub(super) scratch: SweepScratch,
}

/// The sums of the slice in work. The derivatives are those that the gradient needs, if the blend is shaded.
pub(super) struct SweepScratch {
    /// Zeros before and behind each row of sums along a.
    rim: usize,
    /// AxisSums along a, and their derivatives along a.
    along_a: Vec<AxisSums>,
    /// AxisSums along a and b, for each phase along b: plain ones, and the derivatives along b and a.
    along_b: Vec<Vec<AxisSums>>,
}

impl SweepScratch {
    /// For a band of `rows` rows.
    pub(super) fn new(view: &SlicedView, rows: usize, is_shaded: bool) -> Self {
        let (rim, rows) = (2 * view.reach[0] + GROUP, Self::rows(view, rows));
        let [of_a, of_b] = Self::kinds(is_shaded);
        let along_a = (0..of_a).map(|_| AxisSums::zeros(rows * Self::width(view, rim))).collect();
        let phase = |_| (0..of_b).map(|_| AxisSums::zeros(rows * view.extent[0])).collect();
        Self { rim, along_a, along_b: (0..view.cells).map(phase).collect() }
    }

    /// The kinds of sums along a, and along a and b.
    fn kinds(is_shaded: bool) -> [usize; 2] {
        if is_shaded { [2, 3] } else { [1, 1] }
    }

    /// The most rows of voxels, in whole bricks, that a band of `rows` rows needs.
    fn rows(view: &SlicedView, rows: usize) -> usize {
        (rows + 2 * view.reach[1] + 1 + 2 * BRICK_ROWS).min(view.count[1].next_multiple_of(BRICK_ROWS))
    }

    fn width(view: &SlicedView, rim: usize) -> usize {
        view.count[0].next_multiple_of(GROUP) + 2 * rim
    }

    /// Bytes, if samples are missing.
    pub(super) fn bytes(view: &SlicedView, rows: usize, is_shaded: bool) -> usize {
        let [of_a, of_b] = Self::kinds(is_shaded);
        let row = of_a * Self::width(view, 2 * view.reach[0] + GROUP) + of_b * view.cells * view.extent[0];
        2 * size_of::<f32>() * Self::rows(view, rows) * row
    }
}

/// The part of a slice that a band needs.
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
    /// The rows of bricks that the band needs. AxisSums begin with the first of them.
    bricks: Range<usize>,
    /// The ranges of bricks, and of bricks with the rows of bricks that the kernel reaches.
    ranges: Ranges,
    wide: Ranges,
}

impl Part<'_> {
    /// The first row of voxels of the sums.
    fn start(&self) -> usize {
        self.bricks.start * BRICK_ROWS
    }
}

impl<B: Blend> Band<'_, B> {
    /// Adds a slice behind the earlier ones.
    pub(super) fn add(&mut self, slice: &Slice, layers: &Layers) {
        let part = self.part(slice, layers);
        if self.blend.shows(part.ranges.joined(part.bricks.clone(), 0..part.ranges.columns)) {
            self.along_a(&part, layers);
            (0..self.view.cells).for_each(|phase| self.along_b(&part, phase));
            self.along_c(&part);
        }
    }

    fn part<'s>(&self, slice: &'s Slice, layers: &'s Layers) -> Part<'s> {
        let view = self.view;
        let (first, met) = slice.along.within(0, view.count[2]);
        let numbers = first..first + met.len();
        let near = first.saturating_sub(view.margin)..(first + met.len() + view.margin).min(view.count[2]);
        let columns = layers.stride / GROUP;
        let ranges = Ranges::joint(near.map(|layer| layers.ranges(layer)), columns, layers.rows.div_ceil(BRICK_ROWS));
        let wide = ranges.dilated((2 * (view.reach[1] + view.margin)).div_ceil(BRICK_ROWS));
        let firsts = slice.across[1].iter().map(|taps| taps.first);
        let (least, most) = (firsts.clone().min().unwrap_or(0), firsts.max().unwrap_or(0));
        let rows = [least + self.rows.start as i64, most + (self.rows.end + 2 * view.reach[1]) as i64];
        let rows = rows.map(|row| row.clamp(0, layers.rows as i64) as usize);
        Part {
            slice,
            layers: numbers.clone().map(|layer| layers.layer(layer)).collect(),
            weights: &slice.along.weights[met.clone()],
            slopes: &slice.along.slopes[met],
            share: slice.along.presence(0, view.count[2]),
            share_slope: slice.along.presence_slope(0, view.count[2]),
            has_missing: numbers.into_iter().any(|layer| layers.is_missing(layer)),
            bricks: rows[0] / BRICK_ROWS..rows[1].div_ceil(BRICK_ROWS),
            ranges,
            wide,
        }
    }

    /// AxisSums along a, for all bricks that a visible cell may need.
    fn along_a(&mut self, part: &Part<'_>, layers: &Layers) {
        let (view, rim) = (self.view, self.scratch.rim);
        let (columns, stride) = (part.ranges.columns, SweepScratch::width(view, rim));
        let reach = (GROUP + 2 * view.reach[0]) / GROUP + 1;
        if part.has_missing {
            self.scratch.along_a.iter_mut().for_each(AxisSums::with_present);
        }
        for row in part.bricks.clone() {
            for column in 0..columns {
                let near = column.saturating_sub(reach)..(column + reach + 1).min(columns);
                if !self.blend.shows(part.wide.joined(row..row + 1, near)) {
                    continue;
                }
                let (first, rows) = rows_of(row, layers.rows);
                let from = Strip { at: first * layers.stride + column * GROUP, stride: layers.stride };
                let to = Strip { at: (first - part.start()) * stride + rim + column * GROUP, stride };
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

    /// AxisSums along b of one phase, for all groups that a visible cell may need.
    fn along_b(&mut self, part: &Part<'_>, phase: usize) {
        let (view, rim) = (self.view, self.scratch.rim);
        let taps = &part.slice.across[0][phase];
        let (from, to) = (SweepScratch::width(view, rim), view.extent[0]);
        let sums = &mut self.scratch.along_b[phase];
        if part.has_missing {
            sums.iter_mut().for_each(AxisSums::with_present);
        }
        // Plain sums, and the derivatives along b and along a.
        let kinds = [(0, &taps.weights), (0, &taps.slopes), (1, &taps.weights)];
        let shifted = |sums| shifted(sums, taps.weights.len());
        let sources: Vec<[Vec<&[f32]>; 2]> =
            self.scratch.along_a.iter().map(|sums| [shifted(&sums.values), shifted(&sums.present)]).collect();
        for group in 0..view.extent[0] / GROUP {
            let columns = columns_of(view, taps.first, group);
            let at = rim as i64 + taps.first + (group * GROUP) as i64;
            for row in part.bricks.clone() {
                if columns.is_empty() || !self.blend.shows(part.wide.joined(row..row + 1, columns.clone())) {
                    continue;
                }
                let (first, rows) = rows_of(row, view.count[1]);
                let first = first - part.start();
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

    /// AxisSums along c, and blends.
    fn along_c(&mut self, part: &Part<'_>) {
        let view = self.view;
        let count = view.extent[0] / GROUP;
        let phases: Vec<Across> = part.slice.across[0].iter().map(|taps| Across::new(view, taps)).collect();
        let mut visible = vec![Visible::default(); view.cells];
        let mut live = vec![false; count];
        for row in self.rows.clone() {
            for (down, taps) in part.slice.across[1].iter().enumerate() {
                let Some(meets) = Down::new(view, part, row, taps) else { continue };
                visible[down].update(part, meets.bricks(view), |range| self.blend.shows(range), view);
                for (phase, across) in phases.iter().enumerate() {
                    if meets.least_density(across) < LEAST {
                        continue;
                    }
                    let at = (((row - self.rows.start) * view.cells + down) * view.cells + phase) * count;
                    let (groups, limits) = (&mut self.groups[at..at + count], &mut self.limits[at..at + count]);
                    if visible[down].live::<B>(phase, limits, &mut live) {
                        let sums = &self.scratch.along_b[phase];
                        let stops = self.stops.get(at..at + count).unwrap_or_default();
                        let row = Row { least: B::LEAST, stops, ..meets.row(view, part, sums, across, &live) };
                        self.blend.add(&row, groups, limits);
                        let over = limits.iter_mut().zip(stops).filter(|(_, stops)| are_over(stops, row.slice));
                        over.for_each(|(limit, _)| *limit = B::OVER);
                    }
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
            density: part.slice.along.density * taps.density,
            share: part.share * of_row,
            share_slopes: [part.share * slope, part.share_slope * of_row],
        })
    }

    /// The rows of bricks that decide what is visible.
    fn bricks(&self, view: &SlicedView) -> Range<usize> {
        let last = (self.first + self.weights.len() - 1 + view.margin).min(view.count[1] - 1);
        self.first.saturating_sub(view.margin) / BRICK_ROWS..last / BRICK_ROWS + 1
    }

    /// No cell has more density where samples are missing along a and c.
    fn least_density(&self, across: &Across) -> f32 {
        self.share * (self.density * across.density) as f32
    }

    fn row<'r>(
        &'r self,
        view: &SlicedView,
        part: &Part<'_>,
        sums: &'r [AxisSums],
        across: &'r Across,
        live: &'r [bool],
    ) -> Row<'r> {
        let from = (self.first - part.start()) * view.extent[0];
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
            live,
            whole: &across.whole,
            slice: part.slice.number,
            place: [across.position, self.position[0], self.position[1]].map(|at| at as f32),
            stops: &[],
        }
    }
}

/// The ranges of the groups of a row of cells, for each phase along b; `None` for groups that are not visible.
#[derive(Debug, Clone, Default)]
struct Visible {
    bricks: Range<usize>,
    ranges: Vec<Vec<Option<(f32, f32)>>>,
}

impl Visible {
    /// Finds the ranges for rows that need these rows of bricks.
    fn update(&mut self, part: &Part<'_>, bricks: Range<usize>, shows: impl Fn((f32, f32)) -> bool, view: &SlicedView) {
        if self.bricks == bricks {
            return;
        }
        let range = |first: i64, group: usize| {
            let columns = columns_of(view, first, group);
            Some(part.ranges.joined(bricks.clone(), columns)).filter(|range| shows(*range))
        };
        let of_phase = |first: i64| (0..view.extent[0] / GROUP).map(|group| range(first, group)).collect();
        self.ranges = part.slice.across[0].iter().map(|taps| of_phase(taps.first)).collect();
        self.bricks = bricks;
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

/// The columns of bricks that the cells of a group need, if the taps of the lattice's first cell start at `first`.
fn columns_of(view: &SlicedView, first: i64, group: usize) -> Range<usize> {
    let from = first + (group * GROUP) as i64;
    let margin = view.margin as i64;
    let ends = [from - margin, from + (GROUP + 2 * view.reach[0] - 1) as i64 + margin];
    let [from, to] = ends.map(|column| column.clamp(0, view.count[0] as i64) as usize);
    if from < to { from / GROUP..to.div_ceil(GROUP) } else { 0..0 }
}

/// The same numbers from the first, the second and so on.
fn shifted(numbers: &[f32], count: usize) -> Vec<&[f32]> {
    (0..count).map(|n| numbers.get(n..).unwrap_or_default()).collect()
}
