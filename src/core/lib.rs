//! The parts of wavesplat that everything else uses. The package `wavesplat` explains them, and is what programs depend on.

pub mod base;
pub mod colour;
pub mod source;
pub mod wavelet;
pub mod codec;
pub mod view;
#[doc = include_str!("bibliography.md")]
pub mod bibliography {}
