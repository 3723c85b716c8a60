//! Pictures from coefficients equal those of the decoded samples, and are within the bound of those of the source.

use crate::common::memory::Memory;
use crate::common::random::Random;
use crate::common::series::{Kind, Mask, volume};
use crate::common::views::{SKEWED, archive, field, largest, rounding, truth, values, view};
use crate::common::{Stored, direct, looking, pictures, settings, stored, windows};
use crate::frame_pictures::{bits, under_less_memory};
use wavesplat::base::grid::{Grid, Region};
use wavesplat::base::sample::SampleType;
use wavesplat::convert::{Basis, Bound, ConvertConfig};
use wavesplat::render::{CoefficientScene, Quantity, RenderConfig, SplatSource};
use wavesplat::source::FrameSource;
use wavesplat::view::camera::View;

const FRAMES: usize = 19;

pub(crate) struct Trial {
    pub(crate) name: &'static str,
    pub(crate) memory: Memory,
    pub(crate) config: ConvertConfig,
    pub(crate) file: Stored,
}

impl Trial {
    pub(crate) fn new(name: &'static str, memory: Memory, config: ConvertConfig) -> Self {
        let config = ConvertConfig { block: Some(4), ..config };
        let file = stored(&mut memory.clone(), &config);
        Self { name, memory, config, file }
    }

    pub(crate) fn grid(&self) -> Grid {
        self.memory.archive().grid
    }

    pub(crate) fn ty(&self) -> SampleType {
        self.memory.archive().sample
    }

    fn of(&self, what: SplatSource, config: &RenderConfig) -> Vec<f32> {
        pictures(&mut CoefficientScene::new(self.file.open(), what), config).0
    }

    fn deltas(&self) -> Vec<f64> {
        let file = self.file.open();
        (0..file.frames()).map(|f| file.metadata().windows[file.window_of(f) as usize].delta).collect()
    }
}

/// Half of the volume is 1e9, where the bound is near a unit in the last place; the other half is 1.
fn hard(grid: Grid) -> Memory {
    let mut random = Random(9);
    let height = |voxel: usize| if voxel % grid.dims[0] < 4 { 1.0 } else { 1e9 };
    let voxels = grid.whole().voxels();
    archive(grid, SampleType::F64, &Vec::from_iter((0..FRAMES * voxels).map(|i| random.signed() * height(i % voxels))))
}

fn masked(grid: Grid) -> Memory {
    let mut samples = field(&grid, FRAMES, 6);
    let voxels = grid.whole().voxels();
    for (i, value) in samples.iter_mut().enumerate() {
        if i % 11 == 3 || i % voxels < 60 || i / voxels == 9 && i % 4 > 0 || i / voxels == 12 {
            *value = if i % 2 == 0 { f64::NAN } else { f64::NEG_INFINITY };
        }
    }
    archive(grid, SampleType::F64, &samples)
}

/// Some voxels are within the bound of 0, the value that marks missing samples. Some of their samples have that value.
fn near_the_missing_value(grid: Grid) -> Memory {
    let mut samples = field(&grid, FRAMES, 6);
    let (voxels, mut random) = (grid.whole().voxels(), Random(3));
    for (i, value) in samples.iter_mut().enumerate().filter(|(i, _)| i % voxels % 17 == 4) {
        *value = if i % 5 == 0 { 0.0 } else { 1e-3 * random.signed() };
    }
    archive(grid, SampleType::F64, &samples)
}

