//! Pictures beyond 8-bit colours: 16 bits per channel, unchanged numbers, and provenance.

use super::render::decode_png;
use super::{Work, floats, read_npy};
use std::collections::{BTreeMap, HashSet};
use std::io::Cursor;

const SIZE: &str = "--size 48x40";

/// The levels of a PNG with 16 bits per channel, and its number of channels.
fn decode_deep(bytes: &[u8]) -> (Vec<u16>, usize) {
    let reader = png::Decoder::new(Cursor::new(bytes)).read_info().unwrap();
    let (colours, depth) = reader.output_color_type();
    assert_eq!(depth, png::BitDepth::Sixteen);
    let levels = decode_png(bytes).as_chunks::<2>().0.iter().map(|b| u16::from(b[0]) << 8 | u16::from(b[1])).collect();
    (levels, colours.samples())
}

/// The description that a PNG holds.
fn texts(bytes: &[u8]) -> BTreeMap<String, String> {
    let reader = png::Decoder::new(Cursor::new(bytes)).read_info().unwrap();
    let texts = reader.info().uncompressed_latin1_text.iter();
    texts.map(|text| (text.keyword.clone(), text.text.clone())).collect()
}

#[test]
fn sixteen_bits_of_grey_hold_the_values() {
    let work = Work::with_file("");
    let options = format!("a.wspl {SIZE} --frames 2 --range=-1,1.5 --beyond none");
    work.render(&format!("{options} -o v.npy")).ok();
    work.render(&format!("{options} -o grey.png --depth 16 --colormap grey")).ok();
    work.render(&format!("{options} -o v.gray16")).ok();
    let (levels, channels) = decode_deep(&work.read("grey.png"));
    assert_eq!((levels.len(), channels), (48 * 40, 1));
    let level = |v: f32| ((f64::from(v) + 1.0) / 2.5).clamp(0.0, 1.0) * 65535.0;
    let expected = |v: &f32| if v.is_nan() { 0 } else { level(*v).round() as u16 };
    assert!(levels == floats(&read_npy(&work.read("v.npy")).1).iter().map(expected).collect::<Vec<_>>());
    assert!(levels.iter().flat_map(|level| level.to_le_bytes()).collect::<Vec<u8>>() == work.read("v.gray16"));
    let piped = work.render(&format!("{options} -o - --depth 16 --colormap grey")).ok().out;
    assert!(piped == work.read("grey.png"));
}

#[test]
fn sixteen_bits_of_colours_round_to_those_of_8_bits() {
    let work = Work::with_file("");
    let options = "a.wspl --frames 2,9 --range=-1,1.5 --colormap turbo --background 102030";
    for more in ["--size 48x40", "--annotate --size 200x160", "--mode mip --size 48x40"] {
        let render = |depth| work.render(&format!("{options} {more} -o - --format sheet --depth {depth}")).ok().out;
        let (shallow, (deep, channels)) = (decode_png(&render(8)), decode_deep(&render(16)));
        assert_eq!((deep.len(), channels), (shallow.len(), 3), "{more}");
        let apart = deep.iter().zip(&shallow).map(|(deep, level)| (f64::from(*deep) / 257.0 - f64::from(*level)).abs());
        assert!(apart.fold(0.0, f64::max) < 0.51, "{more}");
        assert!(deep.iter().collect::<HashSet<_>>().len() > 1000, "{more}");
    }
    let options = format!("{options} {SIZE}");
    work.render(&format!("{options} -o a.apng --depth 16")).ok();
    work.render(&format!("{options} -o b_%d.png --depth 16")).ok();
    let (moving, still) = (decode_png(&work.read("a.apng")), decode_png(&work.read("b_2.png")));
    assert!(moving == still && moving.len() == 48 * 40 * 6);
    for format in ["npy", "rgb24", "y4m", "gray16"] {
        work.render(&format!("{options} -o c.{format} --depth 16")).fails(2, &["--depth 16", "png"]);
    }
    work.render(&format!("{options} -o c.png --depth 12")).fails(2, &["--depth", "8 or 16"]);
}

