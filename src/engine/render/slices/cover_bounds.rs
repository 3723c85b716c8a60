//! Bounds of how much of its cell a surface covers (eq 43), if the field is known up to an error: [`Rays::meeting`] for all fields
//! within the errors.

use super::cover::{CoverPoint, FAR, Rays, length, opacity_of_second, share};

/// The numbers from `least` to `most`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Interval {
    pub(super) least: f32,
    pub(super) most: f32,
}

impl Interval {
    /// No number: nothing is in it, and a hull with it changes nothing.
    pub(super) const NONE: Self = Self { least: f32::INFINITY, most: f32::NEG_INFINITY };

    fn around(number: f32, off: f32) -> Self {
        Self { least: number - off, most: number + off }
    }

    /// Lengths of vectors that may be off by vectors of the length `off`; absolute values.
    fn size(length: f32, off: f32) -> Self {
        Self { least: (length.abs() - off).max(0.0), most: length.abs() + off }
    }

    pub(super) fn hull(self, other: Self) -> Self {
        Self { least: self.least.min(other.least), most: self.most.max(other.most) }
    }

    fn map(self, rising: impl Fn(f32) -> f32) -> Self {
        Self { least: rising(self.least), most: rising(self.most) }
    }

    /// The share a / (a + b) of numbers of at least 0.
    fn share_of(self, other: Self) -> Self {
        let share = |a: f32, b: f32, unknown: f32| if a + b > 0.0 { a / (a + b) } else { unknown };
        Self { least: share(self.least, other.most, 0.0), most: share(self.most, other.least, 1.0) }
    }

    fn middle(self) -> f32 {
        0.5 * (self.least + self.most)
    }

    fn half(self) -> f32 {
        0.5 * (self.most - self.least)
    }

    fn holds(self, number: f32) -> bool {
        self.least <= number && number <= self.most
    }
}

/// The field of a cell in a slice, and its errors.
#[derive(Debug, Clone, Copy)]
pub(super) struct Place {
    pub(super) point: CoverPoint,
    pub(super) error: f32,
    /// The length of the gradient's error, per world unit; and the error of its components, per voxel along b, c and a.
    pub(super) gradient_error: f32,
    pub(super) errors_per_voxel: [f32; 3],
    /// The change of the field along the ray per voxel along a.
    pub(super) rise: f32,
    pub(super) rise_error: f32,
}

impl Place {
    /// Whether the field rises along the ray; `None` if that is not certain.
    fn rises(&self) -> Option<bool> {
        (self.rise.abs() > self.rise_error).then_some(self.rise > 0.0)
    }

    /// Whether the field is below a value; `None` if that is not certain.
    pub(super) fn below(&self, value: f32) -> Option<bool> {
        let over = self.point.value - value;
        (over.abs() > self.error).then_some(over < 0.0)
    }
}

/// How a surface may show between two slices.
#[derive(Debug, Clone, Copy)]
pub(super) struct Shown {
    /// Its opacity.
    pub(super) opacity: Interval,
    /// Where it shows, as a share of the way.
    pub(super) share: Interval,
}

/// The two ways in which a surface may show between two slices; `None` if it cannot.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct MayShow {
    /// The field passes the value.
    pub(super) passed: Option<Shown>,
    /// The ray turns back before it, or behind it. It may show less, or not at all: that depends on the samples around.
    pub(super) turned: Option<Shown>,
}

/// A step of a ray from slice to slice, for all fields within the errors.
pub(super) struct Step<'a> {
    pub(super) rays: &'a Rays,
    pub(super) from: &'a Place,
    pub(super) to: &'a Place,
}

/// The change of the field at a share of the way, and the error of each number.
struct Change {
    gradient: [f32; 3],
    off: [f32; 3],
    rise: Interval,
    /// The length across the lattice.
    across: Interval,
}

