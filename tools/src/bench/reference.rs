//! The reference by brute force: every pixel times every voxel, in f64, with an uncut Gaussian.
//!
//! It is written from the image model alone (the weighted mean along a ray, eq 12). It uses neither the library's
//! camera nor its splatting, and no optimisations that could be wrong.

use super::camera::{CameraSettings, SIGMA};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::f64::consts::PI;

/// A pixel is compared if its weights sum to more than this share of the largest sum. That is safely more than the 1 %
/// below which it is background, although the largest sum of the whole picture is not known here.
const SURELY_INSIDE: f64 = 0.011;

/// The reference values of some pixels of some frames.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(super) struct ReferencePixels {
    /// The frames.
    frames: Vec<usize>,
    /// Positions in a picture, row by row.
    pixels: Vec<usize>,
    /// Frame by frame, pixel by pixel.
    means: Vec<f64>,
    /// Highest minus lowest value of the archive.
    range: f64,
}

/// Errors of pictures as shares of the value range.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct ImageError {
    /// The largest error of any pixel.
    pub largest: f64,
    /// The root of the mean square.
    pub rms: f64,
}

impl ReferencePixels {
    /// The means of `values` (frame number, samples of the volume) as seen by a camera.
    pub(super) fn new(dims: [usize; 3], camera: &CameraSettings, values: &[(usize, Vec<f64>)], range: f64) -> Self {
        let places = places(dims, camera);
        let pixels = camera.compared_pixels();
        let sums: Vec<Sums> = pixels.par_iter().map(|pixel| sums(&places, camera, *pixel, values)).collect();
        let largest = sums.iter().map(|s| s.weight).fold(0.0, f64::max);
        let inside: Vec<(usize, &Sums)> = (pixels.iter().map(|[x, y]| y * camera.size + x).zip(&sums))
            .filter(|(_, sums)| sums.weight > SURELY_INSIDE * largest)
            .collect();
        let frame = |f: usize| inside.iter().map(move |(_, sums)| sums.values[f] / sums.weight);
        Self {
            frames: values.iter().map(|(number, _)| *number).collect(),
            pixels: inside.iter().map(|(pixel, _)| *pixel).collect(),
            means: (0..values.len()).flat_map(frame).collect(),
            range,
        }
    }

    /// The differences between a picture and the reference; none if the frame is not compared. A pixel that is wrongly
    /// background has an infinite error.
    pub(super) fn differences(&self, frame: usize, picture: &[f32]) -> Vec<f64> {
        let Some(number) = self.frames.iter().position(|f| *f == frame) else { return Vec::new() };
        let means = &self.means[number * self.pixels.len()..][..self.pixels.len()];
        let difference = |(pixel, mean): (&usize, &f64)| (f64::from(picture[*pixel]) - mean).abs() / self.range;
        let finite = |d: f64| if d.is_nan() { f64::INFINITY } else { d };
        self.pixels.iter().zip(means).map(difference).map(finite).collect()
    }

    /// The values of a picture of errors at the compared pixels; none if the frame is not compared.
    pub(super) fn at_pixels(&self, frame: usize, errors: &[f32]) -> Vec<f64> {
        let compared = self.frames.contains(&frame);
        let at = |pixel: &usize| f64::from(errors[*pixel]) / self.range;
        self.pixels.iter().filter(|_| compared).map(at).collect()
    }

    /// The error over all differences.
    pub(super) fn error(differences: &[f64]) -> ImageError {
        let squares: f64 = differences.iter().map(|d| d * d).sum();
        let largest = differences.iter().copied().fold(0.0, f64::max);
        ImageError { largest, rms: (squares / differences.len().max(1) as f64).sqrt() }
    }
}

/// A pixel's sums over all voxels: of weights, and of weight times value for each frame.
struct Sums {
    weight: f64,
    values: Vec<f64>,
}

fn sums(places: &[[f64; 2]], camera: &CameraSettings, [x, y]: [usize; 2], frames: &[(usize, Vec<f64>)]) -> Sums {
    let mut sums = Sums { weight: 0.0, values: vec![0.0; frames.len()] };
    for (voxel, place) in places.iter().enumerate() {
        let w = weight(*place, [x as f64 + 0.5, y as f64 + 0.5], camera.scale);
        sums.weight += w;
        for (sum, (_, values)) in sums.values.iter_mut().zip(frames) {
            *sum += w * values[voxel];
        }
    }
    sums
}

/// The projected Gaussian of a voxel at `place`, at a position in the picture; both in pixels.
fn weight(place: [f64; 2], at: [f64; 2], scale: f64) -> f64 {
    let (dx, dy) = ((at[0] - place[0]) / scale, (at[1] - place[1]) / scale);
    (-(dx * dx + dy * dy) / (2.0 * SIGMA * SIGMA)).exp() / (2.0 * PI * SIGMA * SIGMA)
}

