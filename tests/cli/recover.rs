//! Recovery of damaged files: intact blocks are recovered and shown; lost blocks are named and never shown as data.

use super::{Archive, Run, Work, floats, places_of, read_npy};
use wavesplat::file::CoefficientFile;

/// Five windows of eight frames, in 24 blocks each.
fn work() -> (Work, Vec<u8>) {
    let work = Work::new();
    work.write("a.npy", Archive::smooth([24, 14, 10], 40).npy());
    work.wavesplat("convert a.npy -o a.wspl --window 8 --block 6 --tolerance 1e-3").ok();
    let file = work.read("a.wspl");
    (work, file)
}

fn of_place(file: &[u8], tag: &[u8; 4], number: usize) -> usize {
    places_of(file, tag)[number]
}

/// Blocks of a window that lie above those of all voxels, and all.
const ABOVE: usize = 5;
const ALL: usize = ABOVE + 24;

#[test]
fn without_its_directory_a_file_is_recovered_to_the_same_bytes() {
    let (work, file) = work();
    let len = file.len();
    for cut in [1, 100, 127] {
        work.write("cut.wspl", &file[..len - cut]);
        work.wavesplat("recover cut.wspl -o saved.wspl --force").ok();
        assert!(work.read("saved.wspl") == file, "cut by {cut}");
    }
    for (tag, number) in
        [(b"ROOT", 0), (b"LEAF", 0), (b"LEAF", 4), (b"STRT", 0), (b"WNDW", 2), (b"WEND", 4), (b"BLCK", 50)]
    {
        let mut bad = file.clone();
        bad[of_place(&file, tag, number) + 20] ^= 1; // in the checksum of its frame
        work.write("bad.wspl", &bad);
        work.wavesplat("verify bad.wspl").fails_or_finds(3, &["bad.wspl", "byte"]);
        work.wavesplat("recover bad.wspl -o saved.wspl --force").ok();
        assert!(work.read("saved.wspl") == file, "{} damaged", String::from_utf8_lossy(tag));
    }
    let mut bad = file.clone();
    bad[..64].fill(0);
    work.write("bad.wspl", &bad);
    work.wavesplat("recover bad.wspl -o saved.wspl --force").ok();
    assert!(work.read("saved.wspl") == file, "without a header, by the footer's id");
}

/// Blocks of labels are lists, which need none above them: only the header tells that there might be some.
#[test]
fn a_file_of_labels_has_no_tiers_and_is_recovered_to_itself() {
    let work = Work::new();
    let label =
        |x: usize, y: usize, z: usize, t: usize| ((x / 3 + 1) * (y / 3 + 2) * (z / 3 + 3) * (t / 4 + 5) % 7) as f32;
    work.write("a.npy", Archive::of([20, 24, 21], 16, label).npy());
    work.wavesplat("convert a.npy -o a.wspl --block 8").ok();
    let file = work.read("a.wspl");
    assert_eq!((file[16], CoefficientFile::open(work.path("a.wspl")).unwrap().metadata().tiers(0)), (0b1101, 0));
    let mut bad = file.clone();
    bad[..64].fill(0);
    work.write("bad.wspl", &bad);
    for name in ["a.wspl", "bad.wspl"] {
        work.wavesplat(&format!("recover {name} -o saved.wspl --force")).ok();
        assert!(work.read("saved.wspl") == file, "{name}");
    }
    work.wavesplat("extract a.wspl -o b.npy").ok();
    assert!(work.read("b.npy").ends_with(&work.read("a.npy")[128..]), "exactly");
}

#[test]
fn a_file_that_lost_its_second_half_keeps_the_windows_of_the_first() {
    let (work, file) = work();
    work.write("half.wspl", &file[..of_place(&file, b"WEND", 1) + 100]);
    let run = work.wavesplat("recover half.wspl -o saved.wspl").finds(3, &["half.wspl", "its end is missing"]);
    assert!(run.err.contains("any later frames"));
    work.wavesplat("verify saved.wspl").ok();
    work.wavesplat("extract saved.wspl -o saved.raw").ok();
    work.wavesplat("extract a.wspl -o a.raw --frames 0:16").ok();
    assert!(work.read("saved.raw") == work.read("a.raw"));
    work.write("within.wspl", &file[..of_place(&file, b"BLCK", ALL + ABOVE + 20)]);
    let run = work.wavesplat("recover within.wspl -o within-saved.wspl --json");
    let report = run.json();
    run.finds(3, &["4 of 58 blocks are lost"]);
    let lost = serde_json::json!({ "window": 1, "frames": [8, 16], "first": 20, "last": 23 });
    assert_eq!((&report["blocks_lost"], &report["all_known"], &report["lost"][0]), (&4.into(), &false.into(), &lost));
    work.write("b.wspl.part", &file[..of_place(&file, b"WEND", 2)]);
    work.wavesplat("recover b.wspl.part -o b.wspl").fails(2, &["b.wspl", "would replace the input"]);
    work.wavesplat("recover b.wspl.part -o so-far.wspl -q").fails(3, &["b.wspl.part", "its end is missing"]);
    work.wavesplat("verify so-far.wspl").ok();
}

