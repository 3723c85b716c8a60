//! A command that is disturbed: the permitted states of its files, and the command that completes it.

use super::{Archive, Run, Work};
use std::fs;
use std::process::Command;
use std::time::{Duration, Instant};

pub(super) struct Job {
    pub(super) work: Work,
    pub(super) line: String,
    /// The command that completes a disturbed run.
    again: String,
    /// The message of a run that could resume nothing new.
    pub(super) before_alone: String,
    /// The initial output, if one exists before the run.
    before: Option<Vec<u8>>,
    pub(super) outputs: Vec<(String, Vec<u8>)>,
    /// The duration of an undisturbed run.
    pub(super) duration: Duration,
}

pub(super) const FILE: &str = "out.wspl";

impl Job {
    fn new(work: Work, line: &str, again: &str, outputs: &[&str]) -> Self {
        let before_alone = ", 0 of them from before".to_string();
        let before = fs::read(work.path(outputs[0])).ok();
        let line = format!("$WAVESPLAT {line}").replace("$WAVESPLAT render", "$RENDER");
        let job = Self {
            again: format!("{line} {again}"),
            work,
            line,
            before_alone,
            before,
            outputs: Vec::new(),
            duration: Duration::MAX,
        };
        let mut job = job;
        for _ in 0..2 {
            outputs.iter().for_each(|name| drop(fs::remove_file(job.work.path(name))));
            job.put_back();
            let started = Instant::now();
            job.run("").ok();
            job.duration = job.duration.min(started.elapsed());
        }
        job.outputs = outputs.iter().map(|name| ((*name).into(), job.work.read(name))).collect();
        job.reset();
        job
    }

    /// A conversion. `input` is `a.npy`, or `-` for its content on standard input.
    pub(super) fn convert(archive: &Archive, input: &str, options: &str) -> Self {
        let work = Work::new();
        work.write("a.npy", archive.npy());
        let from = if input == "-" { "< a.npy" } else { "" };
        Self::new(work, &format!("convert {input} -o {FILE} {options} {from}"), "--resume", &[FILE])
    }

    /// A conversion of two variables. Each file has a frame of both.
    pub(super) fn convert_two(archive: &Archive, options: &str) -> Self {
        let work = Work::new();
        write_two(&work, archive);
        let line = format!("convert steps/ -o %n.wspl --variable all {options}");
        Self::new(work, &line, "--resume", &["wave.wspl", "twice.wspl"])
    }

    /// Appends the last frames to a file of the first ones.
    pub(super) fn append(archive: &Archive, first: usize, options: &str) -> Self {
        let work = Work::new();
        let of = |range: std::ops::Range<usize>| {
            let len = archive.frame_len();
            let values = archive.values[range.start * len..range.end * len].to_vec();
            Archive { dims: archive.dims, frames: range.len(), values }.npy()
        };
        work.write("a.npy", of(first..archive.frames));
        work.write("first.npy", of(0..first));
        work.wavesplat(&format!("convert first.npy -o {FILE} {options}")).ok();
        let threads = if options.contains("--threads 1") { "--threads 1" } else { "" };
        let job = Self::new(work, &format!("append {FILE} a.npy {threads}"), "--resume", &[FILE]);
        Self { before_alone: format!(", {first} of them from before"), ..job }
    }

    /// Pictures or samples of a file `a.wspl`.
    pub(super) fn of_file(archive: &Archive, line: &str, outputs: &[&str]) -> Self {
        let work = Work::new();
        work.write("a.npy", archive.npy());
        work.wavesplat("convert a.npy -o a.wspl --window 4 --tolerance 0.001").ok();
        Self::new(work, line, "--force", outputs)
    }

    fn put_back(&self) {
        if let Some(before) = &self.before {
            self.work.write(FILE, before);
        }
    }

    /// Restores the state before any run.
    pub(super) fn reset(&self) {
        for (name, _) in &self.outputs {
            for name in [name.clone(), format!("{name}.part")] {
                let _ = fs::remove_file(self.work.path(name)); // if it exists
            }
        }
        self.put_back();
    }

    /// The command with more arguments, after some words for the shell.
    pub(super) fn command(&self, words: &str, more: &str) -> Command {
        let mut command = self.work.command("sh");
        command.args(["-c", &format!("{words} {} {more}", self.line)]);
        command
    }

    pub(super) fn run(&self, more: &str) -> Run {
        Run::of(&self.line, self.command("exec", more).output().unwrap())
    }

    /// Checks that each output is complete or as before the run. Returns whether all are complete.
    #[track_caller]
    pub(super) fn is_done(&self) -> bool {
        let is_whole = |(name, right): &(String, Vec<u8>)| {
            let found = fs::read(self.work.path(name)).ok();
            let whole = found.as_ref() == Some(right);
            assert!(whole || found == self.before, "{}: {name} is neither the old nor the new file", self.line);
            whole
        };
        self.outputs.iter().filter(|output| is_whole(output)).count() == self.outputs.len()
    }

    /// Completes a disturbed run. Returns the message of the completing run.
    #[track_caller]
    pub(super) fn complete(&self) -> Option<Run> {
        let done = self.is_done();
        let run = (!done).then(|| self.work.shell(&format!("exec {}", self.again)).ok());
        assert!(self.is_done(), "{}: completed to other bytes", self.again);
        let known =
            |name: &str| self.outputs.iter().any(|(output, _)| output == name) || self.work_files().contains(&name);
        for name in self.work.names().iter().filter(|name| !known(name)) {
            // A run that dies between linking the final name and removing the old one may leave only a second name of
            // the finished file.
            let same = done && name.strip_suffix(".part").is_some_and(known);
            assert!(same, "{}: left {name}", self.line);
        }
        run
    }

    fn work_files(&self) -> &'static [&'static str] {
        &["a.npy", "first.npy", "a.wspl", "steps"]
    }
}

/// Writes a VTK file of two variables for each frame, into `steps/`: `wave`, the archive, and `twice`, its double.
pub(super) fn write_two(work: &Work, archive: &Archive) {
    let ([x, y, z], voxels) = (archive.dims, archive.frame_len());
    let head = format!(
        "# vtk DataFile Version 3.0\nstep\nBINARY\nDATASET STRUCTURED_POINTS\nDIMENSIONS {x} {y} {z}\nORIGIN 0 0 0\n\
         SPACING 1 1 1\nPOINT_DATA {voxels}\n"
    );
    for frame in 0..archive.frames {
        let mut file = head.clone().into_bytes();
        for (name, factor) in [("wave", 1.0), ("twice", 2.0)] {
            file.extend(format!("SCALARS {name} float 1\nLOOKUP_TABLE default\n").into_bytes());
            let values = &archive.values[frame * voxels..][..voxels];
            file.extend(values.iter().flat_map(|value| (factor * value).to_le_bytes().into_iter().rev())); // big-endian
            file.push(b'\n');
        }
        work.write(&format!("steps/step_{frame}.vtk"), file);
    }
}
