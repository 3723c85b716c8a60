//! Runs that fail: a message with file, place and reason, the right exit code, nothing under the final name.

use super::{Bench, raw};
use std::fs;

/// Runs, and checks exit code and message; the folder must hold nothing new.
fn fails(b: &Bench, program: &str, args: &str, code: i32, says: &[&str]) {
    let before = b.names();
    let said = b.run(program, args);
    assert_eq!(said.code, code, "{args}: {}", said.err);
    for part in says {
        assert!(said.err.contains(part), "{args}: '{part}' is not in: {}", said.err);
    }
    assert_eq!(b.names(), before, "{args}");
}

#[test]
fn damaged_files_are_refused() {
    let b = Bench::new(5);
    b.done("wavesplat", "convert frames -o a.wspl");
    let whole = b.bytes("a.wspl");
    for len in [0, 1, 7, 100, 128, 500, whole.len() - 200, whole.len() - 1] {
        fs::write(b.path("cut.wspl"), &whole[..len]).unwrap();
        fails(&b, "wavesplat", "info cut.wspl", 3, &["cut.wspl"]);
        fails(&b, "wavesplat-render", "cut.wspl -o x.npy", 3, &["cut.wspl"]);
    }
    for place in (0..whole.len()).step_by(whole.len() / 60) {
        let mut flipped = whole.clone();
        flipped[place] ^= 1 << (place % 8);
        fs::write(b.path("flipped.wspl"), &flipped).unwrap();
        fails(&b, "wavesplat", "verify flipped.wspl", 3, &["flipped.wspl"]);
    }
    fs::write(b.path("foreign.wspl"), "a text, and nothing else").unwrap();
    fails(&b, "wavesplat", "verify foreign.wspl", 3, &["foreign.wspl", "not a wavesplat coefficient file"]);
    fails(&b, "wavesplat-render", "frames -o x.npy", 2, &["--method direct"]);
}

#[test]
fn frames_that_do_not_fit_are_refused() {
    let b = Bench::new(6);
    fs::write(b.path("all.raw"), raw(6)).unwrap();
    fails(&b, "wavesplat", "convert all.raw --dims 11x9x8x6 --dtype f32 -o x.wspl", 3, &["all.raw", "bytes"]);
    fails(&b, "wavesplat", "convert all.raw -o x.wspl", 2, &["all.raw", "--dims"]);
    fails(&b, "wavesplat", "convert frames/frame_0000.npy no.npy -o x.wspl", 1, &["no.npy", "No such file"]);
    b.write_npy("frames/frame_0003.npy", &[7, 9, 10], &vec![0.0; 630]);
    fails(&b, "wavesplat", "convert frames -o x.wspl", 3, &["frame_0003.npy", "10x9x7"]);
    fs::remove_file(b.path("frames/frame_0003.npy")).unwrap();
    fails(&b, "wavesplat", "convert frames -o x.wspl", 3, &["frame_0002.npy", "frame_0004.npy", "missing"]);
    b.done("wavesplat", "convert frames -o gap.wspl --allow-gaps");
}

#[test]
fn outputs_that_cannot_be_written_leave_nothing() {
    let b = Bench::new(2);
    fails(&b, "wavesplat", "convert frames -o no/x.wspl", 1, &["no/x.wspl", "No such file"]);
    fails(&b, "wavesplat", "convert frames -o frames/frame_0000.npy/x.wspl", 1, &["x.wspl"]);
    fails(&b, "wavesplat", "convert frames -o /dev/full", 1, &["/dev/full", "No space left"]);
    b.done("wavesplat", "convert frames -o a.wspl");
    fails(&b, "wavesplat", "extract a.wspl -o /dev/full --format raw", 1, &["/dev/full", "No space left"]);
    fails(&b, "wavesplat-render", "a.wspl -o /dev/full --format npy", 1, &["/dev/full", "No space left"]);
    fails(&b, "wavesplat", "convert frames -o a.wspl", 2, &["a.wspl", "--force"]);
    b.done("wavesplat", "convert frames -o a.wspl --force --tolerance 0");
    fails(&b, "wavesplat-render", "a.wspl -o x.png", 2, &["x.png", "%04d"]);
}

#[test]
fn options_that_make_no_sense_are_usage_errors() {
    let b = Bench::new(2);
    b.done("wavesplat", "convert frames -o a.wspl");
    for options in [
        "--tolerance -1",
        "--tolerance nan",
        "--window 30",
        "--window 0",
        "--basis multi --window 32",
        "--range 2,1",
        "--region 0:99,:,:",
        "--frames 7:9",
        "--memory 1KiB",
        "--memory lots",
        "--block 0",
        "--block 999",
        "--level 99",
        "--bound l7",
    ] {
        fails(&b, "wavesplat", &format!("convert frames -o x.wspl {options}"), 2, &[]);
    }
    for options in [
        "--view x",
        "--view 1,inf",
        "--size 0x5",
        "--size 99999x5",
        "--scale -1",
        "--sigma 0",
        "--tau -1",
        "--splat-error -1",
        "--colormap no",
        "--range 1,0",
        "--background white",
        "--frames 9",
        "--region 5:5,:,:",
        "--memory 1MiB",
        "--format bmp",
    ] {
        fails(&b, "wavesplat-render", &format!("a.wspl -o x_%d.png {options}"), 2, &[]);
    }
}
