//! Letters as pixels.

use spleen_font::{FONT_8X16, FONT_12X24, FONT_16X32};

/// Letters of one size.
#[derive(Debug, Clone, Copy)]
pub(super) struct Letters {
    /// The rows of each ASCII character, one after another. Each row starts at a byte; the most significant bit is the
    /// left pixel.
    bits: &'static [u8],
    /// Pixels from one letter to the next.
    pub(super) width: usize,
    /// Pixels from one line to the next.
    pub(super) height: usize,
}

impl Letters {
    /// The letter size for a picture whose shorter side has `pixels` pixels.
    pub(super) fn for_side(pixels: usize) -> Self {
        // The tables are PSF files: a header, then the bits. The crate's own reader misreads the smallest font.
        const OF_PSF_1: usize = 4;
        const OF_PSF_2: usize = 32;
        let (font, header, width) = match pixels {
            0..600 => (FONT_8X16, OF_PSF_1, 8),
            600..1400 => (FONT_12X24, OF_PSF_2, 12),
            _ => (FONT_16X32, OF_PSF_2, 16),
        };
        Self { bits: &font[header..], width, height: 2 * width }
    }

    /// The set pixels of a text, as [x, y] from its upper left corner. Characters outside ASCII are skipped.
    pub(super) fn pixels(&self, text: &str) -> Vec<[usize; 2]> {
        let row = self.width.div_ceil(8);
        let mut inked = Vec::new();
        for (column, letter) in text.bytes().filter(u8::is_ascii).enumerate() {
            let bits = &self.bits[usize::from(letter) * row * self.height..][..row * self.height];
            let is_on = |x: usize, y: usize| bits[y * row + x / 8] << (x % 8) & 0x80 != 0;
            let all = (0..self.height).flat_map(|y| (0..self.width).map(move |x| (x, y)));
            inked.extend(all.filter(|(x, y)| is_on(*x, *y)).map(|(x, y)| [column * self.width + x, y]));
        }
        inked
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::HashSet;

    #[test]
    fn letters_stay_in_their_cell() {
        for (side, height) in [(16, 16), (800, 24), (4000, 32)] {
            let letters = Letters::for_side(side);
            assert_eq!(letters.height, height);
            let pixels = |c: u8| letters.pixels(std::str::from_utf8(&[c]).expect("ASCII"));
            let all: HashSet<_> = (b' '..=b'~').map(pixels).collect();
            assert_eq!(all.len(), 95, "all letters differ");
            assert!(
                all.iter().flatten().all(|[x, y]| *x < letters.width && *y < letters.height) && pixels(b' ').is_empty()
            );
            let left = pixels(b'L').iter().filter(|[x, _]| *x < letters.width / 2).count();
            assert!(2 * left > pixels(b'L').len(), "the stem is at the left");
        }
        assert!(Letters::for_side(0).pixels(" 1").iter().all(|[x, _]| *x >= 8));
    }
}
