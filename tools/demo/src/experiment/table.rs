//! Table 1 compared with that of [Dobashi](wavesplat_core::bibliography), with file sizes and errors, which the paper does not give.

use super::{Demo, Experiment, FRAMES, Run, TOLERANCE};
use std::fmt::Write as _;

/// The paper's measurements of a method.
struct Paper {
    name: &'static str,
    /// Seconds to transform, splat and invert, where the paper distinguishes these.
    seconds: Option<[f64; 3]>,
    total: f64,
}

impl Paper {
    /// Seconds without the transform.
    fn view(&self) -> f64 {
        self.total - self.seconds.map_or(0.0, |[transform, ..]| transform)
    }
}

const PAPER: [Paper; 3] = [
    Paper { name: "Haar", seconds: Some([68.0, 323.3, 8.0]), total: 399.3 },
    Paper { name: "Multi", seconds: Some([202.8, 341.6, 15.4]), total: 559.8 },
    Paper { name: "conventional", seconds: None, total: 1643.0 },
];

/// All tables.
pub(super) fn text(demo: &Demo, experiment: &Experiment) -> String {
    let Experiment { coloured, plain, textbook } = experiment;
    let [width, height] = demo.size;
    let by_coefficients = &coloured[1..];
    let mut text = format!(
        "Table 1: {FRAMES} frames of {width}x{height} pixels, coloured before the transform, tolerance {TOLERANCE} (seconds)\n\n"
    );
    text += "The paper's comparison: the conventional method adds a table's footprint for every voxel and frame\n\n";
    text += &first_view(by_coefficients, textbook);
    text += &further_view(by_coefficients, textbook);
    text += "\nThe same lattice, which is faster than footprints, for all methods\n\n";
    text += &first_view(by_coefficients, &coloured[0]);
    text += &further_view(by_coefficients, &coloured[0]);
    text + &sizes(coloured, plain) + NOTES
}

/// The paper's rows, each with the run of that method.
fn rows<'a>(by_coefficients: &'a [Run], conventional: &'a Run) -> impl Iterator<Item = (&'static Paper, &'a Run)> {
    let run = move |paper: &Paper| by_coefficients.iter().chain([conventional]).find(|run| run.name == paper.name);
    PAPER.iter().filter_map(move |paper| Some((paper, run(paper)?)))
}

/// The times of a first view: with the transform.
fn first_view(by_coefficients: &[Run], conventional: &Run) -> String {
    let columns = format!("{:>9}{:>11}{:>9}{:>9}{:>8}", "transform", "splatting", "inverse", "total", "ratio");
    let mut text = format!("{:14}{:^49}{:^48}\n{:14}{columns}   {columns}\n", "", "here", "in the paper", "");
    for (paper, run) in rows(by_coefficients, conventional) {
        let here = cells(Some(run.seconds()), run.total(), conventional.total(), 3);
        let there = cells(paper.seconds, paper.total, PAPER[2].total, 1);
        let _ = writeln!(text, "{:14}{here}   {there}", run.name);
    }
    text
}

/// The same for a further view: without the transform.
fn further_view(by_coefficients: &[Run], conventional: &Run) -> String {
    let columns = format!("{:>9}{:>8}", "seconds", "ratio");
    let mut text = format!("\n{:14}{columns}   {columns}\n", "further views");
    let cells = |view: f64, conventional: f64, places: usize| format!("{view:>9.places$}{:>8.1}", conventional / view);
    for (paper, run) in rows(by_coefficients, conventional) {
        let here = cells(run.view(), conventional.view(), 3);
        let there = cells(paper.view(), PAPER[2].view(), 1);
        let _ = writeln!(text, "{:14}{here}   {there}", run.name);
    }
    text
}

/// Seconds, and the speed-up over the conventional method.
fn cells(seconds: Option<[f64; 3]>, total: f64, conventional: f64, places: usize) -> String {
    let cell = |n: usize| seconds.filter(|s| s[n] > 0.0).map_or("-".into(), |s| format!("{:.places$}", s[n]));
    let ratio = format!("{:.1}", conventional / total);
    format!("{:>9}{:>11}{:>9}{total:>9.places$}{ratio:>8}", cell(0), cell(1), cell(2))
}

/// The content of the files and their errors; and the same for one channel, with its times.
fn sizes(coloured: &[Run], plain: &[Run]) -> String {
    let mut text = format!(
        "\n{:22}{:>12}{:>10}{:>20}\n{:22}{:>12}{:>10}{:>10}{:>10}{:>10}{:>8}\n",
        "",
        "coefficients",
        "file",
        "largest error/bound",
        "",
        "per sample",
        "bytes",
        "voxel",
        "pixel",
        "seconds",
        "ratio"
    );
    for (channels, runs) in [("3 channels", coloured), ("1 channel", plain)] {
        for run in runs.iter().skip(1).chain(&runs[..1]) {
            let (name, [seconds, ratio]) = (run.name, [run.total(), runs[0].total() / run.total()]);
            let _ = writeln!(
                text,
                "{:22}{}{seconds:>10.3}{ratio:>8.1}",
                format!("{name}, {channels}"),
                size(run, &runs[0])
            );
        }
    }
    text
}

/// The columns of a file; the conventional method has none.
fn size(run: &Run, truth: &Run) -> String {
    let Some((report, compared)) = &run.converted else {
        return format!("{:>12}{:>10}{:>10}{:>10}", "-", "-", "-", "-");
    };
    let (voxel, pixel) = (compared.largest_share_of_bound, run.pixel_share(truth));
    format!("{:>12.4}{:>10}{voxel:>10.4}{pixel:>10.4}", report.coefficients_per_sample, report.output_bytes)
}

const NOTES: &str = "
A ratio above 1 is faster than the conventional method, which draws frame by frame. A further view needs no transform.
The inverse also turns sums into pixels; for the lattice's conventional method it does only this. The time for the sums
of weights, which a view needs once, is not counted. Coefficients of three channels are counted together.
One channel gets its colours after projection, so other colours need no new conversion.
";
