//! Inputs and outputs that fail: the exit code, a message with file, place and reason, and no files left behind.

use super::{Archive, Work, npy, npy_ordered, small};

#[test]
fn inputs_that_contradict_their_headers_give_code_3() {
    let work = Work::new();
    let archive = small();
    work.write("a.raw", archive.bytes());
    work.write("short.npy", &archive.npy()[..20_000]);
    work.write("header.npy", &archive.npy()[..60]);
    work.write("fortran.npy", npy_ordered("<f4", "40, 10, 14, 20", "True", &archive.bytes()));
    work.write("complex.npy", npy("<c8", "20, 10, 14, 20", &archive.bytes()));
    work.write("flat.npy", npy("<f4", "112000,", &archive.bytes()));
    work.write("foreign.npy", "not an array at all, but text with this name");
    work.write("empty.npy", "");
    let cases: [(&str, &[&str]); 9] = [
        ("a.raw --dims 20x14x11x40 --dtype f32", &["a.raw", "expected 492800", "found 448000"]),
        ("a.raw --dims 20x14x10 --dtype f32", &["a.raw", "--dims 20x14x10x40"]),
        ("a.raw --dims 20x14x10x40 --dtype f64", &["a.raw", "found 448000", "20 whole frame(s)"]),
        ("short.npy", &["short.npy", "expected 448128", "found 20000"]),
        ("header.npy", &["header.npy", "header"]),
        ("complex.npy", &["complex.npy", "f4"]),
        ("flat.npy", &["flat.npy", "(t, z, y, x)"]),
        ("foreign.npy", &["foreign.npy", "npy"]),
        ("empty.npy", &["empty.npy"]),
    ];
    let names = work.names();
    for (input, words) in cases {
        work.wavesplat(&format!("convert {input} -o out.wspl")).fails(3, words);
        assert_eq!(work.names(), names, "{input}");
    }
    let stream = work.shell("cat fortran.npy | $WAVESPLAT convert - -o out.wspl");
    stream.fails(3, &["Fortran", "ascontiguousarray"]);
}

#[test]
fn frames_that_do_not_belong_together_give_code_3() {
    let (work, archive) = (Work::new(), Archive::smooth([9, 8, 7], 6));
    archive.write_frames(&work, "frames");
    std::fs::remove_file(work.path("frames/f_3.npy")).unwrap();
    work.wavesplat("convert frames -o out.wspl").fails(3, &["f_2.npy", "f_4.npy", "missing", "--allow-gaps"]);
    work.wavesplat("convert frames -o out.wspl --allow-gaps").ok();
    work.write("frames/f_3.npy", Archive::smooth([9, 8, 6], 1).frame_npy(0));
    work.wavesplat("convert frames -o out.wspl --force").fails(3, &["f_3.npy", "9x8x6", "9x8x7", "f_0.npy"]);
    work.write("frames/f_3.npy", npy("<f8", "7, 8, 9", &[0; 9 * 8 * 7 * 8]));
    work.wavesplat("convert frames -o out.wspl --force").fails(3, &["f_3.npy", "f64", "f32"]);
    work.write("frames/other.raw", "x");
    assert_eq!(work.names(), ["frames", "out.wspl"]);
}

#[test]
fn no_output_replaces_an_input() {
    let (work, archive) = (Work::with_file(""), Archive::smooth([9, 8, 7], 6));
    archive.write_frames(&work, "frames");
    let before = |name: &str| std::fs::read(work.path(name)).unwrap();
    let (frame, whole, file) = (before("frames/f_3.npy"), before("a.npy"), before("a.wspl"));
    for command in [
        "convert a.npy -o a.npy --force",
        "convert a.npy -o frames/../a.npy --force",
        "convert frames -o frames/f_3.npy --force",
        "convert frames/f_*.npy -o frames/f_3.npy --force",
        "extract a.wspl -o a.wspl --format raw --force",
    ] {
        work.wavesplat(command).fails(2, &["would replace the input"]);
    }
    for command in ["a.wspl -o a.wspl --format npy --force", "frames --method direct -o frames/f_%d.npy --force"] {
        work.render(command).fails(2, &["would replace the input"]);
    }
    work.wavesplat("convert frames -o frames/out.wspl --force").ok();
    assert!(before("frames/f_3.npy") == frame && before("a.npy") == whole && before("a.wspl") == file);
}

#[test]
fn missing_files_give_code_1() {
    let work = Work::with_file("");
    work.wavesplat("convert absent.npy -o out.wspl").fails(1, &["absent.npy", "No such file"]);
    work.wavesplat("convert a.npy absent.npy -o out.wspl").fails(1, &["absent.npy", "No such file"]);
    for command in ["info absent.wspl", "verify absent.wspl", "extract absent.wspl -o b.npy"] {
        work.wavesplat(command).fails(1, &["absent.wspl", "No such file"]);
    }
    work.render("absent.wspl -o b.npy").fails(1, &["absent.wspl", "No such file"]);
    assert_eq!(work.names(), ["a.npy", "a.wspl"]);
}

