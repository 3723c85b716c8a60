//! Files of colours in the programs: reports, refusals and resuming.

use super::{Archive, Run, Work, floats, npy, places_of, read_npy};

/// Writes an archive `a.npy` with values beyond the colour map's, and a transfer function `a.csv`.
fn work() -> (Work, Archive) {
    let (work, archive) = (Work::new(), Archive::smooth([20, 14, 10], 40));
    work.write("a.npy", archive.npy());
    (work, archive)
}

/// Like the above, with a file of colours `a.wspl`.
fn with_file(more: &str) -> (Work, Archive) {
    let (work, archive) = work();
    work.wavesplat(&format!("convert a.npy -o a.wspl --transfer-function rainbow --range -1,1.5 {more}")).ok();
    (work, archive)
}

/// The red, green or blue of the paper's map: from blue over cyan, green and yellow to red.
fn rainbow(value: f32, channel: usize) -> f64 {
    let share = ((f64::from(value) + 1.0) / 2.5).clamp(0.0, 1.0);
    let ramp = |from: f64, to: f64| ((share - from) / (to - from)).clamp(0.0, 1.0);
    [ramp(0.5, 0.75), ramp(0.0, 0.25) * ramp(1.0, 0.75), ramp(0.5, 0.25)][channel]
}

#[test]
fn channels_are_extracted_by_name_and_keep_their_bound() {
    let (work, archive) = with_file("--tolerance 0.01 --window 8");
    for (number, name) in ["red", "green", "blue"].into_iter().enumerate() {
        work.wavesplat(&format!("extract a.wspl --channel {name} -o {name}.npy")).ok();
        work.wavesplat(&format!("extract a.wspl --channel {number} -o {name}.raw")).ok();
        let (header, bytes) = read_npy(&work.read(&format!("{name}.npy")));
        assert!(header.contains("'<f4'") && header.contains("(40, 10, 14, 20)"), "{header}");
        assert!(bytes == work.read(&format!("{name}.raw")));
        for (found, value) in floats(&bytes).into_iter().zip(&archive.values) {
            let off = (f64::from(found) - rainbow(*value, number)).abs();
            assert!(off <= 0.01 + 1e-6, "{name}: {found} for {value}");
        }
    }
    let part = work.wavesplat("extract a.wspl --channel red --frames 9 --region 3:8,:,2:4 -o - --format raw").ok();
    assert_eq!(part.out.len(), 4 * 5 * 14 * 2);
    work.wavesplat("extract a.wspl -o b.npy").fails(2, &["a.wspl", "holds colours", "--channel", "red, green, blue"]);
    work.wavesplat("extract a.wspl --channel mauve -o b.npy").fails(2, &["--channel", "one of red, green, blue"]);
    work.wavesplat("convert a.npy -o plain.wspl").ok();
    work.wavesplat("extract plain.wspl --channel red -o b.npy").fails(2, &["--channel", "plain.wspl holds values"]);
    assert!(!work.path("b.npy").exists());
}

#[test]
fn info_and_verify_report_the_colours() {
    let (work, archive) = with_file("");
    let info = work.wavesplat("info a.wspl").ok();
    assert!(
        info.text().contains("colours    3 channels: red, green, blue by rainbow from -1 to 1.5"),
        "{}",
        info.text()
    );
    let info = work.wavesplat("info a.wspl --json").ok().json();
    assert_eq!((info["channels"].as_u64(), info["raw_bytes"].as_u64()), (Some(3), Some(4 * 2800 * 40)));
    assert_eq!(
        (info["colours"].as_str(), &info["range"]),
        (Some("rainbow from -1 to 1.5"), &serde_json::json!([0.0, 1.0]))
    );
    let verified = work.wavesplat("verify a.wspl --against a.npy --json").ok().json();
    assert_eq!(verified["against"]["samples"].as_u64(), Some(3 * 2800 * 40));
    assert!(["red", "green", "blue"].contains(&verified["against"]["worst"]["channel"].as_str().unwrap()));
    let mut other = archive.clone();
    other.values[5000] += 1.0;
    work.write("other.npy", other.npy());
    let run = work.wavesplat("verify a.wspl --against other.npy");
    run.finds(4, &["series outside the bound", "frame 1,"]);
}

