//! Colour maps and their files, annotations in pictures, and files that hold all pictures of a run.

use super::render::decode_png;
use super::{Archive, Work, floats, read_npy};
use std::io::Cursor;

const SIZE: &str = "--size 48x40";

const MAPS: &str = r#"[
    {"Name": "Grey", "ColorSpace": "RGB", "RGBPoints": [-1, 0, 0, 0, 2, 1, 1, 1]},
    {"Name": "Far", "ColorSpace": "Diverging", "RGBPoints": [100, 0, 0, 1, 101, 1, 0, 0]}]"#;

#[test]
fn a_map_file_sets_the_range() {
    let work = Work::with_file("");
    work.write("maps.json", MAPS);
    work.write("map.csv", "# grey\nvalue,red,green,blue\n-1,0,0,0\n2,255,255,255\n");
    let render = |options: &str| decode_png(&work.render(&format!("a.wspl {SIZE} --frames 2 -o - {options}")).ok().out);
    let grey = render("--colormap grey --range=-1,2");
    assert!(render("--colormap maps.json#Grey") == grey && render("--colormap map.csv") == grey);
    assert!(render("--colormap maps.json#Grey --range 0,1") == render("--colormap grey --range 0,1"));
    assert!(render("--colormap map.csv --range 0.1,1 --norm log") != render("--colormap map.csv --range 0.1,1"));
    let far = work.render(&format!("a.wspl {SIZE} --frames 2 -o far.png --colormap maps.json#Far")).ok();
    assert!(far.err.contains("1.0000e2 to 1.0100e2") && far.err.contains("--range"), "{}", far.err);
    let quiet = work.render(&format!("a.wspl {SIZE} --frames 2 -o near.png --colormap maps.json#Grey")).ok();
    assert!(quiet.err.is_empty(), "{}", quiet.err);
}

#[test]
fn unreadable_maps_are_named_with_the_expected_form() {
    let work = Work::with_file("");
    work.write("maps.json", MAPS);
    work.write("cut.json", &MAPS[..90]);
    work.write("bad.csv", "0,0,0,0\n1,1,x,1\n");
    let render = |map: &str| work.render(&format!("a.wspl --frames 2 -o out.png --colormap {map}"));
    render("maps.json").fails(3, &["maps.json", "2 maps", "FILE#NAME", "Grey, Far"]);
    render("maps.json#Red").fails(3, &["maps.json", "no map 'Red'", "Grey, Far"]);
    render("cut.json").fails(3, &["cut.json", "ParaView"]);
    render("bad.csv").fails(3, &["bad.csv", "line 2", "a number for green"]);
    render("none.csv").fails(1, &["none.csv"]);
    assert_eq!(work.names(), ["a.npy", "a.wspl", "bad.csv", "cut.json", "maps.json"]);
}

/// The least and the largest value of pictures.
fn extremes(values: &[f32]) -> [f64; 2] {
    let present = values.iter().filter(|v| !v.is_nan()).map(|v| f64::from(*v));
    present.fold([f64::INFINITY, f64::NEG_INFINITY], |[lo, hi], v| [lo.min(v), hi.max(v)])
}

#[test]
fn automatic_ranges_are_near_those_of_all_voxels_in_all_frames() {
    let work = Work::new();
    work.write("a.npy", Archive::smooth([90, 76, 80], 5).npy());
    work.wavesplat("convert a.npy -o a.wspl --window 4").ok();
    work.wavesplat("convert a.npy -o haar.wspl --window 4 --basis haar --space none").ok();
    for input in ["a.wspl", "haar.wspl", "a.npy --method direct"] {
        for mode in ["--beyond none", "--quantity emission", "--mode mip"] {
            work.render(&format!("{input} --size 64x64 {mode} -o all.npy --force")).ok();
            let [lo, hi] = extremes(&floats(&read_npy(&work.read("all.npy")).1));
            let range = |options: &str| {
                let options = format!("{input} {SIZE} {mode} -o a.png --force --json {options}");
                let json = work.render(&options).ok().json();
                [0, 1].map(|i| json["range"][i].as_f64().unwrap())
            };
            let found = range("--frames 2 --threads 1 --memory 60MiB");
            let off = (found[0] - lo).abs().max((found[1] - hi).abs());
            assert!(off <= 0.1 * (hi - lo), "{input} {mode}: {found:?} instead of {lo} to {hi}");
            assert_eq!(range("--frames 4 --threads 3"), found, "{input} {mode}");
        }
    }
}

