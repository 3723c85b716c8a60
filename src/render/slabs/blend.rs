//! How the slabs along a ray are combined, front to back: composited (eq 31; the operator "over" of
//! [PorterDuff](crate::bibliography)), or the largest of them.

use super::medium::Medium;

/// A way to make one pixel of slabs.
pub(in crate::render) trait Blend: Sync {
    /// A pixel so far.
    type Pixel: Copy + Send + Sync;

    /// A slab counts where it is this share of its thickness long.
    const LEAST: f64;

    /// Before the first slab.
    const EMPTY: Self::Pixel;

    /// Adds a slab behind those before: the mean of its values at a pixel, and the world units that it is thick there.
    fn add(&self, pixel: &mut Self::Pixel, value: f64, length: f64);

    /// Whether no slab behind can be seen.
    fn is_closed(pixel: &Self::Pixel) -> bool;

    /// Whether values of such a range can be seen.
    fn shows(&self, range: (f64, f64)) -> bool;

    /// The numbers of finished pixels.
    fn finish(pixels: Vec<Self::Pixel>) -> Vec<f32>;
}

/// Emission and absorption: light of each slab through those before it (eq 30 and 31).
pub(in crate::render) struct Composite {
    pub(in crate::render) medium: Medium,
    /// World units of a path that has such opacities.
    pub(in crate::render) unit: f64,
}

/// What comes through of less is not seen: an eighth of a level of an 8-bit picture.
const CLOSED: f32 = 1.0 / 2048.0;

impl Blend for Composite {
    /// Red, green and blue of the light, and what comes through.
    type Pixel = [f32; 4];

    const LEAST: f64 = 0.01;
    const EMPTY: [f32; 4] = [0.0, 0.0, 0.0, 1.0];

    fn add(&self, pixel: &mut [f32; 4], value: f64, length: f64) {
        let (extinction, [r, g, b]) = (self.medium.extinction(value), self.medium.colour(value));
        if extinction > 0.0 && !Self::is_closed(pixel) {
            let through = pixel[3] * libm::expf(-extinction * (length / self.unit) as f32);
            let seen = pixel[3] - through;
            *pixel = [pixel[0] + seen * r, pixel[1] + seen * g, pixel[2] + seen * b, through];
        }
    }

    fn is_closed(pixel: &[f32; 4]) -> bool {
        pixel[3] < CLOSED
    }

    fn shows(&self, range: (f64, f64)) -> bool {
        !self.medium.is_clear(range)
    }

    fn finish(mut pixels: Vec<[f32; 4]>) -> Vec<f32> {
        pixels.iter_mut().for_each(|pixel| pixel[3] = 1.0 - pixel[3]);
        pixels.into_flattened()
    }
}

/// The largest value.
pub(in crate::render) struct Largest;

impl Blend for Largest {
    /// NaN before any.
    type Pixel = f32;

    const LEAST: f64 = 0.01;
    const EMPTY: f32 = f32::NAN;

    fn add(&self, pixel: &mut f32, value: f64, _: f64) {
        *pixel = pixel.max(value as f32);
    }

    fn is_closed(_: &f32) -> bool {
        false
    }

    fn shows(&self, _: (f64, f64)) -> bool {
        true
    }

    fn finish(pixels: Vec<f32>) -> Vec<f32> {
        pixels
    }
}
