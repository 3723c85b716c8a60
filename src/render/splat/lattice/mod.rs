//! Splatting by way of a lattice: planes of sums on the sheared lattice of the view, instead of a footprint for each
//! voxel.
//!
//! ```text
//! amounts of a block, plane by plane    spread: to the cells around each voxel, by B-splines
//! cells of a band of the picture        gather: to pixels, by the kernel that makes Gaussians of B-splines
//! ```
//!
//! The lattice is that of the shear-warp factorization ([Lacroute](crate::bibliography)): the voxels of a slice across
//! the principal axis are whole cells apart (eq 35, `shear`). So they all have the same weights, and a block costs a
//! few products a voxel, however wide footprints are in pixels. A pixel's cost depends on its cells alone. Spreading by
//! splines and correcting for them afterwards (eq 36, `kernel`) is how nonuniform Fourier transforms place samples on a
//! grid ([Greengard](crate::bibliography)).
//!
//! Each plane has one owner and meets blocks in file order, so sums depend neither on threads nor on memory.

mod cells;
mod gather;
mod kernel;
mod picture;
mod shares;
mod shear;
mod spline;
mod spread;
#[cfg(test)]
mod tests;

pub(super) use cells::{CellPlane, Cells, Rectangle};
pub(super) use gather::Gather;
pub(super) use picture::Lattice;
pub(super) use shear::Shear;
pub(super) use spread::{Placed, Work};

/// How amounts are spread over the cells of a view.
#[derive(Debug, Clone, Copy)]
struct Spreading {
    shear: Shear,
    /// Of the B-splines; odd.
    degree: usize,
    tau: f64,
}
