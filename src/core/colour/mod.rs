//! Maps values to colours and opacities.
//!
//! A [`TransferFunction`] maps every value to a colour and, for composites, to an opacity. It is a named map over a
//! range, or comes from a file (`file`). It is applied to samples before the transform (eq 28), to the means of pixels
//! after projection, or along the ray (eq 31). [`Scale`] colours pixels.

mod distribution;
mod file;
mod lab;
mod list;
mod lookup;
mod named;
mod opacities;
mod paraview;
mod scale;
mod space;
mod table;

pub use distribution::{Common, Distribution};
pub use named::NAMES;
use named::Named;
pub use opacities::{At, Opacities, OpacityPoints};
pub use scale::{Clear, Norm, Scale};
pub use space::ColourSpace;

use crate::base::error::{Error, Result};
use std::path::Path;

/// Red, green and blue, 0 to 1.
pub type Colour = [f64; 3];

/// Red, green and blue, 8 bits per channel.
pub type Rgb = [u8; 3];

/// A map from values to colours and opacities.
#[derive(Debug, Clone, PartialEq)]
pub struct TransferFunction {
    colours: Colours,
    /// (value, opacity), ascending by value, two or more.
    opacity: Vec<(f64, f64)>,
    /// The colour of NaN, if a file gives one.
    nan: Option<Colour>,
    /// The values of the first and the last colour.
    range: (f64, f64),
    /// Whether the range was given; otherwise it is 0 to 1 by default.
    of_values: bool,
}

#[derive(Debug, Clone, PartialEq)]
enum Colours {
    /// One of [`NAMES`].
    Named(&'static Named),
    /// (value, colour), ascending by value, two or more, and the space of interpolation.
    Points(Vec<(f64, Colour)>, ColourSpace),
}

impl TransferFunction {
    /// Opens a map by its name; or makes one of a list of colours, `#0000ff,#ffffff`; or opens a file: ParaView's JSON
    /// (`FILE.json#MAP` if it holds several maps) or CSV.
    ///
    /// # Errors
    /// An unknown name, a wrong list, or a file that cannot be read or is not a colour map.
    pub fn open(name: &str) -> Result<Self> {
        if let Some(named) = named::known(name) {
            return Ok(Self::named(named));
        }
        if list::is_list(name) {
            return list::parse(name).map_err(|what| Error::setting("colours", what));
        }
        let path = Path::new(file::split(name).0);
        if path.extension().is_none() && !path.exists() {
            let what = format!("no such colour map or file; the maps are {}", NAMES.join(" "));
            return Err(Error::path(name, what));
        }
        file::read(name)
    }

    fn named(named: &'static Named) -> Self {
        let (range, opacity) = ((0.0, 1.0), ramp((0.0, 1.0)));
        Self { colours: Colours::Named(named), opacity, nan: None, range, of_values: false }
    }

    /// A map of points (value, colour). By default, the opacity rises from 0 at the first value to 1 at the last.
    ///
    /// # Errors
    /// Fewer than two points, values that do not ascend or are all equal, values that are not finite, or colours and
    /// opacities outside 0 to 1. The message is worded to follow the name of the file.
    pub fn from_points(
        points: Vec<(f64, Colour)>,
        space: ColourSpace,
        opacity: Option<Vec<(f64, f64)>>,
        nan: Option<Colour>,
    ) -> std::result::Result<Self, String> {
        check_points("colours", points.iter().map(|(v, c)| (*v, c.as_slice())))?;
        let range = (points[0].0, points[points.len() - 1].0);
        let opacity = opacity.unwrap_or_else(|| ramp(range));
        check_points("opacities", opacity.iter().map(|(v, a)| (*v, std::slice::from_ref(a))))?;
        if let Some(wrong) = nan.iter().flatten().find(|c| !(0.0..=1.0).contains(*c)) {
            return Err(format!("NaN's colour has {wrong}, where 0 to 1 is expected"));
        }
        Ok(Self { colours: Colours::Points(points, space), opacity, nan, range, of_values: true })
    }

    /// Whether the map has a range of values. A named map has none until [`Self::over`] sets it.
    pub fn is_of_values(&self) -> bool {
        self.of_values
    }

    /// The values of the first and the last colour.
    pub fn range(&self) -> (f64, f64) {
        self.range
    }

