//! Missing samples: NaN, infinities and declared values; their positions, and the values under the mask.

use super::kept;
use crate::common::memory::Memory;
use crate::common::random::Random;
use crate::common::samples::{append, special};
use crate::common::series::Mask;
use crate::common::views::{SKEWED, field, rounding, truth, view};
use crate::common::{Stored, extracted, looking, pictures, settings, stored, windows};
use crate::frame_pictures::bits;
use std::path::Path;
use wavesplat::base::progress::Silent;
use wavesplat::base::sample::SampleType;
use wavesplat::convert::{Basis, ConvertConfig, convert};
use wavesplat::render::{CoefficientScene, Quantity, RenderConfig, SplatSource};

const FLOATS: [SampleType; 3] = [SampleType::F16, SampleType::F32, SampleType::F64];
const FRAMES: usize = 11;

/// Every bit pattern with all exponent bits set: quiet and signalling NaN, and infinities, of either sign.
fn not_finite(ty: SampleType, random: &mut Random, infinite: bool) -> Vec<u8> {
    let fraction = if infinite { 0 } else { random.bits() | 1 };
    let sign = random.bits() & 1;
    match ty {
        SampleType::F16 => ((sign << 15 | 0x7c00 | fraction & 0x3ff) as u16).to_le_bytes().into(),
        SampleType::F32 => ((sign << 31 | 0x7f80_0000 | fraction & 0x7f_ffff) as u32).to_le_bytes().into(),
        _ => (sign << 63 | 0x7ff0 << 48 | fraction & ((1 << 52) - 1)).to_le_bytes().into(),
    }
}

fn with_holes(ty: SampleType, infinite: bool) -> Vec<u8> {
    let mut random = Random(1);
    let mut out = Vec::new();
    for i in 0..40 * 21 {
        if i % 40 == 3 || random.below(5) == 0 {
            out.extend(not_finite(ty, &mut random, infinite));
        } else {
            append(ty, (i as f64 * 0.1).sin(), &mut out);
        }
    }
    out
}

/// Samples that are not finite in the source must come back bit for bit; all others must be finite.
#[test]
fn nan_comes_back_with_its_payload_and_nowhere_else() {
    for ty in FLOATS {
        for tolerance in [0.0, 1e-3, 0.3] {
            kept(ty, Mask::Special, 40, &with_holes(ty, false), tolerance);
        }
    }
}

#[test]
fn infinities_come_back_with_their_sign_and_nowhere_else() {
    for ty in FLOATS {
        for tolerance in [0.0, 1e-3, 0.3] {
            kept(ty, Mask::Special, 40, &with_holes(ty, true), tolerance);
        }
    }
}

/// Voxel and frame.
type Missing = fn([usize; 3], usize) -> bool;

/// Faces, edges, corners, the first and last frame, shells, and their complements.
const BORDERS: [Missing; 10] = [
    |[x, _, _], _| x == 0,
    |[x, _, _], _| x == SKEWED.dims[0] - 1,
    |[_, y, _], _| y == 0 || y == SKEWED.dims[1] - 1,
    |[_, _, z], _| z == 0 || z == SKEWED.dims[2] - 1,
    |[x, y, z], _| [x, y, z].iter().zip(SKEWED.dims).filter(|(i, n)| **i == 0 || **i == n - 1).count() >= 2,
    |[x, y, z], _| [x, y, z].iter().zip(SKEWED.dims).all(|(i, n)| *i == 0 || *i == n - 1),
    |[x, y, z], _| [x, y, z].iter().zip(SKEWED.dims).any(|(i, n)| *i == 0 || *i == n - 1),
    |[x, y, z], _| !([x, y, z].iter().zip(SKEWED.dims).any(|(i, n)| *i == 0 || *i == n - 1)),
    |_, t| t == 0 || t == FRAMES - 1,
    |[x, _, _], t| x < 4 && t < 8 || x >= 4 && t >= 8, // along the borders of blocks and windows
];

fn masked(missing: Missing) -> (Memory, Vec<f64>, Vec<bool>) {
    let values = field(&SKEWED, FRAMES, 3);
    let voxels = SKEWED.whole().voxels();
    let holes: Vec<bool> = (0..values.len()).map(|i| missing(SKEWED.whole().voxel(i % voxels), i / voxels)).collect();
    let mut samples = Vec::new();
    for (i, (value, hole)) in values.iter().zip(&holes).enumerate() {
        if *hole { samples.extend(special(SampleType::F64, i)) } else { append(SampleType::F64, *value, &mut samples) }
    }
    (Memory::new(SKEWED, SampleType::F64, samples), values, holes)
}

fn of_coefficients(file: &Stored, look: &RenderConfig) -> Vec<f32> {
    pictures(&mut CoefficientScene::new(file.open(), SplatSource::Coefficients), look).0
}

