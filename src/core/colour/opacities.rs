//! Values and opacities as users give them.

use crate::base::choice::serde_as_text;
use crate::base::values::share;
use std::fmt;
use std::str::FromStr;

/// A value, as options name it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum At {
    /// A share of the range: `40%`.
    Share(f64),
    /// In the samples' unit: `@280`.
    Value(f64),
}

impl At {
    /// Reads a text; `plain` says what a number without a mark is.
    ///
    /// # Errors
    /// A text that is neither, or a share that is not from 0 to 1.
    pub fn parse(text: &str, plain: fn(f64) -> Self) -> Result<Self, String> {
        let text = text.trim();
        let at = match text.strip_prefix('@') {
            Some(value) => value.parse().ok().map(Self::Value),
            None if text.ends_with('%') => share(text).ok().map(Self::Share),
            None => text.parse().ok().map(plain),
        };
        let is_sound = |at: &Self| match at {
            Self::Share(share) => (0.0..=1.0).contains(share),
            Self::Value(value) => value.is_finite(),
        };
        at.filter(is_sound)
            .ok_or_else(|| format!("'{text}' is neither a value like @280 nor a share of the range like 40%"))
    }

    /// The value, where shares are those of a range.
    pub fn value(self, (lo, hi): (f64, f64)) -> f64 {
        match self {
            Self::Share(share) => lo + share * (hi - lo),
            Self::Value(value) => value,
        }
    }

    /// The share of a range, 0 to 1; `None` if the value is beyond it.
    fn share(self, (lo, hi): (f64, f64)) -> Option<f64> {
        match self {
            Self::Share(share) => Some(share),
            Self::Value(value) => (lo..=hi).contains(&value).then(|| (value - lo) / (hi - lo)),
        }
    }
}

/// An opacity at a value.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Point {
    at: At,
    opacity: f64,
}

/// Opacities at shares of a range, like `0:0,0.5:0.1,1:0.8` or `0%:0,50%:10%`, or at values, like `@280:0,@300:0.5`.
#[derive(Debug, Clone, PartialEq)]
pub struct OpacityPoints(Vec<Point>);

/// Opacities that are given, or suggested from the samples.
#[derive(Debug, Clone, PartialEq)]
pub enum Opacities {
    /// Suggested from the samples.
    Auto,
    /// At shares of the range, or at values.
    Points(OpacityPoints),
}

impl OpacityPoints {
    /// The values at which opacities are given.
    pub fn values(&self) -> impl Iterator<Item = f64> {
        self.0.iter().filter_map(|point| match point.at {
            At::Value(value) => Some(value),
            At::Share(_) => None,
        })
    }

    /// The opacities at shares of a range.
    ///
    /// # Errors
    /// A value beyond the range.
    pub fn at_shares(&self, range @ (lo, hi): (f64, f64)) -> Result<Vec<(f64, f64)>, String> {
        let beyond = |at: At| format!("{} is beyond the range {lo} to {hi}", at.value(range));
        self.0.iter().map(|point| Ok((point.at.share(range).ok_or_else(|| beyond(point.at))?, point.opacity))).collect()
    }
}

impl FromStr for Opacities {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        if text == "auto" {
            Ok(Self::Auto)
        } else {
            text.parse().map(Self::Points).map_err(|what| format!("auto, or {what}"))
        }
    }
}

impl FromStr for OpacityPoints {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let point = |text: &str| {
            let (at, opacity) = text.split_once(':')?;
            Some(Point { at: At::parse(at, At::Share).ok()?, opacity: share(opacity).ok()? })
        };
        let points = text.split(',').map(point).collect::<Option<Vec<_>>>();
        let what =
            "takes pairs of a share of the range and an opacity, like 0:0,0.5:0.1,1:0.8, or of a value, like @280:0.1";
        points.map(Self).ok_or_else(|| what.into())
    }
}

impl fmt::Display for OpacityPoints {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let text = |point: &Point| match point.at {
            At::Share(share) => format!("{share}:{}", point.opacity),
            At::Value(value) => format!("@{value}:{}", point.opacity),
        };
        f.write_str(&self.0.iter().map(text).collect::<Vec<_>>().join(","))
    }
}

impl fmt::Display for Opacities {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Auto => f.write_str("auto"),
            Self::Points(points) => points.fmt(f),
        }
    }
}

serde_as_text!(Opacities);

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn opacities_are_given_at_shares_or_values() {
        let points = |text: &str| text.parse::<OpacityPoints>();
        let shares = |text: &str| points(text).and_then(|points| points.at_shares((200.0, 300.0)));
        assert_eq!(shares("0:0,0.5:0.1,1:0.8"), Ok(vec![(0.0, 0.0), (0.5, 0.1), (1.0, 0.8)]));
        assert_eq!(shares("25% : 10 %,@300:1"), Ok(vec![(0.25, 0.1), (1.0, 1.0)]));
        assert!(shares("@199:0").is_err_and(|what| what.contains("199 is beyond")));
        assert_eq!(points("@280:0.5,25%:0").expect("points").to_string(), "@280:0.5,0.25:0");
        for wrong in ["", "1", "2:0", "a:0", "@:0", "101%:0", "@nan:0"] {
            assert!(points(wrong).is_err(), "{wrong}");
        }
    }
}
