//! The values beside a colour bar.

use crate::colour::{Norm, Scale};

/// About `wanted` round values within a scale's range: evenly spaced, or powers of ten for a logarithmic scale.
pub(super) fn ticks(scale: &Scale, wanted: usize) -> Vec<f64> {
    let (lo, hi) = scale.range();
    if !(hi - lo > 1e-11 * lo.abs().max(hi.abs()) && (hi - lo).is_finite()) {
        return vec![lo];
    }
    let decades = if scale.norm() == Norm::Log { decades(lo, hi, wanted) } else { Vec::new() };
    if decades.len() > 1 { decades } else { round_values(lo, hi, wanted) }
}

/// About `wanted` multiples of 1, 2 or 5 times a power of ten between two numbers.
pub fn round_values(lo: f64, hi: f64, wanted: usize) -> Vec<f64> {
    let least = (hi - lo) / wanted as f64;
    let power = exponent(least);
    let step =
        [1.0, 2.0, 5.0].map(|m| m * ten_to(power)).into_iter().find(|s| *s >= least).unwrap_or(ten_to(power + 1));
    let (first, last) = ((lo / step - 1e-9).ceil(), (hi / step + 1e-9).floor());
    let count = (last - first).max(0.0) as usize;
    (0..=count.min(2 * wanted)).map(|i| (first + i as f64) * step).collect()
}

/// The largest of 1, 2 and 5 times a power of ten that a positive number reaches.
pub(super) fn round_below(most: f64) -> f64 {
    let power = ten_to(exponent(most));
    [5.0, 2.0].map(|m| m * power).into_iter().find(|value| *value <= most).unwrap_or(power)
}

/// Powers of ten, thinned out to about `wanted`. If there are only one or two, also 2 and 5 times these.
fn decades(lo: f64, hi: f64, wanted: usize) -> Vec<f64> {
    let (first, last) = (exponent(lo), exponent(hi));
    let within = |v: &f64| (lo..=hi).contains(v);
    let powers: Vec<f64> = (first..=last).map(ten_to).filter(within).collect();
    if powers.len() > 2 {
        return powers.iter().step_by(powers.len().div_ceil(wanted)).copied().collect();
    }
    (first..=last).flat_map(|power| [1.0, 2.0, 5.0].map(|m| m * ten_to(power))).filter(within).collect()
}

/// The power of ten at or below a positive number.
fn exponent(v: f64) -> i32 {
    let text = format!("{v:e}");
    text.split_once('e').and_then(|(_, power)| power.parse().ok()).unwrap_or(0)
}

/// A power of ten, correctly rounded (`powi` is not).
fn ten_to(power: i32) -> f64 {
    format!("1e{power}").parse().unwrap_or(f64::INFINITY)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::decimal::short;
    use crate::colour::TransferFunction;

    fn labels(range: (f64, f64), norm: Norm, wanted: usize) -> Vec<String> {
        let map = TransferFunction::open("grey").expect("a known map");
        let scale = Scale::new(&map, range, norm, [0; 3]).expect("a range");
        ticks(&scale, wanted).into_iter().map(short).collect()
    }

    #[test]
    fn values_are_round() {
        let even = |lo, hi, wanted| labels((lo, hi), Norm::Linear, wanted);
        assert_eq!(even(0.0, 1.0, 5), ["0", "0.2", "0.4", "0.6", "0.8", "1"]);
        assert_eq!(even(-0.13, 0.31, 5), ["-0.1", "0", "0.1", "0.2", "0.3"]);
        assert_eq!(even(-3e6, 2.4e6, 3), ["-2e6", "0", "2e6"]);
        assert_eq!(even(1e-9, 5e-9, 4), ["1e-9", "2e-9", "3e-9", "4e-9", "5e-9"]);
        assert_eq!(even(1e6, 1e6 + 1.0, 2), ["1e6", "1.0000005e6", "1.000001e6"]);
        assert_eq!(even(7.0, 7.0, 4), ["7"]);
        assert_eq!(even(-1e308, 1e308, 4), ["-1e308"], "too far apart to divide");
    }

    #[test]
    fn lengths_are_round() {
        assert_eq!([1.0, 1.99, 2.0, 4.7, 5.2, 0.03, 990.0].map(round_below), [1.0, 1.0, 2.0, 2.0, 5.0, 0.02, 500.0]);
    }

    #[test]
    fn logarithms_have_decades() {
        let log = |lo, hi, wanted| labels((lo, hi), Norm::Log, wanted);
        assert_eq!(log(2e-4, 30.0, 8), ["0.001", "0.01", "0.1", "1", "10"]);
        assert_eq!(log(1e-9, 1e9, 5), ["1e-9", "1e-5", "0.1", "1000", "1e7"]);
        assert_eq!(log(0.9, 30.0, 8), ["1", "2", "5", "10", "20"]);
        assert_eq!(log(3.1, 4.2, 3), ["3.5", "4"]);
    }
}
