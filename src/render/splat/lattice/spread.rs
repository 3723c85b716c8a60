//! The amounts of a block's voxels to the cells around them, by B-splines at the places of eq 35.
//!
//! All voxels of a slice across the principal axis are spread by the same weights. So a row of them is convolved with
//! the weights along u, once for each phase, and rows of cells are sums of such rows times the weights along v.

use super::Spreading;
use super::cells::{Aligned, CellPlane, LINE, Rectangle};
use super::shares::Shares;
use super::spline::{MOST_DEGREE, Spread, spread};
use crate::base::grid::Region;
use crate::codec::real::Real;
use crate::render::plane_values::PlaneValues;
use crate::render::splat::slab::Slab;
use crate::render::splat::tile_rect::intersect;
use std::ops::Range;

/// Where the voxels of a block are in cells: the same for all planes.
#[derive(Debug)]
pub(in crate::render) struct Placed {
    spreading: Spreading,
    /// The block, and what of it counts.
    region: Region,
    clip: Region,
    slices: Vec<Slice>,
    /// The cells that they reach.
    rectangle: Rectangle,
    /// Voxels that count along b, c and a; the first of them, and from one to the next, in an array of all.
    count: [usize; 3],
    first: usize,
    steps: [usize; 3],
    /// exp(-tau z) from the first voxel along b and c.
    fading: [Vec<f64>; 2],
    /// What is in the slab, if only one is seen.
    shares: Option<Shares>,
}

/// A slice of a block across the principal axis.
#[derive(Debug)]
struct Slice {
    /// The first cell that its first voxel reaches.
    cell: [isize; 2],
    along: Spread,
    /// Times exp(-tau z) of its first voxel.
    across: Spread,
    /// The voxels along b and along c that reach cells that are there.
    seen: [Range<usize>; 2],
}

/// Room for a slice that is being spread.
#[derive(Debug, Default)]
pub(in crate::render) struct Work {
    /// Rows of voxels times their fading, with zeros on both sides.
    faded: Vec<f64>,
    /// The block's own cells.
    sums: Aligned,
    /// Zeros before a faded row, and all numbers of one.
    before: usize,
    width: usize,
    /// Cache lines that a row reaches, of each phase.
    lines: usize,
}

impl Placed {
    /// Of the block at `region`, of which the voxels in `clip` count, and these as far as they are in a slab, for
    /// planes of some cells.
    pub(super) fn new(
        spreading: &Spreading,
        region: &Region,
        (clip, slab): (&Region, Option<&Slab>),
        seen: &Rectangle,
    ) -> Self {
        let (clip, shear) = (region.intersect(clip), &spreading.shear);
        let (dims, block) = (clip.dims(), region.dims());
        let stride = |axis: usize| block[..axis].iter().product::<usize>();
        let count = shear.axes.map(|axis| dims[axis]);
        let fading = [0, 1].map(|i| {
            let depth = spreading.tau * shear.depths[i];
            (0..count[i]).map(|n| libm::exp(-depth * n as f64)).collect()
        });
        let slice = |k| Slice::new(clip.start, spreading, k, [count[0], count[1]], seen);
        let mut slices: Vec<Slice> = (0..count[2]).map(slice).collect();
        let shares = slab.map(|slab| Shares::new(slab, shear, clip.start, count));
        if let Some(shares) = &shares {
            slices.iter_mut().enumerate().for_each(|(k, slice)| slice.keep(shares.reached(k)));
        }
        Self {
            spreading: *spreading,
            rectangle: rectangle_of(&slices, spreading, [count[0], count[1]]),
            slices,
            count,
            first: region.index(clip.start),
            steps: shear.axes.map(stride),
            fading,
            shares,
            region: *region,
            clip,
        }
    }

    /// Adds amounts to a plane.
    pub(in crate::render) fn add(&self, amounts: PlaneValues<'_>, plane: &mut CellPlane<'_>, work: &mut Work) {
        match amounts {
            PlaneValues::Nothing => {}
            PlaneValues::Single(amounts) => self.add_all(amounts, plane, work),
            PlaneValues::Double(amounts) => self.add_all(amounts, plane, work),
            PlaneValues::Few(amounts) => {
                amounts.iter().for_each(|(voxel, amount)| self.add_one(*voxel, *amount, plane));
            }
        }
    }