#[test]
fn automatic_ranges_depend_on_the_map_and_the_norm() {
    let work = Work::with_file("");
    let range = |options: &str| {
        let json = work.render(&format!("a.wspl {SIZE} --frames 2 -o a.png --force --json {options}")).ok().json();
        [0, 1].map(|i| json["range"][i].as_f64().unwrap())
    };
    let [lo, hi] = range("--beyond none");
    assert!(lo < 0.0 && 0.0 < hi);
    let most = hi.max(-lo);
    assert_eq!(range("--beyond none --colormap coolwarm"), [-most, most]);
    let [inner, outer] = range("");
    assert!(lo < inner && outer < hi, "short rays have the extremes");
    let [least, most] = range("--norm log");
    assert!(most == hi && hi * 1e-4 <= least && least < hi);
    assert_eq!(range("--norm log --range 1,10"), [1.0, 10.0]);
}

/// A volume of ones shows the lengths of the rays, and so how other values are weighed.
#[test]
fn means_are_weighed_by_the_lengths_of_their_rays() {
    let work = Work::with_file("");
    work.write("ones.npy", Archive::of([20, 14, 10], 3, |_, _, _, _| 1.0).npy());
    let picture = |options: &str| {
        let common = format!("{SIZE} --frames 2 --format gray16 -o -");
        let bytes = work.render(&format!("{options} {common}")).ok().out;
        bytes.chunks_exact(2).map(|two| f64::from(u16::from_le_bytes([two[0], two[1]])) / 65535.0).collect::<Vec<_>>()
    };
    let lengths = picture("ones.npy --method direct --beyond 0 --range 0,1");
    let shown = picture("a.wspl --beyond=-1 --range=-3,4").into_iter().map(|share| share * 7.0 - 3.0);
    work.render(&format!("a.wspl {SIZE} --frames 2 -o v.npy")).ok();
    let means = floats(&read_npy(&work.read("v.npy")).1);
    let mut seen = [0; 2];
    for ((mean, shown), length) in means.iter().zip(shown).zip(lengths).filter(|((mean, _), _)| !mean.is_nan()) {
        let expected = -1.0 + length * (f64::from(*mean) + 1.0);
        assert!((shown - expected).abs() < 7e-4, "{shown} instead of {expected} for {mean}, {length}");
        seen[usize::from(length > 0.999)] += 1;
    }
    assert!(seen.iter().all(|count| *count > 30), "short and long rays: {seen:?}");
    work.render("a.wspl -o x.png --beyond far").fails(2, &["--beyond", "auto, none, or a value"]);
}

#[test]
fn the_time_and_the_colours_are_drawn_into_pictures() {
    let work = Work::with_file("");
    let render = |options: &str| decode_png(&work.render(&format!("a.wspl --frames 2 -o - {options}")).ok().out);
    let beside = render("--size 200x160 --annotate --colormap grey");
    let below_the_bar = beside.chunks(600).skip(132).flat_map(|row| &row[3 * 110..]);
    assert!(below_the_bar.into_iter().all(|v| *v == 0), "the volume is beside the bar");
    let render = |options: &str| render(&format!("--scale 9 {options}"));
    let differ = |a: &[u8], b: &[u8]| a.chunks(3).zip(b.chunks(3)).map(|(a, b)| a != b).collect::<Vec<_>>();
    let (plain, drawn) = (render("--size 200x160"), render("--size 200x160 --annotate"));
    let changed = differ(&plain, &drawn);
    assert!(drawn.len() == plain.len() && changed[..200 * 30].contains(&true), "the time");
    assert!(changed[200 * 80 + 170..200 * 81].contains(&true), "the bar");
    assert!(!changed[200 * 80..200 * 80 + 100].contains(&true), "the rest");
    let light = render("--size 200x160 --annotate --background ffffff");
    assert!(light[..200 * 30 * 3].iter().any(|v| *v < 100), "black on white");
    assert!(render("--size 16x16 --annotate") == render("--size 16x16"), "there is no room");
    let array =
        format!("a.wspl {SIZE} --frames 2 --annotate --colormap grey -o a%v.npy --error-image e%v.npy --orbit 2");
    work.render(&array).ok();
}

