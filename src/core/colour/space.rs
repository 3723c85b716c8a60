//! Interpolation between colours.

use super::Colour;
use super::lab;
use std::f64::consts::{PI, TAU};

/// The space in which colours are interpolated, as in VTK, so that maps look the same as in ParaView.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ColourSpace {
    /// Red, green and blue separately.
    Rgb,
    /// Hue, saturation and value separately. Hue is a number from 0 to 1 and does not wrap around.
    Hsv,
    /// The same as [`Self::Hsv`], but hue takes the shorter way around.
    HsvWrapped,
    /// CIE L*a*b* for sRGB and D65.
    Lab,
    /// Moreland's Msh space; passes through white if both colours are saturated and their hues differ.
    Diverging,
    /// A step: the second colour everywhere but at the first point.
    Step,
}

impl ColourSpace {
    const ALL: [Self; 6] = [Self::Rgb, Self::Hsv, Self::HsvWrapped, Self::Lab, Self::Diverging, Self::Step];

    /// The name of the space.
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Rgb => "RGB",
            Self::Hsv => "HSV",
            Self::HsvWrapped => "HSV wrapped",
            Self::Lab => "Lab",
            Self::Diverging => "Diverging",
            Self::Step => "Step",
        }
    }

    /// Finds a space by its name.
    pub(super) fn named(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|space| space.name().eq_ignore_ascii_case(name))
    }

    /// The colour at a share `t` of the way from `a` to `b`. All channels are 0 to 1.
    pub(super) fn between(self, a: Colour, b: Colour, t: f64) -> Colour {
        let colour = match self {
            Self::Rgb => mix_all(a, b, t),
            Self::Hsv => from_hsv(mix_all(hsv(a), hsv(b), t)),
            Self::HsvWrapped => from_hsv(mix_wrapped(hsv(a), hsv(b), t)),
            Self::Lab => lab::to_rgb(mix_all(lab::from_rgb(a), lab::from_rgb(b), t)),
            Self::Diverging => diverging(polar(lab::from_rgb(a)), polar(lab::from_rgb(b)), t),
            Self::Step if t > 0.0 => b,
            Self::Step => a,
        };
        colour.map(|c| c.clamp(0.0, 1.0))
    }
}

fn mix_all(a: [f64; 3], b: [f64; 3], t: f64) -> [f64; 3] {
    std::array::from_fn(|i| mix(a[i], b[i], t))
}

/// The number at a share `t` of the way from `a` to `b`.
pub(super) fn mix(a: f64, b: f64, t: f64) -> f64 {
    a + (b - a) * t
}

/// Converts to hue (0 to 1), saturation and value.
fn hsv([r, g, b]: Colour) -> [f64; 3] {
    let (value, least) = (r.max(g).max(b), r.min(g).min(b));
    let chroma = value - least;
    if chroma <= 0.0 {
        return [0.0, 0.0, value];
    }
    let sixths = if r == value {
        (g - b) / chroma
    } else if g == value {
        2.0 + (b - r) / chroma
    } else {
        4.0 + (r - g) / chroma
    };
    [sixths.rem_euclid(6.0) / 6.0, chroma / value, value]
}

fn from_hsv([hue, saturation, value]: [f64; 3]) -> Colour {
    let channel = |sixth: f64| {
        let angle = (sixth + hue * 6.0).rem_euclid(6.0);
        value - value * saturation * angle.min(4.0 - angle).clamp(0.0, 1.0)
    };
    [channel(5.0), channel(3.0), channel(1.0)]
}

/// Mixes with the hue going the shorter way around.
fn mix_wrapped(mut a: [f64; 3], mut b: [f64; 3], t: f64) -> [f64; 3] {
    if a[0] - b[0] > 0.5 {
        a[0] -= 1.0;
    } else if b[0] - a[0] > 0.5 {
        b[0] -= 1.0;
    }
    mix_all(a, b, t)
}

/// Converts L*a*b* to Moreland's Msh: length, angle to the axis of greys, and hue. Angles are in radians.
fn polar([l, a, b]: [f64; 3]) -> [f64; 3] {
    let length = (l * l + a * a + b * b).sqrt();
    let angle = if length > 0.001 { libm::acos((l / length).clamp(-1.0, 1.0)) } else { 0.0 };
    [length, angle, if angle > 0.001 { libm::atan2(b, a) } else { 0.0 }]
}

/// Colours with smaller angles count as grey.
const SATURATED: f64 = 0.05;

