//! Files of colours: every channel is within its bound of the samples' colours, and so are pictures of the channels.

use crate::common::memory::Memory;
use crate::common::series::{Kind, Mask, volume};
use crate::common::views::{SKEWED, archive, field, largest, rounding, truth, values, view};
use crate::common::{Stored, extracted_channel, looking, pictures, rendered, settings, stored, windows};
use crate::frame_pictures::{bits, under_less_memory};
use crate::reference::colour::{Point, colour};
use crate::reference::splat::Images;
use wavesplat::base::grid::Grid;
use wavesplat::base::progress::Silent;
use wavesplat::base::sample::SampleType;
use wavesplat::colour::{ColourSpace, TransferFunction};
use wavesplat::convert::{Basis, Bound, ConvertConfig, convert};
use wavesplat::render::{CoefficientScene, FrameScene, Limit, Quantity, RenderConfig, SplatSource};
use wavesplat::source::FrameSource;
use wavesplat::view::camera::View;

/// Largest rounding error of a colour as `f32`, for either way of computing it.
const ROUNDING: f64 = 1.0 / (1 << 24) as f64;

/// Slopes, a step, two steps at one value, a flat piece, and a channel that is dark for half of the values.
const SHARES: [Point; 7] = [
    (0.0, [0.0, 1.0, 0.0]),
    (0.3, [1.0, 0.75, 0.0]),
    (0.3, [0.125, 0.0, 0.0]),
    (0.5, [0.125, 0.0, 0.0]),
    (0.5, [0.5, 1.0, 1.0]),
    (0.8, [0.0, 0.3, 0.1]),
    (1.0, [0.7, 0.3, 1.0]),
];

/// An archive of colours and the reference's result for it.
struct ColouredArchive {
    memory: Memory,
    config: ConvertConfig,
    missing: Vec<bool>,
    /// `channels[channel][sample]`; 0 if a sample is missing.
    channels: [Vec<f64>; 3],
}

impl ColouredArchive {
    fn new(memory: Memory, config: ConvertConfig) -> Self {
        let samples = values(&memory, memory.archive().sample);
        let missing_at = |v: f64| !v.is_finite() || Some(v) == config.missing_value;
        let missing: Vec<bool> = samples.iter().map(|v| missing_at(*v)).collect();
        let there = samples.iter().copied().filter(|v| !missing_at(*v));
        let (lo, hi) = there.fold((f64::INFINITY, f64::NEG_INFINITY), |(lo, hi), v| (lo.min(v), hi.max(v)));
        let (lo, hi) = if lo < hi { (lo, hi) } else { (0.0, 1.0) };
        let points = SHARES.map(|(share, colour)| (lo + share * (hi - lo), colour));
        let paint = |v: &f64| if missing_at(*v) { [0.0; 3] } else { colour(&points, *v) };
        let painted: Vec<[f64; 3]> = samples.iter().map(paint).collect();
        let channels = [0, 1, 2].map(|c| painted.iter().map(|colour| colour[c]).collect());
        let colours = TransferFunction::from_points(points.to_vec(), ColourSpace::Rgb, None, Some([0.5; 3])).unwrap();
        let config = ConvertConfig { colours: Some(colours), ..config };
        Self { memory, config, missing, channels }
    }

    fn grid(&self) -> Grid {
        self.memory.archive().grid
    }

    fn frames(&self) -> usize {
        self.memory.archive().frames.unwrap()
    }

    fn file(&self) -> Stored {
        stored(&mut self.memory.clone(), &self.config)
    }

    fn direct(&self) -> FrameScene {
        let colours = self.config.colours.clone().unwrap();
        FrameScene::coloured(Box::new(self.memory.clone()), self.config.missing_value, colours)
    }

    /// Compares every channel of a file with the colours. Returns how many samples differ at all.
    fn check(&self, name: &str) -> usize {
        let stored = self.file();
        let (file, voxels, mut off) = (stored.open(), self.grid().whole().voxels(), 0);
        for (channel, expected) in self.channels.iter().enumerate() {
            let found = extracted_channel(&file, channel);
            let found: Vec<f32> = found.as_chunks().0.iter().map(|b| f32::from_le_bytes(*b)).collect();
            for window in &file.metadata().windows {
                let frames = window.first_frame as usize..window.first_frame as usize + window.frames as usize;
                for voxel in 0..voxels {
                    let at = frames.clone().map(|frame| frame * voxels + voxel);
                    off += self.check_series(at, &found, expected, &format!("{name}, channel {channel}"));
                }
            }
        }
        assert_eq!(stored.report.missing, 3 * self.missing.iter().filter(|missing| **missing).count() as u64);
        off
    }

