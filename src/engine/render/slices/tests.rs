//! Pictures against brute force: the field of the kernels, sampled along the ray of every pixel at small steps.

use super::view::SlicedView;
use crate::render::{FrameScene, Mode, Plane, RenderConfig, RenderReport, Rendered, Surface, render};
use lit::LAMP;
use wavesplat_core::base::error::Result;
use wavesplat_core::base::grid::{Grid, Region};
use wavesplat_core::base::progress::Silent;
use wavesplat_core::base::sample::{SampleType, store};
use wavesplat_core::colour::TransferFunction;
use wavesplat_core::source::ArraySource;
use wavesplat_core::view::camera::{Camera, View};

mod edges;
mod lit;

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

fn composite_of(transfer: TransferFunction) -> Mode {
    Mode::Composite { transfer, unit: None, slices: None, light: None, planes: Vec::new() }
}

impl Case {
    fn config(&self, scene: &FrameScene, mode: Mode) -> RenderConfig {
        let mut config = RenderConfig { mode, region: self.region, ..RenderConfig::new(scene, self.view) };
        (config.kernel.sigma, config.kernel.follows_axes) = (self.sigma, false);
        config
    }

    fn scene(&self) -> FrameScene {
        let mut bytes = vec![0; self.values.len() * 8];
        store(SampleType::F64, &self.values, &mut bytes);
        let source = ArraySource::new(self.grid, SampleType::F64, bytes).expect("whole frames");
        FrameScene::new(Box::new(source), None)
    }

    /// The density and the mean at a point, for a kernel of 0.75 spacings along each axis.
    fn mean(&self, at: [f64; 3]) -> (f64, f64) {
        let (mut density, mut sum) = (0.0, 0.0);
        for (voxel, value) in self.grid.whole().iter().zip(&self.values).filter(|(_, value)| !value.is_nan()) {
            let position = self.grid.position(voxel);
            let off = |a: usize| (at[a] - position[a]) / (0.75 * self.grid.spacing[a]);
            let weight = (0..3).map(|a| (-0.5 * off(a) * off(a)).exp()).product::<f64>();
            density += weight / ((2.0 * std::f64::consts::PI).sqrt() * 0.75).powi(3);
            sum += weight * value / ((2.0 * std::f64::consts::PI).sqrt() * 0.75).powi(3);
        }
        (density, sum / density)
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

    /// For each pixel, the density and the mean at every step along its ray, front to back, up to a depth and to some voxels
    /// beyond the box.
    fn rays_up_to(&self, step: f64, least: f64, end: f64, beyond: f64) -> Vec<Vec<(f64, f64)>> {
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
        let behind = ends[1] + 4.0 * self.sigma;
        let count = ((behind.min(end) - ends[0] + 4.0 * self.sigma) / step).round() as usize;
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
            let (from, along) = camera.ray(at);
            let is_within = |n: usize| {
                let depth = ends[0] - 4.0 * self.sigma + (n as f64 + 0.5) * step;
                let place = |a: usize| (from[a] + depth * along[a] - self.grid.origin[a]) / self.grid.spacing[a];
                let first = |a: usize| clip.start[a] as f64 - 0.5 - beyond;
                (0..3).all(|a| (first(a)..=clip.end[a] as f64 - 0.5 + beyond).contains(&place(a)))
            };
            let met = sums.into_iter().enumerate().filter(|(n, (density, _))| *density > least && is_within(*n));
            met.map(|(_, (d, sum))| (d, sum / d)).collect()
        };
        (0..self.view.size.iter().product()).map(of_pixel).collect()
    }

    /// Light and opacity of every pixel.
    fn light(&self) -> Vec<f64> {
        self.light_of(&transfer())
    }

    fn light_of(&self, transfer: &TransferFunction) -> Vec<f64> {
        self.light_up_to(transfer, f64::INFINITY)
    }

