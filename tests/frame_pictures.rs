//! Pictures of single frames against brute force (eq 4 and 12).

use crate::common::views::{SKEWED, archive, field, largest, rounding, truth, values, view};
use crate::common::{MEMORY, direct, looking, pictures, rendered, rendered_if_it_can_be};
use crate::reference::splat::BACKGROUND;
use wavesplat::base::error::Error;
use wavesplat::base::grid::{Grid, Region};
use wavesplat::base::sample::SampleType;
use wavesplat::render::{Quantity, RenderConfig};
use wavesplat::view::camera::View;

/// Grid, view and tau.
fn scenes() -> Vec<(Grid, View, f64)> {
    let size = [40, 33];
    let cube = Grid::unit([6, 7, 8]);
    vec![
        (cube, view(30.0, 30.0, size), 0.0),
        (cube, view(0.0, 0.0, size), 0.0),
        (cube, view(90.0, 0.0, size), 0.2),
        (cube, view(0.0, 90.0, size), 0.0),
        (cube, view(0.0, -90.0, size), 0.5),
        (cube, View { roll: 33.0, ..view(-100.0, -20.0, [17, 64]) }, 0.0),
        (SKEWED, view(200.0, 55.0, size), 0.3),
        (SKEWED, View { roll: 90.0, ..view(0.0, 0.0, size) }, 0.0),
        (SKEWED, View { scale: Some(5.5), center: Some([-37.0, 4.0, 1001.0]), ..view(61.0, 12.0, [70, 20]) }, 0.1),
        (SKEWED, View { scale: Some(0.4), ..view(61.0, 12.0, [9, 9]) }, 0.0),
        (Grid::unit([12, 1, 9]), view(15.0, 10.0, size), 0.0),
        (Grid::unit([12, 1, 1]), view(0.0, 0.0, size), 0.0),
        (Grid::unit([1, 1, 1]), view(77.0, 5.0, [31, 31]), 1.0),
        (Grid { spacing: [0.002, 0.002, 0.004], ..Grid::unit([8, 8, 3]) }, view(30.0, 45.0, size), 40.0),
    ]
}

#[test]
fn the_exact_method_is_within_a_millionth_of_brute_force() {
    for (n, (grid, view, tau)) in scenes().into_iter().enumerate() {
        for frames in [1, 3] {
            let memory = archive(grid, SampleType::F64, &field(&grid, frames, n as u64));
            let mut scene = direct(&memory, None);
            let config = looking(view, tau, Quantity::Emission, &grid, frames);
            let (emission, report) = pictures(&mut scene, &config);
            let expected = truth(&grid, &config, report.views[0].scale, &values(&memory, SampleType::F64), None);
            let most = 1e-6 * largest(&expected.emission);
            for (found, expected) in emission.iter().zip(&expected.emission) {
                assert!((f64::from(*found) - expected).abs() <= most, "scene {n}: {found} for {expected}");
            }
            let (mean, _) = pictures(&mut scene, &RenderConfig { quantity: Quantity::Mean, ..config });
            let most = 1e-6 * largest(&expected.mean);
            for (found, expected) in mean.iter().zip(&expected.mean) {
                assert_eq!(found.is_nan(), expected.is_nan(), "scene {n}");
                let off = (f64::from(*found) - expected).abs();
                assert!(found.is_nan() || off <= most, "scene {n}: {found} for {expected}");
            }
        }
    }
}

