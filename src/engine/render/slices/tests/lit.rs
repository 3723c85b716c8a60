//! Shaded composites, surfaces, and planes in composites, against brute force in world coordinates.

use super::*;
use crate::render::{Light, Plane};

/// A lamp unlike the default, so that its angles matter.
pub(super) const LAMP: Light = Light { azimuth: 35.0, elevation: 20.0, ambient: 0.3, diffuse: 0.6, specular: 0.4 };

/// The field and its gradient along the ray of every pixel, by sums over voxels in world coordinates.
struct World<'a> {
    case: &'a Case,
    voxels: Vec<([f64; 3], f64)>,
    /// Unit vectors to the right, up, and to the viewer.
    axes: [[f64; 3]; 3],
    camera: Camera,
}

impl World<'_> {
    fn new(case: &Case) -> World<'_> {
        let camera = Camera::new(&case.view, &case.grid).expect("a view");
        let voxels = case.grid.whole().iter().zip(&case.values).map(|(voxel, v)| (case.grid.position(voxel), *v));
        let axes =
            [[90.0, 0.0], [0.0, 90.0], [0.0, 0.0]].map(|[azimuth, elevation]| camera.towards(azimuth, elevation));
        World { case, voxels: voxels.filter(|(_, value)| !value.is_nan()).collect(), axes, camera }
    }

    /// The density and the mean at a point.
    fn field(&self, at: [f64; 3]) -> (f64, f64) {
        let sigma = self.case.sigma;
        let cell: f64 = self.case.grid.spacing.iter().product();
        let peak = cell / ((2.0 * std::f64::consts::PI).sqrt() * sigma).powi(3);
        let square = |p: &[f64; 3]| (0..3).map(|i| (p[i] - at[i]).powi(2)).sum::<f64>() / (sigma * sigma);
        let near = self.voxels.iter().map(|(p, value)| (square(p), value)).filter(|(square, _)| *square < 36.0);
        let (density, sum) = near.fold((0.0, 0.0), |(density, sum), (square, value)| {
            let weight = peak * (-0.5 * square).exp();
            (density + weight, sum + weight * value)
        });
        (density, sum / density)
    }

    fn gradient(&self, at: [f64; 3]) -> [f64; 3] {
        const STEP: f64 = 1e-4;
        let moved = |axis: usize, by: f64| std::array::from_fn(|i| at[i] + if i == axis { by } else { 0.0 });
        [0, 1, 2].map(|axis| (self.field(moved(axis, STEP)).1 - self.field(moved(axis, -STEP)).1) / (2.0 * STEP))
    }

    /// The points along the ray of a pixel, front to back.
    fn ray(&self, pixel: usize, step: f64) -> Vec<[f64; 3]> {
        let [width, height] = self.case.view.size;
        let x = (pixel % width) as f64 + 0.5 - width as f64 / 2.0;
        let y = height as f64 / 2.0 - (pixel / width) as f64 - 0.5;
        let middle = self.camera.beside(0.0);
        let count = (60.0 / step) as i32;
        let point = |n: i32| {
            let z = (0.5 * f64::from(count) - f64::from(n)) * step;
            let [right, up, viewer] = self.axes;
            std::array::from_fn(|i| middle[i] + (x * right[i] + y * up[i]) / self.camera.scale + z * viewer[i])
        };
        (0..count).map(point).collect()
    }

    /// A colour in the light of the lamp: eq 42. `share` is how much light counts.
    fn lit(&self, colour: [f64; 3], gradient: [f64; 3], share: f64) -> [f64; 3] {
        let [right, up, viewer] = self.axes;
        let (a, e) = (LAMP.azimuth.to_radians(), LAMP.elevation.to_radians());
        let lamp: [f64; 3] =
            std::array::from_fn(|i| a.sin() * e.cos() * right[i] + e.sin() * up[i] + a.cos() * e.cos() * viewer[i]);
        let unit = |v: [f64; 3]| v.map(|n| n / v.iter().map(|n| n * n).sum::<f64>().sqrt());
        let dot = |a: [f64; 3], b: [f64; 3]| (0..3).map(|i| a[i] * b[i]).sum::<f64>();
        let normal = unit(gradient);
        let normal = if dot(normal, viewer) < 0.0 { normal.map(|n| -n) } else { normal };
        let middle = unit(std::array::from_fn(|i| lamp[i] + viewer[i]));
        let shade = LAMP.ambient + LAMP.diffuse * dot(normal, lamp).max(0.0);
        let gloss = LAMP.specular * dot(normal, middle).max(0.0).powi(32);
        colour.map(|c| c * (1.0 + share * (shade - 1.0)) + share * gloss)
    }
}

