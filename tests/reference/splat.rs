//! Images by brute force (eq 4 and 12): every pixel times every voxel times every frame, kernel never cut.

use super::camera::{Lattice, View, project};

/// Where the sum of weights is below this part of the view's largest, the weighted mean is background (eq 16).
pub(crate) const BACKGROUND: f64 = 0.01;

/// The images of all frames, each [t][y][x] with y from the top of the image.
#[derive(Debug, Clone)]
pub(crate) struct Images {
    /// I, the sum of `w_i` `v_i`(t): value times world length.
    pub(crate) emission: Vec<f64>,
    /// The sum of `w_i` over the samples present in the frame.
    pub(crate) weight: Vec<f64>,
    /// g = I / sum of `w_i`; NaN where the weight is below 1 % of `largest_weight`.
    pub(crate) mean: Vec<f64>,
    /// The largest, over the pixels of the image, of the sum of `w_i` over ALL voxels, missing or not.
    pub(crate) largest_weight: f64,
}

/// Section 2, f(x, y): the attenuated projection of one voxel's kernel, x and y in world units from its centre.
pub(crate) fn footprint(lattice: &Lattice, view: &View, x: f64, y: f64) -> f64 {
    footprint_at_centre(lattice, view) * gaussian(view, x, y)
}

/// f(0, 0).
fn footprint_at_centre(lattice: &Lattice, view: &View) -> f64 {
    let cell = lattice.spacing[0] * lattice.spacing[1] * lattice.spacing[2];
    let variance = view.sigma * view.sigma;
    let attenuation = (view.tau * view.tau * variance / 2.0).exp();
    cell * attenuation / (2.0 * std::f64::consts::PI * variance)
}

/// f(x, y) / f(0, 0).
fn gaussian(view: &View, x: f64, y: f64) -> f64 {
    (-(x * x + y * y) / (2.0 * view.sigma * view.sigma)).exp()
}

/// Section 2, `w_i`(x, y) = exp(-tau `z_i`) f(x - `x_i`, y - `y_i`) of every voxel at the centre of pixel (a, b).
pub(crate) fn weights(lattice: &Lattice, view: &View, a: usize, b: usize) -> Vec<f64> {
    let mut weights = Vec::new();
    for position in lattice.positions() {
        let [x, y, z] = project(lattice, view, position);
        let (right, below) = from_centre(view, x, y, a, b);
        weights.push((-view.tau * z).exp() * footprint(lattice, view, right, below));
    }
    weights
}

/// World units from a voxel that is projected to (`x_i`, `y_i`) to the centre of pixel (a, b).
fn from_centre(view: &View, x: f64, y: f64, a: usize, b: usize) -> (f64, f64) {
    ((a as f64 + 0.5 - x) / view.scale, (b as f64 + 0.5 - y) / view.scale)
}

/// Eq 1-4 and eq 12. `values` are `[t][z][y][x]`.
///
/// `missing` has one entry per value. A missing sample is absent: it counts neither in I nor in the sum of weights of its
/// frame. The 1 % rule compares that frame's sum of weights with the largest that the view would have if none were missing.
pub(crate) fn images(lattice: &Lattice, view: &View, values: &[f64], missing: Option<&[bool]>) -> Images {
    let voxels = lattice.voxels();
    let frames = values.len() / voxels;
    let pixels = view.width * view.height;
    assert_eq!(values.len(), frames * voxels);
    assert!(missing.is_none_or(|missing| missing.len() == values.len()));

    let projected: Vec<[f64; 3]> = lattice.positions().iter().map(|&point| project(lattice, view, point)).collect();
    // Each voxel's weight at its own place, which no pixel changes.
    let centre = footprint_at_centre(lattice, view);
    let own: Vec<f64> = projected.iter().map(|[_, _, z]| (-view.tau * z).exp() * centre).collect();
    let mut emission = vec![0.0; frames * pixels];
    let mut present_weight = vec![0.0; frames * pixels];
    let mut largest_weight = 0.0_f64;
    for b in 0..view.height {
        for a in 0..view.width {
            let pixel = b * view.width + a;
            let mut full_weight = 0.0;
            for voxel in 0..voxels {
                let [x, y, _] = projected[voxel];
                let (right, below) = from_centre(view, x, y, a, b);
                let w = own[voxel] * gaussian(view, right, below);
                full_weight += w;
                for frame in 0..frames {
                    let sample = frame * voxels + voxel;
                    if missing.is_none_or(|missing| !missing[sample]) {
                        emission[frame * pixels + pixel] += w * values[sample];
                        present_weight[frame * pixels + pixel] += w;
                    }
                }
            }
            largest_weight = largest_weight.max(full_weight);
        }
    }

    let mut mean = vec![f64::NAN; frames * pixels];
    for at in 0..frames * pixels {
        if present_weight[at] >= BACKGROUND * largest_weight {
            mean[at] = emission[at] / present_weight[at];
        }
    }
    Images { emission, weight: present_weight, mean, largest_weight }
}