#[test]
fn masks_that_touch_every_border_are_kept_and_not_shown() {
    for (n, missing) in BORDERS.into_iter().enumerate() {
        let (memory, values, holes) = masked(missing);
        for (basis, window) in windows(8) {
            let config = ConvertConfig { block: Some(4), ..settings(basis, window, 0.01) };
            let file = stored(&mut memory.clone(), &config);
            assert_eq!(file.report.missing, holes.iter().filter(|h| **h).count() as u64);
            let back = extracted(&file.open());
            let same = |i: usize| back[8 * i..8 * i + 8] == memory.frames[8 * i..8 * i + 8];
            assert!((0..holes.len()).all(|i| !holes[i] || same(i)), "border {n}");
            let look = looking(view(30.0, 25.0, [30, 24]), 0.1, Quantity::Mean, &SKEWED, FRAMES);
            let (found, report) = pictures(&mut CoefficientScene::new(file.open(), SplatSource::Coefficients), &look);
            let truth = truth(&SKEWED, &look, report.views[0].scale, &values, Some(&holes));
            let range = values.iter().fold((0.0_f64, 0.0_f64), |(lo, hi), v| (lo.min(*v), hi.max(*v)));
            for (at, (found, expected)) in found.iter().zip(&truth.mean).enumerate() {
                assert_eq!(found.is_nan(), expected.is_nan(), "border {n}");
                let unit = (range.1 - range.0) * truth.largest_weight / truth.weight[at % truth.weight.len()];
                let most = file.report.delta + report.views[0].stated_splat_error * unit + rounding(*found);
                assert!(found.is_nan() || (f64::from(*found) - expected).abs() <= most, "border {n}: {found}");
            }
        }
    }
}

/// Values under the mask change neither the other samples nor the pictures.
#[test]
fn values_under_a_mask_change_nothing_else() {
    let (memory, _, holes) = masked(|[x, y, z], t| (x * 7 + y * 3 + z * 5 + t * t) % 6 == 0 || x == 2);
    let other = |bytes: [u8; 8]| {
        let samples = memory.frames.chunks_exact(8).zip(&holes);
        let filled = samples.flat_map(|(old, hole)| if *hole { bytes } else { old.try_into().unwrap() });
        Memory::new(SKEWED, SampleType::F64, filled.collect())
    };
    for (basis, window) in windows(8) {
        let config = ConvertConfig { missing_value: Some(-1e30), ..settings(basis, window, 0.01) };
        let run = |memory: &Memory| {
            let file = stored(&mut memory.clone(), &config);
            let back = extracted(&file.open());
            let present = |(i, _): &(usize, &bool)| back[8 * i..8 * i + 8].to_vec();
            let present: Vec<Vec<u8>> = holes.iter().enumerate().filter(|(_, h)| !**h).map(|p| present(&p)).collect();
            let shown = [Quantity::Mean, Quantity::Emission].map(|quantity| {
                bits(&of_coefficients(&file, &looking(view(70.0, -15.0, [30, 24]), 0.0, quantity, &SKEWED, FRAMES)))
            });
            (present, shown, file.report.delta, file.report.range)
        };
        let first = run(&memory);
        for fill in [f64::NAN, -f64::NAN, f64::INFINITY, f64::NEG_INFINITY, -1e30] {
            assert!(run(&other(fill.to_le_bytes())) == first, "{basis:?}, {fill}");
        }
    }
}

/// Includes types to which the declared value must be rounded.
#[test]
fn only_undeclared_values_widen_the_bound() {
    for (ty, value) in
        [(SampleType::F32, 1e35), (SampleType::F32, -9999.0), (SampleType::F64, 1e30), (SampleType::I16, -9999.0)]
    {
        let values = Vec::from_iter(field(&SKEWED, FRAMES, 5).into_iter().map(f64::round));
        let mut samples = Vec::new();
        for (i, v) in values.iter().enumerate() {
            append(ty, if i % 5 == 2 { value } else { *v }, &mut samples);
        }
        let memory = Memory::new(SKEWED, ty, samples);
        let config = ConvertConfig { missing_value: Some(value), ..settings(Basis::Haar, 16, 0.1) };
        let file = stored(&mut memory.clone(), &config);
        let largest = values.iter().fold(0.0_f64, |m, v| m.max(v.abs()));
        assert!(file.report.range.0 >= -largest && file.report.range.1 <= largest, "{:?}", file.report);
        assert_eq!(
            file.report.missing,
            values.len().div_ceil(5) as u64 - u64::from(values.len() % 5 <= 2 && values.len() % 5 > 0)
        );
        let size = ty.size();
        let back = extracted(&file.open());
        let kept = (2..values.len()).step_by(5).all(|i| back[i * size..][..size] == memory.frames[i * size..][..size]);
        assert!(kept, "{ty} {value}");
        // If the value is not declared, it is part of the range, and so of the bound, which then leaves nothing of the rest.
        let plain = ConvertConfig { refuse_fill: true, ..settings(Basis::Haar, 16, 0.1) };
        let refused = convert(&mut memory.clone(), &plain, Path::new("a.wspl"), Vec::new(), &Silent).unwrap_err();
        assert!(refused.to_string().contains("samples are exactly"), "{refused}");
        let file = stored(&mut memory.clone(), &ConvertConfig { refuse_fill: false, ..plain });
        assert!(
            file.report.missing == 0 && file.report.delta >= 0.09 * value.abs() && !file.report.warnings.is_empty(),
            "{:?}",
            file.report.warnings
        );
    }
}
