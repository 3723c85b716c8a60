//! Probes a picture: the field along the rays of a few pixels, without lattice, table or slices, against the finished
//! pixels.
//!
//! The errors at these pixels are an estimate of those of the picture. They include all steps from samples to pixels.
//! They do not include the errors of samples, and of the kernel's cut.

use super::LEAST;
use super::layer::Layers;
use super::row::Blend;
use super::taps::Taps;
use super::units::Units;
use super::view::SlicedView;
use crate::render::report::Probed;

/// Steps per voxel along a.
const STEPS: usize = 4;
/// Rays across and down the picture.
const SIDE: usize = 6;

/// A few rays of one frame.
pub(super) struct Probe<B: Blend> {
    /// The view with the probe's steps for slices.
    view: SlicedView,
    next: usize,
    rays: Vec<Ray<B>>,
    /// Slices of the picture for each step.
    share: f64,
}

/// The ray of a pixel.
struct Ray<B: Blend> {
    pixel: usize,
    /// Its position on the lattice, in voxels.
    cell: [f64; 2],
    state: B::Exact,
}

impl<B: Blend> Probe<B> {
    pub(super) fn new(view: &SlicedView, blend: &B) -> Self {
        let [width, height] = view.camera.size;
        let ray = |n: usize| {
            let [x, y] = [(2 * (n % SIDE) + 1) * width, (2 * (n / SIDE) + 1) * height].map(|at| at / (2 * SIDE));
            let cell = view.cell_at([x as f64 + 0.5, y as f64 + 0.5]);
            Ray { pixel: y * width + x, cell, state: blend.exact() }
        };
        let (fine, share) = view.with_slices(STEPS);
        Self { view: fine, next: 0, rays: (0..SIDE * SIDE).map(ray).collect(), share }
    }

    /// Follows the rays through the layers up to `met`.
    pub(super) fn add(&mut self, blend: &B, units: &Units, layers: &Layers, met: usize) {
        let ready = self.view.ready(self.next, met);
        self.next = ready.end;
        for number in ready {
            for ray in &mut self.rays {
                let (density, mean) = field(layers, &self.view.taps_at(number, ray.cell), self.view.count);
                if density >= f64::from(LEAST) {
                    blend.step(&mut ray.state, mean / units.per + units.zero, density, self.share);
                }
            }
        }
    }

    /// The errors of a picture's pixels; `None` if no ray meets the volume.
    pub(super) fn errors(&self, picture: &[f32]) -> Option<Probed> {
        let pixel = |ray: &Ray<B>| B::off(&ray.state, &picture[ray.pixel * B::NUMBERS..][..B::NUMBERS]);
        let off: Vec<f64> = self.rays.iter().filter_map(pixel).collect();
        let squares: f64 = off.iter().map(|off| off * off).sum();
        let (rms, largest) = ((squares / off.len() as f64).sqrt(), off.iter().copied().fold(0.0, f64::max));
        (!off.is_empty()).then_some(Probed { rays: off.len(), rms, largest })
    }
}

/// The density and the mean at a point, from the taps along b, c and a.
fn field(layers: &Layers, [b, c, a]: &[Taps; 3], count: [usize; 3]) -> (f64, f64) {
    let ((column, across), (row, down)) = (b.within(0, count[0]), c.within(0, count[1]));
    let (slice, along) = a.within(0, count[2]);
    if across.is_empty() || down.is_empty() || along.is_empty() {
        return (0.0, 0.0);
    }
    let (mut weights, mut sum) = (0.0, 0.0);
    for (slice, along) in (slice..).zip(&a.weights[along]) {
        for (row, down) in (row..).zip(&c.weights[down.clone()]) {
            let values = &layers.layer(slice)[row * layers.stride + column..];
            let weight = f64::from(*along) * f64::from(*down);
            for (value, across) in values.iter().zip(&b.weights[across.clone()]).filter(|(value, _)| !value.is_nan()) {
                weights += weight * f64::from(*across);
                sum += weight * f64::from(*across) * f64::from(*value);
            }
        }
    }
    (weights * b.density * c.density * a.density, sum / weights)
}
