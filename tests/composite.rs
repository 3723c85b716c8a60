//! Colour and opacity along the ray, and largest values: compared with brute force, and with finer slices.

use crate::common::views::{archive, field, of_reference, view};
use crate::common::{Stored, direct, looking, pictures, settings, stored};
use crate::frame_pictures::{bits, under_less_memory};
use crate::reference::ray::Rays;
use wavesplat::base::error::Error;
use wavesplat::base::grid::{Grid, Region};
use wavesplat::base::sample::SampleType;
use wavesplat::colour::{ColourSpace, TransferFunction};
use wavesplat::convert::{Basis, ConvertConfig, SchemeConstraint};
use wavesplat::render::{CoefficientScene, Mode, Quantity, RenderConfig, Scene, SplatSource};
use wavesplat::view::camera::{Camera, View};
use wavesplat::view::footprint::Kernel;

const FRAMES: usize = 5;
const GRID: Grid = Grid { dims: [13, 9, 11], spacing: [1.0, 0.8, 1.2], origin: [5.0, -2.0, 100.0] };

/// From transparent blue at -1 over green to red at 4.
const COLOURS: [(f64, [f64; 3]); 3] = [(-1.0, [0.1, 0.2, 1.0]), (1.5, [0.2, 1.0, 0.1]), (4.0, [1.0, 0.1, 0.0])];
const OPACITIES: [(f64, f64); 3] = [(0.0, 0.0), (2.0, 0.3), (3.5, 0.9)];
const UNIT: f64 = 1.5;

fn transfer() -> TransferFunction {
    TransferFunction::from_points(COLOURS.to_vec(), ColourSpace::Rgb, Some(OPACITIES.to_vec()), None).unwrap()
}

/// The transfer function in the reference's terms.
fn medium(value: f64) -> [f64; 4] {
    let linear = |points: &[(f64, f64)]| {
        let mut found = points[0].1;
        for ends in points.windows(2) {
            if value > ends[0].0 {
                let share = ((value - ends[0].0) / (ends[1].0 - ends[0].0)).min(1.0);
                found = ends[0].1 + share * (ends[1].1 - ends[0].1);
            }
        }
        found
    };
    let channel = |i: usize| linear(&COLOURS.map(|(v, colour)| (v, colour[i])));
    [channel(0), channel(1), channel(2), -(1.0 - linear(&OPACITIES)).ln() / UNIT]
}

fn composite(slices: Option<usize>) -> Mode {
    Mode::Composite { transfer: transfer(), unit: Some(UNIT), slices, light: None, planes: Vec::new() }
}

fn seen(view: View, grid: &Grid, mode: Mode) -> RenderConfig {
    let looking = looking(view, 0.0, Quantity::Mean, grid, FRAMES);
    RenderConfig { mode, kernel: Kernel { follows_axes: false, ..looking.kernel }, ..looking }
}

fn views() -> [View; 3] {
    [
        view(30.0, 25.0, [30, 26]),
        View { roll: 40.0, ..view(200.0, -70.0, [28, 30]) },
        View { scale: Some(1.3), ..view(0.0, 0.0, [24, 20]) },
    ]
}

/// The steps of the reference along a ray.
const STEPS: usize = 100;

/// What brute force gives for every component of all pixels in all frames; `None` where it has no number.
fn brute_force(
    (grid, config): (&Grid, &RenderConfig),
    samples: &[f64],
    expected: impl Fn(&Rays<'_>, [usize; 2]) -> Vec<Option<f64>>,
) -> Vec<Option<f64>> {
    let scale = Camera::new(&config.views[0], grid).unwrap().scale;
    let (lattice, view) = of_reference(grid, config, scale);
    let [width, height] = config.views[0].size;
    let frames = samples.chunks_exact(grid.whole().voxels());
    let rays = frames.map(|values| Rays { lattice: &lattice, view: &view, values });
    let pixels = |rays: Rays<'_>| -> Vec<Option<f64>> {
        (0..width * height).flat_map(|pixel| expected(&rays, [pixel % width, pixel / width])).collect()
    };
    rays.flat_map(pixels).collect()
}

