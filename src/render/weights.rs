//! The sums of weights that the weighted mean divides by (eq 12), and what is background.

use super::certificate;
use super::lattice::{Lattice, Sums};
use super::plan::Budget;
use super::splat::{Order, Tile};
use super::terms::{Layout, Terms};
use super::{Blocks, Eye, Quantity, RenderConfig, RenderReport};
use crate::error::Result;
use crate::footprint::{Footprint, Method};
use crate::volume::{BlockGrid, Region};

/// A pixel is background where its weights sum to less than this share of the view's largest.
pub(super) const BACKGROUND: f64 = 0.01;
/// Of a pixel's weights this share must not be missing.
const LEAST_PRESENT: f64 = 1e-6;

/// The sums of weights of all voxels of a view.
#[derive(Debug)]
pub(super) struct Weights {
    size: [usize; 2],
    /// With the footprints that values are splatted with, so that the quotient is a mean.
    sums: Vec<f64>,
    /// With uncut footprints, so that the background is the same for every splat method. Empty: the same sums.
    uncut: Vec<f64>,
    /// At least what lies beyond the cut. Empty: not asked for.
    beyond: Vec<f64>,
    threshold: f64,
}

/// The weights of one pixel.
#[derive(Debug, Clone, Copy)]
pub(super) struct PixelWeight {
    /// C, as values are splatted.
    pub(super) sum: f64,
    uncut: f64,
    /// T, beyond the cut.
    pub(super) beyond: f64,
    threshold: f64,
}

impl PixelWeight {
    /// The weighted mean of an emission, less weights that are missing; NaN in the background, and where so much is
    /// missing that rounding is what is left.
    pub(super) fn mean(&self, emission: f64, absent: f64) -> f64 {
        let present = self.sum - absent;
        let enough = self.uncut - absent >= self.threshold && present > LEAST_PRESENT * self.sum;
        if enough { emission / present } else { f64::NAN }
    }
}

impl Weights {
    /// Splats a 1 for every voxel.
    pub(super) fn new(eye: &Eye, config: &RenderConfig, budget: &Budget) -> Result<Self> {
        let mean = config.quantity == Quantity::Mean;
        let by = |method: Method| Footprint::new(config.kernel, &eye.grid, eye.camera.scale, method);
        let seen_by = |footprint: Footprint| Eye { footprint, lattice: None, ..eye.clone() };
        let sums = sums(eye, budget)?;
        let exact = by(Method::EXACT)?;
        let uncut = if mean && (eye.lattice.is_some() || eye.footprint.reach < exact.reach) {
            self::sums(&seen_by(exact), budget)?
        } else {
            Vec::new()
        };
        let mut beyond = Vec::new();
        if config.certify {
            let whole = seen_by(by(certificate::WHOLE)?);
            beyond = self::sums(&whole, budget)?;
            certificate::leave_beyond(&whole, &sums, &mut beyond);
        }
        let largest = if uncut.is_empty() { &sums } else { &uncut }.iter().copied().fold(0.0, f64::max);
        Ok(Self { size: eye.camera.size, sums, uncut, beyond, threshold: BACKGROUND * largest })
    }

    /// The sums of the pixels that are not background.
    pub(super) fn shown(&self) -> impl Iterator<Item = f64> {
        self.sums.iter().copied().filter(|sum| *sum >= self.threshold)
    }

    /// The sum at a place of the picture, and that of the nearest pixel up to `reach` pixels beside it; at least what is
    /// not background.
    pub(super) fn near(&self, place: [f64; 2], reach: f64) -> Option<f64> {
        let within = |a: usize| place[a] >= -reach && place[a] < self.size[a] as f64 + reach;
        let pixel = |a: usize| (place[a].max(0.0) as usize).min(self.size[a] - 1);
        let seen = within(0) && within(1) && self.threshold > 0.0;
        seen.then(|| self.sums[pixel(1) * self.size[0] + pixel(0)].max(self.threshold))
    }

    /// The weights of a tile's pixel, counted row by row.
    pub(super) fn at(&self, tile: &Tile, pixel: usize) -> PixelWeight {
        let (x, y) = (tile.x.start + pixel % tile.x.len(), tile.y.start + pixel / tile.x.len());
        let at = y * self.size[0] + x;
        let sum = self.sums[at];
        let uncut = self.uncut.get(at).copied().unwrap_or(sum);
        PixelWeight { sum, uncut, beyond: self.beyond.get(at).copied().unwrap_or(0.0), threshold: self.threshold }
    }
}

fn sums(eye: &Eye, budget: &Budget) -> Result<Vec<f64>> {
    let layout =
        Layout { coefficients: 1, frames: 1, values: false, absent: false, error_planes: 0, order: Order::Planes };
    let mut out = vec![0.0; eye.pixels()];
    for rows in budget.bands(&layout) {
        let blocks: Vec<usize> = eye.blocks.touching(&eye.clip).filter(|b| eye.sees(*b, &rows)).collect();
        let mut tiles = eye.tiles(rows.clone(), &layout);
        let (batch, report) = (budget.batch(&layout, rows.len()), &mut RenderReport::default());
        eye.splat(&mut tiles, &blocks, batch, &Ones(&eye.blocks), report)?;
        tiles.iter().for_each(|tile| eye.paste(tile, 1, &mut out, |sum| sum));
    }
    Ok(out)
}

/// A 1 for every voxel of a block.
struct Ones<'a>(&'a BlockGrid);

impl Blocks for Ones<'_> {
    fn terms(&self, block: usize) -> Result<Terms> {
        Ok(Terms::ones(self.0.region(block).voxels()))
    }

    fn sums(&self, block: usize, clip: &Region, lattice: &Lattice) -> Result<Option<Sums>> {
        let region = self.0.region(block).intersect(clip);
        let mut dense = lattice.dense(&region, 1);
        dense.add(0, &vec![1.0; region.voxels()]);
        Ok(Some(dense.into()))
    }
}
