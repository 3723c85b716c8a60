//! Tests of `.vti` files.

use super::*;
use crate::source::testing::{Folder, check_inputs, payload, refused, survives_damage};
use crate::source::{OpenOptions, open};
use ::base64::Engine;
use ::base64::engine::general_purpose::STANDARD;

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
    let other = "<DataArray type=\"UInt8\" Name=\"K\" format=\"ascii\">1</DataArray>";
    vti.arrays = vti.arrays.replace("</PointData>", &format!("{other}</PointData>"));
    let active = folder.write("a.vti", vti.bytes());
    check_inputs(std::slice::from_ref(&active), &OpenOptions::default(), SampleType::U8, 1);
    let named = |name: &str| OpenOptions { variable: Some(name.into()), ..OpenOptions::default() };
    refused(std::slice::from_ref(&active), &named("K"), "format \"ascii\" is not supported");
    refused(&[active], &named("L"), "has no array L; it has J, K");
    vti.arrays = vti.arrays.replace(" Scalars=\"J\"", "");
    let none_active = [folder.write("a.vti", vti.bytes())];
    refused(&none_active, &OpenOptions::default(), "--variable chooses one of J, K");
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
    with("byte_order", "compressor=\"vtkZLibDataCompressor\" byte_order", "compressed by vtkZLibDataCompressor");
    with("LittleEndian", "MixedEndian", "byte_order \"MixedEndian\"");
    with("byte_order", "header_type=\"UInt16\" byte_order", "header_type \"UInt16\"");
    with("type=\"ImageData\"", "type=\"RectilinearGrid\"", "of type RectilinearGrid");
    with("type=\"UInt8\"", "type=\"Int64\"", "type Int64 is not supported");
    with("type=\"UInt8\"", "type=\"UInt16\"", "its array has 105 bytes, but its extent and type need 210");
    with("Name=\"J\"", "Name=\"J\" NumberOfComponents=\"3\"", "3 components");
    with("</Piece>", "</Piece><Piece Extent=\"2 8 0 4 0 2\"></Piece>", "several pieces");
    with("Piece Extent=\"2 8", "Piece Extent=\"2 7", "only");
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

#[test]
fn a_direction_is_noted_and_frames_must_agree() {
    let folder = Folder::new();
    let vti = raw(TAGS[0], "UInt8", &payload(SampleType::U8, 0..1, false));
    let a = folder.write("a1.vti", vti.bytes());
    let tilted =
        String::from_utf8_lossy(&vti.bytes()[..200]).replace("Spacing", "Direction=\"0 1 0 1 0 0 0 0 1\" Spacing");
    let b = folder.write("b.vti", [tilted.as_bytes(), &vti.bytes()[200..]].concat());
    let source = open(std::slice::from_ref(&b), &OpenOptions::default()).expect("opening");
    assert!(source.archive().notes[0].contains("Direction"));
    let renamed = Vti { arrays: vti.arrays.replace("\"J\"", "\"K\""), ..vti };
    let c = folder.write("c.vti", renamed.bytes());
    refused(&[a, b, c], &OpenOptions::default(), "c.vti: has the array K, but the first frame");
}
