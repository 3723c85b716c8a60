//! What is recorded.

use super::reference::ImageError;
use super::settings::Settings;
use serde::{Deserialize, Serialize};

/// All results of a run.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Results {
    /// What all points share.
    pub settings: Settings,
    /// The day they were written.
    pub date: String,
    /// Everything measured, in the order of the plan.
    pub points: Vec<Point>,
}

/// One contender at one setting.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Point {
    /// Its name: that of its group, method, bound.
    pub key: String,
    /// The name of those it was measured in turns with.
    pub group: String,
    /// Which sweep: `tolerance` or `splat`.
    pub sweep: String,
    /// What the archive shows.
    pub kind: String,
    /// The tolerance of the group; the conventional method itself has none.
    pub tolerance: f64,
    /// `haar` or `multi` for coefficients; `shared` or `textbook` for the conventional method.
    pub method: String,
    /// What coefficients promise.
    pub bound: Option<String>,
    /// Frames converted and rendered.
    pub frames: usize,
    /// Of coefficients.
    pub conversion: Option<Conversion>,
    /// The pictures.
    pub rendering: Rendering,
}

/// Frames to a file.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Conversion {
    /// From opening the frames to the last byte written.
    pub seconds: Spread,
    /// Million bytes of samples a second, by the median time.
    pub megabytes_per_second: f64,
    /// Bytes of the file.
    pub file_bytes: u64,
    /// Bytes of samples by bytes of the file.
    pub ratio: f64,
    /// Bytes of the file for each sample.
    pub bytes_per_sample: f64,
    /// Nonzero coefficients for each sample.
    pub coefficients_per_sample: f64,
    /// Nonzero coefficients for each voxel, over all frames.
    pub coefficients_per_voxel: f64,
    /// Samples stored exactly because coefficients missed the bound.
    pub outliers: u64,
    /// The voxel bound as a share of the value range.
    pub promised: f64,
    /// The largest error of any sample as a share of the value range.
    pub largest_voxel_error: f64,
    /// The root of the mean squared error as a share of the value range.
    pub rms_voxel_error: f64,
    /// The largest error in what the bound is about, in units of the bound.
    pub share_of_bound: f64,
    /// Series outside the bound.
    pub series_outside: u64,
    /// Peak memory of the process, with pages of mapped files.
    pub peak_bytes: Option<u64>,
}

/// Two views of all frames.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Rendering {
    /// From opening the input to the last picture: seconds for all frames.
    pub first_view: Spread,
    /// Another view: seconds for all frames.
    pub further_view: Spread,
    /// Milliseconds for each frame of a further view, by the median.
    pub milliseconds_per_frame: f64,
    /// The splat method.
    pub splat: String,
    /// What splatting may add, as a share of the value range; unknown for the textbook form.
    pub stated_splat_error: Option<f64>,
    /// What no pixel's error may exceed by promise, as a share of the value range, where there is a promise.
    pub promised: Option<f64>,
    /// Against brute force, as shares of the value range.
    pub image_error: ImageError,
    /// The largest error that the renderer certifies for any compared pixel, as a share of the value range.
    pub certified_error: Option<f64>,
    /// That in units of the largest true error of the same pictures.
    pub certificate_tightness: Option<f64>,
    /// Compared pixels that are further off than certified.
    pub beyond_certificate: usize,
    /// Peak memory of the process, with pages of mapped files.
    pub peak_bytes: Option<u64>,
}

/// Repeated measurements.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Spread {
    /// The smallest.
    pub min: f64,
    /// The middle one, or the mean of the two in the middle.
    pub median: f64,
    /// All, in the order taken.
    pub all: Vec<f64>,
}

impl Spread {
    /// Of any measurements; not a number of none.
    pub fn of(all: Vec<f64>) -> Self {
        let mut sorted = all.clone();
        sorted.sort_by(f64::total_cmp);
        let at = |i: usize| sorted.get(i).copied().unwrap_or(f64::NAN);
        let median = f64::midpoint(at(sorted.len().saturating_sub(1) / 2), at(sorted.len() / 2));
        Self { min: at(0), median, all }
    }
}

#[cfg(test)]
impl Point {
    /// A conventional rendering.
    pub(super) fn example(key: &str) -> Self {
        let rendering = Rendering {
            first_view: Spread::of(vec![0.25]),
            further_view: Spread::of(vec![0.125]),
            milliseconds_per_frame: 4.0,
            splat: "exact".into(),
            stated_splat_error: None,
            promised: None,
            image_error: ImageError { largest: 0.5, rms: 0.25 },
            certified_error: None,
            certificate_tightness: None,
            beyond_certificate: 0,
            peak_bytes: Some(1),
        };
        let (group, sweep) = ("tolerance/smooth/1e-1".into(), "tolerance".into());
        let (kind, method) = ("smooth".into(), "shared".into());
        let (tolerance, bound, frames, conversion) = (0.1, None, 32, None);
        Self { key: key.into(), group, sweep, kind, tolerance, method, bound, frames, conversion, rendering }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn spreads_have_a_middle() {
        let spread = |all: &[f64]| Spread::of(all.to_vec());
        assert_eq!((spread(&[3.0, 1.0, 8.0]).min, spread(&[3.0, 1.0, 8.0]).median), (1.0, 3.0));
        assert_eq!(spread(&[4.0, 1.0, 8.0, 2.0]).median, 3.0);
        assert_eq!(spread(&[5.0]).median, 5.0);
    }
}
