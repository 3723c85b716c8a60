//! A transfer function ([Levoy](wavesplat_core::bibliography)) for one distance of slices, tabulated over the values: colours
//! times opacity, and opacity (eq 30), for rays of full length; colours and extinction for others.

use crate::render::batches::Units;
use wavesplat_core::colour::TransferFunction;

/// Entries of the table. An entry and its slope take 32 bytes, so that the table fits in a first-level cache.
pub(super) const ENTRIES: usize = 512;
const LAST: usize = ENTRIES - 1;

/// The largest opacity of a path of unit length: the rest is less than half a level of an 8-bit picture.
const MOST_OPAQUE: f64 = 1.0 - 1.0 / 512.0;

/// Shares of a step that count as nothing.
const NEAR: f64 = 1e-3;

/// Four numbers for every value, and their changes up to the next entry.
pub(super) type Entries = [[f32; 8]; ENTRIES];

/// The light and opacity of one slice for every value.
#[derive(Debug, Clone)]
pub(super) struct Table {
    transfer: TransferFunction,
    /// Length of a ray between two slices, in units of opacity.
    length: f64,
    pub(super) units: Units,
    /// Red, green and blue times the opacity, and minus the opacity; then the change up to the next entry.
    pub(super) entries: Box<Entries>,
    /// Red, green and blue, and the power of two by which light falls; then the change up to the next entry.
    pub(super) colours: Box<Entries>,
    /// The number of entries before each that are visible.
    visible: Vec<u16>,
}

/// The extinction along `length` units of a ray.
fn extinction(transfer: &TransferFunction, length: f64, value: f64) -> f64 {
    -libm::log1p(-transfer.opacity(value).min(MOST_OPAQUE)) * length
}

/// Red, green and blue times the opacity, and minus the opacity, of a slice in which rays are `length` units long.
fn light(transfer: &TransferFunction, length: f64, value: f64) -> [f64; 4] {
    let opacity = -libm::expm1(-extinction(transfer, length, value));
    let [r, g, b] = transfer.colour(value).unwrap_or_default();
    [r * opacity, g * opacity, b * opacity, -opacity]
}

/// The values of the first and the last colour or opacity.
fn range(transfer: &TransferFunction) -> (f64, f64) {
    let (colours, opacities) = (transfer.range(), transfer.opacity_range());
    (colours.0.min(opacities.0), colours.1.max(opacities.1))
}

/// The number of steps from the first to the last entry, such that the points of the opacities, and then those of the
/// colours, lie on entries as nearly as possible. Where a point of the opacities does not, the whole step is transparent
/// if any of it is: a ray may meet many such values.
fn steps(transfer: &TransferFunction, lo: f64, hi: f64) -> usize {
    let opacities = transfer.opacity_points();
    let [before, after] = [(lo - 1.0, opacities[0].1), (hi + 1.0, opacities[opacities.len() - 1].1)];
    let opacities = bends([&[before], opacities, &[after]].concat().as_slice());
    let colours = transfer.colour_points();
    let of_channel = |c: usize| bends(&colours.iter().map(|(v, colour)| (*v, colour[c])).collect::<Vec<_>>());
    let colours: Vec<_> = (0..3).flat_map(of_channel).collect();
    let off = |bends: &[(f64, f64)], steps: usize| -> f64 {
        let error = |(value, bend): &(f64, f64)| {
            let at = (value - lo) / (hi - lo) * steps as f64;
            let rest = at - at.floor();
            rest * (1.0 - rest) * bend
        };
        bends.iter().map(error).sum()
    };
    let off = |steps: usize| off(&opacities, steps) + COLOURS * off(&colours, steps);
    (ENTRIES / 2..=LAST).rev().min_by(|a, b| off(*a).total_cmp(&off(*b))).unwrap_or(LAST)
}

/// How much less a point of the colours counts than one of the opacities.
const COLOURS: f64 = 1e-3;

/// The inner points of a polyline, and how much it bends there.
fn bends(points: &[(f64, f64)]) -> Vec<(f64, f64)> {
    let slope = |pair: &[(f64, f64)]| (pair[1].1 - pair[0].1) / (pair[1].0 - pair[0].0);
    let bend = |three: &[(f64, f64)]| (slope(&three[1..]) - slope(&three[..2])).abs().min(1e300);
    points.windows(3).map(|three| (three[1].0, bend(three))).collect()
}

