//! Projections decode each block once if the default memory allows it, plan no more than they may take, and give the same
//! pixels with any memory.

use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};
use wavesplat::base::grid::BlockGrid;
use wavesplat::base::progress::Silent;
use wavesplat::render::{
    BatchOutcome, BatchRequest, BlockPlanes, FrameBatch, Inverse, Layout, PlaneValues, RenderConfig, RenderReport,
    SampleErrors, Scene, Scratch, Selection, render,
};
use wavesplat::view::camera::View;
use wavesplat::{Grid, Region, Result};

/// A scene of cubes, each block with a few values in every frame, that counts decoded blocks.
struct Counted {
    grid: Grid,
    frames: usize,
    /// The value of a voxel is this far from zero: far values need sums in f64.
    offset: f64,
    decoded: AtomicUsize,
}

impl Counted {
    fn new(edge: usize, frames: usize, offset: f64) -> Self {
        Self { grid: Grid::unit([edge; 3]), frames, offset, decoded: AtomicUsize::new(0) }
    }

    /// All pictures, the report, and how often a block was decoded, at most.
    fn pictures(&mut self, size: usize, memory: usize) -> (Vec<u32>, RenderReport, f64) {
        let view = View { size: [size; 2], ..View::new(30.0, 30.0) };
        let config = RenderConfig { memory, ..RenderConfig::new(self, view) };
        let mut all = Vec::new();
        let mut take = |rendered: wavesplat::render::Rendered<'_>| {
            all.extend(rendered.picture.iter().map(|v| v.to_bits()));
            Ok(())
        };
        self.decoded.store(0, Relaxed);
        let report = render(self, &config, &Silent, &mut take).unwrap();
        assert!(report.planned_bytes <= memory as u64, "{} of {memory} bytes", report.planned_bytes);
        assert_eq!(report.blocks_read, self.decoded.load(Relaxed) as u64);
        (all, report, self.decoded.load(Relaxed) as f64 / self.blocks().len() as f64)
    }
}

impl Scene for Counted {
    fn grid(&self) -> &Grid {
        &self.grid
    }

    fn blocks(&self) -> BlockGrid {
        BlockGrid::cubes(self.grid.dims, 48)
    }

    fn frames(&self) -> Option<usize> {
        Some(self.frames)
    }

    fn batch_end(&self, _frame: usize) -> usize {
        self.frames
    }

    fn most_planes(&self, frames: usize, _config: &RenderConfig) -> usize {
        2 * frames
    }

    fn block_bytes(&self) -> usize {
        self.blocks().region(0).voxels() * self.frames * (size_of::<f32>() + size_of::<f64>())
    }

    fn open<'a>(&'a mut self, request: &BatchRequest<'a>) -> Result<Box<dyn FrameBatch + 'a>> {
        let selection = Selection::of_all(self.blocks(), request);
        Ok(Box::new(Batch { scene: self, frames: request.frames, selection, errors: SampleErrors::default() }))
    }
}

struct Batch<'a> {
    scene: &'a Counted,
    frames: &'a [usize],
    selection: Selection,
    errors: SampleErrors,
}

impl FrameBatch for Batch<'_> {
    /// As of a file with a few outliers: planes of coefficients, and nearly empty planes of values.
    fn layout(&self) -> Layout {
        Layout { coefficients: self.frames.len(), ..Layout::of_values(self.frames.len()) }
    }

    fn selection(&self) -> &Selection {
        &self.selection
    }

    fn planes(&self, block: usize) -> Result<Box<dyn BlockPlanes + '_>> {
        self.scene.decoded.fetch_add(1, Relaxed);
        let region = self.scene.blocks().region(block);
        Ok(Box::new(Block { block, frames: self.frames, region, offset: self.scene.offset }))
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
    block: usize,
    frames: &'a [usize],
    region: Region,
    offset: f64,
}

impl BlockPlanes for Block<'_> {
    fn voxels(&self) -> usize {
        self.region.voxels()
    }

    fn plane<'a>(&'a self, plane: usize, scratch: &'a mut Scratch) -> Result<PlaneValues<'a>> {
        let Some(frame) = self.frames.get(plane) else { return Ok(PlaneValues::Nothing) };
        let values = scratch.values(self.voxels());
        let value = |i: usize| self.offset + ((i * 7 + self.block * 5 + frame * 3) % 16) as f64 / 16.0;
        values.iter_mut().enumerate().for_each(|(i, out)| *out = value(i));
        Ok(PlaneValues::Double(values))
    }

    fn held(&self) -> [u64; 2] {
        [0; 2]
    }
}

const MIB: usize = 1 << 20;

#[test]
fn the_default_memory_decodes_each_block_once() {
    for edge in [128, 256] {
        let (_, _, decoded) = Counted::new(edge, 32, 0.0).pictures(512, 512 * MIB);
        assert!(decoded <= 1.0, "{edge}: {decoded}");
    }
}

#[test]
fn little_memory_gives_the_same_pixels_in_more_passes() {
    for offset in [0.0, 1e4, 3e6] {
        let mut scene = Counted::new(100, 8, offset);
        let (right, _, once) = scene.pictures(200, 1 << 30);
        assert!(once <= 1.0 && right.iter().any(|bits| !f32::from_bits(*bits).is_nan()));
        let (mut passes, mut most) = (0.0_f64, 256 * MIB);
        loop {
            let view = View { size: [200; 2], ..View::new(30.0, 30.0) };
            let least = wavesplat::render::least_memory(&scene, &RenderConfig::new(&scene, view)).unwrap();
            most = (most / 4 * 3).max(least);
            let (pictures, _, decoded) = scene.pictures(200, most);
            assert!(pictures == right, "{offset} with {most} bytes");
            passes = passes.max(decoded);
            if most == least {
                break;
            }
        }
        assert!((2.0..40.0).contains(&passes), "{offset}: {passes}");
    }
}
