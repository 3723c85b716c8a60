//! The programs' pictures of composites and largest values.

use super::render::decode_png;
use super::{Archive, Work, floats, read_npy, small};

/// The header of an array of `f32`, and its numbers.
fn singles(work: &Work, name: &str) -> (String, Vec<f32>) {
    let (header, bytes) = read_npy(&work.read(name));
    (header, floats(&bytes))
}

const SIZE: &str = "--size 48x40";

#[test]
fn a_composite_array_holds_light_and_opacity_and_a_picture_holds_colours() {
    let work = Work::with_file("--tolerance 1e-4");
    let shown = "a.wspl --mode composite --transfer-function turbo --frames 2";
    work.render(&format!("{shown} {SIZE} -o light.npy")).ok();
    let (header, light) = singles(&work, "light.npy");
    assert!(header.contains("'<f4'") && header.contains("(1, 40, 48, 4)"), "{header}");
    let pixels: Vec<[f32; 4]> = light.as_chunks().0.to_vec();
    assert!(pixels.iter().flatten().all(|v| (0.0..=1.0).contains(v)));
    assert!(pixels.iter().any(|p| p[3] > 0.5) && pixels[0] == [0.0; 4], "something opaque, and nothing in the corner");
    let png = |more: &str| decode_png(&work.render(&format!("{shown} {SIZE} -o - {more}")).ok().out);
    let (dark, white) = (png(""), png("--background ffffff"));
    for ((pixel, dark), white) in pixels.iter().zip(dark.chunks(3)).zip(white.chunks(3)) {
        for i in 0..3 {
            assert!((pixel[i] * 255.0 - f32::from(dark[i])).abs() < 0.6);
            assert!(((pixel[i] + 1.0 - pixel[3]) * 255.0 - f32::from(white[i])).abs() < 0.6);
        }
    }
    assert!(png("--threads 3") == png("--threads 1"));
    assert!(png("--opacity 0:0,1:0").iter().all(|v| *v == 0), "nothing is opaque");
    assert!(png("--range 0,100") != dark && png("--opacity-unit 5") != dark && png("--slices 1") != dark);
}

#[test]
fn frames_and_their_file_have_the_same_composite() {
    let work = Work::with_file("--tolerance 0");
    let shown = format!("--mode composite --frames 1:3 --splat-error 1e-4 {SIZE}");
    work.render(&format!("a.wspl {shown} -o file.npy")).ok();
    work.render(&format!("a.npy {shown} --method direct -o frames.npy")).ok();
    let [(header, file), (_, frames)] = ["file.npy", "frames.npy"].map(|name| singles(&work, name));
    assert!(header.contains("(2, 40, 48, 4)"), "{header}");
    let off = file.iter().zip(&frames).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
    assert!(off < 1e-5, "{off:e}");
}

#[test]
fn the_largest_value_takes_a_colour_map() {
    let work = Work::with_file("");
    let json = work.render(&format!("a.wspl --mode mip {SIZE} -o m_%d.png --colormap grey --json")).ok().json();
    assert!(json["views"][0]["slices"].as_u64().unwrap() > 3 && json["expected_error"].is_null());
    work.render(&format!("a.wspl --mode mip {SIZE} -o m.npy")).ok();
    work.render(&format!("a.wspl {SIZE} -o mean.npy")).ok();
    let [(header, largest), (_, mean)] = ["m.npy", "mean.npy"].map(|name| singles(&work, name));
    assert!(header.contains(", 40, 48)"), "{header}");
    // Near its rim, means have samples beyond the box.
    let is_within = |at: usize| {
        let around = (0..81).map(|n| at as isize + (n / 9 - 4) * 48 + n % 9 - 4);
        around.into_iter().all(|at| largest.get(at as usize).is_some_and(|value| !value.is_nan()))
    };
    let both = || (0..largest.len()).filter(|at| is_within(*at)).map(|at| (largest[at], mean[at]));
    assert!(both().count() > 100 && both().all(|(largest, mean)| largest > mean - 1e-2));
}

#[test]
fn light_changes_colours_and_no_opacity() {
    let work = Work::with_file("--tolerance 1e-4");
    for (name, more) in [("plain", ""), ("shaded", "--shade"), ("lit", "--light 60,0"), ("default", "--light -30,40")] {
        work.render(&format!("a.wspl --mode composite --frames 2 {SIZE} {more} -o {name}.npy")).ok();
    }
    let [plain, shaded, lit, default] =
        ["plain", "shaded", "lit", "default"].map(|n| singles(&work, &format!("{n}.npy")).1);
    assert!(shaded != plain && lit != shaded && default == shaded);
    let opacity = |light: &[f32]| light.iter().skip(3).step_by(4).copied().collect::<Vec<_>>();
    let off = opacity(&plain).iter().zip(opacity(&shaded)).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
    assert!(off < 1e-5, "{off:e}");
}

