//! Pictures of one view over some frames, as a web page takes them: raw, or coded small.
//!
//! A coded block holds the pictures' orthonormal Haar transform over time (eq 5). Each plane of it is guessed from coarse to
//! fine, every pixel from those around it that are known, and only what guesses miss is kept, in whole steps. Smooth
//! planes are guessed well. Guesses start from what the page will know, so that every coefficient is within half a step.
//! The largest error of a number is then half a step times the sum of a picture's weights, which is below 2.2 for 32
//! pictures. `web/block.js` is the inverse. What was tried is in NOTES.md.

use flate2::{Compression, write::ZlibEncoder};
use rayon::prelude::*;
use serde::Serialize;
use std::io::{self, Write};

/// The largest code: three bytes with a sign.
const MOST: f64 = ((1 << 23) - 1) as f64;
const CODE_BYTES: usize = 3;

/// Numbers of pictures, one plane of pixels after another: all planes of a picture, then those of the next. NaN is no
/// value.
#[derive(Debug, Clone, PartialEq)]
pub struct Planes {
    /// Width and height in pixels.
    pub(crate) size: [usize; 2],
    /// Planes of a picture.
    pub(crate) numbers: usize,
    /// Whether numbers are logarithms of values.
    pub(crate) log: bool,
    pub(crate) planes: Vec<Vec<f32>>,
}

/// How the bytes behind a block's head are to be read.
#[derive(Debug, Serialize)]
struct Head {
    size: [usize; 2],
    numbers: usize,
    pictures: usize,
    /// Whether numbers are logarithms of values.
    log: bool,
    /// The step of codes; 0 for raw numbers.
    step: f32,
    /// Bytes of each coded plane; 0 for a plane of zeros.
    lengths: Vec<usize>,
    /// Bytes that mark missing numbers; 0 if none is missing.
    missing: usize,
}

impl Planes {
    /// Planes of zeros: `numbers` of `size` pixels.
    pub fn new(size: [usize; 2], numbers: usize, log: bool) -> Self {
        Self { size, numbers, log, planes: Vec::new() }
    }

    /// Adds a picture. The numbers of a pixel are side by side in it; `number` gives what is kept of each.
    pub fn push(&mut self, picture: &[f32], number: impl Fn(f32) -> f32) {
        let plane = |n| picture.iter().skip(n).step_by(self.numbers).map(|value| number(*value)).collect();
        let planes: Vec<Vec<f32>> = (0..self.numbers).map(plane).collect();
        self.planes.extend(planes);
    }

    /// The number of pictures.
    pub fn pictures(&self) -> usize {
        self.planes.len() / self.numbers
    }

    fn head(&self, step: f32) -> Head {
        let (size, numbers, pictures) = (self.size, self.numbers, self.pictures());
        Head { size, numbers, pictures, log: self.log, step, lengths: Vec::new(), missing: 0 }
    }

    /// A block of the numbers as they are: little-endian floats of 32 bits.
    pub fn raw(&self) -> io::Result<Vec<u8>> {
        let mut bytes = headed(&self.head(0.0))?;
        for plane in &self.planes {
            let start = bytes.len();
            bytes.resize(start + size_of_val(plane.as_slice()), 0);
            let places = bytes[start..].as_chunks_mut().0;
            places.iter_mut().zip(plane).for_each(|(place, number)| *place = number.to_le_bytes());
        }
        Ok(bytes)
    }

    /// A block of codes that are multiples of `step`.
    pub fn coded(mut self, step: f32) -> io::Result<Vec<u8>> {
        let missing = self.missing()?;
        let is_known = self.is_known();
        self.fill();
        haar(&mut self.planes, self.numbers);
        let largest =
            self.planes.par_iter().flatten().fold(|| 0.0, |a: f32, b| a.max(b.abs())).reduce(|| 0.0, f32::max);
        let step = step.max(largest / MOST as f32 * 2.0);
        let known = |n: usize| &is_known[n % self.numbers];
        let planes = self.planes.par_iter().enumerate();
        let coded = planes.map(|(n, plane)| code(plane, known(n), self.size, step));
        let coded: Vec<Vec<u8>> = coded.collect::<io::Result<_>>()?;
        let lengths = coded.iter().map(Vec::len).collect();
        let mut bytes = headed(&Head { lengths, missing: missing.len(), ..self.head(step) })?;
        coded.iter().chain([&missing]).for_each(|part| bytes.extend(part));
        Ok(bytes)
    }