#[test]
fn a_moving_png_has_all_frames() {
    let work = Work::with_file("");
    work.render(&format!("a.wspl {SIZE} --frames :3 --fps 30 -o a.apng")).ok();
    let rgb = work.render(&format!("a.wspl {SIZE} --frames :3 -o - --format rgb24")).ok().out;
    let mut reader = png::Decoder::new(Cursor::new(work.read("a.apng"))).read_info().unwrap();
    let control = *reader.info().animation_control().unwrap();
    assert_eq!((control.num_frames, control.num_plays), (3, 0), "without end");
    for picture in rgb.chunks(48 * 40 * 3) {
        let mut pixels = vec![0; picture.len()];
        reader.next_frame(&mut pixels).unwrap();
        assert!(pixels == picture);
        let frame = *reader.info().frame_control().unwrap();
        assert_eq!((frame.delay_num, frame.delay_den), (1, 30));
    }
    let piped = work.render(&format!("a.wspl {SIZE} --frames :3 --fps 30 -o - --format apng")).ok().out;
    assert!(piped == work.read("a.apng"));
}

#[test]
fn a_sheet_has_all_pictures_in_rows() {
    let work = Work::with_file("");
    work.render(&format!("a.wspl {SIZE} --frames :3 -o a.png --format sheet --background 010203")).ok();
    let rgb = work.render(&format!("a.wspl {SIZE} --frames :3 -o - --format rgb24 --background 010203")).ok().out;
    let sheet = decode_png(&work.read("a.png"));
    assert_eq!(sheet.len(), 96 * 80 * 3);
    let row = |x: usize, y: usize| &sheet[(y * 96 + x) * 3..][..48 * 3];
    let of = |picture: usize, y: usize| &rgb[(picture * 40 + y) * 48 * 3..][..48 * 3];
    for y in 0..40 {
        assert!(row(0, y) == of(0, y) && row(48, y) == of(1, y) && row(0, y + 40) == of(2, y), "{y}");
        assert!(row(48, y + 40).chunks(3).all(|pixel| pixel == [1, 2, 3]), "{y}");
    }
    let large = work.render("a.wspl --size 20000x20000 --frames :4 -o b.png --format sheet");
    large.fails(2, &["4 pictures", "40000x40000", "32768", "--size"]);
    work.render("a.wspl -o b.sheet").fails(2, &["b.sheet", "no pictures are written as .sheet", ".apng"]);
    work.render("a.wspl -o b_%d.png --format sheet").fails(2, &["b_%d.png", "all frames"]);
    let room = "--size 2000x2000 --frames :9 -o b.png --format sheet --memory 200MiB";
    let asked = work.render(&format!("a.wspl {room}"));
    assert!(asked.mebibytes() > 200, "{}", asked.err);
}

#[test]
fn several_views_of_one_frame_make_a_turntable() {
    let work = Work::with_file("");
    let render = |options: &str| work.render(&format!("a.wspl {SIZE} --range 0,1 --frames 2 --orbit 3 {options}")).ok();
    render("-o view%v.npy");
    render("-o all.npy");
    let (header, values) = read_npy(&work.read("all.npy"));
    assert!(header.contains("(3, 40, 48)"), "{header}");
    let each: Vec<u8> = (0..3).flat_map(|view| read_npy(&work.read(&format!("view{view}.npy"))).1).collect();
    assert!(values == each);
    render("-o view%v.rgb24");
    let each: Vec<u8> = (0..3).flat_map(|view| work.read(&format!("view{view}.rgb24"))).collect();
    assert!(render("-o - --format rgb24").out == each);
    render("-o turn.apng --error-image errors.y4m");
    assert_eq!(work.read("errors.y4m").windows(6).filter(|w| w == b"FRAME\n").count(), 3);
    let several = work.render(&format!("a.wspl {SIZE} --frames 2,3 --orbit 3 -o all.y4m"));
    several.fails(2, &["all.y4m", "3 views", "%v"]);
}