/// The largest change, within an eighth of the range of values, of the opacity of a path of `length` units.
pub(super) fn change(transfer: &TransferFunction, length: f64) -> f64 {
    const PARTS: usize = 64;
    let (lo, hi) = range(transfer);
    let opacity = |n: usize| -light(transfer, length, lo + (hi - lo) * n as f64 / PARTS as f64)[3];
    let opacities: Vec<f64> = (0..=PARTS).map(opacity).collect();
    let change = |opacities: &[f64]| {
        let ends = opacities.iter().fold((1.0_f64, 0.0_f64), |(lo, hi), a| (lo.min(*a), hi.max(*a)));
        ends.1 - ends.0
    };
    opacities.windows(PARTS / 8 + 1).map(change).fold(0.0, f64::max)
}

impl Table {
    /// The table for slices whose rays are `length` units of opacity long.
    pub(super) fn new(transfer: &TransferFunction, length: f64) -> Self {
        let (lo, hi) = range(transfer);
        let last = steps(transfer, lo, hi);
        let units = Units { zero: lo, per: last as f64 / (hi - lo) };
        let value = |at: f64| lo + (at / units.per).min(hi - lo);
        let light = |at: f64| light(transfer, length, value(at)).map(|number| number as f32);
        let colour = |at: f64| {
            let [r, g, b] = transfer.colour(value(at)).unwrap_or_default();
            [r, g, b, extinction(transfer, length, value(at)) * std::f64::consts::LOG2_E].map(|number| number as f32)
        };
        // Where a value next to a transparent end is transparent, the opacities have a point inside.
        let is_edge = |n: usize| {
            let near = [light(n as f64 + NEAR), light((n + 1) as f64 - NEAR)];
            let ends = [n, n + 1].map(|n| light(place(n, last))[3] == 0.0);
            ends[0] != ends[1] && near.iter().any(|light| light[3] == 0.0)
        };
        let is_edge: Vec<bool> = (0..ENTRIES).map(is_edge).collect();
        let entries = entries(last, light, |n, light| if is_edge[n] { [0.0; 4] } else { light });
        let colours = |n: usize, [r, g, b, extinction]: [f32; 4]| [r, g, b, if is_edge[n] { 0.0 } else { extinction }];
        let colours = self::entries(last, colour, colours);
        let count = |sum: &mut u16, entry: &[f32; 8]| {
            *sum += u16::from(entry[3] != 0.0);
            Some(*sum)
        };
        let visible = std::iter::once(0).chain(entries.iter().scan(0, count)).collect();
        Self { transfer: transfer.clone(), length, units, entries, colours, visible }
    }

    /// A gradient, in these units per world unit, whose direction means little: a hundredth of the range within eight
    /// voxels.
    pub(super) fn faint(&self, spacing: f64) -> f64 {
        0.01 * LAST as f64 / (8.0 * spacing)
    }

    /// The light and minus the opacity of a number of these units.
    pub(super) fn at(&self, number: f32) -> [f32; 4] {
        interpolated(&self.entries, number)
    }

    /// The same for a share of a slice, from the colours and the extinction.
    fn share_at(&self, number: f32, share: f32) -> [f32; 4] {
        let [r, g, b, power] = interpolated(&self.colours, number);
        let opacity = 1.0 - (-power * share).exp2();
        [r * opacity, g * opacity, b * opacity, -opacity]
    }

    /// Whether a number from `lo` to `hi` has an opacity.
    pub(super) fn shows(&self, lo: f32, hi: f32) -> bool {
        if lo > hi {
            return false;
        }
        let [first, last] = [lo, hi].map(|number| number.clamp(0.0, LAST as f32));
        let from = first as usize + usize::from(first > (first as usize) as f32);
        let to = last as usize + 1;
        let within = from < to && self.visible[to] > self.visible[from];
        within || [first, last].iter().any(|number| self.at(*number)[3] != 0.0)
    }

    /// The exact light and minus the opacity of a value, for a share of a slice.
    pub(super) fn exact(&self, value: f64, share: f64) -> [f64; 4] {
        light(&self.transfer, self.length * share, value)
    }

    /// The largest error of a slice's light and opacity that the table makes, found at eight values per entry.
    pub(super) fn error(&self) -> f64 {
        self.error_of(1.0, |number| self.at(number))
    }

    /// The largest error for rays that cross only a part of a slice, found for four lengths.
    pub(super) fn error_of_parts(&self) -> f64 {
        let of_share = |share: f32| self.error_of(f64::from(share), |number| self.share_at(number, share));
        [1.0, 0.5, 0.25, 0.125].map(of_share).into_iter().fold(0.0, f64::max)
    }

    fn error_of(&self, share: f64, at: impl Fn(f32) -> [f32; 4]) -> f64 {
        let off = |value: f64| {
            let (found, exact) = (at(self.units.number(value)), self.exact(value, share));
            found.iter().zip(exact).map(|(found, exact)| (f64::from(*found) - exact).abs()).fold(0.0, f64::max)
        };
        let values = (0..8 * ENTRIES).map(|n| self.units.zero + (n as f64 + 0.5) / (8.0 * self.units.per));
        values.map(off).fold(0.0, f64::max)
    }
}

