//! Certified composites and isosurfaces (eq 49, 50): no pixel is further from the same drawing of any original than its certificate
//! says.
//!
//! An original is any archive within the errors that the file states. The tests draw many, also such that are chosen to move a
//! pixel as far as they can. A drawing of the original's samples states its own rounding; nothing else is allowed.

use crate::common::memory::Memory;
use crate::common::random::Random;
use crate::common::views::{SKEWED, archive, field, values, view};
use crate::common::{Stored, direct, extracted, is_taken, looking, rendered, settings, stored};
use crate::frame_pictures::under_less_memory;
use wavesplat::base::grid::{Grid, Region};
use wavesplat::base::sample::SampleType;
use wavesplat::colour::TransferFunction;
use wavesplat::convert::{Basis, Bound, ConvertConfig};
use wavesplat::render::{CoefficientScene, Light, Mode, Plane, Quantity, RenderConfig, SplatSource, Surface, render};
use wavesplat::view::camera::View;

const TYPE: SampleType = SampleType::F64;

/// Samples as a file gives them back, and how far the original's may be off.
struct Decoded {
    file: Stored,
    samples: Vec<f64>,
    off: Vec<f64>,
}

impl Decoded {
    fn new(grid: Grid, source: &Memory, config: &ConvertConfig) -> Self {
        let stored = stored(&mut source.clone(), config);
        let file = stored.open();
        let samples = values(&archive_of(grid, extracted(&file)), TYPE);
        let voxels = grid.whole().voxels();
        let mut off = vec![0.0; samples.len()];
        for window in 0..file.metadata().windows.len() as u32 {
            let frames = file.window_range(window);
            for entry in file.leaves(window).iter().flat_map(|leaf| file.leaf(leaf).unwrap()) {
                for voxel in file.blocks.region(entry.id.block as usize).iter() {
                    let at = grid.whole().index(voxel);
                    frames.clone().for_each(|frame| off[frame * voxels + at] = entry.stats.reached);
                }
            }
        }
        Self { file: stored, samples, off }
    }

    /// An original: the samples, each off by a share of what it may be.
    fn original(&self, grid: Grid, mut share: impl FnMut(usize) -> f64) -> Memory {
        let sample = |(i, (v, off)): (usize, (&f64, &f64))| v + share(i).clamp(-1.0, 1.0) * off;
        archive(grid, TYPE, &Vec::from_iter(self.samples.iter().zip(&self.off).enumerate().map(sample)))
    }
}

fn archive_of(grid: Grid, bytes: Vec<u8>) -> Memory {
    Memory::new(grid, TYPE, bytes)
}

/// The light of a drawing, and its certificate.
struct Certified {
    light: Vec<f32>,
    errors: Vec<f32>,
}

impl Certified {
    fn of_file(file: &Stored, config: &RenderConfig) -> Self {
        let (light, errors, report) =
            rendered(&mut CoefficientScene::new(file.open(), SplatSource::Coefficients), config);
        let largest = errors.iter().copied().fold(0.0, f32::max);
        assert_eq!(report.certified_error, Some(f64::from(largest)));
        assert_eq!(errors.len() * 4, light.len());
        Self { light, errors }
    }

    fn of_original(original: &Memory, config: &RenderConfig) -> Self {
        let (light, errors, _) = rendered(&mut direct(original, None), config);
        Self { light, errors }
    }

    /// The largest difference of each pixel's numbers.
    fn off(&self, other: &Self) -> Vec<f32> {
        let pixels = self.light.chunks_exact(4).zip(other.light.chunks_exact(4));
        pixels.map(|(a, b)| a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max)).collect()
    }

    /// Asserts that an original is within the certificate. Returns the largest share of it that a pixel uses.
    fn check(&self, original: &Self, name: &str) -> f32 {
        let mut used = 0.0_f32;
        for (at, off) in self.off(original).into_iter().enumerate() {
            let allowed = self.errors[at] + original.errors[at];
            assert!(off <= allowed, "{name}, pixel {at}: off by {off}, certified {allowed}");
            used = used.max(off / allowed);
        }
        used
    }
}

