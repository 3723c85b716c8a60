//! Letters as shares of pixels, from DejaVu Sans. The file font.ttf has its Latin and Greek letters, superscripts and signs;
//! font-licence.txt is its licence.

use ab_glyph::{Font, FontRef, PxScaleFont, ScaleFont, point};

const FONT: &[u8] = include_bytes!("font.ttf");

/// Letters of one size.
#[derive(Debug, Clone)]
pub struct Letters {
    font: PxScaleFont<FontRef<'static>>,
    /// The height of a line in pixels.
    pub(super) size: f64,
}

impl Letters {
    /// Letters for lines of `size` pixels.
    pub fn new(size: f64) -> Self {
        let font = FontRef::try_from_slice(FONT).unwrap_or_else(|_| unreachable!("the program's own font"));
        Self { font: font.into_scaled(size as f32), size }
    }

    /// The same letters in another size.
    pub(super) fn with_size(&self, size: f64) -> Self {
        Self { font: self.font.font.clone().into_scaled(size as f32), size }
    }

    /// The width of a text in pixels.
    pub fn width(&self, text: &str) -> f64 {
        text.chars().map(|letter| f64::from(self.font.h_advance(self.font.glyph_id(known(letter))))).sum()
    }

    /// Calls `put(x, y, share)` for all pixels of a text whose middle is at `middle`.
    pub fn draw(&self, text: &str, middle: [f64; 2], mut put: impl FnMut(i64, i64, f64)) {
        let (mut x, half) =
            (middle[0] - self.width(text) / 2.0, f64::from(self.font.ascent() + self.font.descent()) / 2.0);
        for letter in text.chars() {
            let id = self.font.glyph_id(known(letter));
            let glyph = id.with_scale_and_position(self.font.scale(), point(x as f32, (middle[1] + half) as f32));
            x += f64::from(self.font.h_advance(id));
            if let Some(outline) = self.font.outline_glyph(glyph) {
                let corner = outline.px_bounds().min;
                let (left, top) = (corner.x as i64, corner.y as i64);
                outline
                    .draw(|u, v, share| put(left + i64::from(u), top + i64::from(v), f64::from(share.clamp(0.0, 1.0))));
            }
        }
    }
}

/// The longest beginning of a text that fits, with dots if something is left out.
pub(super) fn shortened(text: &str, fits: impl Fn(&str) -> bool) -> String {
    if fits(text) {
        return text.into();
    }
    let letters: Vec<char> = text.chars().collect();
    let beginning = |count: usize| letters[..count].iter().chain(['…'].iter()).collect::<String>();
    (0..letters.len()).rev().map(beginning).find(|text| fits(text)).unwrap_or_default()
}

/// A letter of the font: others become a question mark.
fn known(letter: char) -> char {
    let is_known = matches!(letter, ' '..='~' | '\u{a0}'..='\u{ff}' | 'Α'..='ω' | '–' | '…' | '⁰'..='₎' | '−' | '′' | '″' | '√' | '∂' | '∇');
    if is_known { letter } else { '?' }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ink(text: &str, size: f64) -> Vec<(i64, i64)> {
        let mut found = Vec::new();
        Letters::new(size).draw(text, [100.0, 100.0], |x, y, share| {
            if share > 0.5 {
                found.push((x, y));
            }
        });
        found
    }

    #[test]
    fn letters_stay_around_their_middle() {
        for size in [9.0, 14.0, 60.0] {
            let letters = Letters::new(size);
            for text in ["frame 10", "−0.25", "kg m⁻³ µ °C Ω", "gj|Ü"] {
                let (pixels, half) = (ink(text, size), letters.width(text) / 2.0 + 2.0);
                assert!(pixels.len() > 5, "{text} at {size}");
                assert!(
                    pixels.iter().all(|(x, y)| {
                        (*x as f64 - 100.0).abs() <= half && (*y as f64 - 100.0).abs() <= 0.75 * size
                    })
                );
            }
            assert!(letters.width("mm") > letters.width("m") && letters.width("") == 0.0);
        }
    }

    #[test]
    fn long_names_are_shortened() {
        assert_eq!([shortened("abcdef", |t| t.chars().count() <= 4), shortened("ab", |_| true)], ["abc…", "ab"]);
    }

    #[test]
    fn all_letters_have_a_shape() {
        for letter in (' '..='~').chain('α'..='ω').chain("⁻¹²³°µ×·−".chars()).filter(|letter| *letter != ' ')
        {
            assert!(!ink(&letter.to_string(), 30.0).is_empty(), "{letter}");
        }
        assert_eq!(ink("\u{4e2d}", 20.0), ink("?", 20.0), "unknown letters");
        assert!(ink(" ", 20.0).is_empty());
    }
}
