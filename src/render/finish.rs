//! The last step of a tile: planes to pixels, by the inverse transform (eq 8) and the division by weights (eq 12).

use super::Quantity;
use super::certificate::Certificate;
use super::scene::Group;
use super::splat::Tile;
use super::terms::Layout;
use super::weights::Weights;
use crate::wavelet::{LANES, Lane};

/// What turns the planes of a group into pixels.
pub(super) struct Finish<'a> {
    pub(super) group: &'a dyn Group,
    pub(super) layout: Layout,
    pub(super) quantity: Quantity,
    pub(super) weights: &'a Weights,
    pub(super) certificate: Option<Certificate>,
}

impl Finish<'_> {
    /// Planes that a finished tile has: the frames, then their errors if they are certified.
    pub(super) fn planes(&self) -> usize {
        self.layout.frames * (1 + usize::from(self.certificate.is_some()))
    }

    /// Turns the planes of a tile into its pixels.
    pub(super) fn tile(&self, tile: &mut Tile) {
        let pixels = tile.pixels();
        let mut planes = vec![Lane::default(); self.layout.planes()];
        let mut frames = vec![Lane::default(); self.layout.frames];
        let mut out = vec![0.0; self.planes() * pixels];
        for first in (0..pixels).step_by(LANES) {
            let count = LANES.min(pixels - first);
            tile.load(first, count, &mut planes);
            let sums: Vec<(Lane, Lane)> = (0..self.layout.frames).map(|f| self.absent_and_errors(&planes, f)).collect();
            self.group.reconstruct(&mut planes, &mut frames);
            for (f, (emission, (absent, errors))) in frames.iter().zip(&sums).enumerate() {
                for l in 0..count {
                    let pixel = self.pixel(tile, first + l, f, emission[l], absent[l], errors[l]);
                    out[f * pixels + first + l] = pixel.0;
                    if self.certificate.is_some() {
                        out[(self.layout.frames + f) * pixels + first + l] = pixel.1;
                    }
                }
            }
        }
        tile.replace(out);
    }

    /// The weights that are missing in a frame, and the sums of weighted errors.
    fn absent_and_errors(&self, planes: &[Lane], frame: usize) -> (Lane, Lane) {
        let (mut absent, mut errors) = (Lane::default(), Lane::default());
        if self.layout.absent {
            let (one, all) = (planes[self.layout.absent(frame)], planes[self.layout.absent_in_all()]);
            absent = std::array::from_fn(|l| one[l] + all[l]);
        }
        let sums = &planes[self.layout.first_error()..self.layout.planes()];
        for (sum, factors) in sums.iter().zip(&self.group.errors().factors) {
            (0..LANES).for_each(|l| errors[l] += sum[l] * factors[frame]);
        }
        (absent, errors)
    }

    /// The value of a pixel and its error.
    fn pixel(&self, tile: &Tile, at: usize, frame: usize, emission: f64, absent: f64, errors: f64) -> (f64, f64) {
        let weight = self.weights.at(tile, at);
        let value = match self.quantity {
            Quantity::Mean => weight.mean(emission, absent),
            Quantity::Emission => emission,
        };
        let certified = self
            .certificate
            .map_or(0.0, |c| c.error(&self.group.errors().frames[frame], &weight, absent, errors, value));
        (value, f64::from(certified))
    }
}
