//! Spreads the values of a block's voxels to the cells around them, by the weights of eq 45 at the positions of eq 35.
//!
//! All voxels of a slice perpendicular to the principal axis have the same weights. So a row of voxels is convolved
//! with the weights along u, once for each phase, and a row of cells is a sum of such rows times the weights along v.
//! A block is summed by itself, then added to its plane. Values that are large compared with their range are spread
//! less their middle, and the middle by the cells of a block of ones in f64.

use super::block_values::{BlockValues, fits_single};
use super::cells::{Aligned, CellPlane, LINE, Rectangle};
use super::fit::{CellWeights, MOST_WIDTH};
use super::shear::Shear;
use super::{Spreading, Sums};
use crate::render::batches::PlaneValues;
use std::ops::Range;
use std::sync::{Arc, OnceLock};
use wavesplat_core::base::grid::Region;
use wavesplat_core::base::vectors::dispatch;
use wavesplat_core::codec::real::Real;

/// The location of a block's voxels in cells, the same for all planes.
#[derive(Debug)]
pub(in crate::render) struct Placed {
    spreading: Arc<Spreading>,
    /// The block, and the part of it that counts.
    region: Region,
    clip: Region,
    slices: Vec<Slice>,
    /// The cells that the voxels reach.
    rectangle: Rectangle,
    /// Number of voxels that count along b, c and a. Then, in the array of the block, the index of the first of them
    /// and the steps to the next one along each axis.
    count: [usize; 3],
    first: usize,
    steps: [usize; 3],
    /// exp(-tau z) of the nearest voxel: the block's cells are in units of it.
    nearest: f64,
    /// exp(-tau z) from the first voxel along b and c; empty without attenuation.
    fading: [Vec<f64>; 2],
    /// The cells of the value 1 at all voxels, once needed.
    ones: OnceLock<Aligned<f64>>,
}

/// A slice of a block, perpendicular to the principal axis.
#[derive(Debug)]
struct Slice {
    /// The first cell that the first voxel reaches.
    cell: [isize; 2],
    along: CellWeights,
    /// Weights along v, times exp(-tau z) of the first voxel in units of the block's nearest one.
    across: CellWeights,
    /// The voxels along b and along c that reach cells of the planes.
    voxels: [Range<usize>; 2],
}

/// Scratch for spreading blocks.
#[derive(Debug, Default)]
pub(in crate::render) struct SpreadScratch {
    single: BlockScratch<f32>,
    double: BlockScratch<f64>,
}

/// Scratch for spreading a block.
#[derive(Debug, Default)]
struct BlockScratch<R> {
    /// Rows of values times their fading, with zeros on both sides.
    faded: Vec<R>,
    /// The block's own cells.
    sums: Aligned<R>,
    /// Number of zeros before a faded row, and the width of a row with its zeros.
    before: usize,
    width: usize,
    /// Cache lines that a row reaches in each phase.
    lines: usize,
}

impl Placed {
    /// Locates the block at `region`, limited to the voxels in `clip`. `extent` gives the cells of the planes.
    pub(super) fn new(spreading: &Arc<Spreading>, region: &Region, clip: &Region, extent: &Rectangle) -> Self {
        let (clip, shear) = (region.intersect(clip), &spreading.shear);
        let (dims, block) = (clip.dims(), region.dims());
        let stride = |axis: usize| block[..axis].iter().product::<usize>();
        let count = shear.axes.map(|axis| dims[axis]);
        let tau = spreading.tau;
        let fading = [0, 1].map(|i| match tau {
            0.0 => Vec::new(),
            _ => (0..count[i]).map(|n| libm::exp(-tau * shear.depths[i] * n as f64)).collect(),
        });
        let nearest = nearest_depth(shear, clip.start, count);
        let slice = |k| Slice::new(clip.start, nearest, spreading, k, [count[0], count[1]], extent);
        let slices: Vec<Slice> = (0..count[2]).map(slice).collect();
        Self {
            spreading: spreading.clone(),
            rectangle: rectangle_of(&slices, spreading, [count[0], count[1]]),
            slices,
            count,
            first: region.index(clip.start),
            steps: shear.axes.map(stride),
            nearest: libm::exp(-tau * nearest),
            fading,
            ones: OnceLock::new(),
            region: *region,
            clip,
        }
    }

