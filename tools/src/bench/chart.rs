//! Small multiples with logarithmic axes: all panels share both axes, and one legend above them.

use plotters::coord::Shift;
use plotters::coord::combinators::{IntoLogRange, LogCoord};
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};
use std::ops::Range;
use std::path::Path;
use wavesplat::base::error::{Error, Result};

/// A figure.
pub(super) struct Figure {
    pub(super) title: String,
    /// The source of the numbers.
    pub(super) note: String,
    /// The names of the axes, with units.
    pub(super) x: String,
    pub(super) y: String,
    /// How curves look.
    pub(super) lines: Vec<Line>,
    pub(super) panels: Vec<Panel>,
    /// A horizontal line in all panels, and its name.
    pub(super) level: Option<(f64, String)>,
}

/// How a curve looks, and its name.
pub(super) struct Line {
    pub(super) name: String,
    pub(super) colour: (u8, u8, u8),
    pub(super) marker: Marker,
    pub(super) dashed: bool,
}

/// The shape drawn at each point.
#[derive(Debug, Clone, Copy)]
pub(super) enum Marker {
    Disc,
    Square,
    Triangle,
    Diamond,
}

/// One of the small diagrams.
pub(super) struct Panel {
    pub(super) title: String,
    pub(super) curves: Vec<Curve>,
}

/// Points of one line.
pub(super) struct Curve {
    /// Index into the figure's lines.
    pub(super) line: usize,
    pub(super) points: Vec<(f64, f64)>,
}

/// Pixels of a panel, of title and note, and of a line of the legend.
const PANEL: (u32, u32) = (460, 380);
const HEAD: u32 = 80;
const ENTRY: u32 = 32;
/// Pixels on the left of a panel's axis.
const LEFT: i32 = 84;
/// Pixels around a panel.
const MARGIN: i32 = 10;
/// Names side by side in the legend.
const NAMES: usize = 4;
/// Panels side by side.
const COLUMNS: usize = 3;
/// Pixels of letters.
const TITLE: u32 = 24;
const TEXT: u32 = 19;

type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;
type Chart<'a, 'b> = ChartContext<'a, SVGBackend<'b>, Cartesian2d<LogCoord<f64>, LogCoord<f64>>>;
type Failed = Box<dyn std::error::Error>;
type Drawn = std::result::Result<(), Failed>;

/// Draws a figure into an SVG file.
pub(super) fn draw(figure: &Figure, path: &Path) -> Result<()> {
    let columns = figure.panels.len().clamp(1, COLUMNS);
    let rows = figure.panels.len().div_ceil(columns);
    let size = (PANEL.0 * columns.max(2) as u32, figure.head() + PANEL.1 * rows as u32);
    let root = SVGBackend::new(path, size).into_drawing_area();
    whole(figure, &root, (rows, columns)).map_err(|e| Error::io(path, "drawing", std::io::Error::other(e.to_string())))
}

/// The legend and all panels. The first panels are at the upper left.
fn whole(figure: &Figure, root: &Area<'_>, grid: (usize, usize)) -> Drawn {
    root.fill(&WHITE)?;
    let (head, body) = root.split_vertically(figure.head());
    legend(figure, &head)?;
    for (panel, area) in figure.panels.iter().zip(body.split_evenly(grid)) {
        draw_panel(figure, panel, &area, root)?;
    }
    root.present()?;
    Ok(())
}

impl Figure {
    /// Pixels above the panels.
    fn head(&self) -> u32 {
        HEAD + ENTRY * self.lines.len().div_ceil(NAMES) as u32
    }

    /// Whole decades around all that is drawn.
    fn range(&self, coordinate: impl Fn(&(f64, f64)) -> f64, level: Option<f64>) -> Range<f64> {
        let points = self.panels.iter().flat_map(|panel| &panel.curves).flat_map(|curve| &curve.points);
        let shown = points.map(coordinate).chain(level).filter(|v| *v > LEAST);
        let (low, high) = shown.fold((f64::INFINITY, LEAST), |(low, high), v| (low.min(v), high.max(v)));
        let (low, high) = (low.min(high).log10().floor(), high.log10().ceil());
        // A little more, so that rounding keeps the marks at both ends.
        0.999 * 10_f64.powf(low)..1.001 * 10_f64.powf(high.max(low + 1.0))
    }
}

/// Smaller values look like 0 and are drawn at the edge.
const LEAST: f64 = 1e-12;

/// The title, the note, and a sample of each line with its name.
fn legend(figure: &Figure, area: &Area<'_>) -> Drawn {
    let middle = Pos::new(HPos::Left, VPos::Center);
    let style = |size: u32| ("sans-serif", size).into_font().color(&BLACK).pos(middle);
    area.draw(&Text::new(figure.title.clone(), (16, 26), style(TITLE)))?;
    area.draw(&Text::new(figure.note.clone(), (16, 56), style(TEXT).color(&BLACK.mix(0.6))))?;
    let step = (area.dim_in_pixel().0 as i32 - 24) / NAMES as i32;
    for (number, line) in (0..).zip(&figure.lines) {
        let (column, row) = (number % NAMES as i32, number / NAMES as i32);
        let (x, y) = (24 + step * column, HEAD as i32 + 8 + ENTRY as i32 * row);
        area.draw(&PathElement::new([(x, y), (x + 36, y)], line.style()))?;
        line.mark((x + 18, y), area)?;
        area.draw(&Text::new(line.name.clone(), (x + 46, y), style(TEXT)))?;
    }
    Ok(())
}

