//! Where a scene is seen from, and how it is splatted: everything that is the same for all frames of a view.

use super::lattice::Lattice;
use super::scene::Scene;
use super::slabs::Slab;
use super::tile_rect::{TILE, overlap, pixels_reached};
use super::{Quantity, RenderConfig, most_splat_error, splat_method};
use crate::base::error::{Error, Result};
use crate::base::grid::{BlockGrid, Grid, Region};
use crate::view::camera::{Camera, View};
use crate::view::footprint::{Footprint, Method};
use std::ops::Range;
use std::sync::Arc;

/// Means are of voxels of which some are not deeper than this over tau: exponentials lose digits at 708, and vanish.
const DEEPEST: f64 = 640.0;

/// A pixel is background where its weights sum to less than this share of the view's largest.
pub(super) const BACKGROUND: f64 = 0.01;

/// Everything that is the same for all frames of a view.
#[derive(Debug, Clone)]
pub(super) struct ViewSetup {
    pub(super) camera: Camera,
    pub(super) footprint: Footprint,
    pub(super) tau: f64,
    pub(super) grid: Grid,
    pub(super) blocks: BlockGrid,
    /// The voxels that are splatted.
    pub(super) clip: Region,
    /// What splats instead of footprints.
    pub(super) lattice: Option<Arc<Lattice>>,
    /// As what that is reported.
    pub(super) method: Method,
    /// The error of the method, and of voxels left out for their depth.
    pub(super) stated_error: f64,
    /// Voxels further away may be left out.
    pub(super) deepest: f64,
    /// What of the volume is seen, if not all.
    pub(super) slab: Option<Slab>,
}

impl ViewSetup {
    pub(super) fn new(scene: &dyn Scene, config: &RenderConfig, view: &View) -> Result<Self> {
        let (grid, blocks) = (*scene.grid(), scene.blocks());
        let clip = config.region.unwrap_or(grid.whole());
        if !grid.whole().contains(&clip) || clip.is_empty() {
            let d = grid.dims;
            return Err(Error::usage(format!("--region: not within the volume of {}x{}x{} voxels", d[0], d[1], d[2])));
        }
        // Where weights are small, certificates would say little of looser cuts.
        let share = if config.certify && config.quantity == Quantity::Mean { BACKGROUND } else { 1.0 };
        let method = splat_method(config.quantity, share * config.splat_error);
        let camera = Camera::new(view, &grid)?;
        let footprint = Footprint::new(config.kernel, &grid, camera.scale, method)?;
        let nearest = camera.nearest_of(&grid.crop(&clip));
        if config.quantity == Quantity::Mean && config.kernel.tau * nearest > DEEPEST {
            let what = "--tau: all voxels of the region lie so deep that their weights are beyond numbers";
            return Err(Error::usage(format!("{what} (tau {:e})", config.kernel.tau)));
        }
        let lattice = (!config.certify)
            .then(|| {
                let error = most_splat_error(config.quantity, config.splat_error);
                Lattice::within(error, config.kernel, (&grid, &clip), &camera, &footprint)
            })
            .flatten();
        let (lattice, instead) = lattice.unzip();
        let (method, lattice) = (instead.unwrap_or(method), lattice.map(Arc::new));
        let (tau, stated_error) = (config.kernel.tau, method.stated_error);
        let deepest = f64::INFINITY;
        Ok(Self { camera, footprint, tau, grid, blocks, clip, lattice, method, stated_error, deepest, slab: None })
    }

    pub(super) fn pixels(&self) -> usize {
        self.camera.size[0] * self.camera.size[1]
    }

    /// Pixels a side of a tile.
    pub(super) fn tile(&self) -> usize {
        self.lattice.as_ref().map_or(TILE, |lattice| lattice.tile())
    }

    /// Whether a block is so deep that it may be left out.
    pub(super) fn is_too_deep(&self, block: usize) -> bool {
        self.camera.nearest_of(&self.grid.crop(&self.blocks.region(block))) > self.deepest
    }

    /// Whether a block is to be splatted into these rows of the picture.
    pub(super) fn sees(&self, block: usize, rows: &Range<usize>) -> bool {
        self.is_in_slab(block) && self.reaches(block, rows) && !self.is_too_deep(block)
    }

    /// Whether any kernel of a block reaches into the slab that is seen.
    pub(super) fn is_in_slab(&self, block: usize) -> bool {
        let region = || self.blocks.region(block).intersect(&self.clip);
        let reached = |slab: Slab| !region().is_empty() && slab.is_reached(&region(), &self.grid, &self.camera);
        self.slab.is_none_or(reached)
    }

    /// Whether any voxel of a block can reach these rows of the picture.
    pub(super) fn reaches(&self, block: usize, rows: &Range<usize>) -> bool {
        overlap(&self.pixels_reached(&self.blocks.region(block))[1], rows)
    }

    /// The columns and rows that any voxel of a region can reach.
    pub(super) fn pixels_reached(&self, region: &Region) -> [Range<usize>; 2] {
        let region = region.intersect(&self.clip);
        match &self.lattice {
            _ if region.is_empty() => [0..0, 0..0],
            Some(lattice) => lattice.pixels_reached(&region, self.camera.size),
            None => pixels_reached(&region, &self.grid, &self.camera, &self.footprint),
        }
    }
}
