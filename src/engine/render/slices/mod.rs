//! Composites, isosurfaces and maximum intensity projections, slice by slice: the field of the kernels along the rays of a lattice.
//!
//! The field at a point p is the mean of the samples, weighted by the kernel, which is a Gaussian; its density is the
//! sum of the weights:
//!
//! ```text
//! g(p) = sum of h(p - p_i) v_i / density(p)        density(p) = sum of h(p - p_i)                         (eq 29)
//! ```
//!
//! A ray is sampled where it crosses slices across the principal axis, which is the axis closest to it. With
//! l = density times the distance of two slices along the ray, a slice lets this part of the light through, and adds
//! its own light ([Max](wavesplat_core::bibliography)):
//!
//! ```text
//! through = exp(-kappa(g) l)        kappa(v) = -ln(1 - opacity(v)) / unit                                 (eq 30)
//! light = sum over slices of (product of through before) (1 - through) colour(g)                          (eq 31)
//! ```
//!
//! A maximum intensity projection takes the largest g of all slices. An isosurface is where g passes a value between two
//! slices.
//!
//! The rays do not go through pixels. They go through the cells of the view's sheared lattice ([Lacroute](wavesplat_core::bibliography), eq
//! 35), where all voxels of a slice are at the same distances from the cells. So the kernel is three short filters, one
//! along each axis, with the same weights for a whole row; and the pixels are interpolated from the finished cells,
//! once for each frame. The data go this way:
//!
//! ```text
//! blocks, a layer at a time       samples in table units           needed: blocks that may be visible
//!   voxel layers of a frame       layer, bricks                    front to back, a few at a time
//!     slab                        view, sweep                      as one slice where light hardly changes, else its slices
//!     slice: sums along a         filter                           6 layers with the default kernel
//!       phases: sums along b      filter                           whole rows
//!         rows: sums along c      filter, row                      16 cells at a time
//!           blend                 blend, iso, mip, table, shade    light and transmittance, or the largest
//! cells to pixels                 finish                           4 x 4 cells
//! ```
//!
//! With sharp opacities, slabs of at most a voxel have several slices. Where the values of a group of cells hardly change
//! from slab to slab, one slice of the slab's thickness takes their place.
//!
//! Certified composites and isosurfaces are swept twice: first they are drawn, then the errors of their pixels are bounded
//! ([`certificate`], eq 49; [`iso_certificate`], eq 50).
//!
//! Bricks and blocks are skipped if no value between their least and largest is visible, and cells that are opaque.
//! Each cell is computed in the same way whatever the number of threads, bands, frames and blocks in memory.

mod table;
mod taps;
mod view;
mod filter;
mod stops;
mod bricks;
mod layer;
mod row;
mod shade;
mod blend;
mod cover;
mod cover_bounds;
mod iso;
mod mip;
mod steepest;
mod sweep;
mod finish;
mod probe;
mod needed;
mod batch;
mod field_errors;
mod certificate;
mod iso_certificate;
mod renderer;

#[cfg(test)]
mod tests;

pub(super) use blend::Composite;
pub(super) use iso::Isosurfaces;
pub(super) use mip::Largest;
pub(super) use renderer::Sliced;

/// Cells that are computed together; also the voxels along b of a brick.
const GROUP: usize = 16;
/// Voxels along c of a brick.
const BRICK_ROWS: usize = 8;
/// Where the density is less, slices have no value in any mode.
const LEAST: f32 = 1e-3;