#[test]
fn values_far_from_zero_have_composites_and_surfaces() {
    let work = Work::new();
    let warm = |x: usize, y: usize, z: usize, t: usize| {
        let [x, y, z, t] = [x, y, z, t].map(|n| n as f32);
        280.0 + (0.6 * x + 0.1 * t).sin() * (0.4 * y).cos() * (0.5 * z).sin()
    };
    work.write("warm.npy", Archive::of([20, 18, 16], 8, warm).npy());
    work.wavesplat("convert warm.npy -o warm.wspl").ok();
    for mode in ["--mode composite", "--iso 50%"] {
        let run = work.render(&format!("warm.wspl {SIZE} {mode} --frames 2 -o light.npy --force")).ok();
        assert!(!run.err.contains("no sample reaches"), "{}", run.err);
        let seen = singles(&work, "light.npy").1.chunks(4).filter(|pixel| pixel[3] > 0.2).count();
        assert!(seen > 100, "{mode}: {seen} pixels");
    }
}

#[test]
fn surfaces_are_named_by_value_or_share() {
    let work = Work::with_file("--tolerance 1e-4");
    let shown = format!("a.wspl --frames 2 {SIZE} --range 0,2");
    for (name, more) in
        [("one", "--iso 50%"), ("same", "--mode iso"), ("value", "--iso 1.0"), ("red", "--iso 1:ff0000:0.5")]
    {
        work.render(&format!("{shown} {more} -o {name}.npy")).ok();
    }
    let [one, same, value, red] = ["one", "same", "value", "red"].map(|n| singles(&work, &format!("{n}.npy")).1);
    assert!(one == same && one == value);
    let most = |light: &[f32], n: usize| light.iter().skip(n).step_by(4).copied().fold(0.0, f32::max);
    assert!(most(&one, 3) > 0.9 && most(&red, 0) > most(&red, 2), "an opaque surface, and a red one");
    let seen = |light: &[f32]| light.chunks(4).filter(|p| p[3] > 0.4).count();
    assert!(seen(&one) > 20 && seen(&one).abs_diff(seen(&red)) < 60, "{} {}", seen(&one), seen(&red));
    assert!(work.render(&format!("{shown} --iso 1e9 -o far.npy")).ok().err.contains("no sample reaches it"));
    work.wavesplat("convert a.npy -o kept.wspl --keep side=1").ok();
    let kept = work.render(&format!("kept.wspl --frames 2 {SIZE} --range 0,2 --iso 1,0.5 -o kept.npy")).ok().err;
    assert!(kept.contains(" 1: every sample"), "{kept}");
    assert!(!kept.contains("0.5: every sample"), "{kept}");
    let json = work.render(&format!("{shown} --iso 0.5,1:00ff00 -o two.png --json")).ok().json();
    let iso = json["picture"]["iso"].as_str().unwrap().to_string();
    assert!(iso.starts_with("0.5:") && iso.ends_with("1:00ff00:0.6"), "{iso}");
}

#[test]
fn options_without_meaning_for_a_mode_are_refused() {
    let work = Work::with_file("");
    work.wavesplat("convert a.npy -o c.wspl --transfer-function turbo").ok();
    for (args, words) in [
        ("a.wspl --opacity 0:0,1:1", &["--opacity", "--mode composite"][..]),
        ("a.wspl --opacity-unit 1", &["--opacity-unit", "--mode composite"]),
        ("a.wspl --slices 5", &["--slices", "--mode composite"]),
        ("a.wspl --transfer-function turbo", &["--transfer-function", "--mode composite", "--colormap"]),
        ("a.wspl --mode mip --transfer-function turbo", &["--transfer-function", "--colormap"]),
        ("a.wspl --mode composite --colormap turbo", &["--colormap", "--transfer-function"]),
        ("a.wspl --mode composite --norm log", &["--norm"]),
        ("a.wspl --mode composite --tau 1", &["--tau"]),
        ("a.wspl --mode composite --quantity emission", &["--quantity"]),
        ("a.wspl --mode mip --error-image e.npy", &["--error-image", "composites"]),
        ("a.wspl --mode composite --slices 0", &["--slices", "1 to"]),
        ("a.wspl --mode composite --opacity-unit 0", &["--opacity-unit", "above 0"]),
        ("a.wspl --mode composite --opacity 0:0", &["--opacity", "two or more"]),
        ("a.wspl --mode composite --opacity 1:0,0:1", &["--opacity", "ascend"]),
        ("a.wspl --mode composite --opacity 0:0,1:2", &["--opacity", "0 to 1"]),
        ("a.wspl --mode composite --opacity 0,1", &["--opacity", "0:0,0.5:0.1,1:0.8"]),
        ("a.wspl --mode composite --opacity 0:NaN,1:1", &["--opacity", "a share of the range"]),
        ("a.wspl --mode composite --transfer-function jet", &["--transfer-function jet", "viridis"]),
        ("a.wspl --mode composite --range 1,1", &["--range"]),
        ("a.wspl --mode composite --range 2,1", &["--range"]),
        ("c.wspl --mode composite", &["--mode", "colours already"]),
        ("c.wspl --iso 1", &["--mode", "colours already"]),
        ("a.wspl --shade", &["--shade", "--mode composite"]),
        ("a.wspl --mode mip --light 1,2", &["--light", "--mode composite or iso"]),
        ("a.wspl --mode composite --iso 1", &["--iso", "--mode iso"]),
        ("a.wspl --iso 1 --opacity 0:0,1:1", &["--opacity", "--mode composite"]),
        ("a.wspl --iso x", &["--iso", "40%"]),
        ("a.wspl --iso 1::2", &["--iso", "at most 1"]),
        ("a.wspl --iso 1 --tau 1", &["--tau"]),
    ] {
        work.render(&format!("{args} {SIZE} -o out.npy")).fails(2, words);
    }
    work.render(&format!("a.wspl --mode composite {SIZE} -o - --format gray16")).fails(2, &["gray16"]);
    assert_eq!(work.names(), ["a.npy", "a.wspl", "c.wspl"]);
}

