//! Tests of `.vti` files.

mod pieced;

use super::count::Count;
use crate::open;
use crate::testing::{Folder, check_inputs, check_window, payload, refused, survives_damage, value, zlib as packed};
use ::base64::Engine;
use ::base64::engine::general_purpose::STANDARD;
use wavesplat_core::base::sample::SampleType;
use wavesplat_core::source::OpenOptions;

/// A file to be varied: its tag, its arrays, and what comes after the image.
struct Vti {
    tag: String,
    arrays: String,
    appended: Vec<u8>,
}

impl Vti {
    fn bytes(&self) -> Vec<u8> {
        let text = format!(
            "<?xml version=\"1.0\"?>\n<VTKFile type=\"ImageData\" {}>\n<ImageData WholeExtent=\"2 8 0 4 0 2\" \
             Origin=\"1 2 3\" Spacing=\"0.5 1 2\"><Piece Extent=\"2 8 0 4 0 2\">{}</Piece></ImageData>",
            self.tag, self.arrays
        );
        [text.as_bytes(), &self.appended, b"</VTKFile>"].concat()
    }
}

const TAGS: [(&str, Count); 4] = [
    ("byte_order=\"LittleEndian\"", Count { wide: false, big_endian: false }),
    ("byte_order=\"LittleEndian\" header_type=\"UInt64\"", Count { wide: true, big_endian: false }),
    ("byte_order=\"BigEndian\" header_type=\"UInt32\"", Count { wide: false, big_endian: true }),
    ("byte_order=\"BigEndian\" header_type=\"UInt64\"", Count { wide: true, big_endian: true }),
];

fn stored_count(len: usize, count: Count) -> Vec<u8> {
    let mut bytes = (len as u64).to_le_bytes()[..count.size()].to_vec();
    if count.big_endian {
        bytes.reverse();
    }
    bytes
}

fn array(ty: &str, more: &str, text: &str) -> String {
    format!("<DataArray type=\"{ty}\" Name=\"J\" {more}>{text}</DataArray>")
}

fn points(inside: &str) -> String {
    format!("<PointData Scalars=\"J\">{inside}</PointData><CellData></CellData>")
}

fn raw(tag: (&str, Count), ty: &str, samples: &[u8]) -> Vti {
    let array = points(&array(ty, "format=\"appended\" offset=\"3\"", ""));
    let count = stored_count(samples.len(), tag.1);
    let data = [b"<AppendedData encoding=\"raw\">\n  _\xff<>", count.as_slice(), samples];
    let appended = [&data.concat(), b"\n</AppendedData>".as_slice()].concat();
    Vti { tag: tag.0.into(), arrays: array, appended }
}

fn text(samples: &[u8], count: Count, separate: bool) -> String {
    let count = stored_count(samples.len(), count);
    if separate {
        return STANDARD.encode(count) + "\n  " + &STANDARD.encode(samples);
    }
    let all = STANDARD.encode([count.as_slice(), samples].concat());
    all.as_bytes().chunks(76).map(|l| String::from_utf8_lossy(l) + "\n").collect()
}

#[test]
fn appended_raw_of_every_type_is_read() {
    let folder = Folder::new();
    let names = ["UInt8", "Int8", "UInt16", "Int16", "UInt32", "Int32", "", "Float32", "Float64"];
    for (name, ty) in names.into_iter().zip(SampleType::ALL).filter(|(name, _)| !name.is_empty()) {
        for tag in TAGS {
            let files = [0, 1, 2].map(|t| {
                let vti = raw(tag, name, &payload(ty, t..t + 1, tag.1.big_endian));
                folder.write(&format!("f{t}.vti"), vti.bytes())
            });
            check_inputs(&files, &OpenOptions::default(), ty, 3);
        }
    }
}

