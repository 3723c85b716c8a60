//! From one colour to the next.

use super::Colour;

/// How colours are interpolated.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Space {
    /// Red, green and blue each by itself.
    Rgb,
    /// Moreland's, by way of white.
    Diverging,
}

impl Space {
    /// Its name.
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Rgb => "RGB",
            Self::Diverging => "Diverging",
        }
    }

    /// By its name.
    pub(super) fn named(name: &str) -> Option<Self> {
        [Self::Rgb, Self::Diverging].into_iter().find(|space| space.name() == name)
    }

    /// The colour at a share of the way.
    pub(super) fn between(self, a: Colour, b: Colour, t: f64) -> Colour {
        std::array::from_fn(|i| a[i] + (b[i] - a[i]) * t)
    }
}
