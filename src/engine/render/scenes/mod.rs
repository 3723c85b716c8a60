//! The scenes that come with the library: a coefficient file, and the frames of an archive.
//!
//! A scene handles files, codes and samples, and selects the blocks of a frame batch ([`select`]). It knows nothing
//! about pixels.

mod select;
mod batch_plan;
mod coded;
mod needs;
mod overview;
mod coefficients;
mod frames;

pub use batch_plan::SplatSource;
pub use coefficients::CoefficientScene;
pub use frames::FrameScene;
