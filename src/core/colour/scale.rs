//! The colours of a picture's pixels.

use super::lookup::{Lookup, bytes};
use super::{Colour, Common, Distribution, Rgb, TransferFunction};
use crate::base::choice::Choice;
use crate::base::error::{Error, Note, Remedy, Result};

/// How values are spread over the colours.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Norm {
    /// Linearly.
    #[default]
    Linear,
    /// By their logarithm: every factor of ten has the same share.
    Log,
}

impl Choice for Norm {
    const CHOICES: &'static [(&'static str, Self, &'static str)] =
        &[("linear", Self::Linear, ""), ("log", Self::Log, "")];
}

impl Norm {
    /// The number whose differences are spread evenly.
    fn spread(self, value: f64) -> f64 {
        if self == Self::Log { libm::log(value.max(f64::MIN_POSITIVE)) } else { value }
    }
}

/// Values that show the background: those of empty space.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Clear {
    /// The least value that is clear.
    pub lo: f64,
    /// The largest value that is clear.
    pub hi: f64,
    /// The distance from the clear values at which colours are full.
    pub fade: f64,
}

/// The distance from clear values at which colours are full, and the distance from empty space that is clear, as shares of
/// the range.
const FADE: f64 = 0.08;
const NEAR: f64 = 0.01;

/// Shares of pixels above which empty space is clear: if there are values on one side of it alone, and on both.
const EMPTY_SHARES: [f64; 2] = [0.25, 0.6];

/// A side of empty space counts if it has this share of the range.
const SIDE: f64 = 0.1;

impl Clear {
    /// The values from `lo` to `hi`, for colours over `range`.
    pub fn new((lo, hi): (f64, f64), range: (f64, f64)) -> Self {
        Self { lo, hi, fade: FADE * (range.1 - range.0) }
    }

    /// The values of empty space, and how common they are, if many of the pixels have such a value.
    pub fn empty_space(pixels: &Distribution, (lo, hi): (f64, f64)) -> Option<(Self, Common)> {
        let empty = pixels.empty((lo, hi))?;
        let (side, near) = (SIDE * (hi - lo), NEAR * (hi - lo));
        let is_between = empty.value - lo > side && hi - empty.value > side;
        let clear = Self::new((empty.value - near, empty.value + near), (lo, hi));
        Some((clear, empty)).filter(|_| empty.share > EMPTY_SHARES[usize::from(is_between)])
    }

    /// How much of its colour a value shows, 0 to 1; it rises smoothly.
    fn presence(&self, value: f64) -> f64 {
        let away = (self.lo - value).max(value - self.hi);
        let share = if self.fade > 0.0 { (away / self.fade).clamp(0.0, 1.0) } else { f64::from(u8::from(away > 0.0)) };
        share * share * (3.0 - 2.0 * share)
    }
}

/// The colours of pixels: a transfer function over a range, and the background.
#[derive(Debug, Clone)]
pub struct Scale {
    /// The map over shares of the range, 0 to 1.
    map: TransferFunction,
    lookup: Lookup,
    range: (f64, f64),
    /// The range as its numbers are spread: their logarithms, if the norm says so.
    normed: (f64, f64),
    norm: Norm,
    background: Rgb,
    clear: Option<Clear>,
}

impl Scale {
    /// A scale of a named map (see [`super::NAMES`]), spread linearly over a range of values, on a black background.
    ///
    /// # Errors
    /// The same as for [`TransferFunction::open`] and [`Self::new`].
    pub fn named(name: &str, range: (f64, f64)) -> Result<Self> {
        Self::new(&TransferFunction::open(name)?, range, Norm::Linear, [0; 3])
    }

    /// A scale from the first to the last colour over `range`.
    ///
    /// # Errors
    /// A range that is not finite or out of order, or not above 0 for a logarithmic scale.
    pub fn new(map: &TransferFunction, range: (f64, f64), norm: Norm, background: Rgb) -> Result<Self> {
        let (lo, hi) = range;
        if !(lo.is_finite() && hi.is_finite() && lo <= hi) {
            return Err(Error::setting("range", format!("takes two numbers, the lower one first, not {lo},{hi}")));
        }
        if norm == Norm::Log && lo <= 0.0 {
            let what = format!("a logarithm takes a range above 0, and this is {lo},{hi}");
            return Err(Error::setting("norm", Note::with(what, Remedy::RangeAboveZero)));
        }
        let map = map.over((0.0, 1.0))?;
        let normed = (norm.spread(lo), norm.spread(hi));
        Ok(Self { lookup: Lookup::new(&map), map, range, normed, norm, background, clear: None })
    }

    /// The same with values that show the background.
    #[must_use]
    pub fn with_clear(self, clear: Option<Clear>) -> Self {
        Self { clear, ..self }
    }

