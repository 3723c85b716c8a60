//! Splatting on the lattice of the view compared with footprints: coefficients of deep volumes, and frames.

use crate::common::views::{archive, field, largest, rounding, truth, view};
use crate::common::{direct, looking, pictures, settings, stored};
use crate::frame_pictures::under_less_memory;
use crate::reference::splat::Images;
use std::ops::Range;
use wavesplat::base::grid::{Grid, Region};
use wavesplat::base::sample::SampleType;
use wavesplat::convert::{Basis, ConvertConfig, SchemeConstraint};
use wavesplat::render::{CoefficientScene, LeftOut, Quantity, RenderConfig, Scene, SplatSource};
use wavesplat::view::camera::View;

const FRAMES: usize = 9;

/// A view nearly along the longest axis.
fn scenes() -> [(Grid, View, f64); 3] {
    let near = |azimuth, elevation, scale| View { scale: Some(scale), ..view(azimuth, elevation, [50, 45]) };
    [
        (Grid::unit([20, 21, 130]), near(25.0, 75.0, 1.5), 0.0),
        (Grid { dims: [150, 18, 17], spacing: [1.0, 0.9, 1.1], origin: [5.0, 0.0, -3.0] }, near(80.0, 12.0, 1.6), 0.01),
        (Grid::unit([19, 140, 20]), View { roll: 30.0, ..near(0.0, 0.0, 1.4) }, 0.0),
    ]
}

fn configs() -> [ConvertConfig; 3] {
    let haar = settings(Basis::Haar, 8, 0.01);
    let auto = ConvertConfig { coding: SchemeConstraint::AUTO, ..settings(Basis::Haar, 9, 0.01) };
    [ConvertConfig { block: Some(16), ..haar }, auto.clone(), ConvertConfig { block: Some(13), ..auto }]
}

#[test]
fn a_lattice_keeps_the_error_that_it_states() {
    let mut found = 0;
    for (n, (grid, view, tau)) in scenes().into_iter().enumerate() {
        let mut samples = field(&grid, FRAMES, n as u64);
        samples.iter_mut().for_each(|v| *v += 20.0); // an offset must not make means worse
        let mean = looking(view, tau, Quantity::Mean, &grid, FRAMES);
        let seen = truth(&grid, &mean, view.scale.unwrap(), &vec![0.0; grid.whole().voxels()], None);
        for (i, convert) in configs().into_iter().enumerate() {
            let mut memory = archive(grid, SampleType::F64, &samples);
            let stored = stored(&mut memory, &convert);
            let mut scene = CoefficientScene::new(stored.open(), SplatSource::Coefficients);
            for quantity in [Quantity::Emission, Quantity::Mean] {
                let plain = looking(view, tau, quantity, &grid, FRAMES);
                let region = Region { start: [1, 2, 3], ..grid.whole() };
                let region = (i == 1).then_some(region);
                let exact = RenderConfig { region, splat_error: 0.0, ..plain.clone() };
                let quick = RenderConfig { region, splat_error: 5e-3, ..plain };
                let largest = (1.01 * largest(&samples), 1.02 * span(&samples));
                found += keeps_its_error(&mut scene, [&exact, &quick], (largest, &seen), &format!("scene {n}, {i}"));
            }
        }
    }
    assert!(found >= 4, "{found} were splatted on a lattice");
}

/// Whether splatting used a lattice.
fn keeps_its_error(
    scene: &mut dyn Scene,
    [exact, quick]: [&RenderConfig; 2],
    ((magnitude, range), seen): ((f64, f64), &Images),
    what: &str,
) -> usize {
    let ((expected, _), (pictures, report)) = (pictures(scene, exact), pictures(scene, quick));
    for (at, (found, expected)) in pictures.iter().zip(&expected).enumerate() {
        assert_eq!(found.is_nan(), expected.is_nan(), "{what}");
        let weight = seen.weight[at % seen.weight.len()];
        let unit = match quick.quantity {
            Quantity::Mean => range * seen.largest_weight / weight,
            Quantity::Emission => magnitude * seen.largest_weight,
        };
        let most = (report.views[0].stated_splat_error + 1e-7) * unit + rounding(*found) + rounding(*expected);
        let off = f64::from(*found) - f64::from(*expected);
        assert!(found.is_nan() || off.abs() <= most, "{what}: {found} for {expected}");
    }
    usize::from(report.views[0].method == "lattice")
}

