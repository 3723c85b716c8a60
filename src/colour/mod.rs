//! Values to colours and opacities.
//!
//! A [`TransferFunction`] is a colour, and where it is asked for an opacity, for every value: one of the field's named
//! maps over a range, or what a file says (`file`). It is applied to samples before the transform (eq 28), to the means
//! of pixels after projection, or along the ray (eq 31). [`Scale`] colours pixels.

mod file;
mod lab;
mod named;
mod paraview;
mod scale;
mod space;
mod table;

pub use named::NAMES;
use named::Named;
pub use scale::{Norm, Scale};
pub use space::ColourSpace;

use crate::base::error::{Error, Result};
use std::path::Path;

/// Red, green and blue, 0 to 1.
pub type Colour = [f64; 3];

/// A colour, 8 bits a channel.
pub type Rgb = [u8; 3];

/// A colour and an opacity for every value.
#[derive(Debug, Clone, PartialEq)]
pub struct TransferFunction {
    colours: Colours,
    /// (value, opacity), ascending, two or more.
    opacity: Vec<(f64, f64)>,
    /// Of NaN, if a file says it.
    nan: Option<Colour>,
    /// The values of the first and the last colour.
    range: (f64, f64),
    /// Whether the range means something, or is 0 to 1 as long as nobody gave another.
    of_values: bool,
}

