//! Runs that succeed.

use super::{Bench, frame, largest_difference, raw};
use std::fs;

const FRAMES: usize = 37;

#[test]
fn the_file_does_not_depend_on_how_frames_are_stored() {
    let b = Bench::new(FRAMES);
    let all: Vec<f32> = (0..FRAMES).flat_map(frame).collect();
    b.write_npy("all.npy", &[FRAMES, 7, 9, 11], &all);
    fs::write(b.path("all.raw"), raw(FRAMES)).unwrap();
    let big: Vec<u8> = [0u8; 5].into_iter().chain(all.iter().flat_map(|v| v.to_be_bytes())).collect();
    fs::write(b.path("big.bin"), big).unwrap();
    b.done("wavesplat", "convert frames -o a.wspl");
    let list: Vec<String> = (0..FRAMES).map(|t| format!("frames/frame_{t:04}.npy")).collect();
    for (i, input) in [
        "frames/frame_*.npy",
        &list.join(" "),
        "all.npy",
        "all.raw --dims 11x9x7x37 --dtype f32",
        "big.bin --dims 11x9x7x37 --dtype f32 --endian big --offset 5",
        "frames --no-mmap",
        "frames --threads 1",
        "frames --threads 5 --memory 64MiB",
    ]
    .iter()
    .enumerate()
    {
        b.done("wavesplat", &format!("convert {input} -o b{i}.wspl"));
        assert_eq!(b.bytes("a.wspl"), b.bytes(&format!("b{i}.wspl")), "{input}");
    }
}

#[test]
fn every_command_tells_what_the_file_holds() {
    let b = Bench::new(FRAMES);
    b.done("wavesplat", "convert frames -o a.wspl --tolerance 0.001 --basis multi");
    let info = b.done("wavesplat", "info a.wspl --json");
    let json: serde_json::Value = serde_json::from_slice(&info.out).unwrap();
    assert_eq!((&json["schema"], &json["frames"], &json["windows"][1]["frames"]), (&1.into(), &37.into(), &4.into()));
    assert!(json["windows"][0]["reached"].as_f64() <= json["windows"][0]["promised"].as_f64());
    let text = String::from_utf8(b.done("wavesplat", "info a.wspl").out).unwrap();
    assert!(text.contains("11 x 9 x 7 voxels") && text.contains("pointwise"), "{text}");
    let text = String::from_utf8(b.done("wavesplat", "verify a.wspl --against frames").out).unwrap();
    assert!(text.contains("bound kept"), "{text}");
}

#[test]
fn extracted_samples_keep_the_promise_and_parts_are_parts_of_the_whole() {
    let b = Bench::new(FRAMES);
    b.done("wavesplat", "convert frames -o a.wspl --tolerance 0.01");
    b.done("wavesplat", "extract a.wspl -o all.npy");
    let (shape, all) = b.array("all.npy");
    assert_eq!(shape, [37, 7, 9, 11]);
    let source: Vec<f32> = (0..FRAMES).flat_map(frame).collect();
    assert!(largest_difference(&all, &source) <= 0.01 * range_of(&source));
    b.done("wavesplat", "extract a.wspl -o part.npy --frames 30:36:5 --region 2:5,:,6:7");
    let part: Vec<f32> = [30, 35]
        .into_iter()
        .flat_map(|t| (0..9).flat_map(move |y| (2..5).map(move |x| ((t * 7 + 6) * 9 + y) * 11 + x)))
        .map(|i| all[i])
        .collect();
    assert_eq!(b.array("part.npy"), (vec![2, 1, 9, 3], part));
    let said = b.done("wavesplat", "extract a.wspl -o - --format raw --frames 3 --memory 16MiB");
    assert_eq!(said.out, all[3 * 693..4 * 693].iter().flat_map(|v| v.to_le_bytes()).collect::<Vec<u8>>());
}

#[test]
fn what_was_converted_of_the_frames_is_remembered() {
    let b = Bench::new(FRAMES);
    b.done("wavesplat", "convert frames -o a.wspl --frames 3:30:4 --region 1:9,0:9,2:7 --tolerance 0");
    let text = String::from_utf8(b.done("wavesplat", "verify a.wspl --against frames").out).unwrap();
    assert!(text.contains("largest error 0.0000e0"), "{text}");
    b.done("wavesplat", "extract a.wspl -o a.npy");
    let (shape, values) = b.array("a.npy");
    assert_eq!((shape, values[0]), (vec![7, 5, 9, 8], frame(3)[2 * 99 + 1]));
}

#[test]
fn pictures_from_coefficients_are_within_the_bound_of_pictures_from_frames() {
    let b = Bench::new(FRAMES);
    b.done("wavesplat", "convert frames -o a.wspl --tolerance 0.02");
    let bound = 0.02 * range_of(&(0..FRAMES).flat_map(frame).collect::<Vec<f32>>());
    for view in ["--view 30,30", "--view 0,90 --roll 15", "--view 200,-10 --tau 0.2"] {
        let picture = |input: &str, name: &str| {
            b.done("wavesplat-render", &format!("{input} -o {name} --force --size 64x48 --splat-error 0 {view}"));
            b.array(name)
        };
        let (shape, coefficients) = picture("a.wspl", "c.npy");
        assert_eq!(shape, [37, 48, 64]);
        let (_, frames) = picture("frames --method direct", "d.npy");
        assert!(largest_difference(&coefficients, &frames) <= bound, "{view}");
        let (_, decoded) = picture("a.wspl --method direct", "s.npy");
        assert!(largest_difference(&coefficients, &decoded) <= 1e-6, "{view}");
    }
}

