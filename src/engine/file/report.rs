//! The error bound of a coefficient file and the errors that it reached, in numbers and words, for `convert` and `info`.

use super::promise::{max_error, range_of_shares, unit};
use serde::Serialize;
use wavesplat_core::codec::bound::Bound;
use wavesplat_core::codec::scheme::Scheme;
use wavesplat_format::{Metadata, Window};

/// The error bound that the tolerance gives.
#[derive(Debug, Clone, Serialize)]
pub struct BoundReport {
    /// The kind of bound.
    pub bound: &'static str,
    /// Whether the tolerance is guaranteed; false if the bound itself is an estimate.
    pub guaranteed: bool,
    /// As asked for; the same number as `max_error` if that was asked for.
    pub tolerance: f64,
    /// The largest error as asked for in the samples' unit, instead of a tolerance.
    pub max_error: Option<f64>,
    /// The samples' unit, if it is known.
    pub units: Option<String>,
    /// For a relative bound: smaller magnitudes have the same allowed error as this one.
    pub floor: Option<f64>,
    /// Of a sampled bound: pixels on each of three faces.
    pub samples: Option<u32>,
    /// Of a sampled bound: what chose the pixels.
    pub seed: Option<u64>,
    /// All of it in words.
    pub promise: String,
}

impl BoundReport {
    /// Of a file.
    pub fn from_metadata(file: &Metadata) -> Self {
        let Metadata { bound, tolerance, .. } = *file;
        let promise = if tolerance == 0.0 { "every bit is kept".into() } else { words(file) };
        let (floor, samples, seed) = match bound {
            Bound::Pointwise | Bound::Rms => (None, None, None),
            Bound::Relative { floor } => (Some(floor), None, None),
            Bound::Sampled { samples, seed } => (None, Some(samples), Some(seed)),
        };
        let guaranteed = tolerance == 0.0 || samples.is_none();
        let (max_error, units) = (max_error(file), unit(file).map(Into::into));
        Self { bound: bound.name(), guaranteed, tolerance, max_error, units, floor, samples, seed, promise }
    }
}

impl BoundReport {
    /// The caution to add to a line that says that the bound is kept; empty if the bound is guaranteed.
    pub fn caution(&self) -> &'static str {
        if self.guaranteed { "" } else { "; that bound is AN ESTIMATE from pixels, NOT A GUARANTEE for images" }
    }
}

/// The largest error, or root mean square, that any window allows.
pub fn largest_bound(file: &Metadata) -> f64 {
    file.windows.iter().map(|w| w.delta).fold(0.0, f64::max)
}

/// A promise in words, with the error in the samples' unit.
fn words(file: &Metadata) -> String {
    let (tolerance, (lo, hi)) = (file.tolerance, range_of_shares(file));
    let amount = |error: f64| unit(file).map_or(format!("{error:e}"), |unit| format!("{error:e} {unit}"));
    let largest = largest_bound(file);
    let is_limited = !file.windows.is_empty();
    let absolute = max_error(file).map(|error| amount(if is_limited { rounded(largest).min(error) } else { error }));
    let largest = amount(rounded(largest));
    let of_range = || {
        let share = || format!("{tolerance:e} x range ({lo:.4e} to {hi:.4e}), at most {largest}");
        absolute.clone().unwrap_or_else(share)
    };
    match file.bound {
        Bound::Rms | Bound::Sampled { .. } if file.keep().limits_samples() => {
            format!("the error of every sample <= {}", of_range())
        }
        Bound::Pointwise => format!("the error of every sample <= {}", of_range()),
        Bound::Rms => format!("the rms error of every voxel in every window <= {}", of_range()),
        Bound::Relative { floor: 0.0 } => {
            format!("the error of every sample v <= {tolerance:e} x |v|, at most {largest}")
        }
        Bound::Relative { floor } => {
            format!("the error of every sample v <= {tolerance:e} x max(|v|, {floor:e}), at most {largest}")
        }
        Bound::Sampled { samples, seed } => format!(
            "AN ESTIMATE, NOT A GUARANTEE, of what keeps pixels within {tolerance:e} of themselves: {samples} pixels on \
             each of three faces, seed {seed}; guaranteed is the rms error of every voxel in every window, <= that estimate, \
             at most {largest}"
        ),
    }
}

/// A bound rounded up to four digits, so that what is printed is never smaller.
fn rounded(bound: f64) -> f64 {
    if bound == 0.0 || !bound.is_finite() {
        return bound;
    }
    let near = |value: f64| format!("{value:.3e}").parse().unwrap_or(value);
    let shown: f64 = near(bound);
    if shown >= bound { shown } else { near(bound * (1.0 + 5e-4)) }
}

/// One window: its error bound, the errors that it reached, and its contents.
#[derive(Debug, Clone, Serialize)]
pub struct WindowReport {
    /// Its first frame.
    pub first_frame: u64,
    /// Its frames.
    pub frames: u32,
    /// The transform along time.
    pub basis: String,
    /// The whole scheme in words.
    pub scheme: String,
    /// Coefficients of one voxel.
    pub coefficients_per_voxel: u32,
    /// The largest error, or root mean square of a series, that the bound allows.
    pub promised: f64,
    /// The largest error of a sample.
    pub reached: f64,
    /// The largest share of its bound that any series used, in the bound's own measure.
    pub share: f64,
    /// The root mean square of the errors of all samples that are not missing.
    pub rms: f64,
    /// The smallest decoded sample.
    pub min: Option<f64>,
    /// The largest decoded sample.
    pub max: Option<f64>,
    /// Nonzero coefficients.
    pub coefficients: u64,
    /// Samples stored exactly because coefficients missed the bound.
    pub outliers: u64,
    /// Missing samples.
    pub missing: u64,
}

impl WindowReport {
    /// Of a window of a grid of `voxels`.
    pub fn new(w: &Window, voxels: u64) -> Self {
        let samples = (voxels * u64::from(w.frames)).saturating_sub(w.missing).max(1);
        Self {
            first_frame: w.first_frame,
            frames: w.frames,
            basis: w.basis.name().into(),
            scheme: Scheme::from_window(w).name(),
            coefficients_per_voxel: w.coefficients,
            promised: w.delta,
            reached: w.reached,
            share: w.share,
            rms: (w.squared_error / samples as f64).sqrt(),
            min: Some(w.min).filter(|v| v.is_finite()),
            max: Some(w.max).filter(|v| v.is_finite()),
            coefficients: w.coded,
            outliers: w.outliers,
            missing: w.missing,
        }
    }

    /// One line: the bound, and what was reached in the bound's own measure; and the errors of samples.
    pub fn line(&self, bound: Bound, tolerance: f64) -> String {
        let Self { first_frame, scheme, promised, reached, share, rms, .. } = self;
        let end = first_frame + u64::from(self.frames);
        let (measure, kind, promised) = match bound {
            Bound::Pointwise => ("error", "promised", *promised),
            Bound::Rms => ("rms of a series", "promised", *promised),
            Bound::Relative { .. } => ("relative error", "promised", tolerance),
            Bound::Sampled { .. } => ("rms of a series", "estimated", *promised),
        };
        format!(
            "frames {first_frame}..{end} {scheme}: {measure} {kind} {promised:.4e}, reached {:.4e}; largest sample error \
             {reached:.4e}, rms of all {rms:.4e}",
            share * promised
        )
    }
}
