//! Movies, made by ffmpeg.

use super::render::decode_png;
use super::{RENDER, Work};
use std::process::Command;

/// Whether ffmpeg is there; says so if it is not.
#[allow(clippy::print_stderr)]
fn has_ffmpeg() -> bool {
    let found = Command::new("ffmpeg").arg("-version").output().is_ok();
    if !found {
        eprintln!("not run: ffmpeg is not installed");
    }
    found
}

#[test]
fn movies_show_the_pictures() {
    if !has_ffmpeg() {
        return;
    }
    let work = Work::with_file("");
    let shown = "a.wspl --size 97x81 --range 0,3 --frames 0:12";
    work.render("a.wspl --size 97x81 --range 0,3 --frames 7 -o seven.png").ok();
    let expected = decode_png(&work.read("seven.png"));
    for (ending, most) in [("mp4", 4.0), ("webm", 6.0), ("gif", 8.0)] {
        work.render(&format!("{shown} -o run.{ending}")).ok();
        let select = "-vf trim=start_frame=7 -frames:v 1 -update 1";
        work.shell(&format!("ffmpeg -v error -nostdin -y -i run.{ending} {select} -pix_fmt rgb24 seven_{ending}.png"))
            .ok();
        let found = decode_png(&work.read(&format!("seven_{ending}.png")));
        let width = found.len() / 3 / if ending == "gif" { 81 } else { 82 };
        let off = |y: usize, x: usize| {
            (0..3)
                .map(|c| f64::from(found[3 * (y * width + x) + c].abs_diff(expected[3 * (y * 97 + x) + c])))
                .sum::<f64>()
        };
        let mean = (0..81).flat_map(|y| (0..97).map(move |x| off(y, x))).sum::<f64>() / (3.0 * 81.0 * 97.0);
        assert!(mean < most, "{ending}: levels differ by {mean} in the mean");
        let frames = work.shell(&format!("ffmpeg -nostdin -i run.{ending} -f null - 2>&1")).ok();
        assert!(frames.text().contains("frame=   12"), "{}", frames.text());
    }
}

#[test]
fn only_movies_of_this_program_are_replaced() {
    if !has_ffmpeg() {
        return;
    }
    let work = Work::with_file("");
    for ending in ["mp4", "webm"] {
        let command = format!("a.wspl --size 40x30 --frames 0:3 -o run.{ending}");
        work.render(&command).ok();
        work.render(&command).ok();
        work.shell(&format!("ffmpeg -v error -nostdin -y -f lavfi -i testsrc=d=1:s=32x32 run.{ending}")).ok();
        work.render(&command).fails(2, &["exists", "--force"]);
    }
    work.render("a.wspl --size 40x30 --frames 0:3 -o - --format mp4").fails(2, &["a movie needs a file"]);
}

#[test]
fn without_ffmpeg_nothing_is_rendered() {
    let work = Work::with_file("");
    let run = work.command(RENDER).args("a.wspl -o run.mp4".split(' ')).env("PATH", "/nonexistent").output().unwrap();
    let said = String::from_utf8(run.stderr).unwrap();
    assert!(run.status.code() == Some(2) && said.contains("not installed") && said.contains(".apng"), "{said}");
    assert_eq!(work.names(), ["a.npy", "a.wspl"]);
}

#[test]
fn a_failing_ffmpeg_leaves_no_file_and_is_quoted() {
    let work = Work::with_file("");
    work.write("ffmpeg", "#!/bin/sh\necho disk is full of cats >&2\nexit 1\n");
    work.shell("chmod +x ffmpeg").ok();
    let path = format!("{}:/usr/bin:/bin", work.path("").display());
    let run = work.command(RENDER).args("a.wspl -o run.mp4".split(' ')).env("PATH", path).output().unwrap();
    let said = String::from_utf8(run.stderr).unwrap();
    assert!(!run.status.success() && said.contains("disk is full of cats"), "{said}");
    assert_eq!(work.names(), ["a.npy", "a.wspl", "ffmpeg"]);
}

/// ffmpeg that creates its output late.
const LATE: &str = "#!/bin/sh\nsleep 0.3\nfor last; do :; done\necho moving > \"$last\"\ncat > /dev/null\n";

#[test]
#[cfg(target_os = "linux")]
fn an_interrupted_movie_leaves_no_file_whenever_ffmpeg_creates_it() {
    let work = Work::with_file("");
    work.write("ffmpeg", LATE);
    work.shell("chmod +x ffmpeg").ok();
    for ending in ["mp4", "webm", "gif"] {
        let path = format!("PATH={}:/usr/bin:/bin", work.path("").display());
        let movie = format!("env --default-signal=INT,TERM {path} $RENDER a.wspl --size 300x300 -o run.{ending} -q");
        let part = format!("run.{ending}.part");
        let wait = format!("while [ ! -e {part} ]; do sleep 0.01; done");
        for name in ["INT", "TERM"] {
            work.shell(&format!("{movie} & pid=$!; {wait}; kill -{name} $pid; wait $pid; sleep 0.5")).code.unwrap();
            assert_eq!(work.names(), ["a.npy", "a.wspl", "ffmpeg"], "{name} {ending}");
        }
    }
}
