//! What a coefficient file promises and what it reached, in numbers and words, for `convert` and `info`.

use crate::codec::bound::Bound;
use crate::codec::scheme::Scheme;
use serde::Serialize;
use wavesplat_format::Window;

/// What the tolerance promises.
#[derive(Debug, Clone, Serialize)]
pub struct BoundReport {
    /// The kind of bound.
    pub bound: &'static str,
    /// Whether the tolerance is guaranteed; false where the bound that is kept is itself an estimate.
    pub guaranteed: bool,
    /// As asked for.
    pub tolerance: f64,
    /// Of a relative bound: below this magnitude samples may be as wrong as at it.
    pub floor: Option<f64>,
    /// Of a sampled bound: pixels on each of three faces.
    pub samples: Option<u32>,
    /// Of a sampled bound: what chose the pixels.
    pub seed: Option<u64>,
    /// All of it in words.
    pub promise: String,
}

impl BoundReport {
    /// Of a tolerance that refers, where it does to one, to the value range `range`.
    pub fn new(bound: Bound, tolerance: f64, range: (f64, f64)) -> Self {
        let promise = if tolerance == 0.0 { "every bit is kept".into() } else { words(bound, tolerance, range) };
        let (floor, samples, seed) = match bound {
            Bound::Pointwise | Bound::Rms => (None, None, None),
            Bound::Relative { floor } => (Some(floor), None, None),
            Bound::Sampled { samples, seed } => (None, Some(samples), Some(seed)),
        };
        let guaranteed = tolerance == 0.0 || samples.is_none();
        Self { bound: bound.name(), guaranteed, tolerance, floor, samples, seed, promise }
    }
}

impl BoundReport {
    /// What a line that says that the bound is kept must add.
    pub fn caution(&self) -> &'static str {
        if self.guaranteed { "" } else { "; that bound is AN ESTIMATE from pixels, NOT A GUARANTEE for images" }
    }
}

fn words(bound: Bound, tolerance: f64, (lo, hi): (f64, f64)) -> String {
    match bound {
        Bound::Pointwise => format!("the error of every sample <= {tolerance:e} x range ({lo:.4e} to {hi:.4e})"),
        Bound::Rms => {
            format!("the rms error of every voxel in every window <= {tolerance:e} x range ({lo:.4e} to {hi:.4e})")
        }
        Bound::Relative { floor: 0.0 } => format!("the error of every sample v <= {tolerance:e} x |v|"),
        Bound::Relative { floor } => format!("the error of every sample v <= {tolerance:e} x max(|v|, {floor:e})"),
        Bound::Sampled { samples, seed } => format!(
            "AN ESTIMATE, NOT A GUARANTEE, of what keeps pixels within {tolerance:e} of themselves: {samples} pixels on \
             each of three faces, seed {seed}; guaranteed is the rms error of every voxel in every window, <= that estimate"
        ),
    }
}

/// What one window promised and reached, and what it holds.
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
            scheme: Scheme::of_window(w).name(),
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

    /// One line: what was promised and reached in the bound's own measure, and the errors of samples.
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
