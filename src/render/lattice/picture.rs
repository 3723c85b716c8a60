//! The lattice of one view as a way of splatting: when it is used, the sums of blocks, and from sums to pixels.

use super::cells::Cells;
use super::kernel::{Kernel, Run, Weights};
use super::shear::Shear;
use super::spline::spread;
use super::{Coded, Dense, Spreading, block_cells};
use crate::camera::Camera;
use crate::footprint::{Footprint, Kernel as Gaussian, Method};
use crate::render::splat::{TILE, Tile};
use crate::render::terms::Terms;
use crate::volume::{BlockGrid, Grid, Region};
use multiversion::multiversion;
use std::ops::Range;

/// The lattice of a view.
#[derive(Debug, Clone)]
pub struct Lattice {
    spreading: Spreading,
    kernel: Kernel,
    /// Of the footprint, in pixels: no cell further from a pixel is seen.
    reach: f64,
    /// f at its centre.
    peak: f64,
}

/// What a block adds to the cells of all planes.
#[derive(Debug)]
pub struct Sums {
    cells: Cells,
    /// Nonzero coefficients among them.
    pub(in crate::render) coefficients: u64,
    /// Stored bytes that were read for them.
    pub(in crate::render) bytes_read: u64,
}

/// Cells per voxel and degrees of splines, from the cheapest.
const CHOICES: [(usize, usize); 9] = [(1, 3), (1, 5), (1, 7), (2, 3), (2, 5), (2, 7), (3, 5), (3, 7), (4, 7)];
/// What amounts grow by from one voxel to the next, at most, as an exponent: rounding grows with its cube.
const STEEPEST: f64 = 0.5;
/// Nodes that a block may have outside.
const MOST_PAD: usize = 6;
/// Cells of a tile, and those of a block, are at most so many times its pixels and its voxels.
const MOST_CELLS: usize = 4;

impl Lattice {
    /// The lattice that splats within `error` (as in [`Method::within`]), and as what it is reported; none if footprints
    /// are better.
    pub(in crate::render) fn within(
        error: f64,
        gaussian: Gaussian,
        (grid, blocks, clip): (&Grid, &BlockGrid, &Region),
        camera: &Camera,
        footprint: &Footprint,
    ) -> Option<(Self, Method)> {
        let (error, sigma) = (error.min(LARGEST), gaussian.sigma * camera.scale);
        let radius = (2.0 * libm::log(20.0 / error)).sqrt(); // half of the error is left for the lattice
        for (fineness, degree) in CHOICES.into_iter().filter(|_| error > SMALLEST) {
            let shear = Shear::new(camera, grid, fineness);
            let kernel = Kernel::new(&shear, sigma, degree, radius);
            let Some(kernel) = kernel else { continue };
            let spreading = Spreading { shear, degree, tau: gaussian.tau };
            let lattice = Self { spreading, kernel, reach: radius * sigma, peak: footprint.at_depth(0.0) };
            if !lattice.suits(blocks) || lattice.work(camera, clip) > footprint_work(camera, clip, footprint) {
                return None; // nor do finer ones
            }
            let stated_error = lattice.kernel.error(&shear, sigma, error);
            if stated_error <= error {
                return Some((lattice, Method { name: "lattice", radius, stated_error }));
            }
        }
        None
    }

    fn suits(&self, blocks: &BlockGrid) -> bool {
        if !self.is_tame() {
            return false;
        }
        let depths = self.spreading.shear.depths.map(|z| (self.spreading.tau * z).abs());
        let tile = self.seen_by(&(0..TILE), &(0..TILE)).1;
        let steep = depths.into_iter().fold(0.0, f64::max) > STEEPEST;
        let region = blocks.region(0);
        !steep
            && area(tile) <= MOST_CELLS * TILE * TILE
            && self.block_cells(&region) <= MOST_CELLS * region.voxels().max(TILE * TILE)
    }