#[test]
fn shaded_composites_are_those_of_brute_force() {
    const STEP: f64 = 0.25;
    for (n, view) in views().into_iter().enumerate().filter(|(n, _)| n % 2 == 0) {
        let mut case = case([12, 11, 9], View { size: [22, 20], ..view });
        case.grid.spacing = if n == 2 { [1.0, 0.7, 1.3] } else { [1.0; 3] };
        case.sigma = 0.75 * case.grid.largest_spacing();
        case.values[300..303].fill(f64::NAN);
        let (world, transfer, unit) = (World::new(&case), transfer(), case.grid.largest_spacing());
        let faint = 0.01 * 0.9 / (8.0 * unit); // 0.9 is the length of the range
        let pixel = |pixel: usize| {
            let (mut light, mut through) = ([0.0; 3], 1.0);
            for at in world.ray(pixel, STEP) {
                let (density, mean) = world.field(at);
                if density > 1e-3 {
                    let (gradient, passed) =
                        (world.gradient(at), (1.0 - transfer.opacity(mean)).powf(density * STEP / unit));
                    let square: f64 = gradient.iter().map(|n| n * n).sum();
                    let colour = transfer.colour(mean).expect("a colour");
                    let lit = world.lit(colour, gradient, square / (square + faint * faint));
                    light.iter_mut().zip(lit).for_each(|(sum, c)| *sum += through * (1.0 - passed) * c);
                    through *= passed;
                }
            }
            [light[0].min(1.0), light[1].min(1.0), light[2].min(1.0), 1.0 - through]
        };
        let mode = Mode::Composite {
            transfer: transfer.clone(),
            unit: None,
            slices: Some(3),
            light: Some(LAMP),
            planes: Vec::new(),
        };
        let (found, report) = case.rendered(mode);
        let expected: Vec<f64> = (0..22 * 20).flat_map(pixel).collect();
        let off: Vec<f64> = found.iter().zip(&expected).map(|(f, e)| (f64::from(*f) - e).abs()).collect();
        let (rms, most) = errors(&off);
        assert!(rms < 4e-3 && most < 5e-2, "view {n}: rms {rms:e}, largest {most:e}");
        assert!(report.views[0].probed.is_some_and(|probed| probed.rms < 1e-2), "view {n}: {report:?}");
        let (plain, _) = case.rendered(composite(Some(3)));
        let apart: Vec<f64> = plain.iter().zip(&found).map(|(a, b)| f64::from((a - b).abs())).collect();
        assert!(errors(&apart).0 > 5.0 * rms, "light shows");
    }
}

/// Whether a point is in the box of the volume: at most half a voxel beyond the outermost ones.
pub(super) fn is_inside(grid: &Grid, at: [f64; 3]) -> bool {
    (0..3).all(|a| {
        let voxel = (at[a] - grid.origin[a]) / grid.spacing[a];
        (-0.5..grid.dims[a] as f64 - 0.5).contains(&voxel)
    })
}

#[test]
fn isosurfaces_are_those_of_brute_force() {
    const STEP: f64 = 1.0 / 16.0;
    let surfaces = vec![
        Surface { value: 0.75, colour: [0.9, 0.3, 0.2], opacity: 1.0 },
        Surface { value: 0.55, colour: [0.2, 0.5, 0.9], opacity: 0.4 },
    ];
    for (n, view) in views().into_iter().enumerate().filter(|(n, _)| n % 3 == 0) {
        let mut case = case([12, 11, 9], View { size: [36, 32], ..view });
        case.grid.spacing = if n == 3 { [1.0, 0.7, 1.3] } else { [1.0; 3] };
        case.sigma = 0.75 * case.grid.largest_spacing();
        let world = World::new(&case);
        let pixel = |pixel: usize| {
            let (mut light, mut through, mut before) = ([0.0; 3], 1.0, None);
            for at in world.ray(pixel, STEP) {
                let (density, mean) = world.field(at);
                let now = (density > 0.01 && is_inside(&case.grid, at)).then_some(mean);
                if let (Some(a), Some(b)) = (before, now) {
                    let mut met: Vec<&Surface> = surfaces.iter().filter(|s| (a < s.value) != (b < s.value)).collect();
                    met.sort_by(|s, t| f64::abs(s.value - a).total_cmp(&f64::abs(t.value - a)));
                    for surface in met {
                        let lit = world.lit(surface.colour, world.gradient(at), 1.0);
                        (0..3).for_each(|c| light[c] += through * surface.opacity * lit[c].min(1.0));
                        through *= 1.0 - surface.opacity;
                    }
                }
                before = now;
            }
            [light[0], light[1], light[2], 1.0 - through]
        };
        let mode = Mode::Iso { surfaces: surfaces.clone(), light: LAMP, slices: None };
        let (found, _) = case.rendered(mode);
        let expected: Vec<f64> = (0..36 * 32).flat_map(pixel).collect();
        let mut off: Vec<f64> = found.iter().zip(&expected).map(|(f, e)| (f64::from(*f) - e).abs()).collect();
        off.sort_by(f64::total_cmp);
        let of_share = |share: f64| off[(share * off.len() as f64) as usize];
        let shown = expected.chunks(4).filter(|pixel| pixel[3] > 0.2).count();
        assert!(shown > 36 * 32 / 8, "view {n} shows surfaces at {shown} pixels");
        assert!(of_share(0.5) < 2e-3 && of_share(0.85) < 3e-2, "view {n}: {:e}, {:e}", of_share(0.5), of_share(0.85));
    }
}

