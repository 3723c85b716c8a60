//! Deep volumes, whose coefficients are splatted on the lattice of the view, against footprints.

use crate::common::views::{archive, field, largest, rounding, truth, view};
use crate::common::{looking, pictures, settings, stored};
use crate::images::under_less_memory;
use wavesplat::camera::View;
use wavesplat::convert::{Coding, ConvertConfig};
use wavesplat::render::{CoefficientScene, Quantity, RenderConfig, What};
use wavesplat::sample::SampleType;
use wavesplat::volume::{Grid, Region};
use wavesplat::wavelet::Basis;

const FRAMES: usize = 9;

/// Nearly along the longest axis.
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
    let auto = ConvertConfig { coding: Coding::AUTO, ..settings(Basis::Haar, 9, 0.01) };
    [ConvertConfig { block: Some(16), ..haar }, auto.clone(), ConvertConfig { block: Some(13), ..auto }]
}

#[test]
fn a_lattice_keeps_the_error_that_it_states() {
    let mut found = 0;
    for (n, (grid, view, tau)) in scenes().into_iter().enumerate() {
        let mut samples = field(&grid, FRAMES, n as u64);
        samples.iter_mut().for_each(|v| *v += 20.0); // means must not suffer from an offset
        let config = looking(view, tau, Quantity::Emission, &grid, FRAMES);
        let scale = view.scale.unwrap();
        let brightest = truth(&grid, &config, scale, &vec![0.0; grid.whole().voxels()], None).largest_weight;
        for (i, convert) in configs().into_iter().enumerate() {
            let mut memory = archive(grid, SampleType::F64, &samples);
            let stored = stored(&mut memory, &convert);
            let mut scene = CoefficientScene::new(stored.open(), What::Coefficients);
            for quantity in [Quantity::Emission, Quantity::Mean] {
                let splat_error = if quantity == Quantity::Mean { 0.5 } else { 5e-3 };
                let plain = looking(view, tau, quantity, &grid, FRAMES);
                let region = Region { start: [1, 2, 3], ..grid.whole() };
                let region = (i == 1).then_some(region);
                let exact = RenderConfig { region, splat_error: 0.0, ..plain.clone() };
                let quick = RenderConfig { region, splat_error, ..plain };
                let ((expected, _), (pictures, report)) = (pictures(&mut scene, &exact), pictures(&mut scene, &quick));
                found += usize::from(report.method == "lattice");
                let (magnitude, range) = (1.01 * largest(&samples), 1.02 * span(&samples));
                let unit = if quantity == Quantity::Mean { range } else { magnitude * brightest };
                for (found, expected) in pictures.iter().zip(&expected) {
                    assert_eq!(found.is_nan(), expected.is_nan());
                    let most = (report.stated_splat_error + 1e-5) * unit + rounding(*found) + rounding(*expected);
                    let off = f64::from(*found) - f64::from(*expected);
                    assert!(found.is_nan() || off.abs() <= most, "scene {n}, {i}: {found} for {expected}");
                }
            }
        }
    }
    assert!(found >= 4, "{found} were splatted on a lattice");
}

fn span(samples: &[f64]) -> f64 {
    samples.iter().fold(f64::MIN, |m, v| m.max(*v)) - samples.iter().fold(f64::MAX, |m, v| m.min(*v))
}

#[test]
fn memory_changes_no_bit_of_a_lattice() {
    let (grid, view, tau) = scenes()[0];
    let mut memory = archive(grid, SampleType::F64, &field(&grid, FRAMES, 7));
    let stored = stored(&mut memory, &configs()[2]);
    let mut scene = CoefficientScene::new(stored.open(), What::Coefficients);
    let view = View { size: [150, 140], scale: Some(3.0), ..view };
    let config = RenderConfig { splat_error: 5e-3, ..looking(view, tau, Quantity::Emission, &grid, FRAMES) };
    assert_eq!(pictures(&mut scene, &config).1.method, "lattice");
    assert!(under_less_memory(&mut scene, &config) > 2);
}
