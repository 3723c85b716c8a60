//! Probes a picture: the field along the rays of a few pixels, without lattice, table or slices, against the finished
//! pixels.
//!
//! The errors at these pixels estimate the errors of the picture. They include all steps from samples to pixels, but
//! not the errors of the samples or of the kernel's cut.

use super::LEAST;
use super::layer::Layers;
use super::row::{Blend, Point};
use super::taps::Taps;
use super::view::SlicedView;
use crate::render::batches::Units;
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
                let taps = self.view.taps_at(number, ray.cell);
                let (density, mean) = field(layers, &taps, self.view.count);
                if density >= f64::from(LEAST) {
                    let gradient =
                        if blend.is_shaded() { gradient(layers, &taps, self.view.count, mean) } else { [0.0; 3] };
                    let value = mean / units.per + units.zero;
                    let place = [0, 1, 2].map(|axis| taps[axis].position);
                    blend.step(&mut ray.state, &Point { place, density, value, gradient }, self.share);
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
    let [present, sum] = sums(layers, [b, c, a].map(|taps| taps.along(false)), count);
    if present > 0.0 { (present * b.density * c.density * a.density, sum / present) } else { (0.0, 0.0) }
}

/// The gradient along b, c and a, in units per voxel (eq 41).
fn gradient(layers: &Layers, [b, c, a]: &[Taps; 3], count: [usize; 3], mean: f64) -> [f64; 3] {
    let [present, _] = sums(layers, [b, c, a].map(|taps| taps.along(false)), count);
    let along = |axis: usize| {
        let [slope, sum] = sums(layers, [b.along(axis == 0), c.along(axis == 1), a.along(axis == 2)], count);
        (sum - mean * slope) / present
    };
    [0, 1, 2].map(along)
}

/// The sum of the weights of present samples, and of these times the samples, with the given weights along b, c and a.
fn sums(layers: &Layers, [b, c, a]: [(&Taps, &[f32]); 3], count: [usize; 3]) -> [f64; 2] {
    let ((column, across), (row, down)) = (b.0.within(0, count[0]), c.0.within(0, count[1]));
    let (slice, along) = a.0.within(0, count[2]);
    let (mut present, mut sum) = (0.0, 0.0);
    if across.is_empty() {
        return [present, sum];
    }
    for (slice, along) in (slice..).zip(&a.1[along]) {
        for (row, down) in (row..).zip(&c.1[down.clone()]) {
            let values = &layers.layer(slice)[row * layers.stride + column..];
            let weight = f64::from(*along) * f64::from(*down);
            for (value, across) in values.iter().zip(&b.1[across.clone()]).filter(|(value, _)| !value.is_nan()) {
                present += weight * f64::from(*across);
                sum += weight * f64::from(*across) * f64::from(*value);
            }
        }
    }
    [present, sum]
}