    /// Adds values to a plane.
    pub(in crate::render) fn add(
        &self,
        values: PlaneValues<'_>,
        plane: &mut CellPlane<'_>,
        scratch: &mut SpreadScratch,
    ) {
        match values {
            PlaneValues::Nothing => {}
            PlaneValues::Single(values) => self.add_all(values, plane, scratch),
            PlaneValues::Double(values) => self.add_all(values, plane, scratch),
            PlaneValues::Few(values) => {
                values.iter().for_each(|(voxel, value)| self.add_one(*voxel, *value, plane));
            }
        }
    }

    /// Adds dense values through the block's own cells, which stay in the second-level cache.
    fn add_all<R: Real>(&self, values: &[R], plane: &mut CellPlane<'_>, scratch: &mut SpreadScratch) {
        let values = BlockValues::new(values);
        if values.middle != 0.0 {
            let ones = self.ones.get_or_init(|| self.spread_ones());
            plane.add_double(&self.rectangle, ones, values.middle * self.nearest);
        }
        let scale = values.scale * self.nearest;
        if values.scale == 0.0 {
            return;
        }
        if self.spreading.sums == Sums::Double {
            let sums = self.spread(&values, &mut scratch.double);
            plane.add_double(&self.rectangle, &sums, scale);
            scratch.double.sums = sums;
            return;
        }
        let sums = self.spread(&values, &mut scratch.single);
        if values.scale == 1.0 && fits_single(values.largest * self.nearest) {
            plane.add_single(&self.rectangle, &sums, scale as f32);
        } else {
            plane.add_double(&self.rectangle, &sums, scale);
        }
        scratch.single.sums = sums;
    }

    /// The cells of the value 1 at all voxels, in f64: those of a slice are the cells of a row times those of a column.
    fn spread_ones(&self) -> Aligned<f64> {
        let mut sums = Aligned::zeros(self.rectangle.area());
        for slice in &self.slices {
            let row = self.cells_of_ones(0, slice.cell[0], &slice.along);
            let column = self.cells_of_ones(1, slice.cell[1], &slice.across);
            dispatch!(add_product(&self.rectangle, &row, &column, &mut sums[..]));
        }
        sums
    }

    /// Spreads the value 1 of all voxels along u (0) or v (1). Gives each cell with its sum; the first voxel begins at `cell`.
    fn cells_of_ones(&self, i: usize, cell: isize, weights: &CellWeights) -> Vec<(isize, f64)> {
        let Shear { fineness, .. } = self.spreading.shear;
        let mut sums = vec![0.0; fineness * self.count[i].saturating_sub(1) + weights.len()];
        for n in 0..self.count[i] {
            let fading = self.fading[i].get(n).copied().unwrap_or(1.0);
            let reached = &mut sums[n * fineness..];
            reached.iter_mut().zip(weights).for_each(|(sum, weight)| *sum += fading * weight);
        }
        (cell..).zip(sums).filter(|(_, sum)| *sum != 0.0).collect()
    }

    /// The block's own cells.
    fn spread<R: Real, S: Real>(&self, values: &BlockValues<'_, R>, scratch: &mut BlockScratch<S>) -> Aligned<S> {
        let area = self.rectangle.area();
        let mut sums = std::mem::take(&mut scratch.sums);
        if sums.len() != area {
            sums = sums.resized(area);
        }
        sums.fill(S::default());
        dispatch!(add_block(self, values, &mut sums[..], scratch));
        sums
    }