/// Views along an axis, nearly along an axis, along a diagonal, and with two axes equally close to the view.
const DIRECTIONS: [(f64, f64); 8] = [
    (0.0, 0.0),
    (90.0, 0.0),
    (0.0, 90.0),
    (0.001, -0.002),
    (45.0, 0.0),
    (44.999, 35.26),
    (120.0, 45.0),
    (-30.0, -75.0),
];

#[test]
fn frames_on_a_lattice_keep_the_error_that_they_state() {
    assert!(frames_keep_their_error(3..6) >= 24);
}

#[test]
#[ignore = "exhaustive"]
fn frames_on_a_lattice_keep_the_error_that_they_state_in_every_direction() {
    assert!(frames_keep_their_error(0..DIRECTIONS.len()) >= 60);
}

/// How many pictures from some of the directions were splatted on a lattice.
fn frames_keep_their_error(directions: Range<usize>) -> usize {
    let mut found = 0;
    let grid = Grid { dims: [33, 37, 35], spacing: [1.0, 1.0, 0.8], origin: [5.0, 0.0, -3.0] };
    let mut samples = field(&grid, 2, 3);
    samples.iter_mut().for_each(|v| *v += 20.0);
    let largest = (largest(&samples), span(&samples));
    for n in directions {
        let (azimuth, elevation) = DIRECTIONS[n];
        let view = View { scale: Some(3.0), roll: 15.0 * (n % 3) as f64, ..view(azimuth, elevation, [70, 65]) };
        let tau = [0.0, 0.03][n % 2];
        let mut memory = archive(grid, SampleType::F64, &samples);
        let region = (n == 5).then_some(Region { start: [0, 2, 1], ..grid.whole() });
        let plain = RenderConfig { region, ..looking(view, tau, Quantity::Emission, &grid, 2) };
        let seen = truth(&grid, &plain, 3.0, &vec![0.0; grid.whole().voxels()], None);
        for splat_error in [2e-2, 1e-3, 1e-4, 1e-5] {
            for quantity in [Quantity::Emission, Quantity::Mean] {
                let exact = RenderConfig { quantity, ..plain.clone() };
                let quick = RenderConfig { splat_error, ..exact.clone() };
                let what = format!("view {n}, {quantity:?}, {splat_error}");
                found += keeps_its_error(&mut direct(&memory, None), [&exact, &quick], (largest, &seen), &what);
            }
        }
        // A missing sample is missing in both sums.
        let missing = |i: usize| i % 7 == 3 || i % 35 < 12;
        memory = archive(grid, SampleType::F64, &masked(&samples, missing));
        let emission = RenderConfig { splat_error: 1e-3, ..plain };
        let exact = RenderConfig { splat_error: 0.0, ..emission.clone() };
        keeps_its_error(&mut direct(&memory, None), [&exact, &emission], (largest, &seen), "masked");
        let constant = masked(&vec![3.0; samples.len()], missing);
        let mean = RenderConfig { quantity: Quantity::Mean, splat_error: 1e-3, ..emission };
        let (means, report) = pictures(&mut direct(&archive(grid, SampleType::F64, &constant), None), &mean);
        found += usize::from(report.views[0].method == "lattice");
        assert!(means.iter().all(|v| v.is_nan() || (v - 3.0).abs() < 1e-5), "means of a constant");
    }
    found
}

