//! The geometry of a view: where a voxel falls in the picture ([`camera`]), and what its kernel covers there
//! ([`footprint`]).
//!
//! Pure functions of numbers. Nothing here knows what is splatted, or how.

pub mod camera;
pub mod footprint;
