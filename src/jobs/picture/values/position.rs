//! Positions along axes, as options name them.

use std::fmt;
use std::str::FromStr;
use wavesplat_core::base::choice::serde_as_text;
use wavesplat_core::base::values::share;

/// A position along an axis, as options name it.
#[derive(Debug, Clone, PartialEq)]
pub enum AxisPosition {
    /// A share of the axis: 0 is the first voxel, 1 the last.
    Share(f64),
    /// The number of a voxel, or a number between those of two.
    Voxel(f64),
    /// A coordinate, perhaps with its unit.
    Coordinate(f64, String),
}

impl FromStr for AxisPosition {
    type Err = String;

    fn from_str(text: &str) -> std::result::Result<Self, String> {
        let text = text.trim();
        let number = |text: &str| text.parse().ok().filter(|n: &f64| n.is_finite()).ok_or_else(|| wrong(text));
        if let Some(voxel) = text.strip_prefix('#') {
            return number(voxel).map(Self::Voxel);
        }
        if text.ends_with('%') {
            return share(text).map(Self::Share).map_err(|_| wrong(text));
        }
        let is_share = |at: &f64| !text.starts_with('@') && text.contains('.') && (0.0..=1.0).contains(at);
        if let Some(share) = number(text).ok().filter(is_share) {
            return Ok(Self::Share(share));
        }
        let (at, unit) = split_unit(text.strip_prefix('@').unwrap_or(text));
        Ok(Self::Coordinate(number(at)?, unit.to_string()))
    }
}

impl fmt::Display for AxisPosition {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Share(share) if (0.0..=1.0).contains(share) => {
                let text = share.to_string();
                write!(f, "{text}{}", if text.contains('.') { "" } else { ".0" })
            }
            Self::Share(share) => write!(f, "{}%", 100.0 * share),
            Self::Voxel(voxel) => write!(f, "#{voxel}"),
            Self::Coordinate(at, unit) => write!(f, "@{at}{unit}"),
        }
    }
}

/// A plane across an axis: `AXIS=POSITION`.
#[derive(Debug, Clone, PartialEq)]
pub struct SliceSpec {
    /// The name of the axis.
    pub axis: String,
    /// Where the plane cuts it.
    pub position: AxisPosition,
}

impl FromStr for SliceSpec {
    type Err = String;

    fn from_str(text: &str) -> std::result::Result<Self, String> {
        let (axis, position) = text.split_once('=').ok_or("takes AXIS=PLACE, like x=0.5, z=#12 or lat=45")?;
        Ok(Self { axis: axis.into(), position: position.parse()? })
    }
}

impl fmt::Display for SliceSpec {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}={}", self.axis, self.position)
    }
}

/// A point: a position along each axis.
#[derive(Debug, Clone, PartialEq)]
pub struct PointSpec(pub [AxisPosition; 3]);

impl FromStr for PointSpec {
    type Err = String;

    fn from_str(text: &str) -> std::result::Result<Self, String> {
        let positions = text.split(',').map(str::parse).collect::<std::result::Result<Vec<AxisPosition>, _>>()?;
        positions.try_into().map(Self).map_err(|_| "takes three places X,Y,Z, like 0.5,#12,120m".into())
    }
}

impl fmt::Display for PointSpec {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [x, y, z] = &self.0;
        write!(f, "{x},{y},{z}")
    }
}

serde_as_text!(SliceSpec, PointSpec);

fn wrong(text: &str) -> String {
    format!(
        "'{text}' is no place; take a share like 0.5 or 50%, a voxel like #12, or a coordinate like 120, 120m or @0.5"
    )
}

/// A number and the unit behind it.
fn split_unit(text: &str) -> (&str, &str) {
    let ends = (0..=text.len()).rev().filter(|end| text.is_char_boundary(*end));
    let is_number =
        |text: &str| text.ends_with(|c: char| c.is_ascii_digit() || c == '.') && text.parse::<f64>().is_ok();
    let end = ends.into_iter().find(|end| is_number(&text[..*end])).unwrap_or(text.len());
    (&text[..end], text[end..].trim())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn place(text: &str) -> Option<AxisPosition> {
        text.parse().ok()
    }

    #[test]
    fn places_are_told_apart_by_their_spelling() {
        let coordinate = |at, unit: &str| Some(AxisPosition::Coordinate(at, unit.into()));
        assert_eq!(["0.3", "1.0", "30%"].map(place), [0.3, 1.0, 0.3].map(|share| Some(AxisPosition::Share(share))));
        assert_eq!(["#12", "#0.5"].map(place), [12.0, 0.5].map(|voxel| Some(AxisPosition::Voxel(voxel))));
        assert_eq!(
            [place("45"), place("-500"), place("1")],
            [coordinate(45.0, ""), coordinate(-500.0, ""), coordinate(1.0, "")]
        );
        assert_eq!(
            [place("120m"), place("-0.5 m"), place("1e3m")],
            [coordinate(120.0, "m"), coordinate(-0.5, "m"), coordinate(1000.0, "m")]
        );
        assert_eq!([place("@0.5"), place("1.5")], [coordinate(0.5, ""), coordinate(1.5, "")]);
        for odd in ["", "#", "m", "nan", "inf", "#nan", "1e999", "@", "%", "é5"] {
            assert_eq!(place(odd), None, "{odd}");
        }
    }
}
