//! Speed of the programs, by the clock: whole processes from their start to the written output, beside another build's
//! in turns.

use super::machine::Provenance;
use super::size::Data;
use crate::synth::{Kind, Synth};
use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::Instant;
use wavesplat::base::error::{Error, Result};

/// The commands that are timed. FRAMES and FILE are the archive and its coefficient file, OUT is a new file, RANGE the
/// range of the samples, TOLERANCE that of the run.
const CASES: [(&str, &str); 21] = [
    ("convert", "wavesplat convert FRAMES -o OUT.wspl --tolerance TOLERANCE"),
    ("convert, Haar", "wavesplat convert FRAMES -o OUT.wspl --tolerance TOLERANCE --basis haar"),
    ("verify", "wavesplat verify FILE"),
    ("verify, against frames", "wavesplat verify FILE --against FRAMES"),
    ("extract", "wavesplat extract FILE -o OUT.npy"),
    ("extract one frame", "wavesplat extract FILE -o OUT.npy --frames 0"),
    ("projections", "wavesplat-render FILE -o OUT.npy --range RANGE"),
    ("projections, fast", "wavesplat-render FILE -o OUT.npy --range RANGE --fast"),
    ("projections along an axis", "wavesplat-render FILE -o OUT.npy --range RANGE --view 0,0"),
    ("projections of frames", "wavesplat-render FRAMES -o OUT.npy --range RANGE --method direct"),
    ("one projection", "wavesplat-render FILE -o OUT.npy --range RANGE --frames 0"),
    ("one picture, all defaults", "wavesplat-render FILE -o OUT.png --frames 0"),
    ("composites", "wavesplat-render FILE -o OUT.npy --range RANGE --mode composite"),
    ("one composite", "wavesplat-render FILE -o OUT.npy --range RANGE --mode composite --frames 0"),
    ("composites, ramp", "wavesplat-render FILE -o OUT.npy --range RANGE --mode composite --opacity 0:0,1:0.3"),
    (
        "one composite, ramp",
        "wavesplat-render FILE -o OUT.npy --range RANGE --mode composite --opacity 0:0,1:0.3 --frames 0",
    ),
    ("composites, shaded", "wavesplat-render FILE -o OUT.npy --range RANGE --mode composite --shade"),
    ("largest values", "wavesplat-render FILE -o OUT.npy --range RANGE --mode mip"),
    ("surfaces", "wavesplat-render FILE -o OUT.npy --range RANGE --mode iso"),
    ("one surface", "wavesplat-render FILE -o OUT.npy --range RANGE --mode iso --frames 0"),
    ("slices", "wavesplat-render FILE -o OUT.npy --range RANGE --slice x=0.5,y=0.5,z=0.5"),
];

/// What to measure, with what, and where results go.
#[derive(Debug, Clone)]
pub struct Config {
    /// Archives of the user, each one `.npy`.
    pub inputs: Vec<PathBuf>,
    /// Kinds of synthetic archives to make.
    pub kinds: Vec<Kind>,
    /// Voxels along x, y and z of those archives, and their frames.
    pub dims: [usize; 4],
    /// The tolerance of the files, as a share of the value range.
    pub tolerance: f64,
    /// Pixels a side of a picture.
    pub size: usize,
    /// Threads of the programs.
    pub threads: usize,
    /// Rounds through all commands; the shortest time counts.
    pub repeats: usize,
    /// The folder of `wavesplat` and `wavesplat-render`.
    pub programs: PathBuf,
    /// The folder of another build of them.
    pub against: Option<PathBuf>,
    /// The folder of results.
    pub output: PathBuf,
    /// The day to write into the results; by default that of the clock.
    pub date: Option<String>,
}

/// Measures all archives, writes `speed.md`, and returns its text. Reports progress through `say`.
///
/// # Errors
/// A folder without the programs, or a program that fails.
pub fn run(config: &Config, say: &mut dyn FnMut(&str)) -> Result<String> {
    if config.repeats == 0 || config.threads == 0 {
        return Err(Error::usage("--repeats, --threads: take 1 or more"));
    }
    let work = config.output.join("speed-work");
    fs::create_dir_all(&work).map_err(|e| Error::io(&work, "creating the folder", e))?;
    let (mut text, path) = (head(config), config.output.join("speed.md"));
    let made = |kind: &Kind| Synth::f32(*kind, config.dims).write_npy(&work);
    for archive in config.inputs.iter().cloned().map(Ok).chain(config.kinds.iter().map(made)) {
        text += &Archive { config, work: &work, data: Data::of(archive?)? }.rows(say)?;
        fs::write(&path, &text).map_err(|e| Error::io(&path, "writing", e))?; // an interrupted run leaves what it has
    }
    fs::remove_dir_all(&work).map_err(|e| Error::io(&work, "removing", e))?;
    Ok(text)
}

