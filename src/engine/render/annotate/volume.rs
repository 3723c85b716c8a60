//! The box of the volume, its axes, a scale, and arrows along x, y and z.

use super::canvas::{Canvas, line};
use super::layout::BAR;
use super::ticks::round_below;
use wavesplat_core::base::decimal;
use wavesplat_core::base::grid::{Grid, Region};
use wavesplat_core::view::camera::Camera;

/// The meaning of an axis.
#[derive(Debug, Clone, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct AxisLabels {
    /// Its name.
    pub name: String,
    /// The unit of its coordinates, or empty.
    pub unit: String,
    /// The coordinate of every voxel, ascending or descending.
    pub at: Vec<f64>,
    /// The sides of a patient at the first and the last voxel: L, R, A, P, S or I; if the source says so.
    #[serde(default)]
    pub sides: Option<[char; 2]>,
}

/// The axes of a volume as it is drawn.
#[derive(Debug, Clone, PartialEq)]
pub struct VolumeAxes {
    /// The lattice that is drawn.
    pub grid: Grid,
    /// The voxels that are drawn.
    pub region: Region,
    /// How far the picture reaches beyond the box, in world units.
    pub rim: f64,
    /// The factor by which heights are drawn taller than they are; 1 if they are no lengths in the unit of x and y.
    pub exaggeration: f64,
    /// The axes x, y and z, with a coordinate for each voxel of the grid.
    pub labels: [AxisLabels; 3],
}

/// The width of lines, in lines of letters.
pub(super) const THIN: f64 = 0.08;

/// By how much lengths may differ that count as the same.
const EVEN: f64 = 1e-3;

/// The largest step of an axis that counts as even, as a multiple of the least one.
const UNEVEN: f64 = 1.2;

impl VolumeAxes {
    /// The point of the picture of a place in voxels.
    pub(super) fn pixel(&self, camera: &Camera, place: [f64; 3]) -> [f64; 2] {
        let position = std::array::from_fn(|a| self.grid.origin[a] + place[a] * self.grid.spacing[a]);
        let [x, y, _] = camera.project(position);
        [x, y]
    }

    /// The first and the last place of the box along an axis: half a voxel beyond the voxels.
    pub(super) fn ends(&self, axis: usize) -> [f64; 2] {
        [self.region.start[axis] as f64 - 0.5, self.region.end[axis] as f64 - 0.5]
    }

    /// A corner of the box: each bit of `corner` chooses an end.
    pub(super) fn corner(&self, camera: &Camera, corner: usize) -> [f64; 2] {
        self.pixel(camera, std::array::from_fn(|a| self.ends(a)[corner >> a & 1]))
    }

    /// Draws all edges of the box by `put(x, y, share)`.
    pub(super) fn draw_box(&self, camera: &Camera, size: f64, mut put: impl FnMut(i64, i64, f64)) {
        let picture = camera.size.map(|n| n as f64);
        for axis in 0..3 {
            for corner in (0..8).filter(|corner| corner >> axis & 1 == 0) {
                let ends = [corner, corner | 1 << axis].map(|corner| self.corner(camera, corner));
                line(picture, ends[0], ends[1], (THIN * size).max(1.0), &mut put);
            }
        }
    }

    /// Coordinates per world unit and their unit, if they are the same along all axes.
    pub fn length_unit(&self) -> Option<(f64, &str)> {
        let mut found = None;
        for (axis, labels) in self.labels.iter().enumerate().filter(|(_, labels)| labels.at.len() > 1) {
            let per_unit = labels.step()? / self.grid.spacing[axis];
            let unit = labels.unit.as_str();
            match found {
                None => found = Some((per_unit, unit)),
                Some((first, same)) if same == unit && (per_unit / first - 1.0).abs() < EVEN => {}
                Some(_) => return None,
            }
        }
        found
    }

    /// Draws a line of a round length at the lower right, if lengths are the same along all axes.
    pub(super) fn draw_scale(&self, canvas: &mut Canvas<'_>, camera: &Camera) {
        let Some((per_unit, unit)) = self.length_unit() else { return };
        let (size, [width, height]) = (canvas.letters.size, canvas.size());
        let most = (BAR - 1.5) * size;
        let value = round_below(most / camera.scale * per_unit);
        let half = value / per_unit * camera.scale / 2.0;
        let (middle, y) = (width - BAR * size / 2.0, height - 2.2 * size);
        let label = if unit.is_empty() { text(value) } else { format!("{} {unit}", text(value)) };
        if half.is_finite() && half > 0.0 && canvas.write(&label, [middle, y + 1.2 * size]) {
            canvas.line([middle - half, y], [middle + half, y], (2.0 * THIN * size).max(1.0));
        }
    }

