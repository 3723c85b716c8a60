//! Every kind of input gives the same file, for any number of threads and any memory budget.

use super::{Archive, Work, assert_same_but_options, npy, small};

#[test]
fn the_file_does_not_depend_on_how_frames_are_stored() {
    let (work, archive) = (Work::new(), small());
    let swapped: Vec<u8> = archive.values.iter().flat_map(|v| v.to_be_bytes()).collect();
    archive.write_frames(&work, "frames");
    for frame in 0..archive.frames {
        work.write(&format!("raw/f_{frame:03}.dat"), archive.frame_bytes(frame));
    }
    work.write("all.npy", archive.npy());
    work.write("big.npy", npy(">f4", "40, 10, 14, 20", &swapped));
    work.write("all.raw", archive.bytes());
    work.write("big.raw", &swapped);
    work.write("offset.raw", [b"a header".as_slice(), &archive.bytes()].concat());
    let list: Vec<String> = (0..40).map(|f| format!("frames/f_{f}.npy")).collect();
    let list = list.join(" ");
    work.wavesplat("convert all.npy -o all.wspl").ok();
    let file = work.read("all.wspl");
    for way in ["frames", "frames/f_*.npy", &list, "big.npy", "frames --no-mmap"] {
        work.wavesplat(&format!("convert {way} -o way.wspl --force")).ok(); // no shell is between
        assert!(work.read("way.wspl") == file, "{way}");
    }
    work.piped("convert - -o pipe.wspl", &archive.npy()).ok();
    assert!(work.read("pipe.wspl") == file, "a pipe");
    assert!(work.piped("convert - -o -", &archive.npy()).ok().out == file, "a pipe to a pipe");
    for way in [
        "all.raw --dims 20x14x10x40 --dtype f32",
        "big.raw --dims 20x14x10x40 --dtype f32 --endian big",
        "offset.raw --dims 20x14x10x40 --dtype f32 --offset 8",
        "raw --dims 20x14x10 --dtype f32",
    ] {
        work.wavesplat(&format!("convert {way} -o way.wspl --force")).ok();
        assert_same_but_options(&work, "way.wspl", "all.wspl");
    }
    for (input, options) in [
        ("all.raw", "--dims 20x14x10 --dtype f32"),
        ("all.raw", "--dims 20x14x10x40 --dtype f32"),
        ("big.raw", "--dims 20x14x10 --dtype f32 --endian big"),
        ("offset.raw", "--dims 20x14x10 --dtype f32 --offset 8"),
    ] {
        let bytes = work.read(input);
        work.piped(&format!("convert - -o pipe.wspl --force {options}"), &bytes).ok();
        assert_same_but_options(&work, "pipe.wspl", "all.wspl");
        let run = work.piped(&format!("convert - -o - {options}"), &bytes).ok();
        assert!(run.out == work.read("pipe.wspl"), "a pipe to a pipe, {options}");
    }
}

#[test]
fn a_pipe_that_spools_to_disk_gives_the_same_file() {
    let (work, archive) = (Work::new(), Archive::smooth([48, 40, 40], 40));
    work.write("a.npy", archive.npy());
    work.wavesplat("convert a.npy -o file.wspl --block 8").ok();
    let asked = work.piped("convert - -o pipe.wspl --block 8 --memory 1MiB", &archive.npy());
    let enough = asked.fails(2, &["--memory", "MiB"]).mebibytes();
    assert!(enough << 20 < 4 * 32 * 4 * archive.frame_len(), "a quarter of {enough}MiB holds a window: nothing spools");
    work.piped(&format!("convert - -o pipe.wspl --block 8 --memory {enough}MiB"), &archive.npy()).ok();
    assert!(work.read("pipe.wspl") == work.read("file.wspl"));
}

#[test]
fn the_memory_that_a_message_requests_is_enough() {
    let work = Work::new();
    work.write("a.npy", small().npy());
    for options in ["", "--block 8", "--window 64 --block 16", "--threads 4"] {
        let enough =
            work.wavesplat(&format!("convert a.npy -o a.wspl --force --memory 1KiB {options}")).fails(2, &["--memory"]);
        let enough = enough.mebibytes();
        work.wavesplat(&format!("convert a.npy -o a.wspl --force --memory {enough}MiB {options}")).ok();
    }
    let enough = work.wavesplat("extract a.wspl -o b.npy --memory 1KiB").fails(2, &["--memory"]).mebibytes();
    work.wavesplat(&format!("extract a.wspl -o b.npy --memory {enough}MiB")).ok();
    let enough = work.render("a.wspl -o c.npy --memory 1KiB").fails(2, &["--memory"]).mebibytes();
    work.render(&format!("a.wspl -o c.npy --memory {enough}MiB")).ok();
    assert_eq!(work.names(), ["a.npy", "a.wspl", "b.npy", "c.npy"]);
}

