//! Error bounds: what a file guarantees, and exact arithmetic to decide whether a block meets its bound.
//!
//! A file guarantees one of these for all its samples v, decoded to v^:
//!
//! ```text
//! pointwise    |v^ - v| <= delta = tolerance * (largest sample - least sample)                            (eq 21)
//! relative     |v^ - v| <= tolerance * max(|v|, floor)                                                    (eq 22)
//! rms          sqrt(mean over the present frames of a window of (v^ - v)^2) <= delta                      (eq 23)
//! ```
//!
//! `--keep` may limit single samples further ([`SampleLimits`], eq 47).
//!
//! The weights w_i of the voxels at a pixel are positive (eq 3). So eq 21 bounds every pixel of every view, by the
//! triangle inequality:
//!
//! ```text
//! |I^ - I| <= sum of w_i |v^_i - v_i| <= delta sum of w_i        |g^ - g| <= delta                        (eq 24)
//! ```
//!
//! Under eq 22, with samples of at least the floor, the relative error of a pixel is at most the tolerance: this bounds
//! what [Dobashi](crate::bibliography) calls E_rel (eq 10). Eq 23 bounds the mean over a window alone: one frame may be
//! off by sqrt(T) delta. Missing samples have no error and count in no mean. `sampled` is eq 23 with a delta from random
//! pixels: an estimate (`convert::sampled`).
//!
//! Rounding every coefficient by at most step / 2 moves a sample by at most gain step / 2, hence
//!
//! ```text
//! step = 2 delta / gain        gain = max over t of the sum over k of |u_k(t)|                            (eq 25)
//! ```
//!
//! One comparison decides a bound: `!(error <= allowed)`. The error is rounded up and the allowed value down, so
//! rounding never hides a violation. No slack is added to a bound. The *share* of a sample is its error divided by its
//! allowed error. The share of a series is the largest, or the root mean square, of its samples' shares. A bound holds
//! if all shares are at most 1.

pub use super::limits::SampleLimits;
pub use wavesplat_format::Bound;

use crate::base::half::Half;
use crate::base::sample::SampleType;

/// x - y, and its rounding error: the exact difference is their sum ([Knuth](crate::bibliography)). NaN if x - y
/// overflows.
fn difference(x: f64, y: f64) -> (f64, f64) {
    let d = x - y;
    let y_used = x - d;
    let x_used = d + y_used;
    (d, (x - x_used) + (y_used - y))
}

/// x - y|, rounded up if it is not exact; NaN if x or y is not finite or the difference overflows.
pub fn difference_up(x: f64, y: f64) -> f64 {
    match difference(x, y) {
        (d, 0.0) => d.abs(),
        (d, lost) if lost.is_finite() && (d > 0.0) != (lost > 0.0) => d.abs(), // rounded away from 0
        (d, lost) if lost.is_finite() => d.abs().next_up(),
        _ => f64::NAN,
    }
}

/// `hi` - `lo`, rounded down if it is not exact.
fn length_down((lo, hi): (f64, f64)) -> f64 {
    match difference(hi, lo) {
        (range, lost) if range.is_finite() => {
            if lost < 0.0 {
                range.next_down()
            } else {
                range
            }
        }
        _ => f64::MAX,
    }
}

/// `a` times `b`, neither negative, rounded down if it is not exact.
fn product_down(a: f64, b: f64) -> f64 {
    let product = a * b;
    if a == 1.0 {
        return product; // exact, however small
    }
    let rounded_up = a.mul_add(b, -product) < 0.0 || product < UNDERFLOW;
    if rounded_up { product.next_down().max(0.0) } else { product }
}

/// The rounding error of a product below this may underflow.
const UNDERFLOW: f64 = 1e-280;

/// `tolerance` times the length of a range, rounded down: the delta of [`Bound::Pointwise`] and [`Bound::Rms`] (eq 21).
pub fn range_bound(tolerance: f64, range: (f64, f64)) -> f64 {
    if range.0 <= range.1 { product_down(tolerance, length_down(range)) } else { 0.0 } // no samples yet
}