#[test]
fn each_annotation_can_be_drawn_alone() {
    let work = Work::with_file("");
    let shown = |options: &str| {
        let common = "a.wspl --frames 2 --size 320x240 --scale 6 --clear=-1e9,1e9"; // nothing hides the box
        decode_png(&work.render(&format!("{common} -o - {options}")).ok().out)
    };
    let plain = shown("");
    assert!(shown("--annotate=none") == plain);
    let parts = ["box", "axes", "triad", "scale", "bar", "time"].map(|part| shown(&format!("--annotate={part}")));
    for (n, one) in parts.iter().enumerate() {
        assert!(*one != plain && parts.iter().skip(n + 1).all(|other| other != one), "part {n}");
    }
    assert!(
        shown("--annotate") == shown("--annotate=box,axes,bar,time") && shown("--annotate") != shown("--annotate=all")
    );
    assert!(shown("--title Words") != plain);
    let light = shown("--theme light --annotate=time");
    assert!(light[light.len() - 3..] == [255; 3] && shown("--theme light --background 102030")[..3] == [16, 32, 48]);
    let json = work.render("a.wspl --frames 2 -o t.png --title Words --annotate=bar --json").ok().json();
    assert_eq!((json["picture"]["annotate"].as_str(), json["picture"]["title"].as_str()), (Some("bar"), Some("Words")));
    work.render("a.wspl -o t.png --annotate=bars").fails(2, &["--annotate", "'bars'", "triad"]);
    work.render("a.wspl -o t.npy --title Words").fails(2, &["--annotate"]);
}

#[test]
fn annotations_do_not_cover_the_volume() {
    let work = Work::with_file("");
    for view in ["iso", "top", "front", "30,30", "200,-40"] {
        let shown = |options: &str| {
            let common = "--size 400x300 --frames 2 --clear none --background 0000ff --range 0,3";
            decode_png(&work.render(&format!("a.wspl --view {view} {common} -o - {options}")).ok().out)
        };
        let json = work.render(&format!("a.wspl --view {view} --size 400x300 --frames 2 --annotate --json -o j.png"));
        let of_view = &json.ok().json()["views"][0];
        let center: Vec<String> = of_view["center"].as_array().unwrap().iter().map(ToString::to_string).collect();
        let alone = shown(&format!("--scale {} --center={}", of_view["scale"], center.join(",")));
        let annotated = shown("--annotate");
        let changed = alone.chunks(3).zip(annotated.chunks(3)).filter(|(a, b)| **a != [0, 0, 255] && a != b).count();
        assert!(changed == 0, "{view}: {changed} pixels of the volume are covered");
        assert!(annotated != alone);
    }
}

/// The title that a PNG holds in UTF-8, and in Latin-1.
fn titles(bytes: &[u8]) -> [Option<String>; 2] {
    let reader = png::Decoder::new(Cursor::new(bytes)).read_info().unwrap();
    let (key, info) = ("wavesplat:title", reader.info());
    let new = info.utf8_text.iter().find(|text| text.keyword == key).map(|text| text.get_text().unwrap());
    let old = info.uncompressed_latin1_text.iter().find(|text| text.keyword == key).map(|text| text.text.clone());
    [new, old]
}

#[test]
fn titles_have_any_letters() {
    let work = Work::with_file("");
    for (title, is_new) in [("σ", true), ("a–b", true), ("10⁶水", true), ("Größe:µm", false), ("plain", false)]
    {
        let expected = if is_new { [Some(title.to_string()), None] } else { [None, Some(title.to_string())] };
        for (name, options) in
            [("a.png", "--frames 2"), ("a.apng", "--frames 2:4"), ("s.png", "--frames 2:5 --format sheet")]
        {
            // Each run replaces the file of the one before.
            work.render(&format!("a.wspl --size 200x160 {options} -o {name} --annotate --title {title}")).ok();
            assert_eq!(titles(&work.read(name)), expected, "{name} {title}");
        }
    }
}

