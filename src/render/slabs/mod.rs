//! Colour and opacity along the rays, slab by slab: how the volume is cut, what a slab holds, and how slabs blend.
//!
//! The volume is cut into slabs across the view direction, as in image-aligned splatting
//! ([Mueller](crate::bibliography)). Pure functions of numbers; [`super::composite`] drives them.
//!
//! A slab takes of each voxel the part of its kernel that lies in the slab. The kernel is a product of a Gaussian along
//! the ray and one across it, so the weight is that of the projection times a share of the Gaussian's integral (Phi is
//! the normal distribution):
//!
//! ```text
//! w_{i,slab} = w_i (Phi((far - z_i) / sigma) - Phi((near - z_i) / sigma))                                 (eq 29)
//! ```
//!
//! With these weights, a pixel of a slab has the length l = sum of w and the mean g = sum of w v / l. Its light is that
//! of the emission-absorption model of [Max](crate::bibliography):
//!
//! ```text
//! through = exp(-kappa(g) l)        kappa(v) = -ln(1 - opacity(v)) / unit                                 (eq 30)
//! light = sum over slabs of (product of through before) (1 - through) colour(g)                           (eq 31)
//! ```
//!
//! As slabs become thinner, that tends to the integral along the ray through the field that the kernels make of the
//! samples. Every mean is off by no more than the file's bound (eq 24).

pub(super) mod medium;
pub(super) mod blend;
pub(super) mod visible;
pub(super) mod cut;
pub(super) mod lengths;

pub(super) use cut::{Slabs, TOGETHER, bytes, count, cut, of_block};
