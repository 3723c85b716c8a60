//! What every other folder stands on: errors, progress, samples, grids, maps of files, and outputs that appear when they
//! are complete.
//!
//! Nothing here knows frames, coefficients or pictures. The modules are listed from the lowest to the highest; each uses
//! only those above it.

mod remedy;
pub mod error;
pub mod progress;
pub(crate) mod memory;
pub(crate) mod half;
pub mod sample;
pub mod grid;
pub mod mapped;
#[doc(hidden)]
pub mod output;
#[doc(hidden)]
pub mod npy;
