//! Pictures one after another in one file.

use super::{PictureFormat, SinkConfig, exr, png};
use crate::render::{Picture, Pixel, Rendered};
use std::io::{self, Write};
use wavesplat_core::base::npy;
use wavesplat_core::base::sample::SampleType;
use wavesplat_core::colour::Rgb;

/// Writes the header of a stream.
pub(super) fn begin(config: &SinkConfig, out: &mut impl Write) -> io::Result<()> {
    let [width, height] = config.size;
    match config.format {
        PictureFormat::Npy if config.coloured_array => {
            npy::write_header(SampleType::U8, &[config.shown.len(), height, width, 3], out)
        }
        PictureFormat::Npy => {
            let shape = [config.shown.len(), height, width, config.pixel.numbers()];
            let axes = if config.pixel == Pixel::Value { 3 } else { 4 };
            npy::write_header(SampleType::F32, &shape[..axes], out)
        }
        PictureFormat::Y4m => {
            let [frames, seconds] = config.frames_and_seconds();
            let chroma = if has_half_chroma(config.size) { "420jpeg" } else { "444" };
            writeln!(out, "YUV4MPEG2 W{width} H{height} F{frames}:{seconds} Ip A1:1 C{chroma} XCOLORRANGE=FULL")
        }
        _ => Ok(()),
    }
}

/// Writes one picture.
pub(super) fn write(
    config: &SinkConfig,
    rendered: &Rendered<'_>,
    picture: Picture<'_>,
    out: &mut impl Write,
) -> io::Result<()> {
    match config.format {
        PictureFormat::Npy if !config.coloured_array => write_numbers(picture, f32::to_le_bytes, out),
        PictureFormat::Gray16 => {
            let level = |v: f32| ((config.colours.share(v) * 65535.0).round() as u16).to_le_bytes();
            write_numbers(&config.as_coloured(rendered, picture), level, out)
        }
        PictureFormat::Y4m => write_yuv(config.image(rendered, picture), config.size, out),
        PictureFormat::Npy | PictureFormat::Rgb24 | PictureFormat::Movie(_) | PictureFormat::Page => {
            out.write_all(config.image(rendered, picture).as_flattened())
        }
        PictureFormat::Exr => exr::write(config, &config.texts_of(rendered), picture, out),
        PictureFormat::Png | PictureFormat::Apng | PictureFormat::Sheet => {
            png::write(config, config.size, &config.texts_of(rendered), &png::samples(config, rendered, picture), out)
        }
    }
}

/// Writes the `bytes` of numbers, some at a time: a buffer for all would be fresh memory for every picture.
fn write_numbers<const N: usize>(
    numbers: &[f32],
    bytes: impl Fn(f32) -> [u8; N],
    out: &mut impl Write,
) -> io::Result<()> {
    let mut buffer = Vec::with_capacity(SOME * N);
    numbers.chunks(SOME).try_for_each(|some| {
        buffer.clear();
        buffer.extend(some.iter().flat_map(|number| bytes(*number)));
        out.write_all(&buffer)
    })
}

/// Numbers that are written together.
const SOME: usize = 1 << 14;

/// Whether the colours of a stream have half of the resolution: what every player shows, but only sizes that are even have it.
fn has_half_chroma([width, height]: [usize; 2]) -> bool {
    width % 2 == 0 && height % 2 == 0
}

fn write_yuv(mut pixels: Vec<Rgb>, size: [usize; 2], out: &mut impl Write) -> io::Result<()> {
    writeln!(out, "FRAME")?;
    pixels.iter_mut().for_each(|pixel| *pixel = yuv(*pixel));
    let plane = |n: usize| pixels.iter().map(|pixel| pixel[n]).collect::<Vec<u8>>();
    out.write_all(&plane(0))?;
    let chroma = |n: usize| if has_half_chroma(size) { halved(&plane(n), size[0]) } else { plane(n) };
    out.write_all(&chroma(1))?;
    out.write_all(&chroma(2))
}

/// The mean of every two by two bytes of a plane with rows of `width` bytes; width and height are even.
fn halved(plane: &[u8], width: usize) -> Vec<u8> {
    let rows = plane.chunks_exact(2 * width).map(|two| two.split_at(width));
    let mean = |(above, below): (&[u8], &[u8])| {
        let sum = above.iter().chain(below).map(|byte| u16::from(*byte)).sum::<u16>();
        ((sum + 2) / 4) as u8
    };
    rows.flat_map(|(above, below)| above.chunks_exact(2).zip(below.chunks_exact(2)).map(mean)).collect()
}

/// Full-range BT.601, the default of players for streams without colour information.
fn yuv([r, g, b]: [u8; 3]) -> [u8; 3] {
    let [r, g, b] = [r, g, b].map(f64::from);
    let y = 0.299 * r + 0.587 * g + 0.114 * b;
    let byte = |v: f64| v.round().clamp(0.0, 255.0) as u8;
    [byte(y), byte(128.0 + (b - y) / 1.772), byte(128.0 + (r - y) / 1.402)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn halved_planes_have_the_means_of_four() {
        assert_eq!(halved(&[0, 1, 9, 9, 2, 1, 8, 9], 4), [1, 9]);
    }

    #[test]
    fn grey_has_no_chroma() {
        for level in [0, 1, 127, 255] {
            assert_eq!(yuv([level; 3]), [level, 128, 128]);
        }
    }
}