#[test]
fn every_footprint_keeps_the_error_that_it_states() {
    let mut names = Vec::new();
    for (n, (grid, view, tau)) in scenes().into_iter().enumerate() {
        let memory = archive(grid, SampleType::F64, &field(&grid, 2, n as u64));
        let samples = values(&memory, SampleType::F64);
        let (lo, hi) = samples.iter().fold((f64::MAX, f64::MIN), |(lo, hi), v| (lo.min(*v), hi.max(*v)));
        let mut scene = direct(&memory, None);
        let mut background: Option<Vec<bool>> = None;
        for error in [5e-2, 1e-2, 2e-3, 2e-4, 2e-5, 0.0] {
            for quantity in [Quantity::Emission, Quantity::Mean] {
                let plain = looking(view, tau, quantity, &grid, 2);
                let config = RenderConfig { splat_error: error, ..plain };
                let (found, report) = pictures(&mut scene, &config);
                assert!(report.views[0].stated_splat_error <= config.splat_error || error == 0.0);
                let truth = truth(&grid, &config, report.views[0].scale, &samples, None);
                let (expected, unit) = match quantity {
                    Quantity::Emission => (&truth.emission, largest(&samples) * truth.largest_weight),
                    Quantity::Mean => (&truth.mean, hi - lo),
                };
                for (at, (found, expected)) in found.iter().zip(expected).enumerate() {
                    let off = (f64::from(*found) - expected).abs();
                    let share = truth.weight[at] / truth.largest_weight;
                    let less = if quantity == Quantity::Mean { 1.0 / share } else { 1.0 };
                    let most = report.views[0].stated_splat_error * unit * less + rounding(*found);
                    assert!(
                        found.is_nan() || off <= most,
                        "scene {n}, {}: {found} for {expected}",
                        report.views[0].method
                    );
                }
                if quantity == Quantity::Mean {
                    let nan: Vec<bool> = found.iter().map(|v| v.is_nan()).collect();
                    assert_eq!(background.get_or_insert(nan.clone()), &nan, "scene {n}, {}", report.views[0].method);
                }
                names.push(report.views[0].method);
            }
        }
    }
    names.sort_unstable();
    names.dedup();
    assert_eq!(names.len(), 7, "every footprint is met, and the lattice");
}

#[test]
fn a_narrow_kernel_on_a_turned_lattice_keeps_the_stated_error() {
    // Four voxels around a pixel's centre, all just beyond the cut.
    let grid = Grid::unit([2, 1, 2]);
    let memory = archive(grid, SampleType::F64, &[1.0; 4]);
    for sigma in [0.2, 0.2357, 0.17] {
        for error in [0.0445, 0.01, 0.002, 2e-4] {
            let view = View { roll: 45.0, ..view(0.0, 0.0, [33, 33]) };
            let mut config = looking(view, 0.0, Quantity::Emission, &grid, 1);
            (config.kernel.sigma, config.splat_error) = (sigma, error);
            let (found, report) = pictures(&mut direct(&memory, None), &config);
            let truth = truth(&grid, &config, report.views[0].scale, &[1.0; 4], None);
            // The largest weight is at a voxel itself, whatever pixels are near it.
            let brightest = 1.0 / (2.0 * std::f64::consts::PI * sigma * sigma);
            for (found, expected) in found.iter().zip(&truth.emission) {
                let off = (f64::from(*found) - expected).abs();
                assert!(
                    off <= report.views[0].stated_splat_error * brightest + rounding(*found),
                    "{found} for {expected}"
                );
            }
        }
    }
}

#[test]
fn missing_samples_are_in_neither_sum() {
    let grid = SKEWED;
    let mut samples = field(&grid, 4, 5);
    let voxels = grid.whole().voxels();
    let missing: Vec<bool> =
        (0..samples.len()).map(|i| i % 7 == 3 || i % voxels < 70 || i / voxels == 2 && i % 9 < 5).collect();
    for (value, missing) in samples.iter_mut().zip(&missing) {
        *value = if *missing { [f64::NAN, f64::INFINITY, -999.0][value.to_bits() as usize % 3] } else { *value };
    }
    let memory = archive(grid, SampleType::F64, &samples);
    for (n, (azimuth, elevation, tau)) in [(30.0, 30.0, 0.0), (0.0, 0.0, 0.3), (0.0, 90.0, 0.0)].into_iter().enumerate()
    {
        for quantity in [Quantity::Emission, Quantity::Mean] {
            let config = looking(view(azimuth, elevation, [40, 30]), tau, quantity, &grid, 4);
            let (found, report) = pictures(&mut direct(&memory, Some(-999.0)), &config);
            let truth = truth(&grid, &config, report.views[0].scale, &samples, Some(&missing));
            let expected = if quantity == Quantity::Mean { &truth.mean } else { &truth.emission };
            for (found, e) in found.iter().zip(expected) {
                assert_eq!(found.is_nan(), e.is_nan(), "view {n}");
                assert!(
                    found.is_nan() || (f64::from(*found) - e).abs() <= 1e-6 * largest(expected),
                    "view {n}: {found} {e}"
                );
            }
        }
    }
}

