//! Resuming killed runs, and appending frames to finished files.

use super::{Archive, Work, npy};

/// Frames `range` of an archive as an `.npy`.
fn some_frames(archive: &Archive, range: std::ops::Range<usize>) -> Vec<u8> {
    let [x, y, z] = archive.dims;
    let bytes: Vec<u8> = range.clone().flat_map(|frame| archive.frame_bytes(frame)).collect();
    npy("<f4", &format!("{}, {z}, {y}, {x}", range.len()), &bytes)
}

/// An archive of 40 frames with growing values, complete and in pieces.
fn work() -> (Work, Archive) {
    let (work, archive) = (Work::new(), Archive::smooth([20, 14, 10], 40));
    work.write("all.npy", archive.npy());
    work.write("first.npy", some_frames(&archive, 0..16));
    work.write("rest.npy", some_frames(&archive, 16..40));
    (work, archive)
}

const SETTINGS: [&str; 6] = [
    "--window 8",
    "--window 8 --basis haar --bound rms",
    "--window 8 --basis learned --range -2,3 --level 7",
    "--window 4 --basis pyramid --space linear --bound relative --floor 0.1 --missing mask",
    "--window 8 --tolerance 0 --missing-value 7",
    "--window 8 --max-error 0.02",
];

#[test]
fn appending_whole_windows_equals_a_single_conversion() {
    for settings in SETTINGS {
        let (work, _) = work();
        work.wavesplat(&format!("convert all.npy -o all.wspl {settings}")).ok();
        work.wavesplat(&format!("convert first.npy -o grown.wspl {settings}")).ok();
        work.wavesplat("append grown.wspl rest.npy --resume").ok();
        assert!(work.read("grown.wspl") == work.read("all.wspl"), "{settings}");
        work.wavesplat("append grown.wspl rest.npy --resume").ok();
        assert!(work.read("grown.wspl") == work.read("all.wspl"), "{settings}, once more");
        let pipe = format!("cat first.npy | $WAVESPLAT convert - -o piped.wspl {settings}");
        work.shell(&pipe).ok();
        work.shell("cat rest.npy | $WAVESPLAT append piped.wspl -").ok();
        assert!(work.read("piped.wspl") == work.read("all.wspl"), "{settings} by pipes");
        work.wavesplat("verify grown.wspl --against all.npy").ok();
        assert_eq!(work.names(), ["all.npy", "all.wspl", "first.npy", "grown.wspl", "piped.wspl", "rest.npy"]);
    }
}

#[test]
fn a_short_last_window_stays_and_appended_frames_begin_a_new_one() {
    let (work, archive) = work();
    work.write("few.npy", some_frames(&archive, 0..13));
    work.write("more.npy", some_frames(&archive, 13..40));
    work.wavesplat("convert few.npy -o few.wspl --window 8").ok();
    let report = work.wavesplat("append few.wspl more.npy --json").ok().json();
    assert_eq!((report["frames"].as_u64(), report["frames_before"].as_u64()), (Some(40), Some(13)));
    let first = |w: &serde_json::Value| w["first_frame"].as_u64().unwrap();
    let windows: Vec<u64> = report["per_window"].as_array().unwrap().iter().map(first).collect();
    assert_eq!(windows, [0, 8, 13, 21, 29, 37]);
    work.wavesplat("verify few.wspl --against all.npy").ok();
}

#[cfg(unix)]
#[test]
fn an_append_keeps_links_and_permissions() {
    use std::os::unix::fs::{PermissionsExt, symlink};
    let (work, _) = work();
    work.wavesplat("convert first.npy -o a.wspl --window 8").ok();
    std::fs::set_permissions(work.path("a.wspl"), std::fs::Permissions::from_mode(0o600)).unwrap();
    symlink(work.path("a.wspl"), work.path("link.wspl")).unwrap();
    work.wavesplat("append link.wspl rest.npy").ok();
    assert!(work.path("link.wspl").is_symlink());
    assert_eq!(work.path("a.wspl").metadata().unwrap().permissions().mode() & 0o777, 0o600);
    work.wavesplat("verify a.wspl --against all.npy").ok();
    work.wavesplat("convert all.npy -o link.wspl --window 8 --force").ok();
    assert!(work.path("link.wspl").is_symlink());
    assert_eq!(work.path("a.wspl").metadata().unwrap().permissions().mode() & 0o777, 0o600);
}

#[test]
fn frames_already_in_a_file_are_not_appended_unasked() {
    let (work, _) = work();
    work.wavesplat("convert first.npy -o a.wspl --window 8").ok();
    work.wavesplat("append a.wspl all.npy").fails(2, &["a.wspl", "begins with these frames", "--frames 16:"]);
    work.wavesplat("append a.wspl rest.npy").ok();
    let file = work.read("a.wspl");
    work.wavesplat("append a.wspl rest.npy").fails(2, &["a.wspl", "ends with these frames", "--force"]);
    work.wavesplat("append a.wspl rest.npy --resume").ok();
    assert!(work.read("a.wspl") == file);
    let report = work.wavesplat("append a.wspl rest.npy --force --json").ok().json();
    assert_eq!(report["frames"].as_u64(), Some(64));
}

#[test]
fn a_run_that_reached_the_end_is_not_resumed_on_a_grown_archive() {
    let (work, archive) = work();
    work.write("few.npy", some_frames(&archive, 0..13));
    work.wavesplat("convert few.npy -o few.wspl --window 8").ok();
    let file = work.read("few.wspl");
    let end = file.windows(4).position(|bytes| bytes == b"META").unwrap();
    work.write("a.wspl.part", &file[..end]); // as if killed before it was finished
    work.wavesplat("convert all.npy -o a.wspl --window 8 --resume").fails(4, &["a.wspl", "has grown", "--frames 0:13"]);
    work.wavesplat("convert few.npy -o a.wspl --window 8 --resume").ok();
    assert!(work.read("a.wspl") == file);
    work.write("b.wspl.part", "notes");
    work.wavesplat("convert few.npy -o b.wspl").fails(2, &["b.wspl.part", "not an unfinished conversion", "--force"]);
}

