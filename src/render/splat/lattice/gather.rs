//! Gathers the pixels of a tile from its cells: sums of cells times the kernel of eq 36.

use super::cells::{Cells, TOGETHER, side_by_side};
use super::kernel::Weights;
use super::picture::Lattice;
use crate::render::splat::tile_rect::TileRect;
use crate::wavelet::{LANES, Lane};
use std::ops::Range;

/// The cells that the pixels of a tile need, with the planes that are not zero there.
#[derive(Debug)]
pub(in crate::render) struct Gather<'a> {
    lattice: &'a Lattice,
    rect: &'a TileRect,
    first: [isize; 2],
    /// Cells along u and v.
    size: [usize; 2],
    used: Vec<usize>,
    /// Number of planes in a bundle.
    together: usize,
    /// The sums of the planes of each bundle side by side, cell by cell.
    bundles: Vec<Vec<f64>>,
    /// The weights of [`LANES`] pixels.
    weights: Vec<Weights>,
}

impl<'a> Gather<'a> {
    /// Collects the cells of layers with the same rectangle of cells and `count` planes each. Planes are counted
    /// through all layers.
    pub(in crate::render) fn new(
        lattice: &'a Lattice,
        (layers, count): (&[&Cells], usize),
        rect: &'a TileRect,
    ) -> Self {
        let (first, size) = lattice.cells_reached(&rect.x, &rect.y);
        let window = CellWindow::of(layers[0], first, size);
        let numbered = |n: usize| move |(plane, sums)| (n * count + plane, sums);
        let planes = layers.iter().enumerate().flat_map(|(n, cells)| cells.touched().map(numbered(n)));
        let planes: Vec<(usize, &[f64])> = planes.filter(|(_, plane)| window.any(plane)).collect();
        let together = side_by_side(planes.len());
        let bundles = planes.chunks(together).map(|planes| window.bundle(planes, together)).collect();
        let lanes = if planes.is_empty() { 0 } else { LANES }; // without planes there are no weights to compute
        let weights = (0..lanes).map(|_| Weights::of(&lattice.kernel)).collect();
        let used = planes.into_iter().map(|(number, _)| number).collect();
        Self { lattice, rect, first, size, used, together, bundles, weights }
    }

    /// The planes that are not zero in this tile.
    pub(in crate::render) fn used(&self) -> &[usize] {
        &self.used
    }

    /// Loads the planes at `count` pixels from `first` on into the first lanes of `planes`.
    pub(in crate::render) fn load(&mut self, first: usize, count: usize, planes: &mut [Lane]) {
        planes.fill(Lane::default());
        if self.used.is_empty() {
            return;
        }
        let from = self.weigh(first, count);
        let mut sums = [0.0; TOGETHER];
        for (used, bundle) in self.used.chunks(self.together).zip(&self.bundles) {
            for (l, (weights, from)) in self.weights.iter().zip(from).enumerate().take(count) {
                sum_cells(weights, bundle, (from, self.size[0]), &mut sums[..self.together]);
                used.iter().zip(sums).for_each(|(plane, sum)| planes[*plane][l] = sum * self.lattice.peak);
            }
        }
    }

    /// The same for a tile with a single plane. It rounds differently from [`Self::load`], so it must not be mixed with
    /// that.
    pub(in crate::render) fn load_one(&mut self, first: usize, count: usize) -> Lane {
        let mut sums = Lane::default();
        let from = if self.used.is_empty() { return sums } else { self.weigh(first, count) };
        if let [bundle] = &self.bundles[..] {
            for (l, (sum, weights)) in sums.iter_mut().zip(&self.weights).enumerate().take(count) {
                *sum = sum_plane(weights, bundle, (from[l], self.size[0])) * self.lattice.peak;
            }
        }
        sums
    }

    /// Computes the weights of `count` pixels. Returns the index of the first cell of each.
    fn weigh(&mut self, first: usize, count: usize) -> [usize; LANES] {
        let mut from = [0; LANES];
        for (l, weights) in self.weights.iter_mut().enumerate().take(count) {
            let [x, y] = self.rect.pixel(first + l).map(|n| n as f64 + 0.5);
            let cell = self.lattice.kernel.weights(self.lattice.position([x, y]), weights);
            let [u, v] = [0, 1].map(|i| (cell[i] - self.first[i]) as usize);
            from[l] = v * self.size[0] + u;
        }
        from
    }
}