    fn check_series(&self, at: impl Iterator<Item = usize>, found: &[f32], expected: &[f64], name: &str) -> usize {
        let (tolerance, mut squares, mut count, mut off) = (self.config.tolerance, 0.0, 0.0, 0);
        for i in at {
            count += 1.0;
            if self.missing[i] {
                assert_eq!(found[i].to_bits(), f32::NAN.to_bits(), "{name}: missing at {i}");
                continue;
            }
            let error = (f64::from(found[i]) - expected[i]).abs();
            let allowed = match self.config.bound {
                Bound::Relative { floor } => tolerance * expected[i].max(floor),
                Bound::Pointwise => tolerance,
                Bound::Rms | Bound::Sampled { .. } => 1.0,
            };
            assert!(error <= allowed + ROUNDING, "{name}: {} for {} at {i}", found[i], expected[i]);
            squares += error * error;
            off += usize::from(error > ROUNDING);
        }
        assert!((squares / count).sqrt() <= tolerance + ROUNDING, "{name}");
        off
    }

    /// The images of a channel by brute force.
    fn truth(&self, config: &RenderConfig, scale: f64, channel: usize) -> Images {
        truth(&self.grid(), config, scale, &self.channels[channel], Some(&self.missing))
    }
}

#[test]
fn every_channel_is_within_the_bound_of_the_colours_of_the_samples() {
    let types = [SampleType::U8, SampleType::I16, SampleType::F16, SampleType::F32, SampleType::F64];
    let kinds =
        [Kind::Wave, Kind::Noise, Kind::Steps, Kind::Flash, Kind::Ramp, Kind::Alternation, Kind::Constant, Kind::Spike];
    let bounds = [Bound::Pointwise, Bound::Rms, Bound::Relative { floor: 0.1 }];
    let (mut off, mut tried) = (0, 0);
    for (n, ty) in types.into_iter().enumerate() {
        for (m, kind) in kinds.into_iter().enumerate() {
            let mask = if ty.is_float() && m % 2 == 0 { Mask::Special } else { Mask::Declared(3.0) };
            let samples = volume(kind, ty, mask, SKEWED.whole().voxels(), 19, (10 * n + m) as u64);
            let missing_value = if let Mask::Declared(value) = mask { Some(value) } else { None };
            for (i, (basis, window)) in windows(8).into_iter().enumerate() {
                let (tolerance, bound) = ([0.2, 0.02, 1e-3, 0.0][(n + m + i) % 4], bounds[(m + i) % 3]);
                let config =
                    ConvertConfig { missing_value, bound, block: Some(4), ..settings(basis, window, tolerance) };
                let painted = ColouredArchive::new(Memory::new(SKEWED, ty, samples.clone()), config);
                off += painted.check(&format!("{kind:?} {ty} {basis:?} {bound:?} {tolerance}"));
                tried += 3 * painted.missing.len();
            }
        }
    }
    assert!(off > tried / 20, "only {off} of {tried} samples are not exact");
}

#[test]
fn a_sampled_bound_holds_for_every_channel_that_is_not_dark() {
    let samples: Vec<f64> = (0..19 * 315).map(|i| (i % 315) as f64 / 700.0).collect(); // the third channel stays dark
    let bound = Bound::Sampled { samples: 50, seed: 1 };
    let config = ConvertConfig { bound, ..settings(Basis::Haar, 8, 0.05) };
    let mut painted = ColouredArchive::new(archive(SKEWED, SampleType::F32, &samples), config);
    let points = vec![(0.0, [0.0, 1.0, 0.0]), (1.0, [1.0, 0.5, 0.0])];
    painted.channels = [0, 1, 2].map(|c| samples.iter().map(|v| colour(&points, f64::from(*v as f32))[c]).collect());
    painted.config.colours = Some(TransferFunction::from_points(points, ColourSpace::Rgb, None, None).unwrap());
    let stored = painted.file();
    assert!(stored.report.delta > 0.0 && stored.report.delta < 0.05 * 0.5, "{}", stored.report.delta);
    painted.check("sampled");
    assert!(extracted_channel(&stored.open(), 2).iter().all(|byte| *byte == 0));
}

/// Means and emissions of a field with and without missing samples.
fn scenes() -> Vec<ColouredArchive> {
    let plain = field(&SKEWED, 19, 2);
    let masked = plain.iter().enumerate();
    let masked: Vec<f64> =
        masked.map(|(i, v)| if i % 11 == 3 || i % 315 < 60 || i / 315 == 12 { f64::NAN } else { *v }).collect();
    let of = |samples: &[f64], basis, window| {
        let config = ConvertConfig { block: Some(4), ..settings(basis, window, 0.02) };
        ColouredArchive::new(archive(SKEWED, SampleType::F64, samples), config)
    };
    let each = windows(8).into_iter().flat_map(|(basis, window)| [(basis, window, &plain), (basis, window, &masked)]);
    each.map(|(basis, window, samples)| of(samples, basis, window)).collect()
}

