//! A scene that the library does not know: values from a formula.

use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};
use wavesplat::Result;
use wavesplat::base::grid::{BlockGrid, Grid, Region};
use wavesplat::render::{
    BatchOutcome, BatchRequest, BlockPlanes, FrameBatch, Inverse, Layout, PlaneValues, RenderConfig, SampleErrors,
    Scene, Scratch, Selection,
};

/// The value of a voxel in a frame.
pub(crate) type Formula = fn(usize, [usize; 3]) -> f64;

/// A scene of one window, which counts the blocks that are read.
pub(crate) struct FormulaScene {
    pub(crate) grid: Grid,
    /// Voxels of a block along each axis.
    pub(crate) edge: usize,
    pub(crate) frames: usize,
    /// The values: `offset` plus the formula.
    pub(crate) formula: Formula,
    pub(crate) offset: f64,
    /// Whether there are as many planes without values, as of a file with few outliers.
    pub(crate) with_empty_planes: bool,
    pub(crate) read: AtomicUsize,
}

impl Scene for FormulaScene {
    fn grid(&self) -> &Grid {
        &self.grid
    }

    fn blocks(&self) -> BlockGrid {
        BlockGrid::cubes(self.grid.dims, self.edge)
    }

    fn frames(&self) -> Option<usize> {
        Some(self.frames)
    }

    fn batch_end(&self, _frame: usize) -> usize {
        self.frames
    }

    fn most_planes(&self, frames: usize, _config: &RenderConfig) -> usize {
        if self.with_empty_planes { 2 * frames } else { frames }
    }

    /// As of a decoded block: coefficients in f32 and values in f64.
    fn block_bytes(&self, _frames: usize, _config: &RenderConfig) -> usize {
        self.blocks().region(0).voxels() * self.frames * (size_of::<f32>() + size_of::<f64>())
    }

    fn open<'a>(&'a mut self, request: &BatchRequest<'a>) -> Result<Box<dyn FrameBatch + 'a>> {
        let selection = Selection::of_all(self.blocks(), request);
        Ok(Box::new(Batch { scene: self, frames: request.frames, selection, errors: SampleErrors::default() }))
    }
}

struct Batch<'a> {
    scene: &'a FormulaScene,
    frames: &'a [usize],
    selection: Selection,
    errors: SampleErrors,
}

impl FrameBatch for Batch<'_> {
    fn layout(&self) -> Layout {
        let values = Layout::of_values(self.frames.len());
        let coefficients = if self.scene.with_empty_planes { self.frames.len() } else { 0 };
        Layout { coefficients, ..values }
    }

    fn selection(&self) -> &Selection {
        &self.selection
    }

    fn planes(&self, block: usize) -> Result<Box<dyn BlockPlanes + '_>> {
        self.scene.read.fetch_add(1, Relaxed);
        Ok(Box::new(Block { batch: self, region: self.scene.blocks().region(block) }))
    }

    fn inverse(&self, _used: &[usize]) -> Box<Inverse<'_>> {
        Box::new(|planes, frames| frames.copy_from_slice(&planes[..frames.len()]))
    }

    fn errors(&self) -> &SampleErrors {
        &self.errors
    }

    fn finish(&self) -> Result<BatchOutcome> {
        Ok(BatchOutcome::Complete)
    }
}

struct Block<'a> {
    batch: &'a Batch<'a>,
    region: Region,
}

impl BlockPlanes for Block<'_> {
    fn voxels(&self) -> usize {
        self.region.voxels()
    }

    fn plane<'a>(&'a self, plane: usize, scratch: &'a mut Scratch) -> Result<PlaneValues<'a>> {
        let Batch { scene, frames, .. } = self.batch;
        let Some(frame) = frames.get(plane) else { return Ok(PlaneValues::Nothing) };
        let values = scratch.values(self.voxels());
        let voxels = values.iter_mut().zip(self.region.iter());
        voxels.for_each(|(out, voxel)| *out = scene.offset + (scene.formula)(*frame, voxel));
        Ok(PlaneValues::Double(values))
    }

    fn held(&self) -> [u64; 2] {
        [0; 2]
    }
}
