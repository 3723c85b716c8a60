//! Arranges pictures: contact sheets, a colour bar, differences, texts.

use crate::differences::of_pixels;
use std::io::Write;
use std::path::Path;
use wavesplat_core::base::error::{Error, Result};
use wavesplat_core::base::output::Output;
use wavesplat_engine::render::annotate::{Letters, over};

/// Red, green, blue.
pub type Rgb = [u8; 3];

/// How a sheet looks.
#[derive(Debug, Clone, Copy)]
pub struct Style {
    /// The height of a line of letters in pixels.
    pub line: usize,
    /// The colour of letters.
    pub ink: Rgb,
    /// The colour around pictures.
    pub paper: Rgb,
}

impl Style {
    /// Black on white.
    pub const LIGHT: Self = Self { line: 16, ink: [0; 3], paper: [255; 3] };

    /// Pixels between pictures of a sheet, and around a bar.
    pub fn gap(&self) -> usize {
        self.line / 3
    }
}

/// A picture; row 0 is at the top.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Image {
    /// Pixels a row.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Row after row.
    pub pixels: Vec<Rgb>,
}

impl Image {
    /// A picture with the pixels `colour(x, y)`.
    pub fn from_fn(width: usize, height: usize, colour: impl Fn(usize, usize) -> Rgb) -> Self {
        let pixels = (0..width * height).map(|i| colour(i % width, i / width)).collect();
        Self { width, height, pixels }
    }

    /// Puts a share of a colour over a pixel; does nothing outside of the picture.
    fn put(&mut self, x: usize, y: usize, colour: Rgb, share: f64) {
        if x < self.width && y < self.height {
            let pixel = &mut self.pixels[y * self.width + x];
            *pixel = over(*pixel, colour, share);
        }
    }

    /// Copies a picture into this one with its upper left corner at (x, y), and clips it.
    pub fn paste(&mut self, picture: &Self, x: usize, y: usize) {
        for (i, colour) in picture.pixels.iter().enumerate() {
            self.put(x + i % picture.width, y + i / picture.width, *colour, 1.0);
        }
    }

    /// Writes a text in the line whose upper left corner is at (x, y).
    pub fn write(&mut self, text: &str, x: usize, y: usize, style: &Style) {
        let letters = style.letters();
        let middle = [x as f64 + letters.width(text) / 2.0, (y as f64 + style.line as f64 / 2.0).round()];
        letters.draw(text, middle, |x, y, share| {
            if let (Ok(x), Ok(y)) = (usize::try_from(x), usize::try_from(y)) {
                self.put(x, y, style.ink, share);
            }
        });
    }

    /// Writes the picture to a PNG, which gets its name when it is complete; `force` replaces an existing file.
    ///
    /// # Errors
    /// The file exists, or cannot be written.
    pub fn save(&self, path: &Path, force: bool) -> Result<()> {
        let mut out = Output::create(path, force)?;
        self.write_png(&mut out)?;
        out.commit()
    }

    /// Writes the picture as a PNG.
    fn write_png(&self, to: impl Write) -> Result<()> {
        let side = |n| u32::try_from(n).map_err(|_| Error::usage(format!("{n} pixels are too many for a PNG")));
        let mut encoder = png::Encoder::new(to, side(self.width)?, side(self.height)?);
        encoder.set_color(png::ColorType::Rgb);
        encoder.set_depth(png::BitDepth::Eight);
        encoder.set_compression(png::Compression::High);
        let written = encoder.write_header().and_then(|mut writer| {
            writer.write_image_data(self.pixels.as_flattened())?;
            writer.finish()
        });
        written.map_err(|e| Error::io("PNG", "writing", std::io::Error::other(e)))
    }
}

impl Style {
    fn letters(&self) -> Letters {
        Letters::new(self.line as f64)
    }

    /// The width of a text in pixels.
    fn width(&self, text: &str) -> usize {
        self.letters().width(text).ceil() as usize
    }

    fn blank(&self, width: usize, height: usize) -> Image {
        Image::from_fn(width, height, |_, _| self.paper)
    }

    /// Pictures in rows of `columns`, with gaps between and around them.
    ///
    /// # Panics
    /// The pictures have different sizes, or `columns` is 0.
    pub fn contact_sheet(&self, pictures: &[Image], columns: usize) -> Image {
        let (w, h) = pictures.first().map_or((0, 0), |p| (p.width, p.height));
        assert!(pictures.iter().all(|p| (p.width, p.height) == (w, h)), "pictures of one size");
        let (columns_used, rows, gap) = (columns.min(pictures.len()), pictures.len().div_ceil(columns), self.gap());
        let mut sheet = self.blank(gap + columns_used * (w + gap), gap + rows * (h + gap));
        for (i, picture) in pictures.iter().enumerate() {
            sheet.paste(picture, gap + i % columns * (w + gap), gap + i / columns * (h + gap));
        }
        sheet
    }