#[test]
fn an_error_image_bounds_the_light_of_every_pixel() {
    let work = Work::with_file("--tolerance 0.004");
    small().write_frames(&work, "frames");
    check_certificate(&work, "--mode composite --opacity 0:0,1:0.2 --range 0,1", 0.3);
    check_certificate(&work, "--iso 0.3,0.7:00ff00:1", 1.0);
}

/// `most` is the largest error that the program may certify.
fn check_certificate(work: &Work, mode: &str, most: f64) {
    let options = format!("{mode} {SIZE} --frames 0,9 --force --json");
    let numbers = |name: &str| floats(&read_npy(&work.read(name)).1);
    let drawn = |input: &str, name: &str| {
        let run = work.render(&format!("{input} {options} -o {name}.npy --error-image {name}-e.npy")).ok();
        (numbers(&format!("{name}.npy")), numbers(&format!("{name}-e.npy")), run.json()["certified_error"].as_f64())
    };
    let ((file, errors, certified), (truth, rounding, _)) =
        (drawn("a.wspl", "a"), drawn("frames --method direct", "b"));
    assert!(errors.len() == 2 * 48 * 40 && file.len() == 4 * errors.len());
    assert!(errors.iter().all(|error| f64::from(*error) <= certified.unwrap()) && certified.unwrap() <= most);
    for (pixel, (file, truth)) in file.chunks_exact(4).zip(truth.chunks_exact(4)).enumerate() {
        let off = file.iter().zip(truth).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
        assert!(off <= errors[pixel] + rounding[pixel], "{pixel}: {off}");
    }
    work.render(&format!("a.wspl {options} -o c_%d.png --error-image e_%d.png")).ok();
    assert!(work.names().contains(&"e_9.png".to_string()));
}

/// A volume that is 0 but for a bright box.
fn nearly_empty(work: &Work) {
    let value = |x: usize, y: usize, z: usize| if x / 4 == 1 && y / 4 == 1 && z / 4 == 1 { 3.0_f32 } else { 0.0 };
    let frame: Vec<f32> = (0..16 * 16 * 16).map(|n| value(n % 16, n / 16 % 16, n / 256)).collect();
    let bytes: Vec<u8> = [&frame[..], &frame[..]].concat().iter().flat_map(|v| v.to_le_bytes()).collect();
    work.write("box.raw", &bytes);
    work.wavesplat("convert box.raw -o box.wspl --dims 16x16x16x2 --dtype f32 --tolerance 1e-4").ok();
}

#[test]
fn empty_space_shows_the_background() {
    let work = Work::new();
    nearly_empty(&work);
    let shown = |more: &str| {
        let run = work.render(&format!("box.wspl --frames 0 {SIZE} --background ff0000 -o - {more}")).ok();
        let red = decode_png(&run.out).chunks(3).filter(|pixel| *pixel == [255, 0, 0]).count();
        (red, run.err.contains("--clear none"))
    };
    let (all, said) = shown("--clear none");
    assert!(!said && all < 48 * 40 * 2 / 3, "{all}");
    let (cleared, said) = shown("");
    assert!(said && cleared > all + 200, "{cleared} {all}");
    assert_eq!(shown("--clear 5,6").0, all, "no pixel has these values");
    assert_eq!(shown("--clear=-1,9").0, 48 * 40, "all pixels have these");
    assert!(shown("--mode mip").0 > shown("--mode mip --clear none").0 + 200);
    work.render(&format!("box.wspl {SIZE} -o x.png --clear 2,1")).fails(2, &["--clear", "lower one first"]);
}

#[test]
fn suggested_opacities_show_rare_values() {
    let work = Work::new();
    nearly_empty(&work);
    let shown = |more: &str| {
        work.render(&format!("box.wspl --frames 0 {SIZE} --mode composite {more} -o c.npy --force")).ok();
        singles(&work, "c.npy").1
    };
    let (auto, none) = (shown(""), shown("--opacity auto"));
    assert!(auto == none, "the default");
    let opaque = |light: &[f32]| light.iter().skip(3).step_by(4).filter(|a| **a > 0.5).count();
    assert!((10..400).contains(&opaque(&auto)), "the box alone: {}", opaque(&auto));
    let full = shown("--opacity 0:1,1:1");
    assert!(opaque(&full) > 2 * opaque(&auto));
}
