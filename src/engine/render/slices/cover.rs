//! How much of its cell a point of a surface covers: less than all of it at silhouettes, and at the faces of the volume.
//!
//! Both edges are found from the field alone, to first order. With D the change of the field along the ray, D' the change
//! of D, and G its change across the lattice, a ray that crosses a surface turns back a height of D^2 / 2|D'| beyond it.
//! That height changes by G from cell to cell, so their ratio is the distance of the silhouette. The distance of a face
//! changes from cell to cell as the point of the ray on the surface moves.
//!
//! ```text
//! share of a cell = 1/2 + height / (G width of a cell), from 0 to 1                                       (eq 43)
//! ```

use super::GROUP;
use super::filter::Sixteen;
use super::row::Row;
use super::view::SlicedView;
use wavesplat_core::base::vectors::dispatch;

/// The field at a point of a ray.
#[derive(Debug, Clone, Copy)]
pub(in crate::render) struct CoverPoint {
    /// Voxels along b, c and a, from the first ones; those along a are counted along the ray.
    pub(super) at: [f32; 3],
    pub(super) value: f32,
    /// The change of the value per voxel.
    pub(super) gradient: [f32; 3],
}

/// The field at sixteen cells of a slice; NaN where there is none.
#[derive(Debug, Clone, Copy)]
pub(in crate::render) struct Slope {
    pub(super) values: Sixteen,
    pub(super) gradient: [Sixteen; 3],
}

impl Slope {
    /// No field.
    pub(super) const NOTHING: Self = Self { values: [f32::NAN; GROUP], gradient: [[0.0; GROUP]; 3] };

    /// The field at a cell whose place is `at`.
    pub(super) fn point(&self, i: usize, at: [f32; 3]) -> CoverPoint {
        CoverPoint { at, value: self.values[i], gradient: self.gradient.map(|along| along[i]) }
    }
}

/// A point of a ray at which a surface shows.
#[derive(Debug, Clone, Copy)]
pub(super) struct Meeting {
    pub(super) gradient: [f32; 3],
    /// The share of the cell that the surface covers.
    covered: f32,
    sheets: Sheets,
}

/// Which sheets of a surface a ray passes.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Sheets {
    One,
    /// The second of two sheets that are close together: it hides behind the first.
    Second,
    Both,
}

impl Meeting {
    /// The opacity of the cell for a surface of some opacity.
    pub(super) fn opacity(&self, of_surface: f32) -> f32 {
        let first = self.covered * of_surface;
        match self.sheets {
            Sheets::One => first,
            Sheets::Second => opacity_of_second(first, of_surface),
            Sheets::Both => first * (2.0 - of_surface),
        }
    }
}

/// The opacity of the second of two sheets, behind the first one.
pub(super) fn opacity_of_second(first: f32, of_surface: f32) -> f32 {
    first * (1.0 - of_surface) / (1.0 - first).max(f32::MIN_POSITIVE)
}

/// Rays of a view, and the box in which surfaces are seen: half a voxel beyond the outermost voxels.
#[derive(Debug, Clone, Copy)]
pub(super) struct Rays {
    /// Voxels that a ray passes from one voxel along a to the next.
    pub(super) direction: [f32; 3],
    /// The distance of two slices in voxels along a.
    pub(super) between: f32,
    /// The width of a cell in voxels.
    pub(super) width: f32,
    /// Voxels of the volume.
    pub(super) count: [f32; 3],
}

/// A wider cell would be covered by voxels that were not looked at.
const WIDEST: f64 = 2.0;
/// A point this many voxels away from a face is not cut by it.
pub(super) const FAR: f32 = 2.0;

impl Rays {
    pub(super) fn new(view: &SlicedView) -> Self {
        Self {
            direction: view.direction().map(|n| n as f32),
            between: view.between() as f32,
            width: view.grain().min(WIDEST) as f32,
            count: view.count.map(|n| n as f32),
        }
    }