#[test]
fn base64_inline_and_appended_is_read() {
    let folder = Folder::new();
    for ty in [SampleType::U8, SampleType::F64] {
        let name = if ty == SampleType::U8 { "UInt8" } else { "Float64" };
        for (tag, separate) in TAGS.into_iter().flat_map(|t| [(t, false), (t, true)]) {
            let text = text(&payload(ty, 0..1, tag.1.big_endian), tag.1, separate);
            let inline = points(&array(name, "format=\"binary\"", &format!("\n  {text}\n")));
            let inline = Vti { tag: tag.0.into(), arrays: inline, appended: Vec::new() };
            check_inputs(&[folder.write("a.vti", inline.bytes())], &OpenOptions::default(), ty, 1);
            let arrays = points(&array(name, "format=\"appended\" offset=\"0\"", ""));
            let appended = format!("<AppendedData encoding=\"base64\">_{text}AAAA</AppendedData>").into_bytes();
            let appended = Vti { tag: tag.0.into(), arrays, appended };
            check_inputs(&[folder.write("a.vti", appended.bytes())], &OpenOptions::default(), ty, 1);
        }
    }
}

#[test]
fn cells_lie_between_points() {
    let folder = Folder::new();
    let samples = payload(SampleType::U8, 0..1, false);
    let mut vti = raw(TAGS[0], "UInt8", &samples);
    vti.arrays = vti.arrays.replace("PointData", "X").replace("CellData", "PointData").replace('X', "CellData");
    let bytes = String::from_utf8_lossy(&vti.bytes()).replace("2 8 0 4 0 2", "2 9 0 5 0 3");
    assert!(!bytes.contains("2 8"));
    let text = bytes.split_once("<AppendedData").expect("tag").0.as_bytes().to_vec();
    let file = folder.write("a.vti", [text, vti.appended].concat());
    check_inputs(std::slice::from_ref(&file), &OpenOptions::default(), SampleType::U8, 1);
    let grid = open(&[file], &OpenOptions::default()).expect("opening").archive().grid;
    assert_eq!((grid.spacing, grid.origin), ([0.5, 1.0, 2.0], [2.25, 2.5, 4.0]));
}

#[test]
fn the_array_is_the_named_the_active_or_the_only_one() {
    let folder = Folder::new();
    let samples = payload(SampleType::U8, 0..1, false);
    let mut vti = raw(TAGS[0], "UInt8", &samples);
    let other = "<DataArray type=\"UInt8\" Name=\"K\" format=\"hex\">1</DataArray>";
    vti.arrays = vti.arrays.replace("</PointData>", &format!("{other}</PointData>"));
    let active = folder.write("a.vti", vti.bytes());
    check_inputs(std::slice::from_ref(&active), &OpenOptions::default(), SampleType::U8, 1);
    let named = |name: &str| OpenOptions { variable: Some(name.into()), ..OpenOptions::default() };
    refused(std::slice::from_ref(&active), &named("K"), "format \"hex\" is not supported");
    refused(&[active], &named("L"), "has no array L; it has J, K");
    vti.arrays = vti.arrays.replace(" Scalars=\"J\"", "");
    let none_active = [folder.write("a.vti", vti.bytes())];
    refused(&none_active, &OpenOptions::default(), "none is active: J, K; ChooseVariable");
    check_inputs(&none_active, &named("J"), SampleType::U8, 1);
    let archive = open(&none_active, &named("J")).expect("opening").archive().clone();
    assert_eq!(archive.variable.as_deref(), Some("J"));
    assert_eq!((archive.grid.spacing, archive.grid.origin), ([0.5, 1.0, 2.0], [2.0, 2.0, 3.0]));
}

