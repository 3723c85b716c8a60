//! Where annotations lie: margins around the volume.

use std::fmt;
use std::str::FromStr;
use wavesplat_core::base::choice::serde_as_text;

/// The parts of an annotation.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Parts {
    /// The edges of the volume's box.
    pub bounds: bool,
    /// Values along three edges of the box.
    pub axes: bool,
    /// Arrows along x, y and z.
    pub triad: bool,
    /// A line of a round length, in the unit of the coordinates.
    pub scale: bool,
    /// The colour bar.
    pub bar: bool,
    /// The time or the number of the frame.
    pub time: bool,
}

impl Parts {
    /// No part.
    pub const NONE: Self = Self { bounds: false, axes: false, triad: false, scale: false, bar: false, time: false };
    /// The parts that most pictures need.
    pub const USUAL: Self = Self { bounds: true, axes: true, triad: false, scale: false, bar: true, time: true };
    /// All parts.
    pub const ALL: Self = Self { triad: true, scale: true, ..Self::USUAL };
}

impl FromStr for Parts {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let mut parts = Self::NONE;
        for name in text.split(',') {
            match name.trim() {
                "all" => parts = Self::ALL,
                "none" => parts = Self::NONE,
                "box" => parts.bounds = true,
                "axes" => parts.axes = true,
                "triad" => parts.triad = true,
                "scale" => parts.scale = true,
                "bar" => parts.bar = true,
                "time" => parts.time = true,
                other => return Err(format!("'{other}' is none of all, none, box, axes, triad, scale, bar and time")),
            }
        }
        Ok(parts)
    }
}

impl fmt::Display for Parts {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { bounds, axes, triad, scale, bar, time } = *self;
        let named = [(bounds, "box"), (axes, "axes"), (triad, "triad"), (scale, "scale"), (bar, "bar"), (time, "time")];
        let names: Vec<&str> = named.into_iter().filter(|(is_drawn, _)| *is_drawn).map(|(_, name)| name).collect();
        f.write_str(&if names.is_empty() { "none".into() } else { names.join(",") })
    }
}

serde_as_text!(Parts);

impl Default for Parts {
    fn default() -> Self {
        Self::USUAL
    }
}

/// Pixels at the sides of a picture that annotations take.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Margins {
    /// At the left.
    pub left: usize,
    /// At the right.
    pub right: usize,
    /// At the top.
    pub top: usize,
    /// At the bottom.
    pub bottom: usize,
}

/// The height of a line of letters, as a share of the picture's shorter side, and the least that is legible.
const LINE: f64 = 0.03;
pub(super) const LEAST_LINE: f64 = 10.0;

/// Lines that a part takes: the colour bar with values and name, the values and the name of an axis, and the time.
pub(super) const BAR: f64 = 7.6;
const AXIS: [f64; 2] = [5.2, 3.2];
const TIME: f64 = 2.0;

/// A picture has values along axes if its shorter side has this many lines.
const LINES_FOR_AXES: f64 = 16.0;

/// The height of a line of letters in a picture.
pub fn line(size: [usize; 2]) -> f64 {
    (LINE * size[0].min(size[1]) as f64).max(LEAST_LINE)
}

/// Whether a picture is large enough for a colour bar, and for values along axes.
pub(super) fn has_bar(size: [usize; 2]) -> bool {
    2.0 * BAR * line(size) <= size[0] as f64
}

pub(super) fn has_axes(size: [usize; 2]) -> bool {
    LINES_FOR_AXES * line(size) <= size[0].min(size[1]) as f64
}

/// Whether a picture is large enough for the time or a title.
pub(super) fn has_time(size: [usize; 2]) -> bool {
    4.0 * TIME * line(size) <= size[1] as f64
}

/// The margins that parts and a title take in a picture of this size.
pub fn margins(size: [usize; 2], parts: Parts, title: bool) -> Margins {
    let pixels = |is_there: bool, lines: f64| if is_there { (lines * line(size)).ceil() as usize } else { 0 };
    let axes = parts.axes && has_axes(size);
    let top = pixels((parts.time || title) && has_time(size), TIME);
    Margins {
        left: pixels(axes, AXIS[0]),
        right: pixels((parts.bar || parts.scale) && has_bar(size), BAR),
        top,
        bottom: pixels(axes, AXIS[1]),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn margins_leave_half_of_any_picture() {
        for width in (1..2000).step_by(37) {
            for height in (1..2000).step_by(41) {
                let Margins { left, right, top, bottom } = margins([width, height], Parts::ALL, true);
                assert!(
                    2 * (left + right) <= 2 * width * 4 / 5 && 10 * (top + bottom) <= 7 * height,
                    "{width}x{height}"
                );
            }
        }
        assert_eq!(margins([512, 512], Parts::NONE, false), Margins::default());
        let large = margins([3840, 2160], Parts::USUAL, false);
        assert!(large.right > 400 && large.bottom > 150, "{large:?}");
    }
}
