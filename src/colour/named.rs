//! The maps of the field by their names.

use super::Colour;
use super::space::Space;

/// The names of the colour maps.
pub const NAMES: [&str; 9] =
    ["viridis", "plasma", "inferno", "magma", "cividis", "turbo", "coolwarm", "grey", "rainbow"];

/// The name of a map as it is kept.
pub(super) fn known(name: &str) -> Option<&'static str> {
    let name = if name == "gray" { "grey" } else { name };
    NAMES.into_iter().find(|known| *known == name)
}

/// Whether the colours of a map lie to both sides of a middle one.
pub(super) fn is_diverging(name: &str) -> bool {
    name == "coolwarm"
}

/// The colour of a known map at a share of its range, 0 to 1.
pub(super) fn colour(name: &str, t: f64) -> Colour {
    let gradient = match name {
        "viridis" => colorous::VIRIDIS,
        "plasma" => colorous::PLASMA,
        "inferno" => colorous::INFERNO,
        "magma" => colorous::MAGMA,
        "cividis" => colorous::CIVIDIS,
        "turbo" => colorous::TURBO,
        "coolwarm" => return Space::Diverging.between(COOL, WARM, t),
        "grey" => return [t; 3],
        _ => return blue_to_red(t),
    };
    gradient.eval_continuous(t).as_array().map(|c| f64::from(c) / 255.0)
}

/// The ends of Moreland's diverging map, ParaView's default.
const COOL: Colour = [0.231_373, 0.298_039, 0.752_941];
const WARM: Colour = [0.705_882, 0.015_686_3, 0.149_02];

/// The paper's map: small values blue, large ones red, by the hues between (240 to 0 degrees).
fn blue_to_red(t: f64) -> Colour {
    let sector = 4.0 * (1.0 - t);
    let channel = |distance: f64| (2.0 - distance.abs()).clamp(0.0, 1.0);
    let red = if sector < 2.0 { channel(sector) } else { 0.0 };
    [red, channel(sector - 2.0), channel(sector - 4.0)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_papers_map_runs_from_blue_over_green_to_red() {
        assert_eq!(blue_to_red(0.0), [0.0, 0.0, 1.0]);
        assert_eq!(blue_to_red(0.25), [0.0, 1.0, 1.0]);
        assert_eq!(blue_to_red(0.5), [0.0, 1.0, 0.0]);
        assert_eq!(blue_to_red(0.75), [1.0, 1.0, 0.0]);
        assert_eq!(blue_to_red(1.0), [1.0, 0.0, 0.0]);
    }
}