    /// Whether whole numbers of cells are small enough for arithmetic.
    fn is_tame(&self) -> bool {
        let shear = &self.spreading.shear;
        let per_pixel = [[1.0, 0.0], [0.0, 1.0]].map(|pixel| shear.cells(pixel));
        let places = [self.place([0.0; 2]), self.kernel.half()];
        let within = |numbers: &[f64; 2], most: f64| numbers.iter().all(|n| n.abs() <= most);
        per_pixel.iter().chain([&shear.slopes]).all(|n| within(n, TILE as f64)) && places.iter().all(|n| within(n, 1e9))
    }

    /// Products for a plane, about.
    fn work(&self, camera: &Camera, clip: &Region) -> f64 {
        let (degree, q) = (self.spreading.degree as f64, self.spreading.shear.fineness as f64);
        let voxels = clip.voxels() as f64;
        GATHERING * self.kernel.cells() as f64 * (camera.size[0] * camera.size[1]) as f64
            + 2.0 * voxels * (degree + 1.0) * (q + 1.0)
    }

    /// Cells of a block's planes.
    pub(in crate::render) fn block_cells(&self, region: &Region) -> usize {
        area(self.rectangle(region, MOST_PAD).1)
    }

    /// Cells of a tile's planes.
    pub(in crate::render) fn tile_cells(&self) -> usize {
        area(self.seen_by(&(0..TILE), &(0..TILE)).1.map(|n| n + 2)) // as rounding and the tile's place have it
    }

    /// The cells that voxels of a region, and of `pad` around it, reach: the first ones, and how many.
    fn rectangle(&self, region: &Region, pad: usize) -> ([isize; 2], [usize; 2]) {
        let Spreading { shear, degree, .. } = self.spreading;
        let [b, c, a] = shear.axes;
        let (mut low, mut high) = ([isize::MAX; 2], [isize::MIN; 2]);
        for corner in 0..8 {
            let at = |axis: usize| if corner >> axis & 1 == 0 { region.start[axis] } else { region.end[axis] - 1 };
            let mut voxel = [0; 3];
            [b, c, a].into_iter().for_each(|axis| voxel[axis] = at(axis));
            let first = shear.place(voxel).map(|place| spread(degree, place).0);
            (0..2).for_each(|i| (low[i], high[i]) = (low[i].min(first[i]), high[i].max(first[i])));
        }
        // A cell more than rounding could move.
        let pad = shear.fineness * pad + 1;
        let size = |i: usize| (high[i] - low[i]) as usize + 2 * pad + degree + 1;
        (low.map(|first| first - pad as isize), [size(0), size(1)])
    }

    /// The cells that some pixels see.
    fn seen_by(&self, x: &Range<usize>, y: &Range<usize>) -> ([isize; 2], [usize; 2]) {
        let corners = [x.start, x.end].into_iter().flat_map(|x| [y.start, y.end].map(move |y| [x as f64, y as f64]));
        let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
        for place in corners.map(|pixel| self.place(pixel)) {
            (0..2).for_each(|i| (low[i], high[i]) = (low[i].min(place[i]), high[i].max(place[i])));
        }
        let half = self.kernel.half();
        let first = [0, 1].map(|i| (low[i] - half[i]).floor() as isize - 1);
        (first, [0, 1].map(|i| ((high[i] + half[i]).ceil() as isize + 2 - first[i]) as usize))
    }

    /// The place in cells of a place in pixels.
    fn place(&self, pixel: [f64; 2]) -> [f64; 2] {
        let shear = &self.spreading.shear;
        shear.cells([0, 1].map(|i| pixel[i] - shear.origin[i]))
    }

    /// The rows of the picture that a block can reach; one that reaches no column reaches no row.
    pub(in crate::render) fn rows_reached(&self, region: &Region, size: [usize; 2]) -> Range<usize> {
        let (first, cells) = self.rectangle(region, MOST_PAD);
        let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
        for corner in 0..4 {
            let cell = [0, 1].map(|i| (first[i] + (corner >> i & 1) * cells[i] as isize) as f64);
            let pixel = self.spreading.shear.pixel(cell);
            (0..2).for_each(|i| (low[i], high[i]) = (low[i].min(pixel[i]), high[i].max(pixel[i])));
        }
        let span = |i: usize| {
            let (from, to) = (low[i] - self.reach - 1.0, high[i] + self.reach + 1.0);
            let end = to.clamp(0.0, size[i] as f64).ceil() as usize;
            from.clamp(0.0, end as f64).floor() as usize..end
        };
        if span(0).is_empty() { 0..0 } else { span(1) }
    }