#[test]
fn what_is_not_supported_is_named() {
    let folder = Folder::new();
    let good = raw(TAGS[0], "UInt8", &payload(SampleType::U8, 0..1, false)).bytes();
    let cut = good.windows(9).position(|w| w == b"<Appended").expect("tag");
    let (xml, data) =
        (String::from_utf8_lossy(&good[..cut]).into_owned(), String::from_utf8_lossy(&good[cut..cut + 33]));
    let with = |from: &str, to: &str, words: &str| {
        assert!(xml.contains(from) || data.contains(from), "{from}");
        let text = format!("{xml}{data}").replacen(from, to, 1);
        let bytes = [text.as_bytes(), &good[cut + 33..]].concat();
        refused(&[folder.write("a.vti", bytes)], &OpenOptions::default(), words);
    };
    with("byte_order", "compressor=\"vtkLZ4DataCompressor\" byte_order", "compressed by vtkLZ4DataCompressor");
    with("byte_order", "compressor=\"vtkZLibDataCompressor\" byte_order", "but its extent and type need 105");
    with("LittleEndian", "MixedEndian", "byte_order \"MixedEndian\"");
    with("byte_order", "header_type=\"UInt16\" byte_order", "header_type \"UInt16\"");
    with("type=\"ImageData\"", "type=\"StructuredGrid\"", "of type StructuredGrid");
    with("type=\"UInt8\"", "type=\"Bit\"", "type Bit is not supported");
    with("type=\"UInt8\"", "type=\"UInt16\"", "its array has 105 bytes, but its extent and type need 210");
    with("Name=\"J\"", "Name=\"J\" NumberOfComponents=\"3\"", "3 components");
    with("</Piece>", "</Piece><Piece Extent=\"2 8 0 4 0 2\"></Piece>", "has a piece without the array J");
    with("Piece Extent=\"2 8", "Piece Extent=\"2 7", "its array has 105 bytes, but");
    with("Piece Extent=\"2 8", "Piece Extent=\"2 9", "outside of the whole");
    with("<Piece Extent=\"2 8 0 4 0 2\">", "<Piece Extent=\"2 2 0 4 0 2\">", "leave some of the whole");
    with("</Piece>", "", "not well-formed");
    with("Name=\"J\"", "Name=\"J\" NumberOfComponents=\"x\"", "NumberOfComponents \"x\" is no number");
    with("type=\"ImageData\"", "type=\"PImageData\"", "without a Source");
    with("offset=\"3\"", "offset=\"18446744073709551615\"", "too large");
    with("offset=\"3\"", "offset=\"999\"", "cut short");
    with("offset=\"3\"", "offset=\"-3\"", "is no number");
    with("offset=\"3\"", "", "no offset");
    with("encoding=\"raw\"", "encoding=\"hex\"", "encoding \"hex\"");
    with("\n  _", "\n  *", "underscore");
    with("0.5 1 2", "0.5 -1 2", "not positive");
    with("0.5 1 2", "0.5 1", "Spacing must be 3 numbers");
    with("</PointData>", "</CellData>", "not well-formed XML at byte");
}

#[test]
fn extents_that_hold_nothing_are_refused() {
    let folder = Folder::new();
    let vti = raw(TAGS[0], "UInt8", &[]);
    let bytes = String::from_utf8_lossy(&vti.bytes()).into_owned();
    for extent in ["0 -1 0 4 0 2", "-9223372036854775808 9223372036854775807 0 1 0 1", "3 2 0 0 0 0"] {
        let file = folder.write("a.vti", bytes.replace("2 8 0 4 0 2", extent));
        refused(&[file], &OpenOptions::default(), "is empty");
    }
    let huge = "0 3000000000 0 3000000000 0 3000000000";
    refused(&[folder.write("a.vti", bytes.replace("2 8 0 4 0 2", huge))], &OpenOptions::default(), "too large");
}

#[test]
fn damaged_base64_is_an_error() {
    let folder = Folder::new();
    let text = text(&payload(SampleType::U8, 0..1, false), TAGS[0].1, false);
    for (bad, words) in [
        (text[..text.len() - 40].to_string(), "ends early"),
        (text.replacen('A', "*", 1), "is damaged"),
        (text.replacen("aQAA", "agAA", 1), "its array has 106 bytes"),
        (String::new(), "ends early"),
        ("AAA".to_string(), "ends early"),
    ] {
        let arrays = points(&array("UInt8", "format=\"binary\"", &bad));
        let vti = Vti { tag: TAGS[0].0.into(), arrays, appended: Vec::new() };
        refused(&[folder.write("a.vti", vti.bytes())], &OpenOptions::default(), words);
    }
}

#[test]
fn a_file_cut_anywhere_before_its_array_ends_is_an_error() {
    let folder = Folder::new();
    let good = raw(TAGS[0], "UInt8", &payload(SampleType::U8, 0..1, false)).bytes();
    let end = good.len() - "\n</AppendedData></VTKFile>".len();
    for len in 0..end {
        let file = folder.write("a.vti", &good[..len]);
        assert!(open(&[file], &OpenOptions::default()).is_err(), "{len} bytes of {end}");
    }
}

