//! The interface to the splat backends: chooses the backend of a view, and answers questions about it.
//!
//! [`SplatBackend::choose`] decides once per view. The rest of the renderer asks the backend for numbers (pixels
//! reached, tile sizes, memory) and hands it blocks through [`super::accumulator`].

use super::lattice::{Lattice, SliceError, SplattedView};
use super::tile_rect::{TILE, TileRect, pixels_reached};
use crate::render::config::{BACKGROUND, Quantity, RenderConfig, most_splat_error, splat_method};
use std::ops::Range;
use std::sync::Arc;
use wavesplat_core::base::grid::{Grid, Region};
use wavesplat_core::view::camera::Camera;
use wavesplat_core::view::footprint::{Footprint, Method};

/// The way in which voxels become pixels.
#[derive(Debug, Clone)]
pub(in crate::render) enum SplatBackend {
    /// Every voxel adds its footprint to the pixels that it covers.
    Footprints,
    /// Voxels are spread to the cells of the view's sheared lattice, and pixels gather from the cells.
    Lattice(Arc<Lattice>),
}

/// The footprints of a view at the configured splat error.
///
/// For certified pictures, the cut is tighter, because weights may be as small as the background threshold.
pub(super) fn footprint_method(config: &RenderConfig) -> Method {
    let share = if config.certify && config.quantity == Quantity::Mean { BACKGROUND } else { 1.0 };
    splat_method(config.quantity, share * config.splat_error)
}

impl SplatBackend {
    /// Chooses the backend of a view, and the method named in reports. Certified pictures take footprints. `slices` is
    /// the largest number of slices that a ray meets, in units of the largest sum of weights in the picture.
    pub(super) fn choose(config: &RenderConfig, view: &SplattedView<'_>, slices: f64) -> (Self, Method) {
        let error = most_splat_error(config.quantity, config.splat_error);
        let stated = |slice: SliceError| match config.quantity {
            Quantity::Mean => slices * slice.of_a_mean(),
            Quantity::Emission => slices * slice.sum,
        };
        let estimated = |slice: SliceError| match config.quantity {
            Quantity::Mean => slices * slice.of_a_smooth_mean(),
            Quantity::Emission => slices * slice.of_waves,
        };
        let lattice = || match config.fast {
            true => Lattice::fast(view, estimated),
            false => Lattice::within(error, view, stated),
        };
        match (!config.certify).then(lattice).flatten() {
            Some((lattice, method)) => (Self::Lattice(Arc::new(lattice)), method),
            None => (Self::Footprints, footprint_method(config)),
        }
    }

    /// Whether voxels are spread to cells.
    pub(in crate::render) fn is_lattice(&self) -> bool {
        matches!(self, Self::Lattice(_))
    }

    /// Width and height of a tile in pixels.
    pub(in crate::render) fn tile(&self) -> [usize; 2] {
        match self {
            Self::Footprints => [TILE; 2],
            Self::Lattice(lattice) => lattice.tile(),
        }
    }

    /// The columns and rows that any voxel of a region can reach.
    pub(super) fn pixels_reached(
        &self,
        region: &Region,
        grid: &Grid,
        camera: &Camera,
        footprint: &Footprint,
    ) -> [Range<usize>; 2] {
        match self {
            Self::Footprints => pixels_reached(region, grid, camera, footprint),
            Self::Lattice(lattice) => lattice.pixels_reached(region, camera.size),
        }
    }

    /// Whether the tiles of these pixels read sums that voxels of a region add to.
    pub(super) fn tiles_read(&self, region: &Region, pixels: &TileRect) -> bool {
        match self {
            Self::Footprints => false, // every sum belongs to a pixel
            Self::Lattice(lattice) => lattice.tiles_read(region, pixels),
        }
    }

    /// An upper bound of the bytes for `planes` planes in a band of `size` pixels, without [`Self::double_bytes`].
    pub(in crate::render) fn band_bytes(&self, size: [usize; 2], planes: usize) -> usize {
        match self {
            Self::Footprints => planes * size[0] * size[1].next_multiple_of(TILE) * size_of::<f64>(),
            Self::Lattice(lattice) => lattice.band_bytes(size, planes),
        }
    }

    /// An upper bound of the bytes that a thread that gathers a tile copies of a plane with sums in f64.
    pub(in crate::render) fn copied_bytes(&self) -> usize {
        match self {
            Self::Footprints => 0,
            Self::Lattice(lattice) => lattice.copied_bytes(),
        }
    }

    /// An upper bound of the bytes that a plane of a band takes in addition if it needs sums in f64.
    pub(in crate::render) fn double_bytes(&self, size: [usize; 2]) -> usize {
        match self {
            Self::Footprints => 0,
            Self::Lattice(lattice) => lattice.double_bytes(size),
        }
    }

    /// An upper bound of the bytes for the cells of ones of the whole picture, which a lattice keeps.
    pub(in crate::render) fn ones_bytes(&self, size: [usize; 2]) -> usize {
        match self {
            Self::Footprints => 0,
            Self::Lattice(lattice) => lattice.plane_bytes(size),
        }
    }

    /// An upper bound of the bytes to make these cells, in addition to them.
    pub(in crate::render) fn bytes_while_ones(&self, size: [usize; 2]) -> usize {
        match self {
            Self::Footprints => 0,
            Self::Lattice(lattice) => lattice.band_bytes(size, 1) + lattice.plane_bytes(size),
        }
    }

    /// The f64 numbers that may be kept with a block while it is splatted.
    pub(in crate::render) fn kept(&self, block: &Region) -> usize {
        match self {
            Self::Footprints => 0,
            Self::Lattice(lattice) => lattice.block_cells(block),
        }
    }

    /// The f64 numbers that a thread holds while it splats a block, or gathers a tile of `planes` planes, without
    /// [`Self::copied_bytes`].
    pub(in crate::render) fn scratch(&self, block: &Region, planes: usize) -> usize {
        match self {
            Self::Footprints => 0,
            Self::Lattice(lattice) => lattice.scratch(block, planes),
        }
    }
}