/// The worst data there are for a pixel have the sign of each voxel's error. Every voxel alone gives these errors.
#[test]
fn no_signs_of_samples_exceed_the_stated_error() {
    let attacks = [
        ((0.0, 0.0), 0.0, [1.0; 3]),
        ((3.0, 2.0), 0.0, [1.0; 3]),
        ((90.0, 4.0), 0.0, [1.0, 1.0, 1.2]),
        ((30.0, 30.0), 20.0, [1.0, 0.8, 1.0]),
        ((-50.0, 80.0), 0.0, [1.0; 3]),
        ((45.0, 35.26), 7.0, [1.0; 3]),
        ((200.0, -30.0), 90.0, [0.9, 1.0, 1.0]),
        ((20.0, 10.0), 45.0, [1.0; 3]),
        ((130.0, 60.0), 0.0, [1.0, 1.0, 0.9]),
    ];
    let mut attacked = 0;
    for ((azimuth, elevation), roll, spacing) in attacks {
        let grid = Grid { spacing, ..Grid::unit([7, 6, 8]) };
        let voxels = grid.whole().voxels();
        let single: Vec<f64> = (0..voxels * voxels).map(|n| if n / voxels == n % voxels { 1.0 } else { 0.0 }).collect();
        let memory = archive(grid, SampleType::F64, &single);
        let view = View { scale: Some(5.0), roll, ..view(azimuth, elevation, [50, 50]) };
        let exact = looking(view, 0.0, Quantity::Emission, &grid, voxels);
        for splat_error in [5e-3, 1e-3, 1e-4, 1e-5] {
            let config = RenderConfig { splat_error, ..exact.clone() };
            let (found, report) = pictures(&mut direct(&memory, None), &config);
            let (expected, _) = pictures(&mut direct(&memory, None), &exact);
            if report.views[0].method != "lattice" {
                continue; // footprints are less work
            }
            attacked += 1;
            let (mut errors, mut weights) = (vec![0.0; 2500], vec![0.0; 2500]);
            for (at, (found, expected)) in found.iter().zip(&expected).enumerate() {
                errors[at % 2500] += (f64::from(*found) - f64::from(*expected)).abs();
                weights[at % 2500] += f64::from(*expected);
            }
            let reached =
                errors.iter().fold(0.0, |m: f64, e| m.max(*e)) / weights.iter().fold(0.0, |m: f64, w| m.max(*w));
            let stated = report.views[0].stated_splat_error;
            assert!(stated <= splat_error && reached <= stated, "{azimuth}: {reached:e} of {stated:e}");
            assert!(reached > 0.02 * stated, "{azimuth}: {reached:e} is far from {stated:e}");
        }
    }
    assert!(attacked >= 18, "{attacked} were splatted on a lattice");
}

#[test]
fn a_quick_look_reports_an_estimate() {
    let grid = Grid::unit([33, 37, 35]);
    let samples = field(&grid, 2, 3);
    let memory = archive(grid, SampleType::F32, &samples);
    for (azimuth, elevation) in [(0.0, 0.0), (30.0, 30.0), (10.0, 80.0)] {
        let view = View { scale: Some(3.0), ..view(azimuth, elevation, [120, 120]) };
        let exact = looking(view, 0.0, Quantity::Mean, &grid, 2);
        let quick = RenderConfig { splat_error: 1e-3, fast: true, ..exact.clone() };
        let (found, report) = pictures(&mut direct(&memory, None), &quick);
        assert!(report.views[0].splat_error_is_estimate && report.views[0].method == "lattice-fast");
        let (expected, report_of_exact) = pictures(&mut direct(&memory, None), &exact);
        assert!(!report_of_exact.views[0].splat_error_is_estimate);
        let off = found.iter().zip(&expected).map(|(a, b)| (f64::from(*a) - f64::from(*b)).abs());
        let largest = off.filter(|off| !off.is_nan()).fold(0.0, f64::max);
        assert!(largest > 0.0 && largest < 0.05 * span(&samples), "{azimuth}: {largest:e}");
    }
    let config =
        RenderConfig { fast: true, certify: true, ..looking(view(0.0, 0.0, [9, 9]), 0.0, Quantity::Mean, &grid, 2) };
    let refused = wavesplat::render::check(&direct(&memory, None), &config);
    assert!(matches!(refused, Err(wavesplat::base::error::Error::Setting { setting: "fast", .. })));
}