#[test]
fn outputs_that_cannot_be_written_give_code_1() {
    let work = Work::with_file("");
    for place in ["a.npy/out", "absent/out", "/proc/out"] {
        work.wavesplat(&format!("convert a.npy -o {place}.wspl")).fails(1, &[place]);
        work.wavesplat(&format!("extract a.wspl -o {place}.npy")).fails(1, &[place]);
        work.render(&format!("a.wspl --size 20x20 -o {place}.npy")).fails(1, &[place]);
        work.render(&format!("a.wspl --size 20x20 -o {place}_%d.png")).fails(1, &[place]);
    }
    assert_eq!(work.names(), ["a.npy", "a.wspl"]);
}

#[cfg(target_os = "linux")]
#[test]
fn a_full_disk_gives_code_1() {
    let work = Work::with_file("--tolerance 0");
    let reason = ["/dev/full", "No space left"];
    work.wavesplat("convert a.npy -o /dev/full").fails(1, &reason);
    work.wavesplat("extract a.wspl -o /dev/full --format raw").fails(1, &reason);
    work.render("a.wspl --size 20x20 -o /dev/full --format npy").fails(1, &reason);
    for line in [
        "$WAVESPLAT convert a.npy -o -",
        "$WAVESPLAT extract a.wspl -o -",
        "$WAVESPLAT info a.wspl",
        "$WAVESPLAT verify a.wspl",
        "$RENDER a.wspl -o -",
    ] {
        work.shell(&format!("{line} > /dev/full")).fails(1, &["-: ", "No space left"]);
    }
}

#[test]
fn missing_values_are_refused_with_their_position_or_kept() {
    let (work, mut archive) = (Work::new(), small());
    let at = |x: usize, y: usize, z: usize, t: usize| t * 2800 + (z * 14 + y) * 20 + x;
    archive.values[at(4, 5, 6, 33)] = f32::NAN;
    archive.values[at(5, 5, 6, 33)] = f32::NEG_INFINITY;
    archive.values[at(0, 0, 9, 39)] = f32::NAN;
    work.write("nan.npy", archive.npy());
    let place = ["nan.npy", "frame 33", "x 4, y 5, z 6", "first of 3", "--missing mask"];
    work.wavesplat("convert nan.npy -o out.wspl").fails(3, &place);
    work.wavesplat("convert nan.npy -o out.wspl --missing mask").fails(2, &["out.wspl.part", "32 frames", "--force"]);
    let args = "convert - -o out.wspl --force";
    work.piped(args, &archive.npy()).fails(3, &["frame 33", "x 4, y 5, z 6", "first of 3"]);
    assert_eq!(work.names(), ["nan.npy", "out.wspl.part"]);
    work.wavesplat("convert nan.npy -o out.wspl --missing mask --resume")
        .fails(2, &["another missing: error, now mask"]);
    work.wavesplat("convert nan.npy -o out.wspl --missing mask --force").ok();
    let report = work.wavesplat("verify out.wspl --against nan.npy --json").ok().json();
    assert_eq!(report["against"]["missing"], 3);
    work.wavesplat("extract out.wspl -o out.raw").ok();
    let decoded = work.read("out.raw");
    for i in [at(4, 5, 6, 33), at(5, 5, 6, 33), at(0, 0, 9, 39)] {
        assert_eq!(decoded[4 * i..][..4], archive.values[i].to_le_bytes(), "the same bits");
    }
    work.write("all.npy", npy("<f4", "9, 4, 4, 4", &f32::NAN.to_le_bytes().repeat(9 * 64)));
    work.wavesplat("convert all.npy -o all.wspl --missing mask").ok();
    work.wavesplat("verify all.wspl --against all.npy").ok();
    work.wavesplat("info all.wspl --json").ok().json();
    work.render("all.wspl --size 20x20 -o all_%d.png").ok();
}

#[test]
fn a_declared_missing_value_is_kept() {
    let (work, mut archive) = (Work::new(), small());
    archive.values[1234] = -999.0;
    work.write("a.npy", archive.npy());
    work.wavesplat("convert a.npy -o out.wspl --missing-value -999 --missing error")
        .fails(3, &["frame 0", "--missing mask"]);
    work.wavesplat("convert a.npy -o out.wspl --missing-value -999").ok();
    assert_eq!(work.wavesplat("info out.wspl --json").ok().json()["missing"], 1);
    assert!(work.wavesplat("info out.wspl --json").ok().json()["value_range"][0].as_f64().unwrap() > -2.0);
    work.wavesplat("verify out.wspl --against a.npy").ok();
}
