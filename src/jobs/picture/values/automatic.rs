//! Settings that are chosen automatically unless a user gives them.

use std::fmt;
use std::str::FromStr;
use wavesplat_core::base::choice::serde_as_text;
use wavesplat_core::base::values::{Numbers, Pair};

/// How much taller than true heights are drawn.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Exaggeration {
    /// As the volume needs.
    Auto,
    /// By this factor.
    Factor(f64),
}

impl FromStr for Exaggeration {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let factor = || text.parse().ok().filter(|factor: &f64| factor.is_finite() && *factor > 0.0);
        match text {
            "auto" => Ok(Self::Auto),
            _ => factor().map(Self::Factor).ok_or_else(|| "auto, or a number above 0".into()),
        }
    }
}

impl fmt::Display for Exaggeration {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Auto => f.write_str("auto"),
            Self::Factor(factor) => factor.fmt(f),
        }
    }
}

/// The level of detail.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Detail {
    /// The coarsest with voxels no larger than a pixel.
    Auto,
    /// Every 2^N-th voxel.
    Level(u32),
}

impl FromStr for Detail {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let level = || text.parse().ok().filter(|level| *level < 32).map(Self::Level);
        if text == "auto" { Ok(Self::Auto) } else { level().ok_or_else(|| "auto, or 0, 1, 2, ...".into()) }
    }
}

impl fmt::Display for Detail {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Auto => f.write_str("auto"),
            Self::Level(level) => level.fmt(f),
        }
    }
}

/// Which values show the background.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum ClearSpec {
    /// Those of empty space, if there is much of it.
    Auto,
    /// None.
    Nothing,
    /// Those from the first number to the second.
    Values(Pair),
}

impl FromStr for ClearSpec {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text {
            "auto" => Ok(Self::Auto),
            "none" => Ok(Self::Nothing),
            _ => match text.parse::<Pair>() {
                Ok(pair @ Numbers([lo, hi])) if lo <= hi => Ok(Self::Values(pair)),
                _ => Err("auto, none, or two numbers, the lower one first".into()),
            },
        }
    }
}

impl fmt::Display for ClearSpec {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Auto => f.write_str("auto"),
            Self::Nothing => f.write_str("none"),
            Self::Values(pair) => pair.fmt(f),
        }
    }
}

/// The value that short rays meet beyond the volume.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum BeyondSpec {
    /// That of empty space, or the median.
    Auto,
    /// None: means stay as they are.
    Nothing,
    /// This one.
    Value(f64),
}

impl FromStr for BeyondSpec {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let value = || text.parse().ok().filter(|value: &f64| (*value as f32).is_finite());
        match text {
            "auto" => Ok(Self::Auto),
            "none" => Ok(Self::Nothing),
            _ => value().map(Self::Value).ok_or_else(|| "auto, none, or a value".into()),
        }
    }
}

impl fmt::Display for BeyondSpec {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Auto => f.write_str("auto"),
            Self::Nothing => f.write_str("none"),
            Self::Value(value) => value.fmt(f),
        }
    }
}

serde_as_text!(Exaggeration, Detail, ClearSpec, BeyondSpec);
