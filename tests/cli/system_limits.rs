//! System limits on the size of files and on memory.
#![cfg(target_os = "linux")]

use super::disturbed_job::Job;
use super::{Archive, Run, Work};
use crate::common::report;
use std::io::{Read, Write};
use std::time::Instant;

/// Runs a command with larger and larger limits on the size of a file, until it succeeds.
fn climb(job: &Job, step: usize) -> usize {
    for blocks in (0..).step_by(step) {
        job.reset();
        let run = Run::of(&job.line, job.command(&format!("ulimit -f {blocks}; exec"), "").output().unwrap());
        if run.code == Some(0) {
            assert!(job.is_done());
            return blocks / step;
        }
        let name = job.outputs.iter().find(|(name, _)| run.err.contains(name.as_str()));
        assert!(name.is_some(), "{run:?}");
        run.fails(1, &["File too large"]);
        assert!(!job.is_done());
        job.complete();
    }
    0
}

#[test]
fn under_any_limit_on_the_size_of_a_file_the_work_is_kept_and_resumed() {
    let (archive, started) = (Archive::smooth([20, 14, 10], 40), Instant::now());
    let options = "--window 4 --tolerance 0 --basis haar";
    let steps = [
        climb(&Job::convert(&archive, "a.npy", options), 20),
        climb(&Job::convert(&archive, "-", &format!("{options} --threads 1")), 48),
        climb(&Job::append(&archive, 16, options), 20),
        climb(&Job::of_file(&archive, "extract a.wspl -o e.npy", &["e.npy"]), 25),
        climb(
            &Job::of_file(&archive, "render a.wspl -o p_%d.png --size 99x99 --frames 1,7", &["p_1.png", "p_7.png"]),
            2,
        ),
        climb(&Job::of_file(&archive, "render a.wspl -o p.npy --size 40x40", &["p.npy"]), 25),
    ];
    report(&format!("{steps:?} limits in {:.1?}", started.elapsed()));
    assert!(steps.iter().all(|steps| *steps > 4), "{steps:?}");
}

/// A large archive: a ramp, with noise in every third frame.
struct Large {
    at: u64,
}

const FRAME: u64 = 4 << 20; // 128 x 128 x 64 samples of 4 bytes

impl Large {
    fn fill(&mut self, out: &mut [u8]) {
        for word in out.as_chunks_mut::<4>().0 {
            let (frame, i) = (self.at / FRAME, self.at % FRAME / 4);
            let noise = (self.at as u32 ^ (self.at >> 17) as u32).wrapping_mul(0x7feb_352d);
            let noise = (noise ^ noise >> 15).wrapping_mul(0x846c_a68b) >> 9;
            let bits = if frame.is_multiple_of(3) { 0x3f80_0000 | noise } else { (1.0 + i as f32 / 4096.0).to_bits() };
            *word = bits.to_le_bytes();
            self.at += 4;
        }
    }
}

#[test]
fn an_archive_and_a_file_larger_than_the_limit_go_through_and_back() {
    goes_through_and_back(108, "ulimit -d 98304; exec", "--memory 48MiB --threads 2", 96 << 20);
}

#[test]
#[ignore = "exhaustive"]
fn a_gibibyte_goes_through_192_mib_and_back() {
    goes_through_and_back(256, "ulimit -d 196608; exec", "--memory 64MiB --threads 2", 256 << 20);
}

/// Converts so many frames under a limit of memory, and reads and draws the file, which has at least `least` bytes.
fn goes_through_and_back(frames: u64, limit: &str, options: &str, least: u64) {
    let (work, started) = (Work::new(), Instant::now());
    let convert = "$WAVESPLAT convert - -o big.wspl --dims 128x128x64 --dtype f32 --window 4 --tolerance 0 --basis haar --level 1";
    let mut child = work.command("sh").args(["-c", &format!("{limit} {convert} {options}")]).spawn().unwrap();
    let (mut input, mut source, mut chunk) = (child.stdin.take().unwrap(), Large { at: 0 }, vec![0; 1 << 20]);
    while source.at < FRAME * frames {
        source.fill(&mut chunk);
        if input.write_all(&chunk).is_err() {
            break; // the caller checks its message
        }
    }
    drop(input);
    Run::of(convert, child.wait_with_output().unwrap()).ok();
    let converted = started.elapsed();
    let bytes = std::fs::metadata(work.path("big.wspl")).unwrap().len();
    assert!(bytes > least, "only {bytes} bytes: they would fit");
    let extract = format!("{limit} $WAVESPLAT extract big.wspl -o - --format raw {options}");
    let mut child = work.command("sh").args(["-c", &extract]).spawn().unwrap();
    let (mut out, mut source, mut expected) = (child.stdout.take().unwrap(), Large { at: 0 }, vec![0; 1 << 20]);
    while source.at < FRAME * frames {
        source.fill(&mut expected);
        out.read_exact(&mut chunk).unwrap();
        assert!(chunk == expected, "other samples before byte {}", source.at);
    }
    drop(out);
    Run::of(&extract, child.wait_with_output().unwrap()).ok();
    let extracted = started.elapsed();
    for more in ["--no-mmap", ""] {
        let render =
            format!("{limit} $RENDER big.wspl -o p.npy --force --size 64x64 --frames 0:{frames}:9 {options} {more}");
        work.shell(&render).ok();
    }
    work.shell(&format!("{limit} $WAVESPLAT verify big.wspl {options}")).ok();
    report(&format!("{bytes} bytes; until {converted:.1?}, {extracted:.1?}, {:.1?}", started.elapsed()));
}
