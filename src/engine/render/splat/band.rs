//! Bands of pictures, into which blocks are splatted in file order.

use super::view_setup::ViewSetup;
use crate::render::batches::{BlockAdder, BlockReader, ReadStats};
use std::ops::Range;
use wavesplat_core::base::error::Result;

/// A band of rows of a view's picture.
#[derive(Clone)]
pub(super) struct Band<'a> {
    pub(super) setup: &'a ViewSetup,
    pub(super) rows: Range<usize>,
}

impl Band<'_> {
    /// Whether a block must be splatted into this band: the picture sees it, and the band needs it.
    pub(super) fn sees(&self, block: usize) -> bool {
        let whole = 0..self.setup.camera.size[1];
        self.setup.sees(block, &whole) && (self.rows == whole || self.setup.needs(block, &self.rows))
    }
}

/// Bands of several views that one backend splats together, so that a block is decoded once for all.
pub(super) trait BandGroup: BlockAdder {
    /// The bands.
    fn bands(&self) -> &[Band<'_>];
}

/// Splats the blocks that reach any band, in order. Ends early if the group is full.
pub(super) fn splat_into(group: &mut impl BandGroup, blocks: &[usize], reader: &BlockReader<'_>) -> Result<ReadStats> {
    let is_visible = |block: &usize| group.bands().iter().any(|band| band.sees(*block));
    let visible: Vec<usize> = blocks.iter().copied().filter(is_visible).collect();
    reader.read(&visible, group)
}