impl Step<'_> {
    /// Whether the field turns along the ray; `None` if that is not certain.
    pub(super) fn turns(&self) -> Option<bool> {
        self.from.rises().zip(self.to.rises()).map(|(a, b)| a != b)
    }

    /// Whether the field rises or falls for sure from slice to slice, as it does at both slices.
    pub(super) fn is_monotone(&self) -> bool {
        let change = self.to.point.value - self.from.point.value;
        let is_certain = change.abs() > self.from.error + self.to.error;
        is_certain && self.turns() == Some(false) && self.from.rises() == Some(change > 0.0)
    }

    /// The ways in which the surface of a value may show.
    pub(super) fn may_show(&self, value: f32, of_surface: f32) -> MayShow {
        let passes = self.from.below(value).zip(self.to.below(value)).map(|(a, b)| a != b);
        let passed = (passes != Some(false)).then(|| self.passed(value, of_surface));
        let may_turn = passes != Some(true) && self.turns() != Some(false);
        let turned = if may_turn { self.turned(value, of_surface) } else { None };
        MayShow { passed, turned: turned.filter(|shown| shown.opacity.most > 0.0) }
    }

    /// Whether the field rises through the surface of a value if that shows: it does if the field is below it before. `None` if that is not
    /// certain.
    pub(super) fn rises_through(&self, value: f32) -> Option<bool> {
        let rises = || self.from.rises().filter(|_| self.is_monotone());
        self.from.below(value).or_else(rises)
    }

    /// Whether the first rise leads to the value; `None` if that is not certain.
    fn is_towards(&self, value: f32) -> Option<bool> {
        self.from.rises().zip(self.from.below(value)).map(|(rises, below)| rises == below)
    }

    fn passed(&self, value: f32, of_surface: f32) -> Shown {
        let distance = |place: &Place| Interval::size(place.point.value - value, place.error);
        let straight = distance(self.from).share_of(distance(self.to));
        // Where the ray turns, it passes the value before or behind its turn, which is anywhere.
        let share = if self.turns() == Some(false) { straight } else { Interval { least: 0.0, most: 1.0 } };
        let (change, bend) = (self.change(share), self.bend());
        let has_turned = self.has_turned(value, &change);
        let height = self.height_of_passed(value, has_turned);
        let (covered, within) = (self.shares(height, change.across), self.within(share, &change, bend));
        let all = Interval { least: covered.least * within.least, most: covered.most * within.most };
        let (first, second) = (all.map(|x| x * of_surface), all.map(|x| opacity_of_second(x * of_surface, of_surface)));
        let opacity = match (has_turned, covered.least >= 1.0, covered.most < 1.0) {
            (Some(false), ..) | (_, true, _) => first,
            (Some(true), _, true) => second,
            _ => first.hull(second),
        };
        Shown { opacity, share }
    }

    fn turned(&self, value: f32, of_surface: f32) -> Option<Shown> {
        if self.is_towards(value) == Some(false) {
            return None;
        }
        let turn = self.turning_share();
        let over = self.turning_value(turn);
        let over = Interval { least: over.least - value, most: over.most - value };
        let under = Interval { least: -over.most, most: -over.least };
        let height = match self.from.rises() {
            Some(true) => over,
            Some(false) => under,
            None => over.hull(under),
        };
        let share = Interval { least: 0.0, most: turn.most }; // the first sheet is before the turn
        let change = self.change(share);
        let (covered, within) = (self.shares(height, change.across), self.within(share, &change, self.bend()));
        let both = |x: f32| x * of_surface * (2.0 - of_surface);
        let opacity = Interval { least: 0.0, most: both(covered.most * within.most) };
        Some(Shown { opacity, share })
    }

    /// Voxels along a between the slices, as they are drawn.
    fn length(&self) -> f32 {
        self.to.point.at[2] - self.from.point.at[2]
    }

    /// The change of the rise along the ray.
    fn bend(&self) -> Interval {
        let off = self.from.rise_error + self.to.rise_error;
        Interval::around(self.to.rise - self.from.rise, off).map(|change| change / self.length())
    }

    fn change(&self, share: Interval) -> Change {
        let (middle, half) = (share.middle(), share.half());
        let [from, to] = [self.from, self.to].map(|place| place.point.gradient);
        let gradient = std::array::from_fn(|i| from[i] + middle * (to[i] - from[i]));
        let off: [f32; 3] = std::array::from_fn(|i| {
            self.from.errors_per_voxel[i].max(self.to.errors_per_voxel[i]) + half * (to[i] - from[i]).abs()
        });
        let of_ray = self.from.rise_error.max(self.to.rise_error) + half * (self.to.rise - self.from.rise).abs();
        let rise = Interval::around(self.rays.rise(&gradient), of_ray);
        let across = Interval::size(length([gradient[0], gradient[1]]), length([off[0], off[1]]));
        Change { gradient, off, rise, across }
    }

    /// Whether a ray has turned before a place where it passes a surface.
    fn has_turned(&self, value: f32, change: &Change) -> Option<bool> {
        let (rise, bend) = (change.rise, self.bend());
        let is_certain = !rise.holds(0.0) && !bend.holds(0.0);
        let straight = is_certain.then_some((rise.least > 0.0) == (bend.least > 0.0));
        let turned = self.is_towards(value).map(|leads_to_it| !leads_to_it);
        match self.turns() {
            Some(true) => turned,
            Some(false) => straight,
            None => None,
        }
    }

    /// How far the ray goes beyond a surface that it passes.
    fn height_of_passed(&self, value: f32, has_turned: Option<bool>) -> Interval {
        let turned = || {
            let turn = self.turning_value(self.turning_share());
            Interval::size(turn.middle() - value, turn.half())
        };
        let beyond = |place: &Place| {
            let (bend, rise) = (self.bend(), Interval::size(place.rise, place.rise_error));
            let bend = Interval::size(bend.middle(), bend.half());
            let end = Interval::size(place.point.value - value, place.error);
            let most = end.most + rise.most * rise.most / (2.0 * bend.least);
            Interval {
                least: end.least + rise.least * rise.least / (2.0 * bend.most).max(f32::MIN_POSITIVE),
                most: if most.is_nan() { f32::INFINITY } else { most },
            }
        };
        let straight = || match has_turned {
            Some(true) => beyond(self.from),
            Some(false) => beyond(self.to),
            None => beyond(self.from).hull(beyond(self.to)),
        };
        match self.turns() {
            Some(true) => turned(),
            Some(false) => straight(),
            None => turned().hull(straight()),
        }
    }

    /// Where the ray turns back, as a share of the way.
    fn turning_share(&self) -> Interval {
        let steep = |place: &Place| Interval::size(place.rise, place.rise_error);
        steep(self.from).share_of(steep(self.to))
    }

    /// The value where the ray turns back, by a cubic (as in [`Rays::meeting`]).
    fn turning_value(&self, share: Interval) -> Interval {
        let [from, to] = [self.from, self.to];
        let (s, length) = (share.middle(), self.length());
        let rest = 1.0 - s;
        let ends = rest * rest * (1.0 + 2.0 * s) * from.point.value + s * s * (3.0 - 2.0 * s) * to.point.value;
        let middle = ends + length * s * rest * (rest * from.rise - s * to.rise);
        // The weights of the values add up to 1, those of the rises are at most 4/27, and their slopes at most 1.5 and 1.
        let of_rises = from.rise_error + to.rise_error;
        let steep = 1.5 * (to.point.value - from.point.value).abs() + length * (from.rise.abs() + to.rise.abs());
        let steep = steep + 1.5 * (from.error + to.error) + length * of_rises;
        let off = from.error.max(to.error) + length * of_rises * (4.0 / 27.0) + steep * share.half();
        Interval::around(middle, off)
    }

    /// The shares of a cell for numbers that change by a length from cell to cell.
    fn shares(&self, number: Interval, length: Interval) -> Interval {
        let of = |number: f32, negative: f32, positive: f32| {
            share(number, self.rays.width * if number < 0.0 { negative } else { positive })
        };
        let Interval { least, most } = length;
        Interval { least: of(number.least, least, most), most: of(number.most, most, least) }
    }

    /// The share of a cell within the box.
    fn within(&self, share: Interval, change: &Change, bend: Interval) -> Interval {
        let [from, to] = [self.from, self.to].map(|place| place.point.at);
        let at = std::array::from_fn(|i| from[i] + share.middle() * (to[i] - from[i]));
        let of_axis = |axis: usize| {
            let off = share.half() * (to[axis] - from[axis]).abs() + 2.0 * f32::EPSILON * to[axis].abs();
            let distance = Interval::around(self.rays.distance(axis, &at), off);
            if distance.least >= FAR {
                return Interval { least: 1.0, most: 1.0 };
            }
            let near = self.of_face(axis, distance, change, bend);
            if distance.most >= FAR { Interval { most: 1.0, ..near } } else { near }
        };
        let least = |a: Interval, b: Interval| Interval { least: a.least.min(b.least), most: a.most.min(b.most) };
        (0..3).map(of_axis).fold(Interval { least: 1.0, most: 1.0 }, least)
    }

    fn of_face(&self, axis: usize, distance: Interval, change: &Change, bend: Interval) -> Interval {
        let rays = self.rays;
        let bend = Interval::size(bend.middle(), bend.half());
        let steep = Interval::size(change.rise.middle(), change.rise.half());
        let silhouette = |bend: f32, across: f32| (2.0 * bend * rays.width * across).sqrt();
        let steep = Interval {
            least: steep.least.max(silhouette(bend.least, change.across.least)),
            most: steep.most.max(silhouette(bend.most, change.across.most)),
        };
        let moved = Interval::size(rays.moved(axis, &change.gradient), self.moved_off(axis, &change.off));
        let product = |distance: f32, low: f32, high: f32| distance * if distance < 0.0 { high } else { low };
        let number = Interval {
            least: product(distance.least, steep.least, steep.most),
            most: product(distance.most, steep.most, steep.least),
        };
        self.shares(number, moved)
    }

    /// How far the movement of a point of a surface from cell to cell may be off.
    fn moved_off(&self, axis: usize, off: &[f32; 3]) -> f32 {
        let ([b, c, a], [along_b, along_c, _]) = (*off, self.rays.direction.map(f32::abs));
        length(match axis {
            0 => [along_c * c + a, along_b * c],
            1 => [along_c * b, along_b * b + a],
            _ => [b, c],
        })
    }
}

