//! The footprint: the projection of the attenuated Gaussian kernel, cut at a stated radius.
//!
//! A voxel of value 1 at depth z adds the weight w to a pixel (x, y) pixels away from it. That is
//! [Westover](crate::bibliography)'s splatting, with the attenuation of [Dobashi](crate::bibliography):
//!
//! ```text
//! f(x, y) = integral over z of h(x, y, z) exp(-tau z)                                                     (eq 2)
//!         = sx sy sz exp(tau^2 sigma^2 / 2) / (2 pi sigma^2) exp(-(x^2 + y^2) / (2 sigma^2))
//! w = exp(-tau z) f(x, y)                                                                                 (eq 3)
//! ```
//!
//! h is a Gaussian of standard deviation sigma, whose integral is the volume of a cell. Completing the square of -z^2 /
//! (2 sigma^2) - tau z gives the factor exp(tau^2 sigma^2 / 2). f is a product of one Gaussian along x and one along y,
//! so a footprint is a row of weights times a column of weights.
//!
//! The cut leaves out little. Take all voxels that lie more than R sigma to one side of a point. At the point R sigma
//! further to that side, each of them weighs at least exp(R^2 / 2) times as much, since (q + R)^2 >= q^2 + R^2 for q >=
//! 0. A square cut has four sides, so
//!
//! ```text
//! what lies beyond a cut at radius R sigma <= 4 exp(-R^2 / 2) * largest sum of w_i                        (eq 15)
//! ```

use crate::base::error::{Error, Note, Remedy, Result};
use crate::base::grid::Grid;
use crate::view::camera::ProjectionError;
use serde::{Deserialize, Serialize};
use std::ops::Range;

/// The settings of the kernel.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Kernel {
    /// Standard deviation in world units.
    pub sigma: f64,
    /// Attenuation per world unit of depth.
    pub tau: f64,
    /// Whether slices through the volume take a kernel that is narrower along axes with less than the largest spacing, so that thick
    /// layers do not blur what is within them.
    #[serde(default)]
    pub follows_axes: bool,
}

impl Kernel {
    /// The default kernel of a grid: sigma is 0.75 of the largest spacing, or in slices of that along each axis, without attenuation.
    pub fn for_grid(grid: &Grid) -> Self {
        Self { sigma: 0.75 * grid.largest_spacing(), tau: 0.0, follows_axes: true }
    }

    /// The standard deviation along an axis of a grid, in voxels, for slices.
    pub fn sigma_in_voxels(&self, grid: &Grid, axis: usize) -> f64 {
        self.sigma / if self.follows_axes { grid.largest_spacing() } else { grid.spacing[axis] }
    }

    /// A kernel with the default sigma unless one is given.
    ///
    /// # Errors
    /// A sigma that is not above 0, a tau below 0, or either not finite.
    pub fn new(sigma: Option<f64>, tau: f64, grid: &Grid) -> Result<Self> {
        let follows_axes = sigma.is_none();
        let sigma = sigma.unwrap_or(Self::for_grid(grid).sigma);
        if !(sigma.is_finite() && sigma > 0.0) {
            return Err(Error::setting("sigma", "takes a number above 0"));
        }
        if !(tau.is_finite() && tau >= 0.0) {
            return Err(Error::setting("tau", "takes a number of 0 or more"));
        }
        Ok(Self { sigma, tau, follows_axes })
    }
}

/// A splat method, with its error in an emission image, relative to the image of the largest |v|.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Method {
    /// The name in reports.
    pub name: &'static str,
    /// Radius of the cut kernel, in standard deviations.
    pub radius: f64,
    /// Error bound of a sum of weights, as a share of the largest sum anywhere in the picture plane. For footprints it
    /// is 4 exp(-R^2 / 2), the bound of the weights beyond the cut (eq 15).
    pub stated_error: f64,
}

