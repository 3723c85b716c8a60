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

pub(super) mod layout;
pub(super) mod plane_values;
pub(super) mod read;
pub(super) mod overview;
pub(super) mod expectation;
pub(super) mod scene;
pub(super) mod driver;
pub(super) mod units;
pub(super) mod samples;
pub(super) mod sampled;
