//! Line charts as SVG.

use std::fmt::Write;
use wavesplat_engine::render::annotate::round_values;

/// Lines over a common axis.
pub(super) struct Chart {
    pub(super) x: Vec<f64>,
    pub(super) x_name: String,
    /// The date of each x, or empty.
    pub(super) dates: Vec<String>,
    pub(super) y_name: String,
    pub(super) lines: Vec<Line>,
    pub(super) band: Band,
}

/// A line; NaN interrupts it.
pub(super) struct Line {
    pub(super) name: String,
    pub(super) values: Vec<f64>,
}

/// Half the width of the band around all lines, at each x.
pub(super) struct Band {
    pub(super) half: Vec<f64>,
}

const WIDTH: f64 = 800.0;
const HEIGHT: f64 = 450.0;
const LEFT: f64 = 90.0;
const RIGHT: f64 = 20.0;
const TOP: f64 = 20.0;
const BOTTOM: f64 = 60.0;
const LEGEND_ROW: f64 = 18.0;

/// Colours that people with colour blindness can tell apart, on white and on black.
const COLOURS: [&str; 7] = ["#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#808080"];

const STYLE: &str = "\
<style>text{font:13px sans-serif;fill:#222}.back{fill:#fff}.grid{stroke:#ddd}.frame{stroke:#555;fill:none}\
@media(prefers-color-scheme:dark){text{fill:#ddd}.back{fill:#161616}.grid{stroke:#3a3a3a}.frame{stroke:#aaa}}</style>";

/// The ranges of both axes, and the height of the picture with its legend.
struct Frame {
    x: (f64, f64),
    y: (f64, f64),
    height: f64,
}

impl Frame {
    fn at_x(&self, x: f64) -> f64 {
        LEFT + (WIDTH - LEFT - RIGHT) * share(x, self.x)
    }

    fn at_y(&self, y: f64) -> f64 {
        TOP + (HEIGHT - TOP - BOTTOM) * (1.0 - share(y, self.y))
    }
}

/// Where a number lies in a range, without an overflow.
fn share(at: f64, (lo, hi): (f64, f64)) -> f64 {
    (at / 2.0 - lo / 2.0) / (hi / 2.0 - lo / 2.0)
}

/// The range of numbers, wide enough to divide by.
fn range(numbers: impl Iterator<Item = f64>) -> (f64, f64) {
    let finite = numbers.filter(|n| n.is_finite());
    let (lo, hi) = finite.fold((f64::INFINITY, f64::NEG_INFINITY), |(lo, hi), n| (lo.min(n), hi.max(n)));
    let wide = 1e-9 * lo.abs().max(hi.abs());
    match lo <= hi {
        false => (0.0, 1.0),
        true if hi - lo > wide => (lo, hi),
        true => (lo - lo.abs().max(1.0) / 2.0, hi + hi.abs().max(1.0) / 2.0),
    }
}

