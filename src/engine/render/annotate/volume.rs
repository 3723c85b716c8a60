//! The box of the volume, and values along its edges.

use super::canvas::{Canvas, line};
use super::layout::BAR;
use super::text::Letters;
use super::ticks::{all_round_values, round_below, texts};
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
    /// The axes x, y and z, with a coordinate for each voxel of the grid.
    pub labels: [AxisLabels; 3],
}

/// The width of lines, in lines of letters.
pub(super) const THIN: f64 = 0.08;

/// By how much lengths may differ that count as the same.
const EVEN: f64 = 1e-3;

/// An edge of the box in a picture.
#[derive(Debug, Clone, Copy)]
struct Edge {
    axis: usize,
    from: [f64; 2],
    to: [f64; 2],
    /// The direction away from the box.
    out: [f64; 2],
}

/// The most values along an edge. So many are taken only if a coarser step gives fewer than four.
const MOST_TICKS: usize = 7;

/// A value beside an edge.
#[derive(Debug, Clone)]
struct Tick {
    text: String,
    /// Its place as a share of the edge.
    share: f64,
    /// The middle of its text in the picture, and half of the text's width and height.
    middle: [f64; 2],
    half: [f64; 2],
}

impl Tick {
    /// Whether two texts touch, or nearly so.
    fn touches(&self, other: &Self) -> bool {
        let gap = [self.half[1], 0.0];
        (0..2).all(|i| (self.middle[i] - other.middle[i]).abs() < self.half[i] + other.half[i] + gap[i])
    }
}

/// Drops each tick that touches the one kept before it: on uneven axes, texts may touch whatever the step is.
fn thinned(ticks: Vec<Tick>) -> Vec<Tick> {
    ticks.into_iter().fold(Vec::new(), |mut kept: Vec<Tick>, tick| {
        if kept.last().is_none_or(|last| !last.touches(&tick)) {
            kept.push(tick);
        }
        kept
    })
}

impl VolumeAxes {
    /// The point of the picture of a place in voxels.
    fn pixel(&self, camera: &Camera, place: [f64; 3]) -> [f64; 2] {
        let position = std::array::from_fn(|a| self.grid.origin[a] + place[a] * self.grid.spacing[a]);
        let [x, y, _] = camera.project(position);
        [x, y]
    }

    /// The first and the last place of the box along an axis: half a voxel beyond the voxels.
    fn ends(&self, axis: usize) -> [f64; 2] {
        [self.region.start[axis] as f64 - 0.5, self.region.end[axis] as f64 - 0.5]
    }

