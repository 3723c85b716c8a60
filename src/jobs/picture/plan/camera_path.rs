//! Where the camera stands at each frame.

use crate::picture::request::PictureRequest;
use std::path::Path;
use wavesplat_core::base::error::{Error, Result};
use wavesplat_core::base::text;

/// Where the camera stands.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::picture) struct Stand {
    /// In degrees.
    pub(in crate::picture) azimuth: f64,
    pub(in crate::picture) elevation: f64,
    /// How much larger than usual the volume is drawn.
    pub(in crate::picture) zoom: f64,
}

/// The frame of each picture if views share the frames, in the order of the views: evenly, from the first frame to the
/// last.
pub(in crate::picture) fn frames_of_views(
    request: &PictureRequest,
    frames: Vec<usize>,
    views: usize,
) -> Result<Vec<usize>> {
    if !request.over_time {
        return Ok(frames);
    }
    if views == 1 {
        return Err(Error::setting("over_time", "turns the camera, so it needs `orbit` N or several `view`"));
    }
    let at = |view: usize| frames.get(view * frames.len() / views).copied();
    Ok((0..views).filter_map(at).collect())
}

/// Whether each picture has a view of its own.
pub(in crate::picture) fn is_moving(request: &PictureRequest) -> bool {
    request.over_time || request.key_frames.is_some()
}

/// Where the camera stands at each of some frames, by a file of key frames.
pub(in crate::picture) fn stands(path: &Path, frames: &[usize]) -> Result<Vec<Stand>> {
    let keys = key_frames(&text::read(path, "list of key frames")?).map_err(|what| Error::input(path, what))?;
    let at: Vec<f64> = keys.iter().map(|key| key[0]).collect();
    let column = |n: usize| Curve::new(&at, keys.iter().map(|key| key[n]).collect());
    let [azimuth, elevation, zoom] = [1, 2, 3].map(column);
    let stand = |frame: &usize| {
        let frame = *frame as f64;
        Stand { azimuth: azimuth.at(frame), elevation: elevation.at(frame), zoom: zoom.at(frame).exp() }
    };
    Ok(frames.iter().map(stand).collect())
}

/// Frame, azimuth, elevation and logarithm of the zoom of each line.
fn key_frames(text: &str) -> std::result::Result<Vec<[f64; 4]>, String> {
    let mut keys: Vec<[f64; 4]> = Vec::new();
    let lines = text.lines().enumerate().map(|(n, line)| (n + 1, line.trim()));
    for (n, line) in lines.filter(|(_, line)| !line.is_empty() && !line.starts_with('#')) {
        if keys.is_empty() && line.to_lowercase().starts_with("frame") {
            continue;
        }
        let key = key_frame(line).ok_or_else(|| format!("line {n}: takes frame,azimuth,elevation and perhaps zoom"))?;
        if keys.last().is_some_and(|last| key[0] <= last[0]) {
            return Err(format!("line {n}: frames must ascend"));
        }
        keys.push(key);
    }
    if keys.is_empty() { Err("has no line such as 0,30,30".into()) } else { Ok(keys) }
}

fn key_frame(line: &str) -> Option<[f64; 4]> {
    let numbers: Vec<f64> = line.split(',').map(|cell| cell.trim().parse().ok()).collect::<Option<_>>()?;
    let (frame, azimuth, elevation, zoom) = match *numbers.as_slice() {
        [frame, azimuth, elevation] => (frame, azimuth, elevation, 1.0),
        [frame, azimuth, elevation, zoom] => (frame, azimuth, elevation, zoom),
        _ => return None,
    };
    let is_sound = zoom > 0.0 && numbers.iter().all(|number| number.is_finite());
    is_sound.then(|| [frame, azimuth, elevation, zoom.ln()])
}

/// A smooth curve through points, which nowhere leaves the range of its neighbours: piecewise cubic, with the slopes of
/// Fritsch and Butland. Beyond its ends it is constant.
struct Curve<'a> {
    at: &'a [f64],
    values: Vec<f64>,
    slopes: Vec<f64>,
}

impl<'a> Curve<'a> {
    fn new(at: &'a [f64], values: Vec<f64>) -> Self {
        let slopes = (0..at.len()).map(|n| slope(at, &values, n)).collect();
        Self { at, values, slopes }
    }

    fn at(&self, x: f64) -> f64 {
        let (at, values) = (self.at, &self.values);
        let next = at.partition_point(|key| *key <= x);
        if next == 0 || next == at.len() {
            return values[next.saturating_sub(1)];
        }
        let (i, width) = (next - 1, at[next] - at[next - 1]);
        let t = (x - at[i]) / width;
        let (rest, steep) = (1.0 - t, [self.slopes[i] * width, self.slopes[next] * width]);
        let ends = values[i] * rest * rest * (1.0 + 2.0 * t) + values[next] * t * t * (3.0 - 2.0 * t);
        ends + t * rest * (rest * steep[0] - t * steep[1])
    }
}

/// The slope at a point: the weighted harmonic mean of those to its neighbours, or 0 at extremes and ends.
fn slope(at: &[f64], values: &[f64], n: usize) -> f64 {
    if n == 0 || n + 1 == at.len() {
        return 0.0;
    }
    let [before, after] = [at[n] - at[n - 1], at[n + 1] - at[n]];
    let [left, right] = [(values[n] - values[n - 1]) / before, (values[n + 1] - values[n]) / after];
    if left * right <= 0.0 {
        return 0.0;
    }
    let (a, b) = (2.0 * after + before, after + 2.0 * before);
    (a + b) / (a / left + b / right)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn key_frames_are_lines_of_numbers() {
        let keys = key_frames("frame,azimuth,elevation\n# a comment\n0, 30,30\n\n8,90,-10,1\n").expect("key frames");
        assert_eq!(keys, [[0.0, 30.0, 30.0, 0.0], [8.0, 90.0, -10.0, 0.0]]);
        for (wrong, named) in [
            ("", "no line"),
            ("frame,azimuth,elevation", "no line"),
            ("0,1", "line 1"),
            ("0,1,2\n\n0,1,2", "line 3"),
            ("0,1,2,0", "line 1"),
            ("0,nan,2", "line 1"),
            ("0,1,2,3,4", "line 1"),
            ("0,1,2\nframe,1,2", "line 2"),
        ] {
            assert!(key_frames(wrong).is_err_and(|what| what.contains(named)), "{wrong}");
        }
    }

    #[test]
    fn curves_pass_through_their_points_and_stay_between_them() {
        let (at, values) = ([0.0, 1.0, 4.0, 5.0, 9.0], vec![0.0, 10.0, 10.0, 30.0, -5.0]);
        let curve = Curve::new(&at, values.clone());
        assert!(at.iter().zip(&values).all(|(x, y)| (curve.at(*x) - y).abs() < 1e-12));
        assert_eq!([curve.at(-3.0), curve.at(99.0)], [0.0, -5.0]);
        for n in 0..900 {
            let x = f64::from(n) / 100.0;
            let i = at.partition_point(|key| *key <= x) - 1;
            let (lo, hi) = (values[i].min(values[i + 1]), values[i].max(values[i + 1]));
            assert!((lo - 1e-9..=hi + 1e-9).contains(&curve.at(x)), "{x}");
            assert!((curve.at(x + 1e-6) - curve.at(x)).abs() < 1e-3, "smooth at {x}");
        }
        assert_eq!(Curve::new(&[2.0], vec![7.0]).at(5.0), 7.0);
    }
}
