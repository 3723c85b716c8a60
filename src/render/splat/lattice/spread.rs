//! Spreads the values of a block's voxels to the cells around them, by B-splines at the positions of eq 35.
//!
//! All voxels of a slice perpendicular to the principal axis have the same weights. So a row of voxels is convolved
//! with the weights along u, once for each phase, and a row of cells is a sum of such rows times the weights along v.

use super::Spreading;
use super::cells::{Aligned, CellPlane, LINE, Rectangle};
use super::spline::{MOST_DEGREE, Spread, spread};
use crate::base::grid::Region;
use crate::codec::real::Real;
use crate::render::plane_values::PlaneValues;
use std::ops::Range;

/// The location of a block's voxels in cells, the same for all planes.
#[derive(Debug)]
pub(in crate::render) struct Placed {
    spreading: Spreading,
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
    /// exp(-tau z) from the first voxel along b and c.
    fading: [Vec<f64>; 2],
}

/// A slice of a block, perpendicular to the principal axis.
#[derive(Debug)]
struct Slice {
    /// The first cell that the first voxel reaches.
    cell: [isize; 2],
    along: Spread,
    /// Weights along v, times exp(-tau z) of the first voxel.
    across: Spread,
    /// The voxels along b and along c that reach cells of the planes.
    voxels: [Range<usize>; 2],
}

/// Scratch for spreading a block.
#[derive(Debug, Default)]
pub(in crate::render) struct Work {
    /// Rows of values times their fading, with zeros on both sides.
    faded: Vec<f64>,
    /// The block's own cells.
    sums: Aligned,
    /// Number of zeros before a faded row, and the width of a row with its zeros.
    before: usize,
    width: usize,
    /// Cache lines that a row reaches in each phase.
    lines: usize,
}

impl Placed {
    /// Locates the block at `region`, limited to the voxels in `clip`. `extent` gives the cells of the planes.
    pub(super) fn new(spreading: &Spreading, region: &Region, clip: &Region, extent: &Rectangle) -> Self {
        let (clip, shear) = (region.intersect(clip), &spreading.shear);
        let (dims, block) = (clip.dims(), region.dims());
        let stride = |axis: usize| block[..axis].iter().product::<usize>();
        let count = shear.axes.map(|axis| dims[axis]);
        let fading = [0, 1].map(|i| {
            let depth = spreading.tau * shear.depths[i];
            (0..count[i]).map(|n| libm::exp(-depth * n as f64)).collect()
        });
        let slice = |k| Slice::new(clip.start, spreading, k, [count[0], count[1]], extent);
        let slices: Vec<Slice> = (0..count[2]).map(slice).collect();
        Self {
            spreading: *spreading,
            rectangle: rectangle_of(&slices, spreading, [count[0], count[1]]),
            slices,
            count,
            first: region.index(clip.start),
            steps: shear.axes.map(stride),
            fading,
            region: *region,
            clip,
        }
    }

    /// Adds values to a plane.
    pub(in crate::render) fn add(&self, values: PlaneValues<'_>, plane: &mut CellPlane<'_>, work: &mut Work) {
        match values {
            PlaneValues::Nothing => {}
            PlaneValues::Single(values) => self.add_all(values, plane, work),
            PlaneValues::Double(values) => self.add_all(values, plane, work),
            PlaneValues::Few(values) => {
                values.iter().for_each(|(voxel, value)| self.add_one(*voxel, *value, plane));
            }
        }
    }

    /// Adds dense values through the block's own cells, which stay in the second-level cache.
    fn add_all<R: Real>(&self, values: &[R], plane: &mut CellPlane<'_>, work: &mut Work) {
        if work.sums.len() < self.rectangle.area() {
            work.sums = Aligned::of(self.rectangle.area());
        }
        let mut sums = std::mem::take(&mut work.sums);
        let own = &mut sums[..self.rectangle.area()];
        own.fill(0.0);
        add_block(self, values, own, work);
        plane.add(&self.rectangle, own);
        work.sums = sums;
    }

    fn add_one(&self, voxel: u32, value: f64, plane: &mut CellPlane<'_>) {
        let Spreading { shear, degree, tau } = &self.spreading;
        let voxel = self.region.voxel(voxel as usize);
        if !(0..3).all(|a| (self.clip.start[a]..self.clip.end[a]).contains(&voxel[a])) {
            return;
        }
        let value = value * libm::exp(-tau * shear.depth(voxel));
        let [(u, along), (v, across)] = shear.position(voxel).map(|position| spread(*degree, position));
        for (v, across) in (v..).zip(&across[..=*degree]) {
            let Some(row) = plane.rectangle.row(v) else { continue };
            for (u, along) in (u..).zip(&along[..=*degree]) {
                if let Some(at) = plane.rectangle.in_row(u) {
                    plane.sums()[row.start + at] += value * across * along;
                }
            }
        }
    }
}

