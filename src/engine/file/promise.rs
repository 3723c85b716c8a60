//! What the metadata say: their settings, and the error bound: a share of a range of values, or an error in the samples' unit.

use wavesplat_core::base::sample::join_ranges;
use wavesplat_format::{Bound, Metadata};

/// The range stored with a bound in the samples' unit. Its length is 1, so that `tolerance` is the error itself.
pub(crate) const UNIT_RANGE: (f64, f64) = (0.0, 1.0);

/// The setting that marks a bound in the samples' unit, in contrast to a share of a given range.
pub(crate) const MAX_ERROR: &str = "max-error";

/// The value of one of a file's settings.
pub fn setting<'a>(file: &'a Metadata, name: &str) -> Option<&'a str> {
    file.settings.iter().find(|(n, _)| n == name).map(|(_, value)| value.as_str())
}

/// The error that a conversion was asked to keep, in the samples' unit; none if it was asked to keep a share.
pub fn max_error(file: &Metadata) -> Option<f64> {
    let stated: f64 = setting(file, MAX_ERROR)?.parse().ok()?;
    let of_range = matches!(file.bound, Bound::Pointwise | Bound::Rms);
    let is_so = of_range && stated == file.tolerance && file.windows.iter().all(|w| w.range == UNIT_RANGE);
    is_so.then_some(stated)
}

/// Range of the decoded samples of all windows; (0, 0) if all are missing.
pub(super) fn value_range(file: &Metadata) -> (f64, f64) {
    let ranges = file.windows.iter().map(|w| (w.min, w.max));
    let range = ranges.fold((f64::INFINITY, f64::NEG_INFINITY), join_ranges);
    if range.0 <= range.1 { range } else { (0.0, 0.0) }
}

/// The value range that shares refer to: the range of the tolerance, or, for a bound in the samples' unit, the range of
/// the decoded samples.
pub fn range_of_shares(file: &Metadata) -> (f64, f64) {
    if max_error(file).is_some() { value_range(file) } else { file.range() }
}

/// The tolerance as a share of [`range_of_shares`].
pub fn share_tolerance(file: &Metadata) -> f64 {
    let Some(error) = max_error(file).filter(|error| *error > 0.0) else { return file.tolerance };
    let (lo, hi) = value_range(file);
    if hi > lo { (error / (hi - lo)).min(1.0) } else { 1.0 }
}

/// The unit of the samples that the bound refers to, if it is known. Channels of colours have none.
pub(super) fn unit(file: &Metadata) -> Option<&str> {
    setting(file, "units").filter(|unit| file.channels == 1 && !unit.is_empty())
}