fn views() -> [(View, f64); 2] {
    [(view(30.0, 30.0, [36, 28]), 0.0), (view(-70.0, -15.0, [28, 36]), 0.4)]
}

#[test]
fn pictures_of_colours_are_within_the_bound_of_those_by_the_conventional_method_and_these_are_right() {
    for painted in scenes() {
        let file = painted.file();
        for (view, tau) in views() {
            for quantity in [Quantity::Mean, Quantity::Emission] {
                let config = looking(view, tau, quantity, &painted.grid(), painted.frames());
                let (a, report) = pictures(&mut painted.direct(), &config);
                let (b, _) = pictures(&mut CoefficientScene::new(file.open(), SplatSource::Coefficients), &config);
                let (c, _) = pictures(&mut CoefficientScene::new(file.open(), SplatSource::Samples), &config);
                assert_eq!((a.len(), b.len()), (3 * 19 * 36 * 28, a.len()));
                for channel in 0..3 {
                    let of = |all: &[f32]| all.iter().skip(channel).step_by(3).copied().collect::<Vec<_>>();
                    let truth = painted.truth(&config, report.views[0].scale, channel);
                    check(quantity, [of(&a), of(&b), of(&c)], &truth);
                }
            }
        }
    }
}

/// Compares pictures of frames, of coefficients and of decoded samples with each other and with brute force.
fn check(quantity: Quantity, [a, b, c]: [Vec<f32>; 3], truth: &Images) {
    let mean = quantity == Quantity::Mean;
    let expected = if mean { &truth.mean } else { &truth.emission };
    let most = 1e-6 * largest(expected);
    for at in 0..a.len() {
        let weight = if mean { 1.0 } else { truth.weight[at] };
        let left = if mean { 0.0 } else { 1e-14 * truth.largest_weight }; // rounding left over after missing samples are subtracted
        assert_eq!((a[at].is_nan(), b[at].is_nan()), (expected[at].is_nan(), a[at].is_nan()));
        if a[at].is_nan() {
            continue;
        }
        let off = |x: f32, y: f32| (f64::from(x) - f64::from(y)).abs();
        assert!((f64::from(a[at]) - expected[at]).abs() <= most, "{} for {}", a[at], expected[at]);
        let allowed = 0.02 * weight + left + rounding(a[at]);
        assert!(off(a[at], b[at]) <= allowed + rounding(b[at]), "{} for {}", b[at], a[at]);
        assert!(off(a[at], c[at]) <= allowed + rounding(c[at]), "{} for {}", c[at], a[at]);
    }
}

#[test]
fn no_number_of_a_coloured_pixel_is_beyond_its_certificate() {
    for painted in scenes() {
        let file = painted.file();
        for (view, tau) in views() {
            for (quantity, splat_error) in [(Quantity::Mean, 1e-3), (Quantity::Emission, 0.02)] {
                let plain = looking(view, tau, quantity, &painted.grid(), painted.frames());
                for allowed in [None, Some(0.1)] {
                    let config = RenderConfig { certify: true, splat_error, allowed, ..plain.clone() };
                    let mut scene = CoefficientScene::new(file.open(), SplatSource::Coefficients);
                    let (found, errors, report) = rendered(&mut scene, &config);
                    for channel in 0..3 {
                        let truth = painted.truth(&config, report.views[0].scale, channel);
                        let expected = if quantity == Quantity::Mean { &truth.mean } else { &truth.emission };
                        for (at, expected) in expected.iter().enumerate().map(|(i, v)| (3 * i + channel, v)) {
                            let off = (f64::from(found[at]) - expected).abs();
                            assert_eq!(
                                (found[at].is_nan(), errors[at].is_nan()),
                                (expected.is_nan(), expected.is_nan())
                            );
                            let kept = off <= f64::from(errors[at])
                                && f64::from(errors[at]) <= report.certified_error.unwrap();
                            assert!(expected.is_nan() || kept, "{} for {expected}", found[at]);
                        }
                    }
                }
            }
        }
    }
}

/// How far samples, or pixels, may deviate under a looser tolerance.
const ALLOWED: f64 = 0.2;

