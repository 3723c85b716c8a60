//! Warnings of conversions, and input that is refused because a value probably means "missing".

use super::{Archive, Run, Work, floats, npy, read_npy, small};

/// The small archive, changed voxel by voxel; `x` and the value.
fn changed(change: impl Fn(usize, f32) -> f32) -> Archive {
    let mut archive = small();
    archive.values.iter_mut().enumerate().for_each(|(i, v)| *v = change(i % 20, *v));
    archive
}

fn warnings(run: &Run) -> String {
    run.err.lines().filter(|line| line.starts_with("warning: ")).collect::<Vec<_>>().join("\n")
}

#[test]
fn a_fill_value_far_beyond_the_samples_is_refused() {
    let work = Work::new();
    for (fill, text) in [(1e20, "1e20"), (9.969_21e36, "9.96921e36"), (-9999.0, "-9999"), (-32768.0, "-32768")] {
        work.write("a.npy", changed(|x, v| if x < 4 { fill } else { v }).npy());
        let remedy = format!("--missing-value {text}");
        let said = ["a.npy", "17920 samples", &format!("exactly {text}"), &remedy].map(String::from);
        let words: Vec<&str> = said.iter().map(String::as_str).collect();
        work.wavesplat("convert a.npy -o a.wspl").fails(3, &words);
        assert_eq!(work.names(), ["a.npy"], "nothing is left");
        work.wavesplat(&format!("convert a.npy -o a.wspl {remedy}")).ok();
        for options in ["--max-error 0.01", "--tolerance 0", "--bound relative --floor 1", "--range 0,1"] {
            let run = work.wavesplat(&format!("convert a.npy -o b.wspl --force {options}")).ok();
            assert!(warnings(&run).contains(&format!("if it means missing, add {remedy}")), "{options}: {}", run.err);
        }
        std::fs::remove_file(work.path("a.wspl")).unwrap();
        std::fs::remove_file(work.path("b.wspl")).unwrap();
    }
}

#[test]
fn common_fill_values_among_temperatures_are_refused_by_default() {
    let work = Work::new();
    let fills = [-999.0, -9999.0, 9999.0, -99.9, -999.25, 1e30, f32::MAX, -32767.0, 32767.0, 65535.0, -1.073_741_8e9];
    for fill in fills {
        work.write("a.npy", changed(|x, v| if x < 4 { fill } else { 280.0 + 10.0 * v }).npy());
        let advice = ["samples are exactly", "--missing-value", "--max-error"];
        work.wavesplat("convert a.npy -o a.wspl").fails(3, &advice);
        work.wavesplat("convert a.npy -o a.wspl --max-error 0.1 --force").ok();
        work.wavesplat(&format!("convert a.npy -o a.wspl --missing-value {fill} --force")).ok();
        std::fs::remove_file(work.path("a.wspl")).unwrap();
    }
    let mut few = changed(|_, v| 280.0 + 10.0 * v);
    few.values[7] = -9999.0;
    few.values[9999] = -9999.0;
    work.write("a.npy", few.npy());
    work.wavesplat("convert a.npy -o a.wspl").fails(3, &["2 samples are exactly -9999"]);
}

#[test]
fn a_fill_value_in_a_later_window_is_refused_before_that_window() {
    let work = Work::new();
    let mut archive = small();
    archive.values[35 * 2800..36 * 2800].fill(1e20);
    work.write("a.npy", archive.npy());
    work.wavesplat("convert a.npy -o a.wspl").fails(3, &["frame", "--missing-value 1e20", "finished windows are kept"]);
    work.wavesplat("convert a.npy -o a.wspl --force --threads 1").fails(3, &["--missing-value 1e20"]);
}

