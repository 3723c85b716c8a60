//! Every operation on files fails once or from then on, moves fewer bytes, is interrupted, or is the last before a
//! kill. The program must report an error that names a file, leave only complete files under final names, and produce
//! the right bytes after resuming.
#![cfg(target_os = "linux")]

use super::disturbed_job::Job;
use super::{Archive, Run, Work};
use crate::common::report;
use std::collections::BTreeSet;
use std::fs;
use std::time::Instant;

/// A library to preload into the programs, and its log.
struct Shim(Work);

impl Shim {
    fn new() -> Self {
        let work = Work::new();
        work.write("faults.c", include_str!("faults.c"));
        work.shell("cc -O1 -shared -fPIC -o faults.so faults.c").ok();
        Self(work)
    }

    /// Runs a command in which operation number `at` fails, if there are that many.
    fn run(&self, job: &Job, kind: &str, at: usize) -> Run {
        let (library, log) = (self.0.path("faults.so"), self.0.path("log"));
        let _ = fs::remove_file(&log); // if it exists
        let (library, log) = (library.display(), log.display());
        let shim = format!("exec env LD_PRELOAD={library} FAULT_LOG={log} FAULT_KIND={kind} FAULT_AT={at}");
        Run::of(&format!("{} with {kind} at {at}", job.line), job.command(&shim, "").output().unwrap())
    }

    /// The names of the logged operations.
    fn operations(&self) -> Vec<String> {
        let log = fs::read_to_string(self.0.path("log")).unwrap_or_default();
        log.lines().map(|line| line.split(' ').nth(1).unwrap().into()).collect()
    }
}

/// Operations that may move fewer bytes than requested.
const MOVING: [&str; 5] = ["read", "pread64", "write", "pwrite64", "copy_file_range"];
/// Operations that are retried when interrupted.
const RETRIED: [&str; 7] = ["read", "pread64", "write", "open", "fsync", "fdatasync", "ftruncate64"];
/// The kinds of faults, and whether each applies only to operations that move bytes.
const KINDS: [(&str, bool); 8] = [
    ("enospc", false),
    ("eio", false),
    ("always", false),
    ("eintr", false),
    ("crash", false),
    ("short", true),
    ("half", true),
    ("torn", true),
];

/// The required outcome of each kind of fault.
#[track_caller]
fn check(job: &Job, run: &Run, kind: &str, operation: &str) {
    let Run { args, code, err, .. } = run;
    let what = format!("{args} ({operation}): {code:?} {err}");
    match (kind, code) {
        ("crash" | "torn", code) => assert_eq!(*code, Some(137), "{what}"),
        ("short" | "half", code) => assert_eq!(*code, Some(0), "{what}"),
        ("eintr", code) if RETRIED.contains(&operation) => assert_eq!(*code, Some(0), "{what}"),
        (_, Some(0)) => {}
        (_, code) => {
            assert!(matches!(code, Some(1 | 4)), "{what}");
            let names = ["a.npy: ", "a.wspl: ", ".part: "];
            let names = names.iter().copied().chain(job.outputs.iter().map(|(name, _)| name.as_str()));
            assert!(err.contains("error: ") && names.into_iter().any(|name| err.contains(name)), "{what}");
        }
    }
    let done = job.is_done();
    assert!(done || *code != Some(0), "{what}");
}

/// Disturbs every operation of a command in every way.
fn disturb(jobs: &[Job], least: usize) {
    let (shim, started) = (Shim::new(), Instant::now());
    let (mut tries, mut failures, mut kinds_of) = (0, 0, BTreeSet::new());
    for job in jobs {
        shim.run(job, "none", 0).ok();
        let operations = shim.operations();
        assert!(operations.len() > 20 && job.is_done(), "{}: {operations:?}", job.line);
        kinds_of.extend(operations.clone());
        for (kind, at) in KINDS.iter().flat_map(|kind| (1..=operations.len()).map(move |at| (kind, at))) {
            let planned = operations[at - 1].as_str();
            let is_moot =
                kind.1 && !MOVING.contains(&planned) || planned == "statx" && !["eio", "always"].contains(&kind.0);
            if is_moot {
                continue;
            }
            job.reset();
            let run = shim.run(job, kind.0, at);
            let Some(operation) = shim.operations().pop() else { continue }; // with threads, the number of operations varies
            if !kind.1 || MOVING.contains(&operation.as_str()) {
                check(job, &run, kind.0, &operation);
            }
            tries += 1;
            failures += usize::from(run.code != Some(0));
            job.complete();
        }
    }
    report(&format!("{tries} faults in {kinds_of:?}, {failures} failures, in {:.1?}", started.elapsed()));
    assert!(tries > least, "only {tries} faults");
}

fn archive() -> Archive {
    Archive::smooth([8, 7, 6], 10)
}

const CONVERT: &str = "--window 4 --threads 1 --basis haar --block 8";

#[test]
fn a_conversion_survives_a_fault_at_every_operation() {
    disturb(&[Job::convert(&archive(), "a.npy", CONVERT)], 400);
}

#[test]
#[ignore = "exhaustive"]
fn a_conversion_that_reads_its_input_survives_a_fault_at_every_operation() {
    disturb(&[Job::convert(&archive(), "a.npy", &format!("{CONVERT} --no-mmap"))], 600);
}

#[test]
fn an_append_survives_a_fault_at_every_operation() {
    let options = "--window 4 --basis haar --block 8 --threads 1";
    disturb(&[Job::append(&archive(), 4, options)], 400);
}

#[test]
fn pictures_survive_a_fault_at_every_operation() {
    let line = "render a.wspl -o p_%d.png --size 12x12 --frames 3,9 --threads 1";
    disturb(&[Job::of_file(&archive(), line, &["p_3.png", "p_9.png"])], 150);
}

#[test]
fn extraction_survives_a_fault_at_every_operation() {
    let line = "extract a.wspl -o e.npy --threads 1";
    disturb(
        &[
            Job::of_file(&archive(), line, &["e.npy"]),
            Job::of_file(&archive(), &format!("{line} --no-mmap"), &["e.npy"]),
        ],
        300,
    );
}
