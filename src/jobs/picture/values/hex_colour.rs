//! Colours as six hexadecimal digits.

use std::fmt;
use std::str::FromStr;
use wavesplat_core::base::choice::serde_as_text;
use wavesplat_core::colour::{Colour, Rgb};

/// A colour like `ffffff`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct HexColour(pub Rgb);

impl HexColour {
    /// Red, green and blue, each 0 to 1.
    pub(crate) fn shares(self) -> Colour {
        self.0.map(|c| f64::from(c) / 255.0)
    }
}

impl FromStr for HexColour {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let wrong = || "takes six hexadecimal digits, such as ffffff".to_string();
        let digits = text.trim_start_matches('#');
        let number = u32::from_str_radix(digits, 16).ok().filter(|_| digits.len() == 6).ok_or_else(wrong)?;
        Ok(Self([(number >> 16) as u8, (number >> 8) as u8, number as u8]))
    }
}

impl fmt::Display for HexColour {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [r, g, b] = self.0;
        write!(f, "{r:02x}{g:02x}{b:02x}")
    }
}

serde_as_text!(HexColour);