#[test]
fn a_file_that_lost_its_end_has_no_coordinates_and_recover_says_so() {
    let (work, _) = work();
    work.wavesplat("extract a.wspl -o a.nc").ok();
    work.wavesplat("convert a.nc -o b.wspl --window 8").ok();
    let file = work.read("b.wspl");
    let text = |run: &Run| String::from_utf8_lossy(&run.out).into_owned();
    let run = work.wavesplat("recover b.wspl -o whole.wspl");
    assert!(work.read("whole.wspl") == file && !text(&run).contains("coordinates"), "{}", text(&run));
    work.write("cut.wspl", &file[..of_place(&file, b"WEND", 2)]);
    let run = work.wavesplat("recover cut.wspl -o saved.wspl");
    assert!(text(&run).contains("lost: the coordinates and attributes of the source"), "{}", text(&run));
    run.finds(3, &["its end is missing"]);
    let json = work.wavesplat("recover cut.wspl -o again.wspl --json").json();
    assert_eq!(json["description_lost"], true);
}

#[test]
fn a_damaged_block_is_lost_and_all_others_are_shown() {
    let (work, file) = work();
    let mut bad = file.clone();
    let at = of_place(&file, b"BLCK", ALL + ABOVE + 7) + 300; // in a part of block 7 of window 1
    bad[at] ^= 1;
    work.write("bad.wspl", &bad);
    work.wavesplat("recover bad.wspl -o saved.wspl").finds(3, &["1 of 145 blocks are lost"]);
    work.wavesplat("verify saved.wspl").finds(3, &["window 1 block 7", "lost before the file was written"]);
    work.wavesplat("verify bad.wspl").finds(3, &["window 1 block 7", "checksum"]);
    let shown = |name: &str| {
        let reading = format!("extract {name} -o out.npy --force");
        work.wavesplat(&reading).fails(3, &[name, "window 1 block 7"]);
        work.wavesplat(&format!("{reading} --skip-damaged")).fails(3, &["1 damaged blocks were left out", "block 7"]);
        floats(&read_npy(&work.read("out.npy")).1)
    };
    let (saved, damaged) = (shown("saved.wspl"), shown("bad.wspl"));
    work.wavesplat("extract a.wspl -o out.npy --force").ok();
    let whole = floats(&read_npy(&work.read("out.npy")).1);
    let block = |i: usize| {
        let (frame, x, y, z) = (i / 3360, i % 24, i / 24 % 14, i / 336 % 10);
        (8..16).contains(&frame) && (18..24).contains(&x) && (6..12).contains(&y) && z < 6
    };
    for (i, v) in whole.iter().enumerate() {
        for found in [saved[i], damaged[i]] {
            assert!(
                if block(i) { found.is_nan() } else { found.to_bits() == v.to_bits() },
                "sample {i}: {found}, not {v}"
            );
        }
    }
    for name in ["saved.wspl", "bad.wspl"] {
        let rendering = format!("{name} --frames 10 --size 40x40 -o out.npy --force --splat-error 0");
        work.render(&rendering).fails(3, &[name, "window 1 block 7"]);
        work.render(&format!("{rendering} --skip-damaged --error-image e.npy")).fails(2, &["--error-image"]);
        work.render(&format!("{rendering} --skip-damaged")).fails(3, &["1 damaged blocks were left out"]);
        let skipped = floats(&read_npy(&work.read("out.npy")).1);
        work.wavesplat("extract bad.wspl -o frames.npy --force --skip-damaged").fails(3, &["left out"]);
        work.wavesplat("convert frames.npy -o nan.wspl --tolerance 0 --missing mask --force").ok();
        work.render(&rendering.replace(name, "nan.wspl")).ok();
        let masked = floats(&read_npy(&work.read("out.npy")).1);
        let same = |(a, b): (&f32, &f32)| a.is_nan() && b.is_nan() || (a - b).abs() <= 1e-6;
        assert!(skipped.iter().zip(&masked).all(same), "{name}: as if the block's samples were missing");
    }
    work.render("bad.wspl --frames 0 --size 40x40 -o first.npy").ok(); // this frame does not include the block
}

