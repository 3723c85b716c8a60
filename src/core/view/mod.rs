//! The geometry of a view: projects voxels into the picture ([`camera`]), and computes the footprint of their kernel
//! there ([`footprint`]).
//!
//! All functions are pure and independent of the data and of the splat backend.

pub mod camera;
pub mod footprint;