    /// The picture with lines of text above it. Long lines are cut at its edge.
    pub fn titled(&self, picture: &Image, lines: &[impl AsRef<str>]) -> Image {
        let step = self.line + self.gap();
        let mut all = self.blank(picture.width, picture.height + lines.len() * step);
        lines.iter().enumerate().for_each(|(n, line)| all.write(line.as_ref(), 0, n * step, self));
        all.paste(picture, 0, lines.len() * step);
        all
    }

    /// Breaks a text after spaces and commas into lines that are no wider than `width` pixels, if possible.
    pub fn broken(&self, text: &str, width: usize) -> Vec<String> {
        let mut lines = vec![String::new()];
        for word in text.split_inclusive([' ', ',']) {
            match lines.last_mut() {
                Some(line) if line.is_empty() || self.width(&format!("{line}{}", word.trim_end())) <= width => {
                    line.push_str(word);
                }
                _ => lines.push(word.into()),
            }
        }
        lines
    }

    /// Pictures one above the other.
    pub fn stacked(&self, pictures: &[Image]) -> Image {
        let width = pictures.iter().map(|p| p.width).max().unwrap_or(0);
        let mut all = self.blank(width, pictures.iter().map(|p| p.height).sum());
        let mut top = 0;
        for picture in pictures {
            all.paste(picture, 0, top);
            top += picture.height;
        }
        all
    }

    /// A sheet with a colour bar at its right and labels for the bar's top, middle and bottom.
    pub fn with_bar(&self, sheet: &Image, labels: &[String; 3], colour: impl Fn(f64) -> Rgb) -> Image {
        let (bar, gap) = (self.line, self.gap());
        let (left, height) = (sheet.width + gap, sheet.height.max(4 * self.line + 2 * gap));
        let text = left + bar + gap;
        let words = labels.iter().map(|label| self.width(label)).max().unwrap_or(0);
        let mut all = self.blank(text + words + gap, height);
        all.paste(sheet, 0, 0);
        let rim = Image::from_fn(bar + 2, height - 2 * gap, |_, _| self.ink);
        all.paste(&rim, left - 1, gap);
        all.paste(&colour_bar(bar, height - 2 * gap - 2, colour), left, gap + 1);
        let rows = [gap, (height - self.line) / 2, height - gap - self.line];
        labels.iter().zip(rows).for_each(|(label, y)| all.write(label, text, y, self));
        all
    }
}

/// An upright bar with `colour(0)` at the bottom and `colour(1)` at the top.
fn colour_bar(width: usize, height: usize, colour: impl Fn(f64) -> Rgb) -> Image {
    let last = height.saturating_sub(1);
    Image::from_fn(width, height, |_, y| colour((last - y) as f64 / last.max(1) as f64))
}

/// The colours of differences at even steps: white for none, dark red for 1 and more.
const DIFFERENCES: [Rgb; 5] = [[255; 3], [255, 231, 140], [252, 150, 60], [214, 47, 39], [128, 0, 38]];

/// White for 0 through yellow and orange to dark red for 1 and more.
pub fn difference_colour(value: f64) -> Rgb {
    let at = value.clamp(0.0, 1.0) * (DIFFERENCES.len() - 1) as f64;
    let below = (at as usize).min(DIFFERENCES.len() - 2);
    over(DIFFERENCES[below], DIFFERENCES[below + 1], at - below as f64)
}

/// The background of pictures of differences.
pub const BACKGROUND: Rgb = [224; 3];

/// |a - b| / scale in [`difference_colour`], as one picture of `width` pixels a row for each `height` rows. A pixel has
/// `channels` numbers; the one that differs most is shown.
///
/// Where both have the background, NaN, it is grey; where only one has it, the difference counts as 1.
///
/// # Panics
/// If `a` and `b` differ in length or do not consist of whole pictures.
pub fn difference_images(
    a: &[f32],
    b: &[f32],
    ([width, height], channels): ([usize; 2], usize),
    scale: f64,
) -> Vec<Image> {
    let of_picture = width * height * channels;
    assert!(a.len() == b.len() && a.len().is_multiple_of(of_picture), "two stacks of whole pictures");
    let colours: Vec<Rgb> = of_pixels(a, b, channels).into_iter().map(|found| heat(found, scale)).collect();
    let picture = |pixels: &[Rgb]| Image { width, height, pixels: pixels.to_vec() };
    colours.chunks_exact(width * height).map(picture).collect()
}

