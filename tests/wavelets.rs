//! The transforms against the matrices of `reference::transform` (eq 17-19).

use crate::common::random::Random;
use crate::reference::transform::{Matrix, apply, ghm_matrix, haar_matrix, inverse, transpose};
use wavesplat::convert::Basis;
use wavesplat_core::wavelet::{LANES, Lane, TimeBasis, basis};

/// The tolerance, relative to the largest number involved.
const CLOSE: f64 = 1e-12;

fn lane_of(lanes: &[Lane], lane: usize) -> Vec<f64> {
    lanes.iter().map(|l| l[lane]).collect()
}

#[track_caller]
fn assert_close(found: &[f64], expected: &[f64], scale: f64, what: &str) {
    assert_eq!(found.len(), expected.len());
    for (i, (f, e)) in found.iter().zip(expected).enumerate() {
        assert!((f - e).abs() <= CLOSE * scale, "{what}, entry {i}: {f} for {e}");
    }
}

fn largest(values: &[f64]) -> f64 {
    values.iter().fold(0.0, |m, v| m.max(v.abs()))
}

/// Random values, scaled so that lanes differ by orders of magnitude.
fn random_lanes(n: usize, random: &mut Random) -> Vec<Lane> {
    (0..n).map(|_| std::array::from_fn(|l| random.signed() * 10f64.powi(3 * l as i32 - 9))).collect()
}

/// The forward transform is `analysis` of the series, continued by its last sample. The inverse is the first rows of
/// `synthesis`.
fn check(basis: &dyn TimeBasis, analysis: &Matrix, synthesis: &Matrix, random: &mut Random) {
    let (n, k) = (basis.frames(), basis.coefficients());
    assert_eq!(k, analysis.len());
    let series = random_lanes(n, random);
    let mut coefficients = vec![Lane::default(); k];
    basis.forward(&series, &mut coefficients);
    for lane in 0..LANES {
        let mut samples = lane_of(&series, lane);
        samples.resize(k, samples[n - 1]);
        let expected = apply(analysis, &samples);
        let what = format!("forward of {n} frames, lane {lane}");
        assert_close(&lane_of(&coefficients, lane), &expected, largest(&expected), &what);
    }
    let given = random_lanes(k, random);
    let mut back = vec![Lane::default(); n];
    basis.inverse(&mut given.clone(), &mut back);
    for lane in 0..LANES {
        let expected = apply(synthesis, &lane_of(&given, lane));
        let what = format!("inverse of {n} frames, lane {lane}");
        assert_close(&lane_of(&back, lane), &expected[..n], largest(&expected), &what);
    }
}

#[test]
fn haar_is_the_reference_matrix_for_every_length() {
    let mut random = Random(1);
    for n in 1..=70 {
        let analysis = haar_matrix(n);
        check(basis(Basis::Haar, &[], n).as_ref(), &analysis, &transpose(&analysis), &mut random);
    }
}

#[test]
fn multi_is_the_reference_matrix_times_root_two_on_the_continued_series() {
    let mut random = Random(2);
    let mut whole = Vec::new();
    for n in 1..=70 {
        let multi = basis(Basis::Multi, &[], n);
        let unscaled = ghm_matrix((multi.coefficients() - 1) / 2);
        let times = |m: &Matrix, by: f64| m.iter().map(|r| r.iter().map(|v| v * by).collect()).collect::<Matrix>();
        let root = std::f64::consts::SQRT_2;
        check(multi.as_ref(), &times(&unscaled, root), &times(&inverse(&unscaled), 1.0 / root), &mut random);
        if multi.coefficients() == n {
            whole.push(n);
        }
    }
    assert_eq!(whole, [3, 5, 9, 17, 33, 65]);
}

#[test]
fn levels_are_those_of_the_reference_order() {
    for p in 1..=5 {
        let n = (1 << p) + 1;
        let levels = basis(Basis::Multi, &[], n).levels();
        assert_eq!(levels, std::iter::once(3).chain((1..p).map(|l| 1 << l)).collect::<Vec<_>>(), "{n} frames");
    }
    assert_eq!(basis(Basis::Haar, &[], 5).levels(), [1, 1, 1, 2]);
    assert_eq!(basis(Basis::Haar, &[], 8).levels(), [1, 1, 2, 4]);
}
