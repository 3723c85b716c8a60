//! An axis beside the box: values along an edge, its name, and the sides of a patient.

use super::Panel;
use super::canvas::Canvas;
use super::text::Letters;
use super::ticks::{all_round_values, roundest, texts};
use super::volume::{AxisLabels, THIN, VolumeAxes, text};
use wavesplat_core::view::camera::Camera;

/// An edge of the box in a picture.
#[derive(Debug, Clone, Copy)]
struct Edge {
    axis: usize,
    from: [f64; 2],
    to: [f64; 2],
    /// The direction away from the box.
    out: [f64; 2],
}

impl Edge {
    fn length(&self) -> f64 {
        length([self.to[0] - self.from[0], self.to[1] - self.from[1]])
    }
}

/// The most values along an edge. So many are taken only if a coarser step gives fewer than four.
const MOST_TICKS: usize = 7;
/// The same of uneven axes, where single values say less.
const MOST_UNEVEN: usize = 10;
/// The most values of one step that are tried on uneven axes.
const MOST_TRIED: usize = 40;

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

/// Drops each tick that touches the one kept before it: on slightly uneven axes, texts may touch whatever the step is.
fn thinned(ticks: Vec<Tick>) -> Vec<Tick> {
    ticks.into_iter().fold(Vec::new(), |mut kept: Vec<Tick>, tick| {
        if kept.last().is_none_or(|last| !last.touches(&tick)) {
            kept.push(tick);
        }
        kept
    })
}