    /// The change of the field along the ray, per voxel along a.
    #[inline(always)]
    pub(super) fn rise(&self, gradient: &[f32; 3]) -> f32 {
        gradient[0] * self.direction[0] + gradient[1] * self.direction[1] + gradient[2]
    }

    /// The places where the ray of a cell of a row crosses the slice before, and the row's slice.
    pub(super) fn places(&self, row: &Row<'_>, cell: usize) -> [[f32; 3]; 2] {
        let [b, c, a] = row.place;
        let at = [b + cell as f32, c, a];
        [std::array::from_fn(|axis| at[axis] - self.between * self.direction[axis]), at]
    }

    /// Where a ray meets the surface of a value between two points, if it does.
    pub(super) fn meeting(&self, value: f32, from: &CoverPoint, to: &CoverPoint) -> Option<Meeting> {
        let rises = [from, to].map(|place| self.rise(&place.gradient));
        let step = Step {
            from,
            to,
            rises,
            bend: (rises[1] - rises[0]) / (to.at[2] - from.at[2]),
            turn: Turn::of(from, to, rises),
        };
        let passes = (from.value < value) != (to.value < value);
        let meeting = if passes { self.passed(value, &step) } else { self.almost_passed(value, &step)? };
        (meeting.covered > 0.0).then_some(meeting)
    }

    /// The meeting with a surface that a ray passes.
    fn passed(&self, value: f32, step: &Step<'_>) -> Meeting {
        let Step { from, to, rises, bend, turn } = step;
        let place = between(from, to, step.share_of(value));
        let has_turned = if turn.is_some() { step.leads_away(value) } else { self.rise(&place.gradient) * bend > 0.0 };
        let height = turn.as_ref().map_or_else(
            || {
                let (end, rise) = if has_turned { (from, rises[0]) } else { (to, rises[1]) };
                (end.value - value).abs() + rise * rise / (2.0 * bend.abs())
            },
            |turn| (turn.value - value).abs(),
        );
        let covered = self.of_height(height, &place.gradient);
        let sheets = if has_turned && covered < 1.0 { Sheets::Second } else { Sheets::One };
        Meeting { gradient: place.gradient, covered: covered * self.within(&place, *bend), sheets }
    }

    /// The meeting with a surface behind which a ray turns back, or before it.
    fn almost_passed(&self, value: f32, step: &Step<'_>) -> Option<Meeting> {
        let turn = step.turn.as_ref().filter(|_| !step.leads_away(value))?;
        let height = if step.rises[0] > 0.0 { turn.value - value } else { value - turn.value };
        let share = if height > 0.0 { step.share_of(value) } else { turn.share }; // the first sheet, or the turn
        let place = between(step.from, step.to, share);
        let covered = self.of_height(height, &place.gradient) * self.within(&place, step.bend);
        Some(Meeting { gradient: place.gradient, covered, sheets: Sheets::Both })
    }

    /// Marks the cells in which one of the surfaces may show between two slices: cell i by bit i.
    pub(super) fn near(&self, values: &[f32], from: &Slope, to: &Slope) -> u32 {
        dispatch!(near(from, to, values, self))
    }

    /// The share of a cell that a surface covers if the ray turns back at `height` beyond it. The height is negative if
    /// the ray turns back before the surface.
    pub(super) fn of_height(&self, height: f32, gradient: &[f32; 3]) -> f32 {
        share(height, self.width * length([gradient[0], gradient[1]]))
    }

    /// The share of a cell of a surface within the box. `bend` is the change of the rise along the ray.
    pub(super) fn within(&self, place: &CoverPoint, bend: f32) -> f32 {
        let near = |axis: &usize| self.distance(*axis, &place.at) < FAR;
        let of_face = |axis: usize| self.of_face(axis, self.distance(axis, &place.at), place, bend);
        (0..3).filter(near).map(of_face).fold(1.0, f32::min)
    }

    /// The distance of a place from the nearest face of the box across an axis. It is negative beyond the face.
    pub(super) fn distance(&self, axis: usize, at: &[f32; 3]) -> f32 {
        (at[axis] + 0.5).min(self.count[axis] - 0.5 - at[axis])
    }