/// Smooth opacities, peaks whose ends lie between entries of the table, and nearly opaque ones.
fn opacities() -> [Vec<(f64, f64)>; 4] {
    [
        vec![(0.0, 0.0), (1.0, 0.2)],
        vec![(0.123, 0.0), (0.234, 0.8), (0.3217, 0.0), (0.6, 0.0), (0.61, 0.4), (1.0, 0.03)],
        vec![(0.3, 0.0), (1.0, 1.0)],
        vec![(0.0, 0.05), (1.0, 0.05)],
    ]
}

fn mode(points: &[(f64, f64)], range: (f64, f64), light: Option<Light>) -> Mode {
    let colours = TransferFunction::open("viridis").unwrap().with_opacity(points).unwrap().over(range).unwrap();
    Mode::Composite { transfer: colours, unit: None, slices: None, light, planes: Vec::new() }
}

fn certified(view: View, grid: &Grid, frames: usize, mode: Mode) -> RenderConfig {
    RenderConfig { certify: true, mode, ..looking(view, 0.0, Quantity::Mean, grid, frames) }
}

fn range(samples: &[f64]) -> (f64, f64) {
    let numbers = || samples.iter().copied().filter(|v| v.is_finite());
    (numbers().fold(f64::INFINITY, f64::min), numbers().fold(f64::NEG_INFINITY, f64::max))
}

/// Archives with and without missing samples, some of them far from zero.
fn sources(grid: Grid, frames: usize) -> Vec<Memory> {
    let plain = field(&grid, frames, 3);
    let masked = plain.iter().enumerate().map(|(i, v)| if i % 11 < 2 { f64::NAN } else { *v });
    let far = plain.iter().map(|v| v + 1e4);
    [plain.clone(), masked.collect(), far.collect()].iter().map(|samples| archive(grid, TYPE, samples)).collect()
}

const VIEWS: [(f64, f64); 4] = [(30.0, 20.0), (200.0, -35.0), (0.0, 0.0), (75.0, 80.0)];

/// Surfaces of one value, glass, two values in opposite orders, and close ones.
fn surfaces((least, largest): (f64, f64)) -> [Mode; 5] {
    let surface = |share: f64, opacity: f64| {
        let colour = [0.2 + 0.6 * share, 1.0 - share, 0.9 * share];
        Surface { value: least + share * (largest - least), colour, opacity }
    };
    let of = |surfaces: &[Surface]| Mode::Iso { surfaces: surfaces.to_vec(), slices: None, light: Light::default() };
    [
        of(&[surface(0.55, 1.0)]),
        of(&[surface(0.5, 0.4)]),
        of(&[surface(0.4, 0.5), surface(0.7, 1.0)]),
        of(&[surface(0.6, 0.7), surface(0.3, 0.3)]),
        of(&[surface(0.5, 0.6), surface(0.51, 0.6), surface(0.53, 1.0)]),
    ]
}

/// All modes that are certified beside projections.
fn modes(range: (f64, f64)) -> Vec<Mode> {
    let lights = [None, Some(Light::default())];
    let composites = opacities().into_iter().flat_map(|points| lights.map(|light| mode(&points, range, light)));
    composites.chain(surfaces(range)).collect()
}

#[test]
fn no_original_is_beyond_the_certificate() {
    let (grid, frames) = (SKEWED, 2);
    let (mut random, mut used, mut case) = (Random(5), [0.0_f32; 2], 0);
    for source in sources(grid, frames) {
        for tolerance in [0.05, 1e-3, 1e-7] {
            let config = ConvertConfig { block: Some(4), ..settings(Basis::Haar, 4, tolerance) };
            let decoded = Decoded::new(grid, &source, &config);
            for mode in modes(range(&decoded.samples)) {
                case += 1;
                if !is_taken(case, 5) {
                    continue;
                }
                let (azimuth, elevation) = VIEWS[case % VIEWS.len()];
                let config = certified(view(azimuth, elevation, [18, 15]), &grid, frames, mode);
                let found = Certified::of_file(&decoded.file, &config);
                let mut check = |original: &Memory, name: &str| {
                    let share = found.check(&Certified::of_original(original, &config), &format!("{name} {case}"));
                    used[kind(&config)] = used[kind(&config)].max(share);
                };
                check(&source, "the source");
                check(&decoded.original(grid, |_| 0.0), "what is decoded");
                for sign in [-1.0, 1.0] {
                    check(&decoded.original(grid, |_| sign), "all off alike");
                }
                check(&decoded.original(grid, |_| random.signed()), "random");
                check(&decoded.original(grid, |_| random.signed() * 1e9), "random signs");
            }
        }
    }
    assert!(used.iter().all(|used| *used > 0.5), "only {used:?} are used");
}

