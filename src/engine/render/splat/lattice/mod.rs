//! Splatting on a lattice: voxels add to the cells of the view's sheared lattice, instead of a footprint for each
//! voxel.
//!
//! ```text
//! values of a block, plane by plane     spread: to the cells around each voxel, by weights that are fitted
//! cells of a band of the picture        filtered: a short filter undoes the blur of spreading, and moves rows
//! filtered cells, columns upright       gather: to pixels, by the Gaussian footprint
//! ```
//!
//! This is the lattice of the shear-warp factorization ([Lacroute](wavesplat_core::bibliography)): the voxels of a slice
//! perpendicular to the principal axis are whole cells apart (eq 35, `shear`). So they all have the same weights, and a
//! block costs a few products per voxel, however wide footprints are in pixels. The cost of a pixel depends only on its
//! number of cells. Nonuniform Fourier transforms place samples on a grid in the same way: they spread by a bump and
//! correct for it afterwards (eq 36, `prefilter`; [Greengard](wavesplat_core::bibliography)). Here the filter is chosen first, and the
//! weights of voxels are fitted to it (eq 45, `fit`). `error` states by how much a pixel can be off.
//!
//! Each plane has one owner and adds blocks in a fixed order, so sums depend neither on threads nor on memory.

mod shear;
mod prefilter;
mod fit;
mod axis;
mod kernel;
mod error;
mod cells;
mod block_values;
mod spread;
mod filtered;
mod upright;
mod picture;
mod bundle;
mod two_passes;
mod gather;
#[cfg(test)]
mod tests;

pub(in crate::render) use cells::DoubleRoom;
pub(super) use cells::{CellPlane, Cells, Rectangle};
pub(super) use error::SliceError;
pub(in crate::render) use filtered::FilteredCells;
pub(super) use gather::Gather;
pub(in crate::render) use gather::Ones;
pub(super) use picture::{Lattice, SplattedView};
pub(in crate::render) use shear::Shear;
pub(super) use spread::{Placed, SpreadScratch};

use fit::{AxisFit, Spread};
use std::sync::OnceLock;

/// A way to spread voxels.
#[derive(Debug, Clone, Copy)]
struct Choice {
    /// Cells per voxel along an axis.
    fineness: usize,
    /// Cells that a voxel is spread to along an axis.
    width: usize,
    sums: Sums,
}

impl Choice {
    const fn new(fineness: usize, width: usize, sums: Sums) -> Self {
        Self { fineness, width, sums }
    }
}

/// The type of the sums of cells.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Sums {
    /// f32, for values of ordinary size.
    Single,
    /// f64.
    Double,
}

impl Sums {
    /// Positions between two cells for which the weights of pixels are tabulated.
    fn phases(self) -> usize {
        match self {
            Self::Single => 256,
            Self::Double => 1024,
        }
    }
}

/// How values are spread over the cells of a view.
#[derive(Debug)]
struct Spreading {
    shear: Shear,
    sums: Sums,
    /// The weights and prefilters along u and v.
    fits: [AxisFit; 2],
    tau: f64,
    /// Slices of the grid.
    slices: usize,
    /// For each slice, the cells along u and v of its voxel that is the first along b and c; empty until needed.
    spreads: OnceLock<[Vec<Spread>; 2]>,
}

impl Spreading {
    /// Spreads voxels for a Gaussian with these standard deviations in cells. The grid has `slices` slices.
    fn new(shear: Shear, choice: Choice, sigmas: [f64; 2], tau: f64, slices: usize) -> Self {
        let fits = sigmas.map(|sigma| AxisFit::new(choice.width, sigma));
        Self { shear, sums: choice.sums, fits, tau, slices, spreads: OnceLock::new() }
    }

    /// Cells that a voxel is spread to along an axis.
    fn width(&self) -> usize {
        self.fits[0].width
    }

    /// The cells along u and v that a voxel is spread to.
    fn spread(&self, voxel: [usize; 3]) -> [Spread; 2] {
        let slice = voxel[self.shear.axes[2]];
        let spreads = self.spreads.get_or_init(|| {
            [0, 1].map(|i| (0..self.slices).map(|slice| self.fits[i].at(self.position(i, slice))).collect())
        });
        [0, 1].map(|i| {
            let Spread { first, weights } = spreads[i][slice];
            Spread { first: first + self.cells_before(i, voxel), weights }
        })
    }

    /// The first cells along u and v that a voxel is spread to.
    fn first(&self, voxel: [usize; 3]) -> [isize; 2] {
        let slice = voxel[self.shear.axes[2]];
        [0, 1].map(|i| self.fits[i].first(self.position(i, slice)) + self.cells_before(i, voxel))
    }

    /// The position of a slice's first voxel along u (0) or v (1), in cells.
    fn position(&self, i: usize, slice: usize) -> f64 {
        self.shear.fineness as f64 * self.shear.slopes[i] * slice as f64
    }

    /// Cells along u (0) or v (1) from the first voxel of a slice to another one.
    fn cells_before(&self, i: usize, voxel: [usize; 3]) -> isize {
        (self.shear.fineness * voxel[self.shear.axes[i]]) as isize
    }
}
