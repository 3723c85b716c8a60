//! Composites and maximum intensity projections, slab by slab: cuts the volume, computes the medium of a slab, and
//! blends slabs, by compositing or by their maximum.
//!
//! The volume is cut into slabs perpendicular to the view direction, as in image-aligned splatting
//! ([Mueller](crate::bibliography)). The functions here are pure; [`super::composite`] calls them.
//!
//! A slab takes the part of each voxel's kernel that lies in the slab. The kernel is a product of a Gaussian along the
//! ray and one across it, so the weight is the weight of the projection times a share of the Gaussian's integral (Phi
//! is the normal distribution):
//!
//! ```text
//! w_{i,slab} = w_i (Phi((far - z_i) / sigma) - Phi((near - z_i) / sigma))                                 (eq 29)
//! ```
//!
//! With these weights, a pixel of a slab has the length l = sum of w and the mean g = sum of w v / l. A maximum
//! intensity projection takes the largest g of all slabs. The light of a composite follows the emission-absorption
//! model of [Max](crate::bibliography):
//!
//! ```text
//! through = exp(-kappa(g) l)        kappa(v) = -ln(1 - opacity(v)) / unit                                 (eq 30)
//! light = sum over slabs of (product of through before) (1 - through) colour(g)                           (eq 31)
//! ```
//!
//! As slabs become thinner, the light converges to the integral along the ray through the field that the kernels
//! reconstruct from the samples. The error of every mean is at most the file's bound (eq 24).

pub(super) mod medium;
pub(super) mod blend;
pub(super) mod visible;
pub(super) mod cut;
pub(super) mod lengths;

pub(super) use cut::{Slabs, TOGETHER, bytes, count, cut, of_block};