/// `tolerance` times the larger of |`value`| and `floor`, rounded down: the error that [`Bound::Relative`] allows (eq
/// 22).
pub fn relative_bound(tolerance: f64, floor: f64, value: f64) -> f64 {
    product_down(tolerance, value.abs().max(floor))
}

/// The error bound of the samples of one window.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ErrorBound {
    /// The kind of bound.
    pub bound: Bound,
    /// The tolerance asked for: a share of the value range, or of each sample's magnitude.
    pub tolerance: f64,
    /// The largest error allowed to any sample, or root mean square error allowed to any series; 0 means bit-exact.
    pub delta: f64,
    /// What else limits the errors of single samples.
    limits: Option<SampleLimits>,
}

/// The form of the error that is allowed to samples.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Form {
    /// The same error for every sample.
    Same,
    /// An error for each sample.
    Varying,
    /// A mean over a series.
    Mean,
}

/// How the share of a series follows from the shares of its samples.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Measure {
    /// The largest.
    Largest,
    /// The root mean square.
    RootMeanSquare,
}

impl ErrorBound {
    /// A bound without other limits.
    pub fn new(bound: Bound, tolerance: f64, delta: f64) -> Self {
        Self { bound, tolerance, delta, limits: None }
    }

    /// The bound with limits of single samples. Where a mean has limits, no error of a sample exceeds delta.
    pub fn within(self, limits: Option<SampleLimits>) -> Self {
        let largest = limits.map_or(f64::INFINITY, |limits| limits.largest);
        Self { limits, delta: self.delta.min(largest), ..self }
    }

    fn form(&self) -> Form {
        match (self.bound, self.limits) {
            (Bound::Relative { .. }, _) | (_, Some(SampleLimits { relative: Some(_), .. })) => Form::Varying,
            (Bound::Rms | Bound::Sampled { .. }, None) => Form::Mean,
            _ => Form::Same,
        }
    }

    /// Whether delta is allowed to every sample.
    pub fn is_same(&self) -> bool {
        self.form() == Form::Same
    }

    /// Whether the error that is allowed to a sample depends on it.
    pub(super) fn is_varying(&self) -> bool {
        self.form() == Form::Varying
    }

    /// The least magnitude to which a share applies; 0 if none does.
    pub(super) fn floor(&self) -> f64 {
        match (self.bound, self.limits.and_then(|limits| limits.relative)) {
            (Bound::Relative { floor }, Some(limit)) => floor.min(limit.floor),
            (Bound::Relative { floor }, None) => floor,
            (_, limit) => limit.map_or(0.0, |limit| limit.floor),
        }
    }

    /// How the share of a series follows from the shares of its samples.
    pub fn measure(&self) -> Measure {
        if self.form() == Form::Mean { Measure::RootMeanSquare } else { Measure::Largest }
    }

    /// The error allowed to a sample of this value, rounded down. For a bound of the mean, the allowed root mean
    /// square.
    pub fn allowed(&self, value: f64) -> f64 {
        let of_bound = match self.bound {
            Bound::Relative { floor } => relative_bound(self.tolerance, floor, value),
            _ => self.delta,
        };
        let Some(limits) = self.limits else { return of_bound };
        let of_share = limits.share_at(value).map_or(f64::INFINITY, |share| relative_bound(share, 0.0, value));
        of_bound.min(of_share).min(self.delta)
    }

    /// As [`Self::allowed`], without directed rounding; 0 if it may underflow.
    #[inline(always)]
    fn about_allowed(&self, value: f64) -> f64 {
        let of_bound = match self.bound {
            Bound::Relative { floor } => self.tolerance * if value.abs() > floor { value.abs() } else { floor },
            _ => self.delta,
        };
        let (share, delta) = self.limits.map_or((None, f64::INFINITY), |limits| (limits.share_at(value), self.delta));
        let of_share = share.map_or(f64::INFINITY, |share| share * value.abs());
        let of_limits = if of_share < delta { of_share } else { delta };
        let allowed = if of_limits < of_bound { of_limits } else { of_bound };
        if allowed < UNDERFLOW { 0.0 } else { allowed }
    }

