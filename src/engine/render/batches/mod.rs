//! Frame batches: the data of a scene, as planes of blocks, and the loop over them.
//!
//! ```text
//! layout         the planes of a batch; plane_values: a block's values, plane by plane
//! read           blocks in order, some at a time
//! overview       single samples of a few frames, for a first impression
//! expectation    the effect of block errors on the pixels of a view
//! scene          the source of blocks: a frame batch and the blocks selected for it
//! driver         the loop over frame batches
//! samples        the samples of blocks in every frame, in some units; sampled: the modes that need them
//! ```

mod layout;
mod plane_values;
mod read;
mod overview;
mod expectation;
mod scene;
mod driver;
mod units;
mod samples;
mod sampled;

pub(super) use driver::{Job, RenderedBatch, Share, for_each_batch, in_batch};
pub use expectation::Expectation;
pub(super) use expectation::{BlockInfluence, ViewWeights, alike};
pub use layout::{Layout, Order};
pub use overview::{OverviewRequest, Thinning, stride};
pub(super) use plane_values::UnitValues;
pub use plane_values::{BlockPlanes, PlaneValues, Scratch};
pub(super) use read::{BlockAdder, BlockReader, BlockSource, ReadStats};
pub(super) use sampled::SampledView;
pub(super) use samples::{BlockSamples, SampleReader};
pub(super) use scene::INVERSE;
pub use scene::{BatchOutcome, BatchRequest, BlockBytes, BlockRange, FrameBatch, FrameBounds};
pub use scene::{Inverse, SampleErrors, Scene, Selection};
pub(super) use units::Units;
