//! The Gaussian footprint of a view, in cells.
//!
//! Filtered cells ([`super::prefilter`]) hold each voxel as a narrow bump with the mass 1. So a pixel is the sum of the
//! cells around it times the Gaussian itself:
//!
//! ```text
//! w(p) = sum over cells c of G(p - c) T(c)        G(d) = exp(-(uu du^2 + 2 uv du dv + vv dv^2) / 2)        (eq 37)
//! ```
//!
//! with T the filtered weights of a voxel, and uu, uv, vv the inverse of the footprint's covariance in cells.

use super::shear::Shear;

/// The kernel of a view.
#[derive(Debug, Clone, Copy)]
pub(super) struct Kernel {
    /// The inverse of its covariance in cells: uu, uv, vv.
    inverse: [f64; 3],
}

impl Kernel {
    /// The kernel for a Gaussian with a standard deviation of `sigma` pixels.
    pub(super) fn new(shear: &Shear, sigma: f64) -> Self {
        let q = shear.fineness as f64;
        let [b, c] = shear.pixels.map(|step| step.map(|pixels| pixels / (q * sigma)));
        Self { inverse: [b[0] * b[0] + b[1] * b[1], b[0] * c[0] + b[1] * c[1], c[0] * c[0] + c[1] * c[1]] }
    }

    /// The standard deviations along u and along v, in cells.
    pub(super) fn sigmas(&self) -> [f64; 2] {
        let [uu, uv, vv] = self.inverse;
        let det = uu * vv - uv * uv;
        [vv / det, uu / det].map(f64::sqrt)
    }

    /// The standard deviations along u at a fixed v, and along v at a fixed u, in cells.
    pub(super) fn conditional_sigmas(&self) -> [f64; 2] {
        let [uu, _, vv] = self.inverse;
        [uu, vv].map(|i| 1.0 / i.sqrt())
    }

    /// G at an offset (eq 37).
    #[cfg(test)]
    pub(super) fn gaussian(&self, [u, v]: [f64; 2]) -> f64 {
        let [uu, uv, vv] = self.inverse;
        libm::exp(-0.5 * ((uu * u + 2.0 * uv * v) * u + vv * v * v))
    }
}