impl Slice {
    /// The `k`-th slice, of `count` voxels along b and c from `start` on.
    fn new(start: [usize; 3], spreading: &Spreading, k: usize, count: [usize; 2], extent: &Rectangle) -> Self {
        let mut voxel = start;
        voxel[spreading.shear.axes[2]] += k;
        let [u, v] = spreading.shear.position(voxel).map(|position| spread(spreading.degree, position));
        let fading = libm::exp(-spreading.tau * spreading.shear.depth(voxel));
        let cell = [u.0, v.0];
        let voxels = [0, 1].map(|i| extent.voxels_reaching(i, cell[i], spreading.degree, count[i]));
        Self { cell, along: u.1, across: v.1.map(|w| w * fading), voxels }
    }
}

/// The cells that slices of `count` voxels along b and c reach.
fn rectangle_of(slices: &[Slice], spreading: &Spreading, count: [usize; 2]) -> Rectangle {
    let q = spreading.shear.fineness;
    let range = |i: usize| {
        let cells = || slices.iter().map(|s| s.cell[i]);
        let (low, high) = (cells().min().unwrap_or(0), cells().max().unwrap_or(0));
        // Includes the zeros that pad rows with fewer taps.
        (low, (high - low) as usize + q * count[i].saturating_sub(1) + spreading.degree.max(MOST_DEGREE) + 1 + q)
    };
    let (u, v) = (range(0), range(1));
    Rectangle::holding([u.0, v.0], [u.1, v.1], q)
}

#[cfg_attr(not(feature = "portable"), multiversion::multiversion(targets("x86_64+avx512f", "x86_64+avx2")))]
fn add_block<R: Real>(placed: &Placed, values: &[R], sums: &mut [f64], work: &mut Work) {
    let Spreading { shear, degree, .. } = &placed.spreading;
    match (shear.fineness, (degree + 1).div_ceil(shear.fineness)) {
        (1, ..=4) => add_slices::<R, 1, 4>(placed, values, sums, work),
        (1, _) => add_slices::<R, 1, 8>(placed, values, sums, work),
        (2, ..=2) => add_slices::<R, 2, 2>(placed, values, sums, work),
        (2, 3) => add_slices::<R, 2, 3>(placed, values, sums, work),
        (2, _) => add_slices::<R, 2, 4>(placed, values, sums, work),
        (3, _) => add_slices::<R, 3, 3>(placed, values, sums, work),
        (_, _) => add_slices::<R, 4, 2>(placed, values, sums, work),
    }
}

/// Adds all slices, with `Q` cells per voxel. At most `TAPS` voxels along an axis reach a cell.
#[inline(always)]
fn add_slices<R: Real, const Q: usize, const TAPS: usize>(
    placed: &Placed,
    values: &[R],
    sums: &mut [f64],
    work: &mut Work,
) {
    work.clear(placed, TAPS);
    for first in (0..placed.count[1]).step_by(ROWS) {
        let rows = first..placed.count[1].min(first + ROWS);
        for (k, slice) in placed.slices.iter().enumerate() {
            let rows = rows.start.max(slice.voxels[1].start)..rows.end.min(slice.voxels[1].end);
            if rows.is_empty() {
                continue;
            }
            let values = &values[placed.first + k * placed.steps[2]..];
            let (live, voxels) = (fade_rows(placed, values, &rows, work), &slice.voxels[0]);
            let live = live.start.max(voxels.start / LINE)..live.end.min(voxels.end.div_ceil(LINE));
            if !live.is_empty() {
                add_rows::<Q, TAPS>((slice, &placed.rectangle), (&rows, &live), work, sums);
            }
        }
    }
}

/// Number of rows that are taken through all slices together: the cells that they reach stay in the first-level cache.
const ROWS: usize = 32;

impl Work {
    fn clear(&mut self, placed: &Placed, taps: usize) {
        self.before = LINE - 1 + taps - 1;
        self.lines = (self.before + placed.count[0]).div_ceil(LINE);
        self.width = self.before + self.lines * LINE;
        // Rows of zeros follow the last row.
        let rows = ROWS.min(placed.count[1]) + taps - 1;
        self.faded.clear();
        self.faded.resize(rows * self.width, 0.0);
    }
}

