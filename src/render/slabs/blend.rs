//! Combines the slabs along a ray, front to back: by compositing (eq 31; the operator "over" of
//! [PorterDuff](crate::bibliography)) or by their maximum.

use super::medium::Medium;

/// A way to combine the slabs of one pixel.
pub(in crate::render) trait Blend: Sync {
    /// The state of a pixel while slabs are added.
    type Pixel: Copy + Send + Sync;

    /// A slab counts at pixels where its ray length is more than this share of its thickness.
    const LEAST: f64;

    /// The state before the first slab.
    const EMPTY: Self::Pixel;

    /// Adds a slab behind the earlier ones: the mean of its values at a pixel, and the length of the ray in it, in
    /// world units.
    fn add(&self, pixel: &mut Self::Pixel, value: f64, length: f64);

    /// Whether the pixel hides all slabs behind.
    fn is_closed(pixel: &Self::Pixel) -> bool;

    /// Whether any value in this range is visible.
    fn shows(&self, range: (f64, f64)) -> bool;

    /// Turns finished pixels into numbers.
    fn finish(pixels: Vec<Self::Pixel>) -> Vec<f32>;
}

/// Emission and absorption: the light of each slab passes through the slabs before it (eq 30 and 31).
pub(in crate::render) struct Composite {
    pub(in crate::render) medium: Medium,
    /// Length of the path that has the transfer function's opacities, in world units.
    pub(in crate::render) unit: f64,
}

/// Pixels with less transmittance are opaque: the rest is an eighth of a level of an 8-bit picture.
const CLOSED: f32 = 1.0 / 2048.0;

impl Blend for Composite {
    /// Red, green and blue of the light, and the transmittance.
    type Pixel = [f32; 4];

    const LEAST: f64 = 0.01;
    const EMPTY: [f32; 4] = [0.0, 0.0, 0.0, 1.0];

    fn add(&self, pixel: &mut [f32; 4], value: f64, length: f64) {
        let (extinction, [r, g, b]) = (self.medium.extinction(value), self.medium.colour(value));
        if extinction > 0.0 && !Self::is_closed(pixel) {
            let through = pixel[3] * libm::expf(-extinction * (length / self.unit) as f32);
            let share = pixel[3] - through;
            *pixel = [pixel[0] + share * r, pixel[1] + share * g, pixel[2] + share * b, through];
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

/// The maximum along the ray.
pub(in crate::render) struct Largest;

impl Blend for Largest {
    /// The maximum so far; NaN before the first slab.
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
