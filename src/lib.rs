//! wavesplat.
pub mod error;
pub mod mapped;
pub mod sample;
pub mod source;
pub mod volume;