#[test]
fn no_damage_panics() {
    let samples = payload(SampleType::U8, 0..1, false);
    survives_damage("a.vti", &raw(TAGS[0], "UInt8", &samples).bytes());
    let text = text(&samples, TAGS[3].1, true);
    let arrays = points(&array("UInt8", "format=\"binary\"", &text));
    survives_damage("a.vti", &Vti { tag: TAGS[3].0.into(), arrays, appended: Vec::new() }.bytes());
}

/// As [`Vti::bytes`], with a `Direction`.
fn directed(vti: &Vti, direction: &str) -> Vec<u8> {
    let (bytes, mark) = (vti.bytes(), b" Spacing=");
    let at = bytes.windows(mark.len()).position(|w| w == mark).expect("a spacing");
    [&bytes[..at], format!(" Direction=\"{direction}\"").as_bytes(), &bytes[at..]].concat()
}

#[test]
fn straight_directions_are_turned() {
    let folder = Folder::new();
    let ty = SampleType::U16;
    let all: Vec<u8> = payload(ty, 0..1, false);
    let flipped = |[x, y, z]: [usize; 3]| all[2 * (((2 - z) * 5 + y) * 7 + (6 - x))..][..2].to_vec();
    let voxels = wavesplat_core::base::grid::Region { start: [0; 3], end: [7, 5, 3] };
    let samples: Vec<u8> = voxels.iter().flat_map(flipped).collect();
    let [before, blocks] = zlib(&samples, TAGS[0].1, 64);
    let packed = appended(&compressed(TAGS[0].0), "UInt16", "raw", &[before, blocks].concat());
    for vti in [raw(TAGS[0], "UInt16", &samples), packed] {
        let file = [folder.write("a.vti", directed(&vti, "-1 0 0 0 1 0 0 0 -1"))];
        check_inputs(&file, &OpenOptions::default(), ty, 1);
        let source = open(&file, &OpenOptions::default()).expect("opening");
        let grid = source.archive().grid;
        assert_eq!((grid.spacing, grid.origin), ([0.5, 1.0, 2.0], [-3.0, 2.0, -1.0]));
        assert!(source.archive().notes[0].text.contains("along -x +y -z of the world"));
    }
    // Axes of 5, 3, 7 voxels that go along y, z, x.
    let order = |[y, z, x]: [usize; 3]| all[2 * ((z * 5 + y) * 7 + x)..][..2].to_vec();
    let voxels = wavesplat_core::base::grid::Region { start: [0; 3], end: [5, 3, 7] };
    let samples: Vec<u8> = voxels.iter().flat_map(order).collect();
    let bytes = directed(&raw(TAGS[0], "UInt16", &samples), "0 0 1 1 0 0 0 1 0");
    let at = bytes.windows(4).position(|w| w == b"\n  _").expect("appended");
    let text = String::from_utf8(bytes[..at].to_vec()).expect("text").replace("2 8 0 4 0 2", "0 4 0 2 2 8");
    let file = [folder.write("a.vti", [text.as_bytes(), &bytes[at..]].concat())];
    check_inputs(&file, &OpenOptions::default(), ty, 1);
    let grid = open(&file, &OpenOptions::default()).expect("opening").archive().grid;
    assert_eq!((grid.spacing, grid.origin), ([2.0, 0.5, 1.0], [5.0, 2.0, 3.0]));
}

#[test]
fn an_oblique_direction_is_noted_and_frames_must_agree() {
    let folder = Folder::new();
    let vti = raw(TAGS[0], "UInt8", &payload(SampleType::U8, 0..1, false));
    let a = folder.write("a1.vti", vti.bytes());
    let b = folder.write("b.vti", directed(&vti, "0.6 -0.8 0 0.8 0.6 0 0 0 1"));
    let source = open(&[b], &OpenOptions::default()).expect("opening");
    assert!(source.archive().notes[0].text.contains("directions of the .vti are oblique"));
    assert_eq!(source.archive().grid.spacing, [0.5, 1.0, 2.0]);
    let renamed = Vti { arrays: vti.arrays.replace("\"J\"", "\"K\""), ..vti };
    let c = folder.write("c.vti", renamed.bytes());
    refused(&[a, c], &OpenOptions::default(), "c.vti: has the array K, but the first frame");
}