fn masked(samples: &[f64], missing: impl Fn(usize) -> bool) -> Vec<f64> {
    samples.iter().enumerate().map(|(i, v)| if missing(i) { f64::NAN } else { *v }).collect()
}

fn span(samples: &[f64]) -> f64 {
    samples.iter().fold(f64::MIN, |m, v| m.max(*v)) - samples.iter().fold(f64::MAX, |m, v| m.min(*v))
}

#[test]
fn memory_changes_no_bit_of_a_lattice() {
    let (grid, view, tau) = scenes()[0];
    let view = View { size: [150, 140], scale: Some(3.0), ..view };
    // Cells that move, and sums in f64: tiles take the mean off them.
    for (view, offset, quantity) in
        [(view, 0.0, Quantity::Emission), (View { roll: 45.0, ..view }, 1e6, Quantity::Mean)]
    {
        let samples: Vec<f64> = field(&grid, FRAMES, 7).into_iter().map(|v| v + offset).collect();
        let mut memory = archive(grid, SampleType::F64, &samples);
        let stored = stored(&mut memory, &configs()[2]);
        let mut scene = CoefficientScene::new(stored.open(), SplatSource::Coefficients);
        let config = RenderConfig { splat_error: 5e-3, ..looking(view, tau, quantity, &grid, FRAMES) };
        for scene in [&mut scene as &mut dyn Scene, &mut direct(&memory, None)] {
            assert_eq!(pictures(scene, &config).1.views[0].method, "lattice");
            assert!(under_less_memory(scene, &config) > 2);
        }
    }
}

#[test]
fn invisible_depths_are_omitted_within_the_stated_error() {
    let grid = Grid::unit([20, 130, 21]);
    let samples = field(&grid, FRAMES, 11);
    let mut memory = archive(grid, SampleType::F64, &samples);
    let stored = stored(&mut memory, &configs()[2]);
    let largest = (1.01 * largest(&samples), 1.02 * span(&samples));
    let mut dimmed = [Vec::new(), Vec::new()];
    for (n, (tau, scale)) in [(0.0, 1.5), (0.1, 1.5), (0.3, 1.5), (1.0, 0.7)].into_iter().enumerate() {
        let view = View { scale: Some(scale), ..view(0.0, 20.0 * (n % 2) as f64, [50, 45]) };
        let mean = looking(view, tau, Quantity::Mean, &grid, FRAMES);
        let seen = truth(&grid, &mean, scale, &vec![0.0; grid.whole().voxels()], None);
        for (dimmed, quantity) in dimmed.iter_mut().zip([Quantity::Emission, Quantity::Mean]) {
            let exact = looking(view, tau, quantity, &grid, FRAMES);
            let quick = RenderConfig { splat_error: 5e-3, ..exact.clone() };
            let mut scene = CoefficientScene::new(stored.open(), SplatSource::Coefficients);
            keeps_its_error(&mut scene, [&exact, &quick], (largest, &seen), &format!("tau {tau}, {quantity:?}"));
            let (all, some) = (pictures(&mut scene, &exact).1, pictures(&mut scene, &quick).1);
            assert!((tau == 0.0) == (some.blocks_dimmed == 0) && all.blocks_dimmed == 0, "{tau}");
            assert!(some.blocks_dimmed == 0 || some.bytes_read < all.bytes_read);
            assert!(some.views[0].stated_splat_error <= 5e-3);
            dimmed.push(some.blocks_dimmed);
        }
    }
    assert!(dimmed.iter().all(|blocks| blocks.is_sorted() && blocks[1] < blocks[2]), "{dimmed:?}");
}