    /// The share of a cell on this side of a face across an axis.
    fn of_face(&self, axis: usize, distance: f32, place: &CoverPoint, bend: f32) -> f32 {
        let ([b, c, _], rise) = (place.gradient, self.rise(&place.gradient));
        // At silhouettes the movement has no limit, but the next cell is beyond the silhouette.
        let least = (2.0 * bend.abs() * self.width * length([b, c])).sqrt();
        share(distance * rise.abs().max(least), self.width * self.moved(axis, &place.gradient))
    }

    /// How far the point of the ray on a surface moves across a face from cell to cell, times the rise. It moves along the ray by
    /// -(b, c) / rise.
    pub(super) fn moved(&self, axis: usize, gradient: &[f32; 3]) -> f32 {
        let ([b, c, _], rise) = (*gradient, self.rise(gradient));
        length(match axis {
            0 => [rise - self.direction[0] * b, -self.direction[0] * c],
            1 => [-self.direction[1] * b, rise - self.direction[1] * c],
            _ => [b, c],
        })
    }
}

/// A step of a ray.
struct Step<'a> {
    from: &'a CoverPoint,
    to: &'a CoverPoint,
    /// The changes of the field along the ray at both ends, and the change of that change.
    rises: [f32; 2],
    bend: f32,
    turn: Option<Turn>,
}

/// Where a ray turns within a step, as a share of the way, and the field there.
struct Turn {
    share: f32,
    value: f32,
}

impl Turn {
    fn of(from: &CoverPoint, to: &CoverPoint, rises: [f32; 2]) -> Option<Self> {
        let share = rises[0] / (rises[0] - rises[1]);
        (rises[0] * rises[1] < 0.0).then(|| Self { share, value: turning_value(from, to, rises, share) })
    }
}

impl Step<'_> {
    /// Whether the first rise leads away from a value. A ray that turns in this step has turned before it passes the value then.
    fn leads_away(&self, value: f32) -> bool {
        (self.rises[0] > 0.0) != (self.from.value < value)
    }

    /// Where the field passes a value, as a share of the way: before the turn or behind it, for there the gradient has the sign of the
    /// surface that is passed.
    fn share_of(&self, value: f32) -> f32 {
        let (from, to) = (self.from.value, self.to.value);
        match &self.turn {
            None => (value - from) / (to - from),
            Some(turn) if self.leads_away(value) => turn.share + (1.0 - turn.share) * part(value, turn.value, to),
            Some(turn) => turn.share * part(value, from, turn.value),
        }
    }
}

/// How far a value is from one number to another, from 0 to 1.
fn part(value: f32, from: f32, to: f32) -> f32 {
    let part = (value - from) / (to - from);
    if part.is_nan() { 0.5 } else { part.clamp(0.0, 1.0) }
}

/// The field between two points, by linear interpolation.
fn between(from: &CoverPoint, to: &CoverPoint, share: f32) -> CoverPoint {
    let mix = |a: f32, b: f32| a + share * (b - a);
    CoverPoint {
        at: std::array::from_fn(|i| mix(from.at[i], to.at[i])),
        value: mix(from.value, to.value),
        gradient: std::array::from_fn(|i| mix(from.gradient[i], to.gradient[i])),
    }
}

/// The value at a share of the way, by the cubic that has the values and the rises of both ends.
fn turning_value(from: &CoverPoint, to: &CoverPoint, rises: [f32; 2], share: f32) -> f32 {
    let (rest, length) = (1.0 - share, to.at[2] - from.at[2]);
    let ends = rest * rest * (1.0 + 2.0 * share) * from.value + share * share * (3.0 - 2.0 * share) * to.value;
    ends + length * share * rest * (rest * rises[0] - share * rises[1])
}

