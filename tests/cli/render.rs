//! Pictures in every format, and the two methods compared with each other.

use super::{Work, floats, read_npy, small};
use std::collections::HashSet;

const SIZE: &str = "--size 48x40";

#[test]
fn a_pattern_numbers_png_files() {
    let work = Work::with_file("");
    work.render(&format!("a.wspl {SIZE} --frames 2,38 -o frame_%04d.png")).ok();
    assert_eq!(work.names(), ["a.npy", "a.wspl", "frame_0002.png", "frame_0038.png"]);
    let picture = decode_png(&work.read("frame_0002.png"));
    assert_eq!(picture.len(), 48 * 40 * 3);
    assert_eq!(picture[..3], [0; 3], "the corner is background");
    let colours: HashSet<&[u8]> = picture.chunks(3).collect();
    assert!(colours.len() > 20, "{} colours", colours.len());
    work.render(&format!("a.wspl {SIZE} --frames 2 -o one.png")).ok();
    assert!(work.read("one.png") == work.read("frame_0002.png"));
    work.render(&format!("a.wspl {SIZE} --frames 2 -o white.png --background ffffff")).ok();
    assert_eq!(decode_png(&work.read("white.png"))[..3], [255; 3]);
}

pub(crate) fn decode_png(bytes: &[u8]) -> Vec<u8> {
    let mut reader = png::Decoder::new(std::io::Cursor::new(bytes)).read_info().unwrap();
    let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
    reader.next_frame(&mut pixels).unwrap();
    pixels
}

#[test]
fn one_png_takes_one_frame() {
    let work = Work::with_file("");
    work.render("a.wspl -o one.png").fails(2, &["one.png", "40 frames", "frame_%04d.png"]);
    work.render("a.wspl -o frame_%x.png").fails(2, &["frame_%x.png", "%04d"]);
    assert_eq!(work.names(), ["a.npy", "a.wspl"]);
}

#[test]
fn each_view_has_its_own_name() {
    let work = Work::with_file("");
    work.render(&format!("a.wspl {SIZE} --frames 2 --view 30,30 --scale 1.5 -o plain.npy")).ok();
    work.render(&format!("a.wspl {SIZE} --frames 2 --view=-60,30 --orbit 4 --scale 1.5 -o view%02v.npy")).ok();
    work.render(&format!("a.wspl {SIZE} --frames 2 --orbit 2 -o c%v.npy --error-image e%v.npy")).ok();
    work.render(&format!("a.wspl {SIZE} --frames 2 --view 0,90 --view=-60,30 --scale 1.5 -o two%v.npy")).ok();
    let json = work.render(&format!("a.wspl {SIZE} --frames 2 --orbit 3 -o s%v.npy --json"));
    let scales: HashSet<&str> = json.text().lines().filter(|line| line.contains("scale")).collect();
    assert_eq!(scales.len(), 1, "a turn does not zoom");
    assert!(json.json()["range"].is_null(), "values have no colours");
    let json = work.render(&format!("a.wspl {SIZE} --frames 2 -o c.png --range 1,3 --json")).json();
    assert_eq!((json["range"][0].as_f64(), json["range"][1].as_f64()), (Some(1.0), Some(3.0)));
    let turned = |n: usize| work.read(&format!("view{n:02}.npy"));
    assert!(turned(0) == work.read("two1.npy") && turned(1) == work.read("plain.npy"));
    assert!(turned(0) != turned(2) && turned(1) != turned(3) && work.read("e1.npy").len() == turned(1).len());
    let run = work.render(&format!("a.wspl {SIZE} --view 1,2 --orbit 2 -o x%d.png"));
    run.fails(2, &["x%d.png", "2 views", "%v"]);
    work.render(&format!("a.wspl {SIZE} --orbit 2 -o -")).fails(2, &["one view"]);
    work.render(&format!("a.wspl {SIZE} --orbit 0 -o x%v.npy")).fails(2, &["--orbit"]);
    // No output is written twice, or over an input.
    let twice = work.render(&format!("a.wspl {SIZE} --frames 1,11 --orbit 12 -o x%v%d.png --force"));
    twice.fails(2, &["x111.png", "twice"]);
    let twice = work.render(&format!("a.wspl {SIZE} --orbit 11 -o p%v.npy --error-image p%02v.npy --force"));
    twice.fails(2, &["p10.npy", "--error-image"]);
    std::fs::copy(work.path("a.npy"), work.path("a0.npy")).unwrap();
    let replaced = work.render(&format!("a0.npy {SIZE} --method direct --orbit 2 -o a%v.npy --force"));
    replaced.fails(2, &["a0.npy", "would replace"]);
}

