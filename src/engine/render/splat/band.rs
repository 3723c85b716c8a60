//! Bands of pictures, into which blocks are splatted in a fixed order.

use super::tile_rect::TileRect;
use super::view_setup::ViewSetup;
use crate::render::batches::{BlockAdder, BlockReader, ReadStats};
use wavesplat_core::base::error::Result;

/// A band of a view's picture: a rectangle of its pixels.
#[derive(Clone)]
pub(super) struct Band<'a> {
    pub(super) setup: &'a ViewSetup,
    pub(super) rect: TileRect,
}

impl Band<'_> {
    /// Whether a block must be splatted into this band: the picture sees it, and the band needs it.
    pub(super) fn sees(&self, block: usize) -> bool {
        let is_whole = self.rect == TileRect::whole(self.setup.camera.size);
        self.setup.sees(block) && (is_whole || self.setup.needs(block, &self.rect))
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
