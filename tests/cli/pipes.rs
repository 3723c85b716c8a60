//! Pipes that end early, late or never; inputs that change; programs that are killed.

use super::{Archive, CONVERT, Run, Work, assert_same_but_options, small};
use std::fs::{self, File};
use std::io::{Read, Write};
use std::process::Child;
use std::thread::sleep;
use std::time::{Duration, Instant};

/// Noise, which does not compress: 32 MiB in one window.
fn noise() -> Archive {
    Archive::of([64, 64, 64], 32, |x, y, z, t| {
        let i = (x + 64 * (y + 64 * (z + 64 * t))) as u32;
        f32::from_bits(0x3f80_0000 | (i.wrapping_mul(2_654_435_761).rotate_left(13).wrapping_mul(40_503) >> 9))
    })
}

fn finish(args: &str, child: Child) -> Run {
    Run::of(args, child.wait_with_output().unwrap())
}

#[test]
fn a_shell_pipe_works_from_end_to_end() {
    let work = Work::with_file("");
    work.write("a.raw", small().bytes());
    work.shell("cat a.npy | $WAVESPLAT convert - -o - | cat > b.wspl").ok();
    work.shell("$WAVESPLAT convert - -o - --dims 20x14x10 --dtype f32 < a.raw > c.wspl").ok();
    assert!(work.read("a.wspl") == work.read("b.wspl"));
    assert_same_but_options(&work, "a.wspl", "c.wspl");
    work.shell("$WAVESPLAT extract a.wspl -o - | $WAVESPLAT convert - -q -o d.wspl --tolerance 0").ok();
    work.wavesplat("extract a.wspl -o e.npy").ok();
    work.wavesplat("verify d.wspl --against e.npy").ok();
}

#[test]
fn a_consumer_that_closes_early_ends_programs_quietly() {
    let work = Work::new();
    work.write("a.npy", noise().npy());
    work.wavesplat("convert a.npy -o a.wspl --tolerance 0").ok();
    let commands = [
        ("sh", "exec $WAVESPLAT convert a.npy -o - --tolerance 0"),
        ("sh", "exec $WAVESPLAT extract a.wspl -o -"),
        ("sh", "exec $RENDER a.wspl -o - --size 200x200 --format npy"),
        ("sh", "exec $RENDER a.wspl -o - --size 200x200 --format y4m"),
        ("sh", "exec $RENDER a.wspl -o - --size 200x200 --format png"),
    ];
    for (shell, line) in commands {
        let mut child = work.command(shell).args(["-c", line]).spawn().unwrap();
        let mut out = child.stdout.take().unwrap();
        out.read_exact(&mut [0; 10]).unwrap();
        drop(out);
        let run = finish(line, child).ok();
        assert!(run.err.is_empty(), "{line}: {}", run.err);
    }
    work.shell("$WAVESPLAT info a.wspl --json | head -c 1").ok();
    work.shell("$WAVESPLAT convert --help | head -c 1").ok();
}

#[test]
fn a_producer_that_dies_within_a_frame_leaves_no_file() {
    let (work, archive) = (Work::new(), small());
    let bytes = archive.bytes();
    let options = "convert - -o raw.wspl --dims 20x14x10 --dtype f32";
    let kept = "the finished windows are kept; --resume";
    work.piped(options, &bytes[..35 * 11_200 + 100]).fails(3, &["-: ", "frame 35", "11200", "100", kept]);
    work.piped("convert - -o few.wspl", &archive.npy()[..9 * 11_200]).fails(3, &["-: ", "frame 8"]);
    work.piped("convert - -o npy.wspl", &archive.npy()[..128 + 32 * 11_200])
        .fails(3, &["-: ", "32 of 40 frames", kept]);
    work.piped("convert - -o few.wspl", &archive.npy()[..50]).fails(3, &["-: ", "header"]);
    work.piped("convert - -o two.wspl", &[archive.npy(), archive.npy()].concat()).fails(3, &["-: ", "40 frame(s)"]);
    work.piped(&options.replace("raw", "few"), b"").fails(3, &["-: ", "empty"]);
    assert_eq!(work.names(), ["npy.wspl.part", "raw.wspl.part", "two.wspl.part"], "whole windows, and no final name");
}

