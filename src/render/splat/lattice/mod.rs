//! Voxels to pictures without a footprint for each of them: planes of sums on the sheared lattice of the view.
//!
//! ```text
//! amounts of a block, plane by plane    spread: to the cells around each voxel, by B-splines
//! cells of a band of the picture        gather: to pixels, by the kernel that makes Gaussians of B-splines
//! ```
//!
//! Voxels of a slice across the principal axis are whole cells apart ([`shear`]), so that all of them have the same weights, and
//! a block costs a few products for each voxel, however wide footprints are in pixels. What a pixel costs depends on its
//! cells alone.
//!
//! Each plane has one owner and meets blocks in file order, so that sums depend neither on threads nor on memory.

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
