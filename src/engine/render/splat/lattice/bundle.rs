//! The planes that a tile gathers from, side by side.
//!
//! Most tiles use the groups of their band. If a plane has sums in f64 in a tile, the tile gets cells of its own: with
//! the image of ones known, in f32, less the mean of the plane over the tile, so that rounding is relative to the range
//! of values, not to their size; otherwise in f64.

use super::cells::TOGETHER;
use super::filtered::{FilteredCells, Group, Window, places};
use std::borrow::Cow;
use wavesplat_core::codec::real::Real;

/// Planes side by side, cell by cell.
#[derive(Debug)]
pub(super) struct Bundle<'a, R: Real> {
    /// The planes and their places in a cell.
    pub(super) planes: Vec<(usize, TilePlane)>,
    /// Places in a cell.
    pub(super) places: usize,
    /// Cells from a row to the next one.
    pub(super) stride: usize,
    pub(super) window: Window,
    pub(super) cells: Cow<'a, [R]>,
}

/// A plane of a tile: `mean` times the image of ones plus `scale` times the numbers in its bundle.
#[derive(Debug, Clone, Copy)]
pub(super) struct TilePlane {
    pub(super) number: usize,
    pub(super) mean: f64,
    pub(super) scale: f64,
}

/// The bundles of a tile.
#[derive(Debug, Default)]
pub(super) struct Bundles<'a> {
    pub(super) single: Vec<Bundle<'a, f32>>,
    pub(super) double: Vec<Bundle<'a, f64>>,
}

impl<'a> Bundles<'a> {
    /// The bundles for the cells in `tile`. The ones are the filtered cells of the value 1 at all voxels.
    pub(super) fn new(cells: &'a FilteredCells, tile: &Window, ones: Option<&FilteredCells>) -> Self {
        let ones = ones.filter(|_| !cells.doubles.is_empty()).map(|ones| ones_in(ones, tile));
        let (relative, precise) = match &ones {
            Some(ones) => (own_planes(cells, tile, |n, sums| OwnPlane::less_mean(n, sums, ones)), Vec::new()),
            None => (Vec::new(), own_planes(cells, tile, OwnPlane::as_it_is)),
        };
        let numbers = relative.iter().map(|plane| plane.stored.number);
        let numbers: Vec<usize> = numbers.chain(precise.iter().map(|plane| plane.stored.number)).collect();
        let has_own = |number: usize| numbers.contains(&number);
        let single = cells.groups.iter().filter_map(|group| of_group(cells, group, tile, has_own));
        let double = cells.double_groups.iter().filter_map(|group| of_group(cells, group, tile, |_| false));
        Self {
            single: single.chain(side_by_side(&relative, tile)).collect(),
            double: double.chain(side_by_side(&precise, tile)).collect(),
        }
    }

    /// The planes with sums.
    pub(super) fn planes(&self) -> impl Iterator<Item = usize> {
        let single = self.single.iter().flat_map(|bundle| &bundle.planes);
        let double = self.double.iter().flat_map(|bundle| &bundle.planes);
        single.chain(double).map(|(_, plane)| plane.number)
    }
}

/// The planes of a group with sums in the tile; `None` if there are none.
fn of_group<'a, R: Real>(
    cells: &'a FilteredCells,
    group: &'a Group<R>,
    tile: &Window,
    has_own: impl Fn(usize) -> bool,
) -> Option<Bundle<'a, R>> {
    let [(columns, _), (rows, _)] = cells.window.part_in(tile);
    let numbered = group.planes.iter().copied().enumerate();
    let touched = numbered.filter(|(place, n)| !has_own(*n) && group.has_sums(*place, &columns, &rows));
    let planes: Vec<_> = touched.map(|(place, number)| (place, TilePlane { number, mean: 0.0, scale: 1.0 })).collect();
    let is_empty = columns.is_empty() || planes.is_empty();
    let Group { places, stride, .. } = *group;
    let (window, cells) = (cells.window, Cow::Borrowed(&group.cells[..]));
    (!is_empty).then_some(Bundle { planes, places, stride, window, cells })
}

/// A plane with sums in f64 in the tile.
struct OwnPlane<R> {
    stored: TilePlane,
    /// What is stored of all its sums at the cells of the tile, row by row.
    numbers: Vec<R>,
}

/// The planes with sums in f64 that are not zero in the tile. `store(number, sums)` takes all sums of a plane.
fn own_planes<R>(
    cells: &FilteredCells,
    tile: &Window,
    store: impl Fn(usize, &[f64]) -> OwnPlane<R>,
) -> Vec<OwnPlane<R>> {
    let (mut sums, mut planes) = (Vec::new(), Vec::new());
    for (number, double) in &cells.doubles {
        if sum_plane(cells, *number, double, tile, &mut sums) {
            planes.push(store(*number, &sums));
        }
    }
    planes
}

/// Puts all sums of a plane at the cells of the tile into `sums`. False if those in f64, `double`, are zero there.
fn sum_plane(cells: &FilteredCells, number: usize, double: &[f64], tile: &Window, sums: &mut Vec<f64>) -> bool {
    sums.clear();
    sums.resize(tile.size[0] * tile.size[1], 0.0);
    let width = cells.window.size[0];
    add_part(&cells.window, tile, sums, |u, v| double[v * width + u]);
    if sums.iter().all(|sum| *sum == 0.0) {
        return false;
    }
    for group in &cells.groups {
        if let Some(place) = group.planes.iter().position(|n| *n == number) {
            let at = |u, v| (v * group.stride + u) * group.places + place;
            add_part(&cells.window, tile, sums, |u, v| group.cells[at(u, v)].into());
        }
    }
    true
}