#[test]
fn a_killed_conversion_leaves_no_file_under_the_final_name() {
    let (work, archive) = (Work::new(), small());
    let mut command = work.command(CONVERT);
    command.args("convert - -o out.wspl --window 8 --dims 20x14x10 --dtype f32".split(' '));
    let mut child = command.spawn().unwrap();
    let mut input = child.stdin.take().unwrap();
    input.write_all(&archive.bytes()[..20 * 11_200]).unwrap(); // two windows and a half
    let started = Instant::now();
    while !work.path("out.wspl.part").exists() && started.elapsed() < Duration::from_secs(20) {
        sleep(Duration::from_millis(5));
    }
    work.wavesplat("info out.wspl").fails(1, &["out.wspl"]);
    let args = "convert - -o out.wspl --window 8 --dims 20x14x10 --dtype f32";
    work.piped(args, &archive.bytes()).fails(2, &["out.wspl", &format!("process {} (", child.id())]);
    child.kill().unwrap();
    child.wait().unwrap();
    assert!(!work.path("out.wspl").exists());
    work.piped(&format!("{args} --force"), &archive.bytes()).ok();
    assert_eq!(work.names(), ["out.wspl"]);
    work.wavesplat("verify out.wspl").ok();
}

#[cfg(unix)]
#[test]
fn an_input_that_shrinks_under_a_map_is_named_and_gives_code_4() {
    let work = Work::new();
    for (name, frames) in [("one.npy", 1), ("many", 32)] {
        let archive = noise();
        if frames == 1 {
            work.write(name, archive.npy());
        } else {
            archive.write_frames(&work, name);
        }
        let line = format!("exec $WAVESPLAT convert {name} -o - --tolerance 0 --block 16 --memory 24MiB");
        let mut child = work.command("sh").args(["-c", &line]).spawn().unwrap();
        // After the first byte of output, a window is being gathered. It cannot finish before its 32 MiB are taken
        // from the pipe.
        child.stdout.as_mut().unwrap().read_exact(&mut [0]).unwrap();
        let victim = if frames == 1 { work.path(name) } else { work.path("many/f_20.npy") };
        File::options().write(true).open(&victim).unwrap().set_len(200).unwrap();
        let run = finish(&line, child);
        assert_eq!(run.code, Some(4), "{}", run.err);
        assert!(run.err.contains(if frames == 1 { "one.npy" } else { "many/f_20.npy" }), "{}", run.err);
        assert!(run.err.contains("shorter") || run.err.contains("changed"), "{}", run.err);
    }
}

#[cfg(unix)]
#[test]
fn an_input_that_is_rewritten_is_noticed_and_leaves_no_file() {
    let work = Work::new();
    for access in ["", "--no-mmap"] {
        noise().write_frames(&work, "many");
        assert!(work.shell("mkfifo slow.fifo").ok().out.is_empty());
        let line =
            format!("exec $WAVESPLAT convert many -o slow.fifo --tolerance 0 --block 16 --memory 24MiB {access}");
        let child = work.command("sh").args(["-c", &line]).spawn().unwrap();
        let mut out = File::open(work.path("slow.fifo")).unwrap();
        out.read_exact(&mut [0]).unwrap();
        fs::write(work.path("many/f_9.npy"), noise().frame_npy(8)).unwrap();
        std::io::copy(&mut out, &mut std::io::sink()).unwrap();
        let run = finish(&line, child).fails(4, &["f_9.npy"]);
        assert!(run.err.contains("shorter") || run.err.contains("changed"), "{}", run.err);
        fs::remove_file(work.path("slow.fifo")).unwrap();
    }
    assert_eq!(work.names(), ["many"]);
}

#[test]
#[allow(clippy::print_stderr, reason = "a skipped test says so")]
fn ffmpeg_reads_the_video() {
    let work = Work::with_file("");
    if work.shell("ffmpeg -version").code != Some(0) {
        eprintln!("skipped: no ffmpeg here");
        return;
    }
    let line = "$RENDER a.wspl --size 64x48 -o - --format y4m | ffmpeg -v error -nostdin -i - -c:v mpeg4 out.mp4";
    work.shell(line).ok();
    let probe = work.shell("ffmpeg -i out.mp4 -f null - 2>&1").ok();
    assert!(probe.text().contains("64x48") && probe.text().contains("frame=   40"), "{}", probe.text());
}

#[test]
#[allow(clippy::print_stderr, reason = "a skipped test says so")]
fn binary_data_is_not_written_to_a_terminal() {
    let work = Work::with_file("");
    if work.shell("script --version").code != Some(0) {
        eprintln!("skipped: no script here");
        return;
    }
    for line in ["$WAVESPLAT convert a.npy -o -", "$WAVESPLAT extract a.wspl -o -", "$RENDER a.wspl -o -"] {
        let run = work.shell(&format!("script -qec '{line}' log < /dev/null"));
        assert_eq!(run.code, Some(2), "{line}: {run:?}");
        assert!(run.text().contains("not written to a terminal"), "{}", run.text());
    }
}