    /// A corner of the box: each bit of `corner` chooses an end.
    fn corner(&self, camera: &Camera, corner: usize) -> [f64; 2] {
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

    /// The edge along an axis that carries its values: on the outline of the box, below it or at its left.
    fn edge(&self, camera: &Camera, axis: usize) -> Option<Edge> {
        let viewer = camera.towards(0.0, 0.0);
        let [b, c] = [(axis + 1) % 3, (axis + 2) % 3];
        let is_seen = |corner: usize, axis: usize| {
            let facing = if corner >> axis & 1 == 1 { viewer[axis] } else { -viewer[axis] };
            facing > 1e-9
        };
        let middle = self.pixel(camera, std::array::from_fn(|a| self.ends(a).iter().sum::<f64>() / 2.0));
        let edges = (0..8).filter(|corner| corner >> axis & 1 == 0 && is_seen(*corner, b) != is_seen(*corner, c));
        let edges = edges.map(|corner| {
            let [from, to] = [corner, corner | 1 << axis].map(|corner| self.corner(camera, corner));
            Edge { axis, from, to, out: away(from, to, middle) }
        });
        let low = |edge: &Edge| {
            let (dx, dy) = (edge.to[0] - edge.from[0], edge.to[1] - edge.from[1]);
            if dx.abs() >= dy.abs() { edge.from[1] + edge.to[1] } else { -(edge.from[0] + edge.to[0]) }
        };
        edges.max_by(|a, b| low(a).total_cmp(&low(b)))
    }

    /// Draws values and names along three edges of the box.
    pub(super) fn draw_axes(&self, canvas: &mut Canvas<'_>, camera: &Camera) {
        for edge in (0..3).filter_map(|axis| self.edge(camera, axis)) {
            self.draw_axis(canvas, &edge, self.rim * camera.scale);
        }
    }

    /// Draws an axis, whose values begin `rim` pixels from the box.
    fn draw_axis(&self, canvas: &mut Canvas<'_>, edge: &Edge, rim: f64) {
        let size = canvas.letters.size;
        let length = length([edge.to[0] - edge.from[0], edge.to[1] - edge.from[1]]);
        if length < 4.0 * size {
            return;
        }
        canvas.line(edge.from, edge.to, (THIN * size).max(1.0));
        let mut widest: f64 = 0.0;
        for Tick { text, share, middle, half } in self.ticks(edge, &canvas.letters, rim) {
            let at = point(edge.from, edge.to, share);
            canvas.line(at, moved(at, edge.out, rim + 0.4 * size), (THIN * size).max(1.0));
            canvas.write(&text, middle);
            widest = widest.max(2.0 * reach(edge.out, half));
        }
        let name = self.labels[edge.axis].title();
        let half = reach(edge.out, [canvas.letters.width(&name) / 2.0, size / 2.0]);
        canvas.write(&name, moved(point(edge.from, edge.to, 0.5), edge.out, rim + 0.9 * size + widest + half));
    }

    /// The values along an edge: as many as fit up to [`MOST_TICKS`], or none, since one alone tells no scale.
    fn ticks(&self, edge: &Edge, letters: &Letters, rim: f64) -> Vec<Tick> {
        let [first, last] = self.ends(edge.axis).map(|voxel| self.labels[edge.axis].coordinate(voxel));
        let all = all_round_values(first.min(last), first.max(last), MOST_TICKS);
        let mut all: Vec<Vec<Tick>> = all.map(|values| self.placed(&values, edge, letters, rim)).collect();
        if all.first().is_some_and(|ticks| ticks.len() == MOST_TICKS) && all.get(1).is_some_and(|next| next.len() > 3) {
            all.remove(0);
        }
        let fits = |ticks: &&Vec<Tick>| ticks.len() > 1 && ticks.windows(2).all(|pair| !pair[0].touches(&pair[1]));
        let found = all.iter().find(fits).cloned().or_else(|| all.into_iter().next().map(thinned));
        found.filter(|ticks| ticks.len() > 1).unwrap_or_default()
    }

    /// Values at their places beside an edge.
    fn placed(&self, values: &[f64], edge: &Edge, letters: &Letters, rim: f64) -> Vec<Tick> {
        let ([first, last], labels, size) = (self.ends(edge.axis), &self.labels[edge.axis], letters.size);
        let tick = |(text, value): (String, &f64)| {
            let share = (labels.voxel(*value) - first) / (last - first);
            let half = [letters.width(&text) / 2.0, size / 2.0];
            let away = rim + 0.6 * size + reach(edge.out, half);
            Tick { text, share, middle: moved(point(edge.from, edge.to, share), edge.out, away), half }
        };
        let within = |tick: &Tick| (-1e-9..=1.0 + 1e-9).contains(&tick.share);
        texts(values).into_iter().zip(values).map(tick).filter(within).collect()
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
        let origin = [2.6 * size, canvas.size()[1] - 2.6 * size];
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

    /// The name and the unit.
    fn title(&self) -> String {
        if self.unit.is_empty() { self.name.clone() } else { format!("{} ({})", self.name, self.unit) }
    }

    /// The coordinate of a place in voxels, also beyond the ends.
    fn coordinate(&self, voxel: f64) -> f64 {
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
    fn voxel(&self, coordinate: f64) -> f64 {
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

/// The length of a vector. The system's `hypot` may differ from machine to machine.
fn length([x, y]: [f64; 2]) -> f64 {
    (x * x + y * y).sqrt()
}

/// The direction from a line away from a point.
fn away(from: [f64; 2], to: [f64; 2], point: [f64; 2]) -> [f64; 2] {
    let along = [to[0] - from[0], to[1] - from[1]];
    let length = length(along).max(f64::MIN_POSITIVE);
    let across = [-along[1] / length, along[0] / length];
    let side = (from[0] - point[0]) * across[0] + (from[1] - point[1]) * across[1];
    if side < 0.0 { across.map(|n| -n) } else { across }
}

fn point(from: [f64; 2], to: [f64; 2], share: f64) -> [f64; 2] {
    std::array::from_fn(|i| from[i] + share * (to[i] - from[i]))
}

fn moved(at: [f64; 2], direction: [f64; 2], by: f64) -> [f64; 2] {
    std::array::from_fn(|i| at[i] + by * direction[i])
}

/// How far a rectangle of these half sides reaches in a direction.
fn reach(direction: [f64; 2], half: [f64; 2]) -> f64 {
    direction[0].abs() * half[0] + direction[1].abs() * half[1]
}

#[cfg(test)]
mod tests {
    use super::*;
    use wavesplat_core::view::camera::View;

    fn axes(grid: Grid) -> VolumeAxes {
        let at = |a: usize| (0..grid.dims[a]).map(|n| grid.origin[a] + n as f64 * grid.spacing[a]).collect();
        let labels = |a: usize| AxisLabels { name: ["x", "y", "z"][a].into(), unit: "m".into(), at: at(a) };
        VolumeAxes { grid, region: grid.whole(), rim: 0.0, labels: [0, 1, 2].map(labels) }
    }

    #[test]
    fn values_are_those_of_the_voxels() {
        let grid = Grid { dims: [11, 5, 4], spacing: [0.5, 1.0, 1.0], origin: [-1.0, 0.0, 0.0] };
        let mut volume = axes(grid);
        let ticks = beside(&volume, 0, 800.0);
        let place = |share: f64| -1.0 + (share * 11.0 - 0.5) * 0.5;
        assert!(ticks.len() > 3 && ticks[0].text == "−1", "{ticks:?}");
        for Tick { text, share, .. } in &ticks {
            let value: f64 = text.replace('−', "-").parse().expect("a number");
            assert!((place(*share) - value).abs() < 1e-9, "{text} at {share}");
        }
        volume.labels[2].at = vec![0.0, -10.0, -100.0, -1000.0];
        for length in [800.0, 100.0] {
            let depth = beside(&volume, 2, length);
            let is_last = |tick: &Tick| tick.text == "−1000" && (tick.share * 4.0 - 3.5).abs() < 1e-9;
            assert!(depth.len() > 1 && depth.iter().any(is_last), "{depth:?}");
        }
    }

    /// The values along an axis below an edge of some length, which ascends to the right.
    fn beside(volume: &VolumeAxes, axis: usize, length: f64) -> Vec<Tick> {
        let (along, out) = ([0.9 * length, -0.436 * length], [0.436, 0.9]);
        volume.ticks(&Edge { axis, from: [0.0; 2], to: along, out }, &Letters::new(15.0), 0.0)
    }

    #[test]
    fn there_are_as_many_values_as_fit() {
        let volume = axes(Grid::unit([96, 1000, 7]));
        let texts = |axis: usize, length: f64| -> Vec<String> {
            beside(&volume, axis, length).into_iter().map(|tick| tick.text).collect()
        };
        assert_eq!(texts(0, 200.0), ["0", "20", "40", "60", "80"]);
        assert_eq!(texts(0, 60.0), ["0", "50"]);
        assert_eq!(texts(1, 200.0), ["0", "200", "400", "600", "800"]);
        assert!(texts(0, 10.0).is_empty() && texts(2, 200.0).len() > 3);
        for (axis, length) in (0..3).flat_map(|axis| (1..40).map(move |n| (axis, 10.0 * f64::from(n)))) {
            let ticks = beside(&volume, axis, length);
            assert!(ticks.len() <= MOST_TICKS && ticks.len() != 1, "{ticks:?}");
            assert!(ticks.windows(2).all(|pair| !pair[0].touches(&pair[1])), "{ticks:?}");
        }
    }

    #[test]
    fn values_lie_outside_of_the_box() {
        let volume = axes(Grid::unit([20, 10, 15]));
        for (azimuth, elevation, roll) in [(30.0, 30.0, 0.0), (0.0, 0.0, 0.0), (180.0, 90.0, 0.0), (200.0, -50.0, 33.0)]
        {
            let view = View { roll, size: [200, 160], ..View::new(azimuth, elevation) };
            let camera = Camera::new(&view, &volume.grid).expect("a view");
            let corners: Vec<[f64; 2]> = (0..8).map(|corner| volume.corner(&camera, corner)).collect();
            let edges: Vec<Edge> = (0..3).filter_map(|axis| volume.edge(&camera, axis)).collect();
            assert!(edges.len() >= 2, "{azimuth} {elevation}");
            for edge in edges {
                let side = |p: &[f64; 2]| (p[0] - edge.from[0]) * edge.out[0] + (p[1] - edge.from[1]) * edge.out[1];
                assert!(corners.iter().all(|corner| side(corner) < 1e-6), "{azimuth} {elevation}: {edge:?}");
            }
        }
    }

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
