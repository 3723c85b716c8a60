//! The fewest coefficients that keep a series within a bound (eq 7), by trying every subset of them. For tiny series.
//!
//! Kept coefficients have their exact values: nothing is quantised, and none is adjusted to compensate for dropped
//! ones.

use super::transform::{Matrix, apply};

/// The error measure that is compared with the bound.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Measure {
    /// The largest |error| over the samples (eq 21).
    Largest,
    /// The square root of the mean over the samples of the squared error (eq 23).
    Rms,
}

/// The error of `found` against `samples`.
pub(crate) fn error(measure: Measure, samples: &[f64], found: &[f64]) -> f64 {
    let errors = samples.iter().zip(found).map(|(sample, found)| found - sample);
    match measure {
        Measure::Largest => errors.map(f64::abs).fold(0.0, f64::max),
        Measure::Rms => (errors.map(|e| e * e).sum::<f64>() / samples.len() as f64).sqrt(),
    }
}

/// A choice of coefficients.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Kept {
    /// Indices of the kept coefficients, ascending.
    pub(crate) indices: Vec<usize>,
    /// The error of their reconstruction.
    pub(crate) error: f64,
}

/// The fewest coefficients whose reconstruction stays within `delta` of `samples`; of the choices with that number, the
/// one with the smallest error. The comparison is a plain `<=` without slack, so none is found only when `delta` is below
/// the rounding of the reconstruction from all coefficients. A series within `delta` of zero keeps none.
pub(crate) fn fewest(
    analysis: &Matrix,
    synthesis: &Matrix,
    samples: &[f64],
    measure: Measure,
    delta: f64,
) -> Option<Kept> {
    let coefficients = apply(analysis, samples);
    let n = coefficients.len();
    assert!(n <= 16, "every one of 2^n subsets is tried");
    let mut best: Option<Kept> = None;
    for subset in 0..1_usize << n {
        let indices: Vec<usize> = (0..n).filter(|k| subset >> k & 1 == 1).collect();
        let mut kept = vec![0.0; n];
        for &k in &indices {
            kept[k] = coefficients[k];
        }
        let error = error(measure, samples, &apply(synthesis, &kept));
        let better = best.as_ref().is_none_or(|best| {
            indices.len() < best.indices.len() || indices.len() == best.indices.len() && error < best.error
        });
        if error <= delta && better {
            best = Some(Kept { indices, error });
        }
    }
    best
}

mod tests {
    use super::super::transform::{ghm_matrix, haar_matrix, inverse, transpose};
    use super::*;

    fn haar(samples: &[f64], measure: Measure, delta: f64) -> Option<Kept> {
        let analysis = haar_matrix(samples.len());
        fewest(&analysis, &transpose(&analysis), samples, measure, delta)
    }

    fn number(samples: &[f64], measure: Measure, delta: f64) -> usize {
        haar(samples, measure, delta).unwrap().indices.len()
    }

    #[test]
    fn within_the_bound_of_zero_keeps_none() {
        for measure in [Measure::Largest, Measure::Rms] {
            assert!(haar(&[0.5, -0.5, 0.25, 0.5], measure, 0.5).unwrap().indices.is_empty());
        }
    }

    #[test]
    fn a_constant_keeps_its_mean_alone() {
        assert_eq!(haar(&[2.0; 8], Measure::Largest, 1e-9).unwrap().indices, [0]);
    }

    #[test]
    fn steps_by_hand() {
        // (1, 3) has mean 2 and difference -2: without the difference the error is 1 everywhere, without the mean 2.
        assert_eq!(number(&[1.0, 3.0], Measure::Largest, 3.0), 0);
        assert_eq!(haar(&[1.0, 3.0], Measure::Largest, 1.0 + 1e-12).unwrap().indices, [0]);
        assert_eq!(number(&[1.0, 3.0], Measure::Largest, 0.99), 2);
        // Mean square: all dropped, 5; the difference dropped, 1.
        assert_eq!(number(&[1.0, 3.0], Measure::Rms, 5.0_f64.sqrt() + 1e-12), 0);
        assert_eq!(number(&[1.0, 3.0], Measure::Rms, 2.23), 1);
        assert_eq!(number(&[1.0, 3.0], Measure::Rms, 0.99), 2);
    }

    #[test]
    fn rms_with_haar_keeps_the_largest_coefficients() {
        // Orthonormal (section 3): the mean square error is the energy of the dropped coefficients over T.
        let samples: Vec<f64> = (0..8).map(|j| (j as f64 * 1.9).sin() + 0.3 * j as f64).collect();
        let mut energies: Vec<f64> = apply(&haar_matrix(8), &samples).iter().map(|c| c * c).collect();
        energies.sort_by(f64::total_cmp);
        for delta in [0.05, 0.1, 0.3, 0.5, 1.0] {
            let mut dropped = 0;
            while energies[..=dropped].iter().sum::<f64>() / 8.0 <= delta * delta {
                dropped += 1;
            }
            assert_eq!(number(&samples, Measure::Rms, delta), 8 - dropped, "delta {delta}");
        }
    }

    #[test]
    fn dropping_the_smallest_first_is_not_always_fewest_for_the_largest_error() {
        // Random series; greedy by magnitude never beats the search, and sometimes loses.
        let mut state = 1_u64;
        let mut random = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 / (1_u64 << 53) as f64 - 0.5
        };
        let analysis = haar_matrix(8);
        let synthesis = transpose(&analysis);
        let mut lost = 0;
        for _ in 0..50 {
            let samples: Vec<f64> = (0..8).map(|_| random()).collect();
            let coefficients = apply(&analysis, &samples);
            let mut order: Vec<usize> = (0..8).collect();
            order.sort_by(|&i, &j| coefficients[j].abs().total_cmp(&coefficients[i].abs()));
            let mut kept = vec![0.0; 8];
            let mut greedy = 0;
            while error(Measure::Largest, &samples, &apply(&synthesis, &kept)) > 0.25 {
                kept[order[greedy]] = coefficients[order[greedy]];
                greedy += 1;
            }
            let fewest = number(&samples, Measure::Largest, 0.25);
            assert!(fewest <= greedy);
            lost += usize::from(fewest < greedy);
        }
        assert!(lost > 0);
    }

    #[test]
    fn a_line_keeps_three_of_the_multiwavelet() {
        let analysis = ghm_matrix(2);
        let synthesis = inverse(&analysis);
        let line = [1.0, 2.0, 3.0, 4.0, 5.0];
        let kept = fewest(&analysis, &synthesis, &line, Measure::Largest, 1e-9).unwrap();
        assert_eq!(kept.indices, [0, 1, 2]);
        assert!(kept.error < 1e-12);
    }

    #[test]
    fn a_bound_below_rounding_finds_none() {
        assert_eq!(haar(&[0.1, 0.2, 0.7], Measure::Largest, -1.0), None);
    }
}
