//! Arranges pictures: contact sheets, a colour bar, differences, labels.

use crate::diff::measure::of_pixels;
use font8x8::legacy::BASIC_LEGACY;
use std::io::Write;
use wavesplat::base::error::{Error, Result};

/// Red, green, blue.
pub type Rgb = [u8; 3];

/// Pixels of a letter's side at size 1.
pub const LETTER: usize = 8;
/// Pixels between pictures of a sheet, and around a bar.
pub const GAP: usize = 4;
/// Pixels from one line of a title to the next.
const LINE: usize = LETTER + 4;
/// Pixels: the width of a bar, and its least height.
const BAR: [usize; 2] = [16, 64];

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

    /// Sets a pixel; does nothing outside of the picture.
    pub fn set(&mut self, x: usize, y: usize, colour: Rgb) {
        if x < self.width && y < self.height {
            self.pixels[y * self.width + x] = colour;
        }
    }

    /// Copies a picture into this one with its upper left corner at (x, y), and clips it.
    pub fn paste(&mut self, picture: &Self, x: usize, y: usize) {
        for (i, colour) in picture.pixels.iter().enumerate() {
            self.set(x + i % picture.width, y + i / picture.width, *colour);
        }
    }

    /// Writes ASCII text with its upper left corner at (x, y), a letter being `8 * size` pixels wide and high.
    /// Other characters become question marks.
    pub fn label(&mut self, text: &str, x: usize, y: usize, size: usize, colour: Rgb) {
        for (i, letter) in text.chars().enumerate() {
            self.letter(letter, x + i * LETTER * size, y, size, colour);
        }
    }

    fn letter(&mut self, letter: char, x: usize, y: usize, size: usize, colour: Rgb) {
        let rows = BASIC_LEGACY[if letter.is_ascii() { letter as usize } else { '?' as usize }];
        for (v, u) in (0..LETTER * size).flat_map(|v| (0..LETTER * size).map(move |u| (v, u))) {
            if rows[v / size] >> (u / size) & 1 == 1 {
                self.set(x + u, y + v, colour);
            }
        }
    }

    /// Writes the picture as a PNG.
    pub fn write_png(&self, to: impl Write) -> Result<()> {
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

/// Pictures in rows of `columns`, with `gap` pixels between and around them.
///
/// # Panics
/// The pictures have different sizes, or `columns` is 0.
pub fn contact_sheet(pictures: &[Image], columns: usize, gap: usize, background: Rgb) -> Image {
    let (w, h) = pictures.first().map_or((0, 0), |p| (p.width, p.height));
    assert!(pictures.iter().all(|p| (p.width, p.height) == (w, h)), "pictures of one size");
    let (columns_used, rows) = (columns.min(pictures.len()), pictures.len().div_ceil(columns));
    let mut sheet = Image::from_fn(gap + columns_used * (w + gap), gap + rows * (h + gap), |_, _| background);
    for (i, picture) in pictures.iter().enumerate() {
        sheet.paste(picture, gap + i % columns * (w + gap), gap + i / columns * (h + gap));
    }
    sheet
}

/// An upright bar with `colour(0)` at the bottom and `colour(1)` at the top.
pub fn colour_bar(width: usize, height: usize, colour: impl Fn(f64) -> Rgb) -> Image {
    let last = height.saturating_sub(1);
    Image::from_fn(width, height, |_, y| colour((last - y) as f64 / last.max(1) as f64))
}

/// The picture with a text above it, in lines no longer than it is wide.
pub fn titled(picture: &Image, lines: &[&str], ink: Rgb, paper: Rgb) -> Image {
    let band = lines.len() * LINE;
    let mut all = Image::from_fn(picture.width, picture.height + band, |_, _| paper);
    lines.iter().enumerate().for_each(|(n, line)| all.label(line, 0, n * LINE, 1, ink));
    all.paste(picture, 0, band);
    all
}

/// Pictures one above the other.
pub fn stacked(pictures: &[Image], paper: Rgb) -> Image {
    let width = pictures.iter().map(|p| p.width).max().unwrap_or(0);
    let mut all = Image::from_fn(width, pictures.iter().map(|p| p.height).sum(), |_, _| paper);
    let mut top = 0;
    for picture in pictures {
        all.paste(picture, 0, top);
        top += picture.height;
    }
    all
}

/// A sheet with a colour bar at its right and labels for the bar's top, middle and bottom.
pub fn with_bar(sheet: &Image, labels: &[String; 3], ink: Rgb, paper: Rgb, colour: impl Fn(f64) -> Rgb) -> Image {
    let letters = labels.iter().map(String::len).max().unwrap_or(0);
    let (left, height) = (sheet.width + GAP, sheet.height.max(BAR[1] + 2 * GAP));
    let text = left + BAR[0] + GAP;
    let mut all = Image::from_fn(text + letters * LETTER + GAP, height, |_, _| paper);
    all.paste(sheet, 0, 0);
    all.paste(&colour_bar(BAR[0], height - 2 * GAP, colour), left, GAP);
    let rows = [GAP, (height - LETTER) / 2, height - GAP - LETTER];
    labels.iter().zip(rows).for_each(|(label, y)| all.label(label, text, y, 1, ink));
    all
}

/// Blue for 0 through cyan, green and yellow to red for 1 and more: hue 240 to 0 degrees, full saturation and value.
pub fn difference_colour(value: f64) -> Rgb {
    let hue = 4.0 * (1.0 - value.clamp(0.0, 1.0)); // in sixths of the circle
    let channel = |at: f64| {
        let away = (hue - at).rem_euclid(6.0);
        ((2.0 - away.min(6.0 - away)).clamp(0.0, 1.0) * 255.0).round() as u8
    };
    [channel(0.0), channel(2.0), channel(4.0)]
}

/// |a - b| / scale in [`difference_colour`], as one picture of `width` pixels a row for each `height` rows. A pixel has
/// `channels` numbers; the one that differs most is shown.
///
/// Where both have the background, NaN, it is black; where only one has it, the difference counts as 1.
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

/// The colour of a difference as a share of `scale`; black for none, where both are background.
pub fn heat(difference: Option<f64>, scale: f64) -> Rgb {
    match difference {
        None => [0; 3],
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

    fn plain(colour: Rgb) -> Image {
        Image::from_fn(4, 3, |_, _| colour)
    }

    fn pixel(image: &Image, x: usize, y: usize) -> Rgb {
        image.pixels[y * image.width + x]
    }

    #[test]
    fn sheets_have_their_pictures_in_rows_and_columns() {
        let sheet = contact_sheet(&[plain(RED), plain(BLUE), plain([9; 3])], 2, 1, [7; 3]);
        assert_eq!((sheet.width, sheet.height), (11, 9));
        assert_eq!((pixel(&sheet, 0, 0), pixel(&sheet, 5, 2)), ([7; 3], [7; 3]));
        assert_eq!((pixel(&sheet, 1, 1), pixel(&sheet, 4, 3)), (RED, RED));
        assert_eq!((pixel(&sheet, 6, 1), pixel(&sheet, 1, 5)), (BLUE, [9; 3]));
        assert_eq!(pixel(&sheet, 6, 5), [7; 3]); // the free place
    }

    #[test]
    fn a_png_reads_back() {
        let (image, mut bytes) = (Image::from_fn(5, 2, |x, y| [x as u8, y as u8, 3]), Vec::new());
        image.write_png(&mut bytes).unwrap();
        let mut reader = png::Decoder::new(std::io::Cursor::new(bytes)).read_info().unwrap();
        let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
        let info = reader.next_frame(&mut pixels).unwrap();
        assert_eq!((info.width, info.height), (5, 2));
        assert_eq!(pixels, image.pixels.as_flattened());
    }

    #[test]
    fn differences_run_from_blue_to_red() {
        let colours = [0.0, 0.25, 0.5, 0.75, 1.0, 9.0].map(difference_colour);
        assert_eq!(colours, [BLUE, [0, 255, 255], [0, 255, 0], [255, 255, 0], RED, RED]);
        let bar = colour_bar(2, 5, difference_colour);
        assert_eq!((pixel(&bar, 0, 0), pixel(&bar, 1, 2), pixel(&bar, 0, 4)), (RED, [0, 255, 0], BLUE));
    }

    #[test]
    fn differences_know_the_background() {
        let nan = f32::NAN;
        let images = difference_images(&[1.0, nan, 2.0, nan], &[1.5, nan, 2.0, 0.0], ([2, 1], 1), 0.5);
        assert_eq!(images.len(), 2);
        assert_eq!(images[0].pixels, [RED, [0; 3]]);
        assert_eq!(images[1].pixels, [BLUE, RED]);
    }

    #[test]
    fn a_pixel_shows_the_channel_that_differs_most() {
        let images = difference_images(&[1.0, 2.0, 3.0, 4.0], &[1.0, 2.5, 3.0, 4.0], ([2, 1], 2), 0.5);
        assert_eq!(images[0].pixels, [RED, BLUE]);
    }

    #[test]
    fn a_bar_is_beside_the_smallest_sheet() {
        let labels = ["1", "x", "0"].map(String::from);
        let all = with_bar(&Image::from_fn(2, 2, |_, _| [0; 3]), &labels, RED, [7; 3], difference_colour);
        assert_eq!(pixel(&all, 2 + GAP, GAP), difference_colour(1.0));
        assert_eq!(pixel(&all, 2 + GAP, all.height - GAP - 1), difference_colour(0.0));
        assert!(all.pixels.contains(&RED));
    }

    #[test]
    fn titles_are_above_and_pictures_below_one_another() {
        let named = titled(&plain(BLUE), &["I", ""], RED, [7; 3]);
        assert_eq!((named.height, pixel(&named, 0, 2 * LINE)), (2 * LINE + 3, BLUE));
        assert!(named.pixels[..LINE * 4].contains(&RED));
        let stack = stacked(&[plain(RED), named], [9; 3]);
        assert_eq!((stack.width, stack.height, pixel(&stack, 3, 2)), (4, 2 * LINE + 6, RED));
    }

    #[test]
    fn labels_draw_letters_and_stop_at_the_edge() {
        let mut image = Image::from_fn(20, 16, |_, _| [0; 3]);
        image.label("Ié|", 0, 0, 2, RED);
        let column = |x| (0..16).filter(|y| pixel(&image, x, *y) == RED).count();
        assert!(column(6) == 14 && column(0) == 0, "the stem of an I: {} {}", column(6), column(0));
    }
}