#[test]
fn threads_change_no_byte_and_no_pixel() {
    let (work, archive) = (Work::new(), Archive::smooth([40, 35, 33], 33));
    work.write("a.npy", archive.npy());
    for threads in [1, 2, 5] {
        let t = format!("--threads {threads}");
        work.wavesplat(&format!("convert a.npy -o {threads}.wspl --block 8 {t}")).ok();
        work.wavesplat(&format!("extract {threads}.wspl -o e{threads}.npy {t}")).ok();
        work.render(&format!("{threads}.wspl --size 60x50 -o r{threads}.npy {t}")).ok();
        work.render(&format!("{threads}.wspl --size 60x50 --frames 7 -o r{threads}.png {t}")).ok();
        work.render(&format!("{threads}.wspl --size 60x50 --frames 7 --method direct -o d{threads}.npy {t}")).ok();
    }
    for threads in [2, 5] {
        for [before, after] in [["", ".wspl"], ["e", ".npy"], ["r", ".npy"], ["r", ".png"], ["d", ".npy"]] {
            let same = work.read(&format!("{before}1{after}")) == work.read(&format!("{before}{threads}{after}"));
            assert!(same, "{before}{threads}{after}");
        }
    }
}

#[test]
fn bytes_depend_on_settings_and_not_on_chance() {
    let work = Work::new();
    work.write("a.npy", small().npy());
    work.write("elsewhere/b.npy", small().npy());
    work.wavesplat("convert a.npy -o 1.wspl").ok();
    work.wavesplat("convert elsewhere/b.npy -o elsewhere/2.wspl").ok();
    assert!(work.read("1.wspl") == work.read("elsewhere/2.wspl"), "the path is in the file");
    for (i, other) in ["--tolerance 0.02", "--basis multi", "--window 16", "--bound rms", "--level 9", "--range 0,9"]
        .iter()
        .enumerate()
    {
        work.wavesplat(&format!("convert a.npy -o o{i}.wspl {other}")).ok();
        assert!(work.read("1.wspl") != work.read(&format!("o{i}.wspl")), "{other}");
        work.wavesplat(&format!("verify o{i}.wspl --against a.npy")).ok();
    }
}

#[test]
fn a_file_is_made_best_for_what_is_read_most() {
    let (work, archive) = (Work::new(), small());
    work.write("a.npy", archive.npy());
    for (options, window, block) in [
        ("", 32, 20),
        ("--best-for series", 128, 20),
        ("--best-for pictures", 8, 20),
        ("--best-for size", 32, 20),
        ("--best-for series --window 16 --block 8", 16, 8),
    ] {
        work.wavesplat(&format!("convert a.npy -o a.wspl --force {options}")).ok();
        let told = work.wavesplat("info a.wspl").ok();
        let has = |name: &str, number: usize| {
            told.text().contains(&format!("--{name}={number}\n"))
                || told.text().contains(&format!("--{name}={number} "))
        };
        assert!(has("window", window) && has("block", block), "{options}: {}", told.text());
        work.wavesplat("verify a.wspl --against a.npy").ok();
    }
    work.wavesplat("convert a.npy -o b.wspl --best-for speed").fails(2, &["best-for", "series", "pictures", "size"]);
}

#[test]
fn the_report_is_one_json_object() {
    let work = Work::new();
    work.write("a.npy", small().npy());
    let run = work.wavesplat("convert a.npy -o a.wspl --json").ok();
    let report = run.json();
    assert_eq!(report["frames"], 40);
    assert_eq!(report["windows"], 2);
    assert_eq!(report["output_bytes"], work.read("a.wspl").len());
    assert!(report["reached"].as_f64().unwrap() <= report["delta"].as_f64().unwrap());
    assert!(run.err.contains("40 frames"), "the note is on standard error: {}", run.err);
    let quiet = work.wavesplat("convert a.npy -o b.wspl -q").ok();
    assert!(quiet.out.is_empty() && quiet.err.is_empty(), "{quiet:?}");
    let both = work.wavesplat("convert a.npy -o - --json -q").ok();
    assert!(both.out == work.read("a.wspl"), "data alone on standard output");
    assert!(both.err.contains("\"output_bytes\""));
}
