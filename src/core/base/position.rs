//! Positions along axes, and boxes of voxels, as options name them.

use super::choice::serde_as_text;
use super::values::share;
use std::fmt;
use std::str::FromStr;

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
        let rest = unit.trim_start_matches(['e', 'E']).trim_start_matches(['+', '-']);
        if rest.starts_with(|c: char| c.is_ascii_digit() || c == '.') {
            return Err(wrong(text)); // a number in two pieces
        }
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

/// A box of voxels: `x0:x1,y0:y1,z0:z1`. The default of each end is that of the volume. Digits alone are a voxel, and any other end is a
/// position. Voxels and shares are where the box ends, so the last one is not in it; coordinates are in it, the lower one first.
#[derive(Debug, Clone, PartialEq)]
pub struct RegionSpec(pub [Ends; 3]);

/// The ends of a box along an axis.
#[derive(Debug, Clone, PartialEq)]
pub struct Ends {
    /// Where it begins.
    pub from: Option<AxisPosition>,
    /// Where it ends.
    pub to: Option<AxisPosition>,
}

impl FromStr for RegionSpec {
    type Err = String;

    fn from_str(text: &str) -> std::result::Result<Self, String> {
        let axes = text.split(',').map(str::parse).collect::<std::result::Result<Vec<Ends>, _>>()?;
        axes.try_into().map(Self).map_err(|_| wrong_box())
    }
}

impl FromStr for Ends {
    type Err = String;

    fn from_str(text: &str) -> std::result::Result<Self, String> {
        let end = |text: &str| if text.trim().is_empty() { Ok(None) } else { end(text).map(Some) };
        let (from, to) = text.split_once(':').filter(|(_, to)| !to.contains(':')).ok_or_else(wrong_box)?;
        Ok(Self { from: end(from)?, to: end(to)? })
    }
}

/// An end of a box. Digits alone are a voxel.
fn end(text: &str) -> std::result::Result<AxisPosition, String> {
    let is_voxel = text.trim().bytes().all(|byte| byte.is_ascii_digit());
    if is_voxel { format!("#{}", text.trim()).parse() } else { text.parse() }
}

fn wrong_box() -> String {
    "takes x0:x1,y0:y1,z0:z1, without voxels x1, y1 and z1, like 0:32,:,10%:50% or @30:@45,:,:".into()
}

impl fmt::Display for RegionSpec {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let end = |end: &Option<AxisPosition>| match end {
            None => String::new(),
            Some(AxisPosition::Voxel(voxel)) if voxel.fract() == 0.0 && voxel.is_sign_positive() => voxel.to_string(),
            Some(other) => other.to_string(),
        };
        let axis = |Ends { from, to }: &Ends| format!("{}:{}", end(from), end(to));
        write!(f, "{}", self.0.each_ref().map(axis).join(","))
    }
}

serde_as_text!(RegionSpec);

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

    #[test]
    fn boxes_have_voxels_shares_and_coordinates() {
        let text = |text: &str| text.parse::<RegionSpec>().map(|region| region.to_string());
        for same in ["2:4,:,5:", "0.1:50%,@-500m:@0.5,3:"] {
            assert_eq!(text(same), Ok(same.replace("50%", "0.5")), "{same}");
        }
        assert_eq!(text(" 2 : #4 ,:, -10m:"), Ok("2:4,:,@-10m:".into()));
        for same in ["#-1:,:,:", "#-0:,:,:", "5000000000:,:,:", "-5:,:,:"] {
            let region: RegionSpec = same.parse().expect("a box");
            assert_eq!(region.to_string().parse(), Ok(region), "{same}");
        }
        assert_eq!(text("5000000000:,:,:"), Ok("5000000000:,:,:".into()));
        for wrong in ["1:2,3:4", "1,2,3", "a:,:,:", "1:2:3,:,:", "@5 e5:,:,:", "@5 .:,:,:"] {
            assert!(text(wrong).is_err(), "{wrong}");
        }
    }

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