/// The largest difference of any component from brute force.
fn largest_difference(found: &[f32], expected: &[Option<f64>]) -> f64 {
    assert_eq!(found.len(), expected.len());
    let (mut largest, mut count) = (0.0_f64, 0);
    for (n, (found, expected)) in found.iter().zip(expected).enumerate() {
        let Some(expected) = expected else { continue };
        assert_eq!(found.is_nan(), expected.is_nan(), "number {n}: {found} for {expected}");
        largest = largest.max(if found.is_nan() { 0.0 } else { (f64::from(*found) - expected).abs() });
        count += usize::from(!found.is_nan());
    }
    assert!(count > found.len() / 8, "{count} of {}", found.len());
    largest
}

fn integral(rays: &Rays<'_>, pixel: [usize; 2]) -> Vec<Option<f64>> {
    rays.integral(pixel, STEPS, &medium).map(Some).to_vec()
}

/// All samples are stored exactly, so that only splatting is approximate. Blocks are small, so that there are many.
fn exact(samples: &[f64], coding: impl Into<SchemeConstraint>) -> Stored {
    let config = ConvertConfig { block: Some(5), coding: coding.into(), ..settings(Basis::Haar, 4, 0.0) };
    stored(&mut archive(GRID, SampleType::F64, samples), &config)
}

fn scene(stored: &Stored) -> CoefficientScene {
    CoefficientScene::new(stored.open(), SplatSource::Coefficients)
}

fn with_holes(mut samples: Vec<f64>) -> Vec<f64> {
    let voxels = GRID.whole().voxels();
    for (i, v) in samples.iter_mut().enumerate() {
        if i % voxels % 7 == 3 || i % 11 == 5 {
            *v = f64::NAN;
        }
    }
    samples
}

#[test]
fn composites_are_those_of_brute_force() {
    for (n, view) in views().into_iter().enumerate() {
        let samples = field(&GRID, FRAMES, n as u64);
        let samples = if n == 1 { with_holes(samples) } else { samples };
        let file = exact(&samples, Basis::Haar);
        let expected = brute_force((&GRID, &seen(view, &GRID, composite(None))), &samples, integral);
        for (slices, most) in [(None, 8e-2), (Some(4), 2e-2)] {
            let config = seen(view, &GRID, composite(slices));
            let mut scenes: [Box<dyn Scene>; 2] =
                [Box::new(scene(&file)), Box::new(direct(&archive(GRID, SampleType::F64, &samples), None))];
            for scene in &mut scenes {
                let (found, report) = pictures(scene.as_mut(), &config);
                let off = largest_difference(&found, &expected);
                assert!(off < most, "view {n}, {slices:?} slices: {off:e}");
                assert!(report.views[0].probed.is_some_and(|probed| probed.largest < most), "{report:?}");
            }
        }
    }
}

#[test]
fn finer_slices_come_nearer_to_the_integral_along_the_ray() {
    let grid = Grid { dims: [9, 8, 7], ..GRID };
    let samples = field(&grid, FRAMES, 5);
    let memory = archive(grid, SampleType::F64, &samples);
    for view in [view(30.0, 25.0, [34, 32]), view(0.0, 90.0, [32, 32])] {
        let expected = brute_force((&grid, &seen(view, &grid, composite(None))), &samples, integral);
        let error = |slices: usize| {
            let config = seen(view, &grid, composite(Some(slices)));
            let (found, _) = pictures(&mut direct(&memory, None), &config);
            largest_difference(&found, &expected)
        };
        let errors = [1, 2, 4].map(error);
        assert!(errors.windows(2).all(|pair| pair[1] < 0.5 * pair[0]) && errors[2] < 2e-2, "{errors:?}");
    }
}

