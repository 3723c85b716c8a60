//! What needs both coefficient files and the formats of others: requests for pictures, resolved and carried out, and
//! extraction. The package `wavesplat` explains it, and is what programs depend on.

pub mod report;
mod units;
pub mod axes;
pub mod extract;
pub mod picture;
