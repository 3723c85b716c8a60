use super::stack::Stack;
use crate::testing::{DIMS, Folder, check_inputs, payload, refused, survives_damage};
use std::io::Cursor;
use std::path::PathBuf;
use tiff::encoder::colortype::{ColorType, Gray8, Gray16, Gray32Float, GrayI16, RGB8};
use tiff::encoder::{Compression, DeflateLevel, Rational, TiffEncoder, TiffValue};
use tiff::tags::Tag;
use wavesplat_core::base::sample::{SampleType, load};
use wavesplat_core::source::OpenOptions;

/// The planes of some frames as numbers.
fn planes(ty: SampleType, frames: std::ops::Range<usize>) -> Vec<Vec<f64>> {
    let mut values = vec![0.0; frames.len() * DIMS.iter().product::<usize>()];
    load(ty, &payload(ty, frames, false), &mut values);
    values.chunks(DIMS[0] * DIMS[1]).map(<[f64]>::to_vec).collect()
}

/// A file with these pages, and a text in the first.
fn file<C: ColorType>(pages: &[Vec<f64>], text: &str, compression: Compression, of: impl Fn(f64) -> C::Inner) -> Vec<u8>
where
    [C::Inner]: TiffValue,
{
    let mut bytes = Cursor::new(Vec::new());
    let mut encoder = TiffEncoder::new(&mut bytes).expect("in memory").with_compression(compression);
    for (i, page) in pages.iter().enumerate() {
        let mut image = encoder.new_image::<C>(DIMS[0] as u32, DIMS[1] as u32).expect("a page");
        image.rows_per_strip(2).expect("small");
        if i == 0 {
            image.encoder().write_tag(Tag::ImageDescription, text).expect("a text");
            image.x_resolution(Rational { n: 2, d: 1 });
        }
        let samples: Vec<C::Inner> = page.iter().map(|v| of(*v)).collect();
        image.write_data(&samples).expect("in memory");
    }
    bytes.into_inner()
}

fn floats(pages: &[Vec<f64>], text: &str) -> Vec<u8> {
    file::<Gray32Float>(pages, text, Compression::Uncompressed, |v| v as f32)
}

fn one(folder: &Folder, bytes: Vec<u8>) -> [PathBuf; 1] {
    [folder.write("a.tif", bytes)]
}

const LZW: Compression = Compression::Lzw;
const DEFLATE: Compression = Compression::Deflate(DeflateLevel::Fast);

#[test]
fn pages_are_planes_of_every_type_and_compression() {
    let folder = Folder::new();
    for compression in [Compression::Uncompressed, LZW, DEFLATE, Compression::Packbits] {
        let of = |ty| planes(ty, 0..1);
        let check = |bytes: Vec<u8>, ty| check_inputs(&one(&folder, bytes), &OpenOptions::default(), ty, 1);
        check(file::<Gray8>(&of(SampleType::U8), "", compression, |v| v as u8), SampleType::U8);
        check(file::<GrayI16>(&of(SampleType::I16), "", compression, |v| v as i16), SampleType::I16);
        check(file::<Gray32Float>(&of(SampleType::F32), "", compression, |v| v as f32), SampleType::F32);
    }
    let files = [0, 1, 2].map(|t| folder.write(&format!("f{t}.dat"), floats(&planes(SampleType::F32, t..t + 1), "")));
    check_inputs(&files, &OpenOptions::default(), SampleType::F32, 3);
}

#[test]
fn imagej_says_planes_frames_and_channels() {
    let folder = Folder::new();
    let text = "ImageJ=1.54f\nimages=12\nslices=3\nframes=4\nhyperstack=true\nunit=micron\nspacing=2\nfinterval=0.5\n";
    let file = one(&folder, floats(&planes(SampleType::F32, 0..4), text));
    check_inputs(&file, &OpenOptions::default(), SampleType::F32, 4);
    let source = crate::open(&file, &OpenOptions::default()).expect("a header");
    let found = source.archive();
    assert_eq!((found.grid.spacing, &found.times[..]), ([0.5, 1.0, 2.0], &[0.0, 0.5, 1.0, 1.5][..]));
    assert_eq!((found.units.space.as_deref(), found.units.times.as_deref()), (Some("um"), Some("s")));
    let two = planes(SampleType::F32, 0..1).into_iter().flat_map(|page| [vec![-1.0; page.len()], page]);
    let file = one(&folder, floats(&two.collect::<Vec<_>>(), "ImageJ=1.54f\nimages=6\nchannels=2\nslices=3\n"));
    let chosen = OpenOptions { variable: Some("[1]".into()), ..OpenOptions::default() };
    check_inputs(&file, &chosen, SampleType::F32, 1);
    refused(&file, &OpenOptions::default(), "2 components");
    assert_eq!(crate::undecided(&file, &OpenOptions::default()).expect("read").len(), 2);
}

