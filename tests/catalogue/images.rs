//! Pictures with long sums, small weights or large values.

use crate::common::computed::Computed;
use crate::common::memory::Memory;
use crate::common::random::Random;
use crate::common::samples::bytes;
use crate::common::views::{SKEWED, archive, field, largest, of_reference, rounding, truth, view};
use crate::common::{MEMORY, direct, looking, pictures, report, settings, stored};
use crate::reference::camera::project;
use crate::reference::splat::{BACKGROUND, footprint};
use std::time::Instant;
use wavesplat::base::error::Error;
use wavesplat::base::grid::{Grid, Region};
use wavesplat::base::progress::Silent;
use wavesplat::base::sample::SampleType;
use wavesplat::convert::Basis;
use wavesplat::render::{CoefficientScene, FrameScene, Quantity, RenderConfig, SplatSource, render};
use wavesplat::view::camera::View;
use wavesplat::view::footprint::Kernel;

/// A compensated sum, which keeps the rounding errors.
#[derive(Default)]
struct Sum {
    high: f64,
    low: f64,
}

impl Sum {
    fn add(&mut self, x: f64) {
        let sum = self.high + x;
        let added = sum - self.high;
        self.low += (self.high - (sum - added)) + (x - added);
        self.high = sum;
    }
}

fn large_value([x, y, z]: [usize; 3]) -> u8 {
    ((x * 31 + y * 17 + z * 7) % 251) as u8
}

#[test]
fn a_million_splats_in_one_pixel_are_summed_right() {
    splats_in_one_pixel_are_summed_right([100, 100, 100]);
}

#[test]
#[ignore = "exhaustive"]
fn a_hundred_million_splats_in_one_pixel_are_summed_right() {
    splats_in_one_pixel_are_summed_right([500, 400, 500]);
}

fn splats_in_one_pixel_are_summed_right(dims: [usize; 3]) {
    let (started, [nx, ny, nz]) = (Instant::now(), dims);
    let grid = Grid::unit(dims);
    let sample = move |_, voxel| [large_value([voxel % nx, voxel / nx % ny, voxel / (nx * ny)])];
    let mut scene = FrameScene::new(Box::new(Computed::new(grid, SampleType::U8, 1, sample)), None);
    // From the front, at tau 0: a weight depends on x and z alone, so the sums along y are sums of integers.
    let view = View { scale: Some(1.0 / 600.0), ..view(0.0, 0.0, [1, 1]) };
    let plain = looking(view, 0.0, Quantity::Emission, &grid, 1);
    let config = RenderConfig { kernel: Kernel::new(Some(300.0), 0.0, &grid).unwrap(), ..plain };
    let (found, _) = pictures(&mut scene, &config);
    let (lattice, view) = of_reference(&grid, &config, 1.0 / 600.0);
    let mut sum = Sum::default();
    for x in 0..nx {
        for z in 0..nz {
            let [px, py, _] = project(&lattice, &view, lattice.position([x, 0, z]));
            let weight = footprint(&lattice, &view, (0.5 - px) / view.scale, (0.5 - py) / view.scale);
            let values: u64 = (0..ny).map(|y| u64::from(large_value([x, y, z]))).sum();
            sum.add(weight * values as f64);
        }
    }
    let expected = sum.high + sum.low;
    // Each addition in f64 rounds by at most half a unit of the sum; weights are right to 12 digits.
    let splats = (nx * ny * nz) as f64;
    let most = expected * (splats * 2f64.powi(-53) + 2e-12) + rounding(found[0]);
    let off = (f64::from(found[0]) - expected).abs();
    report(&format!("{splats:e} splats: {} for {expected} in {:.1?}", found[0], started.elapsed()));
    assert!(off <= most, "{} for {expected}", found[0]);
}