/// The numbers between two entries.
fn interpolated(entries: &Entries, number: f32) -> [f32; 4] {
    let at = number.clamp(0.0, LAST as f32);
    let (n, rest) = (at as usize, at.fract());
    std::array::from_fn(|i| entries[n][i] + rest * entries[n][4 + i])
}

/// The place of an entry; beyond the last value, one that is far enough to have this value.
fn place(n: usize, last: usize) -> f64 {
    if n < last { n as f64 } else { 1e9 }
}

/// Tabulates four numbers, which are given at the places from 0 to `last`. `within` may change those of an entry's step.
fn entries(
    last: usize,
    numbers: impl Fn(f64) -> [f32; 4],
    within: impl Fn(usize, [f32; 4]) -> [f32; 4],
) -> Box<Entries> {
    let ends: Vec<[f32; 4]> = (0..=ENTRIES).map(|n| numbers(place(n, last))).collect();
    let entry = |n: usize| {
        let (from, to) = (within(n, ends[n]), within(n, ends[n + 1]));
        std::array::from_fn(|i| if i < 4 { from[i] } else { to[i - 4] - from[i - 4] })
    };
    Box::new(std::array::from_fn(entry))
}

/// The light of slabs that count as one slice.
pub(super) struct SlabTable {
    pub(super) table: Table,
    /// The largest change of the values from slab to slab, at each entry, for which one slice is as good as several.
    pub(super) steady: Box<[f32; ENTRIES]>,
}

impl SlabTable {
    /// For slabs of `parts` slices, whose light is that of `slices`.
    pub(super) fn new(slices: &Table, parts: usize) -> Self {
        let table = Table::new(&slices.transfer, slices.length * parts as f64);
        let at_entry: Vec<f32> = (0..=ENTRIES).map(|n| table.steady(slices, parts, n as f32)).collect();
        let steady = Box::new(std::array::from_fn(|n| at_entry[n].min(at_entry[n + 1])));
        Self { table, steady }
    }
}

/// A slab counts as one slice if light and opacity, without shading, are off by less than this. With ten times as much, shaded pictures
/// are off by more than without slabs.
const SAME: f32 = 1e-5;
/// How much more a value may change within a slab than from the slab before.
const CAUTION: f32 = 2.0;

impl Table {
    /// The largest change from the slab before for which the light of a slab around a value is that of its slices.
    fn steady(&self, slices: &Self, parts: usize, value: f32) -> f32 {
        let changes = (0..=4 * ENTRIES.ilog2()).map(|n| 0.5 * 2.0_f32.powf(n as f32 / 4.0));
        let is_same =
            |change: &f32| [-change, *change].iter().all(|change| self.off(slices, parts, value, *change) < SAME);
        changes.take_while(is_same).last().unwrap_or(0.0) / CAUTION
    }

