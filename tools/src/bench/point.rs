//! The recorded measurements.

use super::reference::ImageError;
use super::settings::Settings;
use serde::{Deserialize, Serialize};

/// All results of a run.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Results {
    /// The settings that all points share.
    pub settings: Settings,
    /// The date of the run.
    pub date: String,
    /// All points, in the order of the plan.
    pub points: Vec<Point>,
}

/// One contender at one setting.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Point {
    /// The name: group, method, bound.
    pub key: String,
    /// The name of the group. The points of a group were measured in turns.
    pub group: String,
    /// The sweep: `tolerance` or `splat`.
    pub sweep: String,
    /// The kind of archive.
    pub kind: String,
    /// The tolerance of the group. The conventional method does not use it.
    pub tolerance: f64,
    /// `haar` or `multi` for coefficients; `shared` or `textbook` for the conventional method.
    pub method: String,
    /// The name of the bound; none for the conventional method.
    pub bound: Option<String>,
    /// Number of frames converted and rendered.
    pub frames: usize,
    /// The conversion; none for the conventional method.
    pub conversion: Option<Conversion>,
    /// The rendering of two views.
    pub rendering: Rendering,
}

/// The measurements of a conversion.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Conversion {
    /// From opening the frames to the last byte written.
    pub seconds: Spread,
    /// Megabytes of samples per second, from the median time.
    pub megabytes_per_second: f64,
    /// Bytes of the file.
    pub file_bytes: u64,
    /// Bytes of the samples divided by bytes of the file.
    pub ratio: f64,
    /// Bytes of the file per sample.
    pub bytes_per_sample: f64,
    /// Nonzero coefficients per sample.
    pub coefficients_per_sample: f64,
    /// Nonzero coefficients per voxel, over all frames.
    pub coefficients_per_voxel: f64,
    /// Samples stored exactly because coefficients missed the bound.
    pub outliers: u64,
    /// The voxel bound as a share of the value range; `promised` in JSON.
    #[serde(rename = "promised")]
    pub voxel_bound: f64,
    /// The largest error of any sample as a share of the value range.
    pub largest_voxel_error: f64,
    /// The root mean square error as a share of the value range.
    pub rms_voxel_error: f64,
    /// The largest error in the bound's own measure, as a share of the bound.
    pub share_of_bound: f64,
    /// Number of series that exceed the bound.
    pub series_outside: u64,
    /// Peak memory of the process, with pages of mapped files.
    pub peak_bytes: Option<u64>,
}

/// The measurements of two views of all frames.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Rendering {
    /// Seconds for all frames of the first view, from opening the input to the last picture.
    pub first_view: Spread,
    /// Seconds for all frames of another view.
    pub further_view: Spread,
    /// Milliseconds per frame of the further view, from the median.
    pub milliseconds_per_frame: f64,
    /// The splat method.
    pub splat: String,
    /// The splat error that the renderer states, as a share of the value range; unknown for the textbook form.
    pub stated_splat_error: Option<f64>,
    /// The bound of every pixel's error, as a share of the value range, if there is one; `promised` in JSON.
    #[serde(rename = "promised")]
    pub pixel_bound: Option<f64>,
    /// The errors compared with brute force, as shares of the value range.
    pub image_error: ImageError,
    /// The largest certified error of any compared pixel, as a share of the value range.
    pub certified_error: Option<f64>,
    /// The largest certified error divided by the largest true error of the same pictures.
    pub certificate_tightness: Option<f64>,
    /// Number of compared pixels whose error exceeds their certificate.
    pub beyond_certificate: usize,
    /// Peak memory of the process, with pages of mapped files.
    pub peak_bytes: Option<u64>,
}

/// Repeated measurements.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Spread {
    /// The smallest.
    pub min: f64,
    /// The median.
    pub median: f64,
    /// All, in the order in which they were taken.
    pub all: Vec<f64>,
}

impl Spread {
    /// The spread of these measurements; NaN if there are none.
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
            pixel_bound: None,
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
    fn spreads_have_a_median() {
        let spread = |all: &[f64]| Spread::of(all.to_vec());
        assert_eq!((spread(&[3.0, 1.0, 8.0]).min, spread(&[3.0, 1.0, 8.0]).median), (1.0, 3.0));
        assert_eq!(spread(&[4.0, 1.0, 8.0, 2.0]).median, 3.0);
        assert_eq!(spread(&[5.0]).median, 5.0);
    }
}
