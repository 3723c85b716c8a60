//! The kernel of a view as a product of two factors, if a column of cells is upright in the picture.
//!
//! With c upright, the column u of cells lies at one x. So the Gaussian of eq 37 is a product of a factor along the
//! column and one across it:
//!
//! ```text
//! A(u, y) = sum over v of g_v(v_y(u) - v) T(u, v)        w(x, y) = sum over u of g_u(u_x - u) A(u, y)      (eq 38)
//! ```
//!
//! with u_x the position of column x of pixels, and v_y(u) the position at which row y of pixels crosses column u.

use super::axis::{AxisKernel, Cut};
use super::shear::Shear;

/// The kernel of a view as a product.
#[derive(Debug, Clone)]
pub(super) struct Product {
    pub(super) along: AxisKernel,
    pub(super) across: AxisKernel,
    /// u of the pixels at x = 0, and per pixel along x.
    pub(super) u: [f64; 2],
    /// v at which y = 0 crosses column 0 of cells, per pixel along y, and per column of cells.
    pub(super) v: [f64; 3],
}

impl Product {
    /// The kernel for a Gaussian with a standard deviation of `sigma` pixels; `None` if it is no product, or too large.
    pub(super) fn new(shear: &Shear, sigma: f64, cut: Cut) -> Option<Self> {
        let q = shear.fineness as f64;
        let [b, c] = shear.pixels.map(|step| step.map(|pixels| pixels / q));
        if c[0].abs() > UPRIGHT * c[1].abs() {
            return None;
        }
        let along = AxisKernel::new(sigma / b[0].abs(), cut)?;
        let across = AxisKernel::new(sigma / c[1].abs(), cut)?;
        let [x, y, _] = shear.origin;
        Some(Self { along, across, u: [-x / b[0], 1.0 / b[0]], v: [-y / c[1], 1.0 / c[1], -b[1] / c[1]] })
    }

    /// The largest share of the kernel's sum over all cells that its weights leave out or get wrong.
    pub(super) fn cut(&self) -> f64 {
        self.along.cut + self.across.cut
    }

    /// An upper bound of the distance from a pixel to any cell with a weight, along u and v.
    pub(super) fn half(&self) -> [f64; 2] {
        let [along, across] = [&self.along, &self.across].map(|axis| (axis.cells / 2) as f64);
        [along, across + along * self.v[2].abs()]
    }

    /// The largest distance in pixels, along x or y, from a pixel to any cell with a weight.
    pub(super) fn reach(&self, shear: &Shear) -> f64 {
        let pixels = |axis: &AxisKernel, step: f64| (axis.cells / 2) as f64 * (step / shear.fineness as f64).abs();
        pixels(&self.along, shear.pixels[0][0]).max(pixels(&self.across, shear.pixels[1][1]))
    }
}

/// A column of cells counts as upright if it leans by less than this share: far less than a pixel over any volume.
const UPRIGHT: f64 = 1e-9;
