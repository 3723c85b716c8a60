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
    // A signal may also come when the file is whole.
    let unfinished = || interrupted(&work, line, "a.wspl.part", true).filter(|_| work.path("a.wspl.part").exists());
    (0..20).find_map(|_| unfinished()).expect("in time").fails(130, &["a.wspl.part", "are kept"]);
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

/// Commands, the name under which each writes, and all names of its output.
const IN_PARTS: [(&str, &str, &[&str]); 5] = [
    ("$WAVESPLAT extract a.wspl -o o.zarr", "o.zarr.part", &["o.zarr"]),
    ("$WAVESPLAT extract a.wspl -o o.nhdr", "o.raw.part", &["o.nhdr", "o.raw"]),
    ("$WAVESPLAT extract a.wspl -o o.pvd", "o.part", &["o", "o.pvd"]),
    ("$WAVESPLAT extract a.wspl -o o.nii.gz", "o.nii.gz.part", &["o.nii.gz"]),
    ("$RENDER a.wspl --size 300x300 -o o.html", "o.html.part", &["o.html"]),
];

/// A folder with a file to read, and its names.
fn with_file() -> (Work, Vec<String>) {
    let work = Work::new();
    work.write("a.npy", archive().npy());
    work.wavesplat("convert a.npy -o a.wspl --window 4").ok();
    let names = work.names();
    (work, names)
}

fn without_output(work: &Work, outputs: &[&str]) {
    let names: Vec<String> = outputs.iter().flat_map(|name| [name.to_string(), format!("{name}.part")]).collect();
    work.shell(&format!("rm -rf {}", names.join(" "))).ok();
}

/// Checksums of all files of outputs.
fn checksums(work: &Work, outputs: &[&str]) -> String {
    work.shell(&format!("find {} -type f | sort | xargs cksum", outputs.join(" "))).ok().text().into()
}

/// Starts a command, and sends a signal some time after its output has appeared. Returns its exit code.
fn signalled(work: &Work, line: &str, part: &str, name: &str, after: Duration) -> Option<i32> {
    let mut child = start(work, &format!("{line} --threads 1 -q"));
    if appears(work, &mut child, part, false) {
        std::thread::sleep(after);
        signal(&child, name);
    }
    child.wait_with_output().unwrap().status.code()
}

#[test]
fn output_of_several_files_is_all_there_or_not_at_all() {
    let (work, before) = with_file();
    for (line, part, outputs) in IN_PARTS {
        let mut interrupts = 0;
        without_output(&work, outputs);
        work.shell(&format!("{line} -q")).ok();
        let (whole, sums) = (work.names(), checksums(&work, outputs));
        for round in 0..24_u64 {
            without_output(&work, outputs);
            let name = if round % 2 == 0 { "INT" } else { "TERM" };
            let code = signalled(&work, line, part, name, Duration::from_micros(700 * (round % 12)));
            interrupts += usize::from(code != Some(0));
            assert!(code == Some(0) || [130, 143].map(Some).contains(&code), "{line}: {code:?}");
            let names = work.names();
            if names == before && code != Some(0) {
                continue; // nothing
            }
            // All, perhaps with the code of a signal: it may come when the outputs have their names already.
            assert_eq!(names, whole, "{line}: {code:?}");
            assert_eq!(checksums(&work, outputs), sums, "{line}: {code:?}");
        }
        assert!(interrupts > 0, "{line}: always ended in time");
        without_output(&work, outputs);
    }
}

#[test]
fn an_interrupted_replacement_leaves_what_was_there() {
    let (work, _) = with_file();
    for (line, part, outputs) in IN_PARTS {
        work.shell(line).ok();
        let names = work.names();
        let kept = work.shell(&format!("cat $(find {} -type f | sort) | cksum", outputs.join(" "))).ok();
        for round in 0..6_u64 {
            signalled(&work, &format!("{line} --force --frames 3:30"), part, "INT", Duration::from_micros(500 * round));
            if work.names() != names {
                panic!("{line}: {:?}", work.names());
            }
        }
        work.shell(&format!("{line} --force")).ok();
        let again = work.shell(&format!("cat $(find {} -type f | sort) | cksum", outputs.join(" "))).ok();
        assert_eq!(again.text(), kept.text(), "{line}");
    }
}

#[test]
fn what_a_killed_run_left_blocks_no_later_run() {
    let (work, before) = with_file();
    for (line, part, outputs) in IN_PARTS {
        work.shell(line).ok();
        let sum = format!("cat $(find {} -type f | sort) | cksum", outputs.join(" "));
        let whole = work.shell(&sum).ok();
        let all = work.names();
        for (force, at) in [("", 0), ("", 5), ("--force", 3)] {
            if force.is_empty() {
                without_output(&work, outputs);
            }
            signalled(&work, &format!("{line} {force}"), part, "KILL", Duration::from_millis(at));
            let is_done = force.is_empty() && work.names() == all;
            work.shell(&format!("{line} {}", if is_done { "--force" } else { force })).ok();
            assert_eq!(work.names(), all, "{line}");
            assert_eq!(work.shell(&sum).ok().text(), whole.text(), "{line}");
        }
        without_output(&work, outputs);
    }
    assert_eq!(work.names(), before);
}

#[test]
fn a_folder_of_somebody_else_is_not_taken_for_a_killed_run() {
    let (work, _) = with_file();
    for (line, part) in [("extract a.wspl -o o.zarr", "o.zarr.part"), ("extract a.wspl -o o.pvd", "o.part")] {
        work.write(&format!("{part}/mine.txt"), "mine");
        for force in ["", "--force"] {
            work.wavesplat(&format!("{line} {force}")).fails(2, &[part, "is in the way"]);
        }
        assert_eq!(work.read(&format!("{part}/mine.txt")), b"mine");
        work.shell(&format!("rm -r {part}; ln -s / {part}")).ok();
        work.wavesplat(line).fails(2, &[part, "is in the way"]);
    }
}

#[test]
fn two_runs_do_not_write_one_folder() {
    let (work, _) = with_file();
    for (line, part) in [("extract a.wspl -o o.zarr", "o.zarr.part"), ("extract a.wspl -o o.pvd", "o.part")] {
        let marker = if part.contains("zarr") { ".zgroup" } else { ".unfinished" };
        work.write(&format!("{part}/{marker}"), "");
        let held = fs::File::open(work.path(part)).unwrap();
        held.lock().unwrap();
        work.wavesplat(line).fails(2, &["is writing it"]);
        drop(held);
        work.wavesplat(line).ok();
    }
}
