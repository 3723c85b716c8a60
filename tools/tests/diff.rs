//! `diff` as a program, on files as they come.
#![allow(clippy::unwrap_used)]

use png::{BitDepth, ColorType};
use serde_json::Value;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use wavesplat::base::sample::{self, SampleType};

const WIDTH: usize = 20;
const HEIGHT: usize = 15;
const NAN: f64 = f64::NAN;

struct Folder(tempfile::TempDir);

impl Folder {
    fn new() -> Self {
        Self(tempfile::tempdir().unwrap())
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn npy(&self, name: &str, ty: SampleType, shape: &[usize], values: &[f64]) -> PathBuf {
        let (mut bytes, mut samples) = (Vec::new(), vec![0; values.len() * ty.size()]);
        wavesplat_core::base::npy::write_header(ty, shape, &mut bytes).unwrap();
        sample::store(ty, values, &mut samples);
        bytes.extend(samples);
        fs::write(self.path(name), bytes).unwrap();
        self.path(name)
    }

    /// Of `WIDTH` times `HEIGHT` pixels.
    fn png(&self, name: &str, colour: ColorType, depth: BitDepth, bytes: &[u8]) -> PathBuf {
        fs::create_dir_all(self.path(name).parent().unwrap()).unwrap();
        let file = fs::File::create(self.path(name)).unwrap();
        let mut encoder = png::Encoder::new(file, WIDTH as u32, HEIGHT as u32);
        encoder.set_color(colour);
        encoder.set_depth(depth);
        encoder.write_header().unwrap().write_image_data(bytes).unwrap();
        self.path(name)
    }

    fn grey(&self, name: &str, bytes: &[u8]) -> PathBuf {
        self.png(name, ColorType::Grayscale, BitDepth::Eight, bytes)
    }
}

fn diff(a: &Path, b: &Path, args: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_wavesplat-tools"));
    command.arg("diff").args([a, b]).args(args).output().unwrap()
}

fn said(run: &Output) -> String {
    String::from_utf8([&run.stdout[..], &run.stderr].concat()).unwrap()
}

#[track_caller]
fn json(a: &Path, b: &Path, args: &[&str]) -> Value {
    let run = diff(a, b, &[&["--json"], args].concat());
    assert!(run.status.success(), "{}", said(&run));
    serde_json::from_slice(&run.stdout).unwrap()
}

#[track_caller]
fn refused(a: &Path, b: &Path, args: &[&str], code: i32, words: &str) {
    let run = diff(a, b, args);
    assert_eq!(run.status.code(), Some(code), "{}", said(&run));
    let message = String::from_utf8_lossy(&run.stderr).into_owned();
    assert!(message.contains(words), "{message:?} without {words:?}");
    assert!(run.stdout.is_empty());
}

fn texture(channels: usize) -> Vec<u8> {
    (0..WIDTH * HEIGHT * channels).map(|i| (i * 7919 % 251) as u8).collect()
}

fn floats(frames: usize) -> Vec<f64> {
    (0..WIDTH * HEIGHT * frames).map(|i| (i * 7919 % 1001) as f64 / 1000.0).collect()
}

/// The size of a PNG and its pixels.
fn picture(path: &Path) -> ([u32; 2], Vec<[u8; 3]>) {
    let mut reader = png::Decoder::new(std::io::BufReader::new(fs::File::open(path).unwrap())).read_info().unwrap();
    let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
    let info = reader.next_frame(&mut pixels).unwrap();
    ([info.width, info.height], pixels.as_chunks().0.to_vec())
}

#[test]
fn identical_pictures_differ_by_nothing() {
    let folder = Folder::new();
    let kinds = [ColorType::Grayscale, ColorType::GrayscaleAlpha, ColorType::Rgb, ColorType::Rgba];
    for (colour, depth) in kinds.into_iter().flat_map(|c| [(c, BitDepth::Eight), (c, BitDepth::Sixteen)]) {
        let bytes = texture(colour.samples() * if depth == BitDepth::Sixteen { 2 } else { 1 });
        let [a, b] = ["a.png", "b.png"].map(|name| folder.png(name, colour, depth, &bytes));
        let found = json(&a, &b, &["--fail-above", "0"]);
        assert_eq!((&found["schema"], &found["channels"]), (&1.into(), &colour.samples().into()));
        let all = &found["all"];
        assert_eq!((&all["identical"], &all["largest"], &all["ssim"]), (&true.into(), &0.0.into(), &1.0.into()));
        assert!(all["psnr_db"].is_null() && all["at"].is_null() && found["worst"].is_null());
    }
    let text = said(&diff(&folder.path("a.png"), &folder.path("b.png"), &[]));
    assert!(text.contains("identical") && text.contains("inf"), "{text}");
}

#[test]
fn a_changed_pixel_is_found_with_its_channel() {
    let folder = Folder::new();
    let mut wide: Vec<u8> = texture(6);
    let a = folder.png("a.png", ColorType::Rgb, BitDepth::Sixteen, &wide);
    let at = ((4 * WIDTH + 7) * 3 + 2) * 2;
    wide[at] ^= 1; // 256: the most significant byte is the first
    let b = folder.png("b.png", ColorType::Rgb, BitDepth::Sixteen, &wide);
    let found = json(&a, &b, &[]);
    assert_eq!((&found["samples"], &found["peak"]), (&"u16".into(), &65535.0.into()));
    let all = &found["all"];
    assert_eq!(all["largest"], 256.0);
    assert_eq!(all["at"], serde_json::json!({"frame": 0, "x": 7, "y": 4, "channel": 2}));
    assert_eq!(all["mean"], 256.0 / (WIDTH * HEIGHT * 3) as f64);
    let psnr = 20.0 * (65535.0 / all["rms"].as_f64().unwrap()).log10();
    assert!((all["psnr_db"].as_f64().unwrap() - psnr).abs() < 1e-9);
    let text = said(&diff(&a, &b, &[]));
    assert!(text.contains("256 at frame 0, x 7, y 4, channel 2"), "{text}");
}

#[test]
fn a_shifted_picture_is_less_similar_than_a_brighter_one() {
    let folder = Folder::new();
    let wave = |shift: usize, more: u8| -> Vec<u8> {
        (0..WIDTH * HEIGHT).map(|i| ((i % WIDTH + shift) % 8 * 20) as u8 + more).collect()
    };
    let a = folder.grey("a.png", &wave(0, 0));
    let similar = |name, bytes: &[u8]| json(&a, &folder.grey(name, bytes), &[])["all"]["ssim"].as_f64().unwrap();
    let (shifted, brighter) = (similar("b.png", &wave(4, 0)), similar("c.png", &wave(0, 10)));
    assert!(shifted < 0.1 && (0.95..1.0).contains(&brighter), "{shifted} {brighter}");
}

#[test]
fn a_stack_has_a_worst_frame() {
    let folder = Folder::new();
    let values = floats(5);
    let mut other = values.clone();
    let frame = WIDTH * HEIGHT;
    other[3 * frame + 2 * WIDTH + 9] += 0.5;
    other[frame] += 0.25;
    let shape = [5, HEIGHT, WIDTH];
    let a = folder.npy("a.npy", SampleType::F64, &shape, &values);
    let b = folder.npy("b.npy", SampleType::F64, &shape, &other);
    let found = json(&a, &b, &[]);
    assert_eq!((&found["frames"], &found["peak"], &found["worst"]["frame"]), (&5.into(), &1.0.into(), &3.into()));
    assert_eq!(found["worst"]["at"], serde_json::json!({"frame": 3, "x": 9, "y": 2, "channel": 0}));
    let close = |value: &Value, to: f64| assert!((value.as_f64().unwrap() - to).abs() < 1e-12, "{value} {to}");
    close(&found["all"]["largest"], 0.5);
    close(&found["all"]["mean"], 0.75 / (5 * frame) as f64);
    close(&found["worst"]["rms"], (0.25 / frame as f64).sqrt());
    let as_f32 = folder.npy("c.npy", SampleType::F32, &shape, &other);
    close(&json(&as_f32, &b, &[])["all"]["background_in_one"], 0.0);
    assert!(said(&diff(&a, &b, &[])).contains("Worst, frame 3"));
}

#[test]
fn channels_are_the_last_axis_of_four() {
    let folder = Folder::new();
    let mut values: Vec<f64> = floats(6).iter().map(|v| (v * 255.0).round()).collect();
    let shape = [2, HEIGHT, WIDTH, 3];
    let a = folder.npy("a.npy", SampleType::U8, &shape, &values);
    values[(HEIGHT * WIDTH + 5) * 3 + 1] = 255.0;
    let b = folder.npy("b.npy", SampleType::U8, &shape, &values);
    let found = json(&a, &b, &[]);
    assert_eq!((&found["channels"], &found["peak"]), (&3.into(), &255.0.into()));
    assert_eq!(found["all"]["at"], serde_json::json!({"frame": 1, "x": 5, "y": 0, "channel": 1}));
}

#[test]
fn background_in_one_alone_differs_infinitely() {
    let folder = Folder::new();
    let (mut values, mut other) = (floats(1), floats(1));
    (values[0], other[0]) = (NAN, NAN);
    let both = folder.npy("both.npy", SampleType::F32, &[HEIGHT, WIDTH], &values);
    let same = folder.npy("same.npy", SampleType::F32, &[HEIGHT, WIDTH], &other);
    let found = json(&both, &same, &["--fail-above", "0"]);
    assert_eq!((&found["all"]["identical"], &found["all"]["background_in_both"]), (&true.into(), &1.into()));
    other[WIDTH + 1] = NAN;
    let one = folder.npy("one.npy", SampleType::F32, &[HEIGHT, WIDTH], &other);
    let found = &json(&both, &one, &[])["all"];
    assert!(found["largest"].is_null() && found["mean"] == 0.0 && found["background_in_one"] == 1);
    assert_eq!(found["at"], serde_json::json!({"frame": 0, "x": 1, "y": 1, "channel": 0}));
    assert_eq!(found["ssim"], 1.0, "windows without background are identical");
    let run = diff(&both, &one, &["--fail-above", "1e300"]);
    assert_eq!(run.status.code(), Some(4));
    assert!(said(&run).contains("inf at frame 0, x 1, y 1, channel 0, where one alone has background"));
}

#[test]
fn undefined_measures_are_reported() {
    let folder = Folder::new();
    let small = folder.npy("small.npy", SampleType::F32, &[2, 10, 20], &[1.0; 400]);
    let plain = folder.npy("plain.npy", SampleType::F32, &[HEIGHT, WIDTH], &[1.0; 300]);
    let other = folder.npy("other.npy", SampleType::F32, &[HEIGHT, WIDTH], &[2.0; 300]);
    let none = folder.npy("none.npy", SampleType::F32, &[HEIGHT, WIDTH], &[NAN; 300]);
    assert!(json(&small, &small, &[])["all"]["ssim"].is_null());
    for (a, b, words) in [
        (&small, &small, "not defined: pictures are smaller than its window of 11x11"),
        (&plain, &other, "not defined: the values of A are all the same"),
        (&none, &none, "not defined: no number is there in both"),
    ] {
        let run = diff(a, b, &[]);
        assert!(run.status.success() && said(&run).contains(words), "{}", said(&run));
    }
}

#[test]
fn folders_and_patterns_are_stacks_in_natural_order() {
    let folder = Folder::new();
    let mut bytes = texture(1);
    for frame in 0..12 {
        folder.grey(&format!("a/f{frame}.png"), &bytes);
        folder.grey(&format!("b/g{frame}.png"), &bytes);
    }
    bytes[17] ^= 64;
    folder.grey("b/g10.png", &bytes);
    let (a, b) = (folder.path("a"), folder.path("b/g*.png"));
    let found = json(&a, &b, &[]);
    assert_eq!((&found["frames"], &found["worst"]["frame"]), (&12.into(), &10.into()));
    refused(&a, &folder.path("b/g?.png"), &[], 2, "10 frame(s) of 20x15 pixels with 1 channel(s) of u8; expected 12");
    refused(&folder.path("a/f*.jpg"), &b, &[], 2, "no file matches");
    fs::create_dir(folder.path("empty")).unwrap();
    refused(&folder.path("empty"), &b, &[], 2, "has no .png file");
    folder.png("b/g11.png", ColorType::Rgb, BitDepth::Eight, &texture(3));
    refused(&a, &b, &[], 2, "g11.png: is 1 frame(s) of 20x15 pixels with 3 channel(s) of u8; expected");
}

#[test]
fn inputs_that_cannot_be_compared_are_refused() {
    let folder = Folder::new();
    let a = folder.npy("a.npy", SampleType::F32, &[HEIGHT, WIDTH], &floats(1));
    let wide = folder.npy("wide.npy", SampleType::F32, &[WIDTH, HEIGHT], &floats(1));
    let bytes = folder.npy("bytes.npy", SampleType::U8, &[HEIGHT, WIDTH], &floats(1));
    let grey = folder.grey("grey.png", &texture(1));
    let rgb = folder.png("rgb.png", ColorType::Rgb, BitDepth::Eight, &texture(3));
    refused(&a, &wide, &[], 2, "15x20 pixels with 1 channel(s) of f32; expected 1 frame(s) of 20x15 pixels");
    refused(&a, &bytes, &[], 2, "of u8; expected 1 frame(s) of 20x15 pixels with 1 channel(s) of f32");
    refused(&grey, &rgb, &[], 2, "3 channel(s) of u8; expected 1 frame(s) of 20x15 pixels with 1 channel(s) of u8");
    assert_eq!(json(&grey, &bytes, &[])["samples"], "u8", "what they are stored in does not matter");
    let heat = folder.path("heat.jpg");
    refused(&grey, &grey, &["-o", heat.to_str().unwrap()], 2, "expected a name that ends in .png");
    refused(&grey, &grey, &["-o", grey.to_str().unwrap()], 2, "would replace the input");
    refused(&grey, &grey, &["--scale", "1"], 2, "--output");
    refused(&grey, &grey, &["--fail-above", "nan"], 2, "is not a number of 0 or more");
}

#[test]
fn damaged_files_and_files_of_another_kind_are_refused() {
    let folder = Folder::new();
    let png = folder.png("a.png", ColorType::Rgb, BitDepth::Eight, &texture(3));
    let npy = folder.npy("a.npy", SampleType::F32, &[HEIGHT, WIDTH], &floats(1));
    for (whole, step) in [(&png, 1), (&npy, 13)] {
        let bytes = fs::read(whole).unwrap();
        let cut = folder.path("cut");
        for len in (bytes.len() / 2..bytes.len()).step_by(step * bytes.len().div_ceil(40)) {
            fs::write(&cut, &bytes[..len]).unwrap();
            refused(whole, &cut, &[], 3, "cut: ");
            refused(&cut, whole, &[], 3, "expected");
        }
    }
    let mut bytes = fs::read(&png).unwrap();
    let middle = bytes.len() / 2;
    bytes[middle] ^= 1;
    fs::write(folder.path("bad.png"), &bytes).unwrap();
    refused(&png, &folder.path("bad.png"), &[], 3, "expected a whole PNG");
    fs::write(folder.path("text.png"), "a picture").unwrap();
    refused(&folder.path("text.png"), &png, &[], 3, "expected a PNG, or an .npy of (H,W), (F,H,W) or (F,H,W,C)");
    let line = folder.npy("line.npy", SampleType::F32, &[8], &[0.0; 8]);
    refused(&line, &line, &[], 3, "its array has 1 dimension(s); expected");
    let empty = folder.npy("empty.npy", SampleType::F32, &[0, 5, 5], &[]);
    refused(&empty, &empty, &[], 3, "its array is empty");
    refused(&png, &folder.path("gone.png"), &[], 1, "gone.png: opening");
}

#[test]
fn a_png_that_claims_more_than_it_can_hold_is_refused() {
    let folder = Folder::new();
    let path = folder.path("huge.png");
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, 1 << 20, 1 << 20);
    encoder.set_color(ColorType::Grayscale);
    drop(encoder.write_header().unwrap());
    bytes.truncate(bytes.len() - 12); // the end
    bytes.extend(b"\0\0\0\0IDAT\x35\xaf\x06\x1e");
    fs::write(&path, bytes).unwrap();
    refused(&path, &path, &[], 3, "claims 1048576x1048576 pixels");
}

