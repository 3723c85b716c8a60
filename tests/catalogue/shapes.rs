//! Lengths of axes, and sample types that are not supported.

use crate::cli::{Work, assert_same_but_options, npy};
use crate::common::samples::bytes;
use crate::common::views::{archive, field, rounding, truth, view};
use crate::common::{extracted, looking, pictures, settings, stored};
use wavesplat::base::grid::Grid;
use wavesplat::base::sample::SampleType;
use wavesplat::render::{CoefficientScene, Quantity, SplatSource};
use wavesplat::wavelet::Basis;

#[test]
fn an_axis_of_length_1_is_like_any_other() {
    for dims in [[1, 1, 1], [9, 1, 1], [1, 9, 1], [1, 1, 9], [1, 7, 5], [7, 1, 5], [7, 5, 1]] {
        let grid = Grid::unit(dims);
        let values = field(&grid, 6, 25);
        let memory = archive(grid, SampleType::F64, &values);
        let file = stored(&mut memory.clone(), &settings(Basis::Haar, 4, 0.0));
        assert_eq!(extracted(&file.open()), *memory.frames);
        let look = looking(view(40.0, 35.0, [20, 20]), 0.1, Quantity::Mean, &grid, 6);
        let (found, report) = pictures(&mut CoefficientScene::new(file.open(), SplatSource::Coefficients), &look);
        let truth = truth(&grid, &look, report.views[0].scale, &values, None);
        let (lo, hi) = file.report.range;
        for (at, (found, expected)) in found.iter().zip(&truth.mean).enumerate() {
            let weight = truth.weight[at % truth.weight.len()] / truth.largest_weight;
            let most = report.views[0].stated_splat_error * (hi - lo) / weight + rounding(*found);
            assert_eq!(found.is_nan(), expected.is_nan(), "{dims:?}");
            assert!(found.is_nan() || (f64::from(*found) - expected).abs() <= most, "{dims:?}");
        }
    }
}

#[test]
fn axes_of_length_0_or_beyond_addresses_are_refused() {
    let work = Work::new();
    work.write("a.raw", [7; 64]);
    let cases = [
        "0x4x4",
        "4x0x4x2",
        "4x4x4x0",
        "4294967296x4294967296x4294967296",
        "18446744073709551615x4x4",
        "99999999999999999999x4x4",
    ];
    for dims in cases {
        work.wavesplat(&format!("convert a.raw --dims {dims} --dtype f64 -o a.wspl")).fails(2, &["--dims"]);
    }
    work.wavesplat("convert a.raw --dims 2147483649x1x1 --dtype u8 -o a.wspl")
        .fails(3, &["expected 2147483649 bytes", "64"]);
    assert_eq!(work.names(), ["a.raw"]);
}

#[test]
fn integers_of_64_bits_are_refused_and_never_rounded() {
    let work = Work::new();
    for (name, descr) in [("a.npy", "<i8"), ("b.npy", "<u8")] {
        work.write(name, npy(descr, "2, 2, 2, 2", &[7; 128]));
        work.wavesplat(&format!("convert {name} -o a.wspl")).fails(3, &[name, "8"]);
    }
    work.write("a.raw", [7; 128]);
    work.wavesplat("convert a.raw --dims 2x2x2x2 --dtype i64 -o a.wspl").fails(2, &["--dtype", "i32"]);
    assert_eq!(work.names(), ["a.npy", "a.raw", "b.npy"]);
}

#[test]
fn samples_of_both_byte_orders_are_the_same() {
    let values = [0.1, -3e8, 1e-30, 7.0];
    let little = bytes(SampleType::F32, &values);
    let big: Vec<u8> = little.chunks(4).flat_map(|b| b.iter().rev()).copied().collect();
    let work = Work::new();
    work.write("l.raw", &little);
    work.write("b.raw", &big);
    for (name, endian) in [("l", "little"), ("b", "big")] {
        let args =
            format!("convert {name}.raw --dims 2x2x1 --dtype f32 --endian {endian} --tolerance 0 -o {name}.wspl");
        work.wavesplat(&args).ok();
        work.wavesplat(&format!("extract {name}.wspl -o {name}.out.raw")).ok();
        assert_eq!(work.read(&format!("{name}.out.raw")), little, "files are little-endian");
    }
    assert_same_but_options(&work, "l.wspl", "b.wspl");
}
