//! Frames of a run are converted while it writes them, to the bytes of a conversion afterwards.

use super::disturbed_job::write_two;
use super::{Archive, Run, Work, npy};
use std::fs::{self, OpenOptions};
use std::io::Write;
use std::path::Path;
use std::process::Child;
use std::time::{Duration, Instant};
use wavesplat_format::CompletePrefix;

fn archive() -> Archive {
    Archive::smooth([12, 10, 8], 22)
}

/// A conversion that follows a run.
fn follow(work: &Work, line: &str) -> Child {
    let mut command = work.command("sh");
    command.args(["-c", &format!("exec $WAVESPLAT convert {line} --window 8")]).spawn().unwrap()
}

fn end(child: Child) -> Run {
    Run::of("follow", child.wait_with_output().unwrap())
}

/// Waits until a file has a number of complete windows.
#[track_caller]
fn wait_for_windows(work: &Work, name: &str, windows: usize) {
    let started = Instant::now();
    let has_them = || {
        let found = fs::read(work.path(name)).ok()?;
        Some(CompletePrefix::read(&found.as_slice()).ok()?.metadata().windows.len() >= windows)
    };
    while has_them() != Some(true) {
        assert!(started.elapsed() < Duration::from_secs(60), "{name} has not {windows} windows");
        std::thread::sleep(Duration::from_millis(50));
    }
}

/// Writes a frame as slow programs do: its name appears first, its bytes later.
fn write_slowly(path: &Path, bytes: &[u8]) {
    let mut file = fs::File::create(path).unwrap();
    for part in bytes.chunks(bytes.len().div_ceil(3)) {
        std::thread::sleep(Duration::from_millis(20));
        file.write_all(part).unwrap();
    }
}

#[test]
fn files_of_a_folder_are_converted_as_they_appear() {
    let (work, archive) = (Work::new(), archive());
    let run = follow(&work, "frames -o run.wspl --follow done --region 1:11,0:10,2:8");
    std::thread::sleep(Duration::from_millis(400)); // the folder is not there yet
    work.write("frames/run.log", "it begins");
    for frame in 0..archive.frames {
        write_slowly(&work.path(format!("frames/f_{frame}.npy")), &archive.frame_npy(frame));
        if frame == 11 {
            wait_for_windows(&work, "run.wspl.part", 1); // with frames to come
        }
    }
    work.write("done", "");
    end(run).ok();
    work.wavesplat("convert frames -o after.wspl --window 8 --region 1:11,0:10,2:8").ok();
    assert!(work.read("run.wspl") == work.read("after.wspl"));
}

#[test]
fn variables_of_a_run_are_converted_as_they_appear_and_resumed_after_it() {
    let (work, archive) = (Work::new(), archive());
    let (all, later) = (Work::new(), Work::new());
    write_two(&all, &archive);
    fs::create_dir(work.path("steps")).unwrap();
    let give = |frame: usize| {
        let name = format!("steps/step_{frame}.vtk");
        write_slowly(&work.path(&name), &all.read(&name));
    };
    let mut run = follow(&work, "steps --variable all -o %n.wspl --follow 1h --dt 0.5");
    (0..18).for_each(give);
    wait_for_windows(&work, "twice.wspl.part", 2);
    run.kill().unwrap();
    run.wait().unwrap();
    (18..archive.frames).for_each(give);
    let line = "steps --variable all -o %n.wspl --window 8 --dt 0.5";
    let resumed = work.wavesplat(&format!("convert {line} --resume")).ok();
    assert!(resumed.message().contains("16 of them from before"), "{}", resumed.message());
    later.shell(&format!("exec $WAVESPLAT convert {}/{line}", all.path("").display())).ok();
    for name in ["wave.wspl", "twice.wspl"] {
        assert!(work.read(name) == later.read(name), "{name}");
    }
}

#[test]
fn a_file_that_grows_is_read_until_nothing_comes() {
    let (work, archive) = (Work::new(), archive());
    let [x, y, z] = archive.dims;
    for (name, bytes, options) in
        [("a.npy", archive.npy(), String::new()), ("a.raw", archive.bytes(), format!("--dims {x}x{y}x{z} --dtype f32"))]
    {
        let mut file = OpenOptions::new().create(true).append(true).open(work.path(name)).unwrap();
        let run = follow(&work, &format!("{name} -o run.wspl --force --follow 1.5s {options}"));
        for part in bytes.chunks(bytes.len().div_ceil(5)) {
            file.write_all(part).unwrap();
            std::thread::sleep(Duration::from_millis(200));
        }
        end(run).ok();
        work.shell(&format!("$WAVESPLAT convert - -o piped.wspl --force --window 8 {options} < {name}")).ok();
        assert!(work.read("run.wspl") == work.read("piped.wspl"), "{name}");
    }
}

