//! Values to colours, after projection.

use crate::error::{Error, Result};

/// A colour, 8 bits a channel.
pub type Rgb = [u8; 3];

/// A named colour map over a range of values.
#[derive(Clone, Copy)]
pub struct ColourMap {
    map: fn(f64) -> Rgb,
    range: (f64, f64),
    background: Rgb,
}

impl std::fmt::Debug for ColourMap {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "ColourMap({:?})", self.range)
    }
}

/// The names of the colour maps.
pub const NAMES: [&str; 7] = ["viridis", "turbo", "rainbow", "grey", "plasma", "inferno", "magma"];

impl ColourMap {
    /// A map by its name, from the first to the last colour over `range`.
    pub fn new(name: &str, range: (f64, f64), background: Rgb) -> Result<Self> {
        let map: fn(f64) -> Rgb = match name {
            "viridis" => |t| colorous::VIRIDIS.eval_continuous(t).as_array(),
            "turbo" => |t| colorous::TURBO.eval_continuous(t).as_array(),
            "plasma" => |t| colorous::PLASMA.eval_continuous(t).as_array(),
            "inferno" => |t| colorous::INFERNO.eval_continuous(t).as_array(),
            "magma" => |t| colorous::MAGMA.eval_continuous(t).as_array(),
            "grey" | "gray" => |t| [(t * 255.0).round() as u8; 3],
            "rainbow" => blue_to_red,
            _ => return Err(Error::usage(format!("--colormap {name}: unknown; one of {}", NAMES.join(" ")))),
        };
        if !(range.0.is_finite() && range.1.is_finite() && range.0 <= range.1) {
            return Err(Error::usage(format!(
                "--range {},{}: takes two numbers, the lower one first",
                range.0, range.1
            )));
        }
        Ok(Self { map, range, background })
    }

    /// The colour of a value: beyond the range the end's, of NaN the background.
    pub fn colour(&self, value: f32) -> Rgb {
        if value.is_nan() {
            return self.background;
        }
        (self.map)(self.share(value))
    }

    /// Where a value lies in the range, 0 to 1; NaN counts as 0.
    pub fn share(&self, value: f32) -> f64 {
        let (lo, hi) = self.range;
        let t = (f64::from(value) - lo) / (hi - lo);
        if t.is_nan() { 0.0 } else { t.clamp(0.0, 1.0) }
    }
}

/// The paper's map: small values blue, large ones red, by the hues between (240 to 0 degrees).
fn blue_to_red(t: f64) -> Rgb {
    let sector = 4.0 * (1.0 - t);
    let channel = |distance: f64| ((2.0 - distance.abs()).clamp(0.0, 1.0) * 255.0).round() as u8;
    let red = if sector < 2.0 { channel(sector) } else { 0 };
    [red, channel(sector - 2.0), channel(sector - 4.0)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_papers_map_runs_from_blue_over_green_to_red() {
        assert_eq!(blue_to_red(0.0), [0, 0, 255]);
        assert_eq!(blue_to_red(0.25), [0, 255, 255]);
        assert_eq!(blue_to_red(0.5), [0, 255, 0]);
        assert_eq!(blue_to_red(0.75), [255, 255, 0]);
        assert_eq!(blue_to_red(1.0), [255, 0, 0]);
    }

    #[test]
    fn values_beyond_the_range_take_its_ends_and_nan_the_background() {
        let map = ColourMap::new("grey", (1.0, 2.0), [9, 8, 7]).expect("a known map");
        assert_eq!(map.colour(-5.0), [0; 3]);
        assert_eq!(map.colour(7.0), [255; 3]);
        assert_eq!(map.colour(f32::NAN), [9, 8, 7]);
        assert_eq!(ColourMap::new("grey", (2.0, 2.0), [0; 3]).expect("an empty range").colour(2.0), [0; 3]);
    }

    #[test]
    fn every_name_is_known() {
        assert!(NAMES.iter().all(|n| ColourMap::new(n, (0.0, 1.0), [0; 3]).is_ok()));
        assert!(ColourMap::new("no such", (0.0, 1.0), [0; 3]).is_err());
    }
}