    fn add_one(&self, voxel: u32, value: f64, plane: &mut CellPlane<'_>) {
        let Spreading { shear, tau, sums, .. } = self.spreading.as_ref();
        let voxel = self.region.voxel(voxel as usize);
        if !(0..3).all(|a| (self.clip.start[a]..self.clip.end[a]).contains(&voxel[a])) {
            return;
        }
        let value = value * libm::exp(-tau * shear.depth(voxel));
        if value == 0.0 {
            return;
        }
        let ([u, v], width) = (self.spreading.spread(voxel), self.spreading.width());
        for (v, across) in (v.first..).zip(&v.weights[..width]) {
            let Some(row) = plane.rectangle.row(v) else { continue };
            for (u, along) in (u.first..).zip(&u.weights[..width]) {
                match plane.rectangle.in_row(u) {
                    Some(at) if *sums == Sums::Single && fits_single(value) => {
                        plane.single()[row.start + at] += (value * across * along) as f32;
                    }
                    Some(at) => plane.double()[row.start + at] += value * across * along,
                    None => {}
                }
            }
        }
    }
}

impl Slice {
    /// The `k`-th slice, of `count` voxels along b and c from `start` on.
    fn new(
        start: [usize; 3],
        nearest: f64,
        spreading: &Spreading,
        k: usize,
        count: [usize; 2],
        extent: &Rectangle,
    ) -> Self {
        let mut voxel = start;
        voxel[spreading.shear.axes[2]] += k;
        let [u, v] = spreading.spread(voxel);
        let fading = libm::exp(-spreading.tau * (spreading.shear.depth(voxel) - nearest));
        let cell = [u.first, v.first];
        let voxels = [0, 1].map(|i| extent.voxels_reaching(i, cell[i], spreading.width(), count[i]));
        Self { cell, along: u.weights, across: v.weights.map(|w| w * fading), voxels }
    }
}

/// The depth of the nearest voxel of a box of voxels. The counts are along b, c and a.
fn nearest_depth(shear: &Shear, start: [usize; 3], count: [usize; 3]) -> f64 {
    let deeper = |i: usize| (shear.depths[i] * count[i].saturating_sub(1) as f64).min(0.0);
    shear.depth(start) + (0..3).map(deeper).sum::<f64>()
}

/// The cells that slices of `count` voxels along b and c reach.
fn rectangle_of(slices: &[Slice], spreading: &Spreading, count: [usize; 2]) -> Rectangle {
    let q = spreading.shear.fineness;
    let range = |i: usize| {
        let cells = || slices.iter().map(|s| s.cell[i]);
        let (low, high) = (cells().min().unwrap_or(0), cells().max().unwrap_or(0));
        // Includes the zeros that pad rows with fewer taps.
        (low, (high - low) as usize + q * count[i].saturating_sub(1) + MOST_WIDTH + q)
    };
    let (u, v) = (range(0), range(1));
    Rectangle::holding([u.0, v.0], [u.1, v.1], q)
}

/// Adds the products of a row of cells and a column of cells.
#[inline(always)]
fn add_product(rectangle: &Rectangle, row: &[(isize, f64)], column: &[(isize, f64)], sums: &mut [f64]) {
    let mut cells = vec![0.0; rectangle.size[0]];
    for (u, sum) in row {
        rectangle.in_row(*u).into_iter().for_each(|at| cells[at] = *sum);
    }
    let of_phase = |at: usize| {
        let phase = &cells[at..at + rectangle.run];
        let end = phase.iter().rposition(|sum| *sum != 0.0).map_or(0, |last| last + 1);
        at + phase.iter().position(|sum| *sum != 0.0).unwrap_or(0)..at + end
    };
    let phases: Vec<Range<usize>> = (0..cells.len()).step_by(rectangle.run.max(1)).map(of_phase).collect();
    for (v, weight) in column {
        let Some(all) = rectangle.row(*v) else { continue };
        for here in phases.iter().filter(|here| here.start < here.end) {
            let sums = &mut sums[all.start + here.start..all.start + here.end];
            sums.iter_mut().zip(&cells[here.clone()]).for_each(|(sum, cell)| *sum += weight * cell);
        }
    }
}