/// An array as VTK compresses it, in blocks of so many bytes: what stands before them, and all of them.
fn zlib(samples: &[u8], count: Count, block: usize) -> [Vec<u8>; 2] {
    let blocks: Vec<Vec<u8>> = samples.chunks(block).map(packed).collect();
    let sizes = blocks.iter().map(Vec::len);
    let before = [blocks.len(), block, samples.len() % block].into_iter().chain(sizes);
    [before.flat_map(|n| stored_count(n, count)).collect(), blocks.concat()]
}

fn compressed(tag: &str) -> String {
    format!("{tag} compressor=\"vtkZLibDataCompressor\"")
}

fn appended(tag: &str, ty: &str, encoding: &str, data: &[u8]) -> Vti {
    let arrays = points(&array(ty, "format=\"appended\" offset=\"0\"", ""));
    let appended = [format!("<AppendedData encoding=\"{encoding}\">_").as_bytes(), data, b"</AppendedData>"].concat();
    Vti { tag: tag.into(), arrays, appended }
}

fn inline(tag: &str, ty: &str, format: &str, text: &str) -> Vti {
    let arrays = points(&array(ty, &format!("format=\"{format}\""), text));
    Vti { tag: tag.into(), arrays, appended: Vec::new() }
}

#[test]
fn compressed_arrays_are_read() {
    let folder = Folder::new();
    for (ty, name) in [(SampleType::U8, "UInt8"), (SampleType::F64, "Float64")] {
        for ((tag, count), block) in TAGS.into_iter().flat_map(|tag| [(tag, 1 << 15), (tag, 35), (tag, 64)]) {
            let [before, blocks] = zlib(&payload(ty, 0..1, count.big_endian), count, block);
            let tag = compressed(tag);
            let text = STANDARD.encode(&before) + &STANDARD.encode(&blocks);
            for vti in [
                appended(&tag, name, "raw", &[before, blocks].concat()),
                appended(&tag, name, "base64", text.as_bytes()),
                inline(&tag, name, "binary", &text),
            ] {
                check_inputs(&[folder.write("a.vti", vti.bytes())], &OpenOptions::default(), ty, 1);
            }
        }
    }
}

#[test]
fn damaged_blocks_are_errors() {
    let folder = Folder::new();
    let count = TAGS[0].1;
    let samples = payload(SampleType::U8, 0..1, false);
    let [_, blocks] = zlib(&samples, count, 64);
    let with = |before: &[u8], blocks: &[u8], words: &str| {
        let vti = appended(&compressed(TAGS[0].0), "UInt8", "raw", &[before, blocks].concat());
        let file = folder.write("a.vti", vti.bytes());
        let failed = open(&[file], &OpenOptions::default()).and_then(|mut source| source.window(0, 1).map(|_| ()));
        let message = crate::testing::message(failed);
        assert!(message.contains(words), "{words:?} is not in {message:?}");
    };
    let counts = |counts: &[usize]| counts.iter().flat_map(|n| stored_count(*n, count)).collect::<Vec<_>>();
    with(&counts(&[2, 64, 42]), &blocks, "has 106 bytes");
    with(&counts(&[0, 64, 41]), &blocks, "has too many bytes");
    with(&counts(&[105, 1, 0]), &[], "it has 105 blocks");
    with(&counts(&[0xffff_ffff, 0, 105]), &blocks, "it has 4294967295 blocks");
    with(&counts(&[2, 64, 41, 9, 0xffff_ffff]), &blocks, "is cut short: its array ends at byte");
    with(&counts(&[2, 64, 41, 4, 4]), &blocks, "cannot be decoded");
    let [before, _] = zlib(&samples, count, 1 << 15);
    with(&before, &blocks, "block 0 holds less");
    let [_, long] = zlib(&[7; 106], count, 1 << 15);
    with(&counts(&[1, 105, 0, long.len()]), &long, "block 0 holds more");
}

