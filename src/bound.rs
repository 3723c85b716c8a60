//! What is promised about an error (method.md section 5), and exact arithmetic to decide it.
//!
//! A promise rests on one comparison, `!(error <= delta)`, whose two sides are rounded against us: the error up, the
//! bound down. No slack is added anywhere.

pub use wavesplat_format::Bound;

use crate::sample::SampleType;
use half::f16;

/// x - y and what rounding took from it: the exact difference is their sum. Not numbers if x - y overflows.
fn difference(x: f64, y: f64) -> (f64, f64) {
    let d = x - y;
    let y_used = x - d;
    let x_used = d + y_used;
    (d, (x - x_used) + (y_used - y))
}

/// |x - y|, rounded up if it is not exact; not a number if either is not finite or the difference overflows.
pub fn difference_up(x: f64, y: f64) -> f64 {
    match difference(x, y) {
        (d, 0.0) => d.abs(),
        (d, lost) if lost.is_finite() => d.abs().next_up(),
        _ => f64::NAN,
    }
}

/// `tolerance` times (`hi` - `lo`), rounded down if it is not exact: the voxel bound delta.
pub fn voxel_bound(tolerance: f64, (lo, hi): (f64, f64)) -> f64 {
    let range = match difference(hi, lo) {
        (range, lost) if range.is_finite() => {
            if lost < 0.0 {
                range.next_down()
            } else {
                range
            }
        }
        _ => f64::MAX,
    };
    let product = tolerance * range;
    let rounded_up = tolerance.mul_add(range, -product) < 0.0 || product < 1e-280; // there what was lost may underflow
    if rounded_up { product.next_down().max(0.0) } else { product }
}

/// The largest error before rounding to the sample type that still leaves `delta` after it; 0 or less if there is none.
///
/// `magnitude` is the largest absolute sample nearby.
pub fn before_rounding(ty: SampleType, delta: f64, magnitude: f64) -> f64 {
    match ty {
        SampleType::F64 => delta,
        SampleType::F32 => delta - magnitude * f64::from(f32::EPSILON) - f64::from(f32::from_bits(1)),
        SampleType::F16 => delta - magnitude * f64::from(f16::EPSILON) - f64::from(f16::MIN_POSITIVE_SUBNORMAL),
        _ => delta.min(delta.floor() + 0.499),
    }
}

/// Whether the errors of one series (one value per frame, rounded up) keep the promise.
pub fn holds(bound: Bound, delta: f64, mut errors: impl ExactSizeIterator<Item = f64>) -> bool {
    match bound {
        Bound::Pointwise => errors.all(|e| e <= delta),
        Bound::Rms => {
            let frames = errors.len() as f64;
            let add = |(sum, each): (f64, bool), e: f64| ((sum + (e * e).next_up()).next_up(), each && e <= delta);
            let (squares, each) = errors.fold((0.0, true), add);
            // Each within delta is enough; squares alone are rounded too far against us at delta itself, and underflow.
            each || squares <= (frames * delta * delta).next_down().next_down()
        }
    }
}

/// The quantisation step of orthonormal-like coefficients for which rounding alone keeps the promise.
///
/// `gain` is the largest sum of |u_k(t)| over k: with step/2 in every coefficient a sample moves by gain * step / 2.
pub fn step(bound: Bound, delta: f64, gain: f64) -> f64 {
    match bound {
        Bound::Pointwise => 2.0 * delta / gain,
        // Rounding moves a sample by step / sqrt 12 rms; the rest of the budget is left for dropping coefficients.
        Bound::Rms => delta,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn exact_differences_are_not_rounded() {
        assert_eq!(difference_up(5.0, 3.0), 2.0);
        assert_eq!(difference_up(-0.5, 0.25), 0.75);
        assert!(difference_up(f64::INFINITY, 0.0).is_nan());
        assert!(difference_up(f64::MAX, -f64::MAX).is_nan());
    }

    #[test]
    fn inexact_differences_are_rounded_up() {
        assert_eq!(difference_up(1.0, -1e-20), 1f64.next_up());
        assert_eq!(difference_up(1.0, 1e-20), 1f64.next_up());
    }

    #[test]
    fn whole_bounds_stay_whole() {
        assert_eq!(voxel_bound(0.02, (0.0, 50.0)), 1.0);
        assert_eq!(voxel_bound(0.5, (-1.0, 1.0)), 1.0);
        assert_eq!(voxel_bound(0.0, (0.0, 1e300)), 0.0);
        assert!(voxel_bound(0.01, (-f64::MAX, f64::MAX)).is_finite());
        assert_eq!(voxel_bound(0.3, (0.0, 5e-324)), 0.0);
        assert_eq!(voxel_bound(0.3, (0.0, 1e-323)), 0.0);
    }

    #[test]
    fn errors_of_just_delta_keep_the_root_mean_square() {
        for delta in [0.0, 5e-324, 1e-200, 0.1, 4.0, f64::MAX] {
            assert!(holds(Bound::Rms, delta, [delta; 3].into_iter()), "{delta}");
            assert!(!holds(Bound::Rms, delta, [delta.next_up(); 3].into_iter()), "{delta}");
        }
    }

    #[test]
    fn whole_numbers_get_no_more_than_half_a_step_beyond_their_whole_bound() {
        assert_eq!(before_rounding(SampleType::U8, 0.3, 255.0), 0.3);
        assert_eq!(before_rounding(SampleType::U8, 2.7, 255.0), 2.499);
    }

    proptest! {
        /// In 128-bit integers: no difference comes out below the truth.
        #[test]
        fn differences_are_never_below_the_truth(a in -(1i64 << 52)..(1i64 << 52), b in -(1i64 << 52)..(1i64 << 52), shift in 0u32..40) {
            let x = a as f64 * f64::from(2u32.pow(shift.min(31)));
            let y = b as f64;
            let truth = (i128::from(a) * (1i128 << shift.min(31)) - i128::from(b)).unsigned_abs();
            prop_assert!(difference_up(x, y) as u128 >= truth);
        }
    }
}