    /// By way of the block's own cells, which stay in the second cache.
    fn add_all<R: Real>(&self, amounts: &[R], plane: &mut CellPlane<'_>, work: &mut Work) {
        if work.sums.len() < self.rectangle.area() {
            work.sums = Aligned::of(self.rectangle.area());
        }
        let mut sums = std::mem::take(&mut work.sums);
        let own = &mut sums[..self.rectangle.area()];
        own.fill(0.0);
        add_block(self, amounts, own, work);
        plane.add(&self.rectangle, own);
        work.sums = sums;
    }

    fn add_one(&self, voxel: u32, amount: f64, plane: &mut CellPlane<'_>) {
        let Spreading { shear, degree, tau } = &self.spreading;
        let voxel = self.region.voxel(voxel as usize);
        if !(0..3).all(|a| (self.clip.start[a]..self.clip.end[a]).contains(&voxel[a])) {
            return;
        }
        let share = self.shares.as_ref().map_or(1.0, |shares| shares.of_depth(shear.depth(voxel)));
        let amount = amount * share * libm::exp(-tau * shear.depth(voxel));
        let [(u, along), (v, across)] = shear.place(voxel).map(|place| spread(*degree, place));
        for (v, across) in (v..).zip(&across[..=*degree]) {
            let Some(row) = plane.rectangle.row(v) else { continue };
            for (u, along) in (u..).zip(&along[..=*degree]) {
                if let Some(at) = plane.rectangle.in_row(u) {
                    plane.sums()[row.start + at] += amount * across * along;
                }
            }
        }
    }
}

impl Slice {
    /// Of the `k`-th slice of so many voxels from `start` on.
    fn new(start: [usize; 3], spreading: &Spreading, k: usize, count: [usize; 2], seen: &Rectangle) -> Self {
        let mut voxel = start;
        voxel[spreading.shear.axes[2]] += k;
        let [u, v] = spreading.shear.place(voxel).map(|place| spread(spreading.degree, place));
        let fading = libm::exp(-spreading.tau * spreading.shear.depth(voxel));
        let cell = [u.0, v.0];
        let seen = [0, 1].map(|i| seen.seen_from(i, cell[i], spreading.degree, count[i]));
        Self { cell, along: u.1, across: v.1.map(|w| w * fading), seen }
    }

    /// Leaves of its voxels those in some ranges along b and c.
    fn keep(&mut self, [b, c]: &[Range<usize>; 2]) {
        self.seen = [intersect(&self.seen[0], b), intersect(&self.seen[1], c)];
    }
}

/// The cells that slices of so many voxels along b and c reach.
fn rectangle_of(slices: &[Slice], spreading: &Spreading, count: [usize; 2]) -> Rectangle {
    let q = spreading.shear.fineness;
    let range = |i: usize| {
        let cells = || slices.iter().map(|s| s.cell[i]);
        let (low, high) = (cells().min().unwrap_or(0), cells().max().unwrap_or(0));
        // Of rows with fewer taps than others some zeros are added, too.
        (low, (high - low) as usize + q * count[i].saturating_sub(1) + spreading.degree.max(MOST_DEGREE) + 1 + q)
    };
    let (u, v) = (range(0), range(1));
    Rectangle::holding([u.0, v.0], [u.1, v.1], q)
}

#[cfg_attr(not(feature = "portable"), multiversion::multiversion(targets("x86_64+avx512f", "x86_64+avx2")))]
fn add_block<R: Real>(placed: &Placed, amounts: &[R], sums: &mut [f64], work: &mut Work) {
    let Spreading { shear, degree, .. } = &placed.spreading;
    match (shear.fineness, (degree + 1).div_ceil(shear.fineness)) {
        (1, ..=4) => add_slices::<R, 1, 4>(placed, amounts, sums, work),
        (1, _) => add_slices::<R, 1, 8>(placed, amounts, sums, work),
        (2, ..=2) => add_slices::<R, 2, 2>(placed, amounts, sums, work),
        (2, 3) => add_slices::<R, 2, 3>(placed, amounts, sums, work),
        (2, _) => add_slices::<R, 2, 4>(placed, amounts, sums, work),
        (3, _) => add_slices::<R, 3, 3>(placed, amounts, sums, work),
        (_, _) => add_slices::<R, 4, 2>(placed, amounts, sums, work),
    }
}