#[inline(always)]
fn add_block<R: Real, S: Real>(
    placed: &Placed,
    values: &BlockValues<'_, R>,
    sums: &mut [S],
    scratch: &mut BlockScratch<S>,
) {
    let (fineness, width) = (placed.spreading.shear.fineness, placed.spreading.width());
    match (fineness, width.div_ceil(fineness)) {
        (1, ..=4) => add_slices::<R, S, 1, 4>(placed, values, sums, scratch),
        (1, _) => add_slices::<R, S, 1, 6>(placed, values, sums, scratch),
        (2, ..=2) => add_slices::<R, S, 2, 2>(placed, values, sums, scratch),
        (2, _) => add_slices::<R, S, 2, 3>(placed, values, sums, scratch),
        (3, _) => add_slices::<R, S, 3, 2>(placed, values, sums, scratch),
        (_, _) => add_slices::<R, S, 4, 2>(placed, values, sums, scratch),
    }
}

/// Adds all slices, with `Q` cells per voxel. At most `TAPS` voxels along an axis reach a cell.
#[inline(always)]
fn add_slices<R: Real, S: Real, const Q: usize, const TAPS: usize>(
    placed: &Placed,
    values: &BlockValues<'_, R>,
    sums: &mut [S],
    scratch: &mut BlockScratch<S>,
) {
    scratch.clear(placed, TAPS);
    for first in (0..placed.count[1]).step_by(ROWS) {
        let rows = first..placed.count[1].min(first + ROWS);
        for (k, slice) in placed.slices.iter().enumerate() {
            let rows = rows.start.max(slice.voxels[1].start)..rows.end.min(slice.voxels[1].end);
            if rows.is_empty() {
                continue;
            }
            let (live, voxels) = (fade_rows(placed, k, values, &rows, scratch), &slice.voxels[0]);
            let live = live.start.max(voxels.start / LINE)..live.end.min(voxels.end.div_ceil(LINE));
            if !live.is_empty() {
                add_rows::<S, Q, TAPS>(slice, &placed.rectangle, &rows, &live, scratch, sums);
            }
        }
    }
}

/// Number of rows that are taken through all slices together: the cells that they reach stay in the first-level cache.
const ROWS: usize = 32;

impl<S: Real> BlockScratch<S> {
    fn clear(&mut self, placed: &Placed, taps: usize) {
        self.before = LINE - 1 + taps - 1;
        self.lines = (self.before + placed.count[0]).div_ceil(LINE);
        self.width = self.before + self.lines * LINE;
        // Rows of zeros follow the last row.
        let rows = ROWS.min(placed.count[1]) + taps - 1;
        self.faded.clear();
        self.faded.resize(rows * self.width, S::default());
    }
}

/// Computes rows of a slice times their fading. Returns the range of cache lines that hold nonzero values.
#[inline(always)]
fn fade_rows<R: Real, S: Real>(
    placed: &Placed,
    k: usize,
    values: &BlockValues<'_, R>,
    rows: &Range<usize>,
    scratch: &mut BlockScratch<S>,
) -> Range<usize> {
    let ([width, ..], [along, across, slices]) = (placed.count, placed.steps);
    let mut live = 0;
    let (faded, behind) = scratch.faded.split_at_mut(rows.len() * scratch.width);
    for (c, row) in rows.clone().zip(faded.chunks_exact_mut(scratch.width)) {
        let row = &mut row[scratch.before..][..width];
        values.load_row(placed.first + k * slices + c * across, along, row);
        if let [_, ..] = placed.fading[0][..] {
            fade(row, placed.fading[1][c], &placed.fading[0]);
        }
        live |= live_lines(row);
    }
    behind.fill(S::default());
    let end = if live >> LAST == 1 { width.div_ceil(LINE) } else { 64 - live.leading_zeros() as usize };
    (live.trailing_zeros() as usize).min(end)..end
}

/// The bit for this line and all lines after it.
const LAST: usize = 63;

