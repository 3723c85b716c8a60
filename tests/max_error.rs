//! Errors in the samples' unit: kept for every kind of series and type, and refused where they mean nothing.

use crate::bounds::search;
use crate::common::exact::Limit;
use crate::common::memory::Memory;
use crate::common::samples::{TYPES, numbers};
use crate::common::series::{KINDS, Mask, volume};
use crate::common::{BASES, cases, extracted, settings, stored, tried};
use proptest::prelude::*;
use std::path::Path;
use std::time::Instant;
use wavesplat::base::grid::Grid;
use wavesplat::base::progress::Silent;
use wavesplat::base::sample::SampleType;
use wavesplat::colour::TransferFunction;
use wavesplat::convert::{Basis, Bound, ConvertConfig, convert};
use wavesplat::file::promise::max_error;
use wavesplat::file::verify::verify;

const DIMS: [usize; 3] = [9, 5, 5];
const FRAMES: usize = 21;

/// From below every step of a float to beyond the largest sample.
const ERRORS: [f64; 14] = [0.0, 5e-324, 1e-300, 1e-40, 1e-9, 1e-3, 0.1, 0.5, 1.0, 7.3, 1e3, 1e9, 1e37, 1e308];

fn config(basis: Basis, bound: Bound, error: f64) -> ConvertConfig {
    let window = 8 + usize::from(basis == Basis::Multi);
    ConvertConfig { bound, block: Some(4), max_error: Some(error), ..settings(basis, window, 0.0) }
}

/// Converts a volume, extracts it and compares in exact arithmetic. Returns the number of series.
fn check(memory: &mut Memory, bytes: &[u8], ty: SampleType, config: &ConvertConfig) -> usize {
    let error = config.max_error.unwrap();
    let stored = stored(memory, config);
    let file = stored.open();
    assert_eq!(max_error(file.metadata()), Some(error));
    assert_eq!(ConvertConfig::from_file(file.metadata(), config.memory).unwrap().max_error, Some(error));
    let exact = error == 0.0 || error > 1e-280;
    assert!(stored.report.delta <= error && (!exact || stored.report.delta == error), "{error:e}");
    let back = extracted(&file);
    assert!(error > 0.0 || back == bytes, "0 keeps every bit");
    let report = verify(&file, Some(memory), 64 << 20, &Silent).unwrap().against.unwrap();
    assert_eq!(report.series_outside, 0, "{config:?}");
    let (source, found, limit) = (numbers(ty, bytes), numbers(ty, &back), Limit::of(error));
    let voxels: usize = DIMS.iter().product();
    for voxel in 0..voxels {
        for window in (0..FRAMES).step_by(config.window) {
            let frames = window..FRAMES.min(window + config.window);
            let places = frames.clone().map(|t| t * voxels + voxel).filter(|i| source[*i].is_finite());
            let pairs: Vec<(f64, f64)> = places.map(|i| (found[i], source[i])).collect();
            let holds = match config.bound {
                Bound::Pointwise => pairs.iter().all(|(a, b)| limit.holds(*a, *b)),
                _ => limit.holds_rms(&pairs, frames.len()),
            };
            assert!(holds, "{config:?}, voxel {voxel}: {pairs:?}");
        }
    }
    voxels * FRAMES.div_ceil(config.window)
}

#[test]
fn no_series_is_off_by_more_than_the_error_in_its_unit() {
    let started = Instant::now();
    let choices = (0..TYPES.len(), 0..KINDS.len(), 0..BASES.len(), any::<(bool, bool, u64)>());
    let series = search(400, (choices, 0..ERRORS.len(), 0.5..1.0), |case| {
        let ((ty, kind, basis, (rms, special, seed)), error, share): (_, usize, f64) = case;
        let (ty, bound) = (TYPES[ty], if rms { Bound::Rms } else { Bound::Pointwise });
        let mask = if special && ty.is_float() { Mask::Special } else { Mask::None };
        let bytes = volume(KINDS[kind], ty, mask, DIMS.iter().product(), FRAMES, seed);
        let mut memory = Memory::new(Grid::unit(DIMS), ty, bytes.clone());
        check(&mut memory, &bytes, ty, &config(BASES[basis], bound, ERRORS[error] * share))
    });
    tried(series, cases(200_000), started);
}

#[test]
fn an_error_without_a_meaning_is_refused() {
    let mut memory = Memory::new(Grid::unit([2, 2, 2]), SampleType::F32, vec![0; 8 * 4]);
    let mut refused = |config: &ConvertConfig, words: &str| {
        let found = convert(&mut memory, config, Path::new("a"), Vec::new(), &Silent).unwrap_err().to_string();
        assert!(found.contains("max_error") && found.contains(words), "{found}");
    };
    let plain = ConvertConfig::with_max_error(0.1);
    for wrong in [-1.0, f64::NAN, f64::INFINITY] {
        refused(&ConvertConfig::with_max_error(wrong), "finite number of 0 or more");
    }
    refused(&ConvertConfig { bound: Bound::Relative { floor: 0.0 }, ..plain.clone() }, "pointwise or rms");
    refused(&ConvertConfig { bound: Bound::Sampled { samples: 5, seed: 0 }, ..plain.clone() }, "pointwise or rms");
    refused(&ConvertConfig { range: Some((0.0, 5.0)), ..plain.clone() }, "no range");
    let colours = Some(TransferFunction::open("turbo").unwrap());
    refused(&ConvertConfig { colours, ..plain }, "colours");
}