#[test]
fn arrays_hold_values_with_nan_for_background() {
    let work = Work::with_file("");
    work.render(&format!("a.wspl {SIZE} --frames 1:4 -o v.npy")).ok();
    let (header, values) = read_npy(&work.read("v.npy"));
    assert!(header.contains("'<f4'") && header.contains("(3, 40, 48)"), "{header}");
    let values = floats(&values);
    assert!(values[0].is_nan());
    let inside: Vec<f32> = values.iter().copied().filter(|v| !v.is_nan()).collect();
    assert!(inside.len() > values.len() / 4);
    assert!(inside.iter().all(|v| (-1.1..=1.9).contains(v)), "a mean leaves the range of the samples");
    work.render(&format!("a.wspl {SIZE} --frames 1:4 --colormap turbo -o c.npy")).ok();
    let (header, colours) = read_npy(&work.read("c.npy"));
    assert!(header.contains("'|u1'") && header.contains("(3, 40, 48, 3)"), "{header}");
    assert_eq!(colours.len(), 3 * 40 * 48 * 3);
    work.render(&format!("a.wspl {SIZE} --frames 1:4 --quantity emission -o e.npy")).ok();
    let emission = floats(&read_npy(&work.read("e.npy")).1);
    let brightest = emission.iter().fold(0.0, |m: f32, v| m.max(v.abs()));
    assert!(emission.iter().all(|v| !v.is_nan()));
    assert!(emission[0].abs() <= 1e-3 * brightest, "emission is nothing but what splatting errs by in the background");
}

#[test]
fn streams_have_the_sizes_that_readers_expect() {
    let work = Work::with_file("");
    let video = work.render(&format!("a.wspl {SIZE} --frames :3 --fps 30 -o - --format y4m")).ok().out;
    let header = b"YUV4MPEG2 W48 H40 F30:1 Ip A1:1 C420jpeg XCOLORRANGE=FULL\n";
    assert!(video.starts_with(header));
    assert_eq!(video.len(), header.len() + 3 * (6 + 48 * 40 * 3 / 2));
    for frame in 0..3 {
        assert_eq!(&video[header.len() + frame * (6 + 48 * 40 * 3 / 2)..][..6], b"FRAME\n");
    }
    let rgb = work.render(&format!("a.wspl {SIZE} --frames :3 -o - --format rgb24")).ok().out;
    assert_eq!(rgb.len(), 3 * 48 * 40 * 3);
    let gray = work.render(&format!("a.wspl {SIZE} --frames :3 -o - --format gray16")).ok().out;
    assert_eq!(gray.len(), 3 * 48 * 40 * 2);
    let pngs = work.render(&format!("a.wspl {SIZE} --frames :3 -o -")).ok().out;
    let starts = pngs.windows(8).filter(|w| w == b"\x89PNG\r\n\x1a\n").count();
    assert_eq!(starts, 3, "png is the default of a pipe");
    assert!(decode_png(&pngs) == rgb[..48 * 40 * 3]);
    for (name, stream) in [("v.y4m", video), ("v.rgb24", rgb), ("v.gray16", gray)] {
        work.render(&format!("a.wspl {SIZE} --frames :3 --fps 30 -o {name}")).ok();
        assert!(work.read(name) == stream, "{name}");
    }
    let npy = work.render(&format!("a.wspl {SIZE} --frames :3 -o - --format npy")).ok().out;
    work.render(&format!("a.wspl {SIZE} --frames :3 -o v.npy")).ok();
    assert!(npy == work.read("v.npy"));
}

