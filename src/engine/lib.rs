//! Coefficient files: behind addresses, opened, written and rendered. The package `wavesplat` explains it, and is what
//! programs depend on.

pub mod remote;
pub mod file;
pub mod convert;
pub mod render;
