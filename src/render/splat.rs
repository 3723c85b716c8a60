//! The splat: terms of voxels times footprints into the planes of one tile of the picture (eq 4 and 9).
//!
//! A tile has one owner and meets blocks and voxels in file order, so a pixel's sum does not depend on how the picture
//! is tiled or on the number of threads. Sums are in f64.

use super::eye::Eye;
use super::terms::Terms;
use crate::camera::Camera;
use crate::footprint::Footprint;
use crate::volume::{Grid, Region};
use crate::wavelet::Lane;
use std::ops::Range;

/// Pixels a side of a tile: its planes stay within a core's cache, and neighbours share few footprints.
pub(super) const TILE: usize = 64;

/// How the planes of a tile lie in memory. No sum depends on it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Order {
    /// Plane by plane: fast where voxels have terms in few planes, a row of pixels at a time.
    Planes,
    /// Pixel by pixel: fast where voxels have terms in most planes, all planes of a pixel at a time.
    Pixels,
}

/// A rectangle of pixels.
#[derive(Debug, Clone)]
pub(super) struct Place {
    /// Columns of the picture.
    pub(super) x: Range<usize>,
    /// Rows of the picture.
    pub(super) y: Range<usize>,
}

impl Place {
    /// Those of `side` pixels a side, or what is left of that, that cover the rows `y` of a picture `width` pixels wide.
    pub(super) fn cover(width: usize, y: Range<usize>, side: usize) -> Vec<Self> {
        let pieces = |r: Range<usize>| r.clone().step_by(side).map(move |s| s..(s + side).min(r.end));
        pieces(y).flat_map(|y| pieces(0..width).map(move |x| Self { x, y: y.clone() })).collect()
    }

    /// Number of pixels.
    pub(super) fn pixels(&self) -> usize {
        self.x.len() * self.y.len()
    }

    /// The column and the row of a pixel, counted row by row.
    pub(super) fn pixel(&self, n: usize) -> [usize; 2] {
        [self.x.start + n % self.x.len(), self.y.start + n / self.x.len()]
    }
}

/// A rectangle of pixels with its planes.
#[derive(Debug)]
pub(super) struct Tile {
    pub(super) place: Place,
    /// Number of planes.
    count: usize,
    order: Order,
    sums: Vec<f64>,
}

impl Tile {
    /// With all planes at zero.
    pub(super) fn new(place: Place, count: usize, order: Order) -> Self {
        Self { sums: vec![0.0; count * place.pixels()], place, count, order }
    }

    /// The planes at `count` pixels from `first` on, into the first lanes of `planes`.
    pub(super) fn load(&self, first: usize, count: usize, planes: &mut [Lane]) {
        let pixels = self.place.pixels();
        for (p, lane) in planes.iter_mut().enumerate() {
            for (l, sum) in lane.iter_mut().enumerate().take(count) {
                *sum = match self.order {
                    Order::Planes => self.sums[p * pixels + first + l],
                    Order::Pixels => self.sums[(first + l) * self.count + p],
                };
            }
        }
    }

    /// Adds a block's voxels, of which these are the terms.
    pub(super) fn splat(&mut self, voxels: &Splats, terms: &Terms, footprint: &Footprint) {
        if !(overlap(&voxels.x, &self.place.x) && overlap(&voxels.y, &self.place.y)) {
            return;
        }
        let (mut column, mut row, mut all) = (Vec::new(), Vec::new(), vec![0.0; self.count]);
        for voxel in &voxels.voxels {
            let (full_x, full_y) = (footprint.span(voxel.x, voxels.size[0]), footprint.span(voxel.y, voxels.size[1]));
            let (x, y) = (intersect(&full_x, &self.place.x), intersect(&full_y, &self.place.y));
            if x.is_empty() || y.is_empty() {
                continue;
            }
            // Weights begin at the footprint's own edge, so that a tile's edge cannot change their last bits.
            footprint.weights(voxel.x, &full_x, &mut row);
            footprint.weights(voxel.y, &full_y, &mut column);
            let row = (x.start, &row[x.start - full_x.start..x.end - full_x.start]);
            let column = (y.start, &column[y.start - full_y.start..y.end - full_y.start]);
            let (planes, amounts) = terms.of_voxel(voxel.index);
            match self.order {
                Order::Planes => {
                    for (plane, amount) in planes.iter().zip(amounts) {
                        self.add(usize::from(*plane), amount * voxel.weight, row, column);
                    }
                }
                Order::Pixels => {
                    all.fill(0.0);
                    planes.iter().zip(amounts).for_each(|(p, a)| all[usize::from(*p)] = a * voxel.weight);
                    self.add_all(&all, row, column);
                }
            }
        }
    }

    /// Adds `amount` times the outer product of a row and a column of weights to a plane.
    fn add(&mut self, plane: usize, amount: f64, (x, row): (usize, &[f64]), (y, column): (usize, &[f64])) {
        let Place { x: xs, y: ys } = &self.place;
        let (width, pixels) = (xs.len(), self.place.pixels());
        let start = plane * pixels + (y - ys.start) * width + (x - xs.start);
        add_to_plane(&mut self.sums[start..], width, amount, row, column);
    }

    /// Adds an amount for every plane, as [`Self::add`] does for one.
    fn add_all(&mut self, amounts: &[f64], (x, row): (usize, &[f64]), (y, column): (usize, &[f64])) {
        let Place { x: xs, y: ys } = &self.place;
        let width = xs.len();
        let start = ((y - ys.start) * width + (x - xs.start)) * self.count;
        add_to_pixels(&mut self.sums[start..], width, amounts, row, column);
    }
}