#[cfg(test)]
mod tests {
    use super::super::cover::tests::Random;
    use super::*;

    /// A long volume, where places are less precise.
    const COUNT: [f32; 3] = [12.0, 9.0, 2014.0];

    fn place(random: &mut Random, rays: &Rays, at: [f32; 3], error: f32) -> Place {
        let gradient = std::array::from_fn(|_| random.next());
        let point = CoverPoint { at, value: random.next() * 0.5, gradient };
        let gradient_error = error * (1.0 + random.next());
        let along = rays.direction.iter().map(|d| d * d).sum::<f32>().sqrt();
        let (rise, rise_error) = (rays.rise(&gradient), gradient_error * along);
        Place { point, error, gradient_error, errors_per_voxel: [gradient_error; 3], rise, rise_error }
    }

    /// A field within the errors; often at their ends.
    fn moved(random: &mut Random, place: &Place) -> CoverPoint {
        let value = place.point.value + place.error * (3.0 * random.next()).clamp(-1.0, 1.0) * 0.999;
        let way: [f32; 3] = std::array::from_fn(|_| random.next());
        let length = way.iter().map(|n| n * n).sum::<f32>().sqrt();
        let size = place.gradient_error * (2.0 * random.next().abs()).min(1.0) * 0.999;
        CoverPoint {
            value,
            gradient: std::array::from_fn(|i| place.point.gradient[i] + size * way[i] / length),
            ..place.point
        }
    }

