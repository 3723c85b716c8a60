//! Annotations drawn into pictures: a colour bar with its values, and the time of the frame.
//!
//! A part that does not fit is left out.

mod text;
mod ticks;

pub use ticks::round_values;

use crate::base::decimal;
use crate::base::time_labels::TimeLabels;
use crate::colour::{Rgb, Scale};
use text::Letters;

/// The annotations of a run's pictures.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Annotation {
    /// The times of frames. Frames without a time show their number.
    pub times: TimeLabels,
}

impl Annotation {
    /// The long and the short label of a frame.
    fn stamps(&self, frame: usize) -> [String; 2] {
        if let Some(date) = self.times.date(frame) {
            let day = date.split(' ').next().unwrap_or_default().to_string();
            return [date, day];
        }
        match (self.times.text(frame), self.times.number(frame)) {
            (Some(long), Some(short)) => [format!("t = {long}"), format!("t = {short}")],
            _ => [format!("frame {frame}"), format!("{frame}")],
        }
    }

    /// Draws the time of `frame` at the top left and, if a `scale` is given, a colour bar at the right edge. A row has
    /// `width` pixels.
    pub(crate) fn draw(&self, pixels: &mut [Rgb], width: usize, frame: usize, background: Rgb, scale: Option<&Scale>) {
        let mut sheet = Sheet::new(pixels, width, background);
        let below = sheet.stamp(&self.stamps(frame));
        if let Some(scale) = scale {
            sheet.bar(scale, below);
        }
    }
}

/// Width in pixels of the colour bar and its values, at the right edge of a picture of this size; 0 if they do not fit.
pub fn colour_bar_width([width, height]: [usize; 2]) -> usize {
    const LETTERS: usize = 12;
    let bar = LETTERS * Letters::for_side(width.min(height)).width;
    if 2 * bar <= width { bar } else { 0 }
}

/// A picture to draw on.
struct Sheet<'a> {
    pixels: &'a mut [Rgb],
    width: usize,
    height: usize,
    letters: Letters,
    /// Distance of the parts from the picture's edges and from each other.
    margin: usize,
    /// Colour of text, in contrast to the background.
    ink: Rgb,
    /// Colour around the ink, in contrast to the ink.
    rim: Rgb,
}

impl<'a> Sheet<'a> {
    fn new(pixels: &'a mut [Rgb], width: usize, background: Rgb) -> Self {
        let height = pixels.len() / width.max(1);
        let letters = Letters::for_side(width.min(height));
        let [r, g, b] = background.map(f64::from);
        let bright = 0.299 * r + 0.587 * g + 0.114 * b > 127.5;
        let (ink, rim) = if bright { ([0; 3], [255; 3]) } else { ([255; 3], [0; 3]) };
        Self { pixels, width, height, margin: letters.width, letters, ink, rim }
    }

    fn set(&mut self, x: usize, y: usize, colour: Rgb) {
        if x < self.width && y < self.height {
            self.pixels[y * self.width + x] = colour;
        }
    }

    fn rectangle(&mut self, x: usize, y: usize, [width, height]: [usize; 2], colour: Rgb) {
        (y..y + height).for_each(|y| (x..x + width).for_each(|x| self.set(x, y, colour)));
    }

    /// Writes text with a rim around each letter, so that it is legible over any picture.
    fn write(&mut self, text: &str, x: usize, y: usize) {
        let inked = self.letters.pixels(text);
        for [u, v] in &inked {
            self.rectangle((x + u).saturating_sub(1), (y + v).saturating_sub(1), [3, 3], self.rim);
        }
        for [u, v] in inked {
            self.set(x + u, y + v, self.ink);
        }
    }

    /// Writes the first of `texts` that fits at the top left. Returns the first free row below.
    fn stamp(&mut self, texts: &[String]) -> usize {
        let Self { margin, letters, .. } = *self;
        let fits = |text: &&String| margin + letters.width * text.len() <= self.width;
        let Some(text) = texts.iter().find(fits).filter(|_| margin + letters.height <= self.height) else {
            return margin;
        };
        self.write(text, margin, margin / 2);
        margin + letters.height
    }

