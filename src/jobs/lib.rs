//! What users ask for, resolved and carried out. The package `wavesplat` explains it, and is what programs depend on.

pub mod extract;
pub mod picture;