#[test]
fn the_heat_map_runs_from_white_to_dark_red_with_a_bar() {
    let folder = Folder::new();
    let (mut values, mut other) = (floats(20), floats(20));
    (values[0], other[0], other[1]) = (NAN, NAN, NAN);
    other[WIDTH + 2] += 0.25;
    other[WIDTH + 3] += 0.5;
    let shape = [20, HEIGHT, WIDTH];
    let [a, b] = [("a.npy", &values), ("b.npy", &other)].map(|(n, v)| folder.npy(n, SampleType::F64, &shape, v));
    let heat = folder.path("heat.png");
    let draw = |args: &[&str]| json(&a, &b, &[&["-o", heat.to_str().unwrap()], args].concat());
    assert!((draw(&[])["heat_map"]["scale"].as_f64().unwrap() - 0.5).abs() < 1e-12);
    let drawn = picture(&heat);
    let [width, height] = drawn.0;
    let (gap, band) = (5, 16 + 5);
    let (background, none, half, most) = ([224; 3], [255; 3], [252, 150, 60], [128, 0, 38]);
    assert!(width as usize > 4 * (WIDTH + gap) && height as usize == gap + 4 * (HEIGHT + band + gap));
    let at = |drawn: &([u32; 2], Vec<[u8; 3]>), x: usize, y: usize| {
        drawn.1[(gap + band + y) * drawn.0[0] as usize + gap + x]
    };
    assert_eq!((at(&drawn, 0, 0), at(&drawn, 1, 0), at(&drawn, 5, 5)), (background, most, none));
    assert_eq!((at(&drawn, 2, 1), at(&drawn, 3, 1)), (half, most));
    refused(&a, &b, &["-o", heat.to_str().unwrap()], 2, "--force");
    draw(&["--scale", "1", "--force"]);
    assert_eq!(at(&picture(&heat), 3, 1), half);
    let one = folder.grey("one.png", &texture(1));
    assert!(diff(&one, &one, &["-o", heat.to_str().unwrap(), "--force"]).status.success());
    assert_eq!(picture(&heat).1[gap * picture(&heat).0[0] as usize + gap], none, "a picture has no name above");
}

#[test]
fn failing_above_a_difference_is_after_the_report() {
    let folder = Folder::new();
    let mut bytes = texture(1);
    let a = folder.grey("a.png", &bytes);
    bytes[5] ^= 8;
    let b = folder.grey("b.png", &bytes);
    assert_eq!(diff(&a, &b, &["--fail-above", "8"]).status.code(), Some(0));
    let run = diff(&a, &b, &["--fail-above", "7.5", "--json"]);
    assert_eq!(run.status.code(), Some(4));
    assert_eq!(serde_json::from_slice::<Value>(&run.stdout).unwrap()["all"]["largest"], 8.0);
    assert!(
        String::from_utf8_lossy(&run.stderr)
            .contains("differs from A by 8 at frame 0, x 5, y 0, channel 0: more than 7.5")
    );
}