    /// The values that show the background.
    pub fn clear(&self) -> Option<Clear> {
        self.clear
    }

    /// The colour of a value. Values beyond the range get the colour of the nearer end; NaN gets the background.
    pub fn colour(&self, value: f32) -> Rgb {
        match self.clear {
            _ if value.is_nan() => self.background,
            Some(clear) => self.colour_over_background(clear, f64::from(value)),
            None => self.full_colour_at(self.share(value)),
        }
    }

    fn colour_over_background(&self, clear: Clear, value: f64) -> Rgb {
        let (presence, share) = (clear.presence(value), self.share(value));
        let looked_up = match presence {
            0.0 => Some(self.background),
            1.0 => self.lookup.exact(share),
            _ => None,
        };
        looked_up.unwrap_or_else(|| bytes(self.faded(presence, share)))
    }

    /// The colour at a share of the range, over the background unless `presence` is 1 ([`Clear::presence`]).
    fn faded(&self, presence: f64, share: f64) -> Colour {
        let background = self.background.map(|c| f64::from(c) / 255.0);
        let full = self.map.colour(share).unwrap_or(background);
        std::array::from_fn(|i| background[i] + presence * (full[i] - background[i]))
    }

    /// The colour of a pixel of one value, of three channels (each spread over the range), or of light and its opacity.
    /// The background if any number is NaN.
    pub fn colour_of_pixel(&self, numbers: &[f32]) -> Rgb {
        match *numbers {
            [value] => self.colour(value),
            _ => bytes(self.exact_colour_of_pixel(numbers)),
        }
    }

    /// The same as [`Self::colour_of_pixel`], but neither rounded nor from a table.
    pub fn exact_colour_of_pixel(&self, numbers: &[f32]) -> Colour {
        let background = || self.background.map(|c| f64::from(c) / 255.0);
        match *numbers {
            _ if numbers.iter().any(|n| n.is_nan()) => background(),
            [value] => match self.clear {
                Some(clear) => self.faded(clear.presence(value.into()), self.share(value)),
                None => self.map.colour(self.share(value)).unwrap_or_else(background),
            },
            [r, g, b] => [r, g, b].map(|c| self.share(c)),
            [r, g, b, opacity] => self.over_background([r, g, b], opacity),
            _ => background(),
        }
    }

    /// How far a pixel hides the background, 0 to 1.
    pub fn opacity_of_pixel(&self, numbers: &[f32]) -> f64 {
        match *numbers {
            _ if numbers.iter().any(|n| n.is_nan()) => 0.0,
            [value] => self.clear.map_or(1.0, |clear| clear.presence(f64::from(value))),
            [.., opacity] if numbers.len() == 4 => f64::from(opacity),
            _ => 1.0,
        }
    }

    /// The colour of light with this opacity in front of the background.
    fn over_background(&self, light: [f32; 3], opacity: f32) -> Colour {
        let behind = f64::from(1.0 - opacity) / 255.0;
        std::array::from_fn(|i| (f64::from(light[i]) + behind * f64::from(self.background[i])).clamp(0.0, 1.0))
    }

    /// The colour at a share of the range, 0 to 1.
    pub fn colour_at(&self, share: f64) -> Rgb {
        self.clear.map_or_else(
            || self.full_colour_at(share),
            |clear| bytes(self.faded(clear.presence(self.value(share)), share)),
        )
    }

    /// The value at a share of the range.
    fn value(&self, share: f64) -> f64 {
        let (lo, hi) = self.range;
        if self.norm == Norm::Log { lo * libm::exp(share * libm::log(hi / lo)) } else { lo + share * (hi - lo) }
    }

    /// The colour at a share of the range, whether it is clear or not.
    fn full_colour_at(&self, share: f64) -> Rgb {
        let exact = || self.map.colour(share).map_or(self.background, bytes);
        self.lookup.colour(share).unwrap_or_else(exact)
    }

    /// The position of a value in the range, 0 to 1; 0 for NaN.
    pub fn share(&self, value: impl Into<f64>) -> f64 {
        let (lo, hi) = self.normed;
        let t = (self.norm.spread(value.into()) - lo) / (hi - lo);
        if t.is_nan() { 0.0 } else { t.clamp(0.0, 1.0) }
    }

    /// The values of the first and the last colour.
    pub fn range(&self) -> (f64, f64) {
        self.range
    }

    /// How values are spread over the range.
    pub fn norm(&self) -> Norm {
        self.norm
    }

    /// Whether every colour is a grey.
    pub fn is_grey(&self) -> bool {
        let [r, g, b] = self.background;
        self.map.is_grey() && r == g && g == b
    }

    /// The map over shares of the range.
    pub fn map(&self) -> &TransferFunction {
        &self.map
    }