fn ome(order: &str, sizes: [usize; 3], more: &str) -> String {
    let [z, c, t] = sizes;
    format!(
        "<?xml version=\"1.0\"?><OME xmlns=\"x\"><Image ID=\"Image:0\"><Pixels DimensionOrder=\"{order}\" SizeX=\"7\" \
         SizeY=\"5\" SizeZ=\"{z}\" SizeC=\"{c}\" SizeT=\"{t}\" Type=\"float\" PhysicalSizeX=\"0.5\" \
         PhysicalSizeZ=\"2000\" PhysicalSizeZUnit=\"nm\" TimeIncrement=\"0.5\">{more}</Pixels></Image></OME>"
    )
}

#[test]
fn ome_xml_says_the_order_of_planes() {
    let folder = Folder::new();
    let pages = planes(SampleType::F32, 0..4);
    let fast: Vec<_> = (0..3).flat_map(|z| (0..4).map(move |t| 3 * t + z)).map(|i| pages[i].clone()).collect();
    for (order, pages) in [("XYZCT", &pages), ("XYTZC", &fast)] {
        let place = "<TiffData IFD=\"0\" PlaneCount=\"12\"/>";
        let file = one(&folder, floats(pages, &ome(order, [3, 1, 4], place)));
        check_inputs(&file, &OpenOptions::default(), SampleType::F32, 4);
        let source = crate::open(&file, &OpenOptions::default()).expect("a header");
        assert_eq!(source.archive().grid.spacing, [0.5, 1.0, 2.0]);
        assert_eq!(source.archive().times, [0.0, 0.5, 1.0, 1.5]);
        assert_eq!(source.archive().units.space.as_deref(), Some("um"));
    }
}

#[test]
fn planes_of_ome_xml_have_times() {
    let folder = Folder::new();
    let pages = planes(SampleType::F32, 0..4);
    let plane = |t: usize, z: usize| {
        let time = 10 * t * t + z;
        format!("<Plane TheT=\"{t}\" TheZ=\"{z}\" TheC=\"0\" DeltaT=\"{time}\" DeltaTUnit=\"ms\"/>")
    };
    let all: Vec<String> = (0..4).flat_map(|t| (0..3).map(move |z| (t, z))).map(|(t, z)| plane(t, z)).collect();
    let times = |planes: &[String]| {
        let text = ome("XYZCT", [3, 1, 4], &planes.concat()).replace(" TimeIncrement=\"0.5\"", "");
        let file = one(&folder, floats(&pages, &text));
        let found = crate::open(&file, &OpenOptions::default()).expect("a header").archive().clone();
        (found.times, found.units.times.unwrap_or_default())
    };
    assert_eq!(times(&all), (vec![0.0, 10.0, 40.0, 90.0], "ms".into()));
    assert_eq!(times(&all[1..]), (Vec::new(), String::new()), "a frame without a time");
}

