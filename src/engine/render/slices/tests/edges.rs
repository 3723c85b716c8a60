//! The edges of surfaces, at silhouettes and at the faces of the volume, against shapes that are known.

use super::lit::{LAMP, is_inside};
use super::*;

/// Points of each pixel, along a side, at which a shape is looked up.
const SIDE: usize = 12;

/// The share of each pixel that a shape covers.
fn covered(view: &View, is_covered: impl Fn([f64; 2]) -> bool) -> Vec<f64> {
    let point = |n: usize| (n as f64 + 0.5) / SIDE as f64;
    let pixel = |pixel: usize| {
        let [x, y] = [pixel % view.size[0], pixel / view.size[0]].map(|n| n as f64);
        let points = (0..SIDE * SIDE).filter(|n| is_covered([x + point(n % SIDE), y + point(n / SIDE)]));
        points.count() as f64 / (SIDE * SIDE) as f64
    };
    (0..view.size[0] * view.size[1]).map(pixel).collect()
}

/// The opacity of each pixel of a surface.
fn opacities(case: &Case, surface: Surface) -> Vec<f64> {
    let found = case.picture(Mode::Iso { surfaces: vec![surface], light: LAMP, slices: None });
    found.chunks_exact(4).map(|pixel| f64::from(pixel[3])).collect()
}

/// Asserts that opacities are within a root mean square and a largest difference of shares, over pixels that are covered
/// in part, and that their sum is that of the shares to a hundredth of the edge.
fn check(name: &str, found: &[f64], expected: &[f64], rms: f64, most: f64) {
    let edge: Vec<usize> = (0..expected.len()).filter(|n| (1e-9..1.0 - 1e-9).contains(&expected[*n])).collect();
    let off: Vec<f64> = edge.iter().map(|n| (found[*n] - expected[*n]).abs()).collect();
    let (found_rms, largest) = errors(&off);
    let sums: f64 = found.iter().zip(expected).map(|(f, e)| f - e).sum::<f64>() / edge.len() as f64;
    assert!(edge.len() > 30, "{name}");
    assert!(
        found_rms < rms && largest < most && sums.abs() < 0.1,
        "{name}: rms {found_rms:e}, largest {largest:e}, sum {sums:e}"
    );
}

fn ball(grid: Grid, middle: [f64; 3]) -> Vec<f64> {
    let value = |p: [usize; 3]| (0..3).map(|a| (p[a] as f64 - middle[a]).powi(2)).sum::<f64>().sqrt();
    grid.whole().iter().map(value).collect()
}

/// The samples of a ball are distances, so that the field is a little more at its surface: by the mean of a kernel.
#[test]
fn silhouettes_are_smooth() {
    let (grid, middle, sigma) = (grid([30, 28, 32]), [14.2, 13.7, 15.9], 0.75_f64);
    for view in views().into_iter().map(|view| View { size: [96, 88], ..view }) {
        let case = Case { values: ball(grid, middle), view, region: None, sigma, grid };
        let camera = Camera::new(&view, &grid).expect("a view");
        let position = std::array::from_fn(|a| grid.origin[a] + middle[a] * grid.spacing[a]);
        let [x, y, _] = camera.project(position);
        for value in [4.3, 9.1] {
            // The mean of distances around a point at r is r + sigma^2 / r.
            let radius = value / 2.0 + (value * value / 4.0 - sigma * sigma).sqrt();
            let expected = covered(&view, |p| (p[0] - x).hypot(p[1] - y) < radius * camera.scale);
            for opacity in [1.0, 0.4] {
                let found = opacities(&case, Surface { value, colour: [1.0; 3], opacity });
                let both = opacity * (2.0 - opacity);
                let found: Vec<f64> = found.iter().map(|o| o / both).collect();
                let name = format!("{} {} {value} {opacity}", view.azimuth, view.elevation);
                check(&name, &found, &expected, 0.1, 0.45);
            }
        }
    }
}

