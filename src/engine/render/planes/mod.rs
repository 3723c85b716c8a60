//! Planes through the volume: where the rays of pixels meet them, and the samples there.
//!
//! A ray stops at the nearest plane that it meets within the volume. The value there is interpolated linearly between
//! the voxels around it. A plane ends half a voxel beyond the outermost voxels, whose samples it repeats there. A ray
//! within a plane does not meet it.
//!
//! ```text
//! hits    pure geometry: the nearest plane of a ray; the voxels around a place, and their weights
//! view    the planes of a view, block by block
//! batch   the pictures of a batch of frames; renderer: of all frames
//! ```

mod hits;
mod view;
mod batch;
mod renderer;

pub(super) use batch::PlanesPass;
pub use hits::{Hit, PlanesView, Taps};
pub(super) use renderer::Planes;
