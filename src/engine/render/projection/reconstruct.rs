//! The last step of a tile: turns planes into pixels by the inverse transform (eq 8) and the division by the sum of
//! weights (eq 12).

use super::certificate::Certificate;
use super::weight_sums::{PixelWeight, WeightSums};
use crate::render::batches::{FrameBatch, Inverse, Layout};
use crate::render::config::{Quantity, RenderConfig};
use crate::render::splat::{Pixels, ResolvedTile};
use wavesplat_core::wavelet::{LANES, Lane};

/// Turns the planes of a batch into pixels.
pub(super) struct PixelReconstructor<'a> {
    batch: &'a dyn FrameBatch,
    layout: Layout,
    quantity: Quantity,
    weights: &'a WeightSums<'a>,
    certificate: Option<Certificate>,
}

impl<'a> PixelReconstructor<'a> {
    /// The reconstructor for the pictures of a view.
    pub(super) fn new(batch: &'a dyn FrameBatch, weights: &'a WeightSums<'a>, config: &RenderConfig) -> Self {
        let certificate = config.certify.then(|| Certificate::new(weights.setup, config.quantity));
        Self { batch, layout: batch.layout(), quantity: config.quantity, weights, certificate }
    }

    /// Number of pictures of a tile: one for each frame, and one more for its error bounds if pictures are certified.
    pub(super) fn pictures(&self) -> usize {
        self.layout.frames * (1 + usize::from(self.certificate.is_some()))
    }

    /// Turns the planes of a tile into its pixels. Background pixels are NaN.
    pub(super) fn tile(&self, mut tile: ResolvedTile<'_>, pixels: &mut Pixels<'_, f32>) {
        let mut inverse = self.batch.inverse(&tile.used());
        let mut planes = vec![Lane::default(); self.layout.planes()];
        let mut frames = vec![Lane::default(); self.layout.frames];
        let width = tile.rect.x.len();
        for (y, at) in tile.rect.y.clone().zip((0..).step_by(width)) {
            for first in (0..width).step_by(LANES) {
                let count = LANES.min(width - first);
                let x = tile.rect.x.start + first;
                let weights = Lanes::new(self.weights, [x, y], count);
                if self.quantity == Quantity::Mean && weights.are_background() {
                    (0..self.pictures()).for_each(|picture| pixels.at(picture, [x, y], count).fill(f32::NAN));
                    continue;
                }
                tile.load(at + first, count, &mut planes);
                self.put(&mut inverse, &mut planes, &mut frames, &weights, |picture, values| {
                    pixels.put(picture, [x, y], &values.map(|v| v as f32)[..count]);
                });
            }
        }
    }

    /// Calls `put(picture, values)` for all pictures at some neighbouring pixels.
    fn put(
        &self,
        inverse: &mut Inverse<'_>,
        planes: &mut [Lane],
        frames: &mut [Lane],
        weights: &Lanes,
        mut put: impl FnMut(usize, Lane),
    ) {
        let sums: Vec<(Lane, Lane)> = match self.layout.planes() > self.layout.value_planes() {
            true => (0..self.layout.frames).map(|f| self.absent_and_errors(planes, f)).collect(),
            false => Vec::new(),
        };
        inverse(planes, frames);
        let all = weights.present(&Lane::default());
        for (f, emission) in frames.iter().enumerate() {
            let (absent, errors) = sums.get(f).copied().unwrap_or_default();
            let present = if self.layout.absent { weights.present(&absent) } else { all };
            let values = std::array::from_fn(|l| self.quantity.pixel(emission[l], present[l]));
            put(f, values);
            if let Some(certificate) = self.certificate {
                let bounds = &self.batch.errors().frames[f];
                let error = |l| certificate.error(bounds, &weights.0[l], absent[l], errors[l], values[l]).into();
                put(self.layout.frames + f, std::array::from_fn(error));
            }
        }
    }

    /// The missing weights of a frame, and the weighted sums of errors.
    fn absent_and_errors(&self, planes: &[Lane], frame: usize) -> (Lane, Lane) {
        let (absent, mut errors) = (self.layout.absent_sums(planes, frame), Lane::default());
        let sums = &planes[self.layout.first_error()..self.layout.planes()];
        for (sum, factors) in sums.iter().zip(&self.batch.errors().factors) {
            (0..LANES).for_each(|l| errors[l] += sum[l] * factors[frame]);
        }
        (absent, errors)
    }
}

impl Quantity {
    /// The value of a pixel: its emission, or its mean (eq 12) with the weights that are present.
    fn pixel(self, emission: f64, present: f64) -> f64 {
        match self {
            Self::Mean => emission / present,
            Self::Emission => emission,
        }
    }
}

impl Layout {
    /// The missing weights of a frame.
    fn absent_sums(&self, planes: &[Lane], frame: usize) -> Lane {
        if !self.absent {
            return Lane::default();
        }
        let (one, all) = (planes[self.absent(frame)], planes[self.absent_in_all()]);
        std::array::from_fn(|l| one[l] + all[l])
    }
}

/// Keeps the sums of pixels as they are, so that those of other voxels can be added.
pub(super) struct PartialSumKeeper<'a> {
    pub(super) batch: &'a dyn FrameBatch,
}

impl PartialSumKeeper<'_> {
    /// Stores the emissions of all frames, then their missing weights if there are any. Leaves tiles without sums unchanged.
    pub(super) fn tile(&self, mut tile: ResolvedTile<'_>, pixels: &mut Pixels<'_, f64>) {
        let (used, layout) = (tile.used(), self.batch.layout());
        if used.is_empty() {
            return;
        }
        let mut inverse = self.batch.inverse(&used);
        let mut planes = vec![Lane::default(); layout.planes()];
        let mut frames = vec![Lane::default(); layout.frames];
        let width = tile.rect.x.len();
        for (y, at) in tile.rect.y.clone().zip((0..).step_by(width)) {
            for first in (0..width).step_by(LANES) {
                let (count, x) = (LANES.min(width - first), tile.rect.x.start + first);
                tile.load(at + first, count, &mut planes);
                for frame in (0..layout.frames).filter(|_| layout.absent) {
                    pixels.put(layout.frames + frame, [x, y], &layout.absent_sums(&planes, frame)[..count]);
                }
                inverse(&mut planes, &mut frames);
                frames.iter().enumerate().for_each(|(f, sums)| pixels.put(f, [x, y], &sums[..count]));
            }
        }
    }
}

/// The pixels of a picture whose sums are complete: emissions, and missing weights unless all samples are there.
pub(in crate::render) fn finished(
    quantity: Quantity,
    weights: &WeightSums<'_>,
    emission: &[f64],
    absent: Option<&[f64]>,
) -> Vec<f32> {
    let width = weights.setup.camera.size[0];
    let pixel = |(at, emission): (usize, &f64)| {
        let present = weights.at([at % width, at / width]).present(absent.map_or(0.0, |absent| absent[at]));
        quantity.pixel(*emission, present) as f32
    };
    emission.iter().enumerate().map(pixel).collect()
}

/// The weights of neighbouring pixels of a row, padded with the weights of the last pixel.
struct Lanes([PixelWeight; LANES]);

impl Lanes {
    fn new(weights: &WeightSums<'_>, [x, y]: [usize; 2], count: usize) -> Self {
        Self(std::array::from_fn(|l| weights.at([x + l.min(count - 1), y])))
    }

    fn are_background(&self) -> bool {
        self.0.iter().all(|weight| weight.present(0.0).is_nan())
    }

    fn present(&self, absent: &Lane) -> Lane {
        std::array::from_fn(|l| self.0[l].present(absent[l]))
    }
}
