//! From where pictures are taken, and which of their pixels are compared with the truth.

use serde::{Deserialize, Serialize};
use wavesplat::view::camera::View;

/// Standard deviation of the kernel in voxels; there is no attenuation.
pub(super) const SIGMA: f64 = 0.75;
/// Share of the picture that the volume's diagonal takes up.
const FIT: f64 = 0.9;
/// Pixels from one that is compared to the next. Odd, so that all places between voxels occur.
const STRIDE: usize = 5;
/// Frames that are compared.
const COMPARED: usize = 4;

/// A view of a volume of voxels one unit apart.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(super) struct CameraSettings {
    /// Degrees about z.
    pub(super) azimuth: f64,
    /// Degrees above the horizon.
    pub(super) elevation: f64,
    /// Pixels a side.
    pub(super) size: usize,
    /// Pixels per voxel.
    pub(super) scale: f64,
}

impl CameraSettings {
    /// The view whose pictures are compared with the truth. The volume fits into the picture from everywhere.
    pub(super) fn first(dims: [usize; 3], size: usize) -> Self {
        let diagonal = dims.map(|n| (n * n) as f64).iter().sum::<f64>().sqrt();
        Self { azimuth: 30.0, elevation: 30.0, size, scale: FIT * size as f64 / diagonal }
    }

    /// A further view.
    pub(super) fn further(&self) -> Self {
        Self { azimuth: 75.0, elevation: 20.0, ..*self }
    }

    /// As the library has it.
    pub(super) fn view(&self) -> View {
        let Self { azimuth, elevation, size, scale } = *self;
        View { azimuth, elevation, roll: 0.0, size: [size; 2], scale: Some(scale), center: None }
    }

    /// The pixels that are compared: column and row.
    pub(super) fn compared_pixels(&self) -> Vec<[usize; 2]> {
        let places = || (0..self.size).step_by(STRIDE);
        places().flat_map(|y| places().map(move |x| [x, y])).collect()
    }
}

/// The frames that are compared, out of the first `frames`.
pub(super) fn compared_frames(frames: usize) -> Vec<usize> {
    (0..COMPARED).map(|i| (2 * i + 1) * frames / (2 * COMPARED)).collect()
}
