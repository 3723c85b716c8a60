//! Colour and opacity along the ray, by brute force: slab by slab (eq 29-31), and the integral of
//! [Max](wavesplat::bibliography) that this tends to as slabs become thinner.
//!
//! ```text
//! C = sum over slabs of  T (1 - exp(-kappa(g) l)) c(g)        T = product over the slabs before of  exp(-kappa(g) l)
//! ```
//!
//! with l the length and g the mean of a slab at a pixel; kappa(v) = -ln(1 - opacity(v)) / unit.

use super::camera::{Lattice, View, project};
use std::f64::consts::PI;

/// The transfer function of a test: red, green, blue and kappa of a value.
pub(crate) type Medium<'a> = &'a dyn Fn(f64) -> [f64; 4];

/// A voxel that is not missing: its x and y in world units from the pixel, depth and value.
struct Voxel {
    squared: f64,
    z: f64,
    value: f64,
}

/// Slabs of a view.
pub(crate) struct Cut {
    /// For each slab, the voxels' shares.
    shares: Vec<Vec<f64>>,
    least: f64,
}

/// A volume as a view sees it.
pub(crate) struct Rays<'a> {
    pub(crate) lattice: &'a Lattice,
    pub(crate) view: &'a View,
    /// NaN is missing.
    pub(crate) values: &'a [f64],
}

impl Rays<'_> {
    fn voxels(&self, pixel: [usize; 2]) -> Vec<Voxel> {
        let mut voxels = Vec::new();
        for (position, value) in self.lattice.positions().into_iter().zip(self.values) {
            let [x, y, z] = project(self.lattice, self.view, position);
            let off = [x - pixel[0] as f64 - 0.5, y - pixel[1] as f64 - 0.5].map(|d| d / self.view.scale);
            if !value.is_nan() {
                voxels.push(Voxel { squared: off[0] * off[0] + off[1] * off[1], z, value: *value });
            }
        }
        voxels
    }

    /// The weight of a voxel in a projection.
    fn across(&self, voxel: &Voxel) -> f64 {
        let [variance, cell] = [self.view.sigma * self.view.sigma, self.lattice.spacing.iter().product()];
        cell / (2.0 * PI * variance) * (-voxel.squared / (2.0 * variance)).exp()
    }

    /// The range of depths that is cut into slabs: from three deviations in front of the first voxels to three behind
    /// the last.
    pub(crate) fn depths(&self) -> [f64; 2] {
        let depths = || self.lattice.corners().into_iter().map(|corner| project(self.lattice, self.view, corner)[2]);
        let ends = [depths().fold(f64::INFINITY, f64::min), depths().fold(f64::NEG_INFINITY, f64::max)];
        [ends[0] - 3.0 * self.view.sigma, ends[1] + 3.0 * self.view.sigma]
    }

    /// The part of every voxel's kernel in each slab, front to back. The first and the last slab are unbounded.
    pub(crate) fn cut(&self, count: usize) -> Cut {
        let [from, to] = self.depths();
        let mut shares = Vec::new();
        for n in 0..count {
            let end = |n: usize| from + (to - from) * n as f64 / count as f64;
            let near = if n == 0 { -1e9 } else { end(n) };
            let far = if n + 1 == count { 1e9 } else { end(n + 1) };
            let depths = self.voxels([0, 0]).into_iter().map(|voxel| voxel.z);
            shares.push(depths.map(|z| between(near - z, far - z, self.view.sigma)).collect());
        }
        Cut { shares, least: 0.01 * (to - from) / count as f64 }
    }

    /// Length and mean of the slabs at a pixel. Slabs of almost no thickness are ignored.
    pub(crate) fn slabs(&self, pixel: [usize; 2], cut: &Cut) -> Vec<(f64, f64)> {
        let voxels = self.voxels(pixel);
        let mut slabs = Vec::new();
        for shares in &cut.shares {
            let (mut length, mut sum) = (0.0, 0.0);
            for (voxel, share) in voxels.iter().zip(shares) {
                let weight = self.across(voxel) * share;
                length += weight;
                sum += weight * voxel.value;
            }
            if length > cut.least {
                slabs.push((length, sum / length));
            }
        }
        slabs
    }

    /// Light and opacity of a pixel by slabs.
    pub(crate) fn composite(&self, pixel: [usize; 2], cut: &Cut, medium: Medium<'_>) -> [f64; 4] {
        blend(self.slabs(pixel, cut).into_iter(), medium)
    }

    /// The integral along the ray in `steps` steps, where the sum of the kernels is not zero.
    pub(crate) fn integral(&self, pixel: [usize; 2], steps: usize, medium: Medium<'_>) -> [f64; 4] {
        let ([from, to], voxels) = (self.depths(), self.voxels(pixel));
        let (width, sigma) = ((to - from) / steps as f64, self.view.sigma);
        let step = |n: usize| {
            let (mut density, mut sum) = (0.0, 0.0);
            for voxel in &voxels {
                let off = (from + (n as f64 + 0.5) * width - voxel.z) / sigma;
                let along = (-0.5 * off * off).exp() / ((2.0 * PI).sqrt() * sigma);
                density += self.across(voxel) * along;
                sum += self.across(voxel) * along * voxel.value;
            }
            (density * width, sum / density)
        };
        blend((0..steps).map(step).filter(|(length, _)| *length > 0.01 * width), medium)
    }
}

fn blend(slabs: impl Iterator<Item = (f64, f64)>, medium: Medium<'_>) -> [f64; 4] {
    let (mut light, mut through) = ([0.0; 3], 1.0);
    for (length, mean) in slabs {
        let [r, g, b, kappa] = medium(mean);
        let passed = (-kappa * length).exp();
        for (light, colour) in light.iter_mut().zip([r, g, b]) {
            *light += through * (1.0 - passed) * colour;
        }
        through *= passed;
    }
    [light[0], light[1], light[2], 1.0 - through]
}

/// The integral of a normalised Gaussian, by Simpson's rule.
fn between(from: f64, to: f64, sigma: f64) -> f64 {
    const INTERVALS: usize = 64;
    let (a, b) = ((from / sigma).clamp(-8.0, 8.0), (to / sigma).clamp(-8.0, 8.0));
    let width = (b - a) / INTERVALS as f64;
    let mut sum = 0.0;
    for n in 0..=INTERVALS {
        let at = a + n as f64 * width;
        let weight = if n == 0 || n == INTERVALS { 1.0 } else { 2.0 + 2.0 * (n % 2) as f64 };
        sum += weight * (-0.5 * at * at).exp();
    }
    sum * width / 3.0 / (2.0 * PI).sqrt()
}