#[test]
fn coefficients_and_frames_give_the_same_pictures() {
    let tolerance = 0.004;
    let work = Work::with_file(&format!("--tolerance {tolerance}"));
    small().write_frames(&work, "frames");
    let bound = tolerance * small().range();
    for options in ["", "--view -70,50 --roll 20", "--tau 0.2", "--region 3:15,2:12,1:8", "--sigma 1.5 --scale 2.2"] {
        let image = |input: &str| {
            work.render(&format!("{input} {SIZE} --frames 0,9,35 --splat-error 0 {options} -o i.npy --force")).ok();
            floats(&read_npy(&work.read("i.npy")).1)
        };
        let ours = image("a.wspl");
        for (input, bound) in [("a.wspl --method direct", 1e-5), ("frames --method direct", bound * 1.001)] {
            let theirs = image(input);
            assert_eq!(ours.len(), theirs.len());
            let worst = ours.iter().zip(&theirs).map(|(a, b)| {
                assert_eq!(a.is_nan(), b.is_nan(), "background differs: {input} {options}");
                if a.is_nan() { 0.0 } else { (a - b).abs() }
            });
            let worst = worst.fold(0.0, f32::max);
            assert!(worst <= bound, "{input} {options}: {worst:e} of {bound:e}");
            assert!(worst > 0.0 || !input.starts_with("frames"), "nothing was compressed");
        }
    }
}

#[test]
fn options_of_the_view_change_the_picture() {
    let work = Work::with_file("");
    let image =
        |options: &str| work.render(&format!("a.wspl --size 40x30 --frames 5 -o - --format npy {options}")).ok().out;
    let usual = image("");
    let others =
        ["--view 45,20", "--roll 30", "--tau 0.3", "--sigma 2", "--scale 1", "--center 3,3,3", "--region :9,:,:"];
    for other in others {
        assert!(image(other) != usual, "{other}");
    }
    assert!(image("--view 30,30 --roll 0 --tau 0 --no-mmap --memory 64MiB") == usual, "the defaults, said");
    let exact = floats(&read_npy(&image("--splat-error 0")).1);
    let near = floats(&read_npy(&usual).1);
    let worst = exact.iter().zip(&near).map(|(a, b)| (a - b).abs()).filter(|d| !d.is_nan()).fold(0.0, f32::max);
    assert!(worst <= 0.001 * small().range(), "{worst:e}");
}

#[test]
fn an_error_image_bounds_every_pixel() {
    let work = Work::with_file("--basis haar --tolerance 0.004");
    small().write_frames(&work, "frames");
    let options = format!("{SIZE} --frames 0,9,35 --force");
    work.render(&format!("frames --method direct --splat-error 0 {options} -o truth.npy")).ok();
    let truth = floats(&read_npy(&work.read("truth.npy")).1);
    let mut largest = Vec::new();
    for looser in ["", "--tolerance 0.02", "--tolerance 0.3"] {
        let run = format!("a.wspl {looser} {options} -o v.npy --error-image e.npy --json -v");
        let run = work.render(&run).ok();
        assert!(run.err.contains("no pixel is off by more than"), "{}", run.err);
        let certified = run.json()["certified_error"].as_f64().unwrap();
        let (values, errors) = (floats(&read_npy(&work.read("v.npy")).1), floats(&read_npy(&work.read("e.npy")).1));
        for ((value, error), truth) in values.iter().zip(&errors).zip(&truth) {
            assert_eq!(value.is_nan(), error.is_nan());
            assert!(value.is_nan() || (value - truth).abs() <= *error && f64::from(*error) <= certified, "{looser}");
        }
        largest.push(certified);
    }
    assert!(largest.is_sorted() && largest[0] <= 0.004001 * f64::from(small().range()), "{largest:?}");
    assert!(largest[2] > 2.0 * largest[0] && largest[2] <= 0.3001 * f64::from(small().range()), "{largest:?}");
    work.render(&format!("a.wspl {options} -o v_%d.png --error-image e_%d.png")).ok();
    assert!(["v_0.png", "e_0.png", "e_35.png"].iter().all(|n| work.names().contains(&n.to_string())));
    work.render(&format!("frames --method direct {options} -o v.npy --error-image e.npy")).ok();
}

