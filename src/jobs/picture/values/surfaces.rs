//! The isosurfaces that `iso` names.

use super::hex_colour::HexColour;
use std::fmt;
use std::str::FromStr;
use wavesplat_core::base::choice::serde_as_text;
use wavesplat_core::base::values::share;
use wavesplat_core::colour::{At, Colour, TransferFunction};
use wavesplat_engine::render::Surface;

/// Surfaces as V, V:RRGGBB or V:RRGGBB:OPACITY, with commas between.
#[derive(Debug, Clone, PartialEq)]
pub struct SurfaceList(Vec<Named>);

/// A surface as it was named.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Named {
    at: At,
    colour: Option<HexColour>,
    opacity: Option<f64>,
}

/// The colour of a single surface: bright on black and on white.
const COLOUR: Colour = [0.45, 0.68, 0.92];

impl Default for SurfaceList {
    fn default() -> Self {
        Self(vec![Named { at: At::Share(0.5), colour: None, opacity: None }])
    }
}

impl FromStr for SurfaceList {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        text.split(',').map(named).collect::<Result<_, _>>().map(Self)
    }
}

fn named(text: &str) -> Result<Named, String> {
    let mut parts = text.trim().split(':');
    let at = At::parse(parts.next().unwrap_or_default(), At::Value)?;
    let mut part = || parts.next().filter(|part| !part.is_empty());
    let colour = part().map(str::parse).transpose()?;
    let opacity = part().map(opacity).transpose()?;
    match parts.next() {
        Some(_) => Err(format!("'{text}' has too many parts; a surface is V[:RRGGBB[:OPACITY]]")),
        None => Ok(Named { at, colour, opacity }),
    }
}

fn opacity(text: &str) -> Result<f64, String> {
    let opacity = share(text).ok().filter(|opacity| *opacity > 0.0 && *opacity <= 1.0);
    opacity.ok_or_else(|| format!("'{text}' is no opacity; it is above 0 and at most 1"))
}

impl SurfaceList {
    /// The surfaces, with the colours that a map has at their values unless they have their own.
    pub(crate) fn surfaces(&self, map: &TransferFunction, is_map_given: bool) -> Vec<Surface> {
        let is_single = self.0.len() == 1;
        let map_colour = |value| map.colour(value).filter(|_| is_map_given || !is_single).unwrap_or(COLOUR);
        let surface = |named: &Named| {
            let value = named.at.value(map.range());
            let opacity = named.opacity.unwrap_or(if is_single { 1.0 } else { 0.6 });
            Surface { value, colour: named.colour.map_or_else(|| map_colour(value), HexColour::shares), opacity }
        };
        self.0.iter().map(surface).collect()
    }
}

impl fmt::Display for SurfaceList {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0.iter().map(ToString::to_string).collect::<Vec<_>>().join(","))
    }
}

impl fmt::Display for Named {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.at {
            At::Value(value) => write!(f, "{value}")?,
            At::Share(share) => write!(f, "{}%", 100.0 * share)?,
        }
        let colour = self.colour.map_or_else(String::new, |colour| colour.to_string());
        match self.opacity {
            Some(opacity) => write!(f, ":{colour}:{opacity}"),
            None if colour.is_empty() => Ok(()),
            None => write!(f, ":{colour}"),
        }
    }
}

serde_as_text!(SurfaceList);

#[cfg(test)]
mod tests {
    use super::*;

    fn surfaces(text: &str, is_map_given: bool) -> Result<Vec<(f64, Colour, f64)>, String> {
        let grey = TransferFunction::open("grey").and_then(|map| map.over((2.0, 6.0))).expect("a map");
        let list: SurfaceList = text.parse()?;
        Ok(list.surfaces(&grey, is_map_given).into_iter().map(|s| (s.value, s.colour, s.opacity)).collect())
    }

    #[test]
    fn surfaces_have_values_colours_and_opacities() {
        assert_eq!(surfaces("@3", false), Ok(vec![(3.0, COLOUR, 1.0)]));
        assert_eq!(surfaces("25%", true), Ok(vec![(3.0, [0.25; 3], 1.0)]));
        assert_eq!(
            surfaces("-1e3:ff0000,50%::30%", false),
            Ok(vec![(-1e3, [1.0, 0.0, 0.0], 0.6), (4.0, [0.5; 3], 0.3)])
        );
    }

    #[test]
    fn what_is_no_surface_is_refused() {
        for text in ["", "x", "nan", "inf", "101%", "1:red", "1::0", "1::2", "1:ffffff:1:1", "1,,2"] {
            assert!(surfaces(text, false).is_err(), "{text}");
        }
    }
}
