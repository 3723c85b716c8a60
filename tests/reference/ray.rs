//! Colour and opacity along the ray, by brute force: many short steps through the field of the kernels (eq 29-31).
//!
//! ```text
//! C = sum over steps of  T (1 - exp(-kappa(g) l)) c(g)        T = product over the steps before of  exp(-kappa(g) l)
//! ```
//!
//! with l the density times the length of a step, and g the mean of the samples there; kappa(v) = -ln(1 - opacity(v)) /
//! unit.

use super::camera::{Lattice, View, project};
use std::f64::consts::PI;

/// The transfer function of a test: red, green, blue and kappa of a value.
pub(crate) type Medium<'a> = &'a dyn Fn(f64) -> [f64; 4];

/// Voxels this many deviations away are left out: their weight, 3e-18, is nothing beside any density that counts.
const FAR: f64 = 9.0;

/// A voxel that is not missing: its x and y in world units from the pixel, depth and value.
struct Voxel {
    squared: f64,
    z: f64,
    value: f64,
}

/// A volume as a view sees it.
pub(crate) struct Rays<'a> {
    pub(crate) lattice: &'a Lattice,
    pub(crate) view: &'a View,
    /// NaN is missing.
    pub(crate) values: &'a [f64],
}

impl Rays<'_> {
    /// The voxels within [`FAR`] of the ray.
    fn voxels(&self, pixel: [usize; 2]) -> Vec<Voxel> {
        let (mut voxels, far) = (Vec::new(), FAR * self.view.sigma);
        for (position, value) in self.lattice.positions().into_iter().zip(self.values) {
            let [x, y, z] = project(self.lattice, self.view, position);
            let off = [x - pixel[0] as f64 - 0.5, y - pixel[1] as f64 - 0.5].map(|d| d / self.view.scale);
            let squared = off[0] * off[0] + off[1] * off[1];
            if !value.is_nan() && squared < far * far {
                voxels.push(Voxel { squared, z, value: *value });
            }
        }
        voxels
    }

    /// The weight of a voxel in a projection.
    fn across(&self, voxel: &Voxel) -> f64 {
        let [variance, cell] = [self.view.sigma * self.view.sigma, self.lattice.spacing.iter().product()];
        cell / (2.0 * PI * variance) * (-voxel.squared / (2.0 * variance)).exp()
    }

    /// The range of depths with samples: from four deviations in front of the first voxels to four behind the last.
    pub(crate) fn depths(&self) -> [f64; 2] {
        let depths = || self.lattice.corners().into_iter().map(|corner| project(self.lattice, self.view, corner)[2]);
        let ends = [depths().fold(f64::INFINITY, f64::min), depths().fold(f64::NEG_INFINITY, f64::max)];
        [ends[0] - 4.0 * self.view.sigma, ends[1] + 4.0 * self.view.sigma]
    }

    /// The integral along the ray in `steps` steps.
    pub(crate) fn integral(&self, pixel: [usize; 2], steps: usize, medium: Medium<'_>) -> [f64; 4] {
        blend(self.steps(pixel, steps, 1e-6, &|_| true).into_iter(), medium)
    }

    /// The largest mean at any of `steps` steps where the density is more than 0.01, at depths that are `within` something.
    pub(crate) fn largest(&self, pixel: [usize; 2], steps: usize, within: &dyn Fn(f64) -> bool) -> f64 {
        self.steps(pixel, steps, 0.01, within).into_iter().map(|(_, mean)| mean).fold(f64::NAN, f64::max)
    }

    /// Length and mean of each step where the density is more than `least`.
    fn steps(&self, pixel: [usize; 2], steps: usize, least: f64, within: &dyn Fn(f64) -> bool) -> Vec<(f64, f64)> {
        let ([from, to], voxels) = (self.depths(), self.voxels(pixel));
        let (width, sigma) = ((to - from) / steps as f64, self.view.sigma);
        let across: Vec<f64> = voxels.iter().map(|voxel| self.across(voxel)).collect();
        let step = |n: usize| {
            let (mut density, mut sum) = (0.0, 0.0);
            let z = from + (n as f64 + 0.5) * width;
            for (voxel, across) in voxels.iter().zip(&across).filter(|(voxel, _)| (z - voxel.z).abs() < FAR * sigma) {
                let off = (z - voxel.z) / sigma;
                let along = (-0.5 * off * off).exp() / ((2.0 * PI).sqrt() * sigma);
                density += across * along;
                sum += across * along * voxel.value;
            }
            (density * width, sum / density)
        };
        let steps = (0..steps).filter(|n| within(from + (*n as f64 + 0.5) * width));
        steps.map(step).filter(|(length, _)| *length > least * width).collect()
    }
}

fn blend(steps: impl Iterator<Item = (f64, f64)>, medium: Medium<'_>) -> [f64; 4] {
    let (mut light, mut through) = ([0.0; 3], 1.0);
    for (length, mean) in steps {
        let [r, g, b, kappa] = medium(mean);
        let passed = (-kappa * length).exp();
        for (light, colour) in light.iter_mut().zip([r, g, b]) {
            *light += through * (1.0 - passed) * colour;
        }
        through *= passed;
    }
    [light[0], light[1], light[2], 1.0 - through]
}
