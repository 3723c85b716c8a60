//! The report about two stacks.

use super::load::Shape;
use super::ssim::WINDOW;
use serde::Serialize;
use std::fmt::Write as _;
use std::path::PathBuf;
use wavesplat_demo::differences::Differences;

/// The whole report, as printed by `--json`. `schema` changes if the meaning of a key changes.
#[derive(Debug, Clone, Serialize)]
pub struct Report {
    /// 1.
    pub schema: u32,
    /// The reference.
    pub a: PathBuf,
    /// The pictures compared with it.
    pub b: PathBuf,
    /// The type of A's numbers.
    pub samples: &'static str,
    /// Number of frames.
    pub frames: usize,
    /// Pixels a row.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Numbers a pixel.
    pub channels: usize,
    /// The value range used for PSNR and SSIM: that of A's values for floats, otherwise that of the type.
    pub peak: f64,
    /// Statistics of all frames.
    pub all: Statistics,
    /// The frame with the largest difference; of several such frames, the one with the largest sum of squares. None if
    /// there is only one frame.
    pub worst: Option<WorstFrame>,
    /// The heat map, if one was drawn.
    pub heat_map: Option<HeatMap>,
}

/// Statistics of one frame, or of all, in the units of the files.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Statistics {
    /// Whether nothing differs.
    pub identical: bool,
    /// The largest absolute difference; infinite (null in JSON) where one alone has background.
    pub largest: f64,
    /// Where it is; none if nothing differs.
    pub at: Option<PixelPosition>,
    /// The largest where neither has background.
    pub largest_compared: f64,
    /// The mean absolute difference where neither has background.
    pub mean: Option<f64>,
    /// The root of the mean square there.
    pub rms: Option<f64>,
    /// The peak's ratio to that, in dB; infinite (null in JSON) if nothing compared differs.
    pub psnr_db: Option<f64>,
    /// Structural similarity: the mean over windows, channels and frames; none if it is not defined.
    pub ssim: Option<f64>,
    /// Numbers that were compared.
    pub compared: u64,
    /// Numbers that are background in both.
    pub background_in_both: u64,
    /// Numbers that are background in one alone.
    pub background_in_one: u64,
}

/// The frame that differs most.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct WorstFrame {
    /// Its number, from 0.
    pub frame: usize,
    /// Its statistics.
    #[serde(flatten)]
    pub figures: Statistics,
}

/// Position of a number. All indices count from 0, rows from the top.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct PixelPosition {
    /// Frame.
    pub frame: usize,
    /// Column.
    pub x: usize,
    /// Row.
    pub y: usize,
    /// Channel.
    pub channel: usize,
}

impl PixelPosition {
    /// The place of a number in a stack, counted from its first.
    pub(super) fn of(at: u64, shape: &Shape) -> Self {
        let at = at as usize;
        let (frame, rest) = (at / shape.numbers(), at % shape.numbers());
        let (pixel, channel) = (rest / shape.channels, rest % shape.channels);
        Self { frame, x: pixel % shape.width, y: pixel / shape.width, channel }
    }

    fn text(&self) -> String {
        format!("frame {}, x {}, y {}, channel {}", self.frame, self.x, self.y, self.channel)
    }
}

/// A picture of differences.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct HeatMap {
    /// The file.
    pub path: PathBuf,
    /// The difference that is red.
    pub scale: f64,
}

impl Statistics {
    /// Of numbers that begin with frame `first` of a stack.
    pub(super) fn of(found: &Differences, first: usize, shape: &Shape, peak: f64, ssim: Option<f64>) -> Self {
        let before = first as u64 * shape.numbers() as u64;
        Self {
            identical: found.is_identical(),
            largest: found.largest(),
            at: found.at.map(|at| PixelPosition::of(before + at, shape)),
            largest_compared: found.largest_compared,
            mean: found.mean(),
            rms: found.rms(),
            psnr_db: found.psnr(peak),
            ssim,
            compared: found.compared,
            background_in_both: found.in_neither,
            background_in_one: found.in_one,
        }
    }