    /// The sums of a block from its codes: planes `ks` of it, and as many more as make `planes`.
    pub(in crate::render) fn of_codes(&self, block: &Coded<'_>, ks: &[usize], planes: usize) -> Sums {
        let timed = block.pyramid.is_some_and(|p| p.order.contains(&wavesplat_format::Axis::T));
        let all: Vec<usize> = (0..block.shape[3]).collect();
        let mut cells = block_cells(block, &self.spreading, if timed { &all } else { ks });
        if timed && ks.len() < all.len() {
            cells.sums = ks.iter().flat_map(|k| cells.plane(*k)).copied().collect();
        }
        cells.sums.resize(planes * cells.area(), 0.0);
        Sums { cells, coefficients: 0, bytes_read: 0 }
    }

    /// The sums in the making of a block with an amount for each voxel.
    pub(in crate::render) fn dense(&self, region: &Region, planes: usize) -> Dense {
        Dense::new(&self.spreading, region, planes)
    }

    /// The sums of terms of the voxels of `region` that lie in `clip`.
    pub(in crate::render) fn of_terms(&self, terms: &Terms, region: &Region, clip: &Region, planes: usize) -> Sums {
        let (first, size) = self.rectangle(region, 0);
        let mut sums = Sums { cells: Cells::new(first, size, planes), coefficients: 0, bytes_read: 0 };
        self.add_terms(terms, region, clip, &mut sums);
        sums
    }

    /// Adds terms to the sums of a block.
    pub(in crate::render) fn add_terms(&self, terms: &Terms, region: &Region, clip: &Region, sums: &mut Sums) {
        let Spreading { shear, degree, tau } = self.spreading;
        let cells = &mut sums.cells;
        for voxel in region.intersect(clip).iter() {
            let (planes, amounts) = terms.of_voxel(region.index(voxel));
            if planes.is_empty() {
                continue;
            }
            let places = shear.place(voxel).map(|place| spread(degree, place));
            let fading = libm::exp(-tau * shear.depth(voxel));
            for (plane, amount) in planes.iter().zip(amounts) {
                cells.add(usize::from(*plane), amount * fading, places, degree);
            }
        }
        sums.coefficients += terms.coefficients;
        sums.bytes_read += terms.bytes_read;
    }

    /// The cells that a tile sees, with all planes at zero, those of a cell side by side.
    pub(in crate::render) fn cells_of(&self, tile: &Tile) -> Cells {
        let (first, size) = self.seen_by(&tile.x, &tile.y);
        Cells::new(first, size, tile.count())
    }

    /// The pixels of a tile from its cells.
    pub(in crate::render) fn gather(&self, cells: &Cells, tile: &mut Tile) {
        let (count, width) = (tile.count(), tile.x.len());
        let mut weights = Weights::of(&self.kernel);
        let (left, top) = (tile.x.start, tile.y.start);
        for (n, pixel) in tile.sums_mut().chunks_exact_mut(count).enumerate() {
            let place = self.place([(left + n % width) as f64 + 0.5, (top + n / width) as f64 + 0.5]);
            let first = self.kernel.weights(place, &mut weights);
            let [u, v] = [0, 1].map(|i| (first[i] - cells.first[i]) as usize);
            let rows = Rows { runs: &weights.rows, spans: &self.kernel.spans, first: v * cells.size[0] + u };
            sum_cells(pixel, self.peak, &rows, cells);
        }
    }
}

/// The cells that a pixel sees.
struct Rows<'a> {
    /// The weights of rows, as many in each; those in its span count.
    runs: &'a [Run],
    spans: &'a [Range<usize>],
    /// The first cell of the first row.
    first: usize,
}