/// The methods, from the cheapest to the exact one, which stands for an uncut kernel.
const METHODS: [Method; 6] = [
    Method { name: "footprint-3", radius: 3.0, stated_error: 4.45e-2 },
    Method { name: "footprint-3.5", radius: 3.5, stated_error: 8.75e-3 },
    Method { name: "footprint-4", radius: 4.0, stated_error: 1.35e-3 },
    Method { name: "footprint-4.5", radius: 4.5, stated_error: 1.61e-4 },
    Method { name: "footprint-5", radius: 5.0, stated_error: 1.50e-5 },
    Method::EXACT,
];

impl Method {
    /// The slow exact method: the reference for the others, and the method for a splat error of 0.
    pub const EXACT: Self = Self { name: "exact", radius: 6.0, stated_error: 6.10e-8 };

    /// The cheapest method within `error`; the exact one if none is.
    pub fn within(error: f64) -> Self {
        METHODS.into_iter().find(|m| m.stated_error <= error).unwrap_or(Self::EXACT)
    }
}

/// The footprint of a view, at any position and depth.
#[derive(Debug, Clone, Copy)]
pub struct Footprint {
    /// Pixels from the centre to the cut.
    pub reach: f64,
    /// f at the centre of the footprint.
    peak: f64,
    tau: f64,
    /// 1 / (2 sigma^2), in pixels.
    decay: f64,
    /// exp(-1 / sigma^2): the second quotient of Gaussians at neighbouring pixels.
    bend: f64,
}

impl Footprint {
    /// The footprint of a kernel seen at `scale` pixels per world unit, splatted by `method` (eq 2).
    pub fn new(kernel: Kernel, grid: &Grid, scale: f64, method: Method) -> Result<Self> {
        let Kernel { sigma, tau, .. } = kernel;
        let cell: f64 = grid.spacing.iter().product();
        let in_pixels = sigma * scale;
        let decay = 0.5 / (in_pixels * in_pixels);
        let peak = cell * libm::exp(tau * tau * sigma * sigma / 2.0) / (2.0 * std::f64::consts::PI * sigma * sigma);
        // At least one pixel: the footprint of a far smaller voxel must still reach the nearest pixel's centre.
        let reach = (method.radius * in_pixels).max(1.0);
        let usable = [reach, peak, decay].iter().all(|n| n.is_finite() && *n > 0.0) && peak < LARGEST_PEAK;
        if !usable {
            let what = format!("its weights are beyond numbers (sigma {sigma:e}, tau {tau:e}, scale {scale:e})");
            return Err(Error::setting("kernel", Note::with(what, Remedy::Adjust(&["sigma", "tau", "scale"]))));
        }
        Ok(Self { reach, peak, tau, decay, bend: libm::exp(-2.0 * decay) })
    }

    /// The weight exp(-tau z) f(0, 0) that a voxel at depth `z` has at its centre (eq 3).
    pub fn at_depth(&self, z: f64) -> f64 {
        self.peak * libm::exp(-self.tau * z)
    }

    /// Rows of voxels. From a voxel to the next one, positions change by `step` pixels and depths by `deeper`.
    pub fn rows(self, step: [f64; 2], deeper: f64) -> VoxelRows {
        VoxelRows { footprint: self, step, deeper, bend: libm::exp(-2.0 * self.decay * dot(step, step)) }
    }

    /// The weight [x, y] pixels from a voxel, as a share of the weight at its centre: exp(-(x^2 + y^2) / (2 sigma^2)).
    pub fn share(&self, [x, y]: [f64; 2]) -> f64 {
        libm::exp(-self.decay * (x * x + y * y))
    }

    /// The sum of a footprint over all pixels, as a multiple of the weight at its centre.
    pub fn area(&self) -> f64 {
        std::f64::consts::PI / self.decay
    }

    /// Bound of the relative rounding error of a weight, given the errors of its position. The depth is at most `depth`.
    pub fn rounding(&self, error: ProjectionError, depth: f64) -> f64 {
        let across = 2.0 * self.decay * (self.reach + 1.0) * error.pixels;
        let along = self.tau * (error.depth + 4.0 * f64::EPSILON * depth);
        libm::expm1(2.0 * across + along) + EXPONENTIALS
    }