/// The heading of the table.
fn head(config: &Config) -> String {
    let Config { tolerance, size, threads, repeats, against, .. } = config;
    let mut text = format!("# Speed\n\n{}.\n\n", Provenance::here(0, config.date.as_ref()).words());
    let _ = writeln!(
        text,
        "Seconds of whole programs by the clock, {threads} thread(s), the least of {repeats} round(s), frames in the system's cache. Files keep every\n\
         sample within {tolerance:e} of the value range. Pictures have {size}x{size} pixels.\n"
    );
    text += match against {
        Some(_) => "| data | command | other build, s | this build, s | this / other |\n|---|---|--:|--:|--:|\n",
        None => "| data | command | s |\n|---|---|--:|\n",
    };
    text
}

/// An archive that is measured.
struct Archive<'a> {
    config: &'a Config,
    work: &'a Path,
    data: Data,
}

impl Archive<'_> {
    /// The rows of the table, one for each command.
    fn rows(&self, say: &mut dyn FnMut(&str)) -> Result<String> {
        let convert = "wavesplat convert FRAMES -o FILE --tolerance TOLERANCE --range RANGE";
        for build in 0..self.builds().len() {
            self.seconds(build, convert)?; // a build reads its own file: formats differ
        }
        let mut text = String::new();
        for (name, line) in CASES {
            say(&format!("{}: {name}", self.data.name));
            let cells = match (self.least(line)?.as_slice(), &self.config.against) {
                ([this, other], Some(_)) => format!("{other:.3} | {this:.3} | {:.2}", this / other),
                (times, _) => format!("{:.3}", times[0]),
            };
            let _ = writeln!(text, "| {} | {name} | {cells} |", self.data.name);
        }
        Ok(text)
    }

    /// The folders of the programs: those of this build, and of the other one.
    fn builds(&self) -> Vec<&PathBuf> {
        std::iter::once(&self.config.programs).chain(&self.config.against).collect()
    }

    /// The least seconds of a command by this build, and by the other one.
    fn least(&self, line: &str) -> Result<Vec<f64>> {
        let mut least = vec![f64::INFINITY; self.builds().len()];
        for _ in 0..self.config.repeats {
            for (build, least) in least.iter_mut().enumerate() {
                *least = least.min(self.seconds(build, line)?);
            }
        }
        Ok(least)
    }

    /// The seconds that a command takes by the build with this number.
    fn seconds(&self, build: usize, line: &str) -> Result<f64> {
        let mut words = line.split(' ');
        let name = words.next().unwrap_or_default();
        let program = self.builds()[build].join(format!("{name}{}", std::env::consts::EXE_SUFFIX));
        let mut command = Command::new(&program);
        let mut words: Vec<String> = words.map(|word| self.word(word, build)).collect();
        words.extend(["--quiet".into(), format!("--threads={}", self.config.threads)]);
        words.extend((name == "wavesplat-render").then(|| format!("--size={0}x{0}", self.config.size)));
        words.extend(line.contains(" -o ").then(|| "--force".into()));
        command.args(&words);
        let clock = Instant::now();
        let status = command.stdin(Stdio::null()).stdout(Stdio::null()).status();
        let (seconds, status) = (clock.elapsed().as_secs_f64(), status.map_err(|e| Error::io(&program, "running", e))?);
        if status.success() {
            Ok(seconds)
        } else {
            Err(Error::input(program, format!("{} failed ({status})", words.join(" "))))
        }
    }

    /// A word of a command, with this archive's names and numbers, for the build with this number.
    fn word(&self, word: &str, build: usize) -> String {
        let place = |name: &str| self.work.join(name).to_string_lossy().into_owned();
        let (lo, hi) = self.data.range;
        match word {
            "FRAMES" => self.data.path.to_string_lossy().into_owned(),
            "FILE" => place(&format!("file{build}.wspl")),
            "RANGE" => format!("{lo},{hi}"),
            "TOLERANCE" => self.config.tolerance.to_string(),
            _ => word.strip_prefix("OUT").map_or(word.into(), |extension| place(&format!("out{extension}"))),
        }
    }
}
