//! The programs from the outside: arguments, files, pipes, messages and exit codes.

mod archives; // archives of other programs are converted, shown and described
mod argument_messages; // messages about arguments say what to do next
mod bound_reports; // how `convert`, `info` and `verify` report each error bound
mod bodies; // sides of a patient, slices side by side, greys, thick layers
mod changed_while_read; // inputs that change while they are read
mod channels; // files of colours: reports, refusals, resuming
mod colours_and_annotations; // colour maps, ranges, annotations, sheets, moving PNGs
mod completions_and_man_pages; // shell completions and man pages
mod composite_and_mip; // pictures along rays
mod concurrent_writers; // several programs write one file at once
mod config; // options from a config file
mod conversion_warnings; // warnings of conversions, and refused fill values
mod convert; // every kind of input gives the same file
mod damaged_files; // damaged coefficient files are refused
mod depth_and_provenance; // 16 bits per channel, OpenEXR, and what made a picture
mod disturbed_job; // helper: a command that is disturbed and completed
mod extract_and_verify; // `info`, `verify` and `extract`
mod failing_files; // inputs and outputs that fail
mod follow; // frames are converted while a run writes them
mod formats_out; // extracted samples in the formats of other programs
mod guide; // README and the guide: commands run, links lead somewhere
mod help; // help texts
mod interrupted; // Ctrl-C and SIGTERM
mod invalid_options; // invalid requests are named
mod io_faults; // a fault at every operation on files
mod irregular_streams; // slow and odd producers behind a pipe
mod killed; // kill -9 at any time
mod max_error; // errors in the samples' unit
mod memory; // memory stays within the budget
mod metadata_round_trip; // metadata as the field's own software reads them
mod movies; // movies by ffmpeg
mod moving_cameras; // cameras that move while time passes
mod partial_sums; // partial sums of pictures, and their total
mod pipes; // pipes that end early, late or never
mod probe; // time series of points and regions
mod progress; // progress as JSON
mod recover; // recovery of damaged files
mod remembered_options; // options that a file remembers
#[cfg(feature = "remote")]
mod remote; // files on servers
pub(crate) mod render; // pictures in every format
mod resume_and_append; // resumed runs and appended frames
mod several_variables; // several variables, and magnitudes of vectors
mod shards; // shards and merging
mod slices; // slices through the volume
mod special_files; // pipes, devices, sockets and folders where a file is expected
mod system_limits; // limits of the system on memory and on the size of files
mod times; // times, dates and calendars

use std::ffi::OsStr;
use std::fs;
use std::io::{Read, Write};
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::time::Duration;
use tempfile::TempDir;
use wait_timeout::ChildExt;

const CONVERT: &str = env!("CARGO_BIN_EXE_wavesplat");
const RENDER: &str = env!("CARGO_BIN_EXE_wavesplat-render");

/// A program that runs for longer hangs, and is killed.
const LONGEST_RUN: Duration = Duration::from_secs(120);

/// A fresh folder in which programs run.
pub(crate) struct Work(TempDir);

impl Work {
    pub(crate) fn new() -> Self {
        Self(tempfile::tempdir().unwrap())
    }

    pub(crate) fn path(&self, name: impl AsRef<Path>) -> PathBuf {
        self.0.path().join(name)
    }

    pub(crate) fn write(&self, name: &str, bytes: impl AsRef<[u8]>) {
        let path = self.path(name);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, bytes).unwrap();
    }

    pub(crate) fn read(&self, name: &str) -> Vec<u8> {
        fs::read(self.path(name)).unwrap_or_else(|e| panic!("{name}: {e}"))
    }

    /// The names in the folder, sorted.
    pub(crate) fn names(&self) -> Vec<String> {
        let entries = fs::read_dir(self.0.path()).unwrap();
        let mut names: Vec<String> = entries.map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
        names.sort();
        names
    }

    /// Runs `wavesplat` with the words of `args`.
    pub(crate) fn wavesplat(&self, args: &str) -> Run {
        self.run(CONVERT, args, b"")
    }

    /// Runs `wavesplat` with `input` on its standard input.
    fn piped(&self, args: &str, input: &[u8]) -> Run {
        self.run(CONVERT, args, input)
    }

    /// Runs `wavesplat-render`.
    pub(crate) fn render(&self, args: &str) -> Run {
        self.run(RENDER, args, b"")
    }

    fn run(&self, program: impl AsRef<OsStr>, args: &str, input: &[u8]) -> Run {
        let mut child = self.command(program).args(args.split_whitespace()).spawn().unwrap();
        let mut stdin = child.stdin.take().unwrap();
        let (mut stdout, mut stderr) = (child.stdout.take().unwrap(), child.stderr.take().unwrap());
        std::thread::scope(|scope| {
            scope.spawn(move || stdin.write_all(input)); // a program may end before it has read everything
            let out = scope.spawn(move || read_all(&mut stdout));
            let err = scope.spawn(move || read_all(&mut stderr));
            let status = child.wait_timeout(LONGEST_RUN).unwrap();
            let status = status.unwrap_or_else(|| child.kill().and_then(|()| child.wait()).unwrap());
            Run::of(args, Output { status, stdout: out.join().unwrap(), stderr: err.join().unwrap() })
        })
    }

    /// A shell that finds the programs as `$WAVESPLAT` and `$RENDER`.
    pub(crate) fn shell(&self, line: &str) -> Run {
        Run::of(line, self.command("sh").args(["-c", line]).output().unwrap())
    }

    /// A command that runs in the folder with all its streams piped.
    fn command(&self, program: impl AsRef<OsStr>) -> Command {
        let mut command = Command::new(program);
        command.current_dir(self.0.path()).env("WAVESPLAT", CONVERT).env("RENDER", RENDER);
        command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
        command
    }

    /// Converts the small archive to `a.wspl`, with more arguments.
    fn with_file(more: &str) -> Self {
        let work = Self::new();
        work.write("a.npy", small().npy());
        work.wavesplat(&format!("convert a.npy -o a.wspl {more}")).ok();
        work
    }
}