/// 0 of composites, 1 of surfaces.
fn kind(config: &RenderConfig) -> usize {
    usize::from(matches!(config.mode, Mode::Iso { .. }))
}

/// Looks for the original that moves a pixel farthest: layer by layer, samples are off to the side that moves it more.
#[test]
fn no_climbing_adversary_is_beyond_the_certificate() {
    let (grid, frames) = (SKEWED, 1);
    let source = archive(grid, TYPE, &field(&grid, frames, 8));
    let config = ConvertConfig { block: Some(4), ..settings(Basis::Haar, 4, 0.03) };
    let decoded = Decoded::new(grid, &source, &config);
    let mut used = [0.0_f32; 2];
    for (n, mode) in modes(range(&decoded.samples)).into_iter().enumerate() {
        let (azimuth, elevation) = VIEWS[n / 2 % VIEWS.len()];
        let config = certified(view(azimuth, elevation, [16, 12]), &grid, frames, mode);
        let found = Certified::of_file(&decoded.file, &config);
        for pixel in [70, 103] {
            used[kind(&config)] = used[kind(&config)].max(climb(&decoded, &found, &config, pixel));
        }
    }
    assert!(used.iter().all(|used| *used > 0.6), "only {used:?} are used");
}

/// The largest share of a certificate that a climb for one pixel uses.
fn climb(decoded: &Decoded, found: &Certified, config: &RenderConfig, pixel: usize) -> f32 {
    let part = |i: usize| i / 9 % 7 / 2 + i / 63 * 4; // rows of two along y, in every layer
    let mut signs = [1.0; 20];
    let (mut most, mut used) = (0.0, 0.0_f32);
    for turned in 0..signs.len() {
        signs[turned] *= -1.0;
        let original = Certified::of_original(&decoded.original(SKEWED, |i| signs[part(i)]), config);
        used = used.max(found.check(&original, "climbing"));
        let off = found.off(&original)[pixel];
        if off < most {
            signs[turned] *= -1.0;
        }
        most = off.max(most);
    }
    used
}

#[test]
fn a_looser_tolerance_is_certified() {
    let grid = Grid::unit([16, 8, 8]);
    let noise = field(&grid, 8, 4);
    let samples: Vec<f64> = (0..noise.len()).map(|i| if i % 16 < 8 { 0.5 } else { noise[i] }).collect();
    let source = archive(grid, TYPE, &samples);
    let file = ConvertConfig { block: Some(4), ..settings(Basis::Haar, 8, 0.002) };
    let file = stored(&mut source.clone(), &file);
    let config = certified(view(30.0, 20.0, [24, 20]), &grid, 8, mode(&opacities()[0], range(&samples), None));
    let largest = [0.0, 1.0, 4.0, 100.0].map(|allowed| {
        let config = RenderConfig { allowed: Some(allowed), ..config.clone() };
        let found = Certified::of_file(&file, &config);
        found.check(&Certified::of_original(&source, &config), "looser");
        found.errors.into_iter().fold(0.0, f32::max)
    });
    assert!(largest.is_sorted() && largest[3] > 4.0 * largest[0], "{largest:?}");
}

#[test]
fn certificates_are_tighter_where_blocks_did_better() {
    let grid = Grid::unit([16, 8, 8]);
    let noise = field(&grid, 8, 4);
    let samples: Vec<f64> = (0..noise.len()).map(|i| if i % 16 < 12 { 0.0 } else { noise[i] }).collect();
    let file = ConvertConfig { bound: Bound::Rms, block: Some(4), ..settings(Basis::Haar, 8, 0.02) };
    let file = stored(&mut archive(grid, TYPE, &samples), &file);
    let region = Some(Region { start: [0; 3], end: [8, 8, 8] });
    let mode = mode(&opacities()[3], range(&samples), None);
    let config = certified(view(0.0, 0.0, [24, 20]), &grid, 8, mode);
    let largest = |region| {
        let errors = Certified::of_file(&file, &RenderConfig { region, ..config.clone() }).errors;
        errors.into_iter().fold(0.0, f32::max)
    };
    assert!(largest(region) < 1e-4 && largest(None) > 1e-3, "{} {}", largest(region), largest(None));
}

