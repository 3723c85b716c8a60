//! The heat map: where two stacks differ, and by how much.

use super::load::Stack;
use super::report::number;
use std::path::Path;
use wavesplat::base::error::Result;
use wavesplat_demo::differences::{largest, of_pixels};
use wavesplat_demo::sheet::{Image, Style, difference_colour, heat};

const STYLE: Style = Style::LIGHT;
/// The largest number of frames shown.
const SHOWN: usize = 16;
/// The largest number of pixels of all shown frames; larger pictures are shrunk.
const PIXELS: usize = 1 << 26;

/// Draws |A - B| of up to 16 frames evenly spread, dark red where it is `scale` or more, as one PNG.
///
/// # Errors
/// Frames cannot be read, or the file cannot be written.
pub(super) fn draw(a: &Stack, b: &Stack, scale: f64, (path, force): (&Path, bool)) -> Result<()> {
    let frames = shown(a.shape.frames);
    let step = shrinking(frames.len() * a.shape.width * a.shape.height);
    let picture = |frame: &usize| {
        let image = map(&of_pixels(&a.read(*frame)?, &b.read(*frame)?, a.shape.channels), a.shape.width, step, scale);
        Ok(if a.shape.frames == 1 { image } else { STYLE.titled(&image, &[format!("frame {frame}")]) })
    };
    let pictures = frames.iter().map(picture).collect::<Result<Vec<_>>>()?;
    let sheet = STYLE.contact_sheet(&pictures, columns(pictures.len()));
    let labels = [format!("{} or more", number(scale)), "|A − B|".into(), "0".into()];
    STYLE.with_bar(&sheet, &labels, difference_colour).save(path, force)
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

/// The factor by which pictures are shrunk along both axes.
fn shrinking(pixels: usize) -> usize {
    (1..).find(|step| pixels / (step * step) <= PIXELS).unwrap_or(1)
}

/// A block of `step` times `step` pixels shows its largest difference, so that none disappears.
fn map(pixels: &[Option<f64>], width: usize, step: usize, scale: f64) -> Image {
    let height = pixels.len() / width;
    let near = |at: usize, end: usize| at * step..((at + 1) * step).min(end);
    let of = |x, y| largest(near(y, height).flat_map(|v| near(x, width).map(move |u| pixels[v * width + u])));
    Image::from_fn(width.div_ceil(step), height.div_ceil(step), |x, y| heat(of(x, y), scale))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shown_frames_run_from_the_first_to_the_last() {
        assert_eq!(shown(1), [0]);
        assert_eq!(shown(3), [0, 1, 2]);
        let many = shown(1000);
        assert_eq!((many.len(), many[0], many[15]), (16, 0, 999));
    }

    #[test]
    fn shrinking_keeps_the_largest_difference() {
        assert_eq!((shrinking(PIXELS), shrinking(2 * PIXELS), shrinking(16 * PIXELS)), (1, 2, 4));
        let mut differences = [Some(0.0); 15];
        differences[14] = Some(2.0);
        let image = map(&differences, 5, 2, 2.0);
        assert_eq!((image.width, image.height), (3, 2));
        let (none, most) = (difference_colour(0.0), difference_colour(1.0));
        assert_eq!(image.pixels, [none, none, none, none, none, most]);
    }
}