/// Means by brute force. Weights are kept as logarithms, so that no depth makes them vanish. No pixel is background.
fn deep_means(grid: &Grid, config: &RenderConfig, scale: f64, values: &[f64]) -> Vec<Option<f64>> {
    let (lattice, view) = of_reference(grid, config, scale);
    let shown = |v: &[usize; 3]| config.region.is_none_or(|r| (0..3).all(|a| (r.start[a]..r.end[a]).contains(&v[a])));
    let voxels = Vec::from_iter(grid.whole().iter().filter(shown));
    let places = Vec::from_iter(voxels.iter().map(|v| project(&lattice, &view, lattice.position(*v))));
    let mut sums = Vec::new();
    for pixel in 0..view.width * view.height {
        let (a, b) = (pixel % view.width, pixel / view.width);
        let log = |[x, y, z]: &[f64; 3]| {
            let (dx, dy) = ((a as f64 + 0.5 - x) / view.scale, (b as f64 + 0.5 - y) / view.scale);
            -view.tau * z - (dx * dx + dy * dy) / (2.0 * view.sigma * view.sigma)
        };
        let logs = Vec::from_iter(places.iter().map(log));
        let most = logs.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let weights = Vec::from_iter(logs.iter().map(|l| (l - most).exp()));
        let all: f64 = weights.iter().sum();
        let mean = weights.iter().zip(&voxels).map(|(w, v)| w * values[grid.whole().index(*v)]).sum::<f64>() / all;
        sums.push((most + all.ln(), mean));
    }
    let brightest = sums.iter().map(|s| s.0).fold(f64::NEG_INFINITY, f64::max);
    sums.into_iter().map(|(log, mean)| (log >= brightest + BACKGROUND.ln()).then_some(mean)).collect()
}

#[test]
fn depths_beyond_an_exponential_are_right_or_refused() {
    let grid = Grid::unit([4, 100, 3]);
    let mut random = Random(18);
    let values = Vec::from_iter((0..1200).map(|_| random.unit()));
    let memory = archive(grid, SampleType::F64, &values);
    let behind = Region { start: [0; 3], end: [4, 10, 3] }; // from the front, y grows towards the viewer
    let mut refused = Vec::new();
    for sigma in [0.3, 0.75, 3.0] {
        for depths in
            [0.0, 1e-300, 1e-10, 1.0, 30.0, 600.0, 700.0, 740.0, 750.0, 790.0, 815.0, 3e3, 1e4, 1e5, 1e150, 1e308]
        {
            for (elevation, region) in [(0.0, None), (25.0, None), (0.0, Some(behind))] {
                let plain = looking(view(0.0, elevation, [12, 10]), 0.0, Quantity::Mean, &grid, 1);
                let kernel = Kernel::new(Some(sigma), depths / 99.0, &grid).unwrap();
                let config = RenderConfig { kernel, region, certify: true, ..plain };
                match render(&mut direct(&memory, None), &config, &Silent, &mut |_| Ok(())) {
                    Err(Error::Setting { setting, .. }) => {
                        assert!(setting == "tau" || setting == "kernel", "{setting}");
                        refused.push((sigma, depths, region.is_some()));
                        continue;
                    }
                    other => drop(other.unwrap()),
                }
                let (found, errors, report) = crate::common::rendered(&mut direct(&memory, None), &config);
                let expected = deep_means(&grid, &config, report.views[0].scale, &values);
                for ((found, error), expected) in found.iter().zip(errors).zip(expected) {
                    let what = format!("sigma {sigma}, tau times depth {depths}, elevation {elevation}, {region:?}");
                    assert_eq!(found.is_nan(), expected.is_none(), "{what}");
                    let Some(expected) = expected else { continue };
                    let off = (f64::from(*found) - expected).abs();
                    assert!(
                        off <= report.views[0].stated_splat_error + rounding(*found),
                        "{what}: {found} for {expected}"
                    );
                    assert!(off <= f64::from(error), "{what}: {found} for {expected}, certified {error}");
                }
            }
        }
    }
    assert!(refused.iter().all(|r| r.1 >= 600.0), "{refused:?}");
    assert!(!refused.contains(&(0.3, 1e4, false)) && refused.contains(&(0.3, 1e308, false)), "{refused:?}");
}

#[test]
fn negative_and_infinite_depths_are_refused() {
    for tau in [-1e-300, -1.0, f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        assert!(matches!(Kernel::new(None, tau, &SKEWED), Err(Error::Setting { setting: "tau", .. })), "{tau}");
    }
}