/// Rays end at planes, which have the colours of interpolated samples.
#[test]
fn planes_in_composites_are_those_of_brute_force() {
    const STEP: f64 = 1.0 / 16.0;
    let planes = vec![Plane { axis: 0, at: 6.0 }, Plane { axis: 2, at: 3.5 }];
    for (n, view) in views().into_iter().enumerate().filter(|(n, _)| [0, 3, 4].contains(n)) {
        let case = case([12, 11, 9], View { size: [24, 22], ..view });
        let (world, transfer, grid) = (World::new(&case), transfer(), &case.grid);
        let voxel = |at: [f64; 3]| -> [f64; 3] { std::array::from_fn(|i| (at[i] - grid.origin[i]) / grid.spacing[i]) };
        let value = |at: [f64; 3]| {
            let near = |[x, y, z]: [usize; 3]| {
                (1.0 - (at[0] - x as f64).abs()).max(0.0)
                    * (1.0 - (at[1] - y as f64).abs()).max(0.0)
                    * (1.0 - (at[2] - z as f64).abs()).max(0.0)
            };
            grid.whole().iter().zip(&case.values).map(|(voxel, value)| near(voxel) * value).sum::<f64>()
        };
        let pixel = |pixel: usize| {
            let (mut light, mut through, mut before) = ([0.0; 3], 1.0, None::<[f64; 3]>);
            for at in world.ray(pixel, STEP) {
                let now = voxel(at);
                let crosses =
                    |plane: &&Plane| before.is_some_and(|b| (b[plane.axis] < plane.at) != (now[plane.axis] < plane.at));
                let inside = (0..3).all(|a| now[a] > 0.0 && now[a] < (grid.dims[a] - 1) as f64);
                if let Some(plane) = planes.iter().find(crosses).filter(|_| inside) {
                    let mut place = now;
                    place[plane.axis] = plane.at;
                    let colour = transfer.colour(value(place)).expect("a colour");
                    (0..3).for_each(|c| light[c] += through * colour[c]);
                    return [light[0], light[1], light[2], 1.0];
                }
                let (density, mean) = world.field(at);
                if density > 1e-3 {
                    let passed = (1.0 - transfer.opacity(mean)).powf(density * STEP);
                    let colour = transfer.colour(mean).expect("a colour");
                    (0..3).for_each(|c| light[c] += through * (1.0 - passed) * colour[c]);
                    through *= passed;
                }
                before = Some(now);
            }
            [light[0], light[1], light[2], 1.0 - through]
        };
        let mode = Mode::Composite {
            transfer: transfer.clone(),
            unit: None,
            slices: Some(3),
            light: None,
            planes: planes.clone(),
        };
        let found = case.picture(mode);
        let expected: Vec<f64> = (0..24 * 22).flat_map(pixel).collect();
        let mut off: Vec<f64> = found.iter().zip(&expected).map(|(f, e)| (f64::from(*f) - e).abs()).collect();
        off.sort_by(f64::total_cmp);
        let of_share = |share: f64| off[(share * off.len() as f64) as usize];
        assert!(expected.chunks(4).filter(|p| p[3] == 1.0).count() > 24 * 22 / 8, "view {n} shows planes");
        assert!(of_share(0.5) < 2e-3 && of_share(0.85) < 2e-2, "view {n}: {:e}, {:e}", of_share(0.5), of_share(0.85));
    }
}

/// A surface is drawn wherever blocks and bricks begin, and whatever is skipped.
#[test]
fn isosurfaces_have_no_holes() {
    let grid = grid([50, 47, 40]);
    let ball = |[x, y, z]: [usize; 3]| {
        ((x as f64 - 24.0).powi(2) + (y as f64 - 23.0).powi(2) + (z as f64 - 20.0).powi(2)).sqrt()
    };
    for value in [3.4, 9.7, 15.2, 18.0] {
        let surfaces = vec![Surface { value, colour: [1.0; 3], opacity: 1.0 }];
        for view in views() {
            let case = Case { values: grid.whole().iter().map(ball).collect(), view, region: None, sigma: 0.75, grid };
            let found = case.picture(Mode::Iso { surfaces: surfaces.clone(), light: LAMP, slices: None });
            let camera = Camera::new(&view, &grid).expect("a view");
            let [x, y, _] = camera.project(grid.position([24, 23, 20]));
            for (pixel, light) in found.chunks_exact(4).enumerate() {
                let at = [(pixel % view.size[0]) as f64 + 0.5 - x, (pixel / view.size[0]) as f64 + 0.5 - y];
                let away = at[0].hypot(at[1]) / camera.scale;
                let expected = if away < value { 1.0 } else { 0.0 };
                // Pixels are interpolated from cells up to two voxels away.
                assert!(
                    (away - value).abs() < 2.5 || (light[3] - expected).abs() < 1e-3,
                    "{value}: {light:?} at {away}"
                );
            }
        }
    }
}