#[test]
fn memory_changes_no_bit_of_a_certificate() {
    let grid = Grid::unit([20, 18, 16]);
    let source = archive(grid, TYPE, &field(&grid, 12, 3));
    let file = stored(&mut source.clone(), &ConvertConfig { block: Some(4), ..settings(Basis::Haar, 8, 0.01) });
    let range = range(&values(&source, TYPE));
    let [surfaces, ..] = surfaces(range);
    for mode in [mode(&opacities()[1], range, Some(Light::default())), surfaces] {
        let config = certified(view(30.0, 25.0, [60, 50]), &grid, 12, mode);
        assert!(under_less_memory(&mut CoefficientScene::new(file.open(), SplatSource::Coefficients), &config) >= 3);
        assert!(under_less_memory(&mut direct(&source, None), &config) >= 3);
    }
}

/// A ball, whose surface faces the viewer in most pixels: it is the more certain, the smaller the errors of samples are.
#[test]
fn surfaces_are_certain_where_errors_are_small() {
    let grid = Grid { dims: [22, 20, 24], spacing: [1.0, 1.1, 0.9], origin: [0.0; 3] };
    let distance = |voxel: [usize; 3]| -> f64 {
        (0..3).map(|i| ((voxel[i] as f64 - 10.5) * grid.spacing[i]).powi(2)).sum::<f64>().sqrt()
    };
    let samples = Vec::from_iter(grid.whole().iter().map(|voxel| 10.0 - distance(voxel)));
    let source = archive(grid, TYPE, &samples);
    let share = |tolerance: f64, mode: &Mode| {
        let file = stored(&mut source.clone(), &settings(Basis::Haar, 1, tolerance));
        let found = Certified::of_file(&file, &certified(view(25.0, 15.0, [60, 50]), &grid, 1, mode.clone()));
        let seen = Vec::from_iter(found.errors.iter().zip(found.light.chunks_exact(4)).filter(|(_, l)| l[3] > 0.0));
        let certain = seen.iter().filter(|(error, _)| **error < 0.05).count();
        certain as f64 / seen.len() as f64
    };
    for mode in &surfaces(range(&samples))[..2] {
        let shares = [1e-2, 1e-3, 1e-4, 1e-7].map(|tolerance| share(tolerance, mode));
        assert!(shares.is_sorted() && shares[2] > 0.8 && shares[3] > 0.9, "{shares:?}");
    }
}

/// One block of a long volume is far off, and the others are exact: the certificate knows where, from every side.
#[test]
fn only_what_a_bad_block_reaches_is_uncertain() {
    let grid = Grid { dims: [28, 20, 18], spacing: [1.0, 1.2, 0.8], origin: [0.0; 3] };
    for (n, axis) in [0, 1, 2, 0, 1, 2].into_iter().enumerate() {
        let noise = field(&grid, 1, 9);
        let bad = [[20, 4, 4], [8, 12, 4], [0, 0, 0], [12, 8, 8], [24, 0, 4], [16, 16, 0]][n];
        let is_bad = |voxel: [usize; 3]| (0..3).all(|a| voxel[a] / 4 == bad[a] / 4);
        let whole = grid.whole();
        let sample = |(i, voxel): (usize, [usize; 3])| if is_bad(voxel) { noise[i] } else { 0.0 };
        let samples = Vec::from_iter(whole.iter().enumerate().map(sample));
        let source = archive(grid, TYPE, &samples);
        let config = ConvertConfig { block: Some(4), ..settings(Basis::Haar, 1, 0.05) };
        let decoded = Decoded::new(grid, &source, &config);
        let turned = if n < 3 { 0.0 } else { 180.0 };
        let view =
            [view(90.0 + turned, 10.0, [24, 20]), view(turned, 15.0, [24, 20]), view(5.0, 85.0 - turned, [24, 20])]
                [axis];
        let light = (n % 2 == 0).then_some(Light { ambient: 2.0, diffuse: 2.0, specular: 2.0, ..Light::default() });
        let region = (n > 3).then_some(Region { start: [1, 0, 1], end: [27, 19, 18] });
        let mut config =
            RenderConfig { region, ..certified(view, &grid, 1, mode(&opacities()[n % 4], range(&samples), light)) };
        config.kernel.sigma *= [1.0, 0.4, 2.0][n % 3];
        let found = Certified::of_file(&decoded.file, &config);
        let mut moved = 0.0_f32;
        for sign in [-1.0, 1.0] {
            let original = Certified::of_original(&decoded.original(grid, |_| sign), &config);
            found.check(&original, &format!("bad block {n}"));
            moved = found.off(&original).into_iter().fold(moved, f32::max);
        }
        let certain = found.errors.iter().filter(|error| **error < 0.05).count();
        assert!(moved > 1e-4 && 4 * certain > found.errors.len(), "{n}: moved by {moved}, {certain} certain");
    }
}