    /// The same colours and opacities, stretched over another range.
    ///
    /// # Errors
    /// A range that is empty, out of order or not finite.
    pub fn over(&self, range: (f64, f64)) -> Result<Self> {
        check_range(range)?;
        let (from, to) = self.range;
        let within = |v: f64| if (from..=to).contains(&v) { range } else { (f64::MIN, f64::MAX) };
        let moved = |v: f64| {
            let (least, most) = within(v); // keeps rounding inside the range
            (range.0 + (v - from) / (to - from) * (range.1 - range.0)).clamp(least, most)
        };
        let colours = match &self.colours {
            Colours::Named(name) => Colours::Named(name),
            Colours::Points(points, space) => {
                Colours::Points(points.iter().map(|(v, c)| (moved(*v), *c)).collect(), *space)
            }
        };
        let opacity = self.opacity.iter().map(|(v, a)| (moved(*v), *a)).collect();
        Ok(Self { colours, opacity, nan: self.nan, range, of_values: true })
    }

    /// The same colours with other opacities: points (share of the range, opacity).
    ///
    /// # Errors
    /// The same as for [`Self::from_points`].
    pub fn with_opacity(&self, at_shares: &[(f64, f64)]) -> std::result::Result<Self, String> {
        check_points("opacities", at_shares.iter().map(|(v, a)| (*v, std::slice::from_ref(a))))?;
        if let Some((share, _)) = at_shares.iter().find(|(share, _)| !(0.0..=1.0).contains(share)) {
            return Err(format!("{share} is no share of the range, 0 to 1"));
        }
        let (lo, hi) = self.range;
        let opacity = at_shares.iter().map(|(share, a)| (lo + share * (hi - lo), *a)).collect();
        Ok(Self { opacity, ..self.clone() })
    }

    /// The colour of a value. Values beyond the range get the colour of the nearer end. `None` for NaN, unless a file
    /// gives a colour for it.
    pub fn colour(&self, value: f64) -> Option<Colour> {
        if value.is_nan() {
            return self.nan;
        }
        Some(match &self.colours {
            Colours::Named(named) => named.colour(self.share(value)),
            Colours::Points(points, space) => match Place::new(points, value) {
                Place::Between { a, b, share } => space.between(*a, *b, share),
                Place::Beyond(end) => *end,
            },
        })
    }

    /// The share of the range at a value, 0 to 1.
    fn share(&self, value: f64) -> f64 {
        ((value - self.range.0) / (self.range.1 - self.range.0)).clamp(0.0, 1.0)
    }

    /// One channel of [`Self::colour`], with the same bits: 0 for red, 1 for green, 2 for blue. Faster than all three where colours are
    /// mixed in RGB.
    pub fn component(&self, value: f64, channel: usize) -> Option<f64> {
        if value.is_nan() {
            return self.nan.map(|colour| colour[channel]);
        }
        let mix = |a: &Colour, b: &Colour, share| space::mix(a[channel], b[channel], share).clamp(0.0, 1.0);
        match &self.colours {
            Colours::Named(named) => Some(named.between(self.share(value), mix)),
            Colours::Points(points, ColourSpace::Rgb) => Some(match Place::new(points, value) {
                Place::Between { a, b, share } => mix(a, b, share),
                Place::Beyond(end) => end[channel],
            }),
            Colours::Points(..) => self.colour(value).map(|colour| colour[channel]),
        }
    }

    /// The opacity of a value, 0 to 1. Values beyond the points get the opacity of the nearer end; NaN gets 0.
    pub fn opacity(&self, value: f64) -> f64 {
        match Place::new(&self.opacity, value) {
            _ if value.is_nan() => 0.0,
            Place::Between { a, b, share } => space::mix(*a, *b, share),
            Place::Beyond(end) => *end,
        }
    }

    /// The points (value, opacity), ascending by value.
    pub fn opacity_points(&self) -> &[(f64, f64)] {
        &self.opacity
    }

    /// The points (value, colour) between which colours are interpolated, ascending by value.
    pub fn colour_points(&self) -> Vec<(f64, Colour)> {
        let (lo, hi) = self.range;
        match &self.colours {
            Colours::Named(named) => named.points().map(|(share, c)| (lo + share * (hi - lo), c)).collect(),
            Colours::Points(points, _) => points.clone(),
        }
    }

    /// The values of the first and the last opacity.
    pub fn opacity_range(&self) -> (f64, f64) {
        (self.opacity[0].0, self.opacity[self.opacity.len() - 1].0)
    }