/// A plane within the volume is seen as the polygon in which it cuts the box.
#[test]
fn surfaces_end_at_the_faces_of_the_volume() {
    let whole = Grid { spacing: [1.0, 0.8, 1.25], ..grid([14, 17, 11]) };
    let part = Region { start: [2, 3, 1], end: [13, 12, 10] };
    for (n, view) in views().into_iter().enumerate() {
        for (axis, region) in (0..3).flat_map(|axis| [(axis, None), (axis, Some(part))]) {
            let (grid, camera) = (whole, Camera::new(&view, &whole).expect("a view"));
            let value = 5.3;
            let values = grid.whole().iter().map(|voxel| voxel[axis] as f64).collect();
            let case = Case { values, view, region, sigma: 0.75, grid };
            let clip = region.unwrap_or(grid.whole());
            let start = std::array::from_fn(|a| grid.origin[a] + clip.start[a] as f64 * grid.spacing[a]);
            let boxed = Grid { dims: clip.dims(), origin: start, ..grid };
            let (at, along) = (grid.origin[axis] + value * grid.spacing[axis], camera.towards(0.0, 0.0));
            if along[axis].abs() < 0.1 {
                continue; // seen from its edge
            }
            let is_covered = |pixel: [f64; 2]| {
                let (start, along) = camera.ray(pixel);
                let depth = (at - start[axis]) / along[axis];
                let mut place: [f64; 3] = std::array::from_fn(|a| start[a] + depth * along[a]);
                place[axis] = boxed.origin[axis];
                is_inside(&boxed, place)
            };
            let expected = covered(&view, is_covered);
            let found = opacities(&case, Surface { value, colour: [1.0; 3], opacity: 1.0 });
            check(&format!("view {n}, axis {axis}, {region:?}"), &found, &expected, 0.12, 0.4);
        }
    }
}

/// A plate that barely reaches the value is lit from the front, wherever the slices lie.
#[test]
fn thin_sheets_show_the_side_that_is_seen() {
    const WIDTH: f64 = 0.6;
    const SIGMA: f64 = 0.5;
    let grid = grid([14, 13, 16]);
    let view = View { azimuth: 180.0, elevation: 90.0, size: [40, 40], ..views()[0] };
    let bell = |x: f64, width: f64| (-x * x / (2.0 * width * width)).exp();
    let towards = LAMP.azimuth.to_radians().cos() * LAMP.elevation.to_radians().cos();
    let gloss = LAMP.specular * ((1.0 + towards) / (2.0 + 2.0 * towards).sqrt()).powi(32);
    let expected = 0.5 * (LAMP.ambient + LAMP.diffuse * towards) + gloss;
    for (phase, share) in (0..10).flat_map(|phase| [0.9, 0.97, 0.99].map(|share| (f64::from(phase) / 10.0, share))) {
        let middle = 7.0 + phase;
        let field = |z: f64| {
            let weights = (0..16).map(|k| (f64::from(k), bell(z - f64::from(k), SIGMA)));
            let [values, all] = weights.fold([0.0; 2], |[v, w], (k, h)| [v + h * bell(k - middle, WIDTH), w + h]);
            values / all
        };
        let peak = (0..2000).map(|n| field(6.0 + f64::from(n) * 1e-3 * 1.5)).fold(0.0, f64::max);
        let values = grid.whole().iter().map(|[_, _, z]| bell(z as f64 - middle, WIDTH)).collect();
        let case = Case { values, view, region: None, sigma: SIGMA, grid };
        let surface = Surface { value: share * peak, colour: [0.5; 3], opacity: 1.0 };
        let found = case.picture(Mode::Iso { surfaces: vec![surface], light: LAMP, slices: None });
        let pixel = &found[4 * (20 * 40 + 20)..][..4];
        assert!((f64::from(pixel[0]) - expected).abs() < 0.02, "{middle} {share}: {pixel:?}, not {expected}");
    }
}