    /// The same in front of a depth.
    fn light_up_to(&self, transfer: &TransferFunction, end: f64) -> Vec<f64> {
        let step = self.grid.spacing.iter().copied().fold(f64::MAX, f64::min) / 8.0;
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
        self.rays_up_to(step, 1e-6, end, f64::INFINITY).iter().flat_map(pixel).collect()
    }

    /// The largest value of every pixel up to some voxels beyond the box; NaN without any.
    fn largest(&self, beyond: f64) -> Vec<f64> {
        let pixel = |ray: &Vec<(f64, f64)>| ray.iter().map(|(_, mean)| *mean).fold(f64::NAN, f64::max);
        self.rays_up_to(0.125, 0.01, f64::INFINITY, beyond).iter().map(pixel).collect()
    }

    /// Asserts that a composite is within a root mean square and a largest difference of brute force.
    fn check(&self, name: &str, rms: f64, most: f64) {
        self.check_of(transfer(), name, rms, most);
    }

    fn check_of(&self, transfer: TransferFunction, name: &str, rms: f64, most: f64) {
        let expected = self.light_of(&transfer);
        let found = self.picture(composite_of(transfer));
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
        let (rms, most) = if along_faces { (2e-3, 1e-2) } else { (5e-4, 6e-3) };
        case([18, 15, 13], view).check(&name, rms, most);
    }
}

#[test]
fn composites_of_long_voxels_are_those_of_brute_force() {
    for view in views() {
        let mut case = case([14, 15, 11], view);
        (case.grid.spacing, case.sigma) = ([1.0, 0.6, 1.4], 0.75 * 1.4);
        case.check(&format!("{} {} {}", view.azimuth, view.elevation, view.roll), 5e-4, 6e-3);
    }
}

#[test]
fn composites_of_parts_holes_and_thin_volumes_are_those_of_brute_force() {
    let region = Some(Region { start: [3, 2, 1], end: [17, 9, 12] });
    for view in [view(30.0, 25.0, 0.0), view(75.0, 15.0, 0.0), view(20.0, -70.0, 0.0)] {
        let whole = case([18, 15, 13], view);
        Case { region, ..whole.clone() }.check("region", 5e-4, 6e-3);
        let mut holes = whole.clone();
        let hole = |p: [usize; 3]| (0..3).map(|a| (p[a] as f64 - 7.0).powi(2)).sum::<f64>() < 16.0;
        let voxels = holes.grid.whole().iter();
        holes.values.iter_mut().zip(voxels).filter(|(_, p)| hole(*p)).for_each(|(value, _)| *value = f64::NAN);
        holes.check("hole", 8e-4, 1e-2);
        for dims in [[1, 15, 13], [18, 1, 13], [18, 15, 1], [2, 3, 2]] {
            case(dims, view).check(&format!("{dims:?}"), 5e-4, 6e-3);
        }
    }
}

/// Sharp opacities, for which slabs have eight slices. Where the field changes little, these count as one.
fn sharp() -> TransferFunction {
    let points = [(0.0, 0.0), (0.3, 0.02), (0.4, 0.5), (0.5, 0.02), (0.7, 0.02), (0.75, 0.4), (1.0, 0.4)];
    transfer().with_opacity(&points).expect("points")
}

#[test]
fn composites_of_sharp_opacities_are_those_of_brute_force() {
    let sharp = sharp();
    for view in views() {
        let name = format!("{} {} {}", view.azimuth, view.elevation, view.roll);
        let mut case = case([18, 15, 13], view);
        case.values.iter_mut().for_each(|value| *value = 0.5 + 0.15 * *value);
        case.check_of(sharp.clone(), &name, 1.2e-3, 2.5e-2);
        case.values[1200..1500].fill(f64::NAN);
        case.check_of(sharp.clone(), &format!("{name}, holes"), 1.2e-3, 2.5e-2);
    }
}

