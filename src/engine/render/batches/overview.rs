//! An overview of a volume: every n-th voxel along each axis, in a few frames, in memory.
//!
//! Small pictures of an overview show the range of values of the archive's pictures, at a small part of their work.

use crate::render::config::RenderConfig;
use wavesplat_core::base::error::Result;
use wavesplat_core::base::grid::{BlockGrid, Grid, Region};
use wavesplat_core::view::camera::Camera;

/// How a volume is thinned: of each block the voxels at multiples of `stride` from its first, along each axis. Blocks
/// keep their numbers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Thinning {
    /// How the volume is cut into blocks.
    pub blocks: BlockGrid,
    /// A power of two.
    pub stride: usize,
}

impl Thinning {
    /// The number of voxels that are taken along an axis before position `at` of the volume.
    fn before(&self, axis: usize, at: usize) -> usize {
        let (edge, stride) = (self.blocks.edges[axis], self.stride);
        at / edge * edge.div_ceil(stride) + (at % edge).div_ceil(stride)
    }

    /// The voxels along an axis that are taken.
    pub(in crate::render) fn taken(&self, axis: usize) -> Vec<usize> {
        (0..self.blocks.dims[axis]).filter(|at| (at % self.blocks.edges[axis]).is_multiple_of(self.stride)).collect()
    }

    /// The voxels that are taken, cut into the same blocks.
    pub fn blocks(&self) -> BlockGrid {
        let dims = std::array::from_fn(|a| self.before(a, self.blocks.dims[a]));
        BlockGrid { dims, edges: self.blocks.edges.map(|edge| edge.div_ceil(self.stride)) }
    }

    /// A grid of the voxels that are taken: evenly spaced over the same part of the world.
    pub fn grid(&self, grid: &Grid) -> Grid {
        let dims = self.blocks().dims;
        let spacing = std::array::from_fn(|a| grid.spacing[a] * grid.dims[a] as f64 / dims[a] as f64);
        let origin = std::array::from_fn(|a| grid.origin[a] + (spacing[a] - grid.spacing[a]) / 2.0);
        Grid { dims, spacing, origin }
    }

    /// The region of the voxels that are taken from a region, at least one.
    pub fn region(&self, region: &Region) -> Region {
        let last = self.blocks().dims.map(|n| n - 1);
        let start = std::array::from_fn(|a| self.before(a, region.start[a]).min(last[a]));
        let end = std::array::from_fn(|a| self.before(a, region.end[a]).max(start[a] + 1));
        Region { start, end }
    }
}

/// A request for an overview.
#[derive(Debug, Clone, Copy)]
pub struct OverviewRequest<'a> {
    /// The voxels to take.
    pub thinning: Thinning,
    /// Frame numbers, ascending. A scene may take frames near them instead.
    pub frames: &'a [usize],
    /// Bytes of memory that blocks may share.
    pub memory: usize,
    /// The blocks that are needed are those that touch this region of the volume. Voxels of others may be NaN.
    pub region: Region,
}

impl OverviewRequest<'_> {
    /// The number of samples of one channel.
    pub fn samples(&self) -> usize {
        self.frames.len() * self.thinning.blocks().dims.iter().product::<usize>()
    }

    /// The index of the first sample of every row along x of a block, in a frame of an overview.
    pub(in crate::render) fn rows(&self, block: usize) -> impl Iterator<Item = usize> + use<> {
        let thinned = self.thinning.blocks();
        let (region, whole) = (thinned.region(block), Region { start: [0; 3], end: thinned.dims });
        region.rows().map(move |(y, z)| whole.index([region.start[0], y, z]))
    }
}

/// Distance of voxels in an overview for the views of `config`: the largest power of two at which neighbours are at most
/// `pixels` pixels apart in every view, and the region has some voxels along each axis. A flat volume may have one.
///
/// # Errors
/// Views that no camera can have.
pub fn stride(grid: &Grid, config: &RenderConfig, pixels: f64) -> Result<usize> {
    let scales = config.views.iter().map(|view| Ok(Camera::new(view, grid)?.scale)).collect::<Result<Vec<_>>>()?;
    let scale = scales.into_iter().fold(0.0, f64::max);
    let region = config.region.unwrap_or(grid.whole());
    let fits = |stride: &usize| {
        let spacing = grid.largest_spacing() * *stride as f64;
        spacing * scale <= pixels
            && spacing * config.kernel.tau <= LITTLE_FADING
            && (0..3).all(|a| grid.dims[a] == 1 || region.dims()[a] >= LEAST_VOXELS * stride)
    };
    Ok([2, 4, 8, 16, 32, 64].into_iter().take_while(fits).last().unwrap_or(1))
}

/// An overview has at least this many voxels along each axis of a region.
const LEAST_VOXELS: usize = 6;

/// The largest attenuation from a voxel of an overview to the next one, as an exponent.
const LITTLE_FADING: f64 = 0.5;
