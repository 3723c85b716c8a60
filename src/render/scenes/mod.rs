//! The scenes that come with the library: a coefficient file, and the frames of an archive.
//!
//! A scene knows files, codes and samples, and decides which blocks a batch of frames reads ([`select`]). It knows nothing
//! of pixels.

mod select;
mod coded;
mod coefficients;
mod frames;

pub use coefficients::{CoefficientScene, SplatSource};
pub use frames::FrameScene;
