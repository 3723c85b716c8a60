//! Programs that are asked to end by Ctrl-C or by a scheduler.
#![cfg(target_os = "linux")]

use super::{Archive, Run, Work};
use std::fs;
use std::io::Write;
use std::process::{Child, Command};
use std::time::{Duration, Instant};

/// A program that handles signals as if started from a terminal.
fn start(work: &Work, line: &str) -> Child {
    let line = format!("exec env --default-signal=INT,TERM {line}");
    work.command("sh").args(["-c", &line]).spawn().unwrap()
}

fn signal(child: &Child, name: &str) {
    let sent = Command::new("kill").args([&format!("-{name}"), &child.id().to_string()]).status().unwrap();
    assert!(sent.success());
}

/// Waits until a file exists, with bytes in it if `filled`. Returns false if the program ended first.
fn appears(work: &Work, child: &mut Child, name: &str, filled: bool) -> bool {
    let started = Instant::now();
    while started.elapsed() < Duration::from_secs(60) {
        if fs::metadata(work.path(name)).is_ok_and(|m| !filled || m.len() > 0) {
            return true;
        }
        if child.try_wait().unwrap().is_some() {
            return false;
        }
        std::thread::sleep(Duration::from_micros(200));
    }
    panic!("{name} does not appear");
}

fn archive() -> Archive {
    Archive::smooth([26, 24, 20], 40)
}

#[test]
fn a_conversion_from_a_slow_pipe_is_interrupted_and_resumed_to_the_same_bytes() {
    let work = Work::new();
    let bytes = archive().npy();
    work.write("a.npy", &bytes);
    let line = "$WAVESPLAT convert - -o a.wspl --window 8";
    for (name, code) in [("INT", 130), ("TERM", 143)] {
        let mut child = start(&work, line);
        let mut pipe = child.stdin.take().unwrap();
        pipe.write_all(&bytes[..bytes.len() / 2]).unwrap(); // the rest never comes
        assert!(appears(&work, &mut child, "a.wspl.part", true));
        signal(&child, name);
        let run = Run::of(line, child.wait_with_output().unwrap());
        run.fails(code, &["interrupted", "a.wspl.part: the finished windows are kept", "--resume"]);
        drop(pipe);
        assert_eq!(work.names(), ["a.npy", "a.wspl.part"]);
        let run = work.piped("convert - -o a.wspl --window 8 --resume", &bytes).ok();
        assert!(run.err.contains("of them from before"), "{}", run.err);
        work.wavesplat("convert a.npy -o whole.wspl --window 8").ok();
        assert!(work.read("a.wspl") == work.read("whole.wspl"));
        ["a.wspl", "whole.wspl"].iter().for_each(|name| fs::remove_file(work.path(name)).unwrap());
    }
}

/// Interrupts a program once a file exists. Returns whether the program was still running.
fn interrupted(work: &Work, line: &str, name: &str, filled: bool) -> Option<Run> {
    (0..20).find_map(|_| {
        let mut child = start(work, &format!("{line} --force"));
        if appears(work, &mut child, name, filled) {
            signal(&child, "INT");
        }
        let run = Run::of(line, child.wait_with_output().unwrap());
        (run.code == Some(130)).then_some(run)
    })
}

#[test]
fn a_conversion_of_files_is_interrupted_and_resumed_to_the_same_bytes() {
    let work = Work::new();
    work.write("a.npy", archive().npy());
    work.wavesplat("convert a.npy -o whole.wspl --window 2 --threads 1").ok();
    let line = "$WAVESPLAT convert a.npy -o a.wspl --window 2 --threads 1";
    interrupted(&work, line, "a.wspl.part", true).expect("in time").fails(130, &["a.wspl.part", "are kept"]);
    work.wavesplat("convert a.npy -o a.wspl --window 2 --threads 1").fails(2, &["a.wspl.part", "--resume", "--force"]);
    work.wavesplat("convert a.npy -o a.wspl --window 2 --threads 1 --resume").ok();
    assert!(work.read("a.wspl") == work.read("whole.wspl"));
}

#[test]
fn output_that_cannot_be_resumed_is_removed() {
    let work = Work::new();
    work.write("a.npy", archive().npy());
    work.wavesplat("convert a.npy -o a.wspl --window 4").ok();
    for (line, part) in [
        ("$WAVESPLAT extract a.wspl -o b.npy --threads 1", "b.npy.part"),
        ("$RENDER a.wspl --size 500x500 -o c.npy --threads 1", "c.npy.part"),
        ("$RENDER a.wspl --size 500x500 -o d_%02d.png --threads 1", "d_00.png.part"),
    ] {
        let run = interrupted(&work, line, part, false).expect("in time");
        assert!(run.err.contains("interrupted") && !run.err.contains("--resume"), "{}", run.err);
        let parts: Vec<String> = work.names().into_iter().filter(|name| name.ends_with(".part")).collect();
        assert!(parts.is_empty(), "{parts:?}");
    }
}

#[test]
fn a_job_in_the_background_is_not_interrupted() {
    let work = Work::new();
    let bytes = archive().npy();
    let mut child =
        work.command("sh").args(["-c", "trap '' INT; exec $WAVESPLAT convert - -o a.wspl --window 8"]).spawn().unwrap();
    let mut pipe = child.stdin.take().unwrap();
    pipe.write_all(&bytes[..bytes.len() / 2]).unwrap();
    assert!(appears(&work, &mut child, "a.wspl.part", true));
    signal(&child, "INT");
    pipe.write_all(&bytes[bytes.len() / 2..]).unwrap();
    drop(pipe);
    Run::of("in the background", child.wait_with_output().unwrap()).ok();
    assert_eq!(work.names(), ["a.wspl"]);
}