/// Whether samples of a transparent block are missing must not matter to the rest of a certified drawing.
#[test]
fn missing_samples_far_away_change_nothing() {
    let grid = Grid::unit([24, 8, 8]);
    let noise = field(&grid, 1, 2);
    let far = |i: usize| i % 24 >= 16;
    let sample = |i: usize| if far(i) { if i.is_multiple_of(5) { f64::NAN } else { -9.0 } } else { noise[i] };
    let source = archive(grid, TYPE, &Vec::from_iter((0..noise.len()).map(sample)));
    let config = ConvertConfig { block: Some(8), ..settings(Basis::Haar, 1, 1e-9) };
    let decoded = Decoded::new(grid, &source, &config);
    let mut config = certified(view(0.0, 0.0, [24, 20]), &grid, 1, mode(&opacities()[0], (-3.0, 9.0), None));
    config.kernel.sigma = 0.71;
    let found = Certified::of_file(&decoded.file, &config);
    found.check(&Certified::of_original(&source, &config), "missing far away");
}

/// Plateaus just below a surface: in the original, it may or may not show around them.
#[test]
fn surfaces_that_are_almost_reached_are_certified() {
    let (grid, frames) = (SKEWED, 1);
    let samples = Vec::from_iter(field(&grid, frames, 6).into_iter().map(|v| v.min(1.0)));
    let source = archive(grid, TYPE, &samples);
    let (mut random, mut shown) = (Random(2), 0);
    for tolerance in [1e-5, 1e-3] {
        let config = ConvertConfig { block: Some(4), ..settings(Basis::Haar, 1, tolerance) };
        let decoded = Decoded::new(grid, &source, &config);
        let error = decoded.off.iter().copied().fold(0.0, f64::max);
        for (n, beyond) in [0.2, 0.9, 1.5, 30.0].into_iter().enumerate() {
            let surface = Surface { value: 1.0 + beyond * error, colour: [0.9, 0.5, 0.2], opacity: [1.0, 0.5][n % 2] };
            let mode = Mode::Iso { surfaces: vec![surface], slices: None, light: Light::default() };
            let (azimuth, elevation) = VIEWS[n];
            let config = certified(view(azimuth, elevation, [[9, 8], [20, 18]][n / 2]), &grid, frames, mode);
            let found = Certified::of_file(&decoded.file, &config);
            shown += found.light.chunks_exact(4).filter(|pixel| pixel[3] > 0.0).count();
            found.check(&Certified::of_original(&source, &config), "the source");
            for sign in [-1.0, 1.0] {
                found.check(&Certified::of_original(&decoded.original(grid, |_| sign), &config), "all off alike");
            }
            found.check(&Certified::of_original(&decoded.original(grid, |_| random.signed() * 1e9), &config), "random");
        }
    }
    assert!(shown > 20, "{shown} pixels show a surface");
}

#[test]
fn modes_that_cannot_be_certified_are_refused() {
    let grid = Grid::unit([6, 6, 6]);
    let source = archive(grid, TYPE, &field(&grid, 2, 3));
    let Mode::Composite { transfer, .. } = mode(&opacities()[0], (-3.0, 3.0), None) else { unreachable!() };
    let planes = vec![Plane { axis: 2, at: 3.0 }];
    let with_planes = Mode::Composite { transfer, unit: None, slices: None, light: None, planes: planes.clone() };
    for mode in [with_planes, Mode::Mip { slices: None }, Mode::Planes { planes, panels: Vec::new() }] {
        let config = certified(view(0.0, 0.0, [8, 8]), &grid, 2, mode);
        let refused = render(&mut direct(&source, None), &config, &wavesplat::base::progress::Silent, &mut |_| Ok(()));
        assert!(refused.unwrap_err().to_string().contains("composites without planes"));
    }
}