mod tests {
    use super::super::camera::{Directions, directions, dot, minus};
    use super::*;

    const CUBE: Lattice = Lattice { dims: [12, 12, 12], spacing: [1.0; 3], origin: [0.0; 3] };
    const FRONT: View = View {
        azimuth: 0.0,
        elevation: 0.0,
        roll: 0.0,
        width: 16,
        height: 16,
        scale: 1.0,
        center: None,
        sigma: 0.75,
        tau: 0.0,
    };

    fn pixel(view: &View, frame: usize, a: usize, b: usize) -> usize {
        (frame * view.height + b) * view.width + a
    }

    #[test]
    fn constant_field_shows_the_path_length() {
        // Along an axis: 12 voxels of 1 unit. Ripple: 2 exp(-2 pi^2 0.75^2) = 3e-5 per image axis.
        let front = images(&CUBE, &FRONT, &vec![1.0; CUBE.voxels()], None);
        assert!((front.emission[pixel(&FRONT, 0, 8, 8)] - 12.0).abs() < 12.0 * 1e-4);
        assert!((front.largest_weight - 12.0).abs() < 12.0 * 1e-4);

        // Turned by 20 degrees: rays near the middle still enter and leave through the y faces, 12 / cos 20 apart.
        let turned = View { azimuth: 20.0, ..FRONT };
        let image = images(&CUBE, &turned, &vec![1.0; CUBE.voxels()], None);
        let length = 12.0 / 20.0_f64.to_radians().cos();
        assert!((image.emission[pixel(&turned, 0, 8, 8)] - length).abs() < length * 1e-3);

        // Unequal spacings, from above: 6 voxels of 2.5 units.
        let slab = Lattice { dims: [12, 16, 6], spacing: [1.5, 1.0, 2.5], origin: [3.0, -4.0, 5.0] };
        let above = View { elevation: 90.0, sigma: 1.5, ..FRONT };
        let image = images(&slab, &above, &vec![1.0; slab.voxels()], None);
        assert!((image.emission[pixel(&above, 0, 8, 8)] - 15.0).abs() < 15.0 * 1e-4);
    }

    #[test]
    fn constant_field_has_its_value_as_mean_and_nan_outside() {
        let view = View { azimuth: 30.0, elevation: 25.0, width: 40, height: 40, tau: 0.1, ..FRONT };
        let image = images(&CUBE, &view, &vec![-2.5; CUBE.voxels()], None);
        for at in 0..image.mean.len() {
            if image.weight[at] < 0.01 * image.largest_weight {
                assert!(image.mean[at].is_nan());
            } else {
                assert!((image.mean[at] + 2.5).abs() < 1e-12);
            }
        }
        assert!(image.mean[pixel(&view, 0, 0, 0)].is_nan());
        assert!(!image.mean[pixel(&view, 0, 20, 20)].is_nan());
    }