    /// Whether the errors of one series are within the bound (eq 21-23). For each sample that is not missing: the error,
    /// rounded up, and the allowed error.
    pub fn holds(&self, mut errors: impl ExactSizeIterator<Item = (f64, f64)>) -> bool {
        match self.measure() {
            Measure::Largest => errors.all(|(e, allowed)| e <= allowed),
            Measure::RootMeanSquare => {
                let present = errors.len() as f64;
                let add = |(sum, each): (f64, bool), (e, allowed): (f64, f64)| {
                    ((sum + (e * e).next_up()).next_up(), each && e <= allowed)
                };
                let (squares, each) = errors.fold((0.0, true), add);
                // It suffices that each error is within delta. The squares alone would fail by rounding at delta itself, or
                // underflow.
                each || squares <= (present * self.delta * self.delta).next_down().next_down()
            }
        }
    }

    /// The share of a series, rounded up; `errors` are as for [`Self::holds`].
    pub fn share(&self, errors: impl ExactSizeIterator<Item = (f64, f64)>) -> f64 {
        let present = errors.len().max(1) as f64;
        let add = |(largest, squares): (f64, f64), (e, allowed)| {
            let share = share(e, allowed);
            (share.max(largest), squares + share * share)
        };
        let (largest, squares) = errors.fold((0.0, 0.0), add);
        match self.measure() {
            Measure::Largest => largest,
            // The mean is at most the largest; underflow loses less than the smallest positive number.
            Measure::RootMeanSquare => largest.min((squares / present * UP + f64::MIN_POSITIVE).sqrt()),
        }
    }

    /// Adds the errors of the next frame of `N` series with samples `values` to the sums for [`Self::largest_share`].
    /// This is vector code without directed rounding.
    pub(crate) fn add<const N: usize>(&self, errors: &[f64; N], values: &[f64; N], sums: &mut [f64; N]) {
        for ((sum, e), value) in sums.iter_mut().zip(errors).zip(values) {
            match self.form() {
                Form::Same => *sum = if *e > *sum { *e } else { *sum },
                Form::Mean => *sum += e * e + if *e > 0.0 { f64::MIN_POSITIVE } else { 0.0 }, // never 0 by underflow
                Form::Varying => {
                    let allowed = self.about_allowed(*value);
                    let used = e / allowed;
                    let used = if used < f64::MIN_POSITIVE { f64::MIN_POSITIVE } else { used }; // never 0 by underflow
                    let share = if *e > 0.0 { used } else { 0.0 };
                    *sum = if share > *sum { share } else { *sum };
                }
            }
        }
    }

    /// An upper bound of the largest share of `N` series of `frames` frames, none of them missing, from the sums of
    /// [`Self::add`].
    pub(crate) fn largest_share<const N: usize>(&self, sums: &[f64; N], frames: usize) -> f64 {
        let largest = sums.iter().copied().fold(0.0, f64::max);
        match self.form() {
            Form::Same if largest > 0.0 => share(largest.next_up(), self.delta),
            Form::Varying if largest > 0.0 => (largest * UP).next_up(),
            Form::Same | Form::Varying => 0.0,
            Form::Mean if !(1e-140..1e140).contains(&self.delta) => f64::INFINITY, // squares would overflow or underflow
            Form::Mean if largest == 0.0 => 0.0,
            Form::Mean => {
                let mean = largest / frames as f64 / (self.delta * self.delta);
                (mean * UP + 1e-40).sqrt() // an error whose square underflowed was below 1e-20 of delta
            }
        }
    }

    /// The largest quantisation step for which rounding alone stays within the allowed `error` (eq 25).
    ///
    /// `gain` is the largest sum of |u_k(t)| over k ([`crate::wavelet::gain`]). Bounds of the mean ignore it.
    pub(crate) fn step(&self, error: f64, gain: f64) -> f64 {
        match self.measure() {
            Measure::Largest => 2.0 * error / gain,
            // Rounding has a root mean square of step / sqrt 12; the rest of the budget is for dropped coefficients.
            Measure::RootMeanSquare => error,
        }
    }
}