#[test]
fn a_fill_value_near_the_samples_is_warned_of_and_ordinary_extremes_are_not() {
    let work = Work::new();
    let fills = |run: &Run| warnings(run).contains("means missing");
    work.write("a.npy", changed(|x, v| if x < 4 { -999.0 } else { 20.0 * v }).npy());
    let run = work.wavesplat("convert a.npy -o a.wspl --tolerance 1e-3 --json").ok();
    assert!(fills(&run), "{}", run.err);
    assert_eq!(run.json()["warnings"][0]["remedy"], "if it means missing, add --missing-value -999");
    type Change = Box<dyn Fn(usize, f32) -> f32>;
    let ordinary: [(&str, Change); 7] = [
        ("plain", Box::new(|_, v| v)),
        ("a background of 0", Box::new(|x, v| if x < 9 { 0.0 } else { 300.0 + v })),
        ("a hot body", Box::new(|x, v| if x < 4 { 1000.0 } else { 300.0 + v })),
        ("a mask", Box::new(|x, _| f32::from(u8::from(x < 4)))),
        ("a mask of huge numbers", Box::new(|x, _| if x < 4 { 1e20 } else { 0.0 })),
        ("saturated", Box::new(|_, v| (1000.0 * v).clamp(-32768.0, 999.0))),
        ("sparse", Box::new(|x, v| if x < 17 { 0.0 } else { v })),
    ];
    for (name, change) in ordinary {
        work.write("b.npy", changed(change).npy());
        let run = work.wavesplat("convert b.npy -o b.wspl --force").ok();
        assert!(!fills(&run), "{name}: {}", run.err);
    }
    let mut spike = small();
    spike.values[17] = 1e20;
    work.write("b.npy", spike.npy());
    assert!(!fills(&work.wavesplat("convert b.npy -o b.wspl --force").ok()), "a spike does not repeat");
    let bytes: Vec<u8> = small().values.iter().map(|v| if *v > 0.0 { 255 } else { (5.0 - 5.0 * v) as u8 }).collect();
    work.write("b.npy", npy("|u1", "40, 10, 14, 20", &bytes));
    assert!(!fills(&work.wavesplat("convert b.npy -o b.wspl --force").ok()), "saturated bytes");
}

#[test]
fn an_error_above_what_most_voxels_change_by_is_warned_of_and_its_remedy_helps() {
    let work = Work::new();
    work.write("plain.npy", small().npy());
    assert_eq!(warnings(&work.wavesplat("convert plain.npy -o plain.wspl").ok()), "");
    work.write("a.npy", changed(|x, v| if x < 2 { 1000.0 + 100.0 * v } else { v }).npy());
    for asked in ["", "--max-error 50"] {
        let run = work.wavesplat(&format!("convert a.npy -o a.wspl --force --json {asked}")).ok();
        let (error, report) = (warnings(&run), run.json());
        assert!(error.contains("half of the voxels that change vary by less than"), "{asked}: {}", run.err);
        assert!(report["typical_variation"].as_f64().unwrap() < report["delta"].as_f64().unwrap());
        let remedy = report["warnings"][0]["remedy"].as_str().unwrap().strip_prefix("try ").unwrap().to_string();
        assert!(remedy.starts_with(if asked.is_empty() { "--tolerance" } else { "--max-error" }), "{remedy}");
        let again = work.wavesplat(&format!("convert a.npy -o a.wspl --force --json {remedy}")).ok();
        assert_eq!(warnings(&again), "");
        let report = again.json();
        assert!(report["delta"].as_f64().unwrap() <= report["typical_variation"].as_f64().unwrap() / 10.0);
    }
    let one = work.wavesplat("convert a.npy -o one.wspl --threads 1 --json --block 8 --memory 64MiB").ok();
    let two = work.wavesplat("convert a.npy -o two.wspl --threads 3 --json --block 8").ok();
    assert!(one.json()["warnings"] == two.json()["warnings"], "threads and memory change no warning");
}

#[test]
fn a_file_larger_than_its_samples_is_warned_of() {
    let work = Work::new();
    let noise: Vec<u8> = (0..80_000_u32).map(|i| (i.wrapping_mul(2_654_435_761) >> 13) as u8).collect();
    let mut state = 1_u64;
    let noise: Vec<u8> = noise
        .iter()
        .map(|byte| {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            byte ^ (state >> 56) as u8
        })
        .collect();
    work.write("a.npy", npy("|u1", "10, 20, 20, 20", &noise));
    let run = work.wavesplat("convert a.npy -o a.wspl --tolerance 0").ok();
    assert!(warnings(&run).contains("larger than the samples"), "{}", run.err);
    assert!(warnings(&run).contains("--tolerance"), "{}", run.err);
    assert!(!warnings(&work.wavesplat("convert a.npy -o b.wspl --tolerance 0.1").ok()).contains("larger"));
}

#[test]
fn longer_windows_are_suggested_where_they_help() {
    let work = Work::new();
    work.write("a.npy", Archive::smooth([16, 16, 16], 300).npy());
    let run = work.wavesplat("convert a.npy -o a.wspl --json").ok();
    let warned = run.json()["warnings"].to_string();
    assert!(warned.contains("try --window 128"), "{warned}");
    let longer = work.wavesplat("convert a.npy -o b.wspl --window 128").ok();
    assert!(work.read("b.wspl").len() < work.read("a.wspl").len() && !warnings(&longer).contains("--window"));
}

