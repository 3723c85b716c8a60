//! The values beside a colour bar.

use wavesplat_core::base::decimal;
use wavesplat_core::colour::{Norm, Scale};

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

/// The multiples of 1, 2, 2.5 or 5 times a power of ten between two numbers, for each step that gives two to `most` of
/// them, from the finest on.
pub(super) fn all_round_values(lo: f64, hi: f64, most: usize) -> impl Iterator<Item = Vec<f64>> {
    let width = hi - lo;
    let first = exponent(width / (most + 1) as f64);
    let steps = (first..=first + 3).flat_map(|power| {
        // No 2.5: its multiples are as long as fractions of it.
        let quarter = (power != 0).then(|| 25.0 * ten_to(power - 1));
        [Some(1.0 * ten_to(power)), Some(2.0 * ten_to(power)), quarter, Some(5.0 * ten_to(power))].into_iter().flatten()
    });
    let values = move |step: f64| {
        let (first, last) = ((lo / step - 1e-9).ceil(), (hi / step + 1e-9).floor());
        let count = (last - first + 1.0).max(0.0) as usize;
        (2..=most).contains(&count).then(|| (0..count).map(|i| (first + i as f64) * step).collect())
    };
    steps.filter(move |_| width > 0.0 && width.is_finite()).filter_map(values)
}

/// Round values between two numbers from the roundest on: 0, powers of ten, their fives and twos, and then the multiples between.
/// For axes whose values lie unevenly: no step suits them.
pub(super) fn roundest(lo: f64, hi: f64) -> Vec<f64> {
    /// So many powers of ten below the largest.
    const POWERS: i32 = 6;
    let largest = lo.abs().max(hi.abs());
    let (last, within) = (exponent(largest), |v: &f64| (lo..=hi).contains(v));
    let of = |multiples: &[f64]| -> Vec<f64> {
        let powers = (last - POWERS..=last).rev();
        powers
            .flat_map(|power| multiples.iter().flat_map(move |m| [1.0, -1.0].map(|sign| sign * m * ten_to(power))))
            .collect()
    };
    let all = [vec![0.0], of(&[1.0]), of(&[5.0]), of(&[2.0]), of(&[3.0, 7.0, 4.0, 8.0, 6.0, 9.0]), of(&[1.5, 2.5])];
    all.concat().into_iter().filter(within).collect()
}

/// The texts of values, all with a power of ten or all without.
pub(super) fn texts(values: &[f64]) -> Vec<String> {
    let short: Vec<String> = values.iter().map(|value| decimal::short(*value)).collect();
    let with_power = short.iter().any(|text| text.contains('e'));
    let texts = short.into_iter().map(|text| text.replace('-', "−"));
    if with_power { values.iter().map(|value| self::with_power(*value)).collect() } else { texts.collect() }
}

/// A value as a number and a power of ten.
pub(super) fn with_power(value: f64) -> String {
    decimal::with_power(value).replace('-', "−")
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
    use wavesplat_core::base::decimal::short;
    use wavesplat_core::colour::TransferFunction;

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
    fn values_have_one_form() {
        assert_eq!(texts(&[0.0, 5e5, 1e6, -1.5e6]), ["0", "5e5", "1e6", "−1.5e6"]);
        assert_eq!(texts(&[0.0, 0.5, 1.0]), ["0", "0.5", "1"]);
        assert_eq!(texts(&[1e-5, 0.1, 1.0, 1000.0, 1e7]), ["1e−5", "1e−1", "1e0", "1e3", "1e7"]);
        assert_eq!(texts(&[0.1 + 0.2, 4e6]), ["3e-1".replace('-', "−"), "4e6".into()]);
    }

    #[test]
    fn steps_become_coarser() {
        let finest = |lo, hi| all_round_values(lo, hi, 6).next().unwrap_or_default();
        assert_eq!(finest(-0.5, 95.5), [0.0, 20.0, 40.0, 60.0, 80.0]);
        assert_eq!(finest(-0.5, 127.5), [0.0, 25.0, 50.0, 75.0, 100.0, 125.0]);
        assert_eq!(finest(-0.5, 11.5), [0.0, 2.0, 4.0, 6.0, 8.0, 10.0]);
        assert_eq!(finest(0.0, 1.3), [0.0, 0.25, 0.5, 0.75, 1.0, 1.25]);
        for size in 2..3000 {
            let (hi, mut before) = (f64::from(size) - 0.5, usize::MAX);
            let all: Vec<Vec<f64>> = all_round_values(-0.5, hi, 6).collect();
            assert!(size < 8 || all[0].len() >= 3, "{size}: {all:?}");
            for values in all {
                assert!(values.len() <= before && values.iter().all(|v| (-0.5..=hi).contains(v)), "{values:?}");
                assert!(size < 6 || values.iter().all(|v| v.fract() == 0.0), "{size}: {values:?}");
                before = values.len();
            }
        }
        assert_eq!(all_round_values(3.0, 3.0, 6).count() + all_round_values(0.0, f64::INFINITY, 6).count(), 0);
    }

    #[test]
    fn the_roundest_values_come_first() {
        assert_eq!(roundest(0.0, 3000.0)[..6], [0.0, 1000.0, 100.0, 10.0, 1.0, 0.1]);
        assert_eq!(roundest(-60.0, -3.0)[..4], [-10.0, -50.0, -5.0, -20.0]);
        assert_eq!(roundest(310.0, 790.0), [500.0, 700.0, 400.0, 600.0]);
        assert_eq!(roundest(0.0, 0.0), [0.0]);
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
