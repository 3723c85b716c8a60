//! The parts that all other folders use: errors, progress, samples, grids, mapped files and output files.
//!
//! Nothing here depends on frames, coefficients or pictures. A module uses only those listed above it.

#[doc(hidden)]
pub mod system;
mod remedy;
pub mod error;
pub mod progress;
pub mod cancel;
pub mod choice;
pub mod memory;
pub mod workers;
pub mod vectors;
pub mod zeroed;
#[doc(hidden)]
pub mod files;
#[doc(hidden)]
pub mod temporary;
#[doc(hidden)]
pub mod text;
pub(crate) mod half;
mod calendar;
pub(crate) mod clock;
pub mod decimal;
pub mod address;
#[doc(hidden)]
pub mod time_labels;
pub mod sample;
pub mod stored;
pub mod grid;
pub mod values;
pub mod position;
pub mod description;
pub mod mapped;
#[doc(hidden)]
pub mod output;
pub mod inputs;
#[doc(hidden)]
pub mod npy;
