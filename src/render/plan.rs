//! How much of a picture is worked on at a time, so that memory stays within its budget.
//!
//! Neither the number of frames in a group, nor the rows in a band, nor the blocks in a batch changes a pixel.

use super::RenderConfig;
use super::lattice::Lattice;
use super::scene::Scene;
use super::splat::TILE;
use super::terms::Layout;
use crate::error::{Error, Result};
use crate::memory;
use crate::volume::Region;
use std::ops::Range;

/// What is allocated at once.
#[derive(Debug)]
pub(super) struct Budget<'a> {
    /// Bytes left for pictures, planes and blocks, besides weights.
    available: usize,
    size: [usize; 2],
    /// Finished numbers of a pixel and frame: its value, and its error.
    numbers: usize,
    /// The largest block.
    block: Region,
    block_bytes: usize,
    lattice: Option<&'a Lattice>,
}

/// The sums of weights for every pixel: as splatted, uncut, and beyond the cut.
const WEIGHT_BYTES: usize = 3 * size_of::<f64>();

impl<'a> Budget<'a> {
    /// For pictures of a scene.
    pub(super) fn new(config: &RenderConfig, scene: &dyn Scene, lattice: Option<&'a Lattice>) -> Result<Self> {
        let size = config.view.size;
        let fixed = memory::FIXED + size[0] * size[1] * WEIGHT_BYTES;
        let numbers = 1 + usize::from(config.certify);
        let available = config.memory.saturating_sub(fixed);
        let (block, block_bytes) = (scene.blocks().region(0), scene.block_bytes(config));
        let budget = Self { available, size, numbers, block, block_bytes, lattice };
        let least = budget.picture_bytes(1) + budget.band_bytes(scene.most_planes(1, config), TILE) + block_bytes;
        if least > budget.available {
            let mib = (fixed + least).div_ceil(1 << 20);
            let threads = rayon::current_num_threads();
            let what = format!(
                "--memory: pictures of {}x{} pixels of this volume need at least {mib}MiB with {threads} thread(s)",
                size[0], size[1]
            );
            return Err(Error::usage(what));
        }
        Ok(budget)
    }

    /// Finished pictures of a group, as f32.
    fn picture_bytes(&self, frames: usize) -> usize {
        frames * self.numbers * self.size[0] * self.size[1] * size_of::<f32>()
    }

    /// A band of so many rows with all planes.
    fn band_bytes(&self, planes: usize, rows: usize) -> usize {
        let numbers = match self.lattice {
            Some(lattice) => {
                let scratch = lattice.scratch(&self.block, planes);
                planes * lattice.band_cells(self.size[0], rows) + rayon::current_num_threads() * scratch
            }
            None => planes * self.size[0] * rows.next_multiple_of(TILE),
        };
        numbers * size_of::<f64>()
    }

    /// How many of `most` frames to render together.
    pub(super) fn frames(&self, scene: &dyn Scene, config: &RenderConfig, most: usize) -> usize {
        let fits = |f: &usize| {
            let rows = self.size[1].min(FEW_ROWS * TILE);
            let band = self.band_bytes(scene.most_planes(*f, config), rows);
            self.picture_bytes(*f) + band + self.block_bytes <= self.available
        };
        (1..=most).rev().find(fits).unwrap_or(1)
    }

    /// The bands of rows to splat one after another, each as tall as fits.
    pub(super) fn bands(&self, layout: &Layout) -> Vec<Range<usize>> {
        let left = self.available - self.picture_bytes(layout.frames) - self.block_bytes;
        let fits = |tiles: &usize| self.band_bytes(layout.planes(), tiles * TILE) <= left;
        let rows = TILE * (1..=self.size[1].div_ceil(TILE)).rev().find(fits).unwrap_or(1);
        (0..self.size[1]).step_by(rows).map(|y| y..y.saturating_add(rows).min(self.size[1])).collect()
    }

    /// How many blocks to decode at a time while a band of `rows` is splatted.
    pub(super) fn batch(&self, layout: &Layout, rows: usize) -> usize {
        let used = self.picture_bytes(layout.frames) + self.band_bytes(layout.planes(), rows);
        // What a lattice takes in plane by plane had better be near.
        let most = if self.lattice.is_some() { rayon::current_num_threads() } else { memory::MOST_BLOCKS };
        (self.available.saturating_sub(used) / self.block_bytes).clamp(1, most)
    }
}

/// Tiles across a band, at least, if it can be: blocks that reach over a band's edge are decoded for both.
const FEW_ROWS: usize = 4;
