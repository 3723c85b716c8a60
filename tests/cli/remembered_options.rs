//! A file remembers the options by which its frames were read, for converting again, appending and verifying.

use super::{Archive, Work, small};

const OPTIONS: &str =
    "--dims 20x14x10x40 --dtype f32 --endian big --offset 8 --spacing 1,2,0.5 --origin=-3,0,1e-7 --region 2:18,:,1:9";

/// Samples with their most significant byte first, after eight other bytes.
fn headerless(archive: &Archive) -> Vec<u8> {
    b"a header".iter().copied().chain(archive.values.iter().flat_map(|v| v.to_be_bytes())).collect()
}

/// The frames from `first` to `end`.
pub(super) fn part(archive: &Archive, first: usize, end: usize) -> Archive {
    let voxels = archive.frame_len();
    Archive { frames: end - first, values: archive.values[first * voxels..end * voxels].to_vec(), ..archive.clone() }
}

/// The options that a file remembers.
fn options_of(work: &Work, file: &str) -> String {
    let info = work.wavesplat(&format!("info {file} --json")).ok().json();
    let options = info["options"].as_object().unwrap();
    options.iter().map(|(name, value)| format!(" --{name}={}", value.as_str().unwrap())).collect()
}

#[test]
fn remembered_options_reproduce_the_file() {
    let work = Work::new();
    work.write("a.raw", headerless(&small()));
    let axes = format!("{}/tests/golden/inputs/hdf5/axes_xyzt.h5", env!("CARGO_MANIFEST_DIR"));
    for (input, options, said) in [
        ("a.raw", OPTIONS.to_string(), "--dims=20x14x10x40 --dtype=f32 --endian=big"),
        ("a.raw", format!("{OPTIONS} --transfer-function turbo"), "--transfer-function=turbo"),
        (&axes, "--axes xyzt --spacing 2,2,2".into(), "--axes=xyzt"),
    ] {
        work.wavesplat(&format!("convert {input} -o a.wspl --force {options}")).ok();
        let again = options_of(&work, "a.wspl");
        assert!(again.contains(said), "{again}");
        assert!(work.wavesplat("info a.wspl").ok().text().contains(&format!("made by    convert{again}")), "{again}");
        work.wavesplat(&format!("convert {input} -o b.wspl --force{again}")).ok();
        assert!(work.read("a.wspl") == work.read("b.wspl"), "{options}");
        work.wavesplat(&format!("verify a.wspl --against {input}")).ok();
    }
}

#[test]
fn append_and_verify_read_frames_with_the_remembered_options() {
    let (work, all) = (Work::new(), small());
    let parts = [part(&all, 0, 32), part(&all, 32, 37), part(&all, 37, 40)];
    for (name, part) in ["a", "b", "c"].iter().zip(&parts) {
        work.write(&format!("{name}.raw"), headerless(part));
        work.write(&format!("{name}.npy"), part.npy());
    }
    let first = OPTIONS.replace("x40", "x32");
    work.wavesplat(&format!("convert a.raw -o a.wspl {first}")).ok();
    work.wavesplat("append a.wspl b.raw").ok();
    work.shell("cat c.raw | $WAVESPLAT append a.wspl -").ok();
    work.write("all.raw", headerless(&all));
    work.write("all.npy", all.npy());
    for source in ["all.raw", "all.npy"] {
        let report = work.wavesplat(&format!("verify a.wspl --against {source} --json")).ok().json();
        assert_eq!(report["against"]["samples"], 16 * 14 * 8 * 40, "{source}");
    }
    work.wavesplat(&format!("convert a.raw -o n.wspl {first}")).ok();
    work.wavesplat("append n.wspl b.npy").ok();
    work.shell("cat c.npy | $WAVESPLAT append n.wspl -").ok();
    assert!(work.read("a.wspl") == work.read("n.wspl"));
}

#[test]
fn given_options_override_remembered_ones() {
    let (work, all) = (Work::new(), small());
    work.write("a.raw", headerless(&all));
    work.write("plain.raw", all.bytes());
    work.wavesplat(&format!("convert a.raw -o a.wspl {OPTIONS}")).ok();
    work.wavesplat("verify a.wspl --against plain.raw").fails(3, &["plain.raw", "expected"]);
    work.wavesplat("verify a.wspl --against plain.raw --endian little --offset 0").ok();
    work.wavesplat("verify a.wspl --against a.raw --dims 20x14x10x39").fails(3, &["expected 436808"]);
    work.wavesplat("verify a.wspl --against a.raw --dtype f64").fails(3, &["expected 896008"]);
}

#[test]
fn a_remembered_variable_is_ignored_by_files_with_one_array_without_a_name() {
    let work = Work::new();
    let named = format!("{}/tests/golden/inputs/hdf5/axes_xyzt.h5", env!("CARGO_MANIFEST_DIR"));
    work.wavesplat(&format!("convert {named} -o a.wspl --variable density --tolerance 0")).ok();
    work.wavesplat("extract a.wspl -o a.npy").ok();
    work.wavesplat("verify a.wspl --against a.npy").ok();
    work.wavesplat("verify a.wspl --against a.npy --variable density").fails(2, &["--variable", "a.npy"]);
}