    /// The pixels along one axis whose centres are within reach of `centre`; the axis has `pixels` pixels.
    pub fn span(&self, centre: f64, pixels: usize) -> Range<usize> {
        let first = (centre - self.reach - 0.5).ceil().max(0.0);
        let end = ((centre + self.reach - 0.5).floor() + 1.0).min(pixels as f64);
        if first < end { first as usize..end as usize } else { 0..0 }
    }

    /// The Gaussian factors of eq 2 at all pixels of `span`, as [`Self::span`] gave it for `centre`.
    ///
    /// Each factor is the previous one times a quotient, which itself changes by a constant factor. So a run takes two
    /// exponentials.
    pub fn weights(&self, centre: f64, span: &Range<usize>, out: &mut Vec<f64>) {
        out.clear();
        let run = if self.decay > STEEP { 1 } else { RUN };
        for first in span.clone().step_by(run) {
            let offset = first as f64 + 0.5 - centre;
            let mut weight = libm::exp(-self.decay * offset * offset);
            let mut quotient = libm::exp(-self.decay * (2.0 * offset + 1.0));
            for _ in first..span.end.min(first + run) {
                out.push(weight);
                weight *= quotient;
                quotient *= self.bend;
            }
        }
    }
}

/// Rows of voxels that are seen at the same angle.
#[derive(Debug, Clone, Copy)]
pub struct VoxelRows {
    footprint: Footprint,
    step: [f64; 2],
    deeper: f64,
    /// The second quotient of the weights of neighbouring voxels.
    bend: f64,
}

impl VoxelRows {
    /// The sum of weights at a point of `count` voxels in a row. The first voxel is `off` pixels from the point at depth
    /// `z`. The voxels should not lie much further than the reach.
    pub fn sum(&self, off: [f64; 2], z: f64, count: usize) -> f64 {
        let Self { footprint: Footprint { peak, tau, decay, .. }, step, deeper, bend } = *self;
        let exponent = |off: [f64; 2], z: f64| tau * z + decay * dot(off, off);
        if decay > NARROW || exponent(off, z) > DEEP {
            let at = |n: f64| libm::exp(-exponent([off[0] + n * step[0], off[1] + n * step[1]], z + n * deeper));
            return peak * (0..count).map(|n| at(n as f64)).sum::<f64>();
        }
        let mut weight = peak * libm::exp(-exponent(off, z));
        let mut quotient = libm::exp(-tau * deeper - decay * (2.0 * dot(off, step) + dot(step, step)));
        let mut sum = 0.0;
        for _ in 0..count {
            sum += weight;
            weight *= quotient;
            quotient *= bend;
        }
        sum
    }
}

fn dot(a: [f64; 2], b: [f64; 2]) -> f64 {
    a[0] * b[0] + a[1] * b[1]
}

/// Upper limit of the peak: sums of 1e20 products with the largest `f32` do not overflow.
const LARGEST_PEAK: f64 = 1e250;

/// Pixels per run of multiplied quotients; rounding grows with its square, to 3e-13.
const RUN: usize = 64;
/// Upper bound of the joint relative error of the exponentials of both axes and of the peak, and of the quotients of a
/// run.
const EXPONENTIALS: f64 = 2e-12;

/// Up to this decay, quotients of the weights of two voxels within reach neither overflow nor underflow.
const NARROW: f64 = 30.0;
/// Runs do not start from a weight below the exponential of minus this: later voxels may be nearer, and the weight has
/// too few digits.
const DEEP: f64 = 600.0;

/// Beyond this decay, a weight may underflow while its quotient overflows. A span is then at most two pixels, and each
/// weight is computed directly.
const STEEP: f64 = 100.0;

#[cfg(test)]
mod tests {
    use super::*;