    /// Which numbers are missing: a byte for each, 1 where this changes from the picture before. Empty if none is
    /// missing.
    fn missing(&self) -> io::Result<Vec<u8>> {
        let is_missing = |plane: &Vec<f32>, at: usize| plane[at].is_nan();
        if !self.planes.par_iter().any(|plane| plane.iter().any(|number| number.is_nan())) {
            return Ok(Vec::new());
        }
        let bytes = self.planes.iter().enumerate().flat_map(|(n, plane)| {
            let before = n.checked_sub(self.numbers).map(|before| &self.planes[before]);
            (0..plane.len())
                .map(move |at| u8::from(is_missing(plane, at) != before.is_some_and(|plane| is_missing(plane, at))))
        });
        packed(&bytes.collect::<Vec<u8>>())
    }

    /// Whether each number of a pixel is known in some picture.
    fn is_known(&self) -> Vec<Vec<bool>> {
        let pixels = self.size[0] * self.size[1];
        let is_known = |n: usize| {
            let planes = || self.planes.iter().skip(n).step_by(self.numbers);
            (0..pixels).map(|at| planes().any(|plane| !plane[at].is_nan())).collect()
        };
        (0..self.numbers).map(is_known).collect()
    }

    /// Gives missing numbers the last number of their pixel, else its next one, else 0: these change least over time.
    fn fill(&mut self) {
        for n in self.numbers..self.planes.len() {
            fill_from(&mut self.planes, n, n - self.numbers);
        }
        for n in (0..self.planes.len().saturating_sub(self.numbers)).rev() {
            fill_from(&mut self.planes, n, n + self.numbers);
        }
        self.planes.par_iter_mut().flatten().filter(|number| number.is_nan()).for_each(|number| *number = 0.0);
    }
}

fn fill_from(planes: &mut [Vec<f32>], n: usize, from: usize) {
    let mut plane = std::mem::take(&mut planes[n]);
    plane
        .iter_mut()
        .zip(&planes[from])
        .filter(|(number, _)| number.is_nan())
        .for_each(|(number, from)| *number = *from);
    planes[n] = plane;
}

/// The orthonormal Haar transform over time of each number, in place: sums of 2, 4, 8, ... pictures stay at the first of
/// these, and differences at the first of the second half. A picture without a partner is not changed.
fn haar(planes: &mut [Vec<f32>], numbers: usize) {
    let mut half = numbers;
    while half < planes.len() {
        for group in planes.chunks_mut(2 * half).filter(|group| group.len() > half) {
            let (first, second) = group.split_at_mut(half);
            for (sums, differences) in first.iter_mut().zip(second).take(numbers) {
                turn(sums, differences);
            }
        }
        half *= 2;
    }
}

/// Puts sums and differences, by the root of 2, in the place of two planes.
fn turn(a: &mut [f32], b: &mut [f32]) {
    const PART: f32 = std::f32::consts::FRAC_1_SQRT_2;
    for (a, b) in a.iter_mut().zip(b) {
        (*a, *b) = ((*a + *b) * PART, (*a - *b) * PART);
    }
}

/// Codes a plane as differences from the expected numbers, in whole steps. The lowest bytes of all differences come
/// first, then the next ones, and all are packed. Empty if all differences are 0.
fn code(plane: &[f32], is_known: &[bool], size: [usize; 2], step: f32) -> io::Result<Vec<u8>> {
    let step = f64::from(step);
    let mut rests = Vec::with_capacity(plane.len());
    let mut found = vec![0.0; plane.len()];
    from_coarse_to_fine(size, &mut found, |at, expected| {
        let rest = (f64::from(plane[at]) / step - expected).round().clamp(-MOST, MOST);
        let rest = if is_known[at] { rest } else { 0.0 };
        rests.push(rest as i32);
        expected + rest
    });
    if rests.iter().all(|rest| *rest == 0) {
        return Ok(Vec::new());
    }
    let bytes =
        (0..8 * CODE_BYTES).step_by(8).flat_map(|shift| rests.iter().map(move |rest| (folded(*rest) >> shift) as u8));
    packed(&bytes.collect::<Vec<u8>>())
}

/// Visits the first pixel, then those halfway between known ones, until all are known. `put` takes the place of a pixel
/// and the number expected there, and returns the number to store.
fn from_coarse_to_fine([width, height]: [usize; 2], found: &mut [f64], mut put: impl FnMut(usize, f64) -> f64) {
    let Some(first) = found.first_mut() else { return };
    *first = put(0, 0.0);
    let mut gap = width.max(height).next_power_of_two() / 2;
    while gap > 0 {
        for y in (0..height).step_by(2 * gap) {
            for x in (gap..width).step_by(2 * gap) {
                let at = y * width + x;
                found[at] = put(at, expected(found, at, [x, width, gap], gap));
            }
        }
        for y in (gap..height).step_by(2 * gap) {
            for x in (0..width).step_by(gap) {
                let at = y * width + x;
                found[at] = put(at, expected(found, at, [y, height, gap], gap * width));
            }
        }
        gap /= 2;
    }
}

