//! The cells of a band after the prefilter (eq 36), with planes side by side.

use super::Sums;
use super::cells::{Aligned, Cells, LINE, PlaneSums, Rectangle, TOGETHER};
use super::prefilter::{HALF, Taps};
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
    /// Filters all planes along u and v. The sums of a group are freed before the next group is filtered.
    pub(super) fn new(cells: Cells, taps: &[Taps; 2]) -> Self {
        let Cells { rectangle, single, planes, sums } = cells;
        let [along, across] = taps;
        let window = Window { first: rectangle.first, size: rectangle.size };
        if sums == Sums::Double {
            let double_groups = double_groups(&rectangle, planes, taps);
            return Self { window, double_groups, ..Self::default() };
        }
        let of_group = |(n, (mut sums, planes)): (usize, (Zeroed<f32>, &[PlaneSums]))| {
            let numbered = (n * TOGETHER..).zip(planes.iter().zip(sums.chunks_exact_mut(rectangle.area().max(1))));
            let with_sums: Vec<_> = numbered.filter(|(_, (plane, _))| plane.has_single).collect();
            let filter = |(number, (_, sums))| Rows::new(&rectangle, number, sums, along);
            let rows: Vec<Rows<'_, f32>> = with_sums.into_par_iter().map(filter).collect();
            (!rows.is_empty()).then(|| group(&rectangle, &rows, across))
        };
        let groups = single.into_iter().zip(planes.chunks(TOGETHER)).enumerate().filter_map(of_group).collect();
        let doubles = planes.into_par_iter().enumerate();
        let doubles = doubles.filter_map(|(number, PlaneSums { double, .. })| Some((number, double?)));
        let filter = |(number, mut sums): (usize, Aligned<f64>)| {
            (number, filter_all_rows(&rectangle, &Rows::new(&rectangle, number, &mut sums, along), across))
        };
        Self { window, groups, double_groups: Vec::new(), doubles: doubles.map(filter).collect() }
    }
}

impl Window {
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

/// A plane whose cells are side by side in rows, filtered along u.
struct Rows<'a, R> {
    number: usize,
    sums: &'a [R],
    /// The columns with sums in each row; empty for rows without any.
    spans: Vec<Range<usize>>,
}

/// Filters planes whose sums are all in f64. The sums of a group are freed before the next group is filtered.
fn double_groups(rectangle: &Rectangle, planes: Vec<PlaneSums>, [along, across]: &[Taps; 2]) -> Vec<Group<f64>> {
    let (mut groups, mut planes) = (Vec::new(), planes.into_iter().enumerate().peekable());
    while planes.peek().is_some() {
        let numbered = planes.by_ref().take(TOGETHER).filter_map(|(number, plane)| Some((number, plane.double?)));
        let mut sums: Vec<(usize, Aligned<f64>)> = numbered.collect();
        let rows = sums.par_iter_mut().map(|(number, sums)| Rows::new(rectangle, *number, sums, along));
        let rows: Vec<Rows<'_, f64>> = rows.filter(Rows::has_sums).collect();
        groups.extend((!rows.is_empty()).then(|| group(rectangle, &rows, across)));
    }
    groups
}