#[test]
fn a_looser_tolerance_reads_less_of_colours_and_keeps_to_it() {
    let grid = Grid::unit([24, 20, 16]);
    let config = ConvertConfig { block: Some(8), ..settings(Basis::Learned, 16, 1e-3) };
    let wave = |[x, y, z]: [usize; 3], t: usize| (0.1 * (x + 2 * y) as f64 - 0.2 * t as f64).sin() + 0.01 * z as f64;
    let samples: Vec<f64> = (0..16).flat_map(|t| grid.whole().iter().map(move |voxel| wave(voxel, t))).collect();
    let mut painted = ColouredArchive::new(archive(grid, SampleType::F32, &samples), config);
    let points = vec![(-1.0, [0.0, 0.2, 1.0]), (1.2, [1.0, 0.8, 0.0])]; // a map with steps would allow no omission
    painted.config.colours = Some(TransferFunction::from_points(points, ColourSpace::Rgb, None, None).unwrap());
    let file = painted.file();
    let plain = looking(view(40.0, 20.0, [60, 50]), 0.0, Quantity::Mean, &grid, 16);
    let (exact, whole) = pictures(&mut CoefficientScene::new(file.open(), SplatSource::Coefficients), &plain);
    assert_eq!((whole.blocks, whole.left_out.coefficients), (3 * file.open().blocks.len() as u64, 0));
    for error in [Limit::Certified, Limit::Expected] {
        let loose = RenderConfig { allowed: Some(ALLOWED), error, ..plain.clone() };
        let (found, report) = pictures(&mut CoefficientScene::new(file.open(), SplatSource::Coefficients), &loose);
        let (left, read) = (report.left_out.coefficients, report.bytes_read);
        assert!(left > 0 && read < whole.bytes_read, "{error:?}: {left} left out, {read} of {}", whole.bytes_read);
        assert!(error == Limit::Expected || report.certified_sample_error <= ALLOWED);
        assert!(report.expected_error > whole.expected_error && report.expected_error <= ALLOWED);
        let squares: Vec<f64> =
            exact.iter().zip(&found).filter(|(a, _)| !a.is_nan()).map(|(a, b)| f64::from(a - b).powi(2)).collect();
        let rms = (squares.iter().sum::<f64>() / squares.len() as f64).sqrt();
        assert!(rms > 0.0 && rms <= ALLOWED, "{error:?}: {rms}");
    }
}

#[test]
#[ignore = "exhaustive"]
fn neither_threads_nor_memory_change_a_bit_of_coloured_pictures() {
    let grid = Grid::unit([20, 18, 16]);
    let mut samples = field(&grid, 19, 3);
    samples.iter_mut().enumerate().filter(|(i, _)| i % 7 == 0).for_each(|(_, v)| *v = f64::NAN);
    for (basis, window) in windows(8) {
        let config = ConvertConfig { block: Some(8), ..settings(basis, window, 0.01) };
        let painted = ColouredArchive::new(archive(grid, SampleType::F32, &samples), config);
        let file = painted.file();
        let scene = || CoefficientScene::new(file.open(), SplatSource::Coefficients);
        let look = looking(view(30.0, 25.0, [80, 60]), 0.05, Quantity::Mean, &grid, 19);
        let certified = RenderConfig { certify: true, frames: vec![3, 4, 5], ..look.clone() };
        assert!(under_less_memory(&mut scene(), &look) >= 4);
        assert!(under_less_memory(&mut scene(), &certified) >= 4);
        assert!(under_less_memory(&mut painted.direct(), &look) >= 4);
        let under = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| {
                let (pictures, report) = pictures(&mut scene(), &look);
                let (direct, _) = crate::common::pictures(&mut painted.direct(), &look);
                let channels = [0, 1, 2].map(|channel| extracted_channel(&file.open(), channel));
                (bits(&pictures), bits(&direct), report.expected_error.to_bits(), channels)
            })
        };
        assert!(under(1) == under(3), "{basis:?}");
    }
}

#[test]
fn memory_changes_no_byte_of_a_file_of_colours() {
    let grid = Grid::unit([40, 33, 20]);
    let samples = volume(Kind::Wave, SampleType::I16, Mask::None, grid.whole().voxels(), 20, 4);
    for basis in [Basis::Haar, Basis::Samples] {
        let config = ConvertConfig { block: Some(8), ..settings(basis, 16, 0.01) };
        let painted = ColouredArchive::new(Memory::new(grid, SampleType::I16, samples.clone()), config);
        let mut files = Vec::new();
        for mib in [16, 20, 40, 300] {
            let config = ConvertConfig { memory: mib << 20, ..painted.config.clone() };
            let mut bytes = Vec::new();
            let name = std::path::Path::new("a.wspl");
            let done = convert(&mut painted.memory.clone(), &config, name, &mut bytes, &Silent);
            files.extend(done.is_ok().then_some(bytes));
        }
        assert!(files.len() >= 3 && files.iter().all(|f| *f == files[0]), "{basis:?}: {} budgets", files.len());
    }
}
