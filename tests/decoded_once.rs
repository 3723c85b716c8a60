//! Projections decode each block once if the default memory allows it, plan no more than they may take, and give the same
//! pixels with any memory.

use crate::common::formula::FormulaScene;
use crate::common::pictures;
use std::sync::atomic::Ordering::Relaxed;
use wavesplat::Grid;
use wavesplat::render::{RenderConfig, Scene, least_memory};
use wavesplat::view::camera::View;

/// A cube whose values lie around `offset`: values far from zero need sums in f64.
fn cube(edge: usize, frames: usize, offset: f64) -> FormulaScene {
    let formula = |frame, [x, y, z]: [usize; 3]| ((x * 7 + y * 5 + z * 11 + frame * 3) % 16) as f64 / 16.0;
    let (grid, read) = (Grid::unit([edge; 3]), 0.into());
    FormulaScene { grid, edge: 48, frames, formula, offset, with_empty_planes: true, read }
}

fn settings(scene: &FormulaScene, side: usize, memory: usize) -> RenderConfig {
    let view = View { size: [side; 2], ..View::new(30.0, 30.0) };
    RenderConfig { memory, ..RenderConfig::new(scene, view) }
}

/// The bits of all pictures, and how often a block was decoded.
fn drawn(scene: &mut FormulaScene, config: &RenderConfig) -> (Vec<u32>, f64) {
    scene.read.store(0, Relaxed);
    let (all, report) = pictures(scene, config);
    let read = scene.read.load(Relaxed);
    assert!(report.planned_bytes <= config.memory as u64, "{} of {} bytes", report.planned_bytes, config.memory);
    assert_eq!(report.blocks_read, read as u64);
    (all.iter().map(|v| v.to_bits()).collect(), read as f64 / scene.blocks().len() as f64)
}

const MIB: usize = 1 << 20;

#[test]
fn the_default_memory_decodes_each_block_once() {
    for edge in [128, 256] {
        let mut scene = cube(edge, 32, 0.0);
        let config = settings(&scene, 512, 512 * MIB);
        let (_, decoded) = drawn(&mut scene, &config);
        assert!(decoded <= 1.0, "{edge}: {decoded}");
    }
}

#[test]
fn little_memory_gives_the_same_pixels_in_more_passes() {
    for offset in [0.0, 1e4, 3e6] {
        let mut scene = cube(100, 8, offset);
        let config = settings(&scene, 200, 1 << 30);
        let (right, once) = drawn(&mut scene, &config);
        assert!(once <= 1.0 && right.iter().any(|bits| !f32::from_bits(*bits).is_nan()));
        let least = least_memory(&scene, &config).unwrap();
        let (mut passes, mut memory) = (0.0_f64, 256 * MIB);
        while memory > least {
            memory = (memory / 4 * 3).max(least);
            let (pictures, decoded) = drawn(&mut scene, &RenderConfig { memory, ..config.clone() });
            assert!(pictures == right, "{offset} with {memory} bytes");
            passes = passes.max(decoded);
        }
        assert!((2.0..40.0).contains(&passes), "{offset}: {passes}");
    }
}
