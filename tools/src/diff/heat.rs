//! The heat map: where two stacks differ, and by how much.

use super::load::Stack;
use super::measure::difference;
use super::report::number;
use crate::sheet::{Image, LETTER, Rgb, colour_bar, contact_sheet, difference_colour, heat};
use std::path::Path;
use wavesplat::error::Result;
use wavesplat::output::Output;

/// At most so many frames are shown.
const SHOWN: usize = 16;
/// At most so many pixels all shown frames have; larger ones are shrunk.
const PIXELS: usize = 1 << 26;
const GAP: usize = 4; // pixels
const BAND: usize = LETTER + 4; // pixels above a picture, for its name
const BAR: [usize; 2] = [16, 64]; // pixels: the width of the bar, and its least height
const PAPER: Rgb = [40; 3];
const INK: Rgb = [255; 3];

/// Draws |A - B| of up to 16 frames evenly spread, red where it is `scale` or more, as one PNG.
///
/// # Errors
/// Frames that cannot be read, a file that cannot be written.
pub(super) fn draw(a: &Stack, b: &Stack, scale: f64, path: &Path) -> Result<()> {
    let frames = shown(a.shape.frames);
    let step = shrinking(frames.len() * a.shape.width * a.shape.height);
    let picture = |frame: &usize| {
        let image = map(&pixels(&a.read(*frame)?, &b.read(*frame)?, a.shape.channels), a.shape.width, step, scale);
        Ok(if a.shape.frames == 1 { image } else { named(&image, &format!("frame {frame}")) })
    };
    let pictures = frames.iter().map(picture).collect::<Result<Vec<_>>>()?;
    let sheet = contact_sheet(&pictures, columns(pictures.len()), GAP, PAPER);
    let mut out = Output::create(path, true)?;
    with_bar(&sheet, scale).write_png(&mut out)?;
    out.commit()
}

/// Frames from the first to the last.
fn shown(frames: usize) -> Vec<usize> {
    let count = frames.min(SHOWN);
    (0..count).map(|i| i * (frames - 1) / (count - 1).max(1)).collect()
}

/// As many columns as rows, or one more.
fn columns(pictures: usize) -> usize {
    (1..).find(|n| n * n >= pictures).unwrap_or(1)
}

/// So many pixels along both axes become one.
fn shrinking(pixels: usize) -> usize {
    (1..).find(|step| pixels / (step * step) <= PIXELS).unwrap_or(1)
}

/// The largest difference of the channels of each pixel; none where all are background in both.
fn pixels(a: &[f64], b: &[f64], channels: usize) -> Vec<Option<f64>> {
    let of_pixel = |(a, b): (&[f64], &[f64])| largest(a.iter().zip(b).map(|(a, b)| difference(*a, *b)));
    a.chunks_exact(channels).zip(b.chunks_exact(channels)).map(of_pixel).collect()
}

fn largest(differences: impl Iterator<Item = Option<f64>>) -> Option<f64> {
    differences.flatten().reduce(f64::max)
}

/// Of `step` times `step` pixels the largest difference is shown, so that none gets lost.
fn map(pixels: &[Option<f64>], width: usize, step: usize, scale: f64) -> Image {
    let height = pixels.len() / width;
    let near = |at: usize, end: usize| at * step..((at + 1) * step).min(end);
    let of = |x, y| largest(near(y, height).flat_map(|v| near(x, width).map(move |u| pixels[v * width + u])));
    Image::from_fn(width.div_ceil(step), height.div_ceil(step), |x, y| heat(of(x, y), scale))
}

fn named(image: &Image, name: &str) -> Image {
    let mut all = Image::from_fn(image.width, image.height + BAND, |_, _| PAPER);
    all.label(name, 0, 0, 1, INK);
    all.paste(image, 0, BAND);
    all
}

/// The sheet with a colour bar from 0 to `scale` at its right.
fn with_bar(sheet: &Image, scale: f64) -> Image {
    let labels = [format!(">={}", number(scale)), "|A-B|".into(), "0".into()];
    let letters = labels.iter().map(String::len).max().unwrap_or(0);
    let (left, height) = (sheet.width + GAP, sheet.height.max(BAR[1] + 2 * GAP));
    let text = left + BAR[0] + GAP;
    let mut all = Image::from_fn(text + letters * LETTER + GAP, height, |_, _| PAPER);
    all.paste(sheet, 0, 0);
    all.paste(&colour_bar(BAR[0], height - 2 * GAP, difference_colour), left, GAP);
    let rows = [GAP, (height - LETTER) / 2, height - GAP - LETTER];
    labels.iter().zip(rows).for_each(|(label, y)| all.label(label, text, y, 1, INK));
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    const NAN: f64 = f64::NAN;

    #[test]
    fn shown_frames_run_from_the_first_to_the_last() {
        assert_eq!(shown(1), [0]);
        assert_eq!(shown(3), [0, 1, 2]);
        let many = shown(1000);
        assert_eq!((many.len(), many[0], many[15]), (16, 0, 999));
    }

    #[test]
    fn a_pixel_shows_its_channel_that_differs_most() {
        let found = pixels(&[1.0, 2.0, NAN, NAN, NAN, 1.0], &[1.5, 5.0, NAN, NAN, 0.0, 1.0], 2);
        assert_eq!(found, [Some(3.0), None, Some(f64::INFINITY)]);
    }

    #[test]
    fn shrinking_keeps_the_largest_difference() {
        assert_eq!((shrinking(PIXELS), shrinking(2 * PIXELS), shrinking(16 * PIXELS)), (1, 2, 4));
        let mut differences = [Some(0.0); 15];
        differences[14] = Some(2.0);
        let image = map(&differences, 5, 2, 2.0);
        assert_eq!((image.width, image.height), (3, 2));
        let (blue, red) = (difference_colour(0.0), difference_colour(1.0));
        assert_eq!(image.pixels, [blue, blue, blue, blue, blue, red]);
    }

    #[test]
    fn the_bar_is_beside_the_smallest_sheet() {
        let all = with_bar(&Image::from_fn(2, 2, |_, _| [0; 3]), 0.5);
        let at = |x: usize, y: usize| all.pixels[y * all.width + x];
        assert_eq!(at(2 + GAP, GAP), difference_colour(1.0));
        assert_eq!(at(2 + GAP, all.height - GAP - 1), difference_colour(0.0));
        assert!(all.pixels.contains(&INK));
    }
}
