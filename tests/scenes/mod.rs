//! Pictures of coefficients in random views, compared with brute force on the source's own samples.

mod random;

use crate::common::memory::Memory;
use crate::common::samples::numbers;
use crate::common::views::{largest, of_reference, rounding, truth};
use crate::common::{cases, rendered, report, stored};
use crate::reference::camera::project;
use crate::reference::splat::{BACKGROUND, Images, footprint};
use random::{Limits, scene};
use std::time::Instant;
use wavesplat::base::grid::Grid;
use wavesplat::base::sample::SampleType;
use wavesplat::convert::{Bound, ConvertConfig};
use wavesplat::file::CoefficientFile;
use wavesplat::render::{CoefficientScene, Quantity, RenderConfig, RenderReport, SplatSource};
use wavesplat::view::footprint::Method;

/// All inputs of a picture.
#[derive(Debug, Clone)]
struct Scene {
    grid: Grid,
    ty: SampleType,
    /// All frames, t slowest.
    samples: Vec<u8>,
    convert: ConvertConfig,
    look: RenderConfig,
    what: SplatSource,
}

/// The brute-force result for a scene.
struct Reference {
    images: Images,
    /// The largest sum of weights if no sample were missing: over the pixels, and over all places inside and outside
    /// of the picture.
    largest_weight: f64,
    brightest: f64,
    /// Range of the samples that are in the picture's volume and not missing.
    range: (f64, f64),
    /// The largest absolute sample of the archive, and whether any sample is missing.
    largest: f64,
    masked: bool,
}

impl Scene {
    fn missing(&self, value: f64) -> bool {
        !value.is_finite() || Some(value) == self.convert.missing_value
    }

    fn truth(&self, scale: f64) -> Reference {
        let voxels = self.grid.whole().voxels();
        let all = numbers(self.ty, &self.samples);
        let values: Vec<f64> =
            self.look.frames.iter().flat_map(|f| &all[f * voxels..(f + 1) * voxels]).copied().collect();
        let outside: Vec<bool> = self.grid.whole().iter().map(|v| !self.shows(v)).collect();
        let absent: Vec<bool> =
            values.iter().enumerate().map(|(i, v)| outside[i % voxels] || self.missing(*v)).collect();
        let images = truth(&self.grid, &self.look, scale, &values, Some(&absent));
        let weights = truth(&self.grid, &self.look, scale, &vec![0.0; voxels], Some(&outside)).weight;
        let present = || values.iter().zip(&absent).filter(|(_, absent)| !**absent).map(|(v, _)| *v);
        let range = (present().fold(f64::INFINITY, f64::min), present().fold(f64::NEG_INFINITY, f64::max));
        let masked = all.iter().any(|v| self.missing(*v));
        let largest_weight = largest(&weights);
        let brightest = self.brightest(scale).max(largest_weight);
        Reference { images, largest_weight, brightest, range, largest: largest(&all), masked }
    }

    fn shows(&self, voxel: [usize; 3]) -> bool {
        let region = self.look.region.unwrap_or(self.grid.whole());
        (0..3).all(|a| (region.start[a]..region.end[a]).contains(&voxel[a]))
    }

    /// The conversion's error bound for every sample of a frame.
    fn delta(&self, file: &CoefficientFile, frame: usize) -> f64 {
        let window = &file.metadata().windows[file.window_of(frame) as usize];
        match self.convert.bound {
            Bound::Pointwise | Bound::Relative { .. } => window.delta,
            Bound::Rms | Bound::Sampled { .. } => window.delta * f64::from(window.frames).sqrt(),
        }
    }

    /// The largest sum of weights at the place of any voxel, inside or outside of the picture.
    fn brightest(&self, scale: f64) -> f64 {
        let (lattice, view) = of_reference(&self.grid, &self.look, scale);
        let shown = self.grid.whole().iter().filter(|v| self.shows(*v));
        let places = Vec::from_iter(shown.map(|v| project(&lattice, &view, lattice.position(v))));
        let weight = |place: &[f64; 3], v: &[f64; 3]| {
            let off = [0, 1].map(|a| (place[a] - v[a]) / scale);
            (-view.tau * v[2]).exp() * footprint(&lattice, &view, off[0], off[1])
        };
        let sum = |place: &[f64; 3]| places.iter().map(|v| weight(place, v)).sum();
        places.iter().map(sum).fold(0.0, f64::max)
    }

