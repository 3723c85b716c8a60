//! A picture to draw lines and letters on.

use super::layout;
use super::text::Letters;
use wavesplat_core::colour::Rgb;

/// A picture, the colour of ink, and the letters.
pub(super) struct Canvas<'a> {
    pub(super) pixels: &'a mut [Rgb],
    pub(super) width: usize,
    pub(super) background: Rgb,
    pub(super) ink: Rgb,
    pub(super) letters: Letters,
    /// The rectangles of all texts, and of the colour bar. Nothing else is drawn there.
    pub(super) taken: Vec<Rectangle>,
    /// All texts.
    pub(super) written: Vec<String>,
}

impl<'a> Canvas<'a> {
    /// A picture without texts, with letters of the size that suits it.
    pub(super) fn new(pixels: &'a mut [Rgb], size: [usize; 2], background: Rgb) -> Self {
        let (ink, letters) = (contrast(background), Letters::new(layout::line(size)));
        Self { pixels, width: size[0], background, ink, letters, taken: Vec::new(), written: Vec::new() }
    }
}

/// The left upper and the right lower corner.
pub(super) type Rectangle = [[f64; 2]; 2];

/// Whether two rectangles have a point in common.
fn overlap(a: &Rectangle, b: &Rectangle) -> bool {
    (0..2).all(|i| a[0][i] < b[1][i] && b[0][i] < a[1][i])
}

/// Black or white, whichever stands out from a colour.
fn contrast([r, g, b]: Rgb) -> Rgb {
    let bright = 299 * u32::from(r) + 587 * u32::from(g) + 114 * u32::from(b) > 127_500;
    if bright { [0; 3] } else { [255; 3] }
}

/// A colour with a share of another one over it.
pub fn over(below: Rgb, above: Rgb, share: f64) -> Rgb {
    std::array::from_fn(|c| (f64::from(below[c]) + share * (f64::from(above[c]) - f64::from(below[c]))).round() as u8)
}

impl Canvas<'_> {
    pub(super) fn size(&self) -> [f64; 2] {
        [self.width as f64, (self.pixels.len() / self.width.max(1)) as f64]
    }

    /// Puts a share of a colour over a pixel, if it is in the picture.
    pub(super) fn put(&mut self, x: i64, y: i64, colour: Rgb, share: f64) {
        let inside = x >= 0 && y >= 0 && (x as usize) < self.width;
        let at = if inside { y as usize * self.width + x as usize } else { usize::MAX };
        if let Some(pixel) = self.pixels.get_mut(at) {
            *pixel = over(*pixel, colour, share);
        }
    }

    /// Fills a rectangle of whole pixels.
    pub(super) fn fill(&mut self, [left, top]: [i64; 2], [width, height]: [i64; 2], colour: Rgb) {
        (top..top + height).for_each(|y| (left..left + width).for_each(|x| self.put(x, y, colour, 1.0)));
    }

    /// Draws a line in ink.
    pub(super) fn line(&mut self, from: [f64; 2], to: [f64; 2], thickness: f64) {
        let (size, ink) = (self.size(), self.ink);
        line(size, from, to, thickness, |x, y, share| self.put(x, y, ink, share));
    }

    /// Whether a rectangle is in the picture and free.
    pub(super) fn is_free(&self, rectangle: &Rectangle) -> bool {
        let size = self.size();
        (0..2).all(|i| rectangle[0][i] >= 0.0 && rectangle[1][i] <= size[i])
            && !self.taken.iter().any(|taken| overlap(taken, rectangle))
    }

    /// Whether a pixel is taken.
    pub(super) fn is_taken(&self, at: usize) -> bool {
        let pixel = [(at % self.width) as f64, (at / self.width) as f64];
        self.taken.iter().any(|taken| overlap(taken, &[pixel, pixel.map(|n| n + 1.0)]))
    }

    /// Writes a text around a point, if it fits in the picture and the place is free. Returns whether it does.
    pub(super) fn write(&mut self, text: &str, middle: [f64; 2]) -> bool {
        self.write_in(&self.letters.clone(), text, middle)
    }

    /// The same in letters of another size.
    pub(super) fn write_in(&mut self, letters: &Letters, text: &str, middle: [f64; 2]) -> bool {
        let ink = self.ink;
        let fits = self.take(text, middle, [letters.width(text) / 2.0, letters.size / 2.0]);
        if fits {
            letters.draw(text, middle, |x, y, share| self.put(x, y, ink, share));
        }
        fits
    }

    /// [`Self::write`], upwards.
    pub(super) fn write_upwards(&mut self, text: &str, middle: [f64; 2]) -> bool {
        let (letters, ink) = (self.letters.clone(), self.ink);
        let fits = self.take(text, middle, [letters.size / 2.0, letters.width(text) / 2.0]);
        if fits {
            let [x0, y0] = middle.map(f64::round);
            letters.draw(text, [0.0, 0.0], |x, y, share| self.put(x0 as i64 + y, y0 as i64 - x, ink, share));
        }
        fits
    }

    /// Takes the place of a text, if it is in the picture and free.
    fn take(&mut self, text: &str, middle: [f64; 2], half: [f64; 2]) -> bool {
        let corners = [-1.0, 1.0].map(|side| std::array::from_fn(|i| middle[i] + side * half[i]));
        let fits = !text.is_empty() && self.is_free(&corners);
        if fits {
            self.taken.push(corners);
            self.written.push(text.into());
        }
        fits
    }
}

/// Calls `put(x, y, share)` for the pixels of a line, within a picture of some size.
pub(super) fn line(size: [f64; 2], from: [f64; 2], to: [f64; 2], thickness: f64, mut put: impl FnMut(i64, i64, f64)) {
    let along = [to[0] - from[0], to[1] - from[1]];
    let square = along[0] * along[0] + along[1] * along[1];
    let reach = thickness / 2.0 + 1.0;
    let pixels = |low: f64, high: f64, i: usize| {
        (low - reach).floor().clamp(0.0, size[i]) as i64..(high + reach).ceil().clamp(0.0, size[i]) as i64
    };
    for y in pixels(from[1].min(to[1]), from[1].max(to[1]), 1) {
        // The part of the line that is near this row.
        let [one, other] = [-reach, reach].map(|off| {
            let share = (y as f64 + 0.5 + off - from[1]) / along[1];
            from[0] + share.clamp(0.0, 1.0) * along[0]
        });
        let [one, other] = if along[1] == 0.0 { [from[0], to[0]] } else { [one, other] };
        for x in pixels(one.min(other), one.max(other), 0) {
            let at = [x as f64 + 0.5 - from[0], y as f64 + 0.5 - from[1]];
            let share =
                if square > 0.0 { ((at[0] * along[0] + at[1] * along[1]) / square).clamp(0.0, 1.0) } else { 0.0 };
            let off = [at[0] - share * along[0], at[1] - share * along[1]];
            let distance = (off[0] * off[0] + off[1] * off[1]).sqrt();
            let covered = (thickness / 2.0 + 0.5 - distance).clamp(0.0, 1.0);
            if covered > 0.0 {
                put(x, y, covered);
            }
        }
    }
}