fn draw_panel(figure: &Figure, panel: &Panel, area: &Area<'_>, root: &Area<'_>) -> Drawn {
    let title = ("sans-serif", TITLE).into_font().color(&BLACK).pos(Pos::new(HPos::Left, VPos::Center));
    area.draw(&Text::new(panel.title.clone(), (MARGIN + LEFT, 24), title))?;
    let level = figure.level.as_ref().map(|(level, _)| *level);
    let (x, y) = (figure.range(|p| p.0, None), figure.range(|p| p.1, level));
    let mut chart = ChartBuilder::on(area)
        .margin(MARGIN)
        .margin_top(44)
        .margin_right(24)
        .x_label_area_size(58)
        .y_label_area_size(LEFT)
        .build_cartesian_2d(x.clone().log_scale(), y.log_scale())?;
    axes(figure, &mut chart)?;
    if let Some((level, name)) = &figure.level {
        let style = BLACK.stroke_width(2);
        chart.draw_series(DashedLineSeries::new([(x.start, *level), (x.end, *level)], 3, 5, style))?;
        let text = ("sans-serif", TEXT).into_font().color(&BLACK).pos(Pos::new(HPos::Left, VPos::Bottom));
        chart.draw_series([Text::new(name.clone(), (1.3 * x.start, 1.1 * level), text)])?;
    }
    panel.curves.iter().try_for_each(|curve| draw_curve(&figure.lines[curve.line], curve, &mut chart, root))
}

fn axes(figure: &Figure, chart: &mut Chart<'_, '_>) -> Drawn {
    let (strong, weak) = (BLACK.mix(0.2), BLACK.mix(0.06));
    chart
        .configure_mesh()
        .bold_line_style(strong)
        .light_line_style(weak)
        .x_labels(8)
        .y_labels(8)
        .label_style(("sans-serif", TEXT))
        .axis_desc_style(("sans-serif", TEXT))
        .x_desc(&figure.x)
        .y_desc(&figure.y)
        .x_label_formatter(&|v| decade(*v))
        .y_label_formatter(&|v| decade(*v))
        .draw()?;
    Ok(())
}

fn draw_curve(line: &Line, curve: &Curve, chart: &mut Chart<'_, '_>, root: &Area<'_>) -> Drawn {
    let mut points = curve.points.clone();
    points.sort_by(|a, b| a.0.total_cmp(&b.0));
    if line.dashed {
        chart.draw_series(DashedLineSeries::new(points.clone(), 8, 6, line.style()))?;
    } else {
        chart.draw_series(LineSeries::new(points.clone(), line.style()))?;
    }
    points.iter().try_for_each(|point| line.mark(chart.backend_coord(point), root))
}

impl Line {
    fn rgb(&self) -> RGBColor {
        RGBColor(self.colour.0, self.colour.1, self.colour.2)
    }

    fn style(&self) -> ShapeStyle {
        self.rgb().stroke_width(3)
    }

    /// Draws the marker at a point, given in pixels to the right and down in the area.
    fn mark(&self, at: (i32, i32), area: &Area<'_>) -> Drawn {
        let corners = self.marker.corners().into_iter().map(|(right, down)| (at.0 + right, at.1 + down));
        Ok(area.draw(&Polygon::new(corners.collect::<Vec<_>>(), self.rgb().filled()))?)
    }
}

impl Marker {
    /// Pixels from the point, right and down.
    fn corners(self) -> Vec<(i32, i32)> {
        match self {
            Self::Disc => vec![(6, -3), (3, -6), (-3, -6), (-6, -3), (-6, 3), (-3, 6), (3, 6), (6, 3)],
            Self::Square => vec![(6, -6), (-6, -6), (-6, 6), (6, 6)],
            Self::Triangle => vec![(0, -9), (-8, 6), (8, 6)],
            Self::Diamond => vec![(0, -9), (-9, 0), (0, 9), (9, 0)],
        }
    }
}

/// The label of a power of ten; empty for other values.
fn decade(value: f64) -> String {
    let power = value.log10();
    if (power - power.round()).abs() > 1e-6 {
        return String::new();
    }
    match power.round() as i32 {
        power @ -2..=4 => format!("{}", 10_f64.powi(power)),
        power => format!("10{}", superscript(power)),
    }
}

fn superscript(number: i32) -> String {
    const DIGITS: [char; 10] = ['⁰', '¹', '²', '³', '⁴', '⁵', '⁶', '⁷', '⁸', '⁹'];
    let raised = |c: char| c.to_digit(10).map_or('⁻', |d| DIGITS[d as usize]);
    number.to_string().chars().map(raised).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn powers_of_ten_have_labels() {
        assert_eq!([1e-3, 0.1, 1.0, 1000.0, 1e-12, 2.0].map(decade), ["10⁻³", "0.1", "1", "1000", "10⁻¹²", ""]);
    }

    #[test]
    fn a_figure_has_its_lines_and_panels() {
        let line = Line { name: "a line".into(), colour: (0, 0, 0), marker: Marker::Diamond, dashed: true };
        let panel = |title: &str| Panel {
            title: title.into(),
            curves: vec![Curve { line: 0, points: vec![(1e-3, 2.0), (0.0, 5.0), (0.1, 30.0)] }],
        };
        let panels = ["one", "two", "three", "four"].map(panel).into();
        let (title, note, level) = ("title".into(), "note".into(), Some((4.0, "level".into())));
        let (x, y) = ("x".into(), "y".into());
        let figure = Figure { title, note, x, y, lines: vec![line], panels, level };
        assert!((figure.range(|p| p.0, None).start / 1e-3).log10().abs() < 0.01);
        assert!((figure.range(|p| p.1, None).end / 100.0).log10().abs() < 0.01);
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("figure.svg");
        draw(&figure, &path).expect("drawn");
        let text = std::fs::read_to_string(path).expect("read");
        for word in ["title", "note", "a line", "four", "level", "0.1"] {
            assert!(text.contains(word), "{word}");
        }
    }
}
