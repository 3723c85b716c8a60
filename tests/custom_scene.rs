//! A scene that another program implements renders as its samples do.

use crate::common::formula::FormulaScene;
use crate::common::pictures;
use wavesplat::render::{FrameScene, Mode, RenderConfig};
use wavesplat::source::ArraySource;
use wavesplat::view::camera::View;
use wavesplat::{Grid, Region};

const DIMS: [usize; 3] = [20, 17, 14];
const FRAMES: usize = 3;

/// The value of a voxel in a frame.
fn value(frame: usize, [x, y, z]: [usize; 3]) -> f64 {
    ((x * 3 + y * 5 + z * 7 + frame * 11) % 16) as f64 / 16.0
}

#[test]
fn a_scene_from_outside_renders_as_its_samples_do() {
    let mut formula = FormulaScene {
        grid: Grid::unit(DIMS),
        edge: 32,
        frames: FRAMES,
        formula: value,
        offset: 0.0,
        with_empty_planes: false,
        read: 0.into(),
    };
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
        let ((own, _), (known, _)) = (pictures(&mut formula, &config), pictures(&mut frames, &config));
        assert!(own.iter().any(|v| *v > 0.0) && own.len() == config.frames.len() * 70 * 60);
        assert!(own.iter().zip(&known).all(|(a, b)| a.to_bits() == b.to_bits()), "{config:?}");
    }
}
