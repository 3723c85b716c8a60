//! Pictures against brute force: the field of the kernels, sampled along the ray of every pixel at small steps.

use crate::base::error::Result;
use crate::base::grid::{Grid, Region};
use crate::base::progress::Silent;
use crate::base::sample::{SampleType, store};
use crate::colour::TransferFunction;
use crate::render::{FrameScene, Light, Mode, Plane, RenderConfig, RenderReport, Rendered, Surface, render};
use crate::source::ArraySource;
use crate::view::camera::{Camera, View};

/// A volume in one view.
#[derive(Clone)]
struct Case {
    grid: Grid,
    values: Vec<f64>,
    view: View,
    region: Option<Region>,
    sigma: f64,
}

fn grid(dims: [usize; 3]) -> Grid {
    Grid { dims, spacing: [1.0; 3], origin: [3.0, -2.0, 10.0] }
}

/// A smooth field between about 0 and 1.
fn smooth(grid: &Grid) -> Vec<f64> {
    let value = |[x, y, z]: [usize; 3]| {
        let [x, y, z] = [x as f64, y as f64, z as f64];
        0.5 + 0.25 * (0.5 * x + 0.3 * y).sin() + 0.2 * (0.45 * z - 0.35 * y + 1.0).cos()
    };
    grid.whole().iter().map(value).collect()
}

fn view(azimuth: f64, elevation: f64, roll: f64) -> View {
    View { roll, size: [40, 36], ..View::new(azimuth, elevation) }
}

fn case(dims: [usize; 3], view: View) -> Case {
    let grid = grid(dims);
    Case { values: smooth(&grid), view, region: None, sigma: 0.75, grid }
}

const TOP: f64 = 0.3;

fn transfer() -> TransferFunction {
    let viridis = TransferFunction::open("viridis").expect("a map");
    viridis.with_opacity(&[(0.0, 0.0), (1.0, TOP)]).expect("points").over((0.1, 1.0)).expect("a range")
}

fn composite(slices: Option<usize>) -> Mode {
    Mode::Composite { transfer: transfer(), unit: None, slices, light: None, planes: Vec::new() }
}

impl Case {
    fn config(&self, scene: &FrameScene, mode: Mode) -> RenderConfig {
        let mut config = RenderConfig { mode, region: self.region, ..RenderConfig::new(scene, self.view) };
        config.kernel.sigma = self.sigma;
        config
    }

    fn scene(&self) -> FrameScene {
        let mut bytes = vec![0; self.values.len() * 8];
        store(SampleType::F64, &self.values, &mut bytes);
        let source = ArraySource::new(self.grid, SampleType::F64, bytes).expect("whole frames");
        FrameScene::new(Box::new(source), None)
    }

    fn picture(&self, mode: Mode) -> Vec<f32> {
        self.rendered(mode).0
    }