impl From<Dense> for Sums {
    fn from(dense: Dense) -> Self {
        Self { cells: dense.cells, coefficients: 0, bytes_read: 0 }
    }
}

impl Sums {
    /// Adds them to the cells of a tile ([`Lattice::cells_of`]) of `count` planes.
    pub(in crate::render) fn add_to(&self, tile: &mut Cells, count: usize) {
        let of = &self.cells;
        let shared = |i: usize| {
            let end = (of.first[i] + of.size[i] as isize).min(tile.first[i] + tile.size[i] as isize);
            of.first[i].max(tile.first[i])..end
        };
        let (us, vs) = (shared(0), shared(1));
        for (v, plane) in vs.flat_map(|v| (0..count).map(move |plane| (v, plane))).filter(|_| !us.is_empty()) {
            let from = (v - of.first[1]) as usize * of.size[0] + (us.start - of.first[0]) as usize;
            let to = (v - tile.first[1]) as usize * tile.size[0] + (us.start - tile.first[0]) as usize;
            let sums = tile.sums[to * count + plane..].iter_mut().step_by(count);
            sums.zip(&of.plane(plane)[from..from + us.len()]).for_each(|(sum, cell)| *sum += cell);
        }
    }
}

/// The planes of a pixel: the weighted sums of cells, each with all planes side by side, times `peak`.
#[multiversion(targets("x86_64+avx512f", "x86_64+avx2"))]
fn sum_cells(pixel: &mut [f64], peak: f64, rows: &Rows<'_>, cells: &Cells) {
    let mut plane = 0;
    while plane < pixel.len() {
        match pixel.len() - plane {
            32.. => sum_planes::<32>(pixel, &mut plane, peak, rows, cells),
            8.. => sum_planes::<8>(pixel, &mut plane, peak, rows, cells),
            4.. => sum_planes::<4>(pixel, &mut plane, peak, rows, cells),
            2.. => sum_planes::<2>(pixel, &mut plane, peak, rows, cells),
            _ => sum_planes::<1>(pixel, &mut plane, peak, rows, cells),
        }
    }
}

/// The same of `N` planes, whose sums stay in registers.
#[inline(always)]
fn sum_planes<const N: usize>(pixel: &mut [f64], plane: &mut usize, peak: f64, rows: &Rows<'_>, cells: &Cells) {
    let mut sums = [0.0; N];
    let weights = rows.runs.chunks_exact(rows.runs.len() / rows.spans.len());
    for (n, (span, weights)) in rows.spans.iter().zip(weights).enumerate().filter(|(_, (span, _))| !span.is_empty()) {
        let first = rows.first + n * cells.size[0] + span.start;
        let row = cells.sums[first * pixel.len() + *plane..].chunks(pixel.len());
        for (weight, cell) in weights.as_flattened()[span.clone()].iter().zip(row) {
            let Some(cell) = cell.first_chunk::<N>() else { continue };
            for (sum, value) in sums.iter_mut().zip(cell) {
                *sum += weight * value;
            }
        }
    }
    pixel[*plane..*plane + N].iter_mut().zip(sums).for_each(|(pixel, sum)| *pixel = sum * peak);
    *plane += N;
}

/// What a product takes from cells to pixels in units of one of a footprint, as measured, weights included.
const GATHERING: f64 = 1.0;

/// Nothing cheaper has larger errors.
const LARGEST: f64 = 0.05;
/// Errors that no lattice reaches.
const SMALLEST: f64 = 1e-7;

fn area([width, height]: [usize; 2]) -> usize {
    width * height
}

/// Products for a plane if all voxels have footprints.
fn footprint_work(camera: &Camera, clip: &Region, footprint: &Footprint) -> f64 {
    let side = |pixels: usize| (2.0 * footprint.reach + 1.0).min(pixels as f64);
    clip.voxels() as f64 * side(camera.size[0]) * side(camera.size[1])
}
