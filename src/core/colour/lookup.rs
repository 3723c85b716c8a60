//! Looks up the 8-bit colours of a map, instead of computing a colour for every pixel.

use super::{Colour, Rgb, TransferFunction};

/// The colours at shares of a map's range, 0 to 1.
#[derive(Debug, Clone)]
pub(super) enum Lookup {
    /// Of a map with linear pieces: the colour of every step that has only one. Others are computed.
    Exact(Vec<Option<Rgb>>),
    /// Of a slow map: the colours at the steps, which are those between them up to rounding.
    Nearest(Vec<Option<Rgb>>),
}

/// Number of steps. In the named maps, 2 to 7 % of the steps have several colours.
const STEPS: usize = 1 << 14;

/// Number of steps for slow maps, enough that colours are exact up to rounding.
const SLOW_STEPS: usize = 1 << 13;

/// Steps whose colours come closer than this to the next level are computed: rounding may decide.
const MARGIN: f64 = 1e-9;

impl Lookup {
    /// The colours of a map over 0 to 1.
    pub(super) fn new(map: &TransferFunction) -> Self {
        if map.is_slow() {
            let colour = |n| map.colour(n as f64 / SLOW_STEPS as f64).map(bytes);
            return Self::Nearest((0..=SLOW_STEPS).map(colour).collect());
        }
        let mut lookup: Vec<Option<Rgb>> = Vec::with_capacity(STEPS + 1);
        let mut before = both_sides(map, 0.0);
        for n in 1..=STEPS {
            let here = both_sides(map, n as f64 / STEPS as f64);
            lookup.push(before.filter(|_| before == here));
            before = here;
        }
        lookup.push(None); // the share 1 itself
        for (point, _) in map.colour_points() {
            // Colours are linear up to this point, and from it on. It may lie between two steps.
            let sides = [point.next_down(), point, point.next_up()];
            let colours = sides.map(|share| both_sides(map, share));
            for step in sides.map(|share| ((share * STEPS as f64) as usize).min(STEPS)) {
                lookup[step] = lookup[step].filter(|colour| colours.iter().all(|side| *side == Some(*colour)));
            }
        }
        Self::Exact(lookup)
    }

    /// The colour at a share; `None` if it must be computed.
    #[inline]
    pub(super) fn colour(&self, share: f64) -> Option<Rgb> {
        match self {
            Self::Exact(_) => self.exact(share),
            Self::Nearest(colours) => colours.get((share * SLOW_STEPS as f64).round() as usize).copied().flatten(),
        }
    }

    /// The colour at a share, if it is exactly the map's.
    #[inline]
    pub(super) fn exact(&self, share: f64) -> Option<Rgb> {
        let Self::Exact(colours) = self else { return None };
        colours.get((share * STEPS as f64) as usize).copied().flatten()
    }
}

/// The colour at a share; `None` if a little more or less would be another colour.
fn both_sides(map: &TransferFunction, share: f64) -> Option<Rgb> {
    let colour = map.colour(share)?;
    let [less, more] = [-MARGIN, MARGIN].map(|margin| bytes(colour.map(|c| c + margin / 255.0)));
    (less == more).then_some(less)
}

/// Rounds to 8 bits per channel, halves up.
pub(super) fn bytes(colour: Colour) -> Rgb {
    colour.map(|c| {
        let (level, whole) = (c * 255.0, (c * 255.0) as u8);
        if level - f64::from(whole) >= 0.5 { whole.saturating_add(1) } else { whole } // f64::round is a slow call
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::colour::{ColourSpace, NAMES};

    /// Compares every colour with the map's own, at shares of all kinds.
    fn is_exact(map: &TransferFunction) -> f64 {
        let lookup = Lookup::new(map);
        let points: Vec<f64> = map.colour_points().iter().flat_map(|(p, _)| [p.next_down(), *p, p.next_up()]).collect();
        let even = (0..=100_000).map(|n| f64::from(n) / 1e5);
        let steps = (0..=STEPS).map(|n| n as f64 / STEPS as f64).flat_map(|s| [s.next_down(), s]);
        let (mut found, mut all) = (0.0, 0.0);
        for share in points.into_iter().chain(even).chain(steps).filter(|share| (0.0..=1.0).contains(share)) {
            let colour = lookup.colour(share);
            assert!(colour.is_none() || colour == map.colour(share).map(bytes), "{} at {share}", map.words());
            (found, all) = (found + f64::from(u8::from(colour.is_some())), all + 1.0);
        }
        found / all
    }

    #[test]
    fn looked_up_colours_are_the_computed_ones() {
        for name in NAMES {
            let found = is_exact(&TransferFunction::open(name).expect("a known map"));
            assert!(found > 0.9, "{name}: {found}");
        }
        let points = vec![(0.0, [0.1, 0.5, 1.0]), (0.3, [0.1, 0.1, 0.1]), (0.3, [0.9, 0.2, 0.7]), (1.0, [0.3; 3])];
        for space in [ColourSpace::Rgb, ColourSpace::Step] {
            let map = TransferFunction::from_points(points.clone(), space, None, None).expect("a map");
            is_exact(&map); // 0.1, 0.3 and 0.5 lie between two levels, so few colours are looked up
        }
    }

    #[test]
    fn jumps_between_steps_are_exact() {
        let grey = |points: &[(f64, f64)]| {
            let points = points.iter().map(|(share, level)| (*share, [*level; 3])).collect();
            is_exact(&TransferFunction::from_points(points, ColourSpace::Rgb, None, None).expect("a map"));
        };
        grey(&[(0.0, 0.2), (0.49995, 0.2), (0.5, 0.9), (0.5, 0.2), (1.0, 0.2)]);
        grey(&[(0.0, 0.0), (0.25, 64.502 / 255.0), (0.25, 64.2 / 255.0), (1.0, 1.0), (1.0, 0.3)]);
    }

    #[test]
    fn slow_maps_are_exact_up_to_rounding() {
        let points = vec![(0.0, [0.2, 0.3, 0.8]), (1.0, [0.7, 0.0, 0.1])];
        let map = TransferFunction::from_points(points, ColourSpace::Diverging, None, None).expect("two points");
        let lookup = Lookup::new(&map);
        for share in (0..=9999).map(|i| f64::from(i) / 9999.0) {
            let exact = bytes(map.colour(share).expect("a colour"));
            let found = lookup.colour(share).expect("every colour of a slow map");
            assert!(exact.iter().zip(found).all(|(a, b)| a.abs_diff(b) <= 1), "{share}: {exact:?}");
        }
    }
}