impl OwnPlane<f32> {
    /// The plane less its mean over the tile, where the value 1 at all voxels has the sums `ones`.
    fn less_mean(number: usize, sums: &[f64], ones: &[f64]) -> Self {
        let most = sums.iter().fold(0.0_f64, |most, sum| most.max(sum.abs()));
        let total = ones.iter().sum::<f64>();
        let mean = if total == 0.0 { 0.0 } else { sums.iter().sum::<f64>() / total };
        let scale = if (UNSCALED[0]..=UNSCALED[1]).contains(&most) { 1.0 } else { most };
        let numbers = sums.iter().zip(ones).map(|(sum, one)| ((sum - mean * one) / scale) as f32);
        Self { stored: TilePlane { number, mean, scale }, numbers: numbers.collect() }
    }
}

impl OwnPlane<f64> {
    fn as_it_is(number: usize, sums: &[f64]) -> Self {
        Self { stored: TilePlane { number, mean: 0.0, scale: 1.0 }, numbers: sums.to_vec() }
    }
}

/// Sums in this range are not scaled: they are far from the limits of f32.
const UNSCALED: [f64; 2] = [1e-20, 1e20];

/// Adds the cells in `window` to the cells of a tile. `sum` gives the sum at a column and a row
/// of the window.
fn add_part(window: &Window, tile: &Window, sums: &mut [f64], sum: impl Fn(usize, usize) -> f64) {
    let [(columns, left), (rows, top)] = window.part_in(tile);
    for (v, row) in rows.clone().zip(sums.chunks_exact_mut(tile.size[0]).skip(top)) {
        for (u, to) in columns.clone().zip(&mut row[left..]) {
            *to += sum(u, v);
        }
    }
}

/// The ones at the cells of a tile.
fn ones_in(ones: &FilteredCells, tile: &Window) -> Vec<f64> {
    let mut sums = vec![0.0; tile.size[0] * tile.size[1]];
    let width = ones.window.size[0];
    let of_plane = |double: &[f64]| add_part(&ones.window, tile, &mut sums, |u, v| double[v * width + u]);
    ones.doubles.iter().map(|(_, double)| &double[..]).for_each(of_plane);
    sums
}

/// A tile's own cells.
fn side_by_side<'a, R: Real>(planes: &[OwnPlane<R>], tile: &Window) -> Vec<Bundle<'a, R>> {
    let bundle = |planes: &[OwnPlane<R>]| {
        let places = places(planes.len());
        let mut cells = vec![R::default(); tile.size[0] * tile.size[1] * places];
        for (place, plane) in planes.iter().enumerate() {
            cells[place..].iter_mut().step_by(places).zip(&plane.numbers).for_each(|(cell, number)| *cell = *number);
        }
        let planes = planes.iter().map(|plane| plane.stored).enumerate().collect();
        Bundle { planes, places, stride: tile.size[0], window: *tile, cells: Cow::Owned(cells) }
    };
    planes.chunks(TOGETHER).map(bundle).collect()
}

/// Sums that are kept apart, so that additions need not wait for each other.
const APART: usize = 4;

/// The sum of cells times their weights, `N` planes side by side; the cells are `stride` apart. The order of additions is
/// the same for any `N`, so that pixels do not depend on how many planes are together.
#[inline(always)]
pub(super) fn weighted<R: Real, const N: usize>(cells: &[[R; N]], stride: usize, weights: &[f32]) -> [R; N] {
    if N == 1 && stride == 1 {
        return [weighted_alone(cells.as_flattened(), weights); N];
    }
    let mut sums = [[R::default(); N]; APART];
    let (several, rest) = weights.as_chunks::<APART>();
    for (n, weights) in several.iter().enumerate() {
        for l in 0..APART {
            add_weighted(&mut sums[l], weights[l], &cells[(APART * n + l) * stride]);
        }
    }
    for (l, weight) in rest.iter().enumerate() {
        add_weighted(&mut sums[l], *weight, &cells[(APART * several.len() + l) * stride]);
    }
    let [mut all, b, c, d] = sums;
    for i in 0..N {
        all[i] = (all[i] + b[i]) + (c[i] + d[i]);
    }
    all
}

#[inline(always)]
fn add_weighted<R: Real, const N: usize>(sums: &mut [R; N], weight: f32, cell: &[R; N]) {
    let weight = R::from_f64(f64::from(weight));
    for i in 0..N {
        sums[i] = sums[i] + weight * cell[i];
    }
}

/// [`weighted`] for one plane whose cells are side by side: several cells at a time.
#[inline(always)]
fn weighted_alone<R: Real>(cells: &[R], weights: &[f32]) -> R {
    let mut sums = [R::default(); APART];
    let (several, rest) = weights.as_chunks::<APART>();
    for (cells, weights) in cells.as_chunks::<APART>().0.iter().zip(several) {
        for l in 0..APART {
            sums[l] = sums[l] + R::from_f64(f64::from(weights[l])) * cells[l];
        }
    }
    for (l, (weight, cell)) in rest.iter().zip(&cells[APART * several.len()..]).enumerate() {
        sums[l] = sums[l] + R::from_f64(f64::from(*weight)) * *cell;
    }
    (sums[0] + sums[1]) + (sums[2] + sums[3])
}