#[test]
fn a_few_voxels_over_a_long_time_need_longer_windows_and_are_no_noise() {
    let walk = |t: usize| (t as f32 * 0.0172).sin() * 10.0 + ((t * t * 31 + t * 17) % 101) as f32 * 0.02;
    for (dims, frames) in [([2, 2, 2], 3000), ([1, 1, 1], 4000), ([3, 2, 1], 2200)] {
        let work = Work::new();
        work.write("a.npy", Archive::of(dims, frames, |x, y, z, t| walk(t) + (x + 2 * y + 3 * z) as f32).npy());
        let run = work.wavesplat("convert a.npy -o a.wspl --window 32").ok();
        let said = warnings(&run);
        assert!(
            said.contains("larger than the samples: a window of 32 frames takes") && !said.contains("noise"),
            "{said}"
        );
        assert!(said.contains("try --window 512"), "{said}");
        let longer = work.wavesplat("convert a.npy -o b.wspl").ok(); // the default
        assert!(!warnings(&longer).contains("larger"), "{}", longer.err);
        assert!(2 * work.read("b.wspl").len() < work.read("a.wspl").len());
        work.wavesplat("verify b.wspl --against a.npy").ok();
    }
}

#[test]
fn long_windows_learn_functions_only_where_these_take_few_bytes() {
    let common = |x: usize, y: usize, z: usize, t: usize| ((x + y * 3 + z * 5) % 7) as f32 * (t * 7919 % 1009) as f32;
    let own = |x: usize, y: usize, z: usize, t: usize| ((t * t * (x + 2 * y + 4 * z + 3)) % 101) as f32;
    let work = Work::new();
    let check = |archive: Archive, learns: bool| {
        work.write("a.npy", archive.npy());
        work.wavesplat("convert a.npy -o a.wspl --force --window 256").ok();
        let told = work.wavesplat("info a.wspl").ok();
        assert_eq!(told.text().contains("learned + pyramid"), learns, "{}", told.text());
        work.wavesplat("verify a.wspl --against a.npy").ok();
    };
    for dims in [[5, 4, 3], [12, 10, 1]] {
        check(Archive::of(dims, 256, common), true);
    }
    for dims in [[2, 2, 2], [3, 1, 1]] {
        check(Archive::of(dims, 256, own), false);
    }
}

#[test]
fn negative_decoded_samples_are_warned_of_and_kept_in_the_range() {
    let work = Work::new();
    let archive = changed(|_, v| (v - 0.5).max(0.0));
    let (least, most) = archive.values.iter().fold((f32::MAX, f32::MIN), |(lo, hi), v| (lo.min(*v), hi.max(*v)));
    assert_eq!(least, 0.0);
    work.write("a.npy", archive.npy());
    let said = |run: &Run| warnings(run).contains("no sample is negative");
    let run = work.wavesplat("convert a.npy -o a.wspl").ok();
    let remedy = run.err.split_once("no sample is negative, but some decoded samples are as low as -0.0");
    assert!(said(&run) && remedy.is_some_and(|(_, remedy)| remedy.contains("; --keep range ")), "{}", run.err);
    for options in
        ["range", "sign --keep range", "range --max-error 0.02", "range --bound rms", "range --basis haar --window 8"]
    {
        assert!(!said(&work.wavesplat(&format!("convert a.npy -o b.wspl --force --keep {options}")).ok()), "{options}");
        work.wavesplat("extract b.wspl -o b.npy --force").ok();
        let back = floats(&read_npy(&work.read("b.npy")).1);
        assert!(back.iter().all(|v| (0.0..=most).contains(v)), "{options}");
        work.wavesplat("verify b.wspl --against a.npy").ok();
        let made = work.wavesplat("info b.wspl").ok();
        assert!(made.text().contains("keeps      range"), "{}", made.text());
    }
    work.wavesplat("extract a.wspl -o a2.npy").ok();
    assert!(floats(&read_npy(&work.read("a2.npy")).1).iter().any(|v| *v < 0.0));
    work.write("signed.npy", changed(|_, v| v - 0.5).npy());
    assert!(!said(&work.wavesplat("convert signed.npy -o c.wspl").ok()));
}
