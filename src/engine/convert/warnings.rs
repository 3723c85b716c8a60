//! Warnings about a conversion that succeeded, with remedies.

use super::variation::Variation;
use super::{ConvertConfig, ConvertReport};
use wavesplat_core::base::error::{Note, Remedy};
use wavesplat_core::base::sample::SampleType;
use wavesplat_core::codec::bound::Bound;
use wavesplat_core::source::extremes::{Extreme, HUGE, Habit, habit, written};
use wavesplat_format::Basis;

/// The reader's findings in the samples.
#[derive(Debug, Clone, Default)]
pub(super) struct Findings {
    /// A value that may mean "missing", if one was seen.
    pub(super) fill: Option<Note>,
    pub(super) variation: Variation,
    /// The range of the source's samples.
    pub(super) range: Option<(f64, f64)>,
}

/// A value that is surely none is far if its distance from the other samples is more than this many times their range.
const NEAR: f64 = 3.0;
/// An extreme dominates the range beyond this distance.
const FAR: f64 = 10.0;
/// Beyond this distance, no sample of a usual field is.
const FARTHEST: f64 = 1000.0;

/// One sample in this many is a noticeable share.
const MANY: u64 = 100;

/// An error above this share of the range of the others is too large for them, beside a value that is surely none.
const SMALL_SHARE: f64 = 0.05;
/// As above, beside a value that may be a sample.
const LARGE_SHARE: f64 = 0.1;

/// The possible meaning of an extreme of the samples.
pub(super) enum Fill {
    /// It may mean "missing".
    Warn(Note),
    /// It would make the bound too large for the other samples.
    Refuse(Note),
}

/// The note on an extreme of `samples` samples, if it may mean "missing". If the bound refers to a range that contains
/// the extreme, `allowed` is the resulting error allowed to the other samples.
pub(super) fn fill(extreme: &Extreme, samples: u64, ty: SampleType, allowed: Option<f64>) -> Option<Fill> {
    let Extreme { value, count, others: (lo, hi) } = *extreme;
    let (far, habit) = (extreme.distance(), habit(ty, value));
    let (least, share) = limits(habit);
    let is_many = habit == Habit::Sure || count.saturating_mul(MANY) >= samples;
    if value == 0.0 || count < 2 || !is_many || far <= least {
        return None;
    }
    let is_suspect = habit == Habit::Sure || habit == Habit::Common && (value.abs() < HUGE || far > FARTHEST);
    let value = written(ty, value);
    let seen = format!("{count} samples are exactly {value}, and the others are from {lo:.4e} to {hi:.4e}");
    Some(match allowed.filter(|error| is_suspect && *error > share * (hi - lo)) {
        Some(error) => {
            let what = format!("{seen}; an error of {error:.3e} would leave little of them");
            Fill::Refuse(Note::with(what, Remedy::DeclareMissingOrError(value)))
        }
        None => Fill::Warn(Note::with(seen, Remedy::DeclareMissing(value))),
    })
}

/// The distance beyond which a value may mean "missing", and the largest error, as shares of the range of the others.
fn limits(habit: Habit) -> (f64, f64) {
    match habit {
        Habit::Sure => (NEAR, SMALL_SHARE),
        Habit::Common => (FAR, LARGE_SHARE),
        Habit::None => (FARTHEST, LARGE_SHARE),
    }
}

/// All that is worth a warning.
pub(super) fn warnings(config: &ConvertConfig, report: &ConvertReport, found: &Findings) -> Vec<Note> {
    let small = small_changes(config, report, found.variation.median());
    let of_file = short_windows(config, report).or_else(|| larger_than_samples(config, report));
    let negative = negative_samples(config, report, found.range);
    found.fill.clone().into_iter().chain(small).chain(negative).chain(of_file).collect()
}

/// Samples that are not negative are negative once decoded.
fn negative_samples(config: &ConvertConfig, report: &ConvertReport, range: Option<(f64, f64)>) -> Option<Note> {
    let least = report.per_window.iter().filter_map(|window| window.min).fold(f64::INFINITY, f64::min);
    let is_kept = config.keep.range || config.keep.sides.contains(&0.0);
    let is_surprise = !is_kept && config.colours.is_none() && range?.0 >= 0.0 && least < 0.0;
    let text = || format!("no sample is negative, but some decoded samples are as low as {}", amount_below(least));
    is_surprise.then(|| Note::with(text(), Remedy::KeepRange))
}

/// As [`amount`], of a number below 0.
fn amount_below(value: f64) -> String {
    format!("-{}", amount(-value))
}

/// The error allowed is larger than what most voxels change by.
fn small_changes(config: &ConvertConfig, report: &ConvertReport, median: Option<f64>) -> Option<Note> {
    let of_range = matches!(config.bound, Bound::Pointwise | Bound::Rms) && config.colours.is_none();
    let (median, error) = (median.filter(|_| of_range)?, report.delta);
    if error <= median {
        return None;
    }
    if config.keep.limits_samples() {
        return None; // the error is not the tolerance's
    }
    let share = config.tolerance / error * (median / 10.0);
    let is_share = config.max_error.is_none() && share >= LEAST_SHARE;
    let (field, value) = if is_share { ("tolerance", share) } else { ("max_error", median / 10.0) };
    let what = format!(
        "error <= {}; half of the voxels that change vary by less than {} over time",
        amount(error),
        amount(median)
    );
    Some(Note::with(what, Remedy::Try(field, round_down(value))))
}

/// Smaller shares of a range are hard to read; an error in the samples' unit says the same.
const LEAST_SHARE: f64 = 1e-6;

