//! Shapes of series along time.

use super::kept;
use crate::bounds::Trial;
use crate::common::exact::Limit;
use crate::common::memory::Memory;
use crate::common::random::Random;
use crate::common::samples::{TYPES, bytes, numbers};
use crate::common::series::{Mask, extremes};
use crate::common::views::{archive, view};
use crate::common::{direct, extracted, looking, pictures, settings, stored, windows};
use wavesplat::base::grid::Grid;
use wavesplat::base::sample::SampleType;
use wavesplat::convert::{Basis, Bound, ConvertConfig};
use wavesplat::render::{CoefficientScene, Quantity, SplatSource};

#[test]
fn neighbours_of_a_spike_keep_the_bound_of_the_range() {
    let mut random = Random(9);
    let value = |i: usize| if i % 640 == 77 { 1e30 } else { 1e-3 * random.signed() };
    let values = Vec::from_iter((0..10 * 64).map(value));
    for ty in [SampleType::F32, SampleType::F64] {
        let samples = bytes(ty, &values);
        kept(ty, Mask::None, 10, &samples, 1e-3);
        kept(ty, Mask::None, 10, &samples, 1e-34);
        // A range without the spike gives its neighbours their own bound.
        for (basis, window) in windows(32) {
            let config = ConvertConfig { range: Some((-1e-3, 1e-3)), ..settings(basis, window, 0.01) };
            let file = stored(&mut Memory::new(Grid::unit([10, 1, 1]), ty, samples.clone()), &config);
            let found = numbers(ty, &extracted(&file.open()));
            let limit = Limit::range(0.01, -1e-3, 1e-3);
            let all = || found.iter().zip(numbers(ty, &samples));
            assert!(all().all(|(a, b)| limit.holds(*a, b)) && all().any(|(a, b)| *a == b && b > 1e29));
        }
    }
}

#[test]
fn constants_are_kept_exactly_or_in_one_coefficient() {
    for ty in TYPES {
        let (lo, hi, least) = extremes(ty);
        for value in [lo, hi, least, 1.0, 0.1, 0.0] {
            // Without a range, no error is allowed.
            let trials = kept(ty, Mask::None, 40, &bytes(ty, &vec![value; 40 * 33]), 0.1);
            let of_range = |t: &&Trial| matches!(t.case.bound, Bound::Pointwise | Bound::Rms);
            trials.iter().filter(of_range).for_each(|t| assert_eq!(t.found, t.source));
        }
    }
    let values = Vec::from_iter((0..40 * 32).map(|i| (i % 40) as f64));
    let config = settings(Basis::Haar, 32, 1e-4);
    let file = stored(&mut archive(Grid::unit([40, 1, 1]), SampleType::F32, &values), &config);
    assert!(file.report.coefficients == 39 && file.report.outliers == 0, "{:?}", file.report);
}

#[test]
fn incompressible_series_are_stored_exactly() {
    let mut random = Random(12);
    let grid = Grid::unit([16, 16, 8]);
    let size = |i: usize| (1 + i % 2048) as f64 / 2048.0;
    let alternating = Vec::from_iter((0..64 * 2048).map(|i| if i / 2048 % 2 == 0 { size(i) } else { -size(i) }));
    let ramp = Vec::from_iter((0..64 * 2048).map(|i| (i / 2048) as f64 * size(i)));
    let noise = Vec::from_iter((0..64 * 2048).map(|_| random.signed()));
    for ty in [SampleType::F32, SampleType::F64] {
        for values in [&alternating, &ramp, &noise] {
            let samples = bytes(ty, values);
            for tolerance in [0.0, 1e-12, 1e-7, 0.01] {
                for (basis, window) in windows(32) {
                    let file = stored(&mut Memory::new(grid, ty, samples.clone()), &settings(basis, window, tolerance));
                    assert!(file.bytes().len() <= samples.len() * 101 / 100 + 2048, "{:?}", file.report);
                }
                kept(ty, Mask::None, 2048, &samples[..2048 * 5 * ty.size()], tolerance);
            }
        }
    }
}

#[test]
fn a_tiny_signal_on_a_large_offset_keeps_the_bound_of_its_own_range() {
    for (ty, offset, height) in [
        (SampleType::F64, 1e6, 1e-3),
        (SampleType::F64, 1e15, 2.0),
        (SampleType::F32, 1e6, 0.5),
        (SampleType::F32, 3e7, 8.0),
    ] {
        let mut random = Random(14);
        let samples = bytes(ty, &Vec::from_iter((0..40 * 64).map(|_| offset + height * random.signed())));
        for tolerance in [0.0, 1e-6, 0.01, 0.2] {
            kept(ty, Mask::None, 40, &samples, tolerance);
        }
    }
}

/// Every remainder of a short window, and lengths around powers of two.
#[test]
fn windows_of_any_length_keep_the_bound() {
    windows_keep_the_bound((1..=20).chain([31, 32, 33, 34, 63, 64, 65, 66, 95, 127, 128, 129, 130]));
}

#[test]
#[ignore = "exhaustive"]
fn windows_of_every_length_keep_the_bound() {
    windows_keep_the_bound(1..=130);
}

fn windows_keep_the_bound(lengths: impl Iterator<Item = usize>) {
    let mut random = Random(23);
    for frames in lengths {
        let values = Vec::from_iter((0..8 * frames).map(|i| (i as f64 * 0.1).sin() + 0.2 * random.signed()));
        let samples = bytes(SampleType::F32, &values);
        for (basis, window) in windows(128) {
            let config = settings(basis, window, 0.01);
            let file = stored(&mut Memory::new(Grid::unit([8, 1, 1]), SampleType::F32, samples.clone()), &config);
            let lengths = Vec::from_iter(file.open().metadata().windows.iter().map(|w| w.frames as usize));
            let expected = if frames > window { vec![window, frames - window] } else { vec![frames] };
            assert_eq!(lengths, expected, "no frame is invented");
        }
        kept(SampleType::F32, Mask::None, 8, &samples, 0.01);
    }
}

#[test]
fn windows_of_one_frame_are_kept_and_shown() {
    let grid = Grid::unit([6, 5, 4]);
    let mut random = Random(24);
    for frames in [1, 3] {
        let memory = archive(grid, SampleType::F64, &Vec::from_iter((0..120 * frames).map(|_| random.signed())));
        let stored = stored(&mut memory.clone(), &settings(Basis::Haar, 1, 0.0));
        assert_eq!(extracted(&stored.open()), *memory.frames);
        let look = looking(view(30.0, 20.0, [30, 24]), 0.1, Quantity::Mean, &grid, frames);
        let (found, _) = pictures(&mut CoefficientScene::new(stored.open(), SplatSource::Coefficients), &look);
        let (expected, _) = pictures(&mut direct(&memory, None), &look);
        assert!(found.iter().zip(&expected).all(|(a, b)| a.to_bits() == b.to_bits()));
    }
}
