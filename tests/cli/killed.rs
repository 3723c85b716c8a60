//! Programs killed at any time: only the right content under final names, and the same bytes in the end.
#![cfg(unix)]

use super::disturbed_job::{FILE, Job};
use super::{Archive, Run};
use crate::common::random::Random;
use crate::common::{cases, report};
use std::os::unix::process::ExitStatusExt;
use std::process::Stdio;
use std::time::{Duration, Instant};

#[derive(Debug, Default)]
struct Tally {
    rounds: usize,
    kills: usize,
    /// Kills that came before the program ended.
    hits: usize,
    /// Runs that completed a killed one.
    resumes: usize,
    /// Of these, the runs that found complete windows.
    went_on: usize,
    verified: usize,
}

impl Tally {
    /// Kills a job, and completes it. `reach` is the latest time of a kill in units of the job's measured duration. It
    /// follows the speed that the machine has now.
    fn round(&mut self, job: &Job, reach: &mut f64, random: &mut Random) {
        job.reset();
        let kills = match random.below(20) {
            0 | 1 => 3,
            2..=6 => 2, // the second kill hits a resume
            _ => 1,
        };
        for kill in 0..kills {
            let hits = self.hits;
            self.kill(job, if kill == 0 { "" } else { "--resume" }, job.duration.mul_f64(*reach * random.unit()));
            *reach *= if self.hits > hits { 1.0 } else { 0.8 };
            if job.is_done() {
                break;
            }
            if job.line.contains("append") && self.kills.is_multiple_of(8) {
                job.work.wavesplat(&format!("verify {FILE} -q")).ok();
                self.verified += 1;
            }
        }
        let run = job.complete();
        self.resumes += usize::from(run.is_some());
        let more = |run: &Run| run.err.contains("of them from before") && !run.err.contains(&job.before_alone);
        let went_on = run.as_ref().map(more);
        *reach *= if went_on == Some(false) { 1.1 } else { 1.0 };
        self.went_on += usize::from(went_on == Some(true));
        self.rounds += 1;
    }

    fn kill(&mut self, job: &Job, more: &str, after: Duration) {
        let mut command = job.command("exec", more);
        let mut child = command.stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
        std::thread::sleep(after);
        child.kill().unwrap();
        self.kills += 1;
        self.hits += usize::from(child.wait().unwrap().signal() == Some(9));
    }

    /// Whether most kills came before the end, and many runs had windows to continue from.
    fn is_telling(&self) -> bool {
        2 * self.hits > self.kills && 4 * self.went_on > self.rounds
    }

    fn check(&self, started: Instant, rounds: usize) {
        report(&format!("{self:?} in {:.1?}", started.elapsed()));
        assert!(self.rounds >= rounds && self.kills >= rounds);
        assert!(self.hits > 0 && self.went_on > 0, "no kill came in time, or no run had windows to continue from");
    }
}

fn archive() -> Archive {
    Archive::smooth([26, 24, 20], 40)
}

/// The most rounds, as a multiple of those wanted.
const PATIENCE: usize = 10;

fn rounds(jobs: &[Job], rounds: usize, seed: u64) {
    let (started, mut random, mut tally) = (Instant::now(), Random(seed), Tally::default());
    let mut reach = vec![1.0; jobs.len()];
    let rounds = cases(rounds);
    // How many kills hit depends on the machine's speed, so there are more rounds while few have.
    while tally.rounds < rounds || !tally.is_telling() && tally.rounds < PATIENCE * rounds {
        let n = tally.rounds % jobs.len();
        tally.round(&jobs[n], &mut reach[n], &mut random);
    }
    tally.check(started, rounds);
}

#[test]
fn a_conversion_killed_at_any_time_is_resumed_to_the_same_bytes() {
    let jobs = [
        ("a.npy", "--window 8"),
        ("a.npy", "--window 4 --threads 1 --basis haar"),
        ("-", "--window 9 --basis multi --bound rms --memory 64MiB"),
        ("a.npy", "--window 6 --basis learned --bound relative --floor 0.1"),
        ("a.npy", "--window 5 --basis pyramid --tolerance 0"),
        ("a.npy", "--window 8 --basis haar --bound sampled --no-mmap"),
        ("-", "--window 8 --threads 1 --level 9 --block 16"),
        ("a.npy", "--window 8 --transfer-function rainbow --range -1,1.5"),
    ];
    let jobs = jobs.map(|(input, options)| Job::convert(&archive(), input, options));
    rounds(&jobs, 210, 1);
}

#[test]
fn variables_side_by_side_are_resumed_each_to_the_same_bytes() {
    let jobs = ["--window 8", "--window 4 --threads 1 --basis haar"];
    let jobs = jobs.map(|options| Job::convert_two(&archive(), options));
    rounds(&jobs, 30, 3);
}

#[test]
fn a_killed_append_leaves_the_file_and_is_resumed_to_the_same_bytes() {
    let jobs = [
        (16, "--window 4"),
        (12, "--window 4 --threads 1 --basis haar"),
        (9, "--window 9 --basis multi --bound rms"),
        (8, "--window 4 --transfer-function coolwarm --range -1,1.5 --basis haar"),
        (13, "--window 5 --basis pyramid --tolerance 0"), // after a short window
    ];
    let jobs = jobs.map(|(first, options)| Job::append(&archive(), first, options));
    rounds(&jobs, 90, 2);
}