/// Interpolates between two colours in Msh, as in [Moreland](crate::bibliography).
fn diverging(mut a: [f64; 3], mut b: [f64; 3], mut t: f64) -> Colour {
    let colours = a[1] > SATURATED && b[1] > SATURATED;
    let apart = (a[2] - b[2] + PI).rem_euclid(TAU) - PI;
    if colours && apart.abs() > 0.33 * PI {
        let white = [a[0].max(b[0]).max(88.0), 0.0, 0.0];
        *(if t < 0.5 { &mut b } else { &mut a }) = white;
        t = if t < 0.5 { 2.0 * t } else { 2.0 * t - 1.0 };
    } else if colours {
        b[2] = a[2] - apart; // the shorter way around
    }
    if a[1] < SATURATED && b[1] > SATURATED {
        a[2] = hue_of_grey(b, a[0]);
    } else if b[1] < SATURATED && a[1] > SATURATED {
        b[2] = hue_of_grey(a, b[0]);
    }
    let [length, angle, hue] = mix_all(a, b, t);
    let chroma = length * libm::sin(angle);
    lab::to_rgb([length * libm::cos(angle), chroma * libm::cos(hue), chroma * libm::sin(hue)])
}

/// The hue assigned to a grey of length `grey`, so that colours change evenly on the way to a saturated colour.
fn hue_of_grey([length, angle, hue]: [f64; 3], grey: f64) -> f64 {
    if length >= grey - 0.1 {
        return hue;
    }
    let spin = angle * (grey * grey - length * length).sqrt() / (length * libm::sin(angle));
    if hue > -0.3 * PI { hue + spin } else { hue - spin } // away from purple
}

#[cfg(test)]
mod tests {
    use super::*;

    #[track_caller]
    fn near(a: Colour, b: Colour, most: f64) {
        assert!(a.iter().zip(b).all(|(a, b)| (a - b).abs() <= most), "{a:?} is not {b:?}");
    }

    const COOL: Colour = [0.231_373, 0.298_039, 0.752_941];
    const WARM: Colour = [0.705_882, 0.015_686_3, 0.149_02];

    #[test]
    fn interpolation_starts_and_ends_at_the_colours() {
        let colours = [[0.0; 3], [1.0; 3], COOL, WARM, [0.0, 1.0, 0.25], [0.5; 3], [1.0, 0.0, 1.0]];
        for (space, a, b) in ColourSpace::ALL.iter().flat_map(|s| colours.map(|a| colours.map(|b| (s, a, b))).concat())
        {
            near(space.between(a, b, 0.0), a, 2e-3);
            near(space.between(a, b, 1.0), b, 2e-3);
            assert_eq!(ColourSpace::named(space.name()), Some(*space));
        }
    }

    #[test]
    fn cool_to_warm_matches_the_table_of_moreland() {
        // Bytes of the published table of 33 colours: every eighth.
        let table = [[59, 76, 192], [141, 176, 254], [221, 221, 221], [244, 154, 123], [180, 4, 38]];
        for (i, bytes) in table.into_iter().enumerate() {
            let expected = bytes.map(|b: u8| f64::from(b) / 255.0);
            near(ColourSpace::Diverging.between(COOL, WARM, i as f64 / 4.0), expected, 1.5 / 255.0);
        }
        near(ColourSpace::Diverging.between(COOL, WARM, 0.5), [0.865, 0.865, 0.865], 2e-3);
    }

    #[test]
    fn hues_wrap_around_only_when_wrapped() {
        let (blue, red) = ([0.0, 0.0, 1.0], [1.0, 0.0, 0.0]);
        near(ColourSpace::Hsv.between(blue, red, 0.5), [0.0, 1.0, 0.0], 1e-12);
        near(ColourSpace::HsvWrapped.between(blue, red, 0.5), [1.0, 0.0, 1.0], 1e-12);
        near(ColourSpace::HsvWrapped.between(red, blue, 0.5), [1.0, 0.0, 1.0], 1e-12);
        near(ColourSpace::Hsv.between([0.5, 0.25, 0.25], [1.0, 0.5, 0.5], 0.5), [0.75, 0.375, 0.375], 1e-12);
    }

    #[test]
    fn lab_mixes_by_lightness() {
        near(ColourSpace::Lab.between([0.0; 3], [1.0; 3], 0.5), [0.4663; 3], 1e-3); // L* = 50
        near(lab::from_rgb([1.0, 0.0, 0.0]), [53.24, 80.09, 67.20], 0.05);
    }

    #[test]
    fn a_step_has_the_colour_of_its_upper_end() {
        assert_eq!([0.0, 0.1, 1.0].map(|t| ColourSpace::Step.between(COOL, WARM, t)), [COOL, WARM, WARM]);
    }
}