#[test]
fn pixels_without_weight_are_background_or_zero() {
    let memory = archive(SKEWED, SampleType::F32, &field(&SKEWED, 3, 19));
    let file = stored(&mut memory.clone(), &settings(Basis::Haar, 4, 0.01));
    // First half of the picture is far from the volume; then all of it.
    for (center, some) in [(None, true), (Some([1e4, 0.0, 0.0]), false)] {
        let view = View { scale: Some(1.0), center, ..view(30.0, 20.0, [120, 24]) };
        for quantity in [Quantity::Mean, Quantity::Emission] {
            let config = RenderConfig { certify: true, ..looking(view, 0.0, quantity, &SKEWED, 3) };
            let scene = &mut CoefficientScene::new(file.open(), SplatSource::Coefficients);
            let (found, errors, report) = crate::common::rendered(scene, &config);
            let truth = truth(&SKEWED, &config, report.views[0].scale, &vec![1.0; 945], None);
            for (at, (found, error)) in found.iter().zip(&errors).enumerate().filter(|(at, _)| truth.weight[*at] == 0.0)
            {
                match quantity {
                    Quantity::Mean => assert!(found.is_nan() && error.is_nan(), "pixel {at}: {found} {error}"),
                    Quantity::Emission => assert!(*found == 0.0 && *error >= 0.0, "pixel {at}: {found} {error}"),
                }
            }
            assert!(truth.weight.contains(&0.0) && some == found.iter().any(|v| v.is_finite() && *v != 0.0));
        }
    }
}

#[test]
fn voxels_far_smaller_than_a_pixel_are_numbers() {
    let grid = Grid::unit([40, 30, 20]);
    let memory = archive(grid, SampleType::F32, &field(&grid, 1, 4));
    for scale in [0.1, 0.03, 0.01, 1e-3, 1e-6] {
        for quantity in [Quantity::Emission, Quantity::Mean] {
            let view = View { scale: Some(scale), ..view(30.0, 20.0, [4, 4]) };
            let config = looking(view, 0.0, quantity, &grid, 1);
            let (found, report) = pictures(&mut direct(&memory, None), &config);
            let samples = crate::common::views::values(&memory, SampleType::F32);
            let truth = truth(&grid, &config, scale, &samples, None);
            for (at, found) in found.iter().enumerate() {
                let unit = largest(&samples) * truth.largest_weight;
                let most = report.views[0].stated_splat_error * unit + rounding(*found);
                let right = match quantity {
                    Quantity::Emission => (f64::from(*found) - truth.emission[at]).abs() <= most,
                    Quantity::Mean => found.is_nan() != truth.mean[at].is_finite(),
                };
                assert!(right, "scale {scale}, pixel {at}: {found}");
            }
        }
    }
}

#[test]
fn pictures_of_the_largest_samples_are_numbers() {
    let mut random = Random(8);
    let mut ends = |lo: f64, hi: f64| Vec::from_iter((0..3 * 315).map(|_| [lo, hi][random.below(2)]));
    let values = ends(f64::from(f32::MIN), f64::from(f32::MAX));
    let memory = Memory::new(SKEWED, SampleType::F32, bytes(SampleType::F32, &values));
    for tolerance in [0.0, 0.01] {
        let file = stored(&mut memory.clone(), &settings(Basis::Haar, 4, tolerance));
        let config = looking(view(30.0, 20.0, [24, 20]), 0.0, Quantity::Mean, &SKEWED, 3);
        let (found, report) = pictures(&mut CoefficientScene::new(file.open(), SplatSource::Coefficients), &config);
        let truth = truth(&SKEWED, &config, report.views[0].scale, &values, None);
        let range = f64::from(f32::MAX) - f64::from(f32::MIN);
        for (found, expected) in found.iter().zip(&truth.mean) {
            assert_eq!(found.is_nan(), expected.is_nan());
            let most = file.report.delta + report.views[0].stated_splat_error * range + rounding(*found);
            assert!(found.is_nan() || (f64::from(*found) - expected).abs() <= most, "{found} for {expected}");
        }
        // A number that an `f32` cannot hold is infinite, never background.
        let emission = RenderConfig { quantity: Quantity::Emission, memory: MEMORY, ..config };
        let (found, _) = pictures(&mut CoefficientScene::new(file.open(), SplatSource::Coefficients), &emission);
        assert!(found.iter().all(|v| !v.is_nan()) && found.iter().any(|v| v.is_infinite()));
    }
}
