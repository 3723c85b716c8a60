//! Splatting on a lattice: voxels add to the cells of the view's sheared lattice, instead of a footprint for each
//! voxel.
//!
//! ```text
//! values of a block, plane by plane     spread: to the cells around each voxel, by B-splines
//! cells of a band of the picture        filtered: a short filter undoes the blur of the B-splines
//! filtered cells of a tile              gather: to pixels, by the Gaussian footprint
//! ```
//!
//! This is the lattice of the shear-warp factorization ([Lacroute](wavesplat_core::bibliography)): the voxels of a slice
//! perpendicular to the principal axis are whole cells apart (eq 35, `shear`). So they all have the same weights, and a
//! block costs a few products per voxel, however wide footprints are in pixels. The cost of a pixel depends only on its
//! number of cells. Nonuniform Fourier transforms place samples on a grid in the same way: they spread by splines and
//! correct for the splines afterwards (eq 36, `prefilter`; [Greengard](wavesplat_core::bibliography)). `error` states by how much
//! a pixel can be off.
//!
//! Each plane has one owner and adds blocks in file order, so sums depend neither on threads nor on memory.

mod shear;
mod spline;
mod prefilter;
mod axis;
mod kernel;
mod error;
mod cells;
mod block_values;
mod spread;
mod filtered;
mod product;
mod picture;
mod bundle;
mod one_pass;
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

/// How values are spread over the cells of a view.
#[derive(Debug, Clone, Copy)]
struct Spreading {
    shear: Shear,
    /// Degree of the B-splines.
    degree: usize,
    tau: f64,
}
