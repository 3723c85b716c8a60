//! Adds slices to a band of the lattice: the kernel along a, then along b and c for each phase, then a blend.

use super::bricks::Ranges;
use super::filter::{Strip, mix, mix_present};
use super::layer::Layers;
use super::row::{Blend, Row};
use super::view::{Slice, SlicedView};
use super::{BRICK_ROWS, GROUP, LEAST};
use std::ops::Range;

/// A band of rows of the lattice of one frame.
pub(super) struct Band<'a, B: Blend> {
    pub(super) view: &'a SlicedView,
    pub(super) blend: &'a B,
    /// Rows in voxels; each has `cells` rows of cells, and these have `cells` phases each.
    pub(super) rows: Range<usize>,
    /// Groups of cells and their limits: row by row, phase by phase.
    pub(super) groups: &'a mut [B::Group],
    pub(super) limits: &'a mut [f32],
    pub(super) work: Work,
}

/// The sums of one slice along some axes: of values, and of the weights of present samples.
#[derive(Debug, Default)]
struct Sums {
    values: Vec<f32>,
    present: Vec<f32>,
}

impl Sums {
    fn of(count: usize) -> Self {
        Self { values: vec![0.0; count], present: Vec::new() }
    }

    /// Makes room for the weights of present samples.
    fn with_present(&mut self) {
        self.present.resize(self.values.len(), 0.0);
    }
}

/// The sums of the slice in work.
pub(super) struct Work {
    /// Zeros before and behind each row of sums along a.
    rim: usize,
    along_a: Sums,
    /// Sums along a and b, for each phase along b.
    along_b: Vec<Sums>,
}

impl Work {
    /// For a band of `rows` rows.
    pub(super) fn new(view: &SlicedView, rows: usize) -> Self {
        let (rim, rows) = (2 * view.reach[0] + GROUP, Self::rows(view, rows));
        let along_a = Sums::of(rows * Self::width(view, rim));
        let along_b = (0..view.cells).map(|_| Sums::of(rows * view.extent[0])).collect();
        Self { rim, along_a, along_b }
    }

    /// The most rows of voxels, in whole bricks, that a band of `rows` rows needs.
    fn rows(view: &SlicedView, rows: usize) -> usize {
        (rows + 2 * view.reach[1] + 1 + 2 * BRICK_ROWS).min(view.count[1].next_multiple_of(BRICK_ROWS))
    }

    fn width(view: &SlicedView, rim: usize) -> usize {
        view.count[0].next_multiple_of(GROUP) + 2 * rim
    }

    /// Bytes, if samples are missing.
    pub(super) fn bytes(view: &SlicedView, rows: usize) -> usize {
        let row = Self::width(view, 2 * view.reach[0] + GROUP) + view.cells * view.extent[0];
        2 * size_of::<f32>() * Self::rows(view, rows) * row
    }
}