#[test]
fn a_png_holds_its_provenance_and_nothing_else() {
    let work = Work::with_file("--tolerance 0.004");
    let options =
        "--size 48x40 --frames 9 --view=-20,35 --colormap turbo --range 0,1.5 --norm linear --tau 0.1 --tolerance 0.02";
    let render = |more: &str, name: &str| {
        work.render(&format!("a.wspl {options} {more} -o {name} --error-image e_{name}")).ok();
        work.read(name)
    };
    let one = render("--threads 1", "one.png");
    assert!(one == render("--threads 2 --memory 40MiB --no-mmap", "two.png"), "the same bytes");
    let said = texts(&one);
    let info = work.wavesplat("info a.wspl --json").ok().json();
    let expected = [
        ("Software", concat!("wavesplat-render ", env!("CARGO_PKG_VERSION"))),
        ("wavesplat:view", "-20,35"),
        ("wavesplat:size", "48,40"),
        ("wavesplat:frames", "9"),
        ("wavesplat:range", "0.0,1.5"),
        ("wavesplat:colormap", "turbo"),
        ("wavesplat:norm", "linear"),
        ("wavesplat:tau", "0.1"),
        ("wavesplat:mode", "projection"),
        ("wavesplat:quantity", "mean"),
        ("wavesplat:tolerance", "0.02"),
        ("wavesplat:shows", "picture"),
        ("wavesplat:file_id", info["id"].as_str().unwrap()),
        ("wavesplat:file_promise", info["promise"].as_str().unwrap()),
    ];
    for (key, value) in expected {
        assert_eq!(said.get(key).map(String::as_str), Some(value), "{key}: {said:?}");
    }
    for key in
        ["roll", "scale", "center", "sigma", "splat_error", "stated_splat_error", "sample_error", "certified_error"]
    {
        assert!(said.contains_key(&format!("wavesplat:{key}")), "{key}: {said:?}");
    }
    assert!(!format!("{said:?}").contains("a.wspl"), "{said:?}");
    let of_error = texts(&work.read("e_one.png"));
    assert_eq!(of_error["wavesplat:shows"], "certified-error");
    assert_ne!(of_error["wavesplat:range"], "0.0,1.5");
    // Makes the same picture again from its own description.
    let again = format!("--scale {} --center {}", said["wavesplat:scale"], said["wavesplat:center"]);
    assert!(decode_png(&render(&again, "again.png")) == decode_png(&one));
}

#[test]
fn a_file_of_pictures_names_times_views_and_frames() {
    let work = Work::with_file("");
    let said = |options: &str| {
        work.render(&format!("a.wspl {SIZE} --range 0,1 --force {options}")).ok();
        texts(&work.read("p.png"))
    };
    let sheet = said("--frames 3:30:3 --format sheet -o p.png");
    assert_eq!((sheet["wavesplat:frames"].as_str(), sheet["wavesplat:view"].as_str()), ("3:28:3", "30,30"));
    let turn = said("--frames 3 --orbit 3 --format sheet -o p.png");
    assert_eq!(turn["wavesplat:view"], "30,30 150,30 270,30");
    assert_eq!((turn["wavesplat:frames"].as_str(), turn["wavesplat:roll"].as_str()), ("3", "0"));
    let moving = said("--frames :4 --format apng -o p.png");
    assert_eq!(moving["wavesplat:frames"], "0:4");
    let composite = said("--frames 1 --mode composite --opacity 0:0,1:0.5 --slices 2 -o p.png");
    assert_eq!((composite["wavesplat:cells"].as_str(), composite["wavesplat:opacity"].as_str()), ("2", "0:0,1:0.5"));
    assert!(composite["wavesplat:slices"].parse::<usize>().unwrap() > 20);
    assert_eq!(composite["wavesplat:transfer_function"], "viridis from 0 to 1");
    assert!(!composite.contains_key("wavesplat:colormap") && !composite.contains_key("wavesplat:quantity"));
}