#[test]
fn parts_of_other_frames_are_counted_and_not_read() {
    // No prediction in space; only the frames between two others are predicted along time.
    let grid = Grid::unit([32, 33, 34]);
    let (places, noise) = (field(&grid, 1, 5), field(&grid, 16, 6));
    let value = |i: usize| {
        let (frame, voxel) = (i / places.len(), i % places.len());
        places[voxel] * (voxel * 7919 % 101) as f64 * (1.0 + 0.02 * frame as f64) + 1e-3 * noise[i]
    };
    let mut memory = archive(grid, SampleType::F64, &Vec::from_iter((0..noise.len()).map(value)));
    let stored = stored(&mut memory, &settings(Basis::Samples, 16, 1e-4));
    let mut scene = CoefficientScene::new(stored.open(), SplatSource::Coefficients);
    let all = looking(view(30.0, 30.0, [30, 30]), 0.0, Quantity::Mean, &grid, 16);
    let whole = pictures(&mut scene, &all).1;
    assert_eq!(whole.other_frames, LeftOut::default());
    let [even, odd] = [8, 9].map(|frame| pictures(&mut scene, &RenderConfig { frames: vec![frame], ..all.clone() }).1);
    for part in [&even, &odd] {
        assert_eq!(part.bytes_read + part.other_frames.bytes, whole.bytes_read);
        assert_eq!(part.coefficients + part.other_frames.coefficients, whole.coefficients);
    }
    assert!(even.other_frames.bytes > 0 && odd.other_frames == LeftOut::default(), "{:?}", even.other_frames);
}

#[test]
fn few_frames_by_value_equal_those_of_a_full_rendering() {
    let (grid, view, tau) = scenes()[1];
    let voxels = grid.whole().voxels();
    let samples: Vec<f64> = field(&grid, 33, 7).into_iter().map(|v| v + 20.0).collect();
    let holes = masked(&samples, |i| i % 11 == 0 || i % voxels < 300);
    for (samples, (basis, window)) in [&samples, &holes].into_iter().zip([(Basis::Haar, 32), (Basis::Learned, 33)]) {
        let mut memory = archive(grid, SampleType::F64, samples);
        let stored = stored(&mut memory, &ConvertConfig { block: Some(16), ..settings(basis, window, 0.05) });
        let mut scene = CoefficientScene::new(stored.open(), SplatSource::Coefficients);
        for splat_error in [0.0, 5e-3] {
            let plain = looking(view, tau, Quantity::Mean, &grid, 33);
            let config = RenderConfig { splat_error, ..plain };
            let (all, _) = pictures(&mut scene, &config);
            let mut sufficed = 0;
            for frames in [vec![0], vec![7, 30], vec![31]] {
                let few = RenderConfig { frames: frames.clone(), ..config.clone() };
                sufficed += under_less_memory(&mut scene, &few);
                let (some, _) = pictures(&mut scene, &few);
                for (frame, picture) in frames.iter().zip(some.chunks_exact(50 * 45)) {
                    for (a, b) in picture.iter().zip(&all[frame * 50 * 45..]) {
                        let same = a.is_nan() && b.is_nan();
                        let off = (f64::from(*a) - f64::from(*b)).abs();
                        // A lattice sums in f32.
                        let sums = if splat_error > 0.0 { 1e-6 * f64::from(b.abs()) } else { 0.0 };
                        assert!(
                            same || off <= sums + 2.0 * (rounding(*a) + rounding(*b)),
                            "{basis:?}, {frame}: {a} for {b}"
                        );
                    }
                }
            }
            assert!(sufficed >= 6, "{sufficed} budgets sufficed");
        }
    }
}