/// Pixels whose largest value hardly any sample supports are ignored: they depend on where the kernel is cut.
#[test]
fn the_largest_value_is_that_of_brute_force() {
    for (n, view) in views().into_iter().enumerate() {
        let samples = field(&GRID, FRAMES, n as u64);
        let config = seen(view, &GRID, Mode::Mip { slices: Some(4) });
        let file = exact(&samples, SchemeConstraint::AUTO);
        let (found, _) = pictures(&mut scene(&file), &config);
        let camera = Camera::new(&view, &GRID).unwrap();
        let expected = brute_force((&GRID, &config), &samples, |rays, pixel| {
            let (from, along) = camera.ray(pixel.map(|n| n as f64 + 0.5));
            let largest = |beyond: f64| {
                let place = |a: usize, depth: f64| (from[a] + depth * along[a] - GRID.origin[a]) / GRID.spacing[a];
                let is_within = |depth: f64| {
                    let end = |a: usize| GRID.dims[a] as f64 - 0.5 + beyond;
                    (0..3).all(|a| (-0.5 - beyond..=end(a)).contains(&place(a, depth)))
                };
                rays.largest(pixel, STEPS, &is_within)
            };
            let [low, high] = [0.15, -0.15].map(largest);
            vec![Some(low).filter(|low| (low - high).abs() < 1e-3)]
        });
        let off = largest_difference(&found, &expected);
        assert!(off < 0.2, "view {n}: {off:e}");
    }
}

/// The error of a mean is at most that of its samples, and so is the error of the largest of several means. A parabola
/// through three of them, and four by four cells around a pixel, may each have a little more.
#[test]
fn the_bound_holds_for_the_largest_value() {
    let samples = field(&GRID, FRAMES, 9);
    let whole = exact(&samples, Basis::Haar);
    const MORE: f64 = 1.25 * 1.25 * 1.25; // sums of absolute weights
    for (tolerance, basis) in [(0.05, Basis::Haar), (0.01, Basis::Samples), (0.02, Basis::Learned)] {
        let config = ConvertConfig { block: Some(6), ..settings(basis, 4, tolerance) };
        let lossy = stored(&mut archive(GRID, SampleType::F64, &samples), &config);
        let delta = lossy.report.delta;
        let config = seen(view(30.0, 25.0, [30, 26]), &GRID, Mode::Mip { slices: None });
        let (expected, _) = pictures(&mut scene(&whole), &config);
        let (found, _) = pictures(&mut CoefficientScene::new(lossy.open(), SplatSource::Coefficients), &config);
        for (found, expected) in found.iter().zip(&expected) {
            let off = f64::from((found - expected).abs());
            assert!(found.is_nan() && expected.is_nan() || off <= MORE * delta, "{found} for {expected}");
        }
    }
}

/// A small object in an empty volume, in front of a wall that hides everything behind it.
fn scene_with_a_wall(grid: &Grid) -> Vec<f64> {
    let value = |[x, y, z]: [usize; 3], t: usize| match y {
        y if y > grid.dims[1] - 25 => 0.0,
        y if y > grid.dims[1] - 35 => 4.0 + 0.1 * ((x + z + t) as f64).sin(),
        _ => 2.0 + (0.3 * (x + y + z + t) as f64).sin(),
    };
    (0..FRAMES).flat_map(|t| grid.whole().iter().map(move |v| value(v, t)).collect::<Vec<_>>()).collect()
}

#[test]
fn transparent_and_hidden_blocks_are_not_read() {
    let grid = Grid::unit([40, 64, 40]);
    let samples = scene_with_a_wall(&grid);
    let memory = archive(grid, SampleType::F32, &samples);
    let config = ConvertConfig { block: Some(8), ..settings(Basis::Haar, 8, 0.0) };
    let file = stored(&mut memory.clone(), &config);
    let close = View { scale: Some(6.0), ..view(0.0, 0.0, [96, 96]) };
    let config = RenderConfig { splat_error: 1e-4, ..seen(close, &grid, composite(None)) };
    let (found, report) = pictures(&mut CoefficientScene::new(file.open(), SplatSource::Coefficients), &config);
    let (whole, of_all) = pictures(&mut direct(&memory, None), &config);
    assert_eq!(found.len(), whole.len());
    let off = found.iter().zip(&whole).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
    assert!(off < 1e-5, "{off:e}");
    assert!(report.blocks_transparent > report.blocks / 10 && of_all.blocks_transparent == 0, "{report:?}");
    assert!(report.blocks_hidden > report.blocks / 10, "{report:?}");
    assert_eq!(report.blocks_read, report.blocks - report.blocks_transparent - report.blocks_hidden);
}