#[test]
fn a_sidecar_has_the_report_with_what_made_the_pictures() {
    let work = Work::with_file("");
    let options = format!("a.wspl {SIZE} --frames 2,5 --tolerance 0.05 --colormap grey");
    let printed = work.render(&format!("{options} -o p_%d.png --sidecar p.json --json")).ok();
    let written: serde_json::Value = serde_json::from_slice(&work.read("p.json")).unwrap();
    assert!(printed.json() == written && printed.out == work.read("p.json"));
    let (picture, said) = (&written["picture"], texts(&work.read("p_5.png")));
    assert_eq!(picture["frames"], serde_json::json!([2, 5]));
    assert_eq!(picture["file_id"], said["wavesplat:file_id"]);
    assert_eq!(picture["sigma"].to_string(), said["wavesplat:sigma"]);
    assert!(written["views"][0]["center"].is_array() && picture["range"] == written["range"]);
    assert!(written["certified_sample_error"].as_f64().unwrap() <= picture["sample_error"].as_f64().unwrap());
    let refused = |more: &str, words: &[&str]| drop(work.render(&format!("{options} {more}")).fails(2, words));
    work.write("q.json", "{}");
    refused("-o q_%d.png --sidecar q.json", &["q.json", "exists", "--force"]);
    work.render(&format!("{options} -o p_%d.png --sidecar p.json")).ok();
    refused("-o q_%d.png --sidecar -", &["--sidecar", "file"]);
    refused("-o q_%d.png --sidecar q_2.png", &["q_2.png", "--sidecar"]);
    refused("-o q_%d.png --sidecar a.wspl --force", &["a.wspl"]);
    assert_eq!(work.names(), ["a.npy", "a.wspl", "p.json", "p_2.png", "p_5.png", "q.json"]);
}

/// The channels of an OpenEXR file by name, and its comments.
#[cfg(feature = "exr")]
fn decode_exr(bytes: &[u8]) -> (BTreeMap<String, Vec<f32>>, String) {
    use exr::prelude::*;
    let reader = read().no_deep_data().largest_resolution_level().all_channels().first_valid_layer().all_attributes();
    let layer = reader.from_buffered(Cursor::new(bytes)).unwrap().layer_data;
    let channels = layer.channel_data.list.iter();
    let channels = channels.map(|c| (c.name.to_string(), c.sample_data.values_as_f32().collect())).collect();
    (channels, layer.attributes.comments.unwrap().to_string())
}

#[cfg(feature = "exr")]
#[test]
fn an_exr_holds_the_numbers_of_an_array_and_what_made_it() {
    let work = Work::with_file("");
    let modes = [("", &["Y"][..]), ("--mode mip", &["Y"]), ("--mode composite", &["R", "G", "B", "A"])];
    for (mode, names) in modes {
        let options = format!("a.wspl {SIZE} --frames 2,9 --range 0,1 --force {mode}");
        work.render(&format!("{options} -o v.npy")).ok();
        work.render(&format!("{options} -o p_%d.exr --threads 1")).ok();
        let (pictures, both) = (read_npy(&work.read("v.npy")).1, [2, 9].map(|n| work.read(&format!("p_{n}.exr"))));
        for (file, numbers) in both.iter().zip(floats(&pictures).chunks(48 * 40 * names.len())) {
            let (channels, comments) = decode_exr(file);
            assert_eq!(channels.len(), names.len(), "{mode}");
            for (i, name) in names.iter().enumerate() {
                let bits = |v: &f32| if v.is_nan() { u32::MAX } else { v.to_bits() };
                let expected = numbers.iter().skip(i).step_by(names.len()).map(bits);
                assert!(expected.eq(channels[*name].iter().map(bits)), "{mode} {name}");
            }
            assert!(comments.contains("wavesplat:view: 30,30\n"), "{comments}");
        }
        assert!(decode_exr(&both[1]).1.contains("wavesplat:frames: 9"));
        work.render(&format!("{options} -o p_%d.exr --threads 2")).ok();
        assert!(both[0] == work.read("p_2.exr"), "the same bytes");
    }
    work.render(&format!("a.wspl {SIZE} -o c_%d.exr --colormap grey")).fails(2, &["--colormap", ".exr"]);
    work.render(&format!("a.wspl {SIZE} --frames 2 -o c.exr --error-image e.exr")).ok();
    assert!(work.render(&format!("a.wspl {SIZE} --frames 2 -o - --format exr")).ok().out.len() > 100);
}