/// NetCDF files of one frame each, with times and attributes.
fn write_netcdf(work: &Work, archive: &Archive) {
    work.write("a.npy", archive.npy());
    work.wavesplat("convert a.npy -o a.wspl --dt 0.25 --tolerance 0").ok();
    fs::create_dir(work.path("all")).unwrap();
    for frame in 0..archive.frames {
        work.wavesplat(&format!("extract a.wspl -o all/f_{frame:02}.nc --frames {frame}")).ok();
    }
}

#[test]
fn descriptions_and_times_are_those_of_all_files() {
    let (work, archive, all) = (Work::new(), archive(), Work::new());
    write_netcdf(&all, &archive);
    let give = |frames: std::ops::Range<usize>| {
        let names = frames.map(|frame| format!("f_{frame:02}.nc"));
        names.for_each(|name| work.write(&format!("all/{name}"), all.read(&format!("all/{name}"))));
    };
    give(0..18);
    let mut run = follow(&work, "all -o run.wspl --follow done");
    wait_for_windows(&work, "run.wspl.part", 2);
    run.kill().unwrap();
    run.wait().unwrap();
    let run = follow(&work, "all -o run.wspl --follow done --resume");
    give(18..archive.frames);
    std::thread::sleep(Duration::from_millis(500));
    work.write("done", "");
    let run = end(run).ok();
    assert!(run.message().contains("16 of them from before"), "{}", run.message());
    work.wavesplat("convert all -o after.wspl --window 8").ok();
    assert!(work.read("run.wspl") == work.read("after.wspl"));
    assert_eq!(work.wavesplat("info run.wspl --json").ok().json()["times"][21], 5.25);
}

#[test]
fn what_is_beside_raw_frames_is_no_frame() {
    let (work, archive) = (Work::new(), archive());
    (0..archive.frames).for_each(|frame| work.write(&format!("raw/f_{frame}.bin"), archive.frame_bytes(frame)));
    let line = "raw --dims 12x10x8 --dtype f32";
    let run = follow(&work, &format!("{line} -o raw/run.wspl --follow raw/done"));
    wait_for_windows(&work, "raw/run.wspl.part", 2);
    work.write("raw/done", "");
    end(run).ok();
    work.shell("mv raw/run.wspl .").ok();
    let pattern = format!("'raw/*' {} -o pattern.wspl --follow raw/done", &line[4..]);
    end(follow(&work, &pattern)).ok();
    work.shell("rm raw/done").ok();
    work.wavesplat(&format!("convert {line} -o after.wspl --window 8")).ok();
    assert!(work.read("run.wspl") == work.read("after.wspl"));
    assert!(work.read("pattern.wspl") == work.read("after.wspl"));
}

#[test]
fn an_array_that_has_its_full_length_from_the_start_is_read_at_the_end() {
    let (work, archive) = (Work::new(), archive());
    let whole = archive.npy();
    let head = whole.len() - archive.bytes().len();
    work.write("a.npy", [&whole[..head], &vec![0; whole.len() - head][..]].concat());
    let run = follow(&work, "a.npy -o run.wspl --follow done");
    std::thread::sleep(Duration::from_millis(500));
    work.write("a.npy", &whole);
    work.write("done", "");
    end(run).ok();
    work.wavesplat("convert a.npy -o after.wspl --window 8").ok();
    assert!(work.read("run.wspl") == work.read("after.wspl"));
}

#[test]
fn variables_end_with_the_same_frames() {
    let (work, archive) = (Work::new(), archive());
    write_two(&work, &archive);
    let run = follow(&work, "steps --variable all -o %n.wspl --follow 2s");
    wait_for_windows(&work, "twice.wspl.part", 2);
    end(run).ok();
    for name in ["wave", "twice"] {
        assert_eq!(work.wavesplat(&format!("info {name}.wspl --json")).ok().json()["frames"], 22);
    }
}

#[test]
fn an_array_that_changes_is_no_silence() {
    let (work, archive) = (Work::new(), archive());
    let whole = archive.npy();
    let head = whole.len() - archive.bytes().len();
    work.write("a.npy", [&whole[..head], &vec![0; whole.len() - head][..]].concat());
    let run = follow(&work, "a.npy -o run.wspl --follow 2.5s");
    let mut file = OpenOptions::new().write(true).open(work.path("a.npy")).unwrap();
    for part in whole.chunks(whole.len().div_ceil(4)) {
        std::thread::sleep(Duration::from_millis(1500));
        file.write_all(part).unwrap();
    }
    end(run).ok();
    work.wavesplat("convert a.npy -o after.wspl --window 8").ok();
    assert!(work.read("run.wspl") == work.read("after.wspl"));
}

#[test]
fn a_list_that_changes_its_times_is_refused() {
    let (work, archive) = (Work::new(), archive());
    write_two(&work, &archive);
    let list = |frames: usize, step: f64| {
        let entry = |frame| format!("<DataSet timestep=\"{}\" file=\"steps/step_{frame}.vtk\"/>", step * frame as f64);
        let entries: String = (0..frames).map(entry).collect();
        work.write("a.pvd", format!("<VTKFile type=\"Collection\"><Collection>{entries}</Collection></VTKFile>"));
    };
    list(16, 1.0);
    let run = follow(&work, "a.pvd --variable wave -o run.wspl --follow 1h");
    wait_for_windows(&work, "run.wspl.part", 2);
    list(22, 2.0);
    end(run).fails(4, &["other times"]);
}

