//! The planes of a frame batch in slabs: the batch's own planes, and one of the ray lengths l (eq 30).

use crate::base::error::Result;
use crate::base::grid::BlockGrid;
use crate::render::layout::Layout;
use crate::render::plane_values::{BlockPlanes, BlockSource, PlaneValues, Scratch, UnitValues};
use crate::render::scene::{FrameBatch, Inverse};
use crate::render::splat::ViewSetup;
use crate::wavelet::Lane;
use std::collections::HashSet;

/// The blocks of a batch with one more plane, which holds the weights of all their voxels.
pub(in crate::render) struct WithLengths<'a> {
    batch: &'a dyn FrameBatch,
    pub(in crate::render) layout: Layout,
    blocks: BlockGrid,
    /// The selected blocks, which have values.
    with_terms: HashSet<usize>,
}

impl<'a> WithLengths<'a> {
    pub(in crate::render) fn new(batch: &'a dyn FrameBatch, setup: &ViewSetup) -> Self {
        let layout = Layout { lengths: true, ..batch.layout() };
        let with_terms = batch.selection().blocks.iter().copied().collect();
        Self { batch, layout, blocks: setup.blocks, with_terms }
    }

    /// The layers of a tile. `used` lists the planes that may have sums, counted through all layers.
    pub(in crate::render) fn layers(&self, used: &[usize], layers: usize) -> Vec<Layer<'_>> {
        let count = self.layout.planes();
        let layer = |n: usize| {
            let used: Vec<usize> =
                used.iter().filter(|plane| **plane / count == n).map(|plane| plane % count).collect();
            let inverse = (!used.is_empty()).then(|| self.batch.inverse(&used));
            Layer { layout: self.layout, inverse, frames: vec![Lane::default(); self.layout.frames] }
        };
        (0..layers).map(layer).collect()
    }
}

/// A slab of a tile.
pub(in crate::render) struct Layer<'a> {
    layout: Layout,
    /// `None` if all sums are zero.
    inverse: Option<Box<Inverse<'a>>>,
    frames: Vec<Lane>,
}

impl Layer<'_> {
    /// Calls `each(frame, sums, lengths)` for all frames at some pixels. Overwrites their planes.
    pub(in crate::render) fn means(&mut self, planes: &mut [Lane], mut each: impl FnMut(usize, &Lane, &Lane)) {
        let Self { layout, inverse: Some(inverse), frames } = self else { return };
        let lengths = lengths(layout, planes);
        if lengths.iter().flatten().all(|length| *length <= 0.0) {
            return;
        }
        inverse(planes, frames);
        frames.iter().zip(&lengths).enumerate().for_each(|(f, (sums, lengths))| each(f, sums, lengths));
    }
}

/// For each frame, the ray lengths at some pixels without missing samples.
fn lengths(layout: &Layout, planes: &[Lane]) -> Vec<Lane> {
    let all = planes[layout.planes() - 1];
    if !layout.absent {
        return vec![all; layout.frames];
    }
    let in_all = planes[layout.absent_in_all()];
    let of_frame = |f: usize| {
        let absent = planes[layout.absent(f)];
        std::array::from_fn(|l| all[l] - absent[l] - in_all[l])
    };
    (0..layout.frames).map(of_frame).collect()
}

impl BlockSource for WithLengths<'_> {
    fn fetch(&self, blocks: &[usize]) -> Result<()> {
        let with_terms: Vec<usize> = blocks.iter().copied().filter(|block| self.with_terms.contains(block)).collect();
        self.batch.fetch(&with_terms)
    }

    fn planes(&self, block: usize) -> Result<Box<dyn BlockPlanes + '_>> {
        let planes = self.with_terms.contains(&block).then(|| self.batch.planes(block)).transpose()?;
        let ones = UnitValues(self.blocks.region(block).voxels());
        Ok(Box::new(BlockWithLengths { planes, ones, last: self.layout.planes() - 1 }))
    }
}

/// A block with a 1 for each of its voxels in the last plane.
struct BlockWithLengths<'a> {
    planes: Option<Box<dyn BlockPlanes + 'a>>,
    ones: UnitValues,
    last: usize,
}

impl BlockPlanes for BlockWithLengths<'_> {
    fn voxels(&self) -> usize {
        self.ones.voxels()
    }

    fn plane<'a>(&'a self, plane: usize, scratch: &'a mut Scratch) -> Result<PlaneValues<'a>> {
        match &self.planes {
            _ if plane == self.last => self.ones.plane(plane, scratch),
            Some(planes) => planes.plane(plane, scratch),
            None => Ok(PlaneValues::Nothing),
        }
    }

    fn held(&self) -> [u64; 2] {
        self.planes.as_ref().map_or([0; 2], |planes| planes.held())
    }
}