impl Chart {
    /// The text of an SVG file.
    pub(super) fn svg(&self) -> String {
        let frame = self.frame();
        let mut svg = format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {WIDTH} {0}\" width=\"{WIDTH}\" height=\"{0}\">\n\
             {STYLE}\n<rect class=\"back\" width=\"{WIDTH}\" height=\"{0}\"/>\n",
            frame.height
        );
        self.axes(&frame, &mut svg);
        for (n, line) in self.lines.iter().enumerate() {
            self.line(&frame, n, line, &mut svg);
        }
        svg + "</svg>\n"
    }

    fn frame(&self) -> Frame {
        let ends = self.lines.iter().flat_map(|line| {
            line.values.iter().zip(&self.band.half).flat_map(|(value, half)| [value - half, value + half])
        });
        let height = HEIGHT + LEGEND_ROW * self.lines.len() as f64;
        Frame { x: range(self.x.iter().copied()), y: range(ends), height }
    }

    fn axes(&self, frame: &Frame, svg: &mut String) {
        let (right, bottom) = (WIDTH - RIGHT, HEIGHT - BOTTOM);
        for y in round_values(frame.y.0, frame.y.1, 6) {
            let at = frame.at_y(y);
            let _ = writeln!(svg, "<path class=\"grid\" d=\"M{LEFT} {at:.2}H{right}\"/>");
            text(svg, [LEFT - 6.0, at + 4.0], "end", "", &number(y));
        }
        for (x, label) in self.x_ticks(frame) {
            let at = frame.at_x(x);
            let _ = writeln!(svg, "<path class=\"grid\" d=\"M{at:.2} {TOP}V{bottom}\"/>");
            text(svg, [at, bottom + 18.0], "middle", "", &label);
        }
        let (width, height) = (right - LEFT, bottom - TOP);
        let _ = writeln!(svg, "<rect class=\"frame\" x=\"{LEFT}\" y=\"{TOP}\" width=\"{width}\" height=\"{height}\"/>");
        text(svg, [f64::midpoint(LEFT, right), bottom + 40.0], "middle", "", &self.x_name);
        let middle = f64::midpoint(TOP, bottom);
        text(svg, [18.0, middle], "middle", &format!(" transform=\"rotate(-90 18 {middle})\""), &self.y_name);
    }

    /// Round numbers, or the dates of frames a round number apart.
    fn x_ticks(&self, frame: &Frame) -> Vec<(f64, String)> {
        if self.dates.len() != self.x.len() || self.dates.is_empty() {
            return round_values(frame.x.0, frame.x.1, 8).into_iter().map(|x| (x, number(x))).collect();
        }
        let numbers = round_values(0.0, (self.x.len() - 1) as f64, 5);
        let frames = numbers.into_iter().filter(|n| n.fract() == 0.0).map(|n| n as usize);
        frames.map(|n| (self.x[n], self.dates[n].clone())).collect()
    }

    /// A line with its band and its entry in the legend.
    fn line(&self, frame: &Frame, number: usize, line: &Line, svg: &mut String) {
        let colour = COLOURS[number % COLOURS.len()];
        let points: Vec<usize> = (0..self.x.len()).collect();
        for run in points.split(|n| !line.values[*n].is_finite()).filter(|run| !run.is_empty()) {
            let point = |n: usize, off: f64| {
                format!("{:.2} {:.2}", frame.at_x(self.x[n]), frame.at_y(line.values[n] + off * self.band.half[n]))
            };
            let along = |off: f64| run.iter().map(|n| point(*n, off)).collect::<Vec<_>>();
            let band: Vec<String> = along(1.0).into_iter().chain(along(-1.0).into_iter().rev()).collect();
            let _ = writeln!(svg, "<path fill=\"{colour}\" fill-opacity=\".25\" d=\"M{}Z\"/>", band.join("L"));
            let shape = "fill=\"none\" stroke-width=\"1.5\" stroke-linecap=\"round\" stroke-linejoin=\"round\"";
            let line = along(0.0);
            let end = if line.len() == 1 { "h0" } else { "" };
            let _ = writeln!(svg, "<path {shape} stroke=\"{colour}\" d=\"M{}{end}\"/>", line.join("L"));
        }
        let y = HEIGHT + LEGEND_ROW * (number as f64 + 0.5) - 8.0;
        let _ = writeln!(svg, "<path stroke=\"{colour}\" stroke-width=\"3\" d=\"M{LEFT} {y}h24\"/>");
        text(svg, [LEFT + 32.0, y + 4.0], "start", "", &line.name);
    }
}

/// A number without digits that come from rounding.
fn number(v: f64) -> String {
    let rounded: f64 = format!("{v:.9e}").parse().unwrap_or(v);
    let is_plain = rounded == 0.0 || (1e-3..1e6).contains(&rounded.abs());
    if is_plain { (rounded + 0.0).to_string() } else { format!("{rounded:e}") }
}

fn text(svg: &mut String, [x, y]: [f64; 2], anchor: &str, more: &str, text: &str) {
    let text = escaped(text);
    let _ = writeln!(svg, "<text x=\"{x:.2}\" y=\"{y:.2}\" text-anchor=\"{anchor}\"{more}>{text}</text>");
}

/// A text without markup and without characters that XML does not allow.
fn escaped(text: &str) -> String {
    let escape = |c: char| match c {
        '&' => "&amp;".into(),
        '<' => "&lt;".into(),
        '>' => "&gt;".into(),
        '"' => "&quot;".into(),
        c if c.is_control() || matches!(c, '\u{fffe}' | '\u{ffff}') => " ".into(),
        c => c.to_string(),
    };
    text.chars().map(escape).collect::<Vec<String>>().concat()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn chart(values: &[f64]) -> Chart {
        Chart {
            x: (0..values.len()).map(|n| n as f64).collect(),
            x_name: "frame".into(),
            dates: Vec::new(),
            y_name: "</text><script>&\u{1}".into(),
            lines: vec![Line { name: "a".into(), values: values.to_vec() }],
            band: Band { half: vec![0.1; values.len()] },
        }
    }

    #[test]
    fn names_are_text_and_not_markup() {
        let svg = chart(&[1.0, 2.0]).svg();
        assert!(svg.contains("&lt;/text&gt;&lt;script&gt;&amp; ") && !svg.contains("<script"));
    }

    #[test]
    fn odd_values_make_no_odd_numbers() {
        let odd = [&[f64::NAN][..], &[], &[0.0], &[1e308, -1e308], &[1.0, f64::NAN, f64::INFINITY, 2.0], &[5.0, 5.0]];
        for values in odd {
            let svg = chart(values).svg();
            assert!(!svg.contains("NaN") && !svg.contains("inf"), "{values:?}: {svg}");
        }
        assert_eq!(chart(&[1.0, f64::NAN, 2.0, 3.0]).svg().matches("fill-opacity").count(), 2, "a gap");
    }
}