    #[test]
    fn one_voxel_by_hand() {
        // Pixel (8, 8) has its centre half a pixel, 1/4 world unit, to the right of and below the only voxel.
        let point = Lattice { dims: [1, 1, 1], spacing: [2.0, 3.0, 5.0], origin: [7.0, 7.0, 7.0] };
        let view = View { scale: 2.0, sigma: 0.5, tau: 0.8, ..FRONT };
        let expected = 7.0 * 30.0 * 0.08_f64.exp() * (-0.25_f64).exp() / (0.5 * std::f64::consts::PI);
        let image = images(&point, &view, &[7.0], None);
        assert!((image.emission[pixel(&view, 0, 8, 8)] - expected).abs() < 1e-12 * expected);
        assert!((weights(&point, &view, 8, 8)[0] - expected / 7.0).abs() < 1e-12 * expected);
    }

    #[test]
    fn arrays_are_t_z_y_x_and_plus_x_is_on_the_left() {
        // One sample in frame 1 at voxel x = 3, y = 0, z = 1: far left, lower half (z = 1 of 0..=4), away from the viewer.
        let lattice = Lattice { dims: [4, 3, 5], spacing: [2.0; 3], origin: [0.0; 3] };
        let mut values = vec![0.0; 2 * 60];
        values[60 + 12 + 3] = 1.0;
        let view = View { width: 20, height: 21, sigma: 0.8, ..FRONT };
        let image = images(&lattice, &view, &values, None);
        let mut brightest = 0;
        for at in 0..image.emission.len() {
            if image.emission[at] > image.emission[brightest] {
                brightest = at;
            }
        }
        // x = 10 - (6 - 3) = 7, the edge of pixels 6 and 7; y = 10.5 - (2 - 4) = 12.5, the centre of pixel 12.
        assert!(brightest == pixel(&view, 1, 6, 12) || brightest == pixel(&view, 1, 7, 12), "{brightest}");
        assert!(image.emission[..20 * 21].iter().all(|&value| value == 0.0));
    }

    #[test]
    fn sum_over_pixels_is_the_integral_of_the_field() {
        let lattice = Lattice { dims: [3, 2, 4], spacing: [1.0, 1.5, 0.5], origin: [0.0; 3] };
        let values: Vec<f64> = (0..lattice.voxels()).map(|i| (i as f64 * 1.7).sin()).collect();
        let view =
            View { azimuth: 33.0, elevation: 21.0, roll: 10.0, width: 64, height: 64, scale: 2.5, sigma: 1.2, ..FRONT };
        let image = images(&lattice, &view, &values, None);
        let area = 1.0 / (view.scale * view.scale);
        let seen: f64 = image.emission.iter().map(|value| value * area).sum();
        let held: f64 = values.iter().map(|value| value * 0.75).sum();
        assert!((seen - held).abs() < 1e-9, "{seen} {held}");
    }

    /// Eq 1 as it stands: the integral over the whole ray through a pixel of exp(-tau z) times the field of
    /// three-dimensional kernels, by the midpoint rule on points in the world. The projection of voxels is not used.
    fn integral_along_the_ray(lattice: &Lattice, view: &View, values: &[f64], a: usize, b: usize) -> f64 {
        let Directions { d, r, u } = directions(view.azimuth, view.elevation, view.roll);
        let c = lattice.middle();
        let right = (a as f64 + 0.5 - view.width as f64 / 2.0) / view.scale;
        let up = (view.height as f64 / 2.0 - b as f64 - 0.5) / view.scale;
        let nearest = lattice.corners().iter().map(|&corner| dot(d, corner)).fold(f64::INFINITY, f64::min);
        let cell: f64 = lattice.spacing.iter().product();
        let norm = cell / (2.0 * std::f64::consts::PI * view.sigma * view.sigma).powf(1.5);
        let (step, steps) = (0.01, 8000);
        let mut sum = 0.0;
        for n in 0..steps {
            let along = (n as f64 + 0.5 - steps as f64 / 2.0) * step;
            let point = [0, 1, 2].map(|axis| c[axis] + right * r[axis] + up * u[axis] + along * d[axis]);
            let z = dot(d, point) - nearest;
            for (position, value) in lattice.positions().into_iter().zip(values) {
                let off = minus(point, position);
                let h = norm * (-dot(off, off) / (2.0 * view.sigma * view.sigma)).exp();
                sum += step * (-view.tau * z).exp() * h * value;
            }
        }
        sum
    }

