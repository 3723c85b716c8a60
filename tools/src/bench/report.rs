//! `results.json` for programs, `results.md` for people.

use super::json::bad_json;
use super::point::{Conversion, Point, Results};
use super::settings::Settings;
use std::fmt::Write as _;
use std::fs;
use std::path::Path;
use wavesplat::base::error::{Error, Result};

const HEAD: &str = "\
Every stage ran in its own process; the contenders of a group took turns. Errors are shares of the value range.
Pictures of bounds other than the first are rendered once, for their errors.
*textbook*: a table of 32 x 32 footprints, one look-up for each voxel and frame. *shared*: the conventional method with
footprints shared by 32 frames. *first*: from opening the input; *further*: another view. Times are milliseconds per frame:
the median and, in brackets, the least. Memory is the peak of the process, with pages of mapped files. Image errors are
relative to brute force, at every fifth pixel along each axis of four frames of the first view. In the figure of times,
coefficients vary in tolerance with the default splat error, the conventional forms vary in splat method.
";

/// Writes both.
pub(super) fn write(results: &Results, folder: &Path) -> Result<()> {
    let json = folder.join("results.json");
    let text = serde_json::to_string_pretty(results).map_err(|e| bad_json(&json, &e))?;
    for (path, text) in [(json, text), (folder.join("results.md"), markdown(results))] {
        fs::write(&path, text).map_err(|e| Error::io(&path, "writing", e))?;
    }
    Ok(())
}

fn markdown(results: &Results) -> String {
    let of = |sweep: &str| results.points.iter().filter(|p| p.sweep == sweep).collect::<Vec<_>>();
    let (main, splat) = (of("tolerance"), of("splat"));
    let mut text = format!("# Run time against error\n\n{}\n\n{HEAD}", made(&results.settings, &results.date));
    text += "\n![Time against error](time.svg)\n\n![Size against error](size.svg)\n\n![Conversion](conversion.svg)\n";
    for kind in kinds(&results.points) {
        let only = |points: &[&Point]| rows(points.iter().copied().filter(|p| p.kind == kind), &results.points);
        let _ = write!(text, "\n## {kind}\n\n### Pictures by tolerance\n\n{RENDER_HEAD}{}", only(&main));
        let _ = write!(text, "\n### Pictures by splat method\n\n{RENDER_HEAD}{}", only(&splat));
        let conversions = main.iter().filter(|p| p.kind == kind).filter_map(|p| converted(p, p.conversion.as_ref()?));
        let _ = write!(text, "\n### Conversion\n\n{CONVERT_HEAD}{}", conversions.collect::<String>());
    }
    text
}

fn made(settings: &Settings, date: &str) -> String {
    let Settings { dims: [x, y, z, t], size, repeats, version, build, machine, .. } = settings;
    let cpu = machine.cpu.as_deref().unwrap_or("unknown processor");
    format!(
        "{x}x{y}x{z} voxels of {t} frames, pictures of {size}x{size} pixels, every time taken {repeats} times; \
         wavesplat {version} (build {build}) on {cpu}, {} threads, {}, {date}.",
        machine.cores, machine.system
    )
}

/// The kinds, in order of appearance.
pub(super) fn kinds(points: &[Point]) -> Vec<&str> {
    let mut kinds: Vec<&str> = points.iter().map(|p| p.kind.as_str()).collect();
    kinds.dedup();
    kinds
}

const RENDER_HEAD: &str = "\
| tolerance | method | bound | splat | first, ms | further, ms | textbook / this | shared / this | largest error | rms error | bound of pixels | certified / true | MB |
|---|---|---|---|--:|--:|--:|--:|--:|--:|--:|--:|--:|
";

/// A line for each of these points; `all` holds the points measured together with them.
fn rows<'a>(points: impl Iterator<Item = &'a Point>, all: &[Point]) -> String {
    points.map(|point| rendered(point, all)).collect()
}

fn rendered(point: &Point, all: &[Point]) -> String {
    let r = &point.rendering;
    let per_frame = |seconds: f64| 1e3 * seconds / point.frames as f64;
    let time = |s: &super::point::Spread| format!("{:.2} ({:.2})", per_frame(s.median), per_frame(s.min));
    let against = |method: &str| {
        let other = all.iter().find(|p| p.group == point.group && p.method == method);
        other.map_or(String::new(), |p| format!("{:.2}", p.rendering.milliseconds_per_frame / r.milliseconds_per_frame))
    };
    let bound = point.bound.as_deref().unwrap_or("");
    let own = if point.bound.is_some() { format!("{:e}", point.tolerance) } else { String::new() };
    let share = |e: Option<f64>| e.map_or(String::new(), |e| format!("{e:.1e}"));
    let tightness = r.certificate_tightness.map_or(String::new(), |t| format!("{t:.2}"));
    format!(
        "| {own} | {} | {bound} | {} | {} | {} | {} | {} | {:.1e} | {:.1e} | {} | {tightness} | {} |\n",
        point.method,
        r.splat,
        time(&r.first_view),
        time(&r.further_view),
        against("textbook"),
        against("shared"),
        r.image_error.largest,
        r.image_error.rms,
        share(r.pixel_bound),
        megabytes(r.peak_bytes),
    )
}

const CONVERT_HEAD: &str = "\
| tolerance | basis | bound | MB/s | bytes | ratio | bytes per sample | coefficients per sample | per voxel | largest error | rms error | MB |
|---|---|---|--:|--:|--:|--:|--:|--:|--:|--:|--:|
";

fn converted(point: &Point, c: &Conversion) -> Option<String> {
    let bound = point.bound.as_deref()?;
    Some(format!(
        "| {:e} | {} | {bound} | {:.0} | {} | {:.1} | {:.4} | {:.4} | {:.2} | {:.1e} | {:.1e} | {} |\n",
        point.tolerance,
        point.method,
        c.megabytes_per_second,
        c.file_bytes,
        c.ratio,
        c.bytes_per_sample,
        c.coefficients_per_sample,
        c.coefficients_per_voxel,
        c.largest_voxel_error,
        c.rms_voxel_error,
        megabytes(c.peak_bytes),
    ))
}

fn megabytes(bytes: Option<u64>) -> String {
    bytes.map_or(String::new(), |b| format!("{:.0}", b as f64 / 1e6))
}
