//! The setup of a view, shared by all frames: camera, kernel, backend and the voxels to splat.

use super::backend::{SplatBackend, footprint_method};
use super::lattice::SplattedView;
use super::reference_weights::ReferenceWeights;
use super::tile_rect::{TileRect, overlap};
use crate::render::config::{Quantity, RenderConfig, most_splat_error};
use std::ops::Range;
use wavesplat_core::base::error::{Error, Result};
use wavesplat_core::base::grid::{BlockGrid, Grid, Region};
use wavesplat_core::view::camera::{Camera, View};
use wavesplat_core::view::footprint::{Footprint, Method};

/// The largest tau times depth of the nearest voxel for which means are computed: exponentials lose digits at 708, and
/// then vanish.
const MOST_EXPONENT: f64 = 640.0;

/// The setup of a view, shared by all frames.
#[derive(Debug, Clone)]
pub(in crate::render) struct ViewSetup {
    pub(in crate::render) camera: Camera,
    pub(in crate::render) footprint: Footprint,
    pub(in crate::render) grid: Grid,
    pub(in crate::render) blocks: BlockGrid,
    /// The voxels that are splatted.
    pub(in crate::render) clip: Region,
    pub(in crate::render) backend: SplatBackend,
    /// The splat method: its name, radius and stated error.
    pub(in crate::render) method: Method,
    /// The stated error of the method and of voxels left out for their depth.
    pub(in crate::render) stated_error: f64,
    /// Voxels deeper than this may be left out.
    pub(in crate::render) deepest: f64,
}

impl ViewSetup {
    /// Whether the stated error is an estimate, as pictures are drawn for a quick look.
    pub(in crate::render) fn is_quick_look(&self, config: &RenderConfig) -> bool {
        config.fast && self.backend.is_lattice()
    }

    /// The setup of a view of `grid`, which is cut into `blocks`.
    ///
    /// # Errors
    /// A region outside the volume, a camera without a picture, or an attenuation that leaves no weights.
    pub(in crate::render) fn new(grid: &Grid, blocks: BlockGrid, config: &RenderConfig, view: &View) -> Result<Self> {
        let (clip, kernel) = (config.clip(grid)?, config.kernel);
        let camera = Camera::new(view, grid)?;
        let footprint = Footprint::new(kernel, grid, camera.scale, footprint_method(config))?;
        check_attenuation(config, camera.nearest_of(&grid.crop(&clip)))?;
        let reference = ReferenceWeights::new(&camera, grid, clip, kernel)?;
        let splatted = SplattedView { kernel, grid, clip: &clip, blocks, camera: &camera, footprint: &footprint };
        let (backend, method) = SplatBackend::choose(config, &splatted, reference.slices());
        let most = most_splat_error(config.quantity, config.splat_error);
        let share = most - method.stated_error;
        let leaves_out = !config.certify && kernel.tau != 0.0 && share > 0.0;
        let deepest = if leaves_out { reference.deepest(share) } else { f64::INFINITY };
        let (deepest, stated_error) = match deepest < camera.depth(grid) {
            true => (deepest, most),
            false => (f64::INFINITY, method.stated_error),
        };
        Ok(Self { camera, footprint, grid: *grid, blocks, clip, backend, method, stated_error, deepest })
    }

    pub(in crate::render) fn pixels(&self) -> usize {
        self.camera.size[0] * self.camera.size[1]
    }

    /// Whether a block is so deep that it may be left out.
    pub(in crate::render) fn is_too_deep(&self, block: usize) -> bool {
        self.camera.nearest_of(&self.grid.crop(&self.blocks.region(block))) > self.deepest
    }

    /// Whether a block must be splatted into the picture.
    pub(in crate::render) fn sees(&self, block: usize) -> bool {
        self.reaches(block, &TileRect::whole(self.camera.size)) && !self.is_too_deep(block)
    }

    /// Whether these pixels change if a block that the picture sees is left out.
    pub(in crate::render) fn needs(&self, block: usize, pixels: &TileRect) -> bool {
        let region = self.blocks.region(block).intersect(&self.clip);
        self.reaches(block, pixels) || !region.is_empty() && self.backend.tiles_read(&region, pixels)
    }

    /// Whether any voxel of a block can reach these pixels.
    pub(in crate::render) fn reaches(&self, block: usize, pixels: &TileRect) -> bool {
        let [x, y] = self.pixels_reached(&self.blocks.region(block));
        overlap(&x, &pixels.x) && overlap(&y, &pixels.y)
    }

    /// The columns and rows that any voxel of a region can reach.
    pub(in crate::render) fn pixels_reached(&self, region: &Region) -> [Range<usize>; 2] {
        let region = region.intersect(&self.clip);
        if region.is_empty() {
            return [0..0, 0..0];
        }
        self.backend.pixels_reached(&region, &self.grid, &self.camera, &self.footprint)
    }
}

/// An error if no weight is left at the depth of the nearest voxel.
fn check_attenuation(config: &RenderConfig, nearest: f64) -> Result<()> {
    if config.quantity == Quantity::Mean && config.kernel.tau * nearest > MOST_EXPONENT {
        let what = "all voxels of the region lie so deep that their weights are beyond numbers";
        return Err(Error::setting("tau", format!("{what} (tau {:e})", config.kernel.tau)));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::render::config::{Limit, Mode};
    use wavesplat_core::view::footprint::Kernel;

    /// The setup of a view of 128^3 voxels with the default settings.
    fn setup(azimuth: f64, elevation: f64, quantity: Quantity) -> ViewSetup {
        let grid = Grid::unit([128; 3]);
        let view = View { azimuth, elevation, roll: 0.0, size: [512; 2], scale: Some(2.3), center: None };
        let config = RenderConfig {
            mode: Mode::Projection,
            views: vec![view],
            kernel: Kernel::for_grid(&grid),
            quantity,
            frames: vec![0],
            paired: false,
            region: None,
            splat_error: 1e-3,
            fast: false,
            allowed: None,
            error: Limit::Certified,
            certify: false,
            memory: 1 << 29,
        };
        ViewSetup::new(&grid, BlockGrid::cubes(grid.dims, 32), &config, &view).expect("a valid view")
    }

    #[test]
    fn ordinary_views_take_the_lattice() {
        for (azimuth, elevation) in [(0.0, 0.0), (3.0, 2.0), (17.0, 11.0), (30.0, 30.0), (45.0, 35.26), (80.0, 70.0)] {
            for quantity in [Quantity::Mean, Quantity::Emission] {
                let setup = setup(azimuth, elevation, quantity);
                assert!(setup.backend.is_lattice() && setup.stated_error <= 1e-3, "{azimuth} {elevation} {quantity:?}");
            }
        }
    }
}