/// Computes rows of a slice times their fading. Returns the range of cache lines that hold nonzero values.
#[inline(always)]
fn fade_rows<R: Real>(placed: &Placed, values: &[R], rows: &Range<usize>, work: &mut Work) -> Range<usize> {
    let ([width, ..], [along, across, _]) = (placed.count, placed.steps);
    let mut live = 0;
    let (faded, behind) = work.faded.split_at_mut(rows.len() * work.width);
    for (c, row) in rows.clone().zip(faded.chunks_exact_mut(work.width)) {
        let row = &mut row[work.before..][..width];
        fade(&values[c * across..], along, (placed.fading[1][c], &placed.fading[0]), row);
        live |= live_lines(row);
    }
    behind.fill(0.0);
    let end = if live >> LAST == 1 { width.div_ceil(LINE) } else { 64 - live.leading_zeros() as usize };
    (live.trailing_zeros() as usize).min(end)..end
}

/// The bit for this line and all lines after it.
const LAST: usize = 63;

/// Fills a row with every `step`-th value times its fading.
#[inline(always)]
fn fade<R: Real>(values: &[R], step: usize, (scale, fading): (f64, &[f64]), row: &mut [f64]) {
    if step == 1 {
        for ((row, value), fading) in row.iter_mut().zip(values).zip(fading) {
            *row = value.to_f64() * (scale * fading);
        }
    } else {
        for ((row, value), fading) in row.iter_mut().zip(values.iter().step_by(step)).zip(fading) {
            *row = value.to_f64() * (scale * fading);
        }
    }
}

/// A bit for each cache line of a row that is not zero.
#[inline(always)]
fn live_lines(row: &[f64]) -> u64 {
    let mut live = 0;
    for (n, line) in row.chunks(LINE).enumerate() {
        let bits = line.iter().fold(0, |bits, v| bits | (v.to_bits() << 1)); // the shift drops the sign of zero
        live |= u64::from(bits != 0) << n.min(LAST);
    }
    live
}

/// Adds rows of a slice to all cells that they reach, one column of cache lines at a time. Down the rows of voxels c,
/// the values spread along u stay in registers for all rows of cells that they reach.
#[inline(always)]
fn add_rows<const Q: usize, const TAPS: usize>(
    (slice, rectangle): (&Slice, &Rectangle),
    (rows, live): (&Range<usize>, &Range<usize>),
    work: &Work,
    sums: &mut [f64],
) {
    let across = by_phase::<Q, TAPS>(&slice.across);
    let top = (slice.cell[1] - rectangle.first[1]) as usize + rows.start * Q;
    for (phase, along) in by_phase::<Q, TAPS>(&slice.along).into_iter().enumerate() {
        let run = rectangle.run_of(slice.cell[0] + phase as isize, work.lines);
        let reached = live.start..live.end + (run.inside + TAPS - 2) / LINE + 1;
        for n in reached.start.max(run.here.start)..reached.end.min(run.here.end) {
            let column = run.start + (n - run.here.start) * LINE;
            let from = n * LINE + work.before - run.inside + 1 - TAPS;
            let faded = work.faded[from..].chunks(work.width).take(rows.len() + TAPS - 1);
            let mut sums = sums[top * rectangle.size[0] + column..].chunks_mut(rectangle.size[0]);
            let mut window = [[0.0; LINE]; TAPS];
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
fn by_phase<const Q: usize, const TAPS: usize>(weights: &Spread) -> [[f64; TAPS]; Q] {
    let mut of_phases = [[0.0; TAPS]; Q];
    for (phase, taps) in of_phases.iter_mut().enumerate() {
        taps.iter_mut().zip(weights[phase..].iter().step_by(Q)).for_each(|(tap, weight)| *tap = *weight);
    }
    of_phases
}

/// out_j = sum over m of w_m row_(j + TAPS - 1 - m)
#[inline(always)]
fn convolved<const TAPS: usize>(row: &[f64], weights: &[f64; TAPS]) -> [f64; LINE] {
    let row = &row[..LINE + TAPS - 1];
    let mut out = [0.0; LINE];
    for m in 0..TAPS {
        for l in 0..LINE {
            out[l] += weights[m] * row[TAPS - 1 - m + l];
        }
    }
    out
}

#[inline(always)]
fn add_weighted<const TAPS: usize>(rows: &[[f64; LINE]; TAPS], weights: &[f64; TAPS], sums: &mut [f64]) {
    let sums = &mut sums[..LINE];
    let mut more = [0.0; LINE];
    for m in 0..TAPS {
        for l in 0..LINE {
            more[l] += weights[m] * rows[m][l];
        }
    }
    (0..LINE).for_each(|l| sums[l] += more[l]);
}