/// Samples are `f64`, so the decoded samples are exactly the splatted values.
pub(crate) fn doubles() -> Vec<Trial> {
    let grid = SKEWED;
    let plain = || archive(grid, SampleType::F64, &field(&grid, FRAMES, 2));
    let rms = |basis, window| ConvertConfig { bound: Bound::Rms, ..settings(basis, window, 0.02) };
    let (haar, multi) =
        (|tolerance| settings(Basis::Haar, 8, tolerance), |tolerance| settings(Basis::Multi, 9, tolerance));
    let declared = |config| ConvertConfig { missing_value: Some(0.0), ..config };
    vec![
        Trial::new("haar", plain(), haar(0.02)),
        Trial::new("multi", plain(), multi(0.02)),
        Trial::new("haar, one window", plain(), settings(Basis::Haar, 32, 0.3)),
        Trial::new("haar, fine", plain(), haar(1e-6)),
        Trial::new("haar, rms", plain(), rms(Basis::Haar, 8)),
        Trial::new("multi, rms", plain(), rms(Basis::Multi, 17)),
        Trial::new("haar, masked", masked(grid), haar(0.05)),
        Trial::new("multi, masked", masked(grid), multi(0.01)),
        Trial::new("exact, masked", masked(grid), multi(0.0)),
        Trial::new("haar, hard", hard(grid), haar(HARD)),
        Trial::new("multi, hard", hard(grid), multi(HARD)),
        Trial::new("haar, outliers", near_the_missing_value(grid), declared(haar(0.02))),
        Trial::new("multi, outliers", near_the_missing_value(grid), declared(multi(0.02))),
        Trial::new("flat", archive(grid, SampleType::F64, &vec![0.1; FRAMES * 315]), haar(0.02)),
        Trial::new("one frame", archive(grid, SampleType::F64, &field(&grid, 1, 2)), haar(0.1)),
        Trial::new("pyramid", plain(), settings(Basis::Samples, 10, 0.02)),
        Trial::new("pyramid, fine", plain(), settings(Basis::Samples, 32, 1e-6)),
        Trial::new("pyramid, rms", plain(), rms(Basis::Samples, 8)),
        Trial::new("pyramid, masked", masked(grid), settings(Basis::Samples, 8, 0.01)),
        Trial::new("pyramid, hard", hard(grid), settings(Basis::Samples, 8, HARD)),
        Trial::new("pyramid, outliers", near_the_missing_value(grid), declared(settings(Basis::Samples, 8, 0.02))),
        Trial::new(
            "pyramid, one frame",
            archive(grid, SampleType::F64, &field(&grid, 1, 2)),
            settings(Basis::Samples, 4, 0.1),
        ),
        Trial::new("learned", plain(), settings(Basis::Learned, 10, 0.02)),
        Trial::new("learned, rms", plain(), rms(Basis::Learned, 32)),
        Trial::new("learned, masked", masked(grid), settings(Basis::Learned, 8, 0.01)),
        Trial::new("one frame, multi", archive(grid, SampleType::F64, &field(&grid, 1, 2)), multi(0.1)),
    ]
}

/// The tolerance gives a bound of a few units in the last place of 1e9.
const HARD: f64 = 2.5e-16;

pub(crate) fn views() -> [(View, f64); 3] {
    [(view(30.0, 30.0, [36, 28]), 0.0), (view(0.0, 90.0, [30, 30]), 0.0), (view(-70.0, -15.0, [28, 36]), 0.4)]
}

#[test]
fn the_hard_archive_has_outliers_and_exact_blocks() {
    let trials = doubles();
    let outliers = |t: &&Trial| t.file.report.outliers > 0;
    let exact = |t: &&Trial| {
        let file = t.file.open();
        let windows = 0..file.metadata().windows.len() as u32;
        windows.flat_map(|w| file.leaves(w)).any(|l| l.exact > 0 && l.coded > 0)
    };
    assert!(trials.iter().filter(outliers).count() >= 2, "no outliers");
    assert!(trials.iter().filter(exact).count() >= 2, "no exact blocks among coded ones");
}

#[test]
fn coefficients_show_what_the_decoded_samples_show() {
    for trial in doubles() {
        for (view, tau) in views() {
            for quantity in [Quantity::Mean, Quantity::Emission] {
                let config = looking(view, tau, quantity, &trial.grid(), trial.file.open().frames());
                let (a, b) = (trial.of(SplatSource::Coefficients, &config), trial.of(SplatSource::Samples, &config));
                let most = 1e-9 * largest(&Vec::from_iter(a.iter().map(|v| f64::from(*v))));
                for (a, b) in a.into_iter().zip(b) {
                    assert_eq!(a.is_nan(), b.is_nan(), "{}", trial.name);
                    let off = f64::from(a) - f64::from(b);
                    let most = most + rounding(a) + rounding(b);
                    assert!(a.is_nan() || off.abs() <= most, "{}: {a} from coefficients, {b} from samples", trial.name);
                }
            }
        }
    }
}