#[test]
fn sharp_composites_of_long_voxels_are_those_of_brute_force() {
    let check = |mut case: Case, name: &str| {
        case.values.iter_mut().for_each(|value| *value = 0.35 + 0.2 * *value);
        case.check_of(sharp(), &format!("{name} {} {}", case.view.azimuth, case.view.elevation), 2e-3, 2.5e-2);
    };
    for view in [view(40.0, 0.0, 0.0), view(0.0, 46.0, 0.0), view(44.0, 44.0, 10.0)] {
        for spacing in [[1.0, 1.0, 4.0], [5.0, 1.0, 1.0], [1.0, 3.0, 1.0]] {
            let case = case([14, 13, 11], view);
            check(Case { grid: Grid { spacing, ..case.grid }, sigma: 3.0, ..case }, &format!("{spacing:?}"));
        }
    }
    for view in [view(20.0, 46.0, 0.0), view(130.0, 50.0, 15.0)] {
        check(very_long(case([26, 23, 4], view), View { size: [20, 18], ..view }), "very long");
    }
}

/// The plane shows the values in it, which are all the same.
#[test]
fn planes_end_the_rays_of_sharp_opacities() {
    let mut case = case([18, 15, 13], View { size: [40, 36], ..View::new(0.0, 0.0) });
    let camera = Camera::new(&case.view, &case.grid).expect("a view");
    let depths: Vec<f64> = (0..3)
        .map(|axis| {
            let mut voxel = [0; 3];
            voxel[axis] = 1;
            camera.project(case.grid.position(voxel))[2] - camera.project(case.grid.position([0; 3]))[2]
        })
        .collect();
    let axis = (0..3).max_by(|a, b| depths[*a].abs().total_cmp(&depths[*b].abs())).expect("three axes");
    let voxels: Vec<[usize; 3]> = case.grid.whole().iter().collect();
    case.values = voxels.iter().map(|voxel| 0.5 + 0.3 * (0.7 * voxel[axis] as f64).sin()).collect();
    for at in [4.0, 5.0, 6.25, 7.5] {
        let plane = Plane { axis, at };
        let found = case.picture(Mode::Composite {
            transfer: sharp(),
            unit: None,
            slices: None,
            light: None,
            planes: vec![plane],
        });
        let end = camera.project(case.grid.position([0; 3]))[2] + at * depths[axis];
        let front = case.light_up_to(&sharp(), end);
        let [from, to] = [at.floor(), at.ceil()].map(|n| 0.5 + 0.3 * (0.7 * n).sin());
        let colour = sharp().colour(from + (to - from) * at.fract()).expect("a colour");
        let inside = |pixel: &usize| (12..24).contains(&(pixel / 40)) && (14..26).contains(&(pixel % 40));
        for pixel in (0..40 * 36).filter(inside) {
            for c in 0..3 {
                let expected = front[4 * pixel + c] + (1.0 - front[4 * pixel + 3]) * colour[c];
                let off = (f64::from(found[4 * pixel + c]) - expected).abs();
                assert!(off < 1e-2 && found[4 * pixel + 3] == 1.0, "{at} {pixel} {c}: {off:e}");
            }
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
    let moved = far.picture(composite_of(over));
    let off: Vec<f64> = plain.iter().zip(&moved).map(|(a, b)| f64::from((a - b).abs())).collect();
    assert!(errors(&off).1 < 1e-5, "{:?}", errors(&off));
    let [near, far] = [&case, &far].map(|case| case.picture(Mode::Mip { slices: None }));
    for (near, far) in near.iter().zip(&far).filter(|(near, far)| !near.is_nan() || !far.is_nan()) {
        assert!((f64::from(*far) - 1e6 - f64::from(*near)).abs() < 0.04, "{near} {far}: half a digit of an f32");
    }
}

/// The pictures of a scene.
fn rendered(mut scene: FrameScene, config: &RenderConfig) -> Vec<f32> {
    let mut found = Vec::new();
    let mut take = |rendered: Rendered<'_>| -> Result<()> {
        found.extend_from_slice(rendered.picture);
        Ok(())
    };
    render(&mut scene, config, &Silent, &mut take).expect("a picture");
    found
}

/// By default, the kernel is as wide in voxels along every axis.
#[test]
fn the_default_kernel_follows_the_axes() {
    for view in views() {
        let mut case = case([9, 8, 6], view);
        case.grid.spacing = [1.0, 0.6, 2.5];
        let scene = case.scene();
        let config = RenderConfig { mode: Mode::Mip { slices: Some(4) }, ..RenderConfig::new(&scene, case.view) };
        let (found, camera) = (rendered(scene, &config), Camera::new(&case.view, &case.grid).expect("a view"));
        let expected = |pixel: usize, beyond: f64| {
            let at = [pixel % case.view.size[0], pixel / case.view.size[0]].map(|n| n as f64 + 0.5);
            let (from, along) = camera.ray(at);
            let depths = (0..400).map(|n| -8.0 + 0.1 * f64::from(n));
            let place = |at: [f64; 3], a: usize| (at[a] - case.grid.origin[a]) / case.grid.spacing[a];
            let points = depths.map(|depth| [0, 1, 2].map(|a| from[a] + depth * along[a]));
            let is_within = |at: &[f64; 3]| {
                let end = |a: usize| case.grid.dims[a] as f64 - 0.5 + beyond;
                (0..3).all(|a| (-0.5 - beyond..=end(a)).contains(&place(*at, a)))
            };
            let means = points.filter(is_within).map(|at| case.mean(at));
            means.filter(|(density, _)| *density > 0.01).map(|(_, mean)| mean).fold(f64::NAN, f64::max)
        };
        let mut seen = 0;
        for (pixel, value) in found.iter().enumerate().step_by(3) {
            let [low, middle, high] = [0.25, 0.0, -0.25].map(|beyond| expected(pixel, beyond));
            if (high - low).abs() < 1e-3 {
                assert!((f64::from(*value) - middle).abs() < 0.08, "{pixel}: {value} instead of {middle}");
                seen += 1;
            }
        }
        assert!(seen > 10, "{seen}");
    }
}

/// At the rim, the largest depends on where exactly the volume ends.
#[test]
fn the_largest_value_is_that_of_brute_force() {
    for view in views() {
        let mut case = case([18, 15, 13], view);
        case.values.iter_mut().for_each(|value| *value -= 0.8);
        let found = case.picture(Mode::Mip { slices: None });
        let [low, expected, high] = [0.3, 0.0, -0.5].map(|beyond| case.largest(beyond)); // the rim is of few cells
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
    let (_, report) = case.rendered(composite_of(step));
    report.views[0].table_error.expect("a table")
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
    let steep = |light, planes| Mode::Composite { transfer: sharp(), unit: None, slices: None, light, planes };
    let planes = vec![Plane { axis: 0, at: 20.0 }, Plane { axis: 2, at: 5.5 }];
    let modes =
        [composite(None), Mode::Mip { slices: None }, shaded, iso, steep(Some(LAMP), vec![]), steep(None, planes)];
    for mode in modes {
        let one = bits(&case, &mode, 1);
        assert!(one == bits(&case, &mode, 2) && one == bits(&case, &mode, 5));
    }
    let long = very_long(case, View { size: [90, 400], ..view(20.0, 44.0, 0.0) });
    let mode = steep(None, vec![]);
    assert!(bits(&long, &mode, 1) == bits(&long, &mode, 5), "slices that move by several voxels");
}

fn bits(case: &Case, mode: &Mode, threads: usize) -> Vec<u32> {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
    pool.install(|| case.picture(mode.clone())).into_iter().map(f32::to_bits).collect()
}

/// The same voxels, so long along z that the slices of a slab move by several voxels from its middle.
fn very_long(case: Case, view: View) -> Case {
    let grid = Grid { spacing: [1.0, 1.0, 12.0], ..case.grid };
    let case = Case { grid, view, sigma: 9.0, ..case };
    let sliced = SlicedView::new(&grid, &case.config(&case.scene(), composite_of(sharp())), &view).expect("a view");
    assert!(sliced.has_parts() && sliced.margin.iter().any(|margin| *margin >= 3), "{:?}", sliced.margin);
    case
}