/// `Q` cells per voxel, of which along an axis a cell sees at most `TAPS` voxels.
#[inline(always)]
fn add_slices<R: Real, const Q: usize, const TAPS: usize>(
    placed: &Placed,
    amounts: &[R],
    sums: &mut [f64],
    work: &mut Work,
) {
    work.clear(placed, TAPS);
    for first in (0..placed.count[1]).step_by(ROWS) {
        let rows = first..placed.count[1].min(first + ROWS);
        for (k, slice) in placed.slices.iter().enumerate() {
            let rows = rows.start.max(slice.seen[1].start)..rows.end.min(slice.seen[1].end);
            if rows.is_empty() {
                continue;
            }
            let amounts = &amounts[placed.first + k * placed.steps[2]..];
            let (live, seen) = (fade_rows(placed, (k, amounts), &rows, work), &slice.seen[0]);
            let live = live.start.max(seen.start / LINE)..live.end.min(seen.end.div_ceil(LINE));
            if !live.is_empty() {
                add_rows::<Q, TAPS>((slice, &placed.rectangle), (&rows, &live), work, sums);
            }
        }
    }
}

/// Voxels across rows that are taken through all slices together: what they reach stays in the first cache.
const ROWS: usize = 32;

impl Work {
    fn clear(&mut self, placed: &Placed, taps: usize) {
        self.before = LINE - 1 + taps - 1;
        self.lines = (self.before + placed.count[0]).div_ceil(LINE);
        self.width = self.before + self.lines * LINE;
        // Rows of zeros take the place of those behind the last one.
        let rows = ROWS.min(placed.count[1]) + taps - 1;
        self.faded.clear();
        self.faded.resize(rows * self.width, 0.0);
    }
}

/// Some rows of a slice times their fading; which of their lines of voxels have any that is not zero.
#[inline(always)]
fn fade_rows<R: Real>(
    placed: &Placed,
    (k, amounts): (usize, &[R]),
    rows: &Range<usize>,
    work: &mut Work,
) -> Range<usize> {
    let ([width, ..], [along, across, _]) = (placed.count, placed.steps);
    let mut live = 0;
    let (faded, behind) = work.faded.split_at_mut(rows.len() * work.width);
    for (c, row) in rows.clone().zip(faded.chunks_exact_mut(work.width)) {
        let row = &mut row[work.before..][..width];
        match &placed.shares {
            None => fade(&amounts[c * across..], along, (placed.fading[1][c], &placed.fading[0]), row),
            Some(shares) => share(&amounts[c * across..], along, shares.of_row(k, c), row),
        }
        live |= live_lines(row);
    }
    behind.fill(0.0);
    let end = if live >> LAST == 1 { width.div_ceil(LINE) } else { 64 - live.leading_zeros() as usize };
    (live.trailing_zeros() as usize).min(end)..end
}

/// The bit that stands for all lines from there on.
const LAST: usize = 63;

/// Every `step`-th amount times its fading, into a row.
#[inline(always)]
fn fade<R: Real>(amounts: &[R], step: usize, (scale, fading): (f64, &[f64]), row: &mut [f64]) {
    if step == 1 {
        for ((row, amount), fading) in row.iter_mut().zip(amounts).zip(fading) {
            *row = amount.to_f64() * (scale * fading);
        }
    } else {
        for ((row, amount), fading) in row.iter_mut().zip(amounts.iter().step_by(step)).zip(fading) {
            *row = amount.to_f64() * (scale * fading);
        }
    }
}

/// The same times the share that is in a slab, of a run of voxels; others have none.
#[inline(always)]
fn share<R: Real>(amounts: &[R], step: usize, (first, shares): (usize, &[f64]), row: &mut [f64]) {
    row.fill(0.0);
    let amounts = amounts.iter().skip(first * step).step_by(step);
    for ((row, amount), share) in row[first..].iter_mut().zip(amounts).zip(shares) {
        *row = amount.to_f64() * share;
    }
}

/// A bit for each line of a row that is not zero.
#[inline(always)]
fn live_lines(row: &[f64]) -> u64 {
    let mut live = 0;
    for (n, line) in row.chunks(LINE).enumerate() {
        let bits = line.iter().fold(0, |bits, v| bits | (v.to_bits() << 1)); // of either zero none is left
        live |= u64::from(bits != 0) << n.min(LAST);
    }
    live
}

/// Adds rows of a slice to all cells that they reach, a column of cache lines at a time: down the rows of voxels c,
/// what is spread along u stays in registers for all rows of cells that it reaches.
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

/// The weights that fall on the cells of each phase: of the voxel there, of the one before, ...
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
