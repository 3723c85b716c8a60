//! The cells of a band after the prefilter (eq 36), with upright columns (eq 46), and planes side by side.

use super::Sums;
use super::cells::{Aligned, Cells, LINE, PlaneSums, Rectangle, TOGETHER};
use super::prefilter::{HALF, TAPS, Taps};
use rayon::prelude::*;
use std::ops::Range;
use wavesplat_core::base::vectors::dispatch;
use wavesplat_core::base::zeroed::Zeroed;
use wavesplat_core::codec::real::Real;

/// A rectangle of filtered cells with planes of sums.
#[derive(Debug, Default)]
pub(in crate::render) struct FilteredCells {
    pub(super) window: Window,
    /// The sums in f32, [`TOGETHER`] planes at most in each group.
    pub(super) groups: Vec<Group<f32>>,
    /// The same if all sums are in f64.
    pub(super) double_groups: Vec<Group<f64>>,
    /// The sums in f64 of planes that have sums in f32, too: the number of a plane, and its cells, row by row.
    pub(super) doubles: Vec<(usize, Vec<f64>)>,
}

/// A rectangle of cells, stored row by row.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(super) struct Window {
    /// The first cell along u and v.
    pub(super) first: [isize; 2],
    /// Cells along u and v.
    pub(super) size: [usize; 2],
}

/// The filters of a band.
#[derive(Debug)]
pub(super) struct Filters {
    /// The filter along v.
    pub(super) across: Taps,
    /// The filter along u of each row of cells.
    pub(super) along: Vec<Along>,
    /// The cells after the filters; the same rows as before.
    pub(super) window: Window,
}

/// The filter along u of a row of cells.
#[derive(Debug)]
pub(super) struct Along {
    /// The column before the filter that becomes the first one after it.
    pub(super) start: isize,
    pub(super) taps: Taps,
}

/// Planes side by side, cell by cell.
#[derive(Debug, Default)]
pub(super) struct Group<R: Real> {
    /// The numbers of the planes; at most as many as there are places in a cell.
    pub(super) planes: Vec<usize>,
    /// Places in a cell: a power of two.
    pub(super) places: usize,
    /// Cells from a row to the next one. One more than a row has: cells below one another would share a set of the
    /// first-level cache.
    pub(super) stride: usize,
    /// The sums: cell by cell, row by row.
    pub(super) cells: Zeroed<R>,
    /// For each plane, the rows of cells with sums and their columns: of row v, from first to last.
    spans: Vec<Vec<Range<usize>>>,
}

/// The places in a cell for `planes` planes in total.
pub(super) fn places(planes: usize) -> usize {
    planes.next_power_of_two().min(TOGETHER)
}

/// The places of all groups of `planes` planes together.
pub(super) fn side_by_side(planes: usize) -> usize {
    let rest = planes % TOGETHER;
    planes - rest + if rest == 0 { 0 } else { places(rest) }
}

impl FilteredCells {
    /// Filters all planes along v and u. The sums of a group are freed before the next group is filtered.
    pub(super) fn new(cells: Cells, filters: &Filters) -> Self {
        let Cells { rectangle, single, planes, sums } = cells;
        let window = filters.window;
        if sums == Sums::Double {
            return Self { window, double_groups: double_groups(&rectangle, planes, filters), ..Self::default() };
        }
        let of_group = |(n, (sums, planes)): (usize, (Zeroed<f32>, &[PlaneSums]))| {
            let numbered = (n * TOGETHER..).zip(planes.iter().zip(sums.chunks_exact(rectangle.area().max(1))));
            let with_sums: Vec<_> = numbered.filter(|(_, (plane, _))| plane.has_single).collect();
            let rows = with_sums.into_par_iter().map(|(number, (_, sums))| Rows::new(&rectangle, number, sums));
            let rows: Vec<Rows<'_, f32>> = rows.collect();
            (!rows.is_empty()).then(|| group(&rows, filters))
        };
        let groups = single.into_iter().zip(planes.chunks(TOGETHER)).enumerate().filter_map(of_group).collect();
        let doubles = planes.into_par_iter().enumerate();
        let doubles = doubles.filter_map(|(number, PlaneSums { double, .. })| Some((number, double?)));
        let filter = |(number, sums): (usize, Aligned<f64>)| {
            (number, filter_plane(&Rows::new(&rectangle, number, &sums), filters))
        };
        Self { window, groups, double_groups: Vec::new(), doubles: doubles.map(filter).collect() }
    }
}

impl Window {
    /// The rectangle with `more` cells on each side along u and v.
    pub(super) fn grown(&self, more: [usize; 2]) -> Self {
        let (first, size) = (self.first, self.size);
        Self { first: [0, 1].map(|i| first[i] - more[i] as isize), size: [0, 1].map(|i| size[i] + 2 * more[i]) }
    }