#[test]
fn what_is_not_supported_is_named() {
    let folder = Folder::new();
    let with = |bytes: Vec<u8>, words: &str| refused(&one(&folder, bytes), &OpenOptions::default(), words);
    let pages = planes(SampleType::F32, 0..4);
    let wide: Vec<_> = pages.iter().map(|page| page.iter().flat_map(|v| [*v; 3]).collect()).collect();
    with(file::<RGB8>(&wide, "", LZW, |v| v as u8), "RGB(8)");
    with(floats(&pages, &ome("XYZCT", [3, 1, 3], "")), "has 12 page(s), but says 3 plane(s) of 1 channel(s) in 3");
    with(floats(&pages, &ome("XYZTT", [3, 1, 4], "")), "lacks one");
    with(floats(&pages, &ome("XZYCT", [3, 1, 4], "")), "is not known");
    with(floats(&pages, &ome("XYZCT", [0, 1, 4], "")), "cannot be");
    with(floats(&pages, &ome("XYZCT", [3, 1, 4], "<TiffData IFD=\"1\" FirstT=\"1\"/>")), "on page 1, not 3");
    with(floats(&pages, &ome("XYZCT", [3, 1, 4], "<TiffData FirstT=\"4\"/>")), "is not there");
    with(floats(&pages[..1], "ImageJ=1\nimages=12\nslices=3\nframes=4\n"), "has one page of the images");
    with(floats(&pages, "ImageJ=1\nimages=12\nslices=x\n"), "the slices \"x\" is no number");
    with(b"II\x2a\0".to_vec(), "is no TIFF that can be read");
    let mixed = file::<Gray16>(&pages, "", LZW, |_| 1);
    with(mixed[..mixed.len() / 2].to_vec(), "");
    let tight = OpenOptions { memory: 4, ..OpenOptions::default() };
    refused(&one(&folder, floats(&pages, "")), &tight, "strips or tiles of 56 bytes");
}

#[test]
fn steps_lead_to_every_page() {
    let stack = Stack::new(['C', 'T', 'Z'], [2, 3, 4]).expect("all axes");
    assert_eq!((stack.frames, stack.planes, stack.channels), (3, 4, 2));
    assert_eq!(stack.page(2, 3, 1), 1 + 2 * (2 + 3 * 3));
}

#[test]
fn no_damage_panics() {
    for compression in [Compression::Uncompressed, LZW, DEFLATE] {
        let pages = planes(SampleType::U8, 0..1)[..2].to_vec();
        survives_damage("a.tif", &file::<Gray8>(&pages, "ImageJ=1\nslices=2\n", compression, |v| v as u8));
    }
}

/// The planes of all frames, the slowest axis first, with their frames first or last.
fn pages_of(frames: usize, are_frames_first: bool) -> Vec<Vec<f64>> {
    let pages = planes(SampleType::F32, 0..frames);
    let place = |at: usize| if are_frames_first { at } else { 3 * (at % frames) + at / frames };
    (0..pages.len()).map(|at| pages[place(at)].clone()).collect()
}

