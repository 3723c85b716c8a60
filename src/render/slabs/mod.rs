//! The volume in slabs across the view: how it is cut, what a slab holds, and how slabs blend along a ray.
//!
//! A slab takes of each voxel what of its kernel lies in the slab: the kernel is a product of one along the ray and one
//! across it, so a weight is that of the projection times a share of a Gaussian's integral ([`Slab`]). With w those weights and
//! v the samples, a pixel of a slab has the length l = sum w and the mean g = sum w v / l, and
//!
//! ```text
//! T = exp(-kappa(g) l)       kappa(v) = -ln(1 - opacity(v)) / unit
//! ```
//!
//! is what it lets through. As slabs become thinner that tends to the integral along the ray through the field that the kernels
//! make of the samples. Every mean is off by no more than the file's bound.
//!
//! Pure functions of numbers; [`super::composite`] drives them.

pub(super) mod medium;
pub(super) mod blend;
pub(super) mod visible;
pub(super) mod cut;
pub(super) mod lengths;

pub(super) use cut::{Slabs, TOGETHER, bytes, count, cut, of_block};