    /// The largest difference and where it is.
    pub fn largest_text(&self) -> String {
        let place = self.at.map(|at| format!(" at {}", at.text())).unwrap_or_default();
        let why = if self.background_in_one > 0 { ", where one alone has background" } else { "" };
        format!("{}{place}{why}", number(self.largest))
    }

    fn text(&self, report: &Report) -> String {
        let or = |value: Option<f64>, why: &str| value.map_or(format!("not defined: {why}"), number);
        let mut text = format!("  largest absolute   {}\n", self.largest_text());
        if self.background_in_one > 0 {
            let _ = writeln!(text, "  largest compared   {}", number(self.largest_compared));
        }
        let nothing = "no number is there in both";
        let flat = if self.compared == 0 { nothing } else { "the values of A are all the same" };
        let _ = writeln!(text, "  mean absolute      {}", or(self.mean, nothing));
        let _ = writeln!(text, "  root mean square   {}", or(self.rms, nothing));
        let _ = writeln!(text, "  PSNR, dB           {}", or(self.psnr_db, flat));
        let _ = writeln!(text, "  SSIM               {}", or(self.ssim, &report.why_no_ssim()));
        if self.background_in_one + self.background_in_both > 0 {
            let (one, both) = (self.background_in_one, self.background_in_both);
            let _ =
                writeln!(text, "  background         {one} in one alone, {both} in both, {} compared", self.compared);
        }
        text
    }
}

impl Report {
    /// The report as text.
    pub fn text(&self) -> String {
        let Self { frames, width, height, channels, samples, .. } = self;
        let mut text = format!("{frames} frame(s) of {width}x{height} pixels, {channels} channel(s) of {samples}\n");
        let same = if self.all.identical { ", which are identical" } else { "" };
        let _ = writeln!(text, "All{same}:\n{}", self.all.text(self).trim_end());
        if let Some(worst) = &self.worst
            && !self.all.identical
        {
            let _ = writeln!(text, "Worst, frame {}:\n{}", worst.frame, worst.figures.text(self).trim_end());
        }
        if let Some(map) = &self.heat_map {
            let _ = writeln!(text, "{}: red is {} or more", map.path.display(), number(map.scale));
        }
        text
    }

    fn why_no_ssim(&self) -> String {
        if self.width < WINDOW || self.height < WINDOW {
            return format!("pictures are smaller than its window of {WINDOW}x{WINDOW} pixels");
        }
        let flat = self.peak <= 0.0;
        if flat { "the values of A are all the same" } else { "no window is free of background" }.into()
    }
}

/// A number with at most six digits.
pub(super) fn number(value: f64) -> String {
    let size = value.abs();
    if value == 0.0 || !value.is_finite() || (1e-4..1e6).contains(&size) && value.fract() == 0.0 {
        return value.to_string();
    }
    if !(1e-4..1e6).contains(&size) {
        return format!("{value:.5e}");
    }
    let places = (5 - libm::floor(libm::log10(size)) as i64).max(0) as usize;
    let text = format!("{value:.places$}");
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').into() } else { text }
}

#[cfg(test)]
mod tests {
    use super::*;
    use wavesplat::base::sample::SampleType;

    #[test]
    fn numbers_have_six_digits() {
        let texts = [0.0, 12.0, 0.5, 1.0 / 3.0, 123_456.78, 1e-7, 2.5e9, f64::INFINITY].map(number);
        assert_eq!(texts, ["0", "12", "0.5", "0.333333", "123457", "1.00000e-7", "2.50000e9", "inf"]);
    }

    #[test]
    fn positions_follow_from_indices() {
        let shape = Shape { frames: 3, height: 4, width: 5, channels: 2, sample: SampleType::U8 };
        let at = 2 * 40 + 3 * 10 + 4 * 2 + 1;
        assert_eq!(PixelPosition::of(at, &shape), PixelPosition { frame: 2, x: 4, y: 3, channel: 1 });
    }
}
