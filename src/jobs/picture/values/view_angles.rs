//! Views by name or by angles.

use std::fmt;
use std::str::FromStr;
use wavesplat_core::base::choice::serde_as_text;
use wavesplat_core::base::values::Pair;

/// Azimuth and elevation in degrees.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ViewAngles(pub [f64; 2]);

/// The elevation of an isometric view, at which all axes look equally long: the arc tangent of 1 / sqrt(2).
const ISOMETRIC: f64 = 35.264_389_682_754_65;

/// Names of views. On a map with x to the east and y to the north, `north` is seen from the north.
const NAMES: [(&str, [f64; 2]); 11] = [
    ("top", [180.0, 90.0]),
    ("bottom", [180.0, -90.0]),
    ("front", [180.0, 0.0]),
    ("south", [180.0, 0.0]),
    ("back", [0.0, 0.0]),
    ("north", [0.0, 0.0]),
    ("right", [270.0, 0.0]),
    ("east", [270.0, 0.0]),
    ("left", [90.0, 0.0]),
    ("west", [90.0, 0.0]),
    ("iso", [225.0, ISOMETRIC]),
];

impl FromStr for ViewAngles {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let named = NAMES.iter().find(|(name, _)| name.eq_ignore_ascii_case(text.trim()));
        let angles = || text.parse::<Pair>().ok().map(|pair| pair.0);
        let names = || NAMES.map(|(name, _)| name).join(" ");
        let found = named.map(|(_, angles)| *angles).or_else(angles).map(Self);
        found.ok_or_else(|| format!("two angles with a comma between them, like 30,30, or one of {}", names()))
    }
}

impl fmt::Display for ViewAngles {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [azimuth, elevation] = self.0;
        write!(f, "{azimuth},{elevation}")
    }
}

serde_as_text!(ViewAngles);

#[cfg(test)]
mod tests {
    use super::*;
    use wavesplat_core::base::grid::Grid;
    use wavesplat_core::view::camera::{Camera, View};

    /// The pixels to the right and down, and the depth, of a step along each axis.
    fn steps(name: &str) -> [[f64; 3]; 3] {
        let [azimuth, elevation] = name.parse::<ViewAngles>().expect("a name").0;
        let view = View { scale: Some(1.0), ..View::new(azimuth, elevation) };
        let camera = Camera::new(&view, &Grid::unit([3, 3, 3])).expect("a view");
        let middle = camera.project([1.0; 3]);
        [0, 1, 2].map(|axis| {
            let at = camera.project(std::array::from_fn(|a| if a == axis { 2.0 } else { 1.0 }));
            std::array::from_fn(|i| (at[i] - middle[i]).round())
        })
    }

    #[test]
    fn names_are_sides_of_a_map() {
        assert_eq!(steps("top"), [[1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, -1.0]]);
        assert_eq!(steps("front"), [[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]]);
        assert_eq!(steps("North"), [[-1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, -1.0, 0.0]]);
        assert_eq!(steps("east"), [[0.0, 0.0, -1.0], [1.0, 0.0, 0.0], [0.0, -1.0, 0.0]]);
        assert_eq!(steps("west"), [[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]]);
        assert_eq!(steps("bottom").map(|step| step[2]), [0.0, 0.0, 1.0]);
        assert_eq!((steps("south"), steps("right"), steps("left")), (steps("front"), steps("east"), steps("west")));
    }

    #[test]
    fn angles_are_taken_too() {
        assert_eq!(" 30,-20".parse(), Ok(ViewAngles([30.0, -20.0])));
        for wrong in ["", "up", "30", "1,2,3"] {
            assert!(wrong.parse::<ViewAngles>().is_err_and(|what| what.contains("top")), "{wrong}");
        }
    }
}