/// Filters planes along v, and puts them side by side.
fn group<R: Real>(rectangle: &Rectangle, planes: &[Rows<'_, R>], taps: &Taps) -> Group<R> {
    let taps = taps.map(R::from_f64);
    let [width, height] = rectangle.size;
    let (stride, places) = (width + 1, places(planes.len()));
    let mut cells = Zeroed::new(stride * height * places);
    cells.par_chunks_exact_mut((stride * places).max(1)).enumerate().for_each(|(v, cells)| {
        let mut row = vec![R::default(); width];
        for (place, plane) in planes.iter().enumerate() {
            if plane.is_near(v) {
                plane.filter_row(v, width, &taps, &mut row);
                cells[place..].iter_mut().step_by(places).zip(&row).for_each(|(to, from)| *to = *from);
            }
        }
    });
    let spans = planes.iter().map(Rows::spread_spans).collect();
    Group { planes: planes.iter().map(|plane| plane.number).collect(), places, stride, cells, spans }
}

/// Filters a plane along v.
fn filter_all_rows(rectangle: &Rectangle, plane: &Rows<'_, f64>, taps: &Taps) -> Vec<f64> {
    let [width, height] = rectangle.size;
    let mut out = vec![0.0; width * height];
    let rows = out.chunks_exact_mut(width.max(1)).enumerate().filter(|(v, _)| plane.is_near(*v));
    rows.for_each(|(v, row)| plane.filter_row(v, width, taps, row));
    out
}

impl<'a, R: Real> Rows<'a, R> {
    /// Puts the cells of all phases of a plane side by side, and filters them along u.
    fn new(rectangle: &Rectangle, number: usize, sums: &'a mut [R], taps: &Taps) -> Self {
        let (width, taps) = (rectangle.size[0], taps.map(R::from_f64));
        let mut wide = vec![R::default(); width + 2 * HALF];
        let of_row = |row: &mut [R]| {
            interleave(row, rectangle, &mut wide[HALF..][..width]);
            let span = span(&wide[HALF..][..width]);
            if span.is_empty() {
                return span;
            }
            dispatch!(filter_along(&wide[..], &taps, &mut *row));
            span.start.saturating_sub(HALF)..(span.end + HALF).min(width)
        };
        let spans = sums.chunks_exact_mut(width.max(1)).map(of_row).collect();
        Self { number, sums, spans }
    }

    fn has_sums(&self) -> bool {
        self.spans.iter().any(|span| !span.is_empty())
    }

    /// The rows that reach row v through the filter.
    fn near(&self, v: usize) -> Range<usize> {
        v.saturating_sub(HALF)..(v + HALF + 1).min(self.spans.len())
    }

    fn is_near(&self, v: usize) -> bool {
        self.spans[self.near(v)].iter().any(|span| !span.is_empty())
    }

    /// For each row, the columns with sums after the filter along v.
    fn spread_spans(&self) -> Vec<Range<usize>> {
        let join = |a: Range<usize>, b: &Range<usize>| match (a.is_empty(), b.is_empty()) {
            (true, _) => b.clone(),
            (_, true) => a,
            _ => a.start.min(b.start)..a.end.max(b.end),
        };
        (0..self.spans.len()).map(|v| self.spans[self.near(v)].iter().fold(0..0, join)).collect()
    }

    /// Filters the rows around row v; rows outside count as zeros.
    fn filter_row(&self, v: usize, width: usize, taps: &[R; HALF + 1], out: &mut [R]) {
        let row = |v: Option<usize>| v.and_then(|v| self.sums.get(v * width..(v + 1) * width));
        let missing = v < HALF || row(Some(v + HALF)).is_none();
        let zeros = if missing { vec![R::default(); width] } else { Vec::new() };
        let at = |v: Option<usize>| row(v).unwrap_or(&zeros);
        dispatch!(filter_across(std::array::from_fn(|n| at((v + n).checked_sub(HALF))), taps, out));
    }
}

/// Puts the cells of all phases of a row side by side.
fn interleave<R: Real>(from: &[R], rectangle: &Rectangle, to: &mut [R]) {
    match rectangle.phases {
        2 => dispatch!(interleave_two(from, rectangle.run, to)),
        phases => {
            for (phase, run) in from.chunks_exact(rectangle.run).enumerate() {
                to[phase..].iter_mut().step_by(phases).zip(run).for_each(|(to, from)| *to = *from);
            }
        }
    }
}

#[inline(always)]
fn interleave_two<R: Real>(from: &[R], run: usize, to: &mut [R]) {
    let (even, odd) = from[..2 * run].split_at(run);
    for ((to, even), odd) in to.as_chunks_mut::<2>().0.iter_mut().zip(even).zip(odd) {
        *to = [*even, *odd];
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

/// Filters a row, which has [`HALF`] more cells on both sides.
#[inline(always)]
fn filter_along<R: Real>(row: &[R], taps: &[R; HALF + 1], to: &mut [R]) {
    let width = to.len();
    sum_of_products(std::array::from_fn(|n| &row[n..][..width]), taps, to);
}

/// Filters the middle one of 2 [`HALF`] + 1 rows.
#[inline(always)]
fn filter_across<R: Real>(rows: [&[R]; 2 * HALF + 1], taps: &[R; HALF + 1], to: &mut [R]) {
    sum_of_products(rows, taps, to);
}

/// out = f_0 x_0 + sum over j of f_j (x_-j + x_j), a line at a time                                       (eq 36)
#[inline(always)]
fn sum_of_products<R: Real>(rows: [&[R]; 2 * HALF + 1], taps: &[R; HALF + 1], to: &mut [R]) {
    let rows: [&[[R; LINE]]; 2 * HALF + 1] = rows.map(|row| row.as_chunks().0);
    for (i, to) in to.as_chunks_mut::<LINE>().0.iter_mut().enumerate() {
        let mut sums = rows[HALF][i];
        for sum in &mut sums {
            *sum = taps[0] * *sum;
        }
        for j in 1..=HALF {
            let (before, after) = (&rows[HALF - j][i], &rows[HALF + j][i]);
            for l in 0..LINE {
                sums[l] = sums[l] + taps[j] * (before[l] + after[l]);
            }
        }
        *to = sums;
    }
}