#[test]
fn a_named_map_takes_the_range_of_all_frames_and_needs_one_for_a_pipe() {
    let (work, archive) = work();
    let range = archive.values.iter().fold((f32::MAX, f32::MIN), |(lo, hi), v| (lo.min(*v), hi.max(*v)));
    work.wavesplat("convert a.npy -o a.wspl --transfer-function viridis").ok();
    work.wavesplat(&format!(
        "convert a.npy -o given.wspl --transfer-function viridis --range {:?},{:?}",
        f64::from(range.0),
        f64::from(range.1)
    ))
    .ok();
    assert!(work.read("a.wspl") == work.read("given.wspl"));
    let pipe = work.shell("cat a.npy | $WAVESPLAT convert - -o b.wspl --transfer-function viridis");
    pipe.fails(2, &["--transfer-function viridis", "standard input", "--range LO,HI"]);
    let given = format!("--range {:?},{:?}", f64::from(range.0), f64::from(range.1));
    work.shell(&format!("cat a.npy | $WAVESPLAT convert - -o b.wspl --transfer-function viridis {given}")).ok();
    assert!(work.read("a.wspl") == work.read("b.wspl"));
    let refused = |args: &str| work.wavesplat(&format!("convert a.npy -o c.wspl --transfer-function {args}"));
    refused("no-such-map").fails(2, &["no-such-map", "viridis"]);
    refused("viridis --range 2,1").fails(2, &["--range"]);
    work.write("flat.npy", Archive::of([4, 4, 4], 3, |_, _, _, _| 2.5).npy());
    work.wavesplat("convert flat.npy -o flat.wspl --transfer-function grey").ok();
    let flat = work.wavesplat("extract flat.wspl --channel green -o - --format raw").ok();
    assert!(floats(&flat.out).into_iter().all(|v| v == 0.0));
}

#[test]
fn neither_threads_nor_kills_nor_appends_change_a_byte_and_other_colours_are_refused() {
    let settings = [
        "--window 8",
        "--window 8 --basis haar --bound relative --floor 0.1",
        "--basis multi --window 9 --bound sampled",
    ];
    for settings in settings {
        let (work, archive) = with_file(settings);
        let whole = work.read("a.wspl");
        let convert = format!("convert a.npy --transfer-function rainbow --range -1,1.5 {settings}");
        work.wavesplat(&format!("{convert} -o b.wspl --threads 1")).ok();
        work.wavesplat(&format!("{convert} -o c.wspl --threads 5")).ok();
        assert!(work.read("b.wspl") == whole && work.read("c.wspl") == whole, "{settings}");
        for cut in [200, whole.len() / 3, whole.len() / 2, whole.len() * 4 / 5, whole.len() - 1] {
            work.write("d.wspl.part", &whole[..cut]);
            work.wavesplat(&format!("{convert} -o d.wspl --resume")).ok();
            assert!(work.read("d.wspl") == whole, "{settings} cut at {cut}");
            std::fs::remove_file(work.path("d.wspl")).unwrap();
        }
        work.write("d.wspl.part", &whole[..whole.len() * 4 / 5]);
        let other = convert.replace("1.5", "1.25");
        work.wavesplat(&format!("{other} -o d.wspl --resume"))
            .fails(2, &["d.wspl", "another transfer function: rainbow -1.0 1.5, now rainbow -1.0 1.25"]);
        let mut changed = archive.clone();
        changed.values[1000] += 1e-3;
        work.write("changed.npy", changed.npy());
        let changed = convert.replace("a.npy", "changed.npy");
        work.wavesplat(&format!("{changed} -o d.wspl --resume")).fails(4, &["frames 0..", "not those"]);
        append(&work, &archive, &convert, &whole);
    }
}