/// The places of all sections of a file with a tag.
fn places_of(file: &[u8], tag: &[u8; 4]) -> Vec<usize> {
    file.windows(4).enumerate().filter(|(_, bytes)| bytes == tag).map(|(at, _)| at).collect()
}

/// What a coefficient file says of itself, but for the options that it remembers, and the id and size that depend on them.
fn all_but_options(work: &Work, file: &str) -> serde_json::Value {
    let mut info = work.wavesplat(&format!("info {file} --json")).ok().json();
    for key in ["settings", "options", "id", "bytes"] {
        info.as_object_mut().unwrap().remove(key).unwrap();
    }
    info
}

/// The files differ in the options that they remember alone: their windows and samples are the same.
#[track_caller]
pub(crate) fn assert_same_but_options(work: &Work, a: &str, b: &str) {
    assert_eq!(all_but_options(work, a), all_but_options(work, b), "{a} and {b}");
    for (file, samples) in [(a, "same_a.raw"), (b, "same_b.raw")] {
        work.wavesplat(&format!("extract {file} -o {samples} --force")).ok();
    }
    assert!(work.read("same_a.raw") == work.read("same_b.raw"), "{a} and {b}");
}

fn read_all(stream: &mut impl Read) -> Vec<u8> {
    let mut bytes = Vec::new();
    stream.read_to_end(&mut bytes).unwrap();
    bytes
}

/// The result of a program.
#[derive(Debug)]
pub(crate) struct Run {
    args: String,
    code: Option<i32>,
    out: Vec<u8>,
    err: String,
}

impl Run {
    fn of(args: &str, output: Output) -> Self {
        let err = String::from_utf8(output.stderr).unwrap();
        assert!(!err.contains("panicked"), "{args}: {err}");
        Self { args: args.into(), code: output.status.code(), out: output.stdout, err }
    }

    #[track_caller]
    pub(crate) fn ok(self) -> Self {
        assert_eq!(self.code, Some(0), "{}: {}", self.args, self.err);
        self
    }

    /// Asserts that it failed with this code, and printed all these words on standard error and nothing on standard
    /// output.
    #[track_caller]
    pub(crate) fn fails(self, code: i32, words: &[&str]) -> Self {
        let Self { args, err, out, .. } = &self;
        assert_eq!(self.code, Some(code), "{args}: {err}");
        assert!(out.is_empty(), "{args}: {} bytes on standard output", out.len());
        for word in words {
            assert!(err.contains(word), "{args}: the message lacks '{word}': {err}");
        }
        self
    }

    /// Asserts that it failed with this code and printed all these words on standard error. Its findings are on
    /// standard output.
    #[track_caller]
    pub(crate) fn finds(self, code: i32, words: &[&str]) -> Self {
        assert!(!self.out.is_empty(), "{}: nothing on standard output", self.args);
        let found = Self { out: Vec::new(), ..self };
        found.fails(code, words)
    }

    /// Asserts that it failed, and printed all these words on standard error and nothing on standard output.
    #[track_caller]
    fn fails_with(self, words: &[&str]) -> Self {
        let code = self.code.filter(|code| *code != 0).unwrap_or_else(|| panic!("{} succeeded", self.args));
        self.fails(code, words)
    }

    /// [`Self::fails`] or [`Self::finds`], as the program requires.
    #[track_caller]
    fn fails_or_finds(self, code: i32, words: &[&str]) -> Self {
        if self.out.is_empty() { self.fails(code, words) } else { self.finds(code, words) }
    }

