//! Turns values of voxels into sums of pixels: the geometry of a view's picture, the two backends, and the bands that
//! they fill.
//!
//! ```text
//! a view            view_setup: camera, kernel, voxels to splat; backend: footprints or lattice, chosen once
//! a block           plane values, from a scene                                      (read by workers)
//!   footprints      sparse_terms -> footprints: each voxel's footprint into the tiles of the band
//!   lattice         lattice_bands -> lattice: spread to cells, plane by plane
//! a tile            accumulator: its planes, pixel by pixel, for [`super::projection`] to invert
//! ```
//!
//! These modules know neither the meaning of planes nor the source of blocks.

pub(super) mod tile_rect;
pub(super) mod lattice;
pub(super) mod backend;
pub(super) mod reference_weights;
mod view_setup;
pub(super) mod sparse_terms;
mod band;
pub(super) mod footprints;
mod lattice_bands;
pub(super) mod accumulator;

pub(super) use accumulator::{BandAccumulator, Pixels, ResolvedTile, splat};
pub(in crate::render) use lattice::{DoubleRoom, FilteredCells, Ones};
pub(super) use view_setup::ViewSetup;
