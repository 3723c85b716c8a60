//! The scenes that come with the library: a coefficient file, and the frames of an archive.
//!
//! A scene knows files, codes and samples, and decides which blocks a batch of frames reads ([`select`]). It knows
//! nothing of pixels.

mod select;
mod batch_plan;
mod coded;
mod coefficients;
mod frames;

pub use batch_plan::SplatSource;
pub use coefficients::CoefficientScene;
pub use frames::FrameScene;