/// A block of tier 1 holds what is coarse in 2 x 2 x 2 blocks.
#[test]
fn a_damaged_block_above_others_loses_only_those_below_it() {
    let (work, file) = work();
    let mut bad = file.clone();
    let header = 24 + 64 + 56; // with one part at least
    bad[of_place(&file, b"BLCK", ALL + 1 + 1) + header + 56] ^= 1; // block 1 of tier 1 of window 1
    work.write("bad.wspl", &bad);
    let run = work.wavesplat("recover bad.wspl -o saved.wspl");
    let lost = run.text().to_string();
    run.finds(3, &["9 of 145 blocks are lost"]);
    assert!(lost.contains("window 1 (frames 8..16), blocks 1 to 1 of tier 1\n"), "{lost}");
    assert!(lost.contains("window 1 (frames 8..16), blocks 2 to 3\n"), "{lost}");
    let run = work.wavesplat("verify bad.wspl");
    assert!(run.text().contains("8 more blocks could not be decoded"), "{}", run.text());
    run.finds(3, &["damaged in 1 place", "block 1 channel 0 tier 1", "checksum"]);
    work.wavesplat("extract a.wspl -o whole.npy").ok();
    let whole = floats(&read_npy(&work.read("whole.npy")).1);
    for name in ["bad.wspl", "saved.wspl"] {
        work.wavesplat(&format!("extract {name} -o out.npy --force")).fails(3, &[name, "window 1"]);
        work.wavesplat(&format!("extract {name} -o out.npy --force --skip-damaged")).fails(3, &["8 damaged blocks"]);
        for (i, (found, v)) in floats(&read_npy(&work.read("out.npy")).1).iter().zip(&whole).enumerate() {
            let (frame, x, y) = (i / 3360, i % 24, i / 24 % 14);
            let is_below = (8..16).contains(&frame) && x >= 12 && y < 12;
            let same = if is_below { found.is_nan() } else { found.to_bits() == v.to_bits() };
            assert!(same, "{name}, sample {i}: {found}, not {v}");
        }
        work.wavesplat(&format!("extract {name} --frames 16:24 -o later.npy --force")).ok();
    }
}

#[test]
fn unrecoverable_files_are_reported() {
    let (work, file) = work();
    work.write("text.wspl", "hello\n".repeat(1000));
    work.wavesplat("recover text.wspl -o saved.wspl").fails(3, &["text.wspl", "nothing can be recovered"]);
    work.write("start.wspl", &file[..700]);
    work.wavesplat("recover start.wspl -o saved.wspl").fails(3, &["start.wspl", "nothing can be recovered"]);
    let mut newer = file.clone();
    newer[16] = 64; // a feature of a later version
    let sum = xxhash_rust::xxh3::xxh3_64(&newer[..120]).to_le_bytes();
    newer[120..128].copy_from_slice(&sum);
    work.write("newer.wspl", &newer);
    work.wavesplat("recover newer.wspl -o saved.wspl").fails(3, &["newer.wspl", "not supported", "feature bit 6"]);
    work.wavesplat("recover a.wspl -o a.wspl --force").fails(2, &["would replace the input"]);
    assert_eq!(work.names(), ["a.npy", "a.wspl", "newer.wspl", "start.wspl", "text.wspl"]);
}

/// As `convert` refuses it: readers would take the file for what its name says.
#[test]
fn an_output_named_like_another_format_is_refused_by_every_command_that_writes_coefficients() {
    let (work, _) = work();
    for name in ["b.nc", "b.NPY", "b.zarr", "b.nrrd"] {
        for command in ["convert a.npy", "convert a.wspl", "recover a.wspl", "merge a.wspl"] {
            work.wavesplat(&format!("{command} -o {name}")).fails(2, &["named .wspl", name]);
        }
    }
    assert_eq!(work.names(), ["a.npy", "a.wspl"]);
}
