//! Named colour maps: viridis, plasma, inferno and magma ([Viridis](crate::bibliography)), cividis
//! ([Nunez](crate::bibliography)), turbo ([Turbo](crate::bibliography)), coolwarm ([Moreland](crate::bibliography)),
//! grey, and the rainbow of [Dobashi](crate::bibliography).

use super::Colour;
use super::space::ColourSpace;
use std::sync::LazyLock;

/// The names of the colour maps.
pub const NAMES: [&str; 9] =
    ["viridis", "plasma", "inferno", "magma", "cividis", "turbo", "coolwarm", "grey", "rainbow"];

/// A named map: colours at even steps of the range, with linear interpolation.
#[derive(Debug, PartialEq)]
pub(super) struct Named {
    pub(super) name: &'static str,
    colours: Vec<Colour>,
}

impl Named {
    /// Whether the colours diverge from a middle colour.
    pub(super) fn is_diverging(&self) -> bool {
        self.name == "coolwarm"
    }

    /// The colours, and their shares of the range, 0 to 1.
    pub(super) fn points(&self) -> impl Iterator<Item = (f64, Colour)> {
        let last = (self.colours.len() - 1) as f64;
        self.colours.iter().enumerate().map(move |(n, colour)| (n as f64 / last, *colour))
    }

    /// The colour at a share of the range, 0 to 1.
    pub(super) fn colour(&self, t: f64) -> Colour {
        self.between(t, |a, b, t| ColourSpace::Rgb.between(*a, *b, t))
    }

    /// The mix of the colours around a share of the range, 0 to 1.
    pub(super) fn between<M>(&self, t: f64, mix: impl Fn(&Colour, &Colour, f64) -> M) -> M {
        let index = t * (self.colours.len() - 1) as f64;
        let n = (index as usize).min(self.colours.len() - 2);
        mix(&self.colours[n], &self.colours[n + 1], index - n as f64)
    }
}

/// All named maps.
static MAPS: LazyLock<Vec<Named>> =
    LazyLock::new(|| NAMES.into_iter().map(|name| Named { name, colours: colours(name) }).collect());

/// Finds a map by its name.
pub(super) fn known(name: &str) -> Option<&'static Named> {
    let name = if name == "gray" { "grey" } else { name };
    MAPS.iter().find(|known| known.name == name)
}

/// The colours of a named map. The colours of the library have 8 bits, so they are taken only at the entries of its own
/// tables: colours in between would have steps.
fn colours(name: &str) -> Vec<Colour> {
    let gradient = match name {
        "viridis" => colorous::VIRIDIS,
        "plasma" => colorous::PLASMA,
        "inferno" => colorous::INFERNO,
        "magma" => colorous::MAGMA,
        "cividis" => colorous::CIVIDIS,
        "turbo" => colorous::TURBO,
        "coolwarm" => {
            return (0..=256).map(|n| ColourSpace::Diverging.between(COOL, WARM, f64::from(n) / 256.0)).collect();
        }
        "grey" => return vec![[0.0; 3], [1.0; 3]],
        _ => return BLUE_TO_RED.to_vec(),
    };
    let at = |n: usize| gradient.eval_rational(n, 256).as_array().map(|c| f64::from(c) / 255.0);
    (0..256).map(at).collect()
}

/// The ends of the diverging map of [Moreland](crate::bibliography), ParaView's default.
const COOL: Colour = [0.231_373, 0.298_039, 0.752_941];
const WARM: Colour = [0.705_882, 0.015_686_3, 0.149_02];

/// The map of [Dobashi](crate::bibliography): from blue for small values to red for large ones, through the hues from
/// 240 to 0 degrees.
const BLUE_TO_RED: [Colour; 5] = [[0.0, 0.0, 1.0], [0.0, 1.0, 1.0], [0.0, 1.0, 0.0], [1.0, 1.0, 0.0], [1.0, 0.0, 0.0]];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_papers_map_runs_from_blue_over_green_to_red() {
        let rainbow = known("rainbow").expect("the paper's map");
        assert_eq!(rainbow.colour(0.0), [0.0, 0.0, 1.0]);
        assert_eq!(rainbow.colour(0.375), [0.0, 1.0, 0.5]);
        assert_eq!(rainbow.colour(1.0), [1.0, 0.0, 0.0]);
    }

    #[test]
    fn maps_agree_with_the_library() {
        let bytes = |name: &str, t| known(name).expect("a name").colour(t).map(|c| (c * 255.0).round() as u8);
        for n in 0..256 {
            let t = n as f64 / 255.0;
            assert_eq!(bytes("viridis", t), colorous::VIRIDIS.eval_rational(n, 256).as_array());
            assert_eq!(bytes("turbo", t), colorous::TURBO.eval_rational(n, 256).as_array());
        }
        assert_eq!(bytes("coolwarm", 0.5), [221; 3]);
        assert_eq!(bytes("viridis", 1.0), [253, 231, 37]);
    }
}