    /// Whether the colours diverge from a middle colour.
    pub fn is_diverging(&self) -> bool {
        match &self.colours {
            Colours::Named(named) => named.is_diverging(),
            Colours::Points(_, space) => *space == ColourSpace::Diverging,
        }
    }

    /// The range to stretch the map over for values from `lo` to `hi`. It is symmetric around 0 if the colours diverge
    /// and the values lie on both sides of 0, and begins at 0 if the values are positive and not far from 0. It is never
    /// empty.
    pub fn suitable(&self, (lo, hi): (f64, f64)) -> (f64, f64) {
        /// A side shorter than this share of the other does not count: values that end near 0 may overshoot a little.
        const SIDE: f64 = 0.05;
        /// A range that begins below this share of its end begins at 0.
        const NEAR: f64 = 0.25;
        if self.is_diverging() && lo < -SIDE * hi && hi > -SIDE * lo {
            return (-hi.max(-lo), hi.max(-lo));
        }
        let lo = if (0.0..NEAR * hi).contains(&lo) { 0.0 } else { lo };
        (lo, if lo < hi { hi } else { lo + lo.abs().max(1.0) })
    }

    /// The name of a named map; `None` for points.
    pub fn name(&self) -> Option<&'static str> {
        match &self.colours {
            Colours::Named(named) => Some(named.name),
            Colours::Points(..) => None,
        }
    }

    /// A short description of the colours and their range, for people.
    pub fn words(&self) -> String {
        let (lo, hi) = self.range;
        format!("{} from {lo} to {hi}", self.description())
    }

    /// The name of a named map, or the number of points and their colour space.
    pub fn description(&self) -> String {
        match &self.colours {
            Colours::Named(named) => named.name.into(),
            Colours::Points(points, space) => format!("{} points ({})", points.len(), space.name()),
        }
    }

    /// The opacities as VALUE:A,..., or their number if there are many.
    pub fn opacity_words(&self) -> String {
        const MOST: usize = 32;
        let points: Vec<String> = self.opacity.iter().map(|(value, opacity)| format!("{value}:{opacity}")).collect();
        if points.len() <= MOST { points.join(",") } else { format!("{} points", points.len()) }
    }

    /// Whether all colours are greys.
    fn is_grey(&self) -> bool {
        matches!(&self.colours, Colours::Named(named) if named.name == "grey")
    }

    /// Whether computing a colour is slow enough to tabulate the colours.
    fn is_slow(&self) -> bool {
        match &self.colours {
            Colours::Named(_) => false,
            Colours::Points(_, space) => !matches!(space, ColourSpace::Rgb | ColourSpace::Step),
        }
    }

    /// The colours as text. [`Self::parse`] restores them exactly.
    pub(crate) fn text(&self) -> String {
        match &self.colours {
            Colours::Named(named) => format!("{} {:?} {:?}", named.name, self.range.0, self.range.1),
            Colours::Points(points, space) => {
                let point = |(v, [r, g, b]): &(f64, Colour)| format!("{v:?} {r:?} {g:?} {b:?}");
                let points: Vec<String> = points.iter().map(point).collect();
                format!("{}; {}", space.name(), points.join("; "))
            }
        }
    }

    /// Restores the colours from `text`; `None` for any other text.
    pub fn parse(text: &str) -> Option<Self> {
        let numbers = |text: &str| text.split_whitespace().map(|n| n.parse().ok()).collect::<Option<Vec<f64>>>();
        let Some((space, points)) = text.split_once(';') else {
            let (name, range) = text.split_once(' ')?;
            let [lo, hi] = numbers(range)?.try_into().ok()?;
            return Self::named(named::known(name)?).over((lo, hi)).ok();
        };
        let point = |text: &str| numbers(text)?.try_into().ok().map(|[v, r, g, b]: [f64; 4]| (v, [r, g, b]));
        let points = points.split(';').map(point).collect::<Option<Vec<_>>>()?;
        Self::from_points(points, ColourSpace::named(space)?, None, None).ok()
    }
}

/// An error if a requested range is empty or invalid.
fn check_range((lo, hi): (f64, f64)) -> Result<()> {
    let wrong = match (hi - lo).is_finite() {
        true if lo < hi => return Ok(()),
        true if lo == hi => "an empty range shows nothing; give two numbers, the lower one first",
        true => "takes two numbers, the lower one first",
        false => "takes two finite numbers, the lower one first, that are not too far apart",
    };
    Err(Error::setting("range", format!("{wrong}, not {lo},{hi}")))
}

