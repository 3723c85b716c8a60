//! The sampled bound: its definition, and cases in which it fails while the other bounds hold (it is an estimate, not
//! a guarantee).

use crate::common::memory::Memory;
use crate::common::random::Random;
use crate::common::samples::numbers;
use crate::common::series::{Kind, Mask, volume};
use crate::common::views::{SKEWED, archive, field, rounding, view};
use crate::common::{direct, looking, pictures, settings, stored};
use crate::reference::camera::Lattice;
use crate::reference::sampled::{Line, delta};
use std::io::Write;
use wavesplat::base::grid::Grid;
use wavesplat::base::sample::SampleType;
use wavesplat::convert::sampled::pixels;
use wavesplat::convert::{Basis, Bound, ConvertConfig};
use wavesplat::render::{CoefficientScene, Quantity, SplatSource};
use wavesplat::source::FrameSource;

/// The library cuts the kernel at six standard deviations and adds in a different order.
const ROUNDING: f64 = 1e-6;

/// Every window's delta equals the reference's delta at the same pixels.
fn check(memory: &Memory, ty: SampleType, bound: (u32, u64), window: usize, tolerance: f64) {
    let (samples, seed) = bound;
    let config = ConvertConfig { bound: Bound::Sampled { samples, seed }, ..settings(Basis::Haar, window, tolerance) };
    let grid = memory.archive().grid;
    let lattice = Lattice { dims: grid.dims, spacing: grid.spacing, origin: grid.origin };
    let pixels = pixels(grid.dims, samples, seed);
    let lines: Vec<Line> = pixels.iter().map(|p| Line { axis: p.axis, at: p.at }).collect();
    let values = numbers(ty, &memory.frames);
    let missing: Vec<bool> = values.iter().map(|v| !v.is_finite()).collect();
    let windows = stored(&mut memory.clone(), &config).open().metadata().windows.clone();
    let samples = window * lattice.voxels();
    assert_eq!(windows.len(), values.len().div_ceil(samples));
    for ((found, values), missing) in windows.iter().zip(values.chunks(samples)).zip(missing.chunks(samples)) {
        let expected = delta(&lattice, tolerance, &lines, values, missing);
        assert!((found.delta - expected).abs() <= ROUNDING * expected, "{} for {expected}", found.delta);
    }
}

#[test]
fn the_bound_is_that_of_its_definition() {
    let signed = archive(SKEWED, SampleType::F64, &field(&SKEWED, 19, 4));
    check(&signed, SampleType::F64, (7, 0), 8, 0.02);
    check(&signed, SampleType::F64, (1, 12), 16, 0.3);
    for (n, mask) in [Mask::Special, Mask::Most].into_iter().enumerate() {
        let samples = volume(Kind::Wave, SampleType::F32, mask, SKEWED.whole().voxels(), 11, n as u64);
        check(&Memory::new(SKEWED, SampleType::F32, samples), SampleType::F32, (9, 1 << 60), 8, 0.1);
    }
    let long = Grid { dims: [1, 2, 300], spacing: [3.0, 1.0, 0.1], origin: [0.0; 3] };
    check(&archive(long, SampleType::F64, &field(&long, 4, 1)), SampleType::F64, (20, 3), 4, 0.01);
    let large: Vec<f64> = field(&SKEWED, 5, 4).into_iter().map(|v| v * 1e300).collect();
    check(&archive(SKEWED, SampleType::F64, &large), SampleType::F64, (7, 0), 8, 0.02);
}

#[test]
fn seeds_and_numbers_choose_other_pixels() {
    let memory = archive(SKEWED, SampleType::F64, &field(&SKEWED, 8, 4));
    let delta = |samples, seed| {
        let config = ConvertConfig { bound: Bound::Sampled { samples, seed }, ..settings(Basis::Haar, 8, 0.1) };
        stored(&mut memory.clone(), &config).open().metadata().windows[0].delta
    };
    assert_eq!(delta(50, 1), delta(50, 1));
    assert!(delta(50, 1) != delta(50, 2) && delta(50, 1) != delta(51, 1));
    assert!((delta(3000, 1) / delta(3000, 2) - 1.0).abs() < 0.05, "both near the mean over the faces");
}