/// The cells of a tile within the planes of a band.
struct CellWindow {
    size: [usize; 2],
    phases: usize,
    /// The range of each row; `None` outside the band.
    rows: Vec<Option<Range<usize>>>,
    /// For each phase, the index in the tile's row of the first cell that lies in the band, and the range of these
    /// cells in the band's row.
    runs: Vec<(usize, Range<usize>)>,
}

impl CellWindow {
    fn of(cells: &Cells, first: [isize; 2], size: [usize; 2]) -> Self {
        let (rectangle, phases) = (cells.rectangle(), cells.rectangle().phases);
        let run = |phase: usize| {
            let (u, run) = rectangle.first_in_row(first[0] + phase as isize, size[0].saturating_sub(phase));
            (phase + u, run)
        };
        let rows = (first[1]..).take(size[1]).map(|v| rectangle.row(v)).collect();
        Self { size, phases, rows, runs: (0..phases).map(run).collect() }
    }

    /// Whether a plane has a nonzero sum in these cells.
    fn any(&self, plane: &[f64]) -> bool {
        let rows = self.rows.iter().flatten().map(|row| &plane[row.clone()]);
        rows.flat_map(|row| self.runs.iter().map(|(_, run)| &row[run.clone()])).any(any)
    }

    /// Copies planes side by side, cell by cell, padded with zero planes up to `together`.
    fn bundle(&self, planes: &[(usize, &[f64])], together: usize) -> Vec<f64> {
        let mut bundle = vec![0.0; self.size[0] * self.size[1] * together];
        for (to, row) in bundle.chunks_exact_mut(self.size[0] * together).zip(&self.rows) {
            let Some(row) = row else { continue };
            for (n, (_, plane)) in planes.iter().enumerate() {
                for (u, run) in self.runs.iter().filter(|(_, run)| !run.is_empty()) {
                    let to = to[u * together + n..].iter_mut().step_by(self.phases * together);
                    to.zip(&plane[row.clone()][run.clone()]).for_each(|(to, from)| *to = *from);
                }
            }
        }
        bundle
    }
}

/// Whether any number is nonzero.
#[cfg_attr(not(feature = "portable"), multiversion::multiversion(targets("x86_64+avx512f", "x86_64+avx2")))]
fn any(numbers: &[f64]) -> bool {
    numbers.iter().fold(0, |bits, n| bits | (n.to_bits() << 1)) != 0 // the shift drops the sign of zero
}

/// The weighted sums of the cells of a pixel. Its first cell has the index `first`, in rows of `width` cells.
#[cfg_attr(not(feature = "portable"), multiversion::multiversion(targets("x86_64+avx512f", "x86_64+avx2")))]
fn sum_cells(weights: &Weights, cells: &[f64], (first, width): (usize, usize), sums: &mut [f64]) {
    match sums.len() {
        1 => sums.copy_from_slice(&sum_planes::<1>(weights, cells, (first, width))),
        2 => sums.copy_from_slice(&sum_planes::<2>(weights, cells, (first, width))),
        4 => sums.copy_from_slice(&sum_planes::<4>(weights, cells, (first, width))),
        8 => sums.copy_from_slice(&sum_planes::<8>(weights, cells, (first, width))),
        _ => sums.copy_from_slice(&sum_planes::<TOGETHER>(weights, cells, (first, width))),
    }
}

/// The sums of `N` planes side by side.
#[inline(always)]
fn sum_planes<const N: usize>(weights: &Weights, cells: &[f64], (first, width): (usize, usize)) -> [f64; N] {
    let mut sums = [0.0; N];
    let cells = cells.as_chunks::<N>().0;
    for (n, start, weights) in weights.rows() {
        let row = &cells[first + n * width + start..][..weights.len()];
        for (weight, cell) in weights.iter().zip(row) {
            for (sum, value) in sums.iter_mut().zip(cell) {
                *sum += weight * value;
            }
        }
    }
    sums
}

/// The sum of one plane, over several neighbouring cells at a time.
#[cfg_attr(not(feature = "portable"), multiversion::multiversion(targets("x86_64+avx512f", "x86_64+avx2")))]
fn sum_plane(weights: &Weights, cells: &[f64], (first, width): (usize, usize)) -> f64 {
    let mut sums = [0.0; LANES];
    for (n, start, weights) in weights.rows() {
        let row = &cells[first + n * width + start..][..weights.len()];
        for (weights, row) in weights.chunks(LANES).zip(row.chunks(LANES)) {
            for (sum, (weight, value)) in sums.iter_mut().zip(weights.iter().zip(row)) {
                *sum += weight * value;
            }
        }
    }
    sums.iter().sum()
}