    /// Draws arrows along x, y and z at the lower left.
    pub(super) fn draw_triad(&self, canvas: &mut Canvas<'_>, camera: &Camera) {
        let size = canvas.letters.size;
        let [width, height] = canvas.size();
        let room = 2.6 * size;
        let places = [[room, height - room], [width - room, height - room], [room, room], [width - room, room]];
        let corners = |at: [f64; 2]| [at.map(|n| n - room), at.map(|n| n + room)];
        let Some(origin) = places.into_iter().find(|at| canvas.is_free(&corners(*at))) else { return };
        let at = |axis: usize, length: f64| {
            let [x, y, _] = camera.step(axis, length / camera.scale);
            [origin[0] + x, origin[1] + y]
        };
        for (axis, name) in ["x", "y", "z"].into_iter().enumerate() {
            canvas.line(origin, at(axis, 1.5 * size), (2.0 * THIN * size).max(1.0));
            canvas.write(name, at(axis, 2.0 * size));
        }
    }
}

impl AxisLabels {
    /// The distance of neighbours, if it is the same everywhere.
    fn step(&self) -> Option<f64> {
        let steps = || self.at.windows(2).map(|pair| pair[1] - pair[0]);
        let mean = steps().sum::<f64>() / steps().len() as f64;
        steps().all(|step| (step / mean - 1.0).abs() < EVEN).then_some(mean.abs())
    }

    /// Whether steps differ so much that no even scale would be true.
    pub fn is_uneven(&self) -> bool {
        let steps = || self.at.windows(2).map(|pair| (pair[1] - pair[0]).abs());
        steps().fold(0.0, f64::max) > UNEVEN * steps().fold(f64::INFINITY, f64::min)
    }

    /// Whether coordinates only ascend, or only descend.
    pub(super) fn is_monotone(&self) -> bool {
        let ascends = |pair: &[f64]| pair[0] < pair[1];
        self.at.windows(2).all(ascends) || self.at.windows(2).all(|pair| ascends(&[pair[1], pair[0]]))
    }

    /// Whether lengths along two axes compare: both are even, and in units of length, in degrees, or in the same unit.
    pub fn compares_with(&self, other: &Self) -> bool {
        const LENGTHS: [&str; 11] =
            ["m", "metre", "metres", "meter", "meters", "km", "kilometers", "cm", "mm", "um", "µm"];
        let both = |is: &dyn Fn(&str) -> bool| is(&self.unit) && is(&other.unit);
        let is_same = self.unit == other.unit
            || both(&|unit| LENGTHS.contains(&unit))
            || both(&|unit| unit.starts_with('°') || unit.starts_with("degree"));
        is_same && !self.is_uneven() && !other.is_uneven()
    }

    /// A coordinate as it is written: longitudes of a whole turn and more begin at 0 again.
    pub(super) fn shown(&self, coordinate: f64) -> f64 {
        if self.unit == "°E" && coordinate >= 360.0 { coordinate - 360.0 } else { coordinate }
    }

    /// The name and the unit.
    pub(super) fn title(&self) -> String {
        if self.unit.is_empty() { self.name.clone() } else { format!("{} ({})", self.name, self.unit) }
    }

    /// The coordinate of a place in voxels, also beyond the ends.
    pub(super) fn coordinate(&self, voxel: f64) -> f64 {
        match self.at.as_slice() {
            [] => voxel,
            [only] => only + voxel,
            at => {
                let below = (voxel.floor().max(0.0) as usize).min(at.len() - 2);
                at[below] + (voxel - below as f64) * (at[below + 1] - at[below])
            }
        }
    }

    /// The place in voxels of a coordinate, also beyond the ends.
    pub(super) fn voxel(&self, coordinate: f64) -> f64 {
        match self.at.as_slice() {
            [] => coordinate,
            [only] => coordinate - only,
            at => {
                let ascends = at[0] <= at[at.len() - 1];
                let before = |value: &f64| if ascends { *value <= coordinate } else { *value >= coordinate };
                let below = at.partition_point(before).saturating_sub(1).min(at.len() - 2);
                below as f64 + (coordinate - at[below]) / (at[below + 1] - at[below])
            }
        }
    }
}

/// A value with a minus sign.
pub(super) fn text(value: f64) -> String {
    decimal::short(value).replace('-', "−")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn coordinates_and_voxels_are_inverse() {
        let labels = AxisLabels { at: vec![5.0, 4.0, 0.0, -1.0], ..AxisLabels::default() };
        for voxel in [-0.5, 0.0, 0.25, 1.9, 3.0, 3.5] {
            assert!((labels.voxel(labels.coordinate(voxel)) - voxel).abs() < 1e-12);
        }
        let single = AxisLabels { at: vec![7.0], ..AxisLabels::default() };
        assert!((single.coordinate(0.5) - 7.5).abs() < 1e-12 && single.voxel(7.5) == 0.5);
    }
}