/// The number between known ones at the place `along` of an axis, by a cubic where there are four. Known numbers are `gap`
/// pixels away along the axis, and `stride` in memory.
fn expected(found: &[f64], at: usize, [along, length, gap]: [usize; 3], stride: usize) -> f64 {
    let before = found[at - stride];
    if along + gap >= length {
        return before;
    }
    let sum = before + found[at + stride];
    if along < 3 * gap || along + 3 * gap >= length {
        return sum / 2.0;
    }
    (9.0 * sum - found[at - 3 * stride] - found[at + 3 * stride]) / 16.0
}

/// 0, -1, 1, -2, 2, ... as 0, 1, 2, 3, 4, ...
fn folded(number: i32) -> u32 {
    ((number << 1) ^ (number >> 31)) as u32
}

fn packed(bytes: &[u8]) -> io::Result<Vec<u8>> {
    let mut encoder = ZlibEncoder::new(Vec::new(), Compression::default());
    encoder.write_all(bytes)?;
    encoder.finish()
}

/// The head behind its length, with spaces up to a multiple of four bytes.
pub fn headed(head: &impl Serialize) -> io::Result<Vec<u8>> {
    let mut text = serde_json::to_vec(head)?;
    text.resize(text.len().next_multiple_of(4), b' ');
    Ok([&(text.len() as u32).to_le_bytes()[..], &text].concat())
}

#[cfg(test)]
mod tests {
    use super::*;
    use flate2::read::ZlibDecoder;
    use std::io::Read;

    /// The numbers of a coded block, by the definition: every weight of every coefficient.
    fn decoded(bytes: &[u8]) -> Vec<Vec<f32>> {
        let length = bytes[..4].iter().rev().fold(0, |all, byte| all << 8 | usize::from(*byte));
        let head: serde_json::Value = serde_json::from_slice(&bytes[4..4 + length]).expect("a head");
        let number = |name: &str| head[name].as_f64().expect("a number");
        let (step, numbers, pictures) = (number("step"), number("numbers") as usize, number("pictures") as usize);
        let [width, height] = [0, 1].map(|n| head["size"][n].as_u64().expect("a size") as usize);
        let mut rest = &bytes[4 + length..];
        let mut take = |length: usize| {
            let mut bytes = Vec::new();
            let part = rest.split_off(..length).expect("enough bytes");
            if length > 0 {
                ZlibDecoder::new(part).read_to_end(&mut bytes).expect("packed bytes");
            }
            bytes
        };
        let lengths = head["lengths"].as_array().expect("lengths");
        let mut codes: Vec<Vec<f64>> = Vec::new();
        for length in lengths {
            let bytes = take(length.as_u64().expect("a length") as usize);
            let mut plane = vec![0.0; width * height];
            for (k, (x, y, near)) in order(width, height).into_iter().enumerate().filter(|_| !bytes.is_empty()) {
                let byte = |n: usize| f64::from(bytes[n * width * height + k]);
                let folded = byte(0) + 256.0 * byte(1) + 65536.0 * byte(2);
                let rest = if folded % 2.0 == 0.0 { folded / 2.0 } else { -(folded + 1.0) / 2.0 };
                let guess: f64 = near.iter().map(|(weight, x, y)| weight * plane[y * width + x]).sum();
                plane[y * width + x] = guess + rest;
            }
            codes.push(plane.into_iter().map(|code| code * step).collect());
        }
        let missing = take(number("missing") as usize);
        let mut found = vec![vec![0.0; width * height]; pictures * numbers];
        let mut is_missing = vec![false; width * height * numbers];
        for picture in 0..pictures {
            let weights = weights(picture, pictures);
            for (n, at) in (0..numbers).flat_map(|n| (0..width * height).map(move |at| (n, at))) {
                let plane = picture * numbers + n;
                let sum: f64 = weights.iter().map(|(k, weight)| weight * codes[k * numbers + n][at]).sum();
                is_missing[n * width * height + at] ^= !missing.is_empty() && missing[plane * width * height + at] == 1;
                found[plane][at] = if is_missing[n * width * height + at] { f32::NAN } else { sum as f32 };
            }
        }
        found
    }

    /// A pixel, and the weights of the pixels that it is guessed from.
    type Guessed = (usize, usize, Vec<(f64, usize, usize)>);

