//! Opacities as users give them.

use crate::base::choice::serde_as_text;
use std::fmt;
use std::str::FromStr;

/// Opacities at shares of a range, like `0:0,0.5:0.1,1:0.8`.
#[derive(Debug, Clone, PartialEq)]
pub struct OpacityPoints(pub Vec<(f64, f64)>);

/// Opacities that are given, or suggested from the samples.
#[derive(Debug, Clone, PartialEq)]
pub enum Opacities {
    /// Suggested from the samples.
    Auto,
    /// At shares of the range.
    Points(OpacityPoints),
}

impl FromStr for Opacities {
    type Err = String;

    fn from_str(text: &str) -> std::result::Result<Self, String> {
        if text == "auto" {
            Ok(Self::Auto)
        } else {
            text.parse().map(Self::Points).map_err(|what| format!("auto, or {what}"))
        }
    }
}

impl FromStr for OpacityPoints {
    type Err = String;

    fn from_str(text: &str) -> std::result::Result<Self, String> {
        let point = |text: &str| {
            let (share, opacity) = text.split_once(':')?;
            Some((share.trim().parse().ok()?, opacity.trim().parse().ok()?))
        };
        let points = text.split(',').map(point).collect::<Option<Vec<_>>>();
        points.map(Self).ok_or_else(|| "takes pairs of a share and an opacity, like 0:0,0.5:0.1,1:0.8".into())
    }
}

impl fmt::Display for OpacityPoints {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let points = self.0.iter().map(|(share, opacity)| format!("{share}:{opacity}"));
        f.write_str(&points.collect::<Vec<_>>().join(","))
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
