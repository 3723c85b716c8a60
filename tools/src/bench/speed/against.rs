//! This build's `wavesplat-render` beside another build's: the same pictures by both programs, in turns.
//!
//! Times are those of whole programs with one thread, by the clock: starting, reading, rendering and writing.

use super::archives::{Bench, Subject};
use super::convert::{Conversion, Scheme, run as convert};
use super::results::{self, Row, Threshold};
use super::settings::Config;
use crate::bench::machine::Provenance;
use crate::bench::size::Data;
use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::Instant;
use wavesplat::base::error::{Error, Result};

/// The output that both programs make.
struct Case {
    name: &'static str,
    /// From the coefficient file, or from frames.
    of_file: bool,
    /// Options, and options of this build alone.
    options: &'static [&'static str],
    own: &'static [&'static str],
    /// Whether the program finds the range of colours, and writes a PNG.
    finds_range: bool,
    /// How many times faster this build is to be.
    wanted: f64,
}

impl Case {
    const fn of_frames(name: &'static str, options: &'static [&'static str], wanted: f64) -> Self {
        Self { name, of_file: false, options, own: &[], finds_range: false, wanted }
    }

    const fn of_file(name: &'static str, options: &'static [&'static str], wanted: f64) -> Self {
        Self { name, of_file: true, options, own: &[], finds_range: false, wanted }
    }

    const fn finding_its_range(self) -> Self {
        Self { finds_range: true, ..self }
    }

    const fn with(self, own: &'static [&'static str]) -> Self {
        Self { own, ..self }
    }
}

const CASES: [Case; 14] = [
    Case::of_frames("frames, all", &[], 5.0),
    Case::of_frames("frames, all, --fast", &[], 9.0).with(&["--fast"]),
    Case::of_frames("frames, all, 0,0", &["--view", "0,0"], 5.0),
    Case::of_frames("frames, all, 45,50", &["--view", "45,50"], 5.0),
    Case::of_frames("frames, all, roll 10", &["--roll", "10"], 5.0),
    Case::of_frames("frames, all, 1 pixel a voxel", &["--scale", "1"], 5.0),
    Case::of_frames("frames, one", &["--frames", "5"], 4.0),
    Case::of_file("file, all", &[], 2.2),
    Case::of_file("file, all, --fast", &[], 2.5).with(&["--fast"]),
    Case::of_file("composite, one", &["--mode", "composite", "--frames", "5"], 50.0),
    Case::of_file("composite, all", &["--mode", "composite"], 30.0),
    Case::of_file("mip, one", &["--mode", "mip", "--frames", "5"], 50.0),
    Case::of_file("mip, all", &["--mode", "mip"], 30.0),
    Case::of_file("first picture, default options", &["--frames", "5"], 5.0).finding_its_range(),
];

/// Measures all archives, writes `against.md`, and returns its text.
///
/// # Errors
/// A folder without `wavesplat-render`, or a program that fails.
pub fn run(config: &Config, other: &Path, say: &mut dyn FnMut(&str)) -> Result<String> {
    let programs = [program_in(other)?, program_in(config.program.parent().unwrap_or(Path::new(".")))?];
    let work = config.output.join("against-work");
    fs::create_dir_all(&work).map_err(|e| Error::io(&work, "creating the folder", e))?;
    let mut rows = Vec::new();
    for subject in (Bench { config, work: &work }).subjects() {
        rows.extend(archive(config, (&subject, &work), &programs, say)?);
        subject.remove(&work)?;
    }
    fs::remove_dir_all(&work).map_err(|e| Error::io(&work, "removing", e))?;
    let (path, text) = (config.output.join("against.md"), table(config, &rows));
    fs::write(&path, &text).map_err(|e| Error::io(&path, "writing", e))?;
    Ok(text)
}

fn program_in(folder: &Path) -> Result<PathBuf> {
    let program = folder.join(format!("wavesplat-render{}", std::env::consts::EXE_SUFFIX));
    if program.is_file() { Ok(program) } else { Err(Error::path(program, "there is no such program")) }
}

/// The rows of an archive: the note of each has the seconds of both programs.
fn archive(
    config: &Config,
    (subject, work): (&Subject, &Path),
    programs: &[PathBuf; 2],
    say: &mut dyn FnMut(&str),
) -> Result<Vec<Row>> {
    let data = subject.data(work, say)?;
    let (source, output) = (data.path.clone(), work.join("file.wspl"));
    let (tolerance, range) = (config.tolerances[0], data.range);
    let window = data.frames.clamp(1, 32);
    convert(&Conversion { source, scheme: Scheme::Auto, window, tolerance, range, output: output.clone() })?;
    let mut rows = Vec::new();
    for case in &CASES {
        say(&format!("{}: {}", data.name, case.name));
        let input = if case.of_file { &output } else { &data.path };
        let mut least = [f64::INFINITY; 2];
        for _ in 0..config.repeats {
            for ((program, least), own) in programs.iter().zip(&mut least).zip([&[], case.own]) {
                *least = least.min(seconds(program, (input, work), (case, own), (config.size, &data))?);
            }
        }
        let value = Ok((least[0] / least[1], format!("{:.3} | {:.3}", least[0], least[1])));
        rows.push(Row::new(case.name, &data.name, String::new(), value, Some(Threshold::AtLeast(case.wanted))));
    }
    Ok(rows)
}

/// Wall time of a program that makes pictures.
fn seconds(
    program: &Path,
    (input, work): (&Path, &Path),
    (case, own): (&Case, &[&str]),
    (size, data): (usize, &Data),
) -> Result<f64> {
    let failed = |e| Error::io(program, "running", e);
    let mut command = Command::new(program);
    command.arg(input).args(["--quiet", "--force", "--threads", "1", "--size", &format!("{size}x{size}")]);
    if !case.options.contains(&"--view") {
        command.args(["--view", "30,30"]);
    }
    if !case.of_file {
        command.args(["--method", "direct"]);
    }
    if case.finds_range {
        command.arg("-o").arg(work.join("picture.png"));
    } else {
        let (lo, hi) = data.range;
        command.args(["--range", &format!("{lo},{hi}"), "-o"]).arg(work.join("pictures.npy"));
    }
    let clock = Instant::now();
    let status = command.args(case.options).args(own).stdin(Stdio::null()).status().map_err(failed)?;
    let seconds = clock.elapsed().as_secs_f64();
    if status.success() { Ok(seconds) } else { Err(Error::input(program, format!("{} failed ({status})", case.name))) }
}

fn table(config: &Config, rows: &[Row]) -> String {
    let made = Provenance::here(results::SCHEMA, config.date.as_ref());
    let (size, rounds, tolerance) = (config.size, config.repeats, config.tolerances[0]);
    let mut text =
        format!("# This build beside another one\n\n{}; {rounds} round(s), {size}x{size} pixels.\n\n", made.words());
    let _ = writeln!(
        text,
        "Seconds of whole programs by the clock, one thread, the least of all rounds, in turns. Views are from 30 degrees about z \
         and 30 above\nthe horizon unless another is named. Files keep every sample within {tolerance:e} of the value range. Frames are in the system's\ncache. \
         `--fast` is compared with the default of the other build.\n"
    );
    text += "| data | pictures | before, s | after, s | times faster | wanted | met |\n|---|---|--:|--:|--:|--:|---|\n";
    for Row { target, data, value, wanted, met, note, .. } in rows {
        let (value, wanted) = (value.unwrap_or(f64::NAN), wanted.as_deref().unwrap_or_default());
        let met = if *met == Some(true) { "yes" } else { "✗" };
        let _ = writeln!(text, "| {data} | {target} | {note} | {value:.1} | {wanted} | {met} |");
    }
    text
}