/// Opacity from 0 to 1 over a range.
fn ramp((lo, hi): (f64, f64)) -> Vec<(f64, f64)> {
    vec![(lo, 0.0), (hi, 1.0)]
}

/// Where a value lies among points.
enum Place<'a, T> {
    /// At a share of the way from one point to the next.
    Between { a: &'a T, b: &'a T, share: f64 },
    /// Before the first point or behind the last.
    Beyond(&'a T),
}

impl<'a, T> Place<'a, T> {
    /// The place of a value. If two points have the same value, the second one holds from there on.
    fn new(points: &'a [(f64, T)], value: f64) -> Self {
        let next = match points.len() {
            ..=FEW_POINTS => points.iter().map(|(v, _)| usize::from(*v <= value)).sum(), // without branches
            _ => points.partition_point(|(v, _)| *v <= value),
        };
        match (next.checked_sub(1).map(|last| &points[last]), points.get(next)) {
            (Some((from, a)), Some((to, b))) => Self::Between { a, b, share: (value - from) / (to - from) },
            (Some((_, end)), None) | (None, Some((_, end))) => Self::Beyond(end),
            (None, None) => unreachable!("two points or more"),
        }
    }
}

/// Up to so many points, comparing all is faster than a search.
const FEW_POINTS: usize = 16;

/// The largest number of points: enough for any map, and few enough for the settings of a file.
const MOST_POINTS: usize = 1 << 16;

/// Checks that there are two or more points with ascending values and components of 0 to 1. A value may repeat, for a
/// step.
fn check_points<'a>(what: &str, points: impl Iterator<Item = (f64, &'a [f64])>) -> std::result::Result<(), String> {
    let (mut count, mut first, mut last) = (0, f64::INFINITY, f64::NEG_INFINITY);
    for (n, (value, components)) in (1..).zip(points) {
        if !value.is_finite() {
            return Err(format!("point {n} of its {what} has the value {value}, where a finite number is expected"));
        }
        if value < last {
            let what = format!("the values of its {what} are expected to ascend");
            return Err(format!("{what}; point {n} has {value} after {last}"));
        }
        if let Some(wrong) = components.iter().find(|c| !(0.0..=1.0).contains(*c)) {
            return Err(format!("point {n} of its {what} has {wrong}, where 0 to 1 is expected"));
        }
        (count, first, last) = (n, first.min(value), value);
    }
    match count {
        _ if count > MOST_POINTS => Err(format!("has {count} points of {what}, where {MOST_POINTS} are the most")),
        2.. if first == last => Err(format!("all of its {what} have the value {last}, where a range is expected")),
        2.. if !(last - first).is_finite() => {
            Err(format!("the values {first} and {last} of its {what} are too far apart"))
        }
        0 | 1 => Err(format!("has {count} point(s) of {what}, where two or more are expected")),
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn components_are_those_of_colours() {
        let points = vec![(-1.0, [0.1, 0.5, 1.0]), (0.3, [0.1, 0.1, 0.1]), (0.3, [0.9, 0.2, 0.7]), (2.0, [0.3; 3])];
        let many =
            (0..40).map(|n| (f64::from(n) / 9.0, [f64::from(n % 7) / 7.0, f64::from(n % 3) / 3.0, 0.5])).collect();
        let of_points =
            |points, space| TransferFunction::from_points(points, space, None, Some([0.25, 0.5, 0.75])).expect("a map");
        let named = NAMES.map(|name| TransferFunction::open(name).expect("a known map"));
        let spaces = [ColourSpace::Rgb, ColourSpace::Hsv, ColourSpace::Lab, ColourSpace::Step];
        let maps = named.into_iter().chain(spaces.map(|space| of_points(points.clone(), space)));
        for map in maps.chain([of_points(many, ColourSpace::Rgb)]) {
            let values = (-30..90).map(|n| f64::from(n) / 29.0).chain([0.3, -1.0, 2.0, f64::INFINITY, f64::NAN]);
            for value in values {
                let components = [0, 1, 2].map(|channel| map.component(value, channel));
                let colour = map.colour(value).map_or([None; 3], |colour| colour.map(Some));
                assert_eq!(components, colour, "{} at {value}", map.words());
            }
        }
    }
}