    /// Renders and compares every pixel. Returns the numbers of compared pixels.
    fn check(&self) -> Compared {
        let mut memory = Memory::new(self.grid, self.ty, self.samples.clone());
        let stored = stored(&mut memory, &self.convert);
        let file = stored.open();
        let deltas: Vec<f64> = self.look.frames.iter().map(|f| self.delta(&file, *f)).collect();
        let (found, errors, report) = rendered(&mut CoefficientScene::new(file, self.what), &self.look);
        let truth = self.truth(report.views[0].scale);
        let (promised, quantity) = (self.look.allowed.is_none(), self.look.quantity);
        let pixels = found.len() / deltas.len();
        let mut compared = Compared { pixels: found.len(), ..Compared::default() };
        for (at, found) in found.iter().enumerate() {
            if quantity == Quantity::Mean && (found.is_nan() || truth.is_background(at)) {
                let right = found.is_nan() && truth.is_background(at);
                assert!(right || truth.is_border(at, &report), "pixel {at}: {found}");
                continue;
            }
            let off = (f64::from(*found) - truth.expected(quantity, at)).abs();
            let most = truth.pixel_bound(quantity, at, deltas[at / pixels], &report) + rounding(*found);
            assert!(!promised || off <= most, "pixel {at}: {found} is off by {off}, promised {most}");
            assert!(
                errors.get(at).is_none_or(|e| off <= f64::from(*e)),
                "pixel {at}: {found} is off by {off}, certified {}",
                errors[at]
            );
            compared.shown += 1;
            compared.promised += usize::from(promised);
            compared.certified += errors.len().min(1);
        }
        compared
    }
}

/// Numbers of pixels.
#[derive(Debug, Clone, Copy, Default)]
struct Compared {
    pixels: usize,
    /// Pixels that are not background.
    shown: usize,
    /// Of these, the pixels compared with the bound and the stated splat error.
    promised: usize,
    /// Of these, the pixels compared with their certificates.
    certified: usize,
}

impl std::ops::Add for Compared {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Self {
            pixels: self.pixels + other.pixels,
            shown: self.shown + other.shown,
            promised: self.promised + other.promised,
            certified: self.certified + other.certified,
        }
    }
}

impl Reference {
    fn is_background(&self, at: usize) -> bool {
        let weight = self.images.weight[at];
        weight == 0.0 || weight < BACKGROUND * self.largest_weight
    }

    /// Whether a pixel of means may either be background or not. The exact method cuts the kernel, too; missing
    /// samples are splatted with the cut kernel; and so far from the volume that the cut can omit everything, there is
    /// no mean.
    fn is_border(&self, at: usize, report: &RenderReport) -> bool {
        let weight = self.images.weight[at];
        let stated = report.views[0].stated_splat_error;
        let share = if self.masked { stated } else { Method::EXACT.stated_error };
        (weight - BACKGROUND * self.largest_weight).abs() <= share * self.brightest || weight <= stated * self.brightest
    }

    fn expected(&self, quantity: Quantity, at: usize) -> f64 {
        match quantity {
            Quantity::Emission => self.images.emission[at],
            Quantity::Mean => self.images.emission[at] / self.images.weight[at],
        }
    }

    /// The largest allowed error of a pixel before rounding.
    fn pixel_bound(&self, quantity: Quantity, at: usize, delta: f64, report: &RenderReport) -> f64 {
        let (lo, hi) = self.range;
        let magnitude = if lo <= hi { lo.abs().max(hi.abs()) } else { 0.0 };
        match quantity {
            Quantity::Emission => {
                // Rounding that sums in f64 leave where coefficients of missing samples are subtracted.
                let left = if self.masked { 1e-15 * self.largest * self.brightest } else { 0.0 };
                delta * self.images.weight[at] + report.views[0].stated_splat_error * magnitude * self.brightest + left
            }
            Quantity::Mean => {
                delta + report.views[0].stated_splat_error * (hi - lo) * self.brightest / self.images.weight[at]
            }
        }
    }
}

/// Checks some of so many scenes: see [`cases`]. Reports the failing scenes at the end.
fn check_all(limits: &Limits, count: u64) {
    let (started, mut all, mut failed) = (Instant::now(), Compared::default(), Vec::new());
    let count = cases(count as usize) as u64;
    for seed in 0..count {
        let scene = scene(limits, seed);
        match std::panic::catch_unwind(|| scene.check()) {
            Ok(compared) => all = all + compared,
            Err(_) => failed.push(seed), // the reason was already printed
        }
    }
    report(&format!("{count} scenes, {all:?}, in {:.1?}", started.elapsed()));
    assert!(failed.is_empty(), "{} scenes: {failed:?}", failed.len());
    assert!(all.promised.min(all.certified) > all.pixels / 4, "little was compared: {all:?}");
}

#[test]
fn pictures_of_random_scenes_are_within_their_bounds() {
    let limits = Limits { sigma: (0.02, 4.0), scale: (0.1, 8.0), moved: true, tau: 30.0 };
    check_all(&limits, 3000);
}