    /// The smallest rectangle that holds both.
    pub(super) fn joined(&self, other: &Self) -> Self {
        let end = |window: &Self, i: usize| window.first[i] + window.size[i] as isize;
        let first = [0, 1].map(|i| self.first[i].min(other.first[i]));
        Self { first, size: [0, 1].map(|i| (end(self, i).max(end(other, i)) - first[i]) as usize) }
    }

    /// The cells of this rectangle in another one.
    pub(super) fn within(&self, other: &Self) -> Self {
        let first = [0, 1].map(|i| self.first[i].max(other.first[i]));
        let end = |window: &Self, i: usize| window.first[i] + window.size[i] as isize;
        Self { first, size: [0, 1].map(|i| (end(self, i).min(end(other, i)) - first[i]).max(0) as usize) }
    }

    /// The part of this rectangle that lies in another one: its columns and rows here, and the first of them there.
    pub(super) fn part_in(&self, other: &Self) -> [(Range<usize>, usize); 2] {
        [0, 1].map(|i| {
            let start = self.first[i].max(other.first[i]);
            let end = self.first[i] + self.size[i] as isize;
            let end = end.min(other.first[i] + other.size[i] as isize).max(start);
            let there = (start - other.first[i]).clamp(0, other.size[i] as isize) as usize;
            let here = (start - self.first[i]).min(self.size[i] as isize) as usize;
            (here..here + (end - start) as usize, there)
        })
    }
}

impl<R: Real> Group<R> {
    /// Whether the plane in this place has sums in a part of the cells.
    pub(super) fn has_sums(&self, place: usize, columns: &Range<usize>, rows: &Range<usize>) -> bool {
        let overlaps = |span: &Range<usize>| span.start < columns.end && columns.start < span.end;
        self.spans[place][rows.clone()].iter().any(overlaps)
    }
}

/// Filters planes whose sums are all in f64. The sums of a group are freed before the next group is filtered.
fn double_groups(rectangle: &Rectangle, planes: Vec<PlaneSums>, filters: &Filters) -> Vec<Group<f64>> {
    let (mut groups, mut planes) = (Vec::new(), planes.into_iter().enumerate().peekable());
    while planes.peek().is_some() {
        let numbered = planes.by_ref().take(TOGETHER).filter_map(|(number, plane)| Some((number, plane.double?)));
        let sums: Vec<(usize, Aligned<f64>)> = numbered.collect();
        let rows = sums.par_iter().map(|(number, sums)| Rows::new(rectangle, *number, sums));
        let rows: Vec<Rows<'_, f64>> = rows.filter(Rows::has_sums).collect();
        groups.extend((!rows.is_empty()).then(|| group(&rows, filters)));
    }
    groups
}

/// Filters planes, and puts them side by side.
fn group<R: Real>(planes: &[Rows<'_, R>], filters: &Filters) -> Group<R> {
    let [width, height] = filters.window.size;
    let (stride, places) = (width + 1, places(planes.len()));
    let mut cells = Zeroed::new(stride * height * places);
    let rows = cells.par_chunks_exact_mut(stride * places).enumerate();
    rows.for_each_init(RowScratch::default, |scratch, (v, cells)| {
        for (place, plane) in planes.iter().enumerate() {
            let columns = plane.columns(v, filters);
            let filtered = plane.filter_row(v, &columns, filters, scratch);
            cells[columns.start * places + place..]
                .iter_mut()
                .step_by(places)
                .zip(filtered)
                .for_each(|(to, n)| *to = *n);
        }
    });
    let spans = planes.iter().map(|plane| (0..height).map(|v| plane.columns(v, filters)).collect());
    Group { planes: planes.iter().map(|plane| plane.number).collect(), places, stride, spans: spans.collect(), cells }
}

/// Filters a plane.
fn filter_plane(plane: &Rows<'_, f64>, filters: &Filters) -> Vec<f64> {
    let [width, height] = filters.window.size;
    let (mut out, mut scratch) = (vec![0.0; width * height], RowScratch::default());
    for (v, row) in out.chunks_exact_mut(width.max(1)).enumerate() {
        let columns = plane.columns(v, filters);
        let filtered = plane.filter_row(v, &columns, filters, &mut scratch);
        row[columns].copy_from_slice(filtered);
    }
    out
}

/// The rows of a plane, in the layout of its rectangle.
struct Rows<'a, R> {
    number: usize,
    rectangle: &'a Rectangle,
    sums: &'a [R],
    /// For each row, the cells of the phases' runs from the first to the last one with sums in any phase.
    spans: Vec<Range<usize>>,
}

impl<'a, R: Real> Rows<'a, R> {
    fn new(rectangle: &'a Rectangle, number: usize, sums: &'a [R]) -> Self {
        let of_row = |row: &[R]| row.chunks_exact(rectangle.run).map(span).fold(0..0, |a, b| join(a, &b));
        let spans = sums.chunks_exact(rectangle.size[0].max(1)).map(of_row).collect();
        Self { number, rectangle, sums, spans }
    }

    fn has_sums(&self) -> bool {
        self.spans.iter().any(|span| !span.is_empty())
    }