    /// The colour of the background.
    pub fn background(&self) -> Rgb {
        self.background
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::colour::NAMES;

    #[test]
    fn values_beyond_the_range_take_its_ends_and_nan_the_background() {
        let grey = TransferFunction::open("grey").expect("a known map");
        let scale = |range| Scale::new(&grey, range, Norm::Linear, [9, 8, 7]).expect("a range");
        assert_eq!(scale((1.0, 2.0)).colour(-5.0), [0; 3]);
        assert_eq!(scale((1.0, 2.0)).colour(7.0), [255; 3]);
        assert_eq!(scale((1.0, 2.0)).colour(f32::NAN), [9, 8, 7]);
        assert_eq!(scale((2.0, 2.0)).colour(2.0), [0; 3], "an empty range");
    }

    #[test]
    fn a_logarithm_gives_equal_shares_to_equal_factors() {
        let grey = TransferFunction::open("grey").expect("a known map");
        let scale = Scale::new(&grey, (1e-2, 1e2), Norm::Log, [0; 3]).expect("a range");
        for (value, share) in [(1e-2, 0.0), (1e-1, 0.25), (1.0, 0.5), (1e2, 1.0), (-3.0, 0.0), (0.0, 0.0)] {
            assert!((scale.share(value) - share).abs() < 1e-7, "{value}");
        }
        assert!(Scale::new(&grey, (0.0, 1.0), Norm::Log, [0; 3]).is_err());
    }

    #[test]
    fn colours_are_rounded_exact_colours() {
        let map = TransferFunction::open("turbo").expect("a known map");
        let scale = Scale::new(&map, (-1.0, 2.0), Norm::Linear, [9, 8, 7]).expect("a range");
        let pixels: [&[f32]; 6] =
            [&[0.3], &[f32::NAN], &[0.1, 5.0, -3.0], &[0.1, f32::NAN, 0.0], &[0.2, 0.1, 0.0, 0.7], &[0.9; 4]];
        for pixel in pixels {
            assert_eq!(bytes(scale.exact_colour_of_pixel(pixel)), scale.colour_of_pixel(pixel), "{pixel:?}");
        }
        let grey = |name: &str, background| {
            let map = TransferFunction::open(name).expect("a known map");
            Scale::new(&map, (0.0, 1.0), Norm::Linear, background).expect("a range").is_grey()
        };
        assert!(grey("grey", [7; 3]) && !grey("grey", [7, 7, 8]) && !grey("turbo", [0; 3]));
    }

    #[test]
    fn empty_space_is_clear_if_there_is_much_of_it() {
        let of = |value: f32, count: usize| {
            let mut values: Vec<f32> = (0..=100).map(|n| n as f32 / 50.0 - 1.0).collect();
            values.extend(vec![value; count]);
            Clear::empty_space(&Distribution::new(values), (-1.0, 1.0)).map(|(clear, _)| clear.lo < clear.hi)
        };
        assert_eq!([of(-1.0, 20), of(-1.0, 60), of(0.0, 60), of(0.0, 300)], [None, Some(true), None, Some(true)]);
    }

    #[test]
    fn clear_values_show_the_background_and_those_near_them_fade() {
        let grey = TransferFunction::open("grey").expect("a known map");
        let clear = Clear { lo: -0.1, hi: 0.1, fade: 0.2 };
        for norm in [Norm::Linear, Norm::Log] {
            let plain = Scale::new(&grey, (1e-3, 1.0), norm, [200, 0, 0]).expect("a range");
            let scale = plain.clone().with_clear(Some(clear));
            for value in [-0.1, 0.0, 0.05, 0.1] {
                assert_eq!(scale.colour(value), [200, 0, 0], "{value}");
            }
            assert!([-0.31, 0.31, 0.9].iter().all(|value| scale.colour(*value) == plain.colour(*value)));
            let half = scale.colour(0.2).map(f64::from);
            let middle = plain.colour(0.2).map(|c| f64::from(c) / 2.0);
            assert!((half[0] - middle[0] - 100.0).abs() < 1.5 && (half[1] - middle[1]).abs() < 1.5, "{half:?}");
            for value in [0.01_f32, 0.15, 0.25, 0.7] {
                let of_share = scale.colour_at(scale.share(value));
                assert!(of_share.iter().zip(scale.colour(value)).all(|(a, b)| a.abs_diff(b) <= 1), "{value}");
                assert_eq!(bytes(scale.exact_colour_of_pixel(&[value])), scale.colour(value));
            }
        }
    }

    #[test]
    fn every_name_is_known() {
        assert!(NAMES.iter().all(|name| TransferFunction::open(name).is_ok()));
        assert!(TransferFunction::open("no such").is_err());
    }
}