/// Adds `amount` times the outer product of a row and a column to a plane whose rows are `width` pixels apart.
#[cfg_attr(not(portable), multiversion::multiversion(targets("x86_64+avx512f", "x86_64+avx2")))]
fn add_to_plane(sums: &mut [f64], width: usize, amount: f64, row: &[f64], column: &[f64]) {
    for (weight, line) in column.iter().zip(sums.chunks_mut(width)) {
        let factor = amount * weight;
        for (sum, w) in line.iter_mut().zip(row) {
            *sum += factor * w;
        }
    }
}

/// The same with an amount for each of a pixel's planes, which lie side by side.
#[cfg_attr(not(portable), multiversion::multiversion(targets("x86_64+avx512f", "x86_64+avx2")))]
fn add_to_pixels(sums: &mut [f64], width: usize, amounts: &[f64], row: &[f64], column: &[f64]) {
    let count = amounts.len();
    let mut factors = vec![0.0; count];
    for (weight, line) in column.iter().zip(sums.chunks_mut(width * count)) {
        factors.iter_mut().zip(amounts).for_each(|(f, amount)| *f = amount * weight);
        for (pixel, w) in line.chunks_exact_mut(count).zip(row) {
            pixel.iter_mut().zip(&factors).for_each(|(sum, f)| *sum += f * w);
        }
    }
}

/// A block's voxels as the camera sees them.
#[derive(Debug)]
pub(super) struct Splats {
    voxels: Vec<Splat>,
    size: [usize; 2],
    /// Columns and rows of the picture that they reach.
    x: Range<usize>,
    y: Range<usize>,
}

#[derive(Debug)]
struct Splat {
    /// The voxel's number in its block.
    index: usize,
    x: f64,
    y: f64,
    /// exp(-tau z) f(0, 0).
    weight: f64,
}

impl Splats {
    /// What a voxel takes.
    pub(super) const BYTES: usize = size_of::<Splat>();

    /// Projects the voxels of a block that are splatted and have terms.
    pub(super) fn new(terms: &Terms, block: usize, eye: &Eye) -> Self {
        let Eye { camera, footprint, grid, clip, .. } = eye;
        let region = eye.blocks.region(block);
        let mut voxels = Vec::new();
        for v in region.intersect(clip).iter() {
            let index = region.index(v);
            if !terms.of_voxel(index).0.is_empty() {
                let [x, y, z] = camera.project(grid.position(v));
                voxels.push(Splat { index, x, y, weight: footprint.at_depth(z) });
            }
        }
        let size = camera.size;
        let x = reach(voxels.iter().map(|v| footprint.span(v.x, size[0])));
        let y = reach(voxels.iter().map(|v| footprint.span(v.y, size[1])));
        Self { voxels, size, x, y }
    }
}

/// The smallest range that holds all that are not empty.
fn reach(spans: impl Iterator<Item = Range<usize>>) -> Range<usize> {
    let all = spans.filter(|s| !s.is_empty()).reduce(|a, b| a.start.min(b.start)..a.end.max(b.end));
    all.unwrap_or(0..0)
}

/// The rows of the picture that any voxel of a block can reach; a block that reaches no column reaches no row.
pub(super) fn rows_reached(region: &Region, grid: &Grid, camera: &Camera, footprint: &Footprint) -> Range<usize> {
    let ends: [[f64; 3]; 2] = [grid.position(region.start), grid.position(region.end.map(|e| e - 1))];
    let corner = |n: usize| camera.project(std::array::from_fn(|a| ends[n >> a & 1][a]));
    rows_around((0..8).map(corner).map(|[x, y, _]| [x, y]), footprint.reach, camera.size)
}

/// The rows of a picture of such a size that are within `reach` pixels of the box around some places; none if no column is.
pub(super) fn rows_around(places: impl Iterator<Item = [f64; 2]>, reach: f64, size: [usize; 2]) -> Range<usize> {
    let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
    for place in places {
        (0..2).for_each(|i| (low[i], high[i]) = (low[i].min(place[i]), high[i].max(place[i])));
    }
    // A pixel more on each side than rounding could move an edge.
    let span = |i: usize| {
        let (from, to) = (low[i] - reach - 1.0, high[i] + reach + 1.0);
        let end = to.clamp(0.0, size[i] as f64).ceil() as usize;
        from.clamp(0.0, end as f64).floor() as usize..end
    };
    if span(0).is_empty() { 0..0 } else { span(1) }
}

/// Whether two ranges share anything.
pub(super) fn overlap(a: &Range<usize>, b: &Range<usize>) -> bool {
    !intersect(a, b).is_empty()
}

fn intersect(a: &Range<usize>, b: &Range<usize>) -> Range<usize> {
    a.start.max(b.start)..a.end.min(b.end)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tiles_cover_each_pixel_once() {
        let mut seen = vec![0; 150 * 100];
        for place in Place::cover(150, 30..100, TILE) {
            for y in place.y.clone() {
                place.x.clone().for_each(|x| seen[y * 150 + x] += 1);
            }
        }
        assert!(seen[..30 * 150].iter().all(|n| *n == 0) && seen[30 * 150..].iter().all(|n| *n == 1));
    }
}