/// The part of a slice that a band needs.
struct Part<'a> {
    slice: &'a Slice,
    /// The layers that the kernel meets, with their weights.
    layers: Vec<&'a [f32]>,
    weights: &'a [f32],
    /// The sum of these weights.
    share: f32,
    has_missing: bool,
    /// The rows of bricks that the band needs. Sums begin with the first of them.
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
        if self.blend.shows(part.ranges.of(part.bricks.clone(), 0..part.ranges.columns)) {
            self.along_a(&part, layers);
            (0..self.view.cells).for_each(|phase| self.along_b(&part, phase));
            self.along_c(&part);
        }
    }

    fn part<'s>(&self, slice: &'s Slice, layers: &'s Layers) -> Part<'s> {
        let view = self.view;
        let (first, met) = slice.along.within(0, view.count[2]);
        let numbers = first..first + met.len();
        let columns = layers.stride / GROUP;
        let ranges =
            Ranges::joint(numbers.clone().map(|layer| layers.ranges(layer)), columns, layers.rows.div_ceil(BRICK_ROWS));
        let wide = ranges.dilated((2 * view.reach[1]).div_ceil(BRICK_ROWS));
        let firsts = slice.across[1].iter().map(|taps| taps.first);
        let (least, most) = (firsts.clone().min().unwrap_or(0), firsts.max().unwrap_or(0));
        let rows = [least + self.rows.start as i64, most + (self.rows.end + 2 * view.reach[1]) as i64];
        let rows = rows.map(|row| row.clamp(0, layers.rows as i64) as usize);
        Part {
            slice,
            layers: numbers.clone().map(|layer| layers.layer(layer)).collect(),
            weights: &slice.along.weights[met],
            share: slice.along.presence(0, view.count[2]),
            has_missing: numbers.into_iter().any(|layer| layers.is_missing(layer)),
            bricks: rows[0] / BRICK_ROWS..rows[1].div_ceil(BRICK_ROWS),
            ranges,
            wide,
        }
    }

    /// Sums along a, for all bricks that a visible cell may need.
    fn along_a(&mut self, part: &Part<'_>, layers: &Layers) {
        let (view, rim) = (self.view, self.work.rim);
        let (columns, stride) = (part.ranges.columns, Work::width(view, rim));
        let reach = (GROUP + 2 * view.reach[0]) / GROUP + 1;
        let sums = &mut self.work.along_a;
        if part.has_missing {
            sums.with_present();
        }
        for row in part.bricks.clone() {
            for column in 0..columns {
                let near = column.saturating_sub(reach)..(column + reach + 1).min(columns);
                if !self.blend.shows(part.wide.of(row..row + 1, near)) {
                    continue;
                }
                let (first, rows) = rows_of(row, layers.rows);
                let from = Strip { at: first * layers.stride + column * GROUP, stride: layers.stride };
                let to = Strip { at: (first - part.start()) * stride + rim + column * GROUP, stride };
                if part.has_missing {
                    let mask = std::array::from_fn(|i| f32::from(u8::from(column * GROUP + i < view.count[0])));
                    let out = (to, sums.values.as_mut_slice(), sums.present.as_mut_slice());
                    mix_present(&part.layers, part.weights, (from, &mask), rows, out);
                } else {
                    mix(&part.layers, part.weights, from, rows, (to, &mut sums.values));
                }
            }
        }
    }

    /// Sums along b of one phase, for all groups that a visible cell may need.
    fn along_b(&mut self, part: &Part<'_>, phase: usize) {
        let (view, rim) = (self.view, self.work.rim);
        let taps = &part.slice.across[0][phase];
        let (from, to) = (Work::width(view, rim), view.extent[0]);
        let sums = &mut self.work.along_b[phase];
        if part.has_missing {
            sums.with_present();
        }
        let shifted = |sums| shifted(sums, taps.weights.len());
        let (values, present) = (shifted(&self.work.along_a.values), shifted(&self.work.along_a.present));
        for group in 0..view.extent[0] / GROUP {
            let columns = columns_of(view, taps.first, group);
            let at = rim as i64 + taps.first + (group * GROUP) as i64;
            for row in part.bricks.clone() {
                if columns.is_empty() || !self.blend.shows(part.wide.of(row..row + 1, columns.clone())) {
                    continue;
                }
                let (first, rows) = rows_of(row, view.count[1]);
                let first = first - part.start();
                let strip = Strip { at: first * from + at as usize, stride: from };
                let out = Strip { at: first * to + group * GROUP, stride: to };
                mix(&values, &taps.weights, strip, rows, (out, &mut sums.values));
                if part.has_missing {
                    mix(&present, &taps.weights, strip, rows, (out, &mut sums.present));
                }
            }
        }
    }

    /// Sums along c, and blends.
    fn along_c(&mut self, part: &Part<'_>) {
        let view = self.view;
        let count = view.extent[0] / GROUP;
        let shares: Vec<Vec<f32>> = part.slice.across[0].iter().map(|taps| shares_of(view, taps)).collect();
        let is_whole = |group: &[f32]| group.iter().all(|share| *share == 1.0);
        let whole: Vec<Vec<bool>> =
            shares.iter().map(|shares| shares.chunks_exact(GROUP).map(is_whole).collect()).collect();
        let mut visible = vec![Visible::default(); view.cells];
        let mut live = vec![false; count];
        for row in self.rows.clone() {
            for (down, taps) in part.slice.across[1].iter().enumerate() {
                let (first, met) = taps.within(row as i64, view.count[1]);
                if met.is_empty() {
                    continue;
                }
                let bricks = first / BRICK_ROWS..(first + met.len() - 1) / BRICK_ROWS + 1;
                visible[down].update(part, bricks, |range| self.blend.shows(range), view);
                let share = part.share * taps.presence(row as i64, view.count[1]);
                for (phase, across) in part.slice.across[0].iter().enumerate() {
                    let density = part.slice.along.density * taps.density * across.density;
                    if share * (density as f32) < LEAST {
                        continue;
                    }
                    let at = (((row - self.rows.start) * view.cells + down) * view.cells + phase) * count;
                    let (groups, limits) = (&mut self.groups[at..at + count], &mut self.limits[at..at + count]);
                    if !visible[down].live::<B>(phase, limits, &mut live) {
                        continue;
                    }
                    let sums = &self.work.along_b[phase];
                    let from = (first - part.start()) * view.extent[0];
                    self.blend.add(
                        &Row {
                            values: &sums.values[from..],
                            present: part.has_missing.then(|| &sums.present[from..]),
                            stride: view.extent[0],
                            weights: &taps.weights[met.clone()],
                            share,
                            shares: &shares[phase],
                            density: density as f32,
                            least: B::LEAST,
                            live: &live,
                            whole: &whole[phase],
                            slice: part.slice.number,
                        },
                        groups,
                        limits,
                    );
                }
            }
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
            Some(part.ranges.of(bricks.clone(), columns)).filter(|range| shows(*range))
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
    let ends = [from, from + (GROUP + 2 * view.reach[0] - 1) as i64];
    let [from, to] = ends.map(|column| column.clamp(0, view.count[0] as i64) as usize);
    if from < to { from / GROUP..to.div_ceil(GROUP) } else { 0..0 }
}

/// For each cell of a row, the sum of weights along b that meet the region.
fn shares_of(view: &SlicedView, taps: &super::taps::Taps) -> Vec<f32> {
    (0..view.extent[0]).map(|cell| taps.presence(cell as i64, view.count[0])).collect()
}

/// The same numbers from the first, the second and so on.
fn shifted(numbers: &[f32], count: usize) -> Vec<&[f32]> {
    (0..count).map(|n| numbers.get(n..).unwrap_or_default()).collect()
}
