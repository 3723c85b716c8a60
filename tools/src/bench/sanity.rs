//! Checks of every point that hold on any machine, however fast it is.

use super::point::{Conversion, Point};

/// Rounding of pictures to f32, which the bound of samples does not include; a share of the value range.
const ROUNDING: f64 = 1e-6;

/// A sentence for every failed check.
pub fn complaints(points: &[Point]) -> Vec<String> {
    points.iter().flat_map(alone).chain(order(points)).collect()
}

/// The failed checks of a point by itself.
fn alone(point: &Point) -> Vec<String> {
    let mut wrong = Vec::new();
    let mut expect = |holds: bool, what: &str| {
        if !holds {
            wrong.push(format!("{}: {what}", point.key));
        }
    };
    if let Some(c) = &point.conversion {
        expect(c.series_outside == 0 && c.share_of_bound <= 1.0, "the bound is missed");
        expect(c.file_bytes > 0 && c.ratio.is_finite(), "the file is empty");
        expect(c.rms_voxel_error <= c.largest_voxel_error, "errors contradict each other");
        let of_range = matches!(point.bound.as_deref(), Some("pointwise" | "rms"));
        expect(!of_range || c.voxel_bound <= point.tolerance * (1.0 + 1e-9), "the bound is larger than the tolerance");
    }
    let (r, error) = (&point.rendering, point.rendering.image_error);
    expect(error.rms <= error.largest && error.largest.is_finite(), "a pixel is background that should not be");
    expect(r.pixel_bound.is_none_or(|bound| error.largest <= bound + ROUNDING), "a pixel exceeds its bound");
    expect(r.beyond_certificate == 0, "a pixel exceeds its certificate");
    let by_library = point.method != "textbook" && point.sweep == "splat";
    // The renderer may use the lattice instead, within the same error, where that is faster.
    let as_requested = point.group.ends_with(&r.splat) || r.splat == "lattice";
    expect(!by_library || as_requested, "another splat method was used");
    expect(r.first_view.min > 0.0 && r.further_view.min > 0.0, "it took no time");
    wrong
}

/// The failed checks of pairs of points that differ only in tolerance.
fn order(points: &[Point]) -> Vec<String> {
    let mut wrong = Vec::new();
    for (i, a) in points.iter().enumerate() {
        for b in &points[i + 1..] {
            if let (true, Some(x), Some(y)) = (alike(a, b), &a.conversion, &b.conversion) {
                let (loose, tight) = if a.tolerance > b.tolerance { (x, y) } else { (y, x) };
                if !falls(loose, tight) {
                    wrong.push(format!("{}, {}: the larger tolerance keeps more coefficients", a.key, b.key));
                }
            }
        }
    }
    wrong
}

/// Whether two points differ only in tolerance and can be compared. Sampled bounds cannot: one may be so tight that blocks
/// are stored exactly, which can be smaller.
fn alike(a: &Point, b: &Point) -> bool {
    a.bound.as_deref() != Some("sampled")
        && a.sweep == "tolerance"
        && b.sweep == a.sweep
        && (&a.kind, &a.method, &a.bound) == (&b.kind, &b.method, &b.bound)
}

/// Whether the larger tolerance keeps no more coefficients, or makes a smaller file. Blocks that are stored exactly have no
/// coefficients, so a smaller tolerance may keep fewer, but then its file is larger.
fn falls(loose: &Conversion, tight: &Conversion) -> bool {
    loose.coefficients_per_sample <= tight.coefficients_per_sample || loose.file_bytes < tight.file_bytes
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bench::point::Spread;

    fn converted(tolerance: f64, coefficients_per_sample: f64, file_bytes: u64) -> Point {
        let conversion = Conversion {
            seconds: Spread::of(vec![1.0]),
            megabytes_per_second: 1.0,
            file_bytes,
            ratio: 2.0,
            bytes_per_sample: 2.0,
            coefficients_per_sample,
            coefficients_per_voxel: 1.0,
            outliers: 0,
            voxel_bound: tolerance,
            largest_voxel_error: tolerance,
            rms_voxel_error: 0.5 * tolerance,
            share_of_bound: 1.0,
            series_outside: 0,
            peak_bytes: None,
        };
        Point {
            tolerance,
            bound: Some("pointwise".into()),
            conversion: Some(conversion),
            ..Point::example(&format!("at {tolerance}"))
        }
    }

    fn wrong(points: &[Point]) -> usize {
        complaints(points).len()
    }

    #[test]
    fn valid_points_are_accepted() {
        assert_eq!(complaints(&[converted(0.1, 0.2, 10), converted(0.01, 0.3, 20)]), [""; 0]);
        assert_eq!(wrong(&[converted(0.1, 0.2, 10), converted(0.01, 0.0, 20)]), 0, "stored exactly");
    }

    #[test]
    fn a_larger_tolerance_must_not_keep_more_coefficients() {
        assert_eq!(wrong(&[converted(0.1, 0.2, 10), converted(0.01, 0.1, 9)]), 1);
        assert_eq!(wrong(&[converted(0.01, 0.1, 9), converted(0.1, 0.2, 10)]), 1);
    }

    #[test]
    fn missed_bounds_are_reported() {
        let broken = |change: fn(&mut Point)| {
            let mut point = converted(0.1, 0.2, 10);
            change(&mut point);
            wrong(&[point])
        };
        assert_eq!(broken(|p| p.rendering.pixel_bound = Some(0.4)), 1);
        assert_eq!(broken(|p| p.rendering.pixel_bound = Some(0.5)), 0);
        assert_eq!(broken(|p| p.rendering.beyond_certificate = 1), 1);
        assert_eq!(broken(|p| p.rendering.image_error.largest = f64::INFINITY), 1);
        assert_eq!(broken(|p| p.rendering.further_view.min = 0.0), 1);
        let of_conversion: [fn(&mut Conversion); 3] =
            [|c| c.series_outside = 1, |c| c.file_bytes = 0, |c| c.voxel_bound = 0.11];
        for change in of_conversion {
            let mut point = converted(0.1, 0.2, 10);
            point.conversion.as_mut().into_iter().for_each(change);
            assert_eq!(wrong(&[point]), 1);
        }
    }
}