    /// How far the light of a slab is from that of its slices, along which the value changes by `change`.
    fn off(&self, slices: &Self, parts: usize, value: f32, change: f32) -> f32 {
        let mut light = [0.0, 0.0, 0.0, 1.0];
        for part in 0..parts {
            let (place, through) = ((part as f32 + 0.5) / parts as f32 - 0.5, light[3]);
            let of_slice = slices.at(value + place * change);
            light.iter_mut().zip(of_slice).for_each(|(light, more)| *light += through * more);
        }
        light[3] -= 1.0;
        light.iter().zip(self.at(value)).map(|(light, slab)| (light - slab).abs()).fold(0.0, f32::max)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use wavesplat_core::colour::NAMES;

    fn grey() -> TransferFunction {
        TransferFunction::open("grey").expect("a map")
    }

    #[test]
    fn a_path_of_unit_length_has_the_requested_opacity() {
        let table = Table::new(&grey().over((10.0, 20.0)).expect("a range"), 1.0);
        for (value, opacity) in [(10.0, 0.0), (12.5, 0.25), (15.0, 0.5), (19.0, 0.9), (25.0, MOST_OPAQUE), (0.0, 0.0)] {
            let [r, .., minus] = table.at(table.units.number(value));
            assert!((f64::from(-minus) - opacity).abs() < 1e-5, "{value}");
            let grey = ((value - 10.0) / 10.0).clamp(0.0, 1.0);
            assert!((f64::from(r) - grey * opacity).abs() < 1e-5, "{value}");
        }
        let half = Table::new(&grey().over((10.0, 20.0)).expect("a range"), 0.5);
        let opacity = -half.at(half.units.number(17.5))[3];
        assert!((f64::from(opacity) - 0.5).abs() < 1e-5, "two of these have 0.75: {opacity}");
    }

    #[test]
    fn ranges_without_opacity_are_not_visible() {
        let table = Table::new(&grey().with_opacity(&[(0.4, 0.0), (0.5, 1.0), (0.6, 0.0)]).expect("points"), 1.0);
        let number = |value: f64| table.units.number(value);
        for (lo, hi, shows) in [
            (0.0, 0.39, false),
            (0.61, 1.0, false),
            (-5.0, -1.0, false),
            (0.3, 0.45, true),
            (0.3, 0.8, true),
            (0.5, 0.5, true),
            (0.4123, 0.4124, true),
            (2.0, 9.0, false),
        ] {
            assert_eq!(table.shows(number(lo), number(hi)), shows, "{lo} to {hi}");
        }
        assert!(table.shows(f32::NEG_INFINITY, f32::INFINITY) && !table.shows(f32::INFINITY, f32::NEG_INFINITY));
    }

    #[test]
    fn transparent_values_remain_so() {
        for points in [vec![(0.2, 0.0), (0.6, 0.3), (0.9, 0.9)], vec![(0.123, 0.0), (0.456, 1.0), (0.789, 0.0)]] {
            let table =
                Table::new(&grey().with_opacity(&points).expect("points").over((-1.0, 4.0)).expect("a range"), 1.0);
            let value = |share: f64| table.units.number(-1.0 + 5.0 * share);
            assert!(!table.shows(value(0.0), value(points[0].0)), "{points:?}");
        }
    }

    #[test]
    fn the_error_of_the_table_is_that_of_its_steps() {
        assert!(Table::new(&grey(), 1.0).error() < 1e-4);
        // The extinction rises steeply where almost nothing passes.
        let of_parts = Table::new(&grey(), 1.0).error_of_parts();
        assert!((1e-3..5e-3).contains(&of_parts), "{of_parts:e}");
        for map in NAMES {
            let flat = TransferFunction::open(map).and_then(|map| map.over((3.0, 4.5))).expect("a map");
            let error = Table::new(&flat.with_opacity(&[(0.0, 0.1), (1.0, 0.1)]).expect("points"), 1.0).error();
            assert!(error < 1e-5, "{map}: {error:e}");
        }
        let sharp = grey().with_opacity(&[(0.5, 0.0), (0.5001, 1.0)]).expect("points");
        assert!(Table::new(&sharp, 1.0).error() > 0.1);
    }

    /// The slices' light is computed from the transfer function here, at values that change as much as they may.
    #[test]
    fn slabs_that_count_as_one_slice_have_the_light_of_their_slices() {
        let peaks = vec![(0.1, 0.0), (0.2, 0.6), (0.3, 0.0), (0.6, 0.0), (0.61, 0.9), (1.0, 1.0)];
        for (points, parts) in [(peaks, 8), (vec![(0.0, 0.0), (1.0, 1.0)], 3), (vec![(0.4, 0.0), (0.5, 0.02)], 2)] {
            let map = TransferFunction::open("viridis").expect("a map").with_opacity(&points).expect("points");
            let slices = Table::new(&map, 0.9 / parts as f64);
            let slabs = SlabTable::new(&slices, parts);
            // A little more between the entries and changes that were tested.
            let allowed = 1.2 * f64::from(SAME) + slabs.table.error() + parts as f64 * slices.error();
            let value = |number: f32| f64::from(number) / slices.units.per + slices.units.zero;
            for n in 0..20_000_u32 {
                let number = (n.wrapping_mul(2_654_435_761) >> 8) as f32 / 30_000.0 - 20.0;
                let most = CAUTION * slabs.steady[number.clamp(0.0, LAST as f32) as usize];
                let change = if n % 2 == 0 { most } else { -most };
                let mut light = [0.0, 0.0, 0.0, 1.0];
                for part in 0..parts {
                    let (place, through) = ((part as f32 + 0.5) / parts as f32 - 0.5, light[3]);
                    let of_slice = slices.exact(value(number + place * change), 1.0);
                    light.iter_mut().zip(of_slice).for_each(|(light, more)| *light += through * more);
                }
                light[3] -= 1.0;
                let of_slab = slabs.table.exact(value(number), 1.0);
                let off = light.iter().zip(of_slab).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
                assert!(off < allowed, "{points:?} {number} {change}: {off:e}");
            }
            let [much, little] = [|most: &&f32| **most >= 1.0, |most: &&f32| **most < 0.5];
            let [much, little] = [slabs.steady.iter().filter(much).count(), slabs.steady.iter().filter(little).count()];
            assert!(much > 15 && (parts == 2 || little > 50), "{points:?}: {much} {little}");
        }
    }
}