    #[test]
    fn no_field_within_the_errors_covers_more_or_less() {
        let (mut random, mut shown, mut narrow) = (Random(3), [0; 2], 0);
        for n in 0..60_000 {
            let direction = [random.next(), random.next(), 1.0];
            let rays =
                Rays { direction, between: [0.25, 0.5, 1.0][n % 3], width: [0.25, 0.5, 2.0][n / 3 % 3], count: COUNT };
            let (place_in, far) = ([12.0, 9.0, 14.0], [0.0, 0.0, if n % 2 == 0 { 0.0 } else { 2000.0 }]);
            let first: [f32; 3] = std::array::from_fn(|i| (random.next() + 1.0) * 0.5 * place_in[i] - 0.5 + far[i]);
            let last = std::array::from_fn(|i| first[i] + rays.between * direction[i]);
            let error = 0.3 * random.next().abs().powi(6);
            let (from, to) = (place(&mut random, &rays, first, error), place(&mut random, &rays, last, error));
            let (value, opacity) = (0.4 * random.next(), [0.3, 0.7, 1.0][n % 3]);
            let bounds = Step { rays: &rays, from: &from, to: &to }.may_show(value, opacity);
            for _ in 0..6 {
                let [from, to] = [&from, &to].map(|place| moved(&mut random, place));
                let passes = (from.value < value) != (to.value < value);
                let found = rays.meeting(value, &from, &to).map_or(0.0, |meeting| meeting.opacity(opacity));
                let allowed = if passes { bounds.passed } else { bounds.turned };
                let Interval { least, most } =
                    allowed.map_or(Interval { least: 0.0, most: 0.0 }, |shown| shown.opacity);
                assert!(found <= most + 1e-5 && found >= least - 1e-5, "{n}: {found}, {least} to {most}, {passes}");
                shown[usize::from(passes)] += u32::from(found > 0.0);
                narrow += u32::from(found > 0.0 && most - least < 0.1);
            }
        }
        assert!(shown.iter().all(|n| *n > 1000) && narrow > 5000, "{shown:?} {narrow}");
    }
}
