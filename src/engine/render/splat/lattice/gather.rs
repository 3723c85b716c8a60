//! Gathers the pixels of a tile from its filtered cells: sums of cells times the kernel, in two passes (eq 38).

use super::bundle::{Bundles, TilePlane};
use super::cells::TOGETHER;
use super::filtered::FilteredCells;
use super::picture::Lattice;
use super::two_passes::TwoPasses;
use crate::render::splat::tile_rect::TileRect;
use wavesplat_core::codec::real::Real;
use wavesplat_core::wavelet::{LANES, Lane};

/// The image of the value 1 at all voxels of a view.
#[derive(Debug, Clone, Copy)]
pub(in crate::render) struct Ones<'a> {
    /// The filtered cells of the whole picture; one plane.
    pub(in crate::render) cells: &'a FilteredCells,
    /// The sums of all pixels, row by row.
    pub(in crate::render) sums: &'a [f64],
    /// Pixels in a row.
    pub(in crate::render) width: usize,
}

/// The cells that the pixels of a tile need, with the planes that are not zero there.
#[derive(Debug)]
pub(in crate::render) struct Gather<'a> {
    /// f at its centre.
    peak: f64,
    rect: &'a TileRect,
    ones: Option<Ones<'a>>,
    bundles: Bundles<'a>,
    passes: TwoPasses<'a>,
}

impl<'a> Gather<'a> {
    /// Collects the cells of a tile.
    pub(in crate::render) fn new(
        lattice: &'a Lattice,
        cells: &'a FilteredCells,
        rect: &'a TileRect,
        ones: Option<Ones<'a>>,
    ) -> Self {
        let tile = lattice.cells_reached(&rect.x, &rect.y);
        let bundles = Bundles::new(cells, &tile, ones.map(|ones| ones.cells));
        let passes = TwoPasses::new(&lattice.upright, rect, &tile, &bundles);
        Self { peak: lattice.peak, rect, ones, bundles, passes }
    }

    /// The planes that are not zero in this tile.
    pub(in crate::render) fn used(&self) -> Vec<usize> {
        let mut used: Vec<usize> = self.bundles.planes().collect();
        used.sort_unstable();
        used
    }

    /// Loads the planes at `count` pixels of a row, from `first` on, into the first lanes of `planes`.
    pub(in crate::render) fn load(&mut self, first: usize, count: usize, planes: &mut [Lane]) {
        planes.fill(Lane::default());
        let Bundles { single, double } = &self.bundles;
        let (pixel, peak) = (self.rect.pixel(first), self.peak);
        let ones = self.ones_at(pixel, count);
        self.passes.sum_row(pixel[1], &self.bundles);
        let (mut sums, mut precise) = ([[0.0; TOGETHER]; LANES], [[0.0; TOGETHER]; LANES]);
        for (n, bundle) in single.iter().enumerate() {
            self.passes.single(n, pixel[0], &mut sums[..count]);
            put(&bundle.planes, peak, &sums, &ones, planes);
        }
        for (n, bundle) in double.iter().enumerate() {
            self.passes.double(n, pixel[0], &mut precise[..count]);
            put(&bundle.planes, peak, &precise, &ones, planes);
        }
    }

    /// The sums of ones at neighbouring pixels; zeros if they are unknown.
    fn ones_at(&self, [x, y]: [usize; 2], count: usize) -> Lane {
        let mut lane = Lane::default();
        if let Some(Ones { sums, width, .. }) = self.ones {
            lane[..count].copy_from_slice(&sums[y * width + x..][..count]);
        }
        lane
    }
}

/// Puts the sums of pixels into their planes.
fn put<R: Real>(
    stored: &[(usize, TilePlane)],
    peak: f64,
    sums: &[[R; TOGETHER]; LANES],
    ones: &Lane,
    planes: &mut [Lane],
) {
    for (place, TilePlane { number, mean, scale }) in stored {
        let factor = scale * peak;
        let plane = &mut planes[*number];
        for l in 0..LANES {
            plane[l] = sums[l][*place].to_f64() * factor + mean * ones[l];
        }
    }
}
