//! The tables for people, in Markdown.

use super::results::Results;
use super::row::Row;
use super::schemes::{BASELINE, SCHEMES};
use super::targets::{TARGETS, Verdict};
use crate::bench::machine::Provenance;
use std::fmt::Write as _;

const HEAD: &str = "\
Every coder keeps every sample within tolerance x value range; every sample was compared. Sizes are those of whole
files. *3d*: each frame separately; *4d*: the whole series as one array. Times are seconds of one core, the least of all
rounds. Every conversion and decoding of wavesplat ran in its own process, in turns with the peers: *convert* from
samples to bytes in memory, *values* back to samples in one array, *codes* to codes that are ready for splatting.
✗ marks a missed target, or a missed bound, even if only by rounding.
";

/// The mark of a missed target.
const MISSED: &str = " ✗";

pub(super) fn markdown(results: &Results) -> String {
    let coders = coders(&results.rows);
    let mut text = format!("# Sizes and times compared with other coders\n\n{}\n\n{HEAD}", made(results));
    text += &targets(results);
    text += &section("Compression ratio", results, &coders, |row| format!("{:.1}", row.ratio));
    let of_bound = |row: &Row| format!("{:.4}{}", share(row), if row.holds() { "" } else { MISSED });
    text += &section("Largest error by its bound", results, &coders, of_bound);
    text += &codes(results);
    text + &times(results)
}

fn made(results: &Results) -> String {
    let Results { made: Provenance { machine, version, date, .. }, rounds, .. } = results;
    let cpu = machine.cpu.as_deref().unwrap_or("unknown processor");
    let mut text =
        format!("wavesplat {version} on one core of {cpu}, {}, {date}; {rounds} round(s).\n", machine.system);
    for data in &results.data {
        let _ = write!(text, "\n- {}", data.in_words());
    }
    text
}

/// All coders in order of appearance.
fn coders(rows: &[Row]) -> Vec<&str> {
    let mut coders: Vec<&str> = Vec::new();
    for row in rows {
        if !coders.contains(&row.coder.as_str()) {
            coders.push(&row.coder);
        }
    }
    coders
}

fn share(row: &Row) -> f64 {
    if row.bound > 0.0 || row.largest_error > 0.0 { row.largest_error / row.bound } else { 0.0 }
}

/// The lines of a table, a first one of titles and a second that aligns all columns but the first `left` to the right.
fn head(left: usize, titles: &[String]) -> String {
    let aligned = (0..titles.len()).map(|i| if i < left { "---|" } else { "--:|" }).collect::<String>();
    format!("| {} |\n|{aligned}\n", titles.join(" | "))
}

/// A table with a line for each archive and tolerance, and a column for each coder.
fn section(title: &str, results: &Results, coders: &[&str], cell: impl Fn(&Row) -> String) -> String {
    let titles = ["data", "tolerance"].iter().chain(coders).map(ToString::to_string).collect::<Vec<_>>();
    let mut text = format!("\n## {title}\n\n{}", head(2, &titles));
    for (data, tolerance) in places(&results.rows) {
        let at = |coder: &&str| find(&results.rows, data, tolerance, coder).map_or(String::new(), &cell);
        let cells: Vec<String> = coders.iter().map(at).collect();
        let _ = writeln!(text, "| {data} | {tolerance:e} | {} |", cells.join(" | "));
    }
    text
}

/// Every archive and tolerance, once.
fn places(rows: &[Row]) -> Vec<(&str, f64)> {
    let mut places: Vec<(&str, f64)> = Vec::new();
    for row in rows {
        if !places.contains(&(&row.data, row.tolerance)) {
            places.push((&row.data, row.tolerance));
        }
    }
    places
}

fn find<'a>(rows: &'a [Row], data: &str, tolerance: f64, coder: &str) -> Option<&'a Row> {
    rows.iter().find(|r| r.data == data && r.tolerance == tolerance && r.coder == coder)
}

/// All targets that could be judged, a line for each scheme, archive and tolerance.
fn targets(results: &Results) -> String {
    let judged: Vec<_> = TARGETS.iter().filter(|t| results.verdicts.iter().any(|v| v.target == t.name)).collect();
    let named = judged.iter().map(|t| format!("{} ({})", t.name, t.wanted()));
    let titles: Vec<String> = ["data", "tolerance", "scheme"].map(Into::into).into_iter().chain(named).collect();
    let mut text = format!("\n## Targets\n\n{}\n{}", summary(&results.verdicts), head(3, &titles));
    for row in results.rows.iter().filter(|r| r.own.is_some() && r.coder != BASELINE) {
        let of_row = |v: &&Verdict| v.data == row.data && v.tolerance == row.tolerance && v.scheme == row.coder;
        let verdicts: Vec<&Verdict> = results.verdicts.iter().filter(of_row).collect();
        let cell = |name: &str| verdicts.iter().find(|v| v.target == name).map_or(String::new(), |v| value(v));
        let cells: Vec<String> = judged.iter().map(|t| cell(t.name)).collect();
        let _ = writeln!(text, "| {} | {:e} | {} | {} |", row.data, row.tolerance, row.coder, cells.join(" | "));
    }
    text
}

fn value(verdict: &Verdict) -> String {
    format!("{:.3}{}", verdict.value, if verdict.met { "" } else { MISSED })
}

/// How many targets each scheme meets.
fn summary(verdicts: &[Verdict]) -> String {
    let mut text = String::new();
    for scheme in SCHEMES.iter().filter(|s| s.name != BASELINE) {
        let of_scheme: Vec<&Verdict> = verdicts.iter().filter(|v| v.scheme == scheme.name).collect();
        let met = of_scheme.iter().filter(|v| v.met).count();
        let _ = writeln!(text, "- *{}* meets {met} of {}", scheme.name, of_scheme.len());
    }
    text
}

const CODES_HEAD: [&str; 6] =
    ["data", "tolerance", "scheme", "codes per sample", "outliers", "samples of exact blocks"];

/// Nonzero codes, and the samples that are stored exactly, without codes.
fn codes(results: &Results) -> String {
    let mut text = format!("\n## Nonzero codes\n\n{}", head(3, &CODES_HEAD.map(Into::into)));
    for row in &results.rows {
        if let Some(own) = &row.own {
            let (codes, outliers, exact) = (own.codes_per_sample, own.outliers, own.exact_samples);
            let place = format!("{} | {:e} | {}", row.data, row.tolerance, row.coder);
            let _ = writeln!(text, "| {place} | {codes:.5} | {outliers} | {exact} |");
        }
    }
    text
}

/// Million samples a second.
fn times(results: &Results) -> String {
    let titles = ["data", "tolerance", "coder", "convert", "values", "codes"].map(Into::into);
    let mut text = format!("\n## Million samples a second\n\n{}", head(3, &titles));
    for row in &results.rows {
        let data = results.data.iter().find(|d| d.name == row.data);
        let samples = data.map_or(f64::NAN, |d| d.frames as f64 * d.dims.iter().product::<usize>() as f64);
        let rate = |seconds: f64| format!("{:.0}", samples / seconds / 1e6);
        let codes = row.own.as_ref().map_or(String::new(), |own| rate(own.codes_seconds));
        let (convert, values) = (rate(row.encode_seconds), rate(row.decode_seconds));
        let place = format!("{} | {:e} | {}", row.data, row.tolerance, row.coder);
        let _ = writeln!(text, "| {place} | {convert} | {values} | {codes} |");
    }
    text
}