/// Largest less smallest.
fn range_of(values: &[f32]) -> f64 {
    let (lo, hi) = values.iter().fold((f32::MAX, f32::MIN), |r, v| (r.0.min(*v), r.1.max(*v)));
    f64::from(hi) - f64::from(lo)
}

#[test]
fn pictures_come_in_every_format() {
    let b = Bench::new(3);
    b.done("wavesplat", "convert frames -o a.wspl");
    b.done("wavesplat-render", "a.wspl -o p_%03d.png --size 40x30");
    let reader = png::Decoder::new(std::io::Cursor::new(b.bytes("p_002.png"))).read_info().unwrap();
    assert_eq!((reader.info().width, reader.info().height), (40, 30));
    b.done("wavesplat-render", "a.wspl -o one.png --frames 1 --colormap turbo");
    assert_ne!(b.bytes("one.png"), b.bytes("p_001.png"));
    let video = b.done("wavesplat-render", "a.wspl -o - --format y4m --size 40x30 --fps 10").out;
    assert!(video.starts_with(b"YUV4MPEG2 W40 H30 F10:1 Ip A1:1 C444 XCOLORRANGE=FULL\nFRAME\n"));
    assert_eq!(video.len(), 54 + 3 * (6 + 3 * 40 * 30));
    assert_eq!(b.done("wavesplat-render", "a.wspl -o - --format rgb24 --size 40x30").out.len(), 3 * 3 * 40 * 30);
    assert_eq!(b.done("wavesplat-render", "a.wspl -o - --format gray16 --size 40x30").out.len(), 3 * 2 * 40 * 30);
    assert!(b.done("wavesplat-render", "a.wspl -o -").out.starts_with(&[0x89, b'P', b'N', b'G']));
    b.done("wavesplat-render", "a.wspl -o c.npy --colormap grey --size 40x30 --quantity emission");
    let bytes = b.bytes("c.npy");
    let colours = npyz::NpyFile::new(bytes.as_slice()).unwrap();
    assert_eq!((colours.shape(), colours.dtype().descr().as_str()), (&[3, 30, 40, 3][..], "'|u1'"));
    b.done("wavesplat-render", "a.wspl -o v.npy --size 40x30");
    let (_, values) = b.array("v.npy");
    assert!(values[0].is_nan() && !values[15 * 40 + 20].is_nan(), "background around the volume");
}

#[test]
fn pictures_do_not_depend_on_threads_or_memory() {
    let b = Bench::new(FRAMES);
    b.done("wavesplat", "convert frames -o a.wspl --block 4");
    b.done("wavesplat-render", "a.wspl -o a.npy --threads 1 --size 150x140");
    for options in ["--threads 2", "--threads 5", "--threads 2 --memory 16MiB", "--no-mmap"] {
        b.done("wavesplat-render", &format!("a.wspl -o b.npy --force --size 150x140 {options}"));
        assert_eq!(b.bytes("a.npy"), b.bytes("b.npy"), "{options}");
    }
}

#[test]
fn missing_samples_come_back_as_they_were() {
    let b = Bench::new(0);
    let mut values = frame(0);
    (values[5], values[6], values[600]) = (f32::NAN, f32::NEG_INFINITY, -9999.0);
    b.write_npy("a.npy", &[7, 9, 11], &values);
    let said = b.run("wavesplat", "convert a.npy -o a.wspl");
    assert_eq!(said.code, 3);
    assert!(
        said.err.contains("a.npy") && said.err.contains("x 5, y 0, z 0") && said.err.contains("the first of 2"),
        "{}",
        said.err
    );
    b.done("wavesplat", "convert a.npy -o a.wspl --missing-value -9999");
    b.done("wavesplat", "extract a.wspl -o back.npy");
    let bits = |v: &[f32]| [v[5], v[6], v[600]].map(f32::to_bits);
    assert_eq!(bits(&b.array("back.npy").1), bits(&values));
    let text = String::from_utf8(b.done("wavesplat", "verify a.wspl --against a.npy").out).unwrap();
    assert!(text.contains("3 missing samples as they were"), "{text}");
}

#[test]
fn help_has_examples() {
    let b = Bench::new(0);
    for (program, args) in [
        ("wavesplat", "--help"),
        ("wavesplat", "convert --help"),
        ("wavesplat", "info --help"),
        ("wavesplat", "verify --help"),
        ("wavesplat", "extract --help"),
        ("wavesplat-render", "--help"),
    ] {
        let text = String::from_utf8(b.done(program, args).out).unwrap();
        assert!(text.contains("Examples:"), "{program} {args}");
    }
    b.done("wavesplat", "--version");
    b.done("wavesplat-render", "--version");
}