const GRID: Grid = Grid { dims: [38, 38, 10], spacing: [1.0; 3], origin: [0.0; 3] };
const FRAMES: usize = 32;
const TOLERANCE: f64 = 0.02;

/// One half is bright, the other dim; the dim half changes as `dim` says.
fn halves(dim: impl Fn(usize) -> f64) -> Memory {
    let mut random = Random(5);
    let mut values = Vec::new();
    for t in 0..FRAMES {
        for [x, _, _] in GRID.whole().iter() {
            let grain = 1.0 + 1e-3 * random.signed();
            values.push(grain * if x < GRID.dims[0] / 2 { 1.0 } else { dim(t) });
        }
    }
    archive(GRID, SampleType::F64, &values)
}

/// For all pixels that are not background in the three views along the axes: the share with |g^ - g| > tolerance * g,
/// the largest |g^ - g| / (tolerance * g), and the largest |g^ - g| / delta, without the rounding to `f32`.
fn errors_of_pixels(memory: &Memory, bound: Bound) -> [f64; 3] {
    let config = ConvertConfig { bound, ..settings(Basis::Haar, FRAMES, TOLERANCE) };
    let file = stored(&mut memory.clone(), &config);
    let (mut pixels, mut beyond, mut worst, mut largest) = (0.0, 0.0, 0.0_f64, 0.0_f64);
    for (azimuth, elevation) in [(0.0, 0.0), (90.0, 0.0), (0.0, 90.0)] {
        let look = looking(view(azimuth, elevation, [32, 32]), 0.0, Quantity::Mean, &GRID, FRAMES);
        let (g, _) = pictures(&mut direct(memory, None), &look);
        let (found, _) = pictures(&mut CoefficientScene::new(file.open(), SplatSource::Coefficients), &look);
        for (g, found) in g.into_iter().zip(found).filter(|(g, _)| !g.is_nan()) {
            let off = (f64::from(g) - f64::from(found)).abs() - rounding(g) - rounding(found);
            let share = off / (TOLERANCE * f64::from(g));
            pixels += 1.0;
            beyond += f64::from(u8::from(share > 1.0));
            (worst, largest) = (worst.max(share), largest.max(off));
        }
    }
    [beyond / pixels, worst, largest / file.report.delta]
}

fn check_scene(name: &str, memory: &Memory) {
    let bounds = [Bound::Sampled { samples: 300, seed: 0 }, Bound::Relative { floor: 0.0 }, Bound::Pointwise];
    let found = bounds.map(|bound| errors_of_pixels(memory, bound));
    for (bound, [beyond, worst, largest]) in bounds.iter().zip(found) {
        let percent = 100.0 * beyond;
        let line = format!(
            "{name}, {bound:?}: {percent:.1} % of pixels beyond the tolerance, worst {worst:.2} times, largest error {largest:.2} of delta\n"
        );
        std::io::stderr().write_all(line.as_bytes()).unwrap();
    }
    let [sampled, relative, pointwise] = found;
    assert!(sampled[0] > 0.2 && sampled[1] > 3.0, "{name}: the estimate is good enough here: {sampled:?}");
    assert!(relative[0] == 0.0 && relative[1] <= 1.0, "{name}: {relative:?}");
    assert!(pointwise[2] <= 1.0, "{name}: {pointwise:?}");
}

/// The estimate takes a mean over pixels, so dim pixels get the tolerance of bright ones.
#[test]
fn a_dim_oscillation_beside_a_bright_half_is_lost_to_the_estimate_alone() {
    check_scene("oscillation", &halves(|t| 0.01 * (1.0 + 0.2 * (t as f64 * 0.9).sin())));
}

/// The estimate bounds a sum over time, so one frame may use all of it.
#[test]
fn a_flash_in_a_dim_half_is_lost_to_the_estimate_alone() {
    check_scene("flash", &halves(|t| if t == 13 { 0.05 } else { 0.01 }));
}
