//! The content of the figures.

use super::chart::{Curve, Figure, Line, Marker, Panel, draw};
use super::plan::{BASES, BOUNDS, BasisRow, BoundRow};
use super::point::{Conversion, Point, Results};
use super::report::kinds;
use super::settings::Settings;
use std::path::Path;
use wavesplat::base::error::Result;

/// Colours that people with colour blindness can distinguish (Okabe & Ito, 2008).
const BLUE: (u8, u8, u8) = (0, 114, 178);
const ORANGE: (u8, u8, u8) = (213, 94, 0);
const GREEN: (u8, u8, u8) = (0, 158, 115);
const GREY: (u8, u8, u8) = (110, 110, 110);

/// Bytes of a sample of the archives, f32.
const RAW: f64 = 4.0;

/// Writes all figures.
pub(super) fn write(results: &Results, folder: &Path) -> Result<()> {
    draw(&time(results), &folder.join("time.svg"))?;
    draw(&size(results), &folder.join("size.svg"))?;
    draw(&conversion(results), &folder.join("conversion.svg"))
}

/// Render time against the largest image error.
fn time(results: &Results) -> Figure {
    let points = &results.points;
    let line = |name: &str, colour, marker| Line { name: name.into(), colour, marker, dashed: false };
    let lines = vec![
        line("coefficients, Haar", BLUE, Marker::Disc),
        line("coefficients, multiwavelet", ORANGE, Marker::Square),
        line("frame by frame, textbook", GREY, Marker::Diamond),
        line("frame by frame, shared footprints", GREEN, Marker::Triangle),
    ];
    let at = |p: &Point| (p.rendering.image_error.largest, p.rendering.milliseconds_per_frame);
    let of = |kind: &str, method: &str, bound: Option<&str>, sweep: &str| {
        let chosen = |p: &&Point| {
            (p.kind.as_str(), p.method.as_str(), p.bound.as_deref(), p.sweep.as_str()) == (kind, method, bound, sweep)
        };
        points.iter().filter(chosen).map(at).collect::<Vec<_>>()
    };
    let first = Some(BOUNDS[0].name);
    let curves = |kind: &str| {
        let each = [
            of(kind, "haar", first, "tolerance"),
            of(kind, "multi", first, "tolerance"),
            of(kind, "textbook", None, "splat"),
            of(kind, "shared", None, "splat"),
        ];
        each.into_iter().enumerate().map(|(line, points)| Curve { line, points }).collect()
    };
    Figure {
        title: "Render time of a frame (lower is better) at its image error (further left is better)".into(),
        note: note(&results.settings, true),
        x: "largest image error, share of the value range".into(),
        y: "milliseconds per frame".into(),
        lines,
        panels: panels(points, curves),
        level: None,
    }
}

/// File size against the largest voxel error.
fn size(results: &Results) -> Figure {
    let points = &results.points;
    Figure {
        title: "File size (lower is better) at the largest error of any sample (further left is better)".into(),
        note: note(&results.settings, false),
        x: "largest voxel error, share of the value range".into(),
        y: "bytes per sample".into(),
        lines: bound_lines(),
        panels: panels(points, |kind| by_bound(points, kind, |_, c| (c.largest_voxel_error, c.bytes_per_sample))),
        level: Some((RAW, "raw f32 frames".into())),
    }
}

/// Conversion throughput against tolerance.
fn conversion(results: &Results) -> Figure {
    let points = &results.points;
    Figure {
        title: "Throughput of conversion (higher is better)".into(),
        note: note(&results.settings, false),
        x: "tolerance, share of the value range".into(),
        y: "MB of frames per second".into(),
        lines: bound_lines(),
        panels: panels(points, |kind| by_bound(points, kind, |p, c| (p.tolerance, c.megabytes_per_second))),
        level: None,
    }
}

/// A note on the archive and the machine.
fn note(settings: &Settings, pictures: bool) -> String {
    let Settings { dims: [x, y, z, frames], size, machine, .. } = settings;
    let pictures = if pictures { format!("pictures of {size}x{size} pixels, ") } else { String::new() };
    let cpu = machine.cpu.as_deref().unwrap_or("unknown processor");
    format!("{x}x{y}x{z} voxels, {frames} frames, {pictures}{cpu}, {} threads", machine.cores)
}

fn panels(points: &[Point], curves: impl Fn(&str) -> Vec<Curve>) -> Vec<Panel> {
    kinds(points).into_iter().map(|kind| Panel { title: title(kind), curves: curves(kind) }).collect()
}

/// A description of each kind of archive.
fn title(kind: &str) -> String {
    let shows = match kind {
        "smooth" => "slow diffusion",
        "moving" => "a moving front",
        "oscillating" => "changes of sign",
        "noise" => "every sample random",
        "sparse" => "mostly empty",
        _ => return kind.into(),
    };
    format!("{kind}: {shows}")
}

/// A line for every basis and bound: the basis has the colour, the bound the marker.
fn bound_lines() -> Vec<Line> {
    let markers = [Marker::Disc, Marker::Triangle, Marker::Square, Marker::Diamond];
    let of_basis = |(basis, colour): (&BasisRow, _)| {
        let name = basis.name;
        let line = move |(i, bound): (usize, &BoundRow)| Line {
            name: format!("{name}, {}", bound.name),
            colour,
            marker: markers[i % markers.len()],
            dashed: i > 0,
        };
        BOUNDS.iter().enumerate().map(line).collect::<Vec<_>>()
    };
    BASES.iter().zip([BLUE, ORANGE]).flat_map(of_basis).collect()
}

/// A curve for every line of [`bound_lines`].
fn by_bound(points: &[Point], kind: &str, at: impl Fn(&Point, &Conversion) -> (f64, f64)) -> Vec<Curve> {
    let of = |basis: &str, bound: &str| {
        let chosen = |p: &&Point| p.sweep == "tolerance" && p.kind == kind && p.method == basis;
        let bounded = points.iter().filter(chosen).filter(|p| p.bound.as_deref() == Some(bound));
        bounded.filter_map(|p| p.conversion.as_ref().map(|c| at(p, c))).collect()
    };
    let pairs = BASES.iter().flat_map(|basis| BOUNDS.iter().map(move |bound| (basis.name, bound.name)));
    pairs.enumerate().map(|(line, (basis, bound))| Curve { line, points: of(basis, bound) }).collect()
}