/// Marks the cells where one of the values may be passed, or almost reached, between two slices.
#[inline(always)]
fn near(from: &Slope, to: &Slope, values: &[f32], rays: &Rays) -> u32 {
    let (mut reached, mut is_near) = ([0.0; GROUP], [false; GROUP]);
    for (i, reached) in reached.iter_mut().enumerate() {
        let [first, last] = [from, to].map(|slope| {
            slope.gradient[2][i] + rays.direction[0] * slope.gradient[0][i] + rays.direction[1] * slope.gradient[1][i]
        });
        let [one, other] = [from, to].map(|slope| slope.gradient[0][i].abs() + slope.gradient[1][i].abs());
        let across = if one > other { one } else { other };
        // The height at which a ray turns back, and what the next cell may be higher.
        let height = 0.5 * rays.between * (first.abs() + last.abs()) + 0.5 * rays.width * across;
        *reached = if first * last < 0.0 { height } else { -1.0 };
    }
    for value in values {
        for i in 0..GROUP {
            let (a, b) = (from.values[i] - value, to.values[i] - value);
            let least = if a.abs() < b.abs() { a.abs() } else { b.abs() };
            is_near[i] |= (least <= reached[i]) | ((a < 0.0) != (b < 0.0));
        }
    }
    (0..GROUP).fold(0, |marks, i| marks | u32::from(is_near[i]) << i)
}

/// Half, and a number of widths more; from 0 to 1.
pub(super) fn share(number: f32, width: f32) -> f32 {
    let share = 0.5 + number / width.max(f32::MIN_POSITIVE);
    if share.is_nan() { 1.0 } else { share.clamp(0.0, 1.0) }
}

/// Not by the system's `hypot`, which may differ from machine to machine.
pub(super) fn length([b, c]: [f32; 2]) -> f32 {
    (b * b + c * c).sqrt()
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    /// Numbers between -1 and 1.
    pub(in super::super) struct Random(pub(in super::super) u32);

    impl Random {
        pub(in super::super) fn next(&mut self) -> f32 {
            self.0 = self.0.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (self.0 >> 8) as f32 / 8_388_608.0 - 1.0
        }

        fn slope(&mut self, size: f32) -> Slope {
            let mut sixteen = |size: f32| std::array::from_fn(|_| size * self.next());
            Slope { values: sixteen(1.0), gradient: [size, size, size].map(&mut sixteen) }
        }
    }

    /// Cells are marked fast by a bound, and surfaces found one by one.
    #[test]
    fn every_cell_with_a_surface_is_marked() {
        let (mut random, mut shown, mut unmarked) = (Random(1), 0, 0);
        for n in 0..4000 {
            let (between, width) = ([0.125, 0.5, 1.0][n % 3], [0.25, 0.5, 2.0][n / 3 % 3]);
            let direction = [random.next(), random.next(), 1.0];
            let rays = Rays { direction, between, width, count: [40.0; 3] };
            let (from, to) = (random.slope(3.0), random.slope(3.0));
            let values = [random.next(), 2.0 * random.next()];
            let marks = rays.near(&values, &from, &to);
            for i in 0..GROUP {
                let mark = marks >> i & 1 == 1;
                let [first, last] = [[9.0; 3], [9.0, 9.0, 9.0 + between]];
                let met = |value: &f32| rays.meeting(*value, &from.point(i, first), &to.point(i, last)).is_some();
                let any = values.iter().any(met);
                assert!(mark || !any, "{n} {i}");
                shown += u32::from(any);
                unmarked += u32::from(!mark);
            }
        }
        assert!(shown > 10_000 && unmarked > 10_000, "{shown} {unmarked}");
    }

    #[test]
    fn two_sheets_let_the_light_of_both_through() {
        for (covered, opacity) in [(0.3, 0.4), (0.9, 0.7), (0.6, 1.0), (1.0, 0.5)] {
            let opacity_of = |sheets| Meeting { gradient: [0.0; 3], covered, sheets }.opacity(opacity);
            let through = (1.0 - opacity_of(Sheets::One)) * (1.0 - opacity_of(Sheets::Second));
            let both = 1.0 - opacity_of(Sheets::Both);
            let expected = 1.0 - covered + covered * (1.0 - opacity) * (1.0 - opacity);
            assert!((through - expected).abs() < 1e-6 && (both - expected).abs() < 1e-6);
        }
    }
}