#[test]
fn tifffile_says_the_axes_of_its_shape() {
    let folder = Folder::new();
    let (t_first, z_first) = (pages_of(4, true), pages_of(4, false));
    for (pages, text) in [
        (&t_first, r#"{"shape": [4, 3, 5, 7], "axes": "TZYX"}"#),
        (&z_first, r#"{"shape": [3, 4, 5, 7], "axes": "ZTYX", "spacing": 2}"#),
        (&t_first, r#"{"shape": [4, 1, 3, 5, 7], "axes": "TCZYX"}"#),
        (&t_first, r#"{"shape": [4, 3, 5, 7], "axes": "QZYX"}"#),
        (&t_first, r#"{"shape": [4, 3, 5, 7]}"#),
        (&t_first, "shape=(4, 3, 5, 7)"),
    ] {
        let file = one(&folder, floats(pages, text));
        check_inputs(&file, &OpenOptions::default(), SampleType::F32, 4);
        let is_said = text.contains("TZ") || text.contains("ZT") || text.contains("TC");
        let source = crate::open(&file, &OpenOptions::default()).expect("a header");
        assert_eq!(source.archive().notes.is_empty(), is_said, "{text}");
    }
    let lapse = one(&folder, floats(&t_first, r#"{"shape": [12, 5, 7], "axes": "TYX"}"#));
    let source = crate::open(&lapse, &OpenOptions::default()).expect("a header");
    assert_eq!((source.archive().grid.dims, source.archive().frames), ([7, 5, 1], Some(12)));
    let with = |text: &str, words: &str| refused(&one(&folder, floats(&t_first, text)), &OpenOptions::default(), words);
    with(r#"{"shape": [4, 4, 5, 7], "axes": "TZYX"}"#, "has 12 page(s) of 5x7 pixels, but says the shape [4, 4, 5, 7]");
    with(r#"{"shape": [2, 2, 3, 5, 7]}"#, "does not say what the axes");
    with(r#"{"shape": [4, 3, 5, 7], "axes": "TZY"}"#, "but the axes TZY");
    with(r#"{"shape": "#, "has a shape in its description");
}

#[test]
fn the_users_letters_say_what_pages_count() {
    let folder = Folder::new();
    let lettered = |axes: &str| OpenOptions { axes: Some(axes.into()), ..OpenOptions::default() };
    let z_first = pages_of(4, false);
    let shaped = one(&folder, floats(&z_first, r#"{"shape": [3, 4, 5, 7], "axes": "TZYX"}"#));
    check_inputs(&shaped, &lettered("ztyx"), SampleType::F32, 4);
    let imagej = one(&folder, floats(&z_first, "ImageJ=1.54f\nimages=12\nslices=4\nframes=3\n"));
    check_inputs(&imagej, &lettered("ztyx"), SampleType::F32, 4);
    let plain = one(&folder, floats(&z_first, ""));
    for (letters, dims, frames) in [("tyx", [7, 5, 1], 12), ("zyx", [7, 5, 12], 1), ("txy", [5, 7, 1], 12)] {
        let source = crate::open(&plain, &lettered(letters)).expect("letters");
        assert_eq!((source.archive().grid.dims, source.archive().frames), (dims, Some(frames)));
    }
    let source = crate::open(&plain, &OpenOptions::default()).expect("a guess");
    assert!(source.archive().notes[0].text.contains("[12, 5, 7] are taken as zyx"));
    refused(&plain, &lettered("tzyx"), "Set(\"axes\")");
    refused(&plain, &lettered("yxt"), "which are not the last of the axes");
}

#[test]
fn images_behind_each_other_on_one_page_are_read() {
    let folder = Folder::new();
    let all = planes(SampleType::F32, 0..4);
    let first = floats(&all[..1], "ImageJ=1.54f\nimages=12\nslices=3\nframes=4\n");
    // Samples come before the directory of the page here: the rest goes behind them, and the offsets of the directory stay.
    let start = first.windows(4).position(|bytes| bytes == (all[0][0] as f32).to_le_bytes()).expect("the first sample");
    let bytes: Vec<u8> = all.iter().flatten().flat_map(|v| (*v as f32).to_le_bytes()).collect();
    let mut file = first.clone();
    let moved = file.len();
    file.extend(&bytes);
    let patched = moved_strips(file, start, moved);
    check_inputs(&one(&folder, patched.clone()), &OpenOptions::default(), SampleType::F32, 4);
    let short = patched[..patched.len() - 1].to_vec();
    refused(&one(&folder, short), &OpenOptions::default(), "has one page of the images that it says, and 1679 bytes");
    let packed = file_of_one_page(&all[..1]);
    refused(&one(&folder, packed), &OpenOptions::default(), "compressed or in pieces");
}

fn file_of_one_page(pages: &[Vec<f64>]) -> Vec<u8> {
    file::<Gray32Float>(pages, "ImageJ=1\nimages=12\nslices=3\nframes=4\n", LZW, |v| v as f32)
}

/// The file with its strips at another place: every offset of a strip is found by its value.
fn moved_strips(mut file: Vec<u8>, from: usize, to: usize) -> Vec<u8> {
    let row = 2 * DIMS[0] * 4;
    for strip in 0..DIMS[1].div_ceil(2) {
        let [old, new] = [from, to].map(|start| ((start + strip * row) as u32).to_le_bytes());
        let at = (0..to).rev().find(|at| file[*at..].starts_with(&old)).expect("an offset");
        file[at..at + 4].copy_from_slice(&new);
    }
    file
}

#[test]
fn samples_of_which_0_is_white_are_as_they_are_stored() {
    let folder = Folder::new();
    let mut bytes = file::<Gray8>(&planes(SampleType::U8, 0..1), "", Compression::Uncompressed, |v| v as u8);
    let black = [6, 1, 3, 0, 1, 0, 0, 0, 1, 0]; // PhotometricInterpretation = 1
    let at: Vec<usize> = (0..bytes.len() - 10).filter(|at| bytes[*at..].starts_with(&black)).collect();
    assert_eq!(at.len(), 3, "one for each page");
    at.into_iter().for_each(|at| bytes[at + 8] = 0);
    check_inputs(&one(&folder, bytes), &OpenOptions::default(), SampleType::U8, 1);
}