#[test]
fn errors_and_tolerances_that_make_no_sense_are_refused() {
    let work = Work::with_file("--tolerance 0.004");
    small().write_frames(&work, "frames");
    let bad = |options: &str, words: &[&str]| drop(work.render(&format!("{options} -o v.npy")).fails(2, words));
    bad("a.wspl --error-image v.npy", &["--error-image", "different names"]);
    bad("a.wspl --error-image -", &["--error-image", "not standard output"]);
    bad("a.wspl --error-image e.png", &["e.png", "frame_%04d.png"]);
    bad("a.wspl --error-image e", &["e: has no extension"]);
    bad("a.wspl --tolerance 0.0001", &["--tolerance", "e-3 of its range off"]);
    bad("a.wspl --tolerance nan", &["--tolerance", "0 to 1"]);
    bad("a.wspl --tolerance 2", &["--tolerance", "0 to 1"]);
    bad("frames --method direct --tolerance 0.1", &["--tolerance", "--method coefficients"]);
    assert_eq!(work.names(), ["a.npy", "a.wspl", "frames"]);
}

#[test]
fn memory_changes_no_pixel() {
    let work = Work::with_file("--block 8");
    let options = "a.wspl --size 150x130 -o - --format npy";
    let least = work.render(&format!("{options} --memory 1MiB")).fails(2, &["--memory"]).mebibytes();
    let tight = work.render(&format!("{options} --memory {least}MiB")).ok().out;
    assert!(tight == work.render(options).ok().out);
}

#[test]
fn the_report_is_json() {
    let work = Work::with_file("");
    let report = work.render(&format!("a.wspl {SIZE} -o v.npy --json")).ok().json();
    assert_eq!(report["frames"], 40);
    let run = work.render(&format!("a.wspl {SIZE} -o - --format rgb24 --json")).ok();
    assert_eq!(run.out.len(), 40 * 48 * 40 * 3, "data alone");
    assert!(run.err.contains("\"stated_splat_error\""));
}

#[test]
fn a_coarse_picture_has_the_framing_of_the_whole() {
    let work = Work::with_file("--block 8");
    let picture = |work: &Work, more: &str| {
        let size = if more.contains("--size") { "" } else { SIZE };
        let command = format!("a.wspl {size} --frames 2,38 --range 0,1 {more} -o all.npy --force");
        work.render(&command).ok();
        floats(&read_npy(&work.read("all.npy")).1)
    };
    for mode in
        ["", "--mode mip", "--mode composite --transfer-function turbo --opacity 0:0,1:1", "--region 2:18,:,1:9"]
    {
        let whole = picture(&work, mode);
        let coarse = picture(&work, &format!("{mode} --lod 1"));
        assert_eq!(coarse.len(), whole.len(), "{mode}");
        let seen = whole.iter().zip(&coarse).filter(|(a, b)| !a.is_nan() && !b.is_nan()).collect::<Vec<_>>();
        let in_one = whole.iter().zip(&coarse).filter(|(a, b)| a.is_nan() != b.is_nan()).count();
        assert!(in_one * 4 < seen.len(), "{mode}: {in_one} pixels in one picture alone, {} in both", seen.len());
        let largest = seen.iter().fold(0.0, |largest: f32, (a, _)| largest.max(a.abs()));
        let off: f32 = seen.iter().map(|(a, b)| (*a - *b).abs()).sum::<f32>() / seen.len() as f32;
        assert!(off > 0.0 && off < 0.08 * largest, "{mode}: {off} of {largest}");
    }
    let few_pixels = |more: &str| picture(&work, &format!("--size 12x10 {more}"));
    let bits = |picture: Vec<f32>| picture.into_iter().map(f32::to_bits).collect::<Vec<_>>();
    assert_eq!(bits(few_pixels("--lod auto")), bits(few_pixels("--lod 1")));
    work.render("a.wspl -o b.npy --lod 9").fails(2, &["--lod", "takes at most 3"]);
    work.render("a.wspl -o b.npy --region 1:2,:,: --lod 1").fails(2, &["--region", "no voxel with --lod 1"]);
    let told = work.render("a.wspl --size 12x10 --frames 2 --lod auto -o b.npy --json").ok();
    assert!(told.err.contains("--lod auto takes level 1 of 3"), "{}", told.err);
    assert_eq!(told.json()["picture"]["lod"], 1);
    work.render("a.npy -o b.npy --method direct --lod 1").fails(2, &["--lod", "coefficient file"]);
}