    fn footprint(scale: f64) -> Footprint {
        Footprint::new(
            Kernel { sigma: 0.75, tau: 0.1, follows_axes: false },
            &Grid::unit([4, 4, 4]),
            scale,
            Method::EXACT,
        )
        .expect("sensible numbers")
    }

    #[test]
    fn weights_agree_with_the_exponential() {
        for scale in [0.05, 1.0, 7.3, 400.0] {
            let f = footprint(scale);
            let centre = 1234.56;
            let span = f.span(centre, 1 << 15);
            let mut weights = Vec::new();
            f.weights(centre, &span, &mut weights);
            for (pixel, w) in span.zip(&weights) {
                let d = pixel as f64 + 0.5 - centre;
                assert!((w - (-f.decay * d * d).exp()).abs() < 1e-11, "scale {scale} offset {d}");
            }
        }
    }

    #[test]
    fn rows_of_voxels_sum_up_to_their_weights() {
        for scale in [1e-3, 0.03, 0.1, 0.2, 1.0, 7.3] {
            let f = footprint(scale);
            for step in [0.01, 0.3, 1.0, 2.0, 13.0].map(|voxels| voxels * f.reach) {
                let (off, step) = ([-f.reach, 0.3 * f.reach], [step, -0.1 * step]);
                let count = (2.5 * f.reach / step[0]).ceil() as usize;
                let at = |n: usize| [0, 1].map(|i| off[i] + n as f64 * step[i]);
                // The last rows start at depths where weights are subnormal or zero, and come nearer.
                for (z, deeper) in [(3.0, 0.5), (3.0, -0.5), (7e3, -0.5), (7.45e3, -50.0)] {
                    let depth = |n: usize| z + deeper * n as f64;
                    let expected: f64 = (0..count).map(|n| f.at_depth(depth(n)) * f.share(at(n))).sum();
                    let found = f.rows(step, deeper).sum(off, z, count);
                    let off = (found - expected).abs();
                    assert!(off <= 1e-9 * expected + 1e-320, "{scale} {step:?} {z}: {found} for {expected}");
                }
            }
        }
    }

    #[test]
    fn weights_of_voxels_far_smaller_than_a_pixel_are_numbers() {
        for scale in [1e-6, 1e-3, 0.01, 0.03, 0.1] {
            let f = footprint(scale);
            for centre in [10.0, 10.01, 10.49, 10.5, 10.99] {
                let span = f.span(centre, 100);
                let mut weights = Vec::new();
                f.weights(centre, &span, &mut weights);
                for (pixel, w) in span.zip(&weights) {
                    let d = pixel as f64 + 0.5 - centre;
                    assert!((w - (-f.decay * d * d).exp()).abs() < 1e-11, "scale {scale} offset {d}: {w}");
                }
            }
        }
    }

    #[test]
    fn spans_stay_in_the_picture() {
        let f = footprint(2.0);
        assert_eq!(f.span(-1e9, 100), 0..0);
        assert_eq!(f.span(1e9, 100), 0..0);
        assert_eq!(f.span(50.0, 100), 41..59);
        assert_eq!(f.span(0.0, 4), 0..4);
    }

    #[test]
    fn the_kernel_has_the_volume_of_a_cell() {
        let f = footprint(20.0);
        let span = f.span(500.0, 1000);
        let mut weights = Vec::new();
        f.weights(500.0, &span, &mut weights);
        let line: f64 = weights.iter().sum();
        let integral = f.at_depth(0.0) * line * line / (20.0 * 20.0);
        let attenuation = (0.1f64 * 0.1 * 0.75 * 0.75 / 2.0).exp();
        assert!((integral - attenuation).abs() < 1e-7, "{integral}");
    }

    #[test]
    fn stated_errors_are_what_the_cut_leaves_out() {
        for m in METHODS {
            assert!(4.0 * (-m.radius * m.radius / 2.0).exp() <= m.stated_error, "{}", m.name);
        }
        assert_eq!(Method::within(0.0), Method::EXACT);
        assert_eq!(Method::within(2e-3).name, "footprint-4");
    }
}
