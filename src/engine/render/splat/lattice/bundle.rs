//! The planes that a tile gathers from, side by side.
//!
//! Most tiles use the groups of their band. If a plane has sums in f64 in a tile, the tile gets cells of its own: with
//! the image of ones known, in f32, less the mean of the plane over the tile, so that rounding is relative to the range
//! of values, not to their size; otherwise in f64.

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
        let offset = cells.doubles.iter();
        let offset = offset.filter_map(|(number, sums)| OffsetPlane::new(cells, *number, sums, tile));
        let offset: Vec<OffsetPlane> = offset.collect();
        let is_offset = |number: usize| offset.iter().any(|plane| plane.number == number);
        let single = cells.groups.iter().filter_map(|group| of_group(cells, group, tile, is_offset)).collect();
        let double = cells.double_groups.iter().filter_map(|group| of_group(cells, group, tile, |_| false)).collect();
        let mut bundles = Self { single, double };
        if offset.is_empty() {
            return bundles;
        }
        let count = places(offset.len());
        match ones.map(|ones| (ones_in(ones, tile), offset.chunks(count))) {
            Some((ones, chunks)) => bundles.single.extend(chunks.map(|some| without_means(some, tile, &ones))),
            None => bundles.double.extend(offset.chunks(count).map(|some| as_they_are(some, tile))),
        }
        bundles
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
    is_offset: impl Fn(usize) -> bool,
) -> Option<Bundle<'a, R>> {
    let [(columns, _), (rows, _)] = cells.window.part_in(tile);
    let numbered = group.planes.iter().copied().enumerate();
    let touched = numbered.filter(|(place, n)| !is_offset(*n) && group.has_sums(*place, &columns, &rows));
    let planes: Vec<_> = touched.map(|(place, number)| (place, TilePlane { number, mean: 0.0, scale: 1.0 })).collect();
    let is_empty = columns.is_empty() || planes.is_empty();
    let Group { places, stride, .. } = *group;
    let (window, cells) = (cells.window, Cow::Borrowed(&group.cells[..]));
    (!is_empty).then_some(Bundle { planes, places, stride, window, cells })
}

/// A plane with sums in f64 in the tile.
struct OffsetPlane {
    number: usize,
    /// All its sums at the cells of the tile, row by row.
    sums: Vec<f64>,
}

impl OffsetPlane {
    /// The plane with these sums in f64; `None` if they are zero in the tile.
    fn new(cells: &FilteredCells, number: usize, double: &[f64], tile: &Window) -> Option<Self> {
        let mut sums = vec![0.0; tile.size[0] * tile.size[1]];
        let width = cells.window.size[0];
        add_part(&cells.window, tile, &mut sums, |u, v| double[v * width + u]);
        if sums.iter().all(|sum| *sum == 0.0) {
            return None;
        }
        for group in &cells.groups {
            if let Some(place) = group.planes.iter().position(|n| *n == number) {
                let at = |u, v| (v * group.stride + u) * group.places + place;
                add_part(&cells.window, tile, &mut sums, |u, v| group.cells[at(u, v)].into());
            }
        }
        Some(Self { number, sums })
    }

    /// How the plane is stored without its mean. The ones have the sum `ones` in the tile.
    fn less_mean(&self, ones: f64) -> TilePlane {
        let most = self.sums.iter().fold(0.0_f64, |most, sum| most.max(sum.abs()));
        let mean = if ones == 0.0 { 0.0 } else { self.sums.iter().sum::<f64>() / ones };
        let scale = if (UNSCALED[0]..=UNSCALED[1]).contains(&most) { 1.0 } else { most };
        TilePlane { number: self.number, mean, scale }
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

/// Planes less their means.
fn without_means(planes: &[OffsetPlane], tile: &Window, ones: &[f64]) -> Bundle<'static, f32> {
    let total = ones.iter().sum();
    let stored: Vec<TilePlane> = planes.iter().map(|plane| plane.less_mean(total)).collect();
    let number = |n: usize, at: usize| (planes[n].sums[at] - stored[n].mean * ones[at]) / stored[n].scale;
    side_by_side(&stored, tile, number)
}

/// Planes in f64.
fn as_they_are(planes: &[OffsetPlane], tile: &Window) -> Bundle<'static, f64> {
    let stored = |plane: &OffsetPlane| TilePlane { number: plane.number, mean: 0.0, scale: 1.0 };
    let stored: Vec<TilePlane> = planes.iter().map(stored).collect();
    side_by_side(&stored, tile, |n, at| planes[n].sums[at])
}

/// A tile's own cells. `number(plane, cell)` is stored.
fn side_by_side<R: Real>(
    stored: &[TilePlane],
    tile: &Window,
    number: impl Fn(usize, usize) -> f64,
) -> Bundle<'static, R> {
    let places = places(stored.len());
    let mut cells = vec![R::default(); tile.size[0] * tile.size[1] * places];
    for (at, cell) in cells.chunks_exact_mut(places).enumerate() {
        (0..stored.len()).for_each(|n| cell[n] = R::from_f64(number(n, at)));
    }
    let planes = stored.iter().copied().enumerate().collect();
    Bundle { planes, places, stride: tile.size[0], window: *tile, cells: Cow::Owned(cells) }
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