/// A number with four digits.
fn amount(value: f64) -> String {
    let short: f64 = format!("{value:.3e}").parse().unwrap_or(value);
    if (1e-3..1e6).contains(&value) { format!("{short}") } else { format!("{short:e}") }
}

/// The largest of 1, 2 and 5 times a power of ten that is not above `value`, which is above 0.
fn round_down(value: f64) -> String {
    let exponent = libm::log10(value).floor() as i32;
    let mut candidates = (exponent - 1..=exponent + 1).flat_map(|e| [1, 2, 5].map(|digit| format!("{digit}e{e}")));
    let number = |text: &String| text.parse::<f64>().unwrap_or(0.0);
    let found = candidates.rfind(|text| number(text) <= value).map_or(0.0, |text| number(&text));
    format!("{found:?}")
}

/// The file is larger than its source.
fn larger_than_samples(config: &ConvertConfig, report: &ConvertReport) -> Option<Note> {
    if report.output_bytes <= report.input_bytes {
        return None;
    }
    let what = "the file is larger than the samples";
    Some(if report.input_bytes < SMALL {
        format!("{what}: so few of them are less than what describes them").into()
    } else if report.delta == 0.0 {
        Note::with(format!("{what}: every bit is kept, and they repeat little"), Remedy::Allow(bound_field(config)))
    } else {
        Note::with(format!("{what}: at this error they are noise"), Remedy::Allow(bound_field(config)))
    })
}

/// Windows of so few samples that what describes a window takes much of its bytes.
fn short_windows(config: &ConvertConfig, report: &ConvertReport) -> Option<Note> {
    let frame = report.samples / report.frames.max(1);
    let suits = |window: &u64| 2 * window <= report.frames && window * frame <= MOST_SAMPLES;
    let longer = [32, 64, 128, 256, 512].into_iter().rfind(suits).filter(|window| *window > config.window as u64)?;
    let each = report.output_bytes / report.windows as u64;
    if each > FEW_BYTES || report.windows < 4 || config.coding.basis == Some(Basis::Multi) {
        return None;
    }
    let larger = if report.output_bytes > report.input_bytes { "the file is larger than the samples: " } else { "" };
    let what = format!(
        "{larger}a window of {} frames takes {each} bytes, much of it to describe the window; longer ones share that",
        config.window
    );
    Some(Note::with(what, Remedy::Try("window", longer.to_string())))
}

/// Bytes of a window that its description takes a notable part of.
const FEW_BYTES: u64 = 4096;
/// Samples of a longer window: choosing its scheme takes more time.
const MOST_SAMPLES: u64 = 1 << 19;

/// The field that says how large errors may be.
fn bound_field(config: &ConvertConfig) -> &'static str {
    if config.max_error.is_some() { "max_error" } else { "tolerance" }
}

/// Bytes of samples that the descriptions in a file may exceed.
const SMALL: u64 = 64 << 10;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tolerances_are_rounded_down() {
        let cases = [(0.0123, "0.01"), (0.02, "0.02"), (0.99, "0.5"), (1.0, "1.0"), (7e-9, "5e-9"), (4.9, "2.0")];
        cases.into_iter().for_each(|(value, expected)| assert_eq!(round_down(value), expected, "{value}"));
    }

    #[test]
    fn only_repeated_far_extremes_are_taken_for_missing() {
        let said_at = |tolerance: f64, value: f64, count, others: (f64, f64), ty| {
            let allowed = tolerance * (value.max(others.1) - value.min(others.0));
            match fill(&Extreme { value, count, others }, 100_000, ty, Some(allowed)) {
                Some(Fill::Refuse(_)) => "refused",
                Some(Fill::Warn(_)) => "warned",
                None => "nothing",
            }
        };
        let said = |value, count, others, ty| said_at(0.01, value, count, others, ty);
        let (f32, u8, u16) = (SampleType::F32, SampleType::U8, SampleType::U16);
        assert_eq!(said(1e20, 30_000, (0.0, 35.0), f32), "refused");
        assert_eq!(said(-9999.0, 30_000, (0.0, 1.0), f32), "refused");
        assert_eq!(said(-9999.0, 30_000, (0.0, 100.0), f32), "refused");
        assert_eq!(said_at(1e-4, -9999.0, 30_000, (0.0, 100.0), f32), "warned");
        for value in [-9999.0, -999.0, 9999.0, -999.25, 1e20, -32768.0, 32767.0, 65535.0] {
            assert_eq!(said(value, 30_000, (250.0, 310.0), f32), "refused", "{value} among temperatures");
        }
        assert_eq!(said(-9999.0, 5, (250.0, 310.0), f32), "refused"); // few, and hardly samples
        assert_eq!(said(65535.0, 5, (90.0, 400.0), u16), "nothing"); // hot pixels
        assert_eq!(said(65535.0, 30_000, (0.0, 9000.0), u16), "nothing"); // saturated
        assert_eq!(said(2.5e19, 30_000, (0.0, 2e18), f32), "warned"); // a dense ball
        assert_eq!(said(3.2e19, 2, (0.0, 1e3), f32), "nothing"); // two sources
        assert_eq!(said(-9999.0, 30_000, (-9000.0, 100.0), f32), "nothing");
        assert_eq!(said(1e20, 1, (0.0, 35.0), f32), "nothing"); // a spike
        assert_eq!(said(0.0, 90_000, (300.0, 310.0), f32), "nothing"); // a background
        assert_eq!(said(1000.0, 30_000, (300.0, 310.0), f32), "nothing"); // a hot body
        assert_eq!(said(255.0, 30_000, (0.0, 12.0), u8), "nothing"); // saturated
    }
}