    fn rendered(&self, mode: Mode) -> (Vec<f32>, RenderReport) {
        let mut scene = self.scene();
        let config = self.config(&scene, mode);
        let mut found = Vec::new();
        let mut take = |rendered: Rendered<'_>| -> Result<()> {
            found.extend_from_slice(rendered.picture);
            Ok(())
        };
        let report = render(&mut scene, &config, &Silent, &mut take).expect("a picture");
        (found, report)
    }

    /// For each pixel, the density and the mean at every step along its ray, front to back.
    fn rays(&self, step: f64, least: f64) -> Vec<Vec<(f64, f64)>> {
        let camera = Camera::new(&self.view, &self.grid).expect("a view");
        let clip = self.region.unwrap_or(self.grid.whole());
        let voxels: Vec<([f64; 3], f64)> = clip
            .iter()
            .map(|voxel| (camera.project(self.grid.position(voxel)), self.values[self.grid.whole().index(voxel)]))
            .filter(|(_, value)| !value.is_nan())
            .collect();
        let cell: f64 = self.grid.spacing.iter().product();
        let peak = cell / ((2.0 * std::f64::consts::PI).sqrt() * self.sigma).powi(3);
        let ends = voxels.iter().fold([f64::MAX, f64::MIN], |e, (p, _)| [e[0].min(p[2]), e[1].max(p[2])]);
        let count = ((ends[1] - ends[0] + 8.0 * self.sigma) / step).ceil() as usize;
        let gauss = |off: f64| (-0.5 * (off / self.sigma).powi(2)).exp();
        let of_pixel = |pixel: usize| {
            let at = [pixel % self.view.size[0], pixel / self.view.size[0]].map(|n| n as f64 + 0.5);
            let mut sums = vec![(0.0, 0.0); count];
            for (p, value) in &voxels {
                let across = peak * gauss((p[0] - at[0]).hypot(p[1] - at[1]) / camera.scale);
                let first = ((p[2] - ends[0]) / step) as usize; // kernels reach 4 sigma to both sides
                let last = (first as f64 + 8.0 * self.sigma / step).ceil() as usize + 1;
                for n in (first..last.min(count)).filter(|_| across > 1e-9 * peak) {
                    let weight = across * gauss(ends[0] - 4.0 * self.sigma + (n as f64 + 0.5) * step - p[2]);
                    sums[n] = (sums[n].0 + weight, sums[n].1 + weight * value);
                }
            }
            sums.into_iter().filter(|(density, _)| *density > least).map(|(d, sum)| (d, sum / d)).collect()
        };
        (0..self.view.size.iter().product()).map(of_pixel).collect()
    }

    /// Light and opacity of every pixel.
    fn light(&self) -> Vec<f64> {
        let (step, transfer) = (self.grid.spacing.iter().copied().fold(f64::MAX, f64::min) / 8.0, transfer());
        let unit = self.grid.largest_spacing();
        let pixel = |ray: &Vec<(f64, f64)>| {
            let (mut light, mut through) = ([0.0; 3], 1.0);
            for (density, mean) in ray {
                let passed = (1.0 - transfer.opacity(*mean)).powf(density * step / unit);
                let colour = transfer.colour(*mean).expect("a colour");
                light.iter_mut().zip(colour).for_each(|(sum, c)| *sum += through * (1.0 - passed) * c);
                through *= passed;
            }
            [light[0], light[1], light[2], 1.0 - through]
        };
        self.rays(step, 1e-6).iter().flat_map(pixel).collect()
    }

    /// The largest value of every pixel; NaN without any.
    fn largest(&self, least: f64) -> Vec<f64> {
        let pixel = |ray: &Vec<(f64, f64)>| ray.iter().map(|(_, mean)| *mean).fold(f64::NAN, f64::max);
        self.rays(0.125, least).iter().map(pixel).collect()
    }

    /// Asserts that a composite is within a root mean square and a largest difference of brute force.
    fn check(&self, name: &str, (rms, most): (f64, f64)) {
        let (found, expected) = (self.picture(composite(None)), self.light());
        let off: Vec<f64> = found.iter().zip(&expected).map(|(f, e)| (f64::from(*f) - e).abs()).collect();
        assert!(expected.iter().any(|e| *e > 0.2) && found.len() == expected.len());
        let (found_rms, largest) = errors(&off);
        assert!(found_rms < rms && largest < most, "{name}: rms {found_rms:e}, largest {largest:e}");
    }
}

fn errors(off: &[f64]) -> (f64, f64) {
    let squares: f64 = off.iter().map(|off| off * off).sum();
    ((squares / off.len() as f64).sqrt(), off.iter().copied().fold(0.0, f64::max))
}

/// Each principal axis, from both ends.
fn views() -> Vec<View> {
    let angles =
        [(30.0, 25.0, 0.0), (200.0, -20.0, 40.0), (75.0, 15.0, -30.0), (-100.0, 20.0, 0.0), (20.0, 70.0, 10.0)];
    let angles = angles.into_iter().chain([(50.0, -65.0, 0.0), (0.0, 0.0, 0.0), (90.0, 0.0, 0.0), (0.0, 90.0, 90.0)]);
    angles.map(|(azimuth, elevation, roll)| view(azimuth, elevation, roll)).collect()
}

#[test]
fn composites_are_those_of_brute_force_along_every_axis() {
    for view in views() {
        let name = format!("{} {} {}", view.azimuth, view.elevation, view.roll);
        // Where rays run along faces, the lattice of cells shows at the silhouette.
        let along_faces = view.azimuth % 90.0 == 0.0 && view.elevation % 90.0 == 0.0;
        case([18, 15, 13], view).check(&name, if along_faces { (2e-3, 1e-2) } else { (5e-4, 6e-3) });
    }
}

