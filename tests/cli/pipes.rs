//! Standard streams, early ends, and files that change.

use super::{Bench, frame, program_path, raw};
use std::fs::{self, File};
use std::io::{Read, Write};
use std::process::{Command, Stdio};
use std::time::Duration;
use wavesplat::npy;
use wavesplat::sample::SampleType;

const FRAMES: usize = 70;

#[test]
fn a_pipe_gives_the_bytes_of_the_files() {
    let b = Bench::new(FRAMES);
    b.done("wavesplat", "convert frames -o a.wspl");
    let mut npy = Vec::new();
    npy::write_header(SampleType::F32, &[FRAMES, 7, 9, 11], &mut npy).unwrap();
    npy.extend(raw(FRAMES));
    for (args, input) in [("--dims 11x9x7 --dtype f32", raw(FRAMES)), ("--threads 1", npy)] {
        let said = b.run_with("wavesplat", &format!("convert - -o - {args}"), input);
        assert_eq!((said.code, said.out == b.bytes("a.wspl")), (0, true), "{args}: {}", said.err);
    }
}

#[test]
fn a_window_that_does_not_fit_in_memory_is_spooled() {
    let b = Bench::new(0);
    let frames: Vec<u8> = (0..40).flat_map(|t| (0..512 * 300u32).map(move |i| (i / 7 + t * 3) as u8)).collect();
    fs::write(b.path("all.raw"), &frames).unwrap();
    b.done("wavesplat", "convert all.raw --dims 512x300x1x40 --dtype u8 -o a.wspl");
    let said = b.run_with("wavesplat", "convert - --dims 512x300x1 --dtype u8 -o p.wspl --memory 18MiB", frames);
    assert_eq!(said.code, 0, "{}", said.err);
    assert_eq!(b.bytes("a.wspl"), b.bytes("p.wspl"));
}

#[test]
fn a_reader_that_has_seen_enough_is_no_error() {
    let b = Bench::new(FRAMES);
    b.done("wavesplat", "convert frames -o a.wspl");
    for (program, args) in [("wavesplat", "extract a.wspl -o -"), ("wavesplat-render", "a.wspl -o - --format rgb24")] {
        let mut child = Command::new(program_path(program))
            .args(args.split(' '))
            .current_dir(b.path(""))
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        child.stdout.take().unwrap().read_exact(&mut [0; 10]).unwrap();
        let output = child.wait_with_output().unwrap();
        assert_eq!((output.status.code(), output.stderr.len()), (Some(0), 0), "{args}");
    }
}

#[test]
fn a_producer_that_dies_mid_frame_leaves_no_file() {
    let b = Bench::new(0);
    let mut input = raw(5);
    input.truncate(input.len() - 100);
    let said = b.run_with("wavesplat", "convert - --dims 11x9x7 --dtype f32 -o a.wspl", input);
    assert_eq!(said.code, 3);
    assert!(said.err.contains("frame 4"), "{}", said.err);
    assert_eq!(b.names(), ["frames"]);
}

#[test]
fn a_killed_conversion_leaves_no_file_and_does_not_block_the_next() {
    let b = Bench::new(FRAMES);
    let mut child = Command::new(program_path("wavesplat"))
        .args("convert - --dims 11x9x7 --dtype f32 -o a.wspl".split(' '))
        .current_dir(b.path(""))
        .stdin(Stdio::piped())
        .spawn()
        .unwrap();
    child.stdin.as_mut().unwrap().write_all(&raw(40)).unwrap();
    while !b.path("a.wspl.part").exists() {
        std::thread::sleep(Duration::from_millis(5));
    }
    let said = b.run("wavesplat", "convert frames -o a.wspl");
    assert_eq!(said.code, 2, "while the first one is at it: {}", said.err);
    child.kill().unwrap();
    child.wait().unwrap();
    assert!(!b.path("a.wspl").exists());
    b.done("wavesplat", "convert frames -o a.wspl");
    b.done("wavesplat", "verify a.wspl --against frames");
    assert_eq!(b.names(), ["a.wspl", "frames"]);
}

#[test]
fn an_input_cut_while_it_is_mapped_ends_with_its_name() {
    let b = Bench::new(0);
    let frames = 64;
    let file = File::create(b.path("all.raw")).unwrap();
    file.set_len(frames * 64 * 64 * 64 * 4).unwrap();
    assert!(Command::new("mkfifo").arg(b.path("out")).status().unwrap().success());
    let child = Command::new(program_path("wavesplat"))
        .args("convert all.raw --dims 64x64x64x64 --dtype f32 -o out --memory 64MiB".split(' '))
        .current_dir(b.path(""))
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    std::thread::sleep(Duration::from_millis(300)); // it waits for a reader of its output, with the input seen
    file.set_len(4096).unwrap();
    let mut reader = File::open(b.path("out")).unwrap();
    let _ = reader.read_to_end(&mut Vec::new());
    let output = child.wait_with_output().unwrap();
    let err = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(4), "{err}");
    assert!(err.contains("all.raw"), "{err}");
}

#[test]
fn a_source_that_differs_is_told_by_verify() {
    let b = Bench::new(4);
    b.done("wavesplat", "convert frames -o a.wspl");
    let mut values = frame(2);
    values[100] += 1.0;
    b.write_npy("frames/frame_0002.npy", &[7, 9, 11], &values);
    let said = b.run("wavesplat", "verify a.wspl --against frames");
    assert_eq!(said.code, 4);
    assert!(said.err.contains("1 series"), "{}", said.err);
}

#[test]
fn ffmpeg_reads_the_video() {
    let b = Bench::new(3);
    if Command::new("ffmpeg").arg("-version").output().is_err() {
        return; // not on this machine
    }
    b.done("wavesplat", "convert frames -o a.wspl");
    let video = b.done("wavesplat-render", "a.wspl -o - --format y4m --size 64x48").out;
    fs::write(b.path("v.y4m"), video).unwrap();
    let status =
        Command::new("ffmpeg").args(["-v", "error", "-i", "v.y4m", "v.mp4"]).current_dir(b.path("")).status().unwrap();
    assert!(status.success());
}