/// Multiplies a row by its fading.
#[inline(always)]
fn fade<S: Real>(row: &mut [S], scale: f64, fading: &[f64]) {
    row.iter_mut().zip(fading).for_each(|(value, fading)| *value = *value * S::from_f64(scale * fading));
}

/// A bit for each line of a row that is not zero.
#[inline(always)]
fn live_lines<S: Real>(row: &[S]) -> u64 {
    let mut live = 0;
    for (n, line) in row.chunks(LINE).enumerate() {
        let any = line.iter().fold(false, |any, value| any | (*value != S::default()));
        live |= u64::from(any) << n.min(LAST);
    }
    live
}

/// Adds rows of a slice to all cells that they reach, one column of cache lines at a time. Down the rows of voxels c,
/// the values spread along u stay in registers for all rows of cells that they reach.
#[inline(always)]
fn add_rows<S: Real, const Q: usize, const TAPS: usize>(
    slice: &Slice,
    rectangle: &Rectangle,
    rows: &Range<usize>,
    live: &Range<usize>,
    scratch: &BlockScratch<S>,
    sums: &mut [S],
) {
    let across = by_phase::<S, Q, TAPS>(&slice.across);
    let top = (slice.cell[1] - rectangle.first[1]) as usize + rows.start * Q;
    for (phase, along) in by_phase::<S, Q, TAPS>(&slice.along).into_iter().enumerate() {
        let run = rectangle.run_of(slice.cell[0] + phase as isize, scratch.lines);
        let reached = live.start..live.end + (run.inside + TAPS - 2) / LINE + 1;
        for n in reached.start.max(run.here.start)..reached.end.min(run.here.end) {
            let column = run.start + (n - run.here.start) * LINE;
            let from = n * LINE + scratch.before - run.inside + 1 - TAPS;
            let faded = scratch.faded[from..].chunks(scratch.width).take(rows.len() + TAPS - 1);
            let mut sums = sums[top * rectangle.size[0] + column..].chunks_mut(rectangle.size[0]);
            let mut window = [[S::default(); LINE]; TAPS];
            for row in faded {
                for m in (1..TAPS).rev() {
                    window[m] = window[m - 1];
                }
                window[0] = convolved(row, &along);
                for (across, sums) in across.iter().zip(sums.by_ref()) {
                    add_weighted(&window, across, sums);
                }
            }
        }
    }
}

/// The weights of the voxels that reach a cell of each phase: of the voxel at the cell, of the voxel before it, ...
#[inline(always)]
fn by_phase<S: Real, const Q: usize, const TAPS: usize>(weights: &CellWeights) -> [[S; TAPS]; Q] {
    let mut of_phases = [[S::default(); TAPS]; Q];
    for (phase, taps) in of_phases.iter_mut().enumerate() {
        taps.iter_mut().zip(weights[phase..].iter().step_by(Q)).for_each(|(tap, weight)| *tap = S::from_f64(*weight));
    }
    of_phases
}

/// out_j = sum over m of w_m row_(j + TAPS - 1 - m)
#[inline(always)]
fn convolved<S: Real, const TAPS: usize>(row: &[S], weights: &[S; TAPS]) -> [S; LINE] {
    let row = &row[..LINE + TAPS - 1];
    let mut out = [S::default(); LINE];
    for m in 0..TAPS {
        for l in 0..LINE {
            out[l] = out[l] + weights[m] * row[TAPS - 1 - m + l];
        }
    }
    out
}

#[inline(always)]
fn add_weighted<S: Real, const TAPS: usize>(rows: &[[S; LINE]; TAPS], weights: &[S; TAPS], sums: &mut [S]) {
    let sums = &mut sums[..LINE];
    let mut more = [S::default(); LINE];
    for m in 0..TAPS {
        for l in 0..LINE {
            more[l] = more[l] + weights[m] * rows[m][l];
        }
    }
    for l in 0..LINE {
        sums[l] = sums[l] + more[l];
    }
}