#[test]
fn composites_of_long_voxels_are_those_of_brute_force() {
    for view in views() {
        let mut case = case([14, 15, 11], view);
        (case.grid.spacing, case.sigma) = ([1.0, 0.6, 1.4], 0.75 * 1.4);
        case.check(&format!("{} {} {}", view.azimuth, view.elevation, view.roll), (5e-4, 6e-3));
    }
}

#[test]
fn composites_of_parts_holes_and_thin_volumes_are_those_of_brute_force() {
    let region = Some(Region { start: [3, 2, 1], end: [17, 9, 12] });
    for view in [view(30.0, 25.0, 0.0), view(75.0, 15.0, 0.0), view(20.0, -70.0, 0.0)] {
        let whole = case([18, 15, 13], view);
        Case { region, ..whole.clone() }.check("region", (5e-4, 6e-3));
        let mut holes = whole.clone();
        let hole = |p: [usize; 3]| (0..3).map(|a| (p[a] as f64 - 7.0).powi(2)).sum::<f64>() < 16.0;
        let voxels = holes.grid.whole().iter();
        holes.values.iter_mut().zip(voxels).filter(|(_, p)| hole(*p)).for_each(|(value, _)| *value = f64::NAN);
        holes.check("hole", (8e-4, 1e-2));
        for dims in [[1, 15, 13], [18, 1, 13], [18, 15, 1], [2, 3, 2]] {
            case(dims, view).check(&format!("{dims:?}"), (5e-4, 6e-3));
        }
    }
}

#[test]
fn finer_slices_and_cells_come_nearer_to_brute_force() {
    let case = case([18, 15, 13], view(30.0, 25.0, 20.0));
    let expected = case.light();
    let error = |slices| {
        let found = case.picture(composite(Some(slices)));
        errors(&found.iter().zip(&expected).map(|(f, e)| (f64::from(*f) - e).abs()).collect::<Vec<_>>())
    };
    let found = [1, 2, 4].map(error);
    assert!(found.windows(2).all(|pair| pair[1].0 < 0.6 * pair[0].0 && pair[1].1 < pair[0].1), "{found:?}");
}

#[test]
fn offsets_of_a_million_change_nothing_but_the_last_digits() {
    let case = case([18, 15, 13], view(30.0, 25.0, 0.0));
    let plain = case.picture(composite(None));
    let far = Case { values: case.values.iter().map(|v| v + 1e6).collect(), ..case.clone() };
    let over = transfer().over((1e6 + 0.1, 1e6 + 1.0)).expect("a range");
    let moved =
        far.picture(Mode::Composite { transfer: over, unit: None, slices: None, light: None, planes: Vec::new() });
    let off: Vec<f64> = plain.iter().zip(&moved).map(|(a, b)| f64::from((a - b).abs())).collect();
    assert!(errors(&off).1 < 1e-5, "{:?}", errors(&off));
    let [near, far] = [&case, &far].map(|case| case.picture(Mode::Mip { slices: None }));
    for (near, far) in near.iter().zip(&far).filter(|(near, far)| !near.is_nan() || !far.is_nan()) {
        assert!((f64::from(*far) - 1e6 - f64::from(*near)).abs() < 0.04, "{near} {far}: half a digit of an f32");
    }
}