impl VolumeAxes {
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
        let (edges, rim) = ((0..3).filter_map(|axis| self.edge(camera, axis)), self.rim * camera.scale);
        let edges: Vec<Edge> = edges.filter(|edge| edge.length() >= canvas.letters.size).collect();
        edges.iter().for_each(|edge| self.draw_sides(canvas, edge, rim)); // they have fewer places than values
        edges.iter().for_each(|edge| self.draw_axis(canvas, edge, rim));
    }

    /// Writes above a slice where it cuts its axis.
    pub(super) fn write_place(&self, canvas: &mut Canvas<'_>, camera: &Camera, panel: &Panel) {
        let labels = &self.labels[panel.axis];
        let value = text(labels.shown(labels.coordinate(panel.at)));
        let place = format!("{} = {value} {}", labels.name, labels.unit);
        let corners = (0..8).map(|corner| self.corner(camera, corner));
        let [mut left, mut right, mut top] = [f64::INFINITY, f64::NEG_INFINITY, f64::INFINITY];
        corners.for_each(|[x, y]| (left, right, top) = (left.min(x), right.max(x), top.min(y)));
        canvas.write(place.trim_end(), [(left + right) / 2.0, top - 0.8 * canvas.letters.size]);
    }

    /// Draws an axis, whose values begin `rim` pixels from the box.
    fn draw_axis(&self, canvas: &mut Canvas<'_>, edge: &Edge, rim: f64) {
        let size = canvas.letters.size;
        canvas.line(edge.from, edge.to, (THIN * size).max(1.0));
        let mut widest: f64 = 0.0;
        // Beside a short edge, values would leave no room for its name.
        let ticks = if edge.length() < 3.0 * size { Vec::new() } else { self.ticks(edge, &canvas.letters, rim) };
        for Tick { text, share, middle, half } in ticks {
            let at = point(edge.from, edge.to, share);
            if canvas.write(&text, middle) {
                canvas.line(at, moved(at, edge.out, rim + 0.4 * size), (THIN * size).max(1.0));
                widest = widest.max(2.0 * reach(edge.out, half));
            }
        }
        self.draw_name(canvas, edge, rim + 0.9 * size + widest);
    }

    /// Writes letters for the sides of a patient beyond the ends of an edge.
    fn draw_sides(&self, canvas: &mut Canvas<'_>, edge: &Edge, rim: f64) {
        // Beyond the end, or else beside it.
        const PLACES: [[f64; 2]; 13] = [
            [0.9, 0.0],
            [0.9, 0.9],
            [0.0, 1.0],
            [1.5, 0.0],
            [1.5, 1.5],
            [0.0, 1.6],
            [2.5, 0.0],
            [0.0, 2.2],
            [2.5, 2.5],
            [-1.0, 1.0],
            [-2.0, 1.0],
            [-3.0, 1.0],
            [0.0, -1.0],
        ];
        let size = canvas.letters.size;
        let Some(sides) = self.labels[edge.axis].sides else { return };
        for (side, [end, other]) in sides.into_iter().zip([[edge.from, edge.to], [edge.to, edge.from]]) {
            let along = [0, 1].map(|i| (end[i] - other[i]) / edge.length());
            let place = |[beyond, out]: [f64; 2]| {
                let [beyond, out] = [beyond, out].map(|lines| lines * size + if lines > 0.0 { rim } else { 0.0 });
                moved(moved(end, along, beyond), edge.out, out)
            };
            let _ = PLACES.into_iter().any(|at| canvas.write(&side.to_string(), place(at)));
        }
    }

    /// Writes the name of an axis `away` from its edge: upwards beside steep edges, unless it is short. Where it has no room in the
    /// middle, it stands nearer to an end; a long one is shortened.
    fn draw_name(&self, canvas: &mut Canvas<'_>, edge: &Edge, away: f64) {
        const FURTHER: [f64; 5] = [0.0, 1.1, 2.2, 3.5, 5.0];
        const SHARES: [f64; 9] = [0.5, 0.4, 0.6, 0.3, 0.7, 0.15, 0.85, 0.0, 1.0];
        let (size, letters) = (canvas.letters.size, canvas.letters.clone());
        let is_steep = (edge.to[1] - edge.from[1]).abs() > (edge.to[0] - edge.from[0]).abs();
        let mut put = |name: &str| {
            let half = [letters.width(name) / 2.0, size / 2.0];
            let upwards = is_steep && half[0] > 1.3 * size;
            let turned = if upwards { [half[1], half[0]] } else { half };
            let places = FURTHER.into_iter().flat_map(|further| SHARES.map(|share| [further, share]));
            places.into_iter().any(|[further, share]| {
                let out = away + further * size + reach(edge.out, turned);
                let at = moved(point(edge.from, edge.to, share), edge.out, out);
                if upwards { canvas.write_upwards(name, at) } else { canvas.write(name, at) }
            })
        };
        let labels = &self.labels[edge.axis];
        let names = [labels.title() + &self.note(edge.axis), labels.title(), labels.name.clone()];
        let beginnings = (1..labels.name.chars().count()).rev();
        let shorter = beginnings.map(|count| labels.name.chars().take(count).chain(['…']).collect::<String>());
        let _ = names.into_iter().chain(shorter).any(|name| put(&name));
    }

    /// The coordinates of the voxels that are drawn.
    fn drawn(&self, axis: usize) -> AxisLabels {
        let AxisLabels { name, unit, at, sides } = &self.labels[axis];
        let region = self.region.start[axis]..self.region.end[axis];
        let counted = || region.clone().map(|voxel| voxel as f64).collect();
        let at = at.get(region.clone()).map_or_else(counted, <[f64]>::to_vec);
        AxisLabels { name: name.clone(), unit: unit.clone(), at, sides: *sides }
    }

    /// Says if an axis is not drawn in proportion.
    fn note(&self, axis: usize) -> String {
        match axis {
            axis if self.drawn(axis).is_uneven() => ", unevenly spaced".into(),
            2 if self.exaggeration != 1.0 => format!(", {} times as tall", text(self.exaggeration)),
            _ => String::new(),
        }
    }

    /// The values along an edge: as many as fit up to [`MOST_TICKS`], or none, since one alone tells no scale.
    fn ticks(&self, edge: &Edge, letters: &Letters, rim: f64) -> Vec<Tick> {
        let drawn = self.drawn(edge.axis);
        match drawn.at.as_slice() {
            [only] => return placed(&drawn, &[*only], edge, letters, rim),
            _ if !drawn.is_monotone() => return Vec::new(),
            _ if drawn.is_uneven() => return uneven_ticks(&drawn, edge, letters, rim),
            _ => {}
        }
        let [first, last] = [0, drawn.at.len()].map(|voxel| drawn.coordinate(voxel as f64 - 0.5));
        let all = all_round_values(first.min(last), first.max(last), MOST_TICKS);
        let mut all: Vec<Vec<Tick>> = all.map(|values| placed(&drawn, &values, edge, letters, rim)).collect();
        if all.first().is_some_and(|ticks| ticks.len() == MOST_TICKS) && all.get(1).is_some_and(|next| next.len() > 3) {
            all.remove(0);
        }
        let fits = |ticks: &&Vec<Tick>| ticks.len() > 1 && ticks.windows(2).all(|pair| !pair[0].touches(&pair[1]));
        let found = all.iter().find(fits).cloned().or_else(|| all.into_iter().next().map(thinned));
        found.filter(|ticks| ticks.len() > 1).unwrap_or_default()
    }
}

