//! A scene that the library does not know: values from a formula.

use wavesplat::base::progress::Silent;
use wavesplat::render::{
    BatchOutcome, BatchRequest, BlockPlanes, FrameBatch, FrameScene, Inverse, Layout, Mode, PlaneValues, RenderConfig,
    SampleErrors, Scene, Scratch, Selection, render,
};
use wavesplat::source::ArraySource;
use wavesplat::view::camera::View;
use wavesplat::{Grid, Region, Result};

const DIMS: [usize; 3] = [20, 17, 14];
const FRAMES: usize = 3;

/// The value of a voxel in a frame.
fn value(frame: usize, [x, y, z]: [usize; 3]) -> f64 {
    ((x * 3 + y * 5 + z * 7 + frame * 11) % 16) as f64 / 16.0
}

struct Formula {
    grid: Grid,
}

impl Scene for Formula {
    fn grid(&self) -> &Grid {
        &self.grid
    }

    fn blocks(&self) -> wavesplat::base::grid::BlockGrid {
        wavesplat::base::grid::BlockGrid::cubes(self.grid.dims, 32)
    }

    fn frames(&self) -> Option<usize> {
        Some(FRAMES)
    }

    fn batch_end(&self, _frame: usize) -> usize {
        FRAMES
    }

    fn most_planes(&self, frames: usize, _config: &RenderConfig) -> usize {
        frames
    }

    fn block_bytes(&self) -> usize {
        self.blocks().region(0).voxels() * size_of::<f64>()
    }

    fn open<'a>(&'a mut self, request: &BatchRequest<'a>) -> Result<Box<dyn FrameBatch + 'a>> {
        let selection = Selection::of_all(self.blocks(), request);
        Ok(Box::new(Batch { scene: self, frames: request.frames, selection, errors: SampleErrors::default() }))
    }
}

struct Batch<'a> {
    scene: &'a Formula,
    frames: &'a [usize],
    selection: Selection,
    errors: SampleErrors,
}

impl FrameBatch for Batch<'_> {
    fn layout(&self) -> Layout {
        Layout::of_values(self.frames.len())
    }

    fn selection(&self) -> &Selection {
        &self.selection
    }

    fn planes(&self, block: usize) -> Result<Box<dyn BlockPlanes + '_>> {
        Ok(Box::new(Block { frames: self.frames, region: self.scene.blocks().region(block) }))
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
    frames: &'a [usize],
    region: Region,
}

impl BlockPlanes for Block<'_> {
    fn voxels(&self) -> usize {
        self.region.voxels()
    }

    fn plane<'a>(&'a self, plane: usize, scratch: &'a mut Scratch) -> Result<PlaneValues<'a>> {
        let values = scratch.values(self.voxels());
        values.iter_mut().zip(self.region.iter()).for_each(|(out, voxel)| *out = value(self.frames[plane], voxel));
        Ok(PlaneValues::Double(values))
    }

    fn held(&self) -> [u64; 2] {
        [0; 2]
    }
}

fn pictures(scene: &mut dyn Scene, config: &RenderConfig) -> Vec<f32> {
    let mut all = Vec::new();
    let mut take = |rendered: wavesplat::render::Rendered<'_>| {
        all.extend_from_slice(rendered.picture);
        Ok(())
    };
    render(scene, config, &Silent, &mut take).unwrap();
    all
}

#[test]
fn a_scene_from_outside_renders_as_its_samples_do() {
    let mut formula = Formula { grid: Grid::unit(DIMS) };
    let all = |frame| formula.grid.whole().iter().map(move |voxel| value(frame, voxel) as f32);
    let samples: Vec<f32> = (0..FRAMES).flat_map(all).collect();
    let mut frames = FrameScene::new(Box::new(ArraySource::from_f32(DIMS, &samples).unwrap()), None);
    let view = View { size: [70, 60], ..View::new(30.0, 20.0) };
    let plain = RenderConfig::new(&formula, view);
    let region = Some(Region { start: [3, 0, 2], end: [20, 9, 14] });
    for config in [
        plain.clone(),
        RenderConfig { splat_error: 0.0, ..plain.clone() },
        RenderConfig { region, frames: vec![1, 2], ..plain.clone() },
        RenderConfig { mode: Mode::Mip { slices: None }, ..plain.clone() },
    ] {
        let (own, known) = (pictures(&mut formula, &config), pictures(&mut frames, &config));
        assert!(own.iter().any(|v| *v > 0.0) && own.len() == config.frames.len() * 70 * 60);
        assert!(own.iter().zip(&known).all(|(a, b)| a.to_bits() == b.to_bits()), "{config:?}");
    }
}