/// Where hardly any sample supports a value, the largest depends on where exactly the kernel is cut.
#[test]
fn the_largest_value_is_that_of_brute_force() {
    for view in views() {
        let mut case = case([18, 15, 13], view);
        case.values.iter_mut().for_each(|value| *value -= 0.8);
        let found = case.picture(Mode::Mip { slices: None });
        let [low, expected, high] = [0.003, 0.01, 0.03].map(|least| case.largest(least));
        let is_sure = |n: &usize| (high[*n] - low[*n]).abs() < 1e-3;
        let off: Vec<f64> =
            (0..found.len()).filter(is_sure).map(|n| (f64::from(found[n]) - expected[n]).abs()).collect();
        let ((rms, most), sure) = (errors(&off), off.len());
        let shown = found.iter().filter(|value| !value.is_nan()).count();
        let wrong = found
            .iter()
            .zip(low.iter().zip(&high))
            .filter(|(f, (l, h))| (f.is_nan() && !h.is_nan()) || (!f.is_nan() && l.is_nan()));
        let name = format!("{} {} {}", view.azimuth, view.elevation, view.roll);
        assert!(rms < 6e-3 && most < 5e-2, "{name}: rms {rms:e}, largest {most:e}");
        assert!(sure > shown / 3 && shown > found.len() / 4 && wrong.count() == 0, "{name}: {sure} of {shown}");
    }
}

#[test]
fn probed_rays_tell_the_errors_of_the_picture() {
    let mut case = case([18, 15, 13], view(30.0, 25.0, 20.0));
    case.view.size = [90, 80];
    let expected = case.light();
    for slices in [1, 2, 4] {
        let (found, report) = case.rendered(composite(Some(slices)));
        let probed = report.views[0].probed.expect("rays that meet the volume");
        let off: Vec<f64> = found.iter().zip(&expected).map(|(f, e)| (f64::from(*f) - e).abs()).collect();
        let of_pixel = off.chunks_exact(4).map(|pixel| pixel.iter().copied().fold(0.0, f64::max));
        let shown = of_pixel.zip(expected.chunks_exact(4)).filter(|(_, light)| light[3] > 0.0).map(|(off, _)| off);
        let (rms, largest) = errors(&shown.collect::<Vec<_>>());
        assert!(probed.rays > 10 && probed.rms > rms / 4.0 && probed.rms < 4.0 * rms && probed.largest < 2.0 * largest);
    }
    let table = report_of_a_step();
    assert!(table > 1e-3, "{table}");
}

/// The stated error of a table of a sudden step.
fn report_of_a_step() -> f64 {
    let case = case([5, 4, 3], view(30.0, 25.0, 0.0));
    let step = transfer().with_opacity(&[(0.5, 0.0), (0.5001, 1.0)]).expect("points");
    let (_, report) =
        case.rendered(Mode::Composite { transfer: step, unit: None, slices: None, light: None, planes: Vec::new() });
    report.views[0].table_error.expect("a table")
}

/// A lamp unlike the default, so that its angles matter.
const LAMP: Light = Light { azimuth: 35.0, elevation: 20.0, ambient: 0.3, diffuse: 0.6, specular: 0.4 };

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
                let now = (density > 0.01).then_some(mean);
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
        assert!(expected.iter().filter(|e| **e > 0.2).count() > off.len() / 8, "view {n} shows surfaces");
        assert!(of_share(0.5) < 2e-3 && of_share(0.85) < 3e-2, "view {n}: {:e}, {:e}", of_share(0.5), of_share(0.85));
    }
}

/// Rays end at planes, which have the colours of interpolated samples.
#[test]
fn planes_in_composites_are_those_of_brute_force() {
    const STEP: f64 = 1.0 / 16.0;
    let planes = vec![Plane { axis: 0, at: 6.0 }, Plane { axis: 2, at: 3.5 }];
    for (n, view) in views().into_iter().enumerate().filter(|(n, _)| n % 3 == 0) {
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

/// The same bits for any number of threads.
#[test]
fn threads_change_no_bit_of_a_composite() {
    let mut case = case([40, 47, 13], view(75.0, 15.0, 20.0));
    case.values[1000..1100].fill(f64::NAN);
    let shaded =
        Mode::Composite { transfer: transfer(), unit: None, slices: None, light: Some(LAMP), planes: Vec::new() };
    let surface = Surface { value: 0.5, colour: [1.0; 3], opacity: 0.5 };
    let iso = Mode::Iso { surfaces: vec![surface], light: LAMP, slices: None };
    for mode in [composite(None), Mode::Mip { slices: None }, shaded, iso] {
        let by = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
            let bits: Vec<u32> = pool.install(|| case.picture(mode.clone())).into_iter().map(f32::to_bits).collect();
            bits
        };
        assert!(by(1) == by(2) && by(1) == by(5));
    }
}