    /// The pixels in their order, each with the weights of the pixels that it is guessed from.
    fn order(width: usize, height: usize) -> Vec<Guessed> {
        let level = |x: usize, y: usize| (x | y).trailing_zeros();
        let mut all: Vec<(usize, usize)> = (0..height).flat_map(|y| (0..width).map(move |x| (x, y))).collect();
        let is_down = |x: usize, y: usize| (x, y) != (0, 0) && y >> level(x, y) & 1 == 1;
        all.sort_by_key(|&(x, y)| (u32::MAX - level(x, y).min(60), is_down(x, y), y, x));
        let near = |x: usize, y: usize| {
            let (gap, down) = (1_isize << level(x, y), is_down(x, y));
            let at = |n: isize| {
                let (x, y) = if down { (x as isize, y as isize + n * gap) } else { (x as isize + n * gap, y as isize) };
                (x >= 0 && y >= 0 && x < width as isize && y < height as isize).then_some((x as usize, y as usize))
            };
            let known = [-3, -1, 1, 3].map(at);
            let weights = match known {
                [Some(_), _, _, Some(_)] => [-0.0625, 0.5625, 0.5625, -0.0625],
                [_, _, Some(_), _] => [0.0, 0.5, 0.5, 0.0],
                _ => [0.0, 1.0, 0.0, 0.0],
            };
            let pairs = weights.into_iter().zip(known).filter(|(weight, _)| *weight != 0.0);
            pairs.filter_map(|(weight, at)| at.map(|(x, y)| (weight, x, y))).collect()
        };
        all.into_iter().map(|(x, y)| (x, y, if (x, y) == (0, 0) { Vec::new() } else { near(x, y) })).collect()
    }

    /// Coefficient and weight of all that make up a picture.
    fn weights(picture: usize, pictures: usize) -> Vec<(usize, f64)> {
        let (mut found, mut scale, mut half, root) = (Vec::new(), 1.0, 1, 0.5_f64.sqrt());
        while half < pictures {
            let (start, second) = (picture / (2 * half) * 2 * half, picture / half % 2 == 1);
            if start + half < pictures {
                scale *= root;
                found.push((start + half, if second { -scale } else { scale }));
            }
            half *= 2;
        }
        found.push((0, scale));
        found
    }

    fn planes(pictures: usize, numbers: usize, number: impl Fn(usize, usize) -> f32) -> Planes {
        let mut planes = Planes::new([7, 5], numbers, false);
        for t in 0..pictures {
            planes.push(&(0..35 * numbers).map(|at| number(t, at)).collect::<Vec<_>>(), |value| value);
        }
        planes
    }

    #[test]
    fn coded_numbers_come_back_within_the_steps_that_sum_up() {
        for (pictures, numbers) in [(1, 1), (2, 4), (3, 1), (5, 1), (8, 4), (21, 1), (32, 1)] {
            let step = 1e-3;
            let wave = |t: usize, at: usize| ((at * 37 % 11) as f32 + t as f32 * 0.3).sin() * 3.0;
            let planes = planes(pictures, numbers, |t, at| if (at + t) % 9 == 2 { f32::NAN } else { wave(t, at) });
            let found = decoded(&planes.clone().coded(step).expect("a block"));
            for (picture, weights) in (0..pictures).map(|t| (t, weights(t, pictures))) {
                let most = f64::from(step) / 2.0 * weights.iter().map(|(_, weight)| weight.abs()).sum::<f64>() + 1e-5;
                assert!(most < 1.1 * f64::from(step) + 1e-5, "{pictures}");
                let own = picture * numbers..(picture + 1) * numbers;
                let pairs = planes.planes[own.clone()].iter().flatten().zip(found[own].iter().flatten());
                for (a, b) in pairs {
                    assert!(a.is_nan() && b.is_nan() || f64::from((a - b).abs()) <= most, "{pictures}: {a} {b}");
                }
            }
        }
    }

    #[test]
    fn codes_of_any_size_come_back() {
        let number = |t: usize, at: usize| if (at + t).is_multiple_of(2) { 1e30 } else { -1e30 };
        let planes = planes(2, 1, number);
        let found = decoded(&planes.clone().coded(1e-3).expect("a block"));
        for (a, b) in planes.planes.iter().flatten().zip(found.iter().flatten()) {
            assert!((a - b).abs() < 1e24, "{a} {b}");
        }
    }

    #[test]
    fn a_still_picture_takes_no_bytes_but_its_own() {
        let bytes = |pictures| planes(pictures, 1, |_, at| at as f32).coded(0.01).expect("a block").len();
        assert!(bytes(32) < bytes(1) + 200, "{} {}", bytes(32), bytes(1));
    }

    #[test]
    fn raw_numbers_follow_the_head() {
        let planes = planes(2, 1, |t, at| (t * 100 + at) as f32);
        let bytes = planes.raw().expect("a block");
        let tail = &bytes[bytes.len() - 4 * 70..];
        assert!((bytes.len() - 4 * 70).is_multiple_of(4));
        assert!(tail.chunks(4).zip(planes.planes.iter().flatten()).all(|(a, b)| a == b.to_le_bytes()));
    }
}