    /// Draws the colour bar at the right edge, below row `below`, with its values to the left.
    fn bar(&mut self, scale: &Scale, below: usize) {
        let Self { margin, letters, width, height, .. } = *self;
        let (thick, length) = (2 * letters.width, (height * 3 / 5).min(height.saturating_sub(below + 2 * margin)));
        if length < 2 * letters.height || thick + 2 * margin > width {
            return;
        }
        let (left, top) = (width - margin - thick, (height.saturating_sub(length) / 2).max(below + margin));
        self.rectangle(left - 2, top - 2, [thick + 4, length + 4], self.rim);
        self.rectangle(left - 1, top - 1, [thick + 2, length + 2], self.ink);
        for row in 0..length {
            let share = 1.0 - row as f64 / (length - 1) as f64;
            self.rectangle(left, top + row, [thick, 1], scale.colour_at(share));
        }
        self.labels(scale, left, top, length);
    }

    /// Writes values beside the bar, if the longest fits.
    fn labels(&mut self, scale: &Scale, left: usize, top: usize, length: usize) {
        let Self { margin, letters, .. } = *self;
        let ticks = ticks::ticks(scale, (length / (2 * letters.height)).clamp(2, 8));
        let labels: Vec<(String, f64)> = ticks.iter().map(|v| (decimal::short(*v), scale.share(*v))).collect();
        let tick = margin / 2;
        let longest = labels.iter().map(|(text, _)| text.len() * letters.width).max().unwrap_or(0);
        if longest + tick + margin > left {
            return;
        }
        for (text, share) in labels {
            let y = top + ((1.0 - share) * (length - 1) as f64).round() as usize;
            self.rectangle(left - 1 - tick, y - 1, [tick, 3], self.rim);
            self.rectangle(left - 1 - tick, y, [tick, 1], self.ink);
            let x = left - 2 - tick - letters.width / 2 - text.len() * letters.width;
            self.write(&text, x, y - letters.height / 2);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::colour::{Norm, TransferFunction};

    fn scale(range: (f64, f64), norm: Norm) -> Scale {
        let map = TransferFunction::open("rainbow").expect("a known map");
        Scale::new(&map, range, norm, [9; 3]).expect("a range")
    }

    fn drawn(width: usize, height: usize, scale: Option<&Scale>) -> Vec<Rgb> {
        let mut pixels = vec![[9; 3]; width * height];
        Annotation::default().draw(&mut pixels, width, 12, [9; 3], scale);
        pixels
    }

    #[test]
    fn a_bar_has_the_last_colour_at_its_top_and_the_first_at_its_bottom() {
        let pixels = drawn(200, 160, Some(&scale((0.0, 1.0), Norm::Linear)));
        let column: Vec<Rgb> = (0..160).map(|y| pixels[y * 200 + 184]).collect();
        let at = |colour: Rgb| column.iter().position(|c| *c == colour).expect("the colour");
        assert!(at([255, 0, 0]) < at([0, 0, 255]) && pixels[159 * 200 + 199] == [9; 3]);
        assert!(pixels[..100].iter().all(|p| *p == [9; 3]), "nothing touches the edge");
    }

    #[test]
    fn pictures_of_any_size_take_what_fits() {
        for (width, height) in (1..90).flat_map(|w| [(w, 90), (90, w), (w, w), (w, 1), (1, w)]) {
            for range in [(0.0, 1.0), (-1e300, 1e300), (2.0, 2.0), (1e6, 1e6 + 1.0)] {
                drawn(width, height, Some(&scale(range, Norm::Linear)));
            }
        }
        assert!(drawn(16, 16, Some(&scale((1e-3, 1e3), Norm::Log))).iter().all(|p| *p == [9; 3]));
        assert!(drawn(90, 30, None).contains(&[255; 3]), "the time alone");
    }

    #[test]
    fn frames_show_their_time_or_their_number() {
        let stamps = |unit: Option<&str>| {
            let times = vec![0.0, 0.0125, 0.1 + 0.2, 1_051_956.0];
            let timed = Annotation { times: TimeLabels::new(times, unit, None) };
            (0..5).map(|frame| timed.stamps(frame)).collect::<Vec<_>>()
        };
        let long = |unit| stamps(unit).into_iter().map(|[long, _]| long).collect::<Vec<_>>();
        assert_eq!(long(None), ["t = 0", "t = 0.0125", "t = 0.3", "t = 1051956", "frame 4"]);
        assert_eq!(stamps(Some("s"))[1], ["t = 0.0125 s", "t = 0.0125"]);
        assert_eq!(stamps(Some("hours since 1900-01-01"))[3], ["2020-01-03 12:00:00", "2020-01-03"]);
        assert_eq!(long(Some("months since 1900-01-01"))[1], "t = 0.0125 months since 1900-01-01");
    }
}