#[test]
fn memory_changes_no_bit_of_a_composite() {
    let samples = with_holes(field(&GRID, FRAMES, 3));
    let files = [exact(&samples, Basis::Haar), exact(&samples, SchemeConstraint::AUTO)];
    let part = Region { start: [6, 5, 5], end: [13, 9, 10] };
    for (splat_error, mode, region) in [
        (0.0, composite(Some(3)), Some(part)),
        (1e-3, composite(None), None),
        (1e-3, Mode::Mip { slices: None }, Some(part)),
    ] {
        let config = RenderConfig { splat_error, region, ..seen(view(30.0, 25.0, [100, 90]), &GRID, mode) };
        files.iter().for_each(|file| assert!(under_less_memory(&mut scene(file), &config) >= 3));
    }
}

/// Blocks behind a wall are hidden in some frames, and read for others: the wall moves.
#[test]
fn a_frame_is_the_same_alone_and_among_others() {
    let grid = Grid::unit([40, 64, 40]);
    let value = |[x, y, z]: [usize; 3], t: usize| match 54 - y.min(54) {
        0..12 => -1.0,
        depth if (12 + 4 * t..20 + 4 * t).contains(&depth) => 3.9 + 0.1 * ((x + z + t) as f64).sin(),
        depth if depth < 12 + 4 * t => -1.0,
        _ => 1.5 + 1.5 * (0.3 * (x + y + z + t) as f64).sin(),
    };
    let frame = |t: usize| grid.whole().iter().map(move |voxel| value(voxel, t)).collect::<Vec<_>>();
    let memory = archive(grid, SampleType::F32, &(0..FRAMES).flat_map(frame).collect::<Vec<_>>());
    let file = stored(&mut memory.clone(), &ConvertConfig { block: Some(5), ..settings(Basis::Haar, 8, 0.0) });
    let close = View { scale: Some(6.0), ..view(0.0, 0.0, [96, 96]) };
    let config = seen(close, &grid, composite(None));
    let mut scene = scene(&file);
    let (all, report) = pictures(&mut scene, &config);
    assert!(report.blocks_hidden > report.blocks / 20, "{report:?}");
    for (frame, expected) in all.chunks_exact(all.len() / FRAMES).enumerate() {
        let (alone, report) = pictures(&mut scene, &RenderConfig { frames: vec![frame], ..config.clone() });
        assert!(bits(&alone) == bits(expected), "{frame}");
        assert!(report.blocks_hidden > 0, "{frame}");
    }
}

#[test]
fn options_without_meaning_along_a_ray_are_refused() {
    let samples = field(&GRID, FRAMES, 3);
    let file = exact(&samples, Basis::Haar);
    let mut scene = scene(&file);
    let plain = seen(view(30.0, 25.0, [20, 20]), &GRID, composite(None));
    let with = |change: &dyn Fn(&mut RenderConfig)| {
        let mut config = plain.clone();
        change(&mut config);
        config
    };
    for (wrong, what) in [
        (with(&|c| c.kernel.tau = 0.1), "tau"),
        (with(&|c| c.quantity = Quantity::Emission), "quantity"),
        (with(&|c| c.mode = composite(Some(0))), "slices"),
        (with(&|c| c.mode = composite(Some(100_000))), "slices"),
    ] {
        let error = wavesplat::render::check(&scene, &wrong).unwrap_err();
        assert!(matches!(&error, Error::Setting { setting, .. } if *setting == what), "{error}");
    }
    assert!(!pictures(&mut scene, &plain).0.is_empty());
}