#[test]
fn a_region_is_splatted_alone_and_in_its_place() {
    let (grid, region) = (SKEWED, Region { start: [2, 0, 1], end: [7, 5, 4] });
    let memory = archive(grid, SampleType::F64, &field(&grid, 3, 8));
    let samples = values(&memory, SampleType::F64);
    let inside = |voxel: usize| {
        let [nx, ny, _] = grid.dims;
        let at = [voxel % nx, voxel / nx % ny, voxel / (nx * ny)];
        (0..3).all(|a| (region.start[a]..region.end[a]).contains(&at[a]))
    };
    let outside: Vec<bool> = (0..samples.len()).map(|i| !inside(i % grid.whole().voxels())).collect();
    let plain = looking(view(40.0, 20.0, [40, 30]), 0.1, Quantity::Emission, &grid, 3);
    let config = RenderConfig { region: Some(region), ..plain };
    let (emission, report) = pictures(&mut direct(&memory, None), &config);
    let truth = truth(&grid, &config, report.views[0].scale, &samples, Some(&outside));
    for (found, e) in emission.iter().zip(&truth.emission) {
        assert!((f64::from(*found) - e).abs() <= 1e-6 * largest(&truth.emission));
    }
    let (mean, _) = pictures(&mut direct(&memory, None), &RenderConfig { quantity: Quantity::Mean, ..config });
    for ((found, e), w) in mean.iter().zip(&truth.emission).zip(&truth.weight) {
        // Pixels are background where the region's own weights are small.
        assert_eq!(found.is_nan(), *w < BACKGROUND * largest(&truth.weight));
        assert!(found.is_nan() || (f64::from(*found) - e / w).abs() <= 1e-6 * largest(&samples));
    }
}

#[test]
fn some_frames_equal_those_of_a_full_rendering() {
    let grid = SKEWED;
    let memory = archive(grid, SampleType::F32, &field(&grid, 40, 8));
    let config = looking(view(40.0, 20.0, [40, 30]), 0.1, Quantity::Mean, &grid, 40);
    let (all, _) = pictures(&mut direct(&memory, None), &config);
    let frames = vec![0, 5, 6, 31, 32, 39];
    let (some, _) = pictures(&mut direct(&memory, None), &RenderConfig { frames: frames.clone(), ..config });
    for (frame, picture) in frames.iter().zip(some.chunks_exact(1200)) {
        assert_eq!(bits(picture), bits(&all[frame * 1200..(frame + 1) * 1200]), "frame {frame}");
    }
}

pub(crate) fn bits(picture: &[f32]) -> Vec<u32> {
    picture.iter().map(|v| v.to_bits()).collect()
}

/// Compares the pictures under smaller and smaller memory budgets until rendering is refused. Returns how many budgets
/// sufficed.
pub(crate) fn under_less_memory(scene: &mut dyn wavesplat::render::Scene, config: &RenderConfig) -> usize {
    let (first, errors, _) = rendered(scene, config);
    let mut count = 0;
    for memory in [MEMORY, 160 << 20, 96 << 20, 64 << 20, 48 << 20, 32 << 20, 24 << 20, 18 << 20, 14 << 20, 10 << 20] {
        let config = RenderConfig { memory, ..config.clone() };
        let found = rendered_if_it_can_be(scene, &config);
        if let Err(Error::Setting { setting: "memory", .. }) = found {
            continue;
        }
        let (again, errors_again, _) = found.unwrap();
        assert_eq!(bits(&first), bits(&again), "{memory} bytes");
        assert_eq!(bits(&errors), bits(&errors_again), "{memory} bytes");
        count += 1;
    }
    count
}

#[test]
fn memory_changes_no_bit_of_a_picture() {
    let grid = Grid::unit([20, 18, 16]);
    let mut samples = field(&grid, 9, 3);
    for quantity in [Quantity::Mean, Quantity::Emission] {
        let config = looking(view(30.0, 25.0, [200, 150]), 0.05, quantity, &grid, 9);
        let memory = archive(grid, SampleType::F32, &samples);
        assert!(under_less_memory(&mut direct(&memory, None), &config) >= 4);
    }
    samples.iter_mut().enumerate().for_each(|(i, v)| *v = if i % 3 == 0 || i % 5760 < 900 { f64::NAN } else { *v });
    let memory = Vec::from_iter(samples.iter().flat_map(|v| (*v as f32).to_le_bytes()));
    let memory = crate::common::memory::Memory::new(grid, SampleType::F32, memory);
    let config = looking(view(30.0, 25.0, [200, 150]), 0.05, Quantity::Mean, &grid, 9);
    assert!(under_less_memory(&mut direct(&memory, None), &config) >= 4);
}