    /// The cells of runs with sums in the rows that reach row v through the filter along v.
    fn near(&self, v: usize) -> Range<usize> {
        let rows = v.saturating_sub(HALF)..(v + HALF + 1).min(self.spans.len());
        self.spans[rows].iter().fold(0..0, join)
    }

    /// The columns with sums in row v after both filters.
    fn columns(&self, v: usize, filters: &Filters) -> Range<usize> {
        let (near, phases, start) = (self.near(v), self.rectangle.phases, filters.along[v].start);
        let (half, width) = (HALF as isize, filters.window.size[0] as isize);
        let within = |column: usize, more: isize| (column as isize + more - start).clamp(0, width) as usize;
        if near.is_empty() { 0..0 } else { within(near.start * phases, -half)..within(near.end * phases, half) }
    }

    /// Filters row v along v, then these columns of it along u. Rows and columns outside count as zeros.
    fn filter_row<'s>(
        &self,
        v: usize,
        columns: &Range<usize>,
        filters: &Filters,
        scratch: &'s mut RowScratch<R>,
    ) -> &'s [R] {
        if columns.is_empty() {
            return &[];
        }
        let (near, Along { start, taps }) = (self.near(v), &filters.along[v]);
        // Before and after the sums, as many zeros as the filter reaches twice, and those of a last line.
        let width = near.len() * self.rectangle.phases;
        let RowScratch { zeros, phase, row, out } = scratch;
        row.clear();
        row.resize(width + 4 * HALF + LINE, R::default());
        zeros.resize(near.len(), R::default());
        phase.resize(near.len(), R::default());
        for n in 0..self.rectangle.phases {
            self.filter_across(v, n, &near, &filters.across, zeros, phase);
            let to = row[2 * HALF + n..].iter_mut().step_by(self.rectangle.phases);
            to.zip(&*phase).for_each(|(to, from)| *to = *from);
        }
        let first = near.start * self.rectangle.phases;
        let from = &row[(columns.start as isize + start + HALF as isize) as usize - first..];
        out.resize(columns.len().next_multiple_of(LINE), R::default());
        dispatch!(filter_along(from, &taps.map(R::from_f64), &mut out[..]));
        &out[..columns.len()]
    }

    /// Filters the cells `near` of one phase of a row along v. Rows outside are `zeros`.
    fn filter_across(&self, v: usize, phase: usize, near: &Range<usize>, taps: &Taps, zeros: &[R], out: &mut [R]) {
        let Rectangle { size: [width, _], run, .. } = *self.rectangle;
        let row = |j: usize| {
            let v = (v + j).checked_sub(HALF).filter(|v| *v < self.spans.len());
            v.map_or(zeros, |v| &self.sums[v * width + phase * run..][near.clone()])
        };
        dispatch!(sum_of_products(std::array::from_fn(row), &taps.map(R::from_f64), out));
    }
}

/// Scratch for a row: zeros, a phase and all phases after the filter along v, and the row after both filters.
#[derive(Default)]
struct RowScratch<R> {
    zeros: Vec<R>,
    phase: Vec<R>,
    row: Vec<R>,
    out: Vec<R>,
}

/// The smallest range that holds both.
fn join(a: Range<usize>, b: &Range<usize>) -> Range<usize> {
    match (a.is_empty(), b.is_empty()) {
        (true, _) => b.clone(),
        (_, true) => a,
        _ => a.start.min(b.start)..a.end.max(b.end),
    }
}

/// The range from the first to the last nonzero number, to a multiple of a few.
fn span<R: Real>(numbers: &[R]) -> Range<usize> {
    const LANES: usize = 16;
    let any = |line: &[R]| line.iter().fold(false, |any, n| any | (*n != R::default()));
    let lines = || numbers.chunks(LANES);
    let Some(first) = lines().position(any) else { return 0..0 };
    let last = lines().rposition(any).unwrap_or(first);
    first * LANES..((last + 1) * LANES).min(numbers.len())
}

/// Filters a row, from [`HALF`] cells before the first filtered one on.
#[inline(always)]
fn filter_along<R: Real>(row: &[R], taps: &[R; TAPS], to: &mut [R]) {
    let width = to.len();
    sum_of_products(std::array::from_fn(|n| &row[n..][..width]), taps, to);
}

/// out = sum over j of f_j x_j, a line at a time                                                            (eq 36)
#[inline(always)]
fn sum_of_products<R: Real>(rows: [&[R]; TAPS], taps: &[R; TAPS], to: &mut [R]) {
    let rows: [&[[R; LINE]]; TAPS] = rows.map(|row| row.as_chunks().0);
    for (i, to) in to.as_chunks_mut::<LINE>().0.iter_mut().enumerate() {
        let mut sums = [R::default(); LINE];
        for j in 0..TAPS {
            let numbers = &rows[j][i];
            for l in 0..LINE {
                sums[l] = sums[l] + taps[j] * numbers[l];
            }
        }
        *to = sums;
    }
}