#[derive(Debug, Clone, PartialEq)]
enum Colours {
    /// One of [`NAMES`].
    Named(&'static Named),
    /// (value, colour), ascending, two or more, and how to get from one to the next.
    Points(Vec<(f64, Colour)>, ColourSpace),
}

impl TransferFunction {
    /// A map by its name, or that of a file: ParaView's JSON, with `#` and the map's name if it holds several, or CSV.
    pub fn open(name: &str) -> Result<Self> {
        if let Some(named) = named::known(name) {
            return Ok(Self::named(named));
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

    /// Of points of some values and, unless it is to run from 0 at the first to 1 at the last of them, of opacities.
    ///
    /// # Errors
    /// Fewer than two points, values that are not ascending or all the same, or anything that is not finite or not
    /// within 0 to 1: in words that follow a name.
    pub fn of_points(
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

    /// Whether it is of certain values; of a mere name the range is to be given.
    pub fn is_of_values(&self) -> bool {
        self.of_values
    }

    /// The values of the first and the last colour.
    pub fn range(&self) -> (f64, f64) {
        self.range
    }

    /// The same colours and opacities, stretched over another range.
    pub fn over(&self, range: (f64, f64)) -> Result<Self> {
        check_range(range)?;
        let (from, to) = self.range;
        let within = |v: f64| if (from..=to).contains(&v) { range } else { (f64::MIN, f64::MAX) };
        let moved = |v: f64| {
            let (least, most) = within(v); // and not what rounding makes of it
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

    /// The same colours with other opacities, at shares of the range.
    ///
    /// # Errors
    /// As [`Self::of_points`], in words that follow a name.
    pub fn with_opacity(&self, at_shares: &[(f64, f64)]) -> std::result::Result<Self, String> {
        check_points("opacities", at_shares.iter().map(|(v, a)| (*v, std::slice::from_ref(a))))?;
        if let Some((share, _)) = at_shares.iter().find(|(share, _)| !(0.0..=1.0).contains(share)) {
            return Err(format!("{share} is no share of the range, 0 to 1"));
        }
        let (lo, hi) = self.range;
        let opacity = at_shares.iter().map(|(share, a)| (lo + share * (hi - lo), *a)).collect();
        Ok(Self { opacity, ..self.clone() })
    }

    /// The colour of a value: beyond the range the end's; of NaN none, unless a file says one.
    pub fn colour(&self, value: f64) -> Option<Colour> {
        if value.is_nan() {
            return self.nan;
        }
        Some(match &self.colours {
            Colours::Named(named) => {
                let share = (value - self.range.0) / (self.range.1 - self.range.0);
                named.colour(share.clamp(0.0, 1.0))
            }
            Colours::Points(points, space) => between(points, value, |a, b, t| space.between(*a, *b, t)),
        })
    }

    /// The opacity of a value, 0 to 1: beyond its points that of the end; of NaN 0.
    pub fn opacity(&self, value: f64) -> f64 {
        if value.is_nan() { 0.0 } else { between(&self.opacity, value, |a, b, t| a + (b - a) * t) }
    }

    /// The values of the first and the last opacity.
    pub(crate) fn opacity_range(&self) -> (f64, f64) {
        (self.opacity[0].0, self.opacity[self.opacity.len() - 1].0)
    }

    /// Whether colours lie to both sides of a middle one.
    pub fn is_diverging(&self) -> bool {
        match &self.colours {
            Colours::Named(named) => named.is_diverging(),
            Colours::Points(_, space) => *space == ColourSpace::Diverging,
        }
    }

    /// What it is best stretched over for values of a range: where they lie to both sides of 0, and its colours to both
    /// sides of a middle one, to both sides of 0 alike. Never empty.
    pub fn suitable(&self, (lo, hi): (f64, f64)) -> (f64, f64) {
        /// Less on one side than this share of the other is as good as none: what is around 0, and off by a little.
        const SIDE: f64 = 0.05;
        if self.is_diverging() && lo < -SIDE * hi && hi > -SIDE * lo {
            return (-hi.max(-lo), hi.max(-lo));
        }
        (lo, if lo < hi { hi } else { lo + lo.abs().max(1.0) })
    }

    /// The name of its colours, unless they are points of a file.
    pub fn name(&self) -> Option<&'static str> {
        match &self.colours {
            Colours::Named(named) => Some(named.name),
            Colours::Points(..) => None,
        }
    }

    /// Its colours in a few words, for people.
    pub fn words(&self) -> String {
        let (lo, hi) = self.range;
        format!("{} from {lo} to {hi}", self.description())
    }

    /// A map's name, or how many points a file's has.
    pub fn description(&self) -> String {
        match &self.colours {
            Colours::Named(named) => named.name.into(),
            Colours::Points(points, space) => format!("{} points ({})", points.len(), space.name()),
        }
    }

    /// Its opacities as VALUE:A,... or, where they are many, how many.
    pub fn opacity_words(&self) -> String {
        const MOST: usize = 32;
        let points: Vec<String> = self.opacity.iter().map(|(value, opacity)| format!("{value}:{opacity}")).collect();
        if points.len() <= MOST { points.join(",") } else { format!("{} points", points.len()) }
    }

    /// Whether all of its colours are greys.
    fn is_grey(&self) -> bool {
        matches!(&self.colours, Colours::Named(named) if named.name == "grey")
    }

    /// Whether a colour takes so long that a table of them is worth it.
    fn is_slow(&self) -> bool {
        match &self.colours {
            Colours::Named(_) => false,
            Colours::Points(_, space) => !matches!(space, ColourSpace::Rgb | ColourSpace::Step),
        }
    }

    /// Its colours as text, from which [`Self::of_text`] makes them again, to the bit.
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

    /// From [`Self::text`].
    pub(crate) fn of_text(text: &str) -> Option<Self> {
        let numbers = |text: &str| text.split_whitespace().map(|n| n.parse().ok()).collect::<Option<Vec<f64>>>();
        let Some((space, points)) = text.split_once(';') else {
            let (name, range) = text.split_once(' ')?;
            let [lo, hi] = numbers(range)?.try_into().ok()?;
            return Self::named(named::known(name)?).over((lo, hi)).ok();
        };
        let point = |text: &str| numbers(text)?.try_into().ok().map(|[v, r, g, b]: [f64; 4]| (v, [r, g, b]));
        let points = points.split(';').map(point).collect::<Option<Vec<_>>>()?;
        Self::of_points(points, ColourSpace::named(space)?, None, None).ok()
    }
}

/// An error if a range that was asked for shows nothing.
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

/// What is at a value, between the points on both sides of it. Of two points of one value the second holds from there
/// on.
fn between<T: Copy>(points: &[(f64, T)], value: f64, mix: impl Fn(&T, &T, f64) -> T) -> T {
    let next = points.partition_point(|(v, _)| *v <= value);
    match (next.checked_sub(1).map(|last| &points[last]), points.get(next)) {
        (Some((from, a)), Some((to, b))) => mix(a, b, (value - from) / (to - from)),
        (Some((_, end)), None) | (None, Some((_, end))) => *end,
        (None, None) => unreachable!("two points or more"),
    }
}

/// More points than this are more than a map needs, and than the settings of a file hold.
const MOST_POINTS: usize = 1 << 16;

/// Whether points are two or more, of ascending values, with components of 0 to 1; a step has a value twice.
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