/// A factor that covers the rounding error of a mean of as many squares as a window has frames.
const UP: f64 = 1.0 + 1e-12;

/// The share: an error, rounded up, divided by the allowed error, rounded down. The result is rounded up.
pub fn share(error: f64, allowed: f64) -> f64 {
    if error > 0.0 { (error / allowed).next_up() } else { 0.0 }
}

/// The largest error before rounding to the sample type that stays within `delta` after it; 0 or less if none does.
///
/// `magnitude` is the largest absolute value of the samples.
pub(crate) fn before_rounding(ty: SampleType, delta: f64, magnitude: f64) -> f64 {
    match ty {
        SampleType::F64 => delta,
        SampleType::F32 => delta - magnitude * f64::from(f32::EPSILON) - f64::from(f32::from_bits(1)),
        SampleType::F16 => delta - magnitude * Half::EPSILON - Half::LEAST,
        _ => delta.min(delta.floor() + 0.499),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use wavesplat_format::Keep;

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
        assert_eq!(difference_up(1.0, 1e-20), 1.0);
        assert_eq!(difference_up(-1.0, -1e-20), 1.0);
        assert_eq!(difference_up(-1.0, 1e-20), 1f64.next_up());
    }

    #[test]
    fn limits_hold_beside_every_bound() {
        let keep = Keep::parse("relative=0.5@4 difference=6").expect("words");
        let limits = SampleLimits::new(&keep, [1; 3], [1.0; 3]);
        for bound in [Bound::Pointwise, Bound::Rms, Bound::Relative { floor: 8.0 }] {
            let bound = ErrorBound::new(bound, 2.0, 100.0).within(limits);
            assert_eq!(bound.measure(), Measure::Largest);
            let samples = [0.0, 3.9, 4.0, -5.0, 100.0, -4.5];
            assert_eq!(samples.map(|v| bound.allowed(v).next_up()), samples.map(|v| bound.about_allowed(v).next_up()));
            for (v, expected) in samples.into_iter().zip([3.0, 3.0, 2.0, 2.5, 3.0, 2.25]) {
                assert!((bound.allowed(v) / expected - 1.0).abs() < 1e-14, "{bound:?} {v}");
            }
        }
    }

    #[test]
    fn whole_bounds_stay_whole() {
        assert_eq!(range_bound(0.02, (0.0, 50.0)), 1.0);
        assert_eq!(range_bound(0.5, (-1.0, 1.0)), 1.0);
        assert_eq!(range_bound(0.0, (0.0, 1e300)), 0.0);
        assert!(range_bound(0.01, (-f64::MAX, f64::MAX)).is_finite());
        assert_eq!(range_bound(0.3, (0.0, 5e-324)), 0.0);
        assert_eq!(range_bound(0.3, (0.0, 1e-323)), 0.0);
        assert_eq!(range_bound(0.3, (f64::INFINITY, f64::NEG_INFINITY)), 0.0);
    }

    #[test]
    fn errors_of_just_delta_keep_the_root_mean_square() {
        for delta in [0.0, 5e-324, 1e-200, 0.1, 4.0, f64::MAX] {
            let bound = ErrorBound::new(Bound::Rms, 0.1, delta);
            assert!(bound.holds([(delta, delta); 3].into_iter()), "{delta}");
            assert!(!bound.holds([(delta.next_up(), delta); 3].into_iter()), "{delta}");
        }
    }

    fn relative(tolerance: f64, floor: f64) -> ErrorBound {
        ErrorBound::new(Bound::Relative { floor }, tolerance, relative_bound(tolerance, floor, -8.0))
    }

    #[test]
    fn a_relative_bound_is_a_share_of_each_magnitude_or_of_the_floor() {
        let bound = relative(0.25, 1.0);
        assert_eq!([-8.0, 2.0, 1.0, 0.5, 0.0].map(|v| bound.allowed(v)), [2.0, 0.5, 0.25, 0.25, 0.25]);
        assert_eq!(bound.delta, 2.0);
        assert_eq!(relative(0.25, 100.0).delta, 25.0);
        assert_eq!(relative(0.25, 0.0).allowed(-0.0), 0.0);
        assert!(bound.holds([(2.0, 2.0), (0.25, 0.25)].into_iter()));
        assert!(!bound.holds([(2.0, 2.0), (0.25f64.next_up(), 0.25)].into_iter()));
        assert!(!bound.holds([(f64::NAN, 2.0)].into_iter()));
    }

    #[test]
    fn whole_numbers_get_no_more_than_half_a_step_beyond_their_whole_bound() {
        assert_eq!(before_rounding(SampleType::U8, 0.3, 255.0), 0.3);
        assert_eq!(before_rounding(SampleType::U8, 2.7, 255.0), 2.499);
    }

    proptest! {
        /// Against 128-bit integers: no difference is below the true one.
        #[test]
        fn differences_are_never_below_the_truth(a in -(1i64 << 52)..(1i64 << 52), b in -(1i64 << 52)..(1i64 << 52), shift in 0u32..40) {
            let x = a as f64 * f64::from(2u32.pow(shift.min(31)));
            let y = b as f64;
            let truth = (i128::from(a) * (1i128 << shift.min(31)) - i128::from(b)).unsigned_abs();
            prop_assert!(difference_up(x, y) as u128 >= truth);
        }

        /// Against 128-bit integers: the allowed error never exceeds the product, and is less by no more than rounding.
        #[test]
        fn what_is_allowed_never_exceeds_the_product(
            t in 0..=1u64 << 53, v in -(1i64 << 53)..(1i64 << 53), floor in 0..1u64 << 53, down in 0..900_i32,
        ) {
            let unit = 2f64.powi(-53);
            let scale = 2f64.powi(-down);
            let bound = relative(t as f64 * unit, floor as f64 * scale);
            let allowed = bound.allowed(v as f64 * scale);
            let truth = u128::from(t) * u128::from(v.unsigned_abs().max(floor)); // in units of unit * scale
            let in_units = allowed / scale; // a power of two
            let (whole, rest) = (in_units.floor(), in_units.fract());
            let found = ((whole as u128) << 53) + (rest / unit) as u128;
            prop_assert!(found <= truth, "{found} {truth}");
            prop_assert!(truth - found <= truth >> 51, "{found} {truth}");
        }

        /// Errors so small that their share underflows use some of the bound.
        #[test]
        fn an_error_uses_some_of_a_bound(value in 1.0..1e300_f64, tolerance in 0.01..1.0, error in 1..1_u64 << 60) {
            for kind in [Bound::Pointwise, Bound::Rms, Bound::Relative { floor: 0.0 }] {
                let bound = ErrorBound::new(kind, tolerance, 1e10);
                let mut sums = [0.0];
                bound.add(&[f64::from_bits(error)], &[value], &mut sums);
                prop_assert!(bound.largest_share(&sums, 1) > 0.0);
            }
        }

        /// The vector code's share is at least the exact share, and close to it.
        #[test]
        fn shares_of_many_are_no_less_than_those_of_each(
            values in proptest::collection::vec((-1e3..1e3, 0.0..30.0), 1..40), kind in 0..3_usize, floor in 0.0..10.0,
        ) {
            let bound = [Bound::Pointwise, Bound::Rms, Bound::Relative { floor }][kind];
            let bound = ErrorBound::new(bound, 0.02, 20.0);
            let mut sums = [0.0];
            values.iter().for_each(|(v, e)| bound.add(&[*e], &[*v], &mut sums));
            let fast = bound.largest_share(&sums, values.len());
            let slow = bound.share(values.iter().map(|(v, e)| (*e, bound.allowed(*v))));
            prop_assert!(fast >= slow * (1.0 - 1e-15) && fast <= slow * (1.0 + 1e-11), "{fast} {slow}");
            prop_assert!(slow > 1.0 || bound.holds(values.iter().map(|(v, e)| (*e, bound.allowed(*v)))));
        }
    }
}