/// The values along an edge of an uneven axis: the roundest ones that do not touch.
fn uneven_ticks(drawn: &AxisLabels, edge: &Edge, letters: &Letters, rim: f64) -> Vec<Tick> {
    // Half a voxel beyond the ends means little where voxels are unlike.
    let (least, most) = drawn.at.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| (a.min(*v), b.max(*v)));
    let finer: Vec<Vec<f64>> = all_round_values(least, most, MOST_TRIED).collect();
    let values: Vec<f64> = roundest(least, most).into_iter().chain(finer.into_iter().rev().flatten()).collect();
    let mut kept: Vec<Tick> = Vec::new();
    for tick in values.iter().flat_map(|value| placed(drawn, &[*value], edge, letters, rim)) {
        if kept.len() < MOST_UNEVEN && kept.iter().all(|other| !other.touches(&tick)) {
            kept.push(tick);
        }
    }
    kept.sort_by(|a, b| a.share.total_cmp(&b.share));
    if kept.len() > 1 { kept } else { Vec::new() }
}

/// Values at their places beside an edge.
fn placed(drawn: &AxisLabels, values: &[f64], edge: &Edge, letters: &Letters, rim: f64) -> Vec<Tick> {
    let size = letters.size;
    let tick = |(text, value): (String, &f64)| {
        let share = (drawn.voxel(*value) + 0.5) / drawn.at.len() as f64;
        let half = [letters.width(&text) / 2.0, size / 2.0];
        let away = rim + 0.6 * size + reach(edge.out, half);
        Tick { text, share, middle: moved(point(edge.from, edge.to, share), edge.out, away), half }
    };
    let within = |tick: &Tick| (-1e-9..=1.0 + 1e-9).contains(&tick.share);
    let shown: Vec<f64> = values.iter().map(|value| drawn.shown(*value)).collect();
    texts(&shown).into_iter().zip(values).map(tick).filter(within).collect()
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
    use super::super::layout::{BAR, Margins, Parts, margins};
    use super::*;
    use wavesplat_core::base::grid::{Grid, Region};
    use wavesplat_core::view::camera::View;

    fn axes(grid: Grid) -> VolumeAxes {
        let at = |a: usize| (0..grid.dims[a]).map(|n| grid.origin[a] + n as f64 * grid.spacing[a]).collect();
        let labels =
            |a: usize| AxisLabels { name: ["x", "y", "z"][a].into(), unit: "m".into(), at: at(a), sides: None };
        VolumeAxes { grid, region: grid.whole(), rim: 0.0, exaggeration: 1.0, labels: [0, 1, 2].map(labels) }
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

    /// Depths of an ocean, and levels of pressure.
    const DEPTHS: [f64; 12] = [0.0, 3.0, 10.0, 25.0, 50.0, 100.0, 200.0, 300.0, 500.0, 1000.0, 2000.0, 3000.0];
    const LEVELS: [f64; 10] = [1000.0, 925.0, 850.0, 700.0, 500.0, 300.0, 200.0, 100.0, 50.0, 10.0];

    /// Axes with names, units and coordinates as archives have them, and the size of their volume.
    fn described() -> Vec<VolumeAxes> {
        let even = |count: usize, step: f64| Vec::from_iter((0..count).map(|n| n as f64 * step));
        let named =
            |name: &str, unit: &str, at: Vec<f64>| AxisLabels { name: name.into(), unit: unit.into(), at, sides: None };
        let of = |labels: [AxisLabels; 3], spacing: [f64; 3], exaggeration: f64| {
            let grid = Grid { dims: labels.each_ref().map(|axis| axis.at.len()), spacing, origin: [0.0; 3] };
            VolumeAxes { grid, region: grid.whole(), rim: 0.0, exaggeration, labels }
        };
        let [x, y] = [named("longitude", "°E", even(40, 0.25)), named("latitude", "°N", even(30, 0.25))];
        let depth = named("depth", "m", DEPTHS.iter().map(|v| -v).rev().collect());
        let pressure = named("air_pressure", "hPa", LEVELS.into());
        let long = named("sea_water_sigma_theta_coordinate_of_the_model", "1e-3 kg m⁻³", even(30, -0.000_123));
        let body = |name: &str, count: usize, sides: [char; 2]| AxisLabels {
            sides: Some(sides),
            ..named(name, "mm", even(count, 2.5))
        };
        let body = [body("x", 64, ['L', 'R']), body("y", 64, ['P', 'A']), body("z", 30, ['I', 'S'])];
        let voxels = [named("x", "", even(64, 1.0)), named("y", "", even(48, 1.0)), named("z", "", even(20, 1.0))];
        vec![
            of([x.clone(), y.clone(), depth], [1.0; 3], 1.0),
            of([x.clone(), y.clone(), pressure], [1.0, 1.0, 3.0], 1.0),
            of([x, y, long], [1.0, 1.0, 0.5], 50.0),
            of(body, [1.0, 1.0, 2.0], 1.0),
            of(voxels, [1.0; 3], 1.0),
        ]
    }

    /// From a thumbnail to 4K, face-on and from anywhere: every axis that has values has its name, and nothing overlaps.
    #[test]
    fn names_and_values_stand_side_by_side_in_pictures_of_any_size() {
        let (mut axes_drawn, mut uneven_drawn) = (0, 0);
        for (volume, size) in described().iter().flat_map(|volume| SIZES.map(|size| (volume, size))) {
            for (azimuth, elevation) in
                [(270.0, 0.0), (180.0, 0.0), (180.0, 90.0), (30.0, 30.0), (215.0, -20.0), (75.0, 60.0)]
            {
                let camera = fitting(volume, size, azimuth, elevation);
                let mut pixels = vec![[0; 3]; size[0] * size[1]];
                let mut canvas = Canvas::new(&mut pixels, size, [0; 3]);
                let (right, letter) = (size[0] as f64, canvas.letters.size);
                let [top, bottom] = [0.2, 0.8].map(|share| share * size[1] as f64);
                let bar = [[right - BAR * letter, top - letter], [right, bottom + letter]];
                canvas.taken.push(bar);
                canvas.written.push("the bar".into());
                volume.draw_axes(&mut canvas, &camera);
                let Canvas { taken, written, letters, .. } = canvas;
                for (n, a) in taken.iter().enumerate() {
                    let within = (0..2).all(|i| a[0][i] >= 0.0 && a[1][i] <= size[i] as f64);
                    let alone = taken[n + 1..].iter().all(|b| (0..2).any(|i| a[1][i] <= b[0][i] || b[1][i] <= a[0][i]));
                    assert!(within && alone, "{size:?} {azimuth} {elevation}: {:?} of {written:?}", written[n]);
                }
                for edge in (0..3).filter_map(|axis| volume.edge(&camera, axis)) {
                    let labels = &volume.labels[edge.axis];
                    if edge.length() < letters.size {
                        continue;
                    }
                    let is_there = |side: char| written.contains(&side.to_string());
                    assert!(
                        labels.sides.is_none_or(|sides| sides.into_iter().all(is_there)),
                        "{size:?} {azimuth} {elevation}: {written:?}"
                    );
                    let begins =
                        |text: &String| text.chars().zip(labels.name.chars()).take_while(|(a, b)| a == b).count();
                    let named = written.iter().map(begins).max().unwrap_or(0);
                    assert!(
                        named >= labels.name.chars().count().min(8),
                        "{size:?} {azimuth} {elevation}: no {} in {written:?}",
                        labels.name
                    );
                    axes_drawn += 1;
                    uneven_drawn += usize::from(written.iter().any(|text| text.ends_with("unevenly spaced")));
                }
            }
        }
        assert!(axes_drawn > 100 && uneven_drawn > 20, "{axes_drawn} {uneven_drawn}");
    }

    const SIZES: [[usize; 2]; 5] = [[200, 200], [512, 512], [900, 600], [1000, 800], [3840, 2160]];

    /// A camera for which the volume fits beside the margins.
    fn fitting(volume: &VolumeAxes, size: [usize; 2], azimuth: f64, elevation: f64) -> Camera {
        let Margins { left, right, top, bottom } = margins(size, Parts::USUAL, true);
        let inner = [size[0] - left - right, size[1] - top - bottom];
        let view = View { size: inner, ..View::new(azimuth, elevation) };
        let camera = Camera::new(&view, &volume.grid).expect("a view");
        let scale = camera.scale;
        let [across, up] = [[right, left], [top, bottom]].map(|[a, b]| (a as f64 - b as f64) / 2.0 / scale);
        let view = View { size, scale: Some(scale), center: Some(camera.moved(across, up)), ..view };
        Camera::new(&view, &volume.grid).expect("a view")
    }

    #[test]
    fn uneven_axes_have_round_values_at_their_places() {
        let [ocean, air, ..] = &described()[..] else { unreachable!() };
        for (volume, wanted) in [(ocean, &["0", "−100", "−1000"][..]), (air, &["10", "100", "1000"])] {
            let ticks = beside(volume, 2, 500.0);
            assert!(
                ticks.len() > 5 && wanted.iter().all(|value| ticks.iter().any(|tick| tick.text == *value)),
                "{ticks:?}"
            );
            for Tick { text, share, .. } in &ticks {
                let value: f64 = text.replace('−', "-").parse().expect("a number");
                let voxel = share * volume.grid.dims[2] as f64 - 0.5;
                assert!(
                    (volume.labels[2].coordinate(voxel) - value).abs() < 1e-9 * value.abs().max(1.0),
                    "{text} at {voxel}"
                );
            }
        }
    }

    #[test]
    fn uneven_axes_have_values_wherever_they_lie() {
        let [ocean, ..] = &described()[..] else { unreachable!() };
        for (first, last) in
            [(41.2, 48.7), (1020.0, 1028.5), (-74.9, -70.5), (2000.0, 2010.0), (1e6, 1.3e6), (3e-7, 4e-7)]
        {
            let mut volume = ocean.clone();
            let share = |n: usize| (n as f64 / 11.0).powi(2);
            volume.labels[2].at = (0..12).map(|n| first + share(n) * (last - first)).collect();
            let ticks = beside(&volume, 2, 400.0);
            assert!(ticks.len() > 3, "{first} to {last}: {ticks:?}");
        }
    }

    #[test]
    fn only_the_voxels_that_are_drawn_count() {
        let [ocean, ..] = &described()[..] else { unreachable!() };
        let mut volume = ocean.clone();
        volume.labels[2].at =
            [0.0, 3.0, 10.0].into_iter().chain((1..=9).map(|n| 1000.0 + 100.0 * f64::from(n))).collect();
        volume.region.start[2] = 3;
        assert!(volume.note(2).is_empty() && beside(&volume, 2, 400.0).len() > 3);
        volume.region = Region { start: [0, 0, 4], end: [40, 30, 5] };
        let one = beside(&volume, 2, 100.0);
        assert!(one.len() == 1 && one[0].text == "1200" && (one[0].share - 0.5).abs() < 1e-9, "{one:?}");
        volume.region = volume.grid.whole();
        volume.labels[2].at[5] = -4.0;
        assert!(beside(&volume, 2, 400.0).is_empty(), "coordinates that turn back have no scale");
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
}