fn append(work: &Work, archive: &Archive, convert: &str, whole: &[u8]) {
    let frames = if convert.contains("multi") { 18 } else { 16 };
    let some = |range: std::ops::Range<usize>| {
        let bytes: Vec<u8> = range.clone().flat_map(|frame| archive.frame_bytes(frame)).collect();
        npy("<f4", &format!("{}, 10, 14, 20", range.len()), &bytes)
    };
    work.write("first.npy", some(0..frames));
    work.write("rest.npy", some(frames..40));
    work.wavesplat(&format!("{} -o grown.wspl", convert.replace("a.npy", "first.npy"))).ok();
    work.wavesplat("append grown.wspl rest.npy").ok();
    assert!(work.read("grown.wspl") == whole, "{convert}");
    work.wavesplat("append grown.wspl rest.npy").fails(2, &["grown.wspl", "ends with these frames"]);
    work.wavesplat("verify grown.wspl --against a.npy").ok();
}

#[test]
fn missing_samples_have_no_colour() {
    let mut archive = Archive::smooth([12, 10, 8], 9);
    archive.values.iter_mut().enumerate().filter(|(i, _)| i % 13 == 5).for_each(|(_, v)| *v = -9999.0);
    archive.values[77] = f32::NAN;
    let work = Work::new();
    work.write("a.npy", archive.npy());
    let convert = "convert a.npy -o a.wspl --transfer-function rainbow --window 8";
    work.wavesplat(&format!("{convert} --missing-value -9999 --missing error"))
        .fails(3, &["missing value", "x 5, y 0"]);
    work.wavesplat(&format!("{convert} --missing-value -9999")).ok();
    work.wavesplat("verify a.wspl --against a.npy").ok();
    let info = work.wavesplat("info a.wspl --json").ok().json();
    let missing = archive.values.iter().filter(|v| **v == -9999.0 || v.is_nan()).count();
    assert_eq!(info["missing"].as_u64(), Some(3 * missing as u64));
    assert_eq!(info["missing_value"], serde_json::Value::Null);
    let red = work.wavesplat("extract a.wspl --channel red -o - --format raw").ok();
    for (found, value) in floats(&red.out).into_iter().zip(&archive.values) {
        assert_eq!(found.is_nan(), *value == -9999.0 || value.is_nan());
    }
    work.wavesplat(&format!("{convert} --missing-value -9998 --resume --missing mask")).fails(2, &["other settings"]);
}

/// The pixel values of an `.npy`.
fn pixels(work: &Work, name: &str, shape: &str) -> Vec<f32> {
    let (header, bytes) = read_npy(&work.read(name));
    assert!(header.contains(shape) && header.contains("'<f4'"), "{header}");
    floats(&bytes)
}

#[test]
fn pictures_have_three_numbers_a_pixel_and_fixed_colours() {
    let (work, _) = with_file("--tolerance 0.01 --window 8");
    let view = "--size 40x30 --frames 3,20";
    work.render(&format!("a.wspl -o a.npy.npy {view} --error-image error.npy")).ok();
    let of_file = pixels(&work, "a.npy.npy", "(2, 30, 40, 3)");
    let errors = pixels(&work, "error.npy", "(2, 30, 40, 3)");
    work.render(&format!("a.npy --method direct --transfer-function rainbow --range -1,1.5 -o b.npy {view}")).ok();
    let direct = pixels(&work, "b.npy", "(2, 30, 40, 3)");
    assert!(direct.iter().any(|v| *v > 0.5) && direct.iter().any(|v| v.is_nan()));
    for ((a, b), error) in of_file.iter().zip(&direct).zip(&errors) {
        assert!(a.is_nan() == b.is_nan() && (a.is_nan() || (a - b).abs() <= error + 2e-3), "{a} {b} {error}");
    }
    work.render(&format!("a.wspl --method direct -o c.npy {view}")).ok();
    pixels(&work, "c.npy", "(2, 30, 40, 3)");
    work.render(&format!("a.wspl -o a.rgb24 {view}")).ok();
    work.render(&format!("a.wspl -o plain.npy {view}")).ok();
    work.render(&format!("a.wspl -o sums.rgb24 {view} --quantity emission --error-image errors_%02d.png")).ok();
    let (mean, sums) = (work.read("a.rgb24"), work.read("sums.rgb24"));
    let byte = |v: f32| if v.is_nan() { 0 } else { (f64::from(v).clamp(0.0, 1.0) * 255.0).round() as u8 };
    assert!(
        mean == pixels(&work, "plain.npy", "(2, 30, 40, 3)").iter().map(|v| byte(*v)).collect::<Vec<_>>(),
        "0 to 1 as it is"
    );
    assert!(sums.len() == mean.len() && sums.contains(&0) && sums.iter().any(|v| *v > 200));
    work.render(&format!("a.wspl -o turn%v_%02d.png {view} --orbit 2 --range 0,0.5")).ok();
    assert!(work.path("turn1_20.png").exists() && work.path("errors_03.png").exists());
}