    /// What it printed on standard error.
    pub(crate) fn message(&self) -> &str {
        &self.err
    }

    pub(crate) fn text(&self) -> &str {
        std::str::from_utf8(&self.out).unwrap()
    }

    fn json(&self) -> serde_json::Value {
        serde_json::from_slice(&self.out).unwrap()
    }

    /// The MiB that a message about `--memory` requests.
    #[track_caller]
    fn mebibytes(&self) -> usize {
        let digits = self.err.split("MiB").next().unwrap().rsplit(' ').next().unwrap();
        digits.parse().unwrap_or_else(|_| panic!("no number of MiB in: {}", self.err))
    }
}

/// An archive of f32 samples, x fastest, then y, z, frames.
#[derive(Debug, Clone)]
pub(crate) struct Archive {
    dims: [usize; 3],
    frames: usize,
    values: Vec<f32>,
}

/// Two windows, the second one short, of a volume whose dimensions are all different.
fn small() -> Archive {
    Archive::smooth([20, 14, 10], 40)
}

impl Archive {
    /// Waves that travel and grow.
    pub(crate) fn smooth(dims: [usize; 3], frames: usize) -> Self {
        Self::of(dims, frames, |x, y, z, t| {
            let [x, y, z, t] = [x, y, z, t].map(|n| n as f32);
            (0.31 * x + 0.11 * t).sin() * (0.23 * y - 0.07 * t).cos() + 0.04 * z + 0.01 * t
        })
    }

    pub(crate) fn of(dims: [usize; 3], frames: usize, value: impl Fn(usize, usize, usize, usize) -> f32) -> Self {
        let [nx, ny, nz] = dims;
        let at = |i: usize| value(i % nx, i / nx % ny, i / (nx * ny) % nz, i / (nx * ny * nz));
        Self { dims, frames, values: (0..nx * ny * nz * frames).map(at).collect() }
    }

    fn frame_len(&self) -> usize {
        self.dims.iter().product()
    }

    fn at(&self, [x, y, z]: [usize; 3], frame: usize) -> f32 {
        self.values[frame * self.frame_len() + (z * self.dims[1] + y) * self.dims[0] + x]
    }

    fn bytes(&self) -> Vec<u8> {
        self.values.iter().flat_map(|v| v.to_le_bytes()).collect()
    }

    fn frame_bytes(&self, frame: usize) -> Vec<u8> {
        self.bytes()[frame * 4 * self.frame_len()..][..4 * self.frame_len()].into()
    }

    pub(crate) fn npy(&self) -> Vec<u8> {
        let [x, y, z] = self.dims;
        npy("<f4", &format!("{}, {z}, {y}, {x}", self.frames), &self.bytes())
    }

    fn frame_npy(&self, frame: usize) -> Vec<u8> {
        let [x, y, z] = self.dims;
        npy("<f4", &format!("{z}, {y}, {x}"), &self.frame_bytes(frame))
    }

    /// Writes one `.npy` per frame, named by the frame's number.
    fn write_frames(&self, work: &Work, folder: &str) {
        for frame in 0..self.frames {
            work.write(&format!("{folder}/f_{frame}.npy"), self.frame_npy(frame)); // in natural order, without leading zeros
        }
    }

    /// The largest value minus the smallest.
    fn range(&self) -> f32 {
        let [lo, hi] = [f32::min, f32::max].map(|pick| self.values.iter().copied().reduce(pick).unwrap());
        hi - lo
    }
}

/// An `.npy` file, assembled here byte by byte.
pub(crate) fn npy(descr: &str, shape: &str, samples: &[u8]) -> Vec<u8> {
    npy_ordered(descr, shape, "False", samples)
}

fn npy_ordered(descr: &str, shape: &str, fortran: &str, samples: &[u8]) -> Vec<u8> {
    let text = format!("{{'descr': '{descr}', 'fortran_order': {fortran}, 'shape': ({shape}), }}");
    let text = format!("{text:<117}\n");
    let mut file = b"\x93NUMPY\x01\x00".to_vec();
    file.extend((text.len() as u16).to_le_bytes());
    file.extend(text.as_bytes());
    file.extend(samples);
    file
}

/// The header and the samples of an `.npy` file.
fn read_npy(file: &[u8]) -> (String, Vec<u8>) {
    assert_eq!(&file[..8], b"\x93NUMPY\x01\x00");
    let len = usize::from(u16::from_le_bytes([file[8], file[9]]));
    let header = String::from_utf8(file[10..10 + len].into()).unwrap();
    assert!((10 + len).is_multiple_of(64) && header.ends_with('\n'), "{header}");
    (header.replace(", )", ")"), file[10 + len..].into())
}

fn floats(bytes: &[u8]) -> Vec<f32> {
    bytes.as_chunks::<4>().0.iter().map(|b| f32::from_le_bytes(*b)).collect()
}
