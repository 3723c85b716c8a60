//! The largest value along the rays: the largest of the slices, and of a parabola through the largest and its two
//! neighbours.

use super::GROUP;
use super::filter::Sixteen;
use super::row::{Blend, Point, Row, RowGroups};
use super::view::SlicedView;
use crate::render::batches::Units;
use wavesplat_core::base::vectors::dispatch;

/// The maximum along the ray, within the box of the volume: half a voxel beyond the outermost voxels.
pub(in crate::render) struct Largest {
    /// Voxels along b, c and a.
    count: [f32; 3],
}

impl Largest {
    /// The largest values within the volume of a view.
    pub(in crate::render) fn new(view: &SlicedView) -> Self {
        Self { count: view.count.map(|n| n as f32) }
    }
}

/// Whether a place along an axis is within the box, but for rounding.
#[inline(always)]
fn is_within(at: f32, count: f32) -> bool {
    const ROUNDING: f32 = 1e-3;
    at >= -0.5 - ROUNDING && at <= count - 0.5 + ROUNDING
}

/// Sixteen cells.
#[derive(Debug, Clone, Copy)]
pub(in crate::render) struct Peaks {
    /// The largest value so far; minus infinity before the first.
    largest: Sixteen,
    /// The values of the last slice and of the one before; minus infinity if there is none.
    last: Sixteen,
    before: Sixteen,
    /// The number of the last slice.
    slice: u32,
}

const NONE: f32 = f32::NEG_INFINITY;

impl Blend for Largest {
    type Group = Peaks;
    type Cell = f32;

    const EMPTY: Peaks =
        Peaks { largest: [NONE; GROUP], last: [NONE; GROUP], before: [NONE; GROUP], slice: u32::MAX - 1 };
    const NOTHING: f32 = NONE;
    /// The limit is the least of a group's largest values.
    const OPEN: f32 = NONE;
    const OVER: f32 = f32::INFINITY;
    const CENTRED: bool = true;
    const NUMBERS: usize = 1;

    fn units(&self, middle: f64) -> Units {
        // Differences of the largest 32-bit numbers do not overflow.
        Units { zero: middle, per: 1.0 / 16.0 }
    }

    /// A value that hardly any sample supports is not taken for the largest.
    fn least(&self) -> f32 {
        0.01
    }

    fn shows(&self, range: (f32, f32)) -> bool {
        range.0 <= range.1
    }

    fn hides(limit: f32, range: (f32, f32)) -> bool {
        range.1 <= limit
    }

    fn is_closed(_: f32) -> bool {
        false
    }

    fn add(&self, row: &Row<'_>, groups: RowGroups<'_, Peaks>) {
        let [_, c, a] = row.place;
        if is_within(c, self.count[1]) && is_within(a, self.count[2]) {
            dispatch!(add(row, self.count[0], groups.live, groups.states, groups.limits));
        }
    }

    fn cells(group: &Peaks) -> Sixteen {
        group.largest
    }

    /// The interpolated value, between the least and the largest of the four cells around the pixel. If the kernel
    /// reaches no sample at some cells, those four are weighed by their distance.
    fn pixel(units: &Units, cells: [&Four; 4], [across, down]: [[f32; 4]; 2], out: &mut [f32]) {
        let inner = [cells[1][1], cells[1][2], cells[2][1], cells[2][2]];
        let there = |cells: &[f32]| cells.iter().all(|cell| *cell > NONE);
        let value = if cells.iter().all(|row| there(*row)) {
            let of_row = |row: &Four| row.iter().zip(across).map(|(cell, weight)| cell * weight).sum::<f32>();
            let sum: f32 = cells.into_iter().zip(down).map(|(row, weight)| of_row(row) * weight).sum();
            let ends = inner.iter().fold((f32::INFINITY, NONE), |(lo, hi), cell| (lo.min(*cell), hi.max(*cell)));
            sum.clamp(ends.0, ends.1)
        } else {
            nearest(inner, across, down)
        };
        out[0] = if value > NONE { units.value(value) as f32 } else { f32::NAN };
    }

    fn background(out: &mut [f32]) {
        out.fill(f32::NAN);
    }

    type Exact = f64;

    fn exact(&self) -> f64 {
        f64::NAN
    }

    fn step(&self, largest: &mut f64, point: &Point, _: f64) {
        let is_within = |axis: usize| is_within(point.place[axis] as f32, self.count[axis]);
        if point.density >= f64::from(self.least()) && (0..3).all(is_within) {
            *largest = largest.max(point.value);
        }
    }

    fn off(largest: &f64, pixel: &[f32]) -> Option<f64> {
        Some((f64::from(pixel[0]) - largest).abs()).filter(|off| !off.is_nan())
    }
}

/// Four cells of a row.
type Four = [f32; 4];

/// The value of the nearest of the four cells around a pixel that has one.
fn nearest(inner: [f32; 4], across: [f32; 4], down: [f32; 4]) -> f32 {
    let near = |n: usize| across[1 + n % 2] * down[1 + n / 2];
    let best = (0..4).filter(|n| inner[*n] > NONE).max_by(|a, b| near(*a).total_cmp(&near(*b)));
    // If the nearest cell with a value has less weight than this, the pixel is background.
    best.filter(|n| near(*n) >= 0.25).map_or(NONE, |n| inner[n])
}

#[inline(always)]
fn add(row: &Row<'_>, count: f32, live: &[bool], groups: &mut [Peaks], limits: &mut [f32]) {
    for (n, (group, limit)) in groups.iter_mut().zip(limits).enumerate() {
        if !live[n] {
            continue;
        }
        let mut values = if row.is_whole(n) {
            row.sums(n)
        } else {
            let (mut means, lengths) = row.means(n);
            for i in 0..GROUP {
                means[i] = if lengths[i] > 0.0 { means[i] } else { NONE };
            }
            means
        };
        let first = row.place[0] + (n * GROUP) as f32;
        if !(is_within(first, count) && is_within(first + (GROUP - 1) as f32, count)) {
            for (i, value) in values.iter_mut().enumerate() {
                *value = if is_within(first + i as f32, count) { *value } else { NONE };
            }
        }
        if group.slice.wrapping_add(1) != row.slice {
            (group.last, group.before) = ([NONE; GROUP], [NONE; GROUP]);
        }
        add_values(&values, group);
        group.slice = row.slice;
        // The largest values only grow: the limit may be an earlier one.
        if row.slice % 4 == 3 {
            *limit = group.largest.iter().copied().fold(f32::INFINITY, f32::min);
        }
    }
}

/// Adds the values of the next slice.
#[inline(always)]
fn add_values(values: &Sixteen, group: &mut Peaks) {
    for (i, value) in values.iter().copied().enumerate() {
        let (last, before) = (group.last[i], group.before[i]);
        let is_peak = before > NONE && value > NONE && last > before && last > value;
        let slope = value - before;
        let bend = if is_peak { 8.0 * ((last - before) + (last - value)) } else { 1.0 };
        let peak = if is_peak { last + slope * slope / bend } else { value };
        let largest = group.largest[i].max(value);
        group.largest[i] = if peak > largest { peak } else { largest };
        group.before[i] = last;
        group.last[i] = value;
    }
}