#[test]
fn options_without_meaning_for_colours_are_refused() {
    let (work, _) = with_file("");
    let refused = |args: &str, words: &[&str]| {
        work.render(args).fails(2, words);
    };
    refused("a.wspl -o a.png --frames 0 --colormap turbo", &["--colormap", "the colours are fixed"]);
    refused("a.wspl -o a.gray16", &["gray16", "three"]);
    refused("a.wspl -o b.npy --transfer-function viridis", &["--transfer-function", "--mode composite"]);
    refused("a.npy --method direct --transfer-function no-such -o b.npy", &["no-such"]);
    work.wavesplat("convert a.npy -o plain.wspl").ok();
    refused("plain.wspl -o b.npy --transfer-function viridis", &["--transfer-function", "--mode composite"]);
    refused("a.wspl -o b.npy --size 900x900 --memory 10MiB", &["--memory", "at least"]);
}

#[test]
fn damaged_channels_are_named_left_out_and_recovered() {
    let (work, _) = with_file("--block 8 --window 8");
    let file = work.read("a.wspl");
    let mut bad = file.clone();
    let blocks = places_of(&file, b"BLCK");
    let above = 2 + 1; // in every channel
    assert_eq!(blocks.len(), 5 * 3 * (above + 3 * 2 * 2));
    let lost = 3 * above + 12 + 5; // in the first window's second channel
    let middle = blocks[lost].midpoint(blocks[lost + 1]);
    bad[middle..middle + 8].iter_mut().for_each(|byte| *byte ^= 0x55);
    work.write("bad.wspl", &bad);
    work.wavesplat("verify bad.wspl").finds(3, &["bad.wspl", "channel 1"]);
    let shown = work.wavesplat("extract bad.wspl --channel green --skip-damaged -o green.raw");
    shown.fails(3, &["1 damaged blocks", "channel 1"]);
    work.wavesplat("extract bad.wspl --channel red --skip-damaged -o red.raw").ok();
    let gaps = |name: &str| floats(&work.read(name)).iter().filter(|v| v.is_nan()).count();
    assert!(gaps("green.raw") > 0 && gaps("red.raw") == 0);
    work.render("bad.wspl --skip-damaged -o bad.npy --size 40x30 --frames 3").fails(3, &["1 damaged blocks"]);
    let run: Run = work.wavesplat("recover bad.wspl -o saved.wspl --json");
    let lost = serde_json::json!([{ "window": 0, "frames": [0, 8], "first": 5, "last": 5, "channel": "green" }]);
    assert_eq!(run.json()["lost"], lost);
    run.finds(3, &["1 of 225 blocks are lost"]);
    let said = work.wavesplat("recover bad.wspl -o saved2.wspl").finds(3, &["lost"]);
    assert!(said.code == Some(3));
    work.wavesplat("verify saved.wspl").finds(3, &["saved.wspl"]);
}
