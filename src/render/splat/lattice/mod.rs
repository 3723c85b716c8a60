//! Splatting on a lattice: voxels add to the cells of the view's sheared lattice, instead of a footprint for each
//! voxel.
//!
//! ```text
//! values of a block, plane by plane     spread: to the cells around each voxel, by B-splines
//! cells of a band of the picture        gather: to pixels, by the kernel that turns B-splines into Gaussians
//! ```
//!
//! This is the lattice of the shear-warp factorization ([Lacroute](crate::bibliography)): the voxels of a slice
//! perpendicular to the principal axis are whole cells apart (eq 35, `shear`). So they all have the same weights, and a
//! block costs a few products per voxel, however wide footprints are in pixels. The cost of a pixel depends only on its
//! number of cells. Nonuniform Fourier transforms place samples on a grid in the same way: they spread by splines and
//! correct for the splines afterwards (eq 36, `kernel`; [Greengard](crate::bibliography)).
//!
//! Each plane has one owner and adds blocks in file order, so sums depend neither on threads nor on memory.

mod cells;
mod gather;
mod kernel;
mod picture;
mod shear;
mod spline;
mod spread;
#[cfg(test)]
mod tests;

pub(super) use cells::{CellPlane, Cells, Rectangle};
pub(super) use gather::Gather;
pub(super) use picture::Lattice;
pub(in crate::render) use shear::Shear;
pub(super) use spread::{Placed, Work};

/// How values are spread over the cells of a view.
#[derive(Debug, Clone, Copy)]
struct Spreading {
    shear: Shear,
    /// Degree of the B-splines; odd.
    degree: usize,
    tau: f64,
}
