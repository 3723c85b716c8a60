//! The `.wspl` file and its safety: opening it, reporting its error bound, checking it, and recovering intact blocks.
//!
//! [`CoefficientFile`] is the only door to stored bytes. Nothing here codes samples (that is
//! [`crate::convert`]) or makes pictures (that is [`crate::render`]).

mod counted;
mod detail;
pub mod promise;
pub(crate) mod above;
mod budget;
mod damage;
mod decoded;
mod coefficient_file;
mod tiers;
mod fetch;
mod keep;
mod check;
mod skip;
pub mod shard;
pub mod report;
pub mod verify;
pub mod recover;
pub mod repack;
pub mod resume;
pub mod merge;

pub use coefficient_file::{CoefficientFile, time_labels, units};
pub(crate) use decoded::{BlockValues, DecodedBlock};
pub use fetch::Prefetch;
pub(crate) use keep::FramesDrawn;
pub use keep::SamplesOfBlock;
pub use promise::setting;