#[test]
fn a_file_that_is_being_written_is_no_silence() {
    let (work, archive) = (Work::new(), archive());
    let run = follow(&work, "frames -o run.wspl --follow 2.5s");
    (0..8).for_each(|frame| work.write(&format!("frames/f_{frame}.npy"), archive.frame_npy(frame)));
    let bytes = archive.frame_npy(8);
    let mut file = fs::File::create(work.path("frames/f_8.npy")).unwrap();
    for part in bytes.chunks(bytes.len().div_ceil(4)) {
        file.write_all(part).unwrap();
        std::thread::sleep(Duration::from_millis(1500));
    }
    end(run).ok();
    work.wavesplat("convert frames -o after.wspl --window 8").ok();
    assert!(work.read("run.wspl") == work.read("after.wspl"));
}

#[test]
fn files_that_change_after_they_were_read_are_named() {
    let (work, archive) = (Work::new(), archive());
    archive.write_frames(&work, "frames");
    let run = follow(&work, "frames -o run.wspl --follow done");
    wait_for_windows(&work, "run.wspl.part", 2);
    work.write("frames/f_1.npy", archive.frame_npy(2));
    work.write("done", "");
    end(run).fails(4, &["f_1.npy"]);
    assert!(!work.path("run.wspl").exists());
}

#[cfg(unix)]
#[test]
fn a_pipe_that_nobody_opens_ends_with_the_run() {
    let work = Work::new();
    work.shell("mkfifo frames.npy").ok();
    work.wavesplat("convert frames.npy -o run.wspl --follow 1s").fails_with(&["frames.npy"]);
}

#[cfg(unix)]
#[test]
fn a_pipe_may_be_opened_by_a_program_for_each_frame() {
    let (work, archive) = (Work::new(), archive());
    archive.write_frames(&work, "frames");
    work.shell("cat $(ls -v frames/*) | $WAVESPLAT convert - -o piped.wspl --window 8").ok();
    work.shell("mkfifo frames.npy").ok();
    for (end_of_run, last) in [("1.5s", ""), ("done", "touch done")] {
        let run = follow(&work, &format!("frames.npy -o run.wspl --force --follow {end_of_run}"));
        work.shell(&format!("for f in $(ls -v frames/*); do cat $f > frames.npy; done; {last}")).ok();
        end(run).ok();
        assert!(work.read("run.wspl") == work.read("piped.wspl"), "{end_of_run}");
    }
}

#[test]
fn what_cannot_be_followed_is_named() {
    let (work, archive) = (Work::new(), archive());
    archive.write_frames(&work, "frames");
    work.write("done", "");
    work.write("empty/run.log", "");
    work.write("one.vti", "<VTKFile");
    work.write("torn/f_0.npy", archive.frame_npy(0));
    work.write("torn/f_1.npy", &archive.frame_npy(1)[..900]);
    work.write("other/f_0.npy", archive.frame_npy(0));
    work.write("other/f_1.npy", npy("<f4", "1, 2, 3", &[0; 24]));
    for (input, words) in [
        ("-", "standard input ends"),
        ("frames one.vti", "takes one folder"),
        ("empty", "had no complete frame"),
        ("gone", "was not there"),
        ("one.vti", "cannot be read while it grows"),
        ("torn", "f_1.npy"),
        ("other", "f_1.npy"),
        ("frames --magnitude a,b", "have ended"),
        ("frames --shard 1/2 --range 0,1", "have ended"),
        ("frames --transfer-function viridis", "needs --range"),
        ("frames --frames 2:4", "has an end"),
        ("frames --spacing 0,1,1", "--spacing"),
    ] {
        work.wavesplat(&format!("convert {input} -o a.wspl --follow done")).fails_with(&["error", words]);
    }
    work.wavesplat("convert frames -o a.wspl --follow 90").fails(2, &["90s, 10min or 2h"]);
    work.wavesplat("convert frames -o a.wspl --follow 0s").fails(2, &["--follow"]);
    work.wavesplat("convert frames -o a.wspl --follow 10m").fails(2, &["90s, 10min or 2h"]);
}

#[test]
fn frames_that_come_out_of_order_are_refused() {
    let (work, archive) = (Work::new(), archive());
    (10..20).for_each(|frame| work.write(&format!("frames/f_{frame}.npy"), archive.frame_npy(frame)));
    let run = follow(&work, "frames -o run.wspl --follow 1h");
    wait_for_windows(&work, "run.wspl.part", 1);
    work.write("frames/f_9.npy", archive.frame_npy(9));
    end(run).fails(4, &["frames: ", "new ones come before"]);
}