#[test]
fn numbers_as_text_are_read() {
    let folder = Folder::new();
    for (ty, name, tag) in [(SampleType::I16, "Int16", TAGS[0].0), (SampleType::F32, "Float32", TAGS[2].0)] {
        let text: String = (0..105).map(|i| format!("{}\n ", value(ty, 0, i))).collect();
        check_inputs(
            &[folder.write("a.vti", inline(tag, name, "ascii", &text).bytes())],
            &OpenOptions::default(),
            ty,
            1,
        );
    }
    for (text, words) in [("1 2 3", "end early"), ("1 x", "\"x\" is no number"), ("256", "\"256\" is no number")] {
        let file = folder.write("a.vti", inline(TAGS[0].0, "UInt8", "ascii", text).bytes());
        let mut source = open(&[file], &OpenOptions::default()).expect("opening");
        let message = crate::testing::message(source.window(0, 1));
        assert!(message.contains(words), "{words:?} is not in {message:?}");
    }
}

#[test]
fn one_component_of_several_is_read() {
    let folder = Folder::new();
    let ty = SampleType::U16;
    let [a, b] = [0, 1].map(|t| payload(ty, t..t + 1, false));
    let both: Vec<u8> = a.chunks(2).zip(b.chunks(2)).flat_map(|(a, b)| [a, b].concat()).collect();
    let [before, blocks] = zlib(&both, TAGS[1].1, 100);
    let tag = compressed(TAGS[1].0);
    let vectors = |mut vti: Vti| {
        vti.arrays = vti.arrays.replace("Name=", "NumberOfComponents=\"2\" Name=");
        [folder.write("a.vti", vti.bytes())]
    };
    let named = |name: &str| OpenOptions { variable: Some(name.into()), ..OpenOptions::default() };
    for vti in [raw(TAGS[0], "UInt16", &both), appended(&tag, "UInt16", "raw", &[before, blocks].concat())] {
        let file = vectors(vti);
        refused(&file, &OpenOptions::default(), "J has 2 components; ChooseComponent { name: \"J\", components: 2 }");
        refused(&file, &named("J[2]"), "none with number 2");
        check_inputs(&file, &named("J[x]"), ty, 1);
        let mut source = open(&file, &named("J[1]")).expect("opening");
        check_window(&*source.window(0, 1).expect("window"), ty, 1);
        assert_eq!(source.archive().variable.as_deref(), Some("J[1]"));
    }
}

#[test]
fn the_time_of_a_file_is_that_of_its_frame() {
    let folder = Folder::new();
    let time = |t: f64, format: &str| match format {
        "ascii" => format!("{t}"),
        _ => text(&t.to_le_bytes(), TAGS[0].1, false),
    };
    let files = [(0, "ascii"), (1, "binary")].map(|(t, format)| {
        let vti = raw(TAGS[0], "UInt8", &payload(SampleType::U8, t..t + 1, false)).bytes();
        let at = vti.windows(7).position(|w| w == b"<Piece ").expect("piece");
        let value = time(0.25 + t as f64, format);
        let field = format!("<FieldData><DataArray type=\"Float64\" Name=\"TimeValue\" format=\"{format}\">{value}</DataArray></FieldData>");
        folder.write(&format!("f{t}.vti"), [&vti[..at], field.as_bytes(), &vti[at..]].concat())
    });
    check_inputs(&files, &OpenOptions::default(), SampleType::U8, 2);
    assert_eq!(open(&files, &OpenOptions::default()).expect("opening").archive().times, [0.25, 1.25]);
}

#[test]
fn no_damage_of_compressed_arrays_panics() {
    let [before, blocks] = zlib(&[7; 105], TAGS[0].1, 64);
    let good = appended(&compressed(TAGS[0].0), "UInt8", "raw", &[before, blocks].concat()).bytes();
    let data = good.windows(5).position(|w| w == b"raw\">").expect("tag") + 5;
    crate::testing::survives_damage_in(data..good.len(), "a.vti", &good);
}