/// Both pictures come from the same splat. So the comparison allows only the bound and half a unit in the last place
/// of each pixel's own `f32`. With missing samples it also allows the rounding that `f64` sums leave after an emission
/// is subtracted again. Weights are the reference's.
fn check_within_the_bound(trial: &Trial, region: Option<Region>) {
    let samples = values(&trial.memory, trial.ty());
    let missing: Vec<bool> = samples.iter().map(|v| !v.is_finite() || Some(*v) == trial.config.missing_value).collect();
    for (view, tau) in views() {
        let frames = trial.file.open().frames();
        let plain = looking(view, tau, Quantity::Mean, &trial.grid(), frames);
        let mean = RenderConfig { region, ..plain };
        let emission = RenderConfig { quantity: Quantity::Emission, ..mean.clone() };
        let mut scene = direct(&trial.memory, trial.config.missing_value);
        let (g, report) = pictures(&mut scene, &mean);
        let (i, _) = pictures(&mut scene, &emission);
        let (g_found, i_found) =
            (trial.of(SplatSource::Coefficients, &mean), trial.of(SplatSource::Coefficients, &emission));
        let truth = truth(&trial.grid(), &mean, report.views[0].scale, &vec![0.0; missing.len()], Some(&missing));
        let left = if missing.contains(&true) { 1e-15 * largest(&samples) * truth.largest_weight } else { 0.0 };
        let weights = truth.weight;
        let pixels = view.size[0] * view.size[1];
        for (frame, delta) in trial.deltas().into_iter().enumerate() {
            for at in frame * pixels..(frame + 1) * pixels {
                assert_eq!(g[at].is_nan(), g_found[at].is_nan(), "{}: background", trial.name);
                let off = (f64::from(g[at]) - f64::from(g_found[at])).abs();
                let most = delta + rounding(g[at]) + rounding(g_found[at]);
                assert!(g[at].is_nan() || off <= most, "{}: mean {} for {}", trial.name, g_found[at], g[at]);
                let off = (f64::from(i[at]) - f64::from(i_found[at])).abs();
                let most = delta * weights[at] + left + rounding(i[at]) + rounding(i_found[at]);
                assert!(off <= most, "{}: emission {} for {}, weight {}", trial.name, i_found[at], i[at], weights[at]);
            }
        }
    }
}

#[test]
fn pictures_are_within_the_bound_of_those_of_the_source() {
    for trial in doubles().iter().filter(|t| t.config.bound == Bound::Pointwise) {
        check_within_the_bound(trial, None);
    }
    let part = Region { start: [1, 2, 0], end: [8, 6, 4] };
    doubles()[..2].iter().for_each(|trial| check_within_the_bound(trial, Some(part)));
}

#[test]
fn pictures_of_any_type_are_within_the_bound() {
    let grid = SKEWED;
    let types = [SampleType::U8, SampleType::I16, SampleType::U32, SampleType::F16, SampleType::F32];
    for (n, ty) in types.into_iter().enumerate() {
        for (m, kind) in [Kind::Noise, Kind::Wave, Kind::Flash, Kind::Ramp, Kind::SignedZero].into_iter().enumerate() {
            let mask = if ty.is_float() { Mask::Special } else { Mask::Declared(3.0) };
            let samples = volume(kind, ty, mask, grid.whole().voxels(), 12, (10 * n + m) as u64);
            let (basis, window) = windows(8)[(n + m) % 4];
            let missing_value = if let Mask::Declared(value) = mask { Some(value) } else { None };
            let config = ConvertConfig { missing_value, ..settings(basis, window, [0.003, 0.05, 0.2][m % 3]) };
            check_within_the_bound(&Trial::new("types", Memory::new(grid, ty, samples), config), None);
        }
    }
}

#[test]
fn some_frames_from_coefficients_equal_those_of_a_full_rendering() {
    for trial in doubles().into_iter().filter(|t| t.file.open().frames() == FRAMES) {
        let (view, tau) = views()[2];
        let config = looking(view, tau, Quantity::Mean, &trial.grid(), FRAMES);
        let all = trial.of(SplatSource::Coefficients, &config);
        let pixels = view.size[0] * view.size[1];
        for frames in [vec![0], vec![7, 8], vec![2, 9, 11, 18], vec![18]] {
            let some = trial.of(SplatSource::Coefficients, &RenderConfig { frames: frames.clone(), ..config.clone() });
            for (frame, picture) in frames.iter().zip(some.chunks_exact(pixels)) {
                let expected = &all[frame * pixels..(frame + 1) * pixels];
                assert_eq!(bits(picture), bits(expected), "{}, frame {frame}", trial.name);
            }
        }
    }
}

#[test]
#[ignore = "exhaustive"]
fn memory_changes_no_bit_of_a_picture_from_coefficients() {
    let grid = Grid::unit([20, 18, 16]);
    let mut samples = field(&grid, FRAMES, 3);
    for mask in [false, true] {
        if mask {
            let missing = |i: usize| i.is_multiple_of(3) || i % 5760 < 900;
            samples.iter_mut().enumerate().filter(|(i, _)| missing(*i)).for_each(|(_, v)| *v = f64::NAN);
        }
        for (basis, window) in windows(8) {
            let config = settings(basis, window, 0.01);
            let trial = Trial::new("memory", archive(grid, SampleType::F64, &samples), config);
            let config = looking(view(30.0, 25.0, [200, 150]), 0.05, Quantity::Mean, &grid, FRAMES);
            let mut scene = CoefficientScene::new(trial.file.open(), SplatSource::Coefficients);
            assert!(under_less_memory(&mut scene, &config) >= 4);
        }
    }
}