#[test]
fn frames_of_a_growing_archive_are_appended_by_number() {
    let (work, archive) = work();
    archive.write_frames(&work, "frames");
    work.wavesplat("convert frames -o a.wspl --window 8 --frames 0:16 --region 2:18,:,1:9").ok();
    work.wavesplat("append a.wspl frames --frames 16:").ok();
    work.wavesplat("verify a.wspl --against frames --frames :").ok();
    work.wavesplat("verify a.wspl --against frames").ok(); // all frames, because the file has as many
}

#[test]
fn unsuitable_frames_are_not_appended_and_leave_the_file_unchanged() {
    let (work, archive) = work();
    work.wavesplat("convert first.npy -o a.wspl --window 8").ok();
    let before = work.read("a.wspl");
    work.write("other.npy", Archive::smooth([20, 14, 9], 8).npy());
    work.wavesplat("append a.wspl other.npy").fails(2, &["a.wspl", "another size"]);
    work.write("type.npy", npy("<f8", "2, 10, 14, 20", &[0; 2 * 2800 * 8]));
    work.wavesplat("append a.wspl type.npy").fails(2, &["a.wspl", "another type of samples: f32, now f64"]);
    work.wavesplat("append a.wspl rest.npy --spacing 2,2,2").fails(2, &["a.wspl", "another spacing"]);
    work.wavesplat("append a.wspl missing.npy").fails(1, &["missing.npy"]);
    work.wavesplat("append missing.wspl rest.npy").fails(1, &["missing.wspl"]);
    let mut nan = archive.clone();
    nan.values[20 * 2800] = f32::NAN;
    work.write("nan.npy", some_frames(&nan, 16..40));
    work.wavesplat("append a.wspl nan.npy").fails(3, &["nan.npy", "frame 4", "missing value"]);
    assert!(work.read("a.wspl") == before);
    let mut bad = before.clone();
    bad[before.len() / 2] ^= 4;
    work.write("bad.wspl", &bad);
    work.wavesplat("append bad.wspl rest.npy").fails(3, &["bad.wspl", "damaged"]);
    assert!(work.read("bad.wspl") == bad);
    let parts: Vec<String> = work.names().into_iter().filter(|name| name.ends_with(".part")).collect();
    assert_eq!(parts, [""; 0], "nothing was finished that could be gone on with");
}

#[test]
fn a_stopped_run_resumes_to_the_same_bytes() {
    for settings in SETTINGS {
        let (work, archive) = work();
        work.wavesplat(&format!("convert all.npy -o all.wspl {settings}")).ok();
        let from_pipe = format!("convert - -o a.wspl {settings}");
        work.piped(&from_pipe, &archive.npy()[..128 + 29 * 11_200]).fails(3, &["the finished windows are kept"]);
        let held = if settings.contains("--window 4") { "28" } else { "24" };
        let holds = format!("holds {held} frames of a run");
        work.piped(&from_pipe, &archive.npy()).fails(2, &["a.wspl.part", &holds, "--resume", "--force"]);
        let run = work.piped(&format!("{from_pipe} --resume"), &archive.npy()).ok();
        assert!(run.err.contains(&format!("40 frames, {held} of them from before")), "{}", run.err);
        assert!(work.read("a.wspl") == work.read("all.wspl"), "{settings}");
        work.wavesplat(&format!("convert all.npy -o a.wspl {settings} --resume")).ok();
        work.wavesplat("convert all.npy -o a.wspl --window 16 --resume").fails(2, &["a.wspl", "is complete, but"]);
        work.wavesplat("convert all.npy -o new.wspl --resume").ok();
    }
}

#[test]
fn runs_are_not_resumed_with_other_frames_or_settings() {
    let (work, archive) = work();
    let args = "convert - -o a.wspl --window 8";
    work.piped(args, &archive.npy()[..128 + 29 * 11_200]).fails(3, &["the finished windows are kept"]);
    for (settings, word) in [
        ("--window 16", "another window: 8, now 16"),
        ("--window 8 --tolerance 0.02", "another tolerance: 0.01, now 0.02"),
        ("--window 8 --basis haar", "another basis: auto, now haar"),
        ("--window 8 --bound rms", "another bound: Pointwise, now Rms"),
        ("--window 8 --range 0,1", "another range: none, now 0.0,1.0"),
        ("--window 8 --max-error 0.1", "another max-error: none, now 0.1"),
    ] {
        let run = work.piped(&format!("convert - -o a.wspl --resume {settings}"), &archive.npy());
        run.fails(2, &["a.wspl", word]);
    }
    for frame in [3, 20] {
        let mut changed = archive.clone();
        changed.values[frame * 2800 + 17] += 1e-3;
        let run = work.piped(&format!("{args} --resume"), &changed.npy());
        let window = format!("frames {}..{} are not those", frame / 8 * 8, frame / 8 * 8 + 8);
        run.fails(4, &["standard input", &window, "a.wspl"]);
    }
    work.piped(&format!("{args} --resume"), &some_frames(&archive, 0..8)).fails(4, &["a.wspl", "ends after 8 frames"]);
    work.piped(&format!("{args} --resume"), &archive.npy()).ok();
    work.wavesplat("convert all.npy -o all.wspl --window 8").ok();
    assert!(work.read("a.wspl") == work.read("all.wspl"), "whatever was tried in between");
}