#[test]
fn long_titles_are_cut_with_a_note() {
    let work = Work::with_file("");
    let title = ["a"; 60].join("_");
    let draw = |size: &str, title: &str| {
        work.render(&format!("a.wspl --frames 2 --size {size} --annotate --title {title} --force -o t.png")).ok()
    };
    for (size, is_cut) in [("320x240", true), ("1200x240", false), ("40x30", false)] {
        let run = draw(size, &title);
        assert!(run.err.contains("it shows 'a_a_") == is_cut && run.err.contains("--title") == is_cut, "{}", run.err);
        assert_eq!(titles(&work.read("t.png"))[1].as_deref(), Some(title.as_str()), "the file keeps all of it");
    }
    let pixels = |title: &str| {
        draw("512x512", title).ok();
        decode_png(&work.read("t.png"))
    };
    let ([long, other], short) = (["a", "b"].map(|end| pixels(&format!("{}{end}", &title[..70]))), pixels("a"));
    assert!(long != short && long != other, "smaller letters show all of it");
}

#[test]
fn the_label_of_the_colour_bar_can_be_chosen() {
    let work = Work::with_file("");
    let shown = |options: &str| {
        decode_png(&work.render(&format!("a.wspl --frames 2 --size 320x240 --annotate -o - {options}")).ok().out)
    };
    assert!(shown("--bar-title Speed") != shown("") && shown("--bar-title Speed") != shown("--bar-title Depth"));
    let json = work.render("a.wspl --frames 2 -o t.png --annotate --bar-title Speed --json").ok().json();
    assert_eq!(json["picture"]["bar_title"].as_str(), Some("Speed"));
}

/// A pulse in few of many frames.
#[test]
fn pages_open_where_there_is_something_to_see() {
    let work = Work::new();
    let pulse =
        |x: usize, y: usize, _: usize, t: usize| if t == 9 && x.abs_diff(8) + y.abs_diff(8) < 4 { 1.0 } else { 0.0 };
    work.write("pulse.npy", Archive::of([16, 16, 8], 24, pulse).npy());
    work.write("waves.npy", Archive::smooth([16, 16, 8], 24).npy());
    for (input, opening) in [("pulse", 9), ("waves", 12)] {
        work.render(&format!("{input}.npy --method direct --size 40x40 -o {input}.html")).ok();
        let page = String::from_utf8(work.read(&format!("{input}.html"))).unwrap();
        assert!(page.contains(&format!("\"opening\":{opening},")), "{input}");
    }
}

/// A surface has the colour of its own, which no bar explains.
#[test]
fn isosurfaces_are_listed_instead_of_a_bar() {
    let work = Work::with_file("");
    let picture = |options: &str| {
        decode_png(&work.render(&format!("a.wspl --frames 2 --size 300x240 --annotate=bar {options} -o -")).ok().out)
    };
    let right = |pixels: &[u8]| -> Vec<[u8; 3]> {
        let rows = pixels.chunks(900).flat_map(|row| row[3 * 240..].chunks(3));
        rows.map(|rgb| [rgb[0], rgb[1], rgb[2]]).collect()
    };
    let shown = right(&picture("--iso 0.5:ff0000:1,1:00ff00:1"));
    let count = |colour: [u8; 3]| shown.iter().filter(|pixel| **pixel == colour).count();
    let [red, green] = [count([255, 0, 0]), count([0, 255, 0])];
    assert!(red > 40 && green == red, "two swatches: {red} {green}");
    let first = |colour: [u8; 3]| shown.iter().position(|pixel| *pixel == colour).unwrap();
    assert!(first([0, 255, 0]) < first([255, 0, 0]), "the larger value is above");
    let coloured = shown.iter().filter(|[r, g, b]| r != g || g != b).count();
    assert_eq!(coloured, red + green, "there is no bar");
}