    #[test]
    fn closed_form_footprint_is_the_integral_of_eq_1() {
        let lattice = Lattice { dims: [3, 2, 4], spacing: [1.0, 1.5, 0.5], origin: [4.0, -1.0, 2.0] };
        let mut single = vec![0.0; lattice.voxels()];
        single[13] = 1.0;
        let varied: Vec<f64> = (0..lattice.voxels()).map(|i| (i as f64 * 2.3).cos()).collect();
        for tau in [0.0, 0.3, 1.1] {
            let view = View { azimuth: 33.0, elevation: -21.0, roll: 40.0, scale: 3.0, sigma: 0.9, tau, ..FRONT };
            for values in [&single, &varied] {
                let image = images(&lattice, &view, values, None);
                for (a, b) in [(7, 8), (5, 10), (12, 3)] {
                    let expected = integral_along_the_ray(&lattice, &view, values, a, b);
                    let found = image.emission[pixel(&view, 0, a, b)];
                    assert!((found - expected).abs() < 1e-9, "tau {tau}: {found} {expected}");
                }
            }
        }
    }

    #[test]
    fn image_is_the_weights_times_the_values() {
        let lattice = Lattice { dims: [3, 3, 2], spacing: [1.0; 3], origin: [0.0; 3] };
        let values: Vec<f64> = (0..2 * lattice.voxels()).map(|i| (i as f64).sin()).collect();
        let view = View { azimuth: 70.0, elevation: 10.0, tau: 0.2, ..FRONT };
        let image = images(&lattice, &view, &values, None);
        let w = weights(&lattice, &view, 9, 7);
        let expected: f64 = (0..18).map(|i| w[i] * values[18 + i]).sum();
        assert!((image.emission[pixel(&view, 1, 9, 7)] - expected).abs() < 1e-12);
        assert!((image.weight[pixel(&view, 1, 9, 7)] - w.iter().sum::<f64>()).abs() < 1e-12);
    }

    #[test]
    fn missing_samples_are_absent_from_emission_and_weight() {
        // Three frames: nothing missing, the half x >= 2 missing, everything missing. Missing values are NaN.
        let lattice = Lattice { dims: [4, 3, 3], spacing: [1.0; 3], origin: [0.0; 3] };
        let voxels = lattice.voxels();
        let mut values = vec![3.0; 3 * voxels];
        let mut missing = vec![false; 3 * voxels];
        for i in 0..voxels {
            missing[voxels + i] = i % 4 >= 2;
            missing[2 * voxels + i] = true;
        }
        for i in 0..3 * voxels {
            if missing[i] {
                values[i] = f64::NAN;
            }
        }
        let view = View { width: 48, ..FRONT };
        let image = images(&lattice, &view, &values, Some(&missing));
        for b in 0..view.height {
            for a in 0..view.width {
                let w = weights(&lattice, &view, a, b);
                let present: f64 = (0..voxels).filter(|i| i % 4 < 2).map(|i| w[i]).sum();
                let at = pixel(&view, 1, a, b);
                assert!((image.weight[at] - present).abs() < 1e-12);
                assert!((image.emission[at] - 3.0 * present).abs() < 1e-12);
                assert_eq!(image.mean[at].is_nan(), present < 0.01 * image.largest_weight);
                let nothing = pixel(&view, 2, a, b);
                assert!(image.weight[nothing] == 0.0 && image.emission[nothing] == 0.0 && image.mean[nothing].is_nan());
            }
        }
        let whole = images(&lattice, &view, &vec![3.0; voxels], None);
        assert_eq!(whole.largest_weight, image.largest_weight);
        assert_eq!(whole.emission[..], image.emission[..48 * 16]);
    }
}