/// The position of every voxel in the picture, x fastest, then y, z.
fn places(dims: [usize; 3], camera: &CameraSettings) -> Vec<[f64; 2]> {
    let mut places = Vec::new();
    for z in 0..dims[2] {
        for y in 0..dims[1] {
            for x in 0..dims[0] {
                places.push(project(dims, camera, [x, y, z]));
            }
        }
    }
    places
}

/// Parallel projection. The picture's centre shows the volume's centre; z is up, and azimuth 0 looks along -y.
fn project(dims: [usize; 3], camera: &CameraSettings, voxel: [usize; 3]) -> [f64; 2] {
    let q: [f64; 3] = std::array::from_fn(|a| voxel[a] as f64 - (dims[a] - 1) as f64 / 2.0);
    let (sin_a, cos_a) = camera.azimuth.to_radians().sin_cos();
    let (sin_e, cos_e) = camera.elevation.to_radians().sin_cos();
    let right = -cos_a * q[0] - sin_a * q[1];
    let up = sin_a * sin_e * q[0] - cos_a * sin_e * q[1] + cos_e * q[2];
    let middle = camera.size as f64 / 2.0;
    [middle + camera.scale * right, middle - camera.scale * up]
}

#[cfg(test)]
mod tests {
    use super::*;

    const LOOK: CameraSettings = CameraSettings { azimuth: 0.0, elevation: 0.0, size: 11, scale: 2.0 };

    #[test]
    fn places_worked_out_by_hand() {
        // Two voxels along x: +x is on the left, half a voxel is one pixel.
        assert_eq!(places([2, 1, 1], &LOOK), [[6.5, 5.5], [4.5, 5.5]]);
        assert_eq!(places([1, 1, 2], &LOOK), [[5.5, 6.5], [5.5, 4.5]], "z is up");
        let from_the_side = CameraSettings { azimuth: 90.0, ..LOOK };
        let [near, far] = [project([1, 2, 1], &from_the_side, [0; 3]), project([1, 2, 1], &from_the_side, [0, 1, 0])];
        assert!((near[0] - 6.5).abs() < 1e-12 && (far[0] - 4.5).abs() < 1e-12, "+y is on the left: {near:?} {far:?}");
        let from_above = project([1, 2, 1], &CameraSettings { elevation: 90.0, ..LOOK }, [0; 3]);
        assert!((from_above[1] - 4.5).abs() < 1e-12, "-y is up: {from_above:?}");
    }

    #[test]
    fn the_weight_of_one_voxel_worked_out_by_hand() {
        // 1 / (2 pi 0.75^2) = 0.282942...; at 3 pixels = 1.5 voxels = 2 sigma it falls by exp(-2) = 0.135335...
        let at = |x: f64| weight([5.5, 5.5], [x, 5.5], LOOK.scale);
        assert!((at(5.5) - 0.282_942_121_052_257).abs() < 1e-12, "{}", at(5.5));
        assert!((at(8.5) - 0.282_942_121_052_257 * 0.135_335_283_236_613).abs() < 1e-12);
        assert!(at(400.0) >= 0.0, "never cut, never negative");
    }

    #[test]
    fn the_mean_of_two_voxels_worked_out_by_hand() {
        // Pixel 0 is centred at 0.5: 4 and 6 pixels, 8/3 and 4 sigma, from the voxels at x = 4.5 and 6.5.
        let frames = [(3, vec![1.0, 5.0])];
        let sums = sums(&places([2, 1, 1], &LOOK), &LOOK, [0, 5], &frames);
        let (far, near) = ((-8.0_f64).exp(), (-32.0_f64 / 9.0).exp());
        let mean = (far + 5.0 * near) / (far + near);
        assert!((sums.values[0] / sums.weight - mean).abs() < 1e-12);
    }

    #[test]
    fn one_voxel_shows_its_value_wherever_it_is_seen() {
        let camera = CameraSettings { scale: 1.5, ..LOOK };
        let truth = ReferencePixels::new([1; 3], &camera, &[(3, vec![2.5])], 10.0);
        assert_eq!(truth.pixels, [60], "of the pixels 0, 5 and 10 along each axis only (5, 5) is inside");
        assert!((truth.means[0] - 2.5).abs() < 1e-12);
        let mut picture = vec![f32::NAN; 121];
        assert!(truth.differences(2, &picture).is_empty());
        assert_eq!(truth.differences(3, &picture), [f64::INFINITY]);
        picture[60] = 3.5;
        assert!((truth.differences(3, &picture)[0] - 0.1).abs() < 1e-12);
    }

    #[test]
    fn errors_are_the_largest_and_the_root_of_the_mean_square() {
        let error = ReferencePixels::error(&[3.0, 4.0]);
        assert_eq!(error, ImageError { largest: 4.0, rms: 12.5_f64.sqrt() });
    }
}
