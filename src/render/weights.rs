//! The sums of weights that the weighted mean divides by (eq 12), and what is background.

use super::plan::Budget;
use super::scene::{Layout, Terms};
use super::splat::Tile;
use super::{Eye, RenderReport};
use crate::error::Result;
use crate::footprint::{Footprint, Kernel, Method};

/// A pixel is background where its weights sum to less than this share of the view's largest.
pub(super) const BACKGROUND: f64 = 0.01;

/// The sums of weights of all voxels of a view.
#[derive(Debug)]
pub(super) struct Weights {
    width: usize,
    /// With the footprints that values are splatted with, so that the quotient is a mean.
    sums: Vec<f64>,
    /// With uncut footprints, so that the background is the same for every splat method. Empty: the same sums.
    uncut: Vec<f64>,
    threshold: f64,
}

/// The weights of one pixel.
#[derive(Debug, Clone, Copy)]
pub(super) struct PixelWeight {
    sum: f64,
    uncut: f64,
    threshold: f64,
}

impl PixelWeight {
    /// The weighted mean of an emission, less weights that are missing; NaN in the background.
    pub(super) fn mean(&self, emission: f64, absent: f64) -> f64 {
        if self.uncut - absent < self.threshold { f64::NAN } else { emission / (self.sum - absent) }
    }
}

impl Weights {
    /// Splats a 1 for every voxel.
    pub(super) fn new(eye: &Eye, kernel: Kernel, budget: &Budget) -> Result<Self> {
        let sums = sums(eye, budget)?;
        let exact = Footprint::new(kernel, &eye.grid, eye.camera.scale, Method::EXACT)?;
        let uncut = if eye.footprint.reach < exact.reach {
            self::sums(&Eye { footprint: exact, ..eye.clone() }, budget)?
        } else {
            Vec::new()
        };
        let largest = if uncut.is_empty() { &sums } else { &uncut }.iter().copied().fold(0.0, f64::max);
        Ok(Self { width: eye.camera.size[0], sums, uncut, threshold: BACKGROUND * largest })
    }

    /// The weights of a tile's pixel, counted row by row.
    pub(super) fn at(&self, tile: &Tile, pixel: usize) -> PixelWeight {
        let (x, y) = (tile.x.start + pixel % tile.x.len(), tile.y.start + pixel / tile.x.len());
        let sum = self.sums[y * self.width + x];
        let uncut = self.uncut.get(y * self.width + x).copied().unwrap_or(sum);
        PixelWeight { sum, uncut, threshold: self.threshold }
    }
}

fn sums(eye: &Eye, budget: &Budget) -> Result<Vec<f64>> {
    let layout = Layout { coefficients: 1, frames: 1, values: false, absent: false };
    let mut out = vec![0.0; eye.pixels()];
    for rows in budget.bands(&layout) {
        let blocks: Vec<usize> = eye.blocks.touching(&eye.clip).filter(|b| eye.sees(*b, &rows)).collect();
        let mut tiles = eye.tiles(rows.clone(), 1);
        let ones = |b: usize| Ok(Terms::ones(eye.blocks.region(b).voxels()));
        eye.splat(&mut tiles, &blocks, budget.batch(&layout, rows.len()), ones, &mut RenderReport::default())?;
        tiles.iter().for_each(|tile| eye.paste(tile, 1, &mut out, |sum| sum));
    }
    Ok(out)
}