/// The colour of a difference as a share of `scale`; grey for none, where both are background.
pub fn heat(difference: Option<f64>, scale: f64) -> Rgb {
    match difference {
        None => BACKGROUND,
        Some(0.0) => difference_colour(0.0), // even if the scale is 0
        Some(f64::INFINITY) => difference_colour(1.0),
        Some(difference) => difference_colour(difference / scale),
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    const RED: Rgb = [255, 0, 0];
    const BLUE: Rgb = [0, 0, 255];
    const STYLE: Style = Style { line: 12, ink: RED, paper: [7; 3] };

    fn plain(colour: Rgb) -> Image {
        Image::from_fn(4, 3, |_, _| colour)
    }

    fn pixel(image: &Image, x: usize, y: usize) -> Rgb {
        image.pixels[y * image.width + x]
    }

    #[test]
    fn sheets_have_their_pictures_in_rows_and_columns() {
        let style = Style { line: 3, ..STYLE };
        let sheet = style.contact_sheet(&[plain(RED), plain(BLUE), plain([9; 3])], 2);
        assert_eq!((sheet.width, sheet.height), (11, 9));
        assert_eq!((pixel(&sheet, 0, 0), pixel(&sheet, 5, 2)), ([7; 3], [7; 3]));
        assert_eq!((pixel(&sheet, 1, 1), pixel(&sheet, 4, 3)), (RED, RED));
        assert_eq!((pixel(&sheet, 6, 1), pixel(&sheet, 1, 5)), (BLUE, [9; 3]));
        assert_eq!(pixel(&sheet, 6, 5), [7; 3]); // the free place
    }

    #[test]
    fn differences_run_from_white_to_dark_red() {
        let colours = [0.0, 0.25, 0.375, 0.5, 1.0, 9.0].map(difference_colour);
        let between = [254, 191, 100];
        assert_eq!(colours, [DIFFERENCES[0], DIFFERENCES[1], between, DIFFERENCES[2], DIFFERENCES[4], DIFFERENCES[4]]);
        let bar = colour_bar(2, 5, difference_colour);
        assert_eq!([0, 2, 4].map(|y| pixel(&bar, 1, y)), [DIFFERENCES[4], DIFFERENCES[2], DIFFERENCES[0]]);
    }

    #[test]
    fn differences_know_the_background() {
        let nan = f32::NAN;
        let images = difference_images(&[1.0, nan, 2.0, nan], &[1.5, nan, 2.0, 0.0], ([2, 1], 1), 0.5);
        assert_eq!(images.len(), 2);
        assert_eq!(images[0].pixels, [DIFFERENCES[4], BACKGROUND]);
        assert_eq!(images[1].pixels, [DIFFERENCES[0], DIFFERENCES[4]]);
    }

    #[test]
    fn a_pixel_shows_the_channel_that_differs_most() {
        let images = difference_images(&[1.0, 2.0, 3.0, 4.0], &[1.0, 2.5, 3.0, 4.0], ([2, 1], 2), 0.5);
        assert_eq!(images[0].pixels, [DIFFERENCES[4], DIFFERENCES[0]]);
    }

    #[test]
    fn a_bar_is_beside_the_smallest_sheet() {
        let labels = ["1", "x", "0"].map(String::from);
        let all = STYLE.with_bar(&Image::from_fn(2, 2, |_, _| [0; 3]), &labels, difference_colour);
        let (x, gap) = (2 + STYLE.gap(), STYLE.gap());
        assert_eq!(pixel(&all, x, gap + 1), difference_colour(1.0));
        assert_eq!(pixel(&all, x, all.height - gap - 2), difference_colour(0.0));
        assert!(all.pixels.contains(&RED));
    }

    #[test]
    fn titles_are_above_and_pictures_below_one_another() {
        let named = STYLE.titled(&plain(BLUE), &["M", ""]);
        assert_eq!((named.height, pixel(&named, 0, 2 * 16)), (2 * 16 + 3, BLUE));
        assert!(named.pixels[..16 * 4].iter().any(|pixel| *pixel != [7; 3]));
        let stack = STYLE.stacked(&[plain(RED), named]);
        assert_eq!((stack.width, stack.height, pixel(&stack, 3, 2)), (4, 2 * 16 + 6, RED));
    }

    #[test]
    fn texts_are_broken_where_they_can_be() {
        let width = STYLE.width("one two,");
        assert_eq!(STYLE.broken("one two,three", width), ["one two,", "three"]);
        assert_eq!(STYLE.broken("immeasurable two", 10), ["immeasurable ", "two"]);
    }

    #[test]
    fn texts_stop_at_the_edge() {
        let mut image = STYLE.blank(8, 12);
        image.write("long Ωµ", 0, 0, &STYLE);
        assert!(image.pixels.iter().any(|pixel| *pixel != STYLE.paper));
    }
}
