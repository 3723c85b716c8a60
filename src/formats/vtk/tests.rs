//! Tests of legacy VTK files.

use crate::open;
use crate::testing::{Folder, check_inputs, check_window, message, payload, refused, survives_damage, value};
use wavesplat_core::base::sample::SampleType;
use wavesplat_core::source::OpenOptions;

const DIMS: &str = "DIMENSIONS 7 5 3\nSPACING 0.5 1 2\nORIGIN 1 2 3\n";

fn options() -> OpenOptions {
    OpenOptions::default()
}

fn named(name: &str) -> OpenOptions {
    OpenOptions { variable: Some(name.into()), ..options() }
}

/// A file of text and samples in turn.
fn vtk(pieces: &[&[u8]]) -> Vec<u8> {
    let start = "# vtk DataFile Version 5.1\nwhat it is\nBINARY\nDATASET STRUCTURED_POINTS\n";
    [start.as_bytes(), &pieces.concat()].concat()
}

fn scalars(ty: &str, samples: &[u8]) -> Vec<u8> {
    let text = format!("{DIMS}POINT_DATA 105\nSCALARS J {ty}\nLOOKUP_TABLE default\n");
    vtk(&[text.as_bytes(), samples, b"\n"])
}

fn bytes(ty: SampleType, frame: usize) -> Vec<u8> {
    payload(ty, frame..frame + 1, true)
}

#[test]
fn every_type_is_read() {
    let folder = Folder::new();
    let names = ["unsigned_char", "char", "unsigned_short", "short", "unsigned_int", "INT", "", "float 1", "double"];
    for (name, ty) in names.into_iter().zip(SampleType::ALL).filter(|(name, _)| !name.is_empty()) {
        let files = [0, 1, 2].map(|t| folder.write(&format!("f{t}.vtk"), scalars(name, &bytes(ty, t))));
        check_inputs(&files, &options(), ty, 3);
        check_inputs(&[folder.path("")], &options(), ty, 3);
    }
    let archive = open(&[folder.path("f0.vtk")], &options()).expect("opening").archive().clone();
    assert_eq!((archive.grid.spacing, archive.grid.origin), ([0.5, 1.0, 2.0], [1.0, 2.0, 3.0]));
    assert_eq!(archive.variable.as_deref(), Some("J"));
    check_inputs(
        &[folder.write("other", scalars("double", &bytes(SampleType::F64, 0)))],
        &options(),
        SampleType::F64,
        1,
    );
}

#[test]
fn one_array_of_several_is_read() {
    let folder = Folder::new();
    let (ty, [a, b, c]) = (SampleType::F32, [0, 1, 2].map(|t| bytes(SampleType::F32, t)));
    let vectors: Vec<u8> = (0..105).flat_map(|i| [&a, &b, &c].map(|of| of[4 * i..][..4].to_vec()).concat()).collect();
    let field = "METADATA\nINFORMATION 0\n\nFIELD FieldData 2\nwith%20space 1 105 unsigned_char\n";
    let bytes = vtk(&[
        b"FIELD FieldData 2\nlong 3 1 vtktypeint64\n",
        &[9; 24],
        b"\nTIME 1 1 double\n",
        &[0x3f, 0xe0, 0, 0, 0, 0, 0, 0],
        b"\n",
        DIMS.as_bytes(),
        b"POINT_DATA 105\nVECTORS v float\n",
        &vectors,
        field.as_bytes(),
        &bytes(SampleType::U8, 0),
        b"\nMETADATA\nCOMPONENT_NAMES\nx\n\nlast 1 105 float\n",
        &b,
        b"\nCELL_DATA 48\nNORMALS n double\n",
        &[1; 48 * 24],
        b"LOOKUP_TABLE t 2\n",
        b"12345678",
        b"\n",
    ]);
    let file = [folder.write("a.vtk", &bytes)];
    refused(&file, &options(), "none is active: v, with space, last, n; ChooseVariable");
    refused(&file, &named("v"), "v has 3 components; ChooseComponent { name: \"v\", components: 3 }");
    refused(&file, &named("w"), "has no array w; it has v");
    check_inputs(&file, &named("v[0]"), ty, 1);
    check_inputs(&file, &named("with space"), SampleType::U8, 1);
    for name in ["v[y]", "last"] {
        let mut source = open(&file, &named(name)).expect("opening");
        check_window(&*source.window(0, 1).expect("window"), ty, 1);
        assert_eq!(source.archive().times, [0.5]);
    }
    let more = [bytes, [b"POINT_DATA 105\nSCALARS s float\n".as_slice(), &a].concat()].concat();
    check_inputs(&[folder.write("a.vtk", more)], &options(), ty, 1);
}

#[test]
fn numbers_as_text_are_read() {
    let folder = Folder::new();
    let (ty, start) = (SampleType::F32, "# vtk DataFile Version 3.0\n\nASCII\nDATASET STRUCTURED_POINTS\n");
    let numbers = |t: usize| (0..105).map(|i| format!("{} \n", value(ty, t, i))).collect::<String>();
    let both: String = (0..105).map(|i| format!("{} {}\n", value(ty, 1, i), value(ty, 0, i))).collect();
    let [a, b] = [numbers(0), numbers(1)];
    let text = format!(
        "{start}FIELD f 1\nTIME 1 1 double\n0.5\n{DIMS}POINT_DATA 105\nSCALARS a float\nLOOKUP_TABLE t\n{a}\nMETADATA\n\n\
         FIELD f 2\nb 1 105 float\n{b}v 2 105 float\n{both}"
    );
    let file = [folder.write("a.vtk", &text)];
    check_inputs(&file, &options(), ty, 1);
    check_inputs(&file, &named("v[1]"), ty, 1);
    let mut source = open(&file, &named("b")).expect("opening");
    check_window(&*source.window(0, 1).expect("window"), ty, 1);
    assert_eq!(source.archive().times, [0.5]);
    check_inputs(&[folder.write("a.vtk", text.trim_end())], &named("v[y]"), ty, 1);
    let mut source = open(&[folder.write("a.vtk", text.replacen("-2.5", "-2,5", 1))], &options()).expect("opening");
    assert!(message(source.window(0, 1)).contains("\"-2,5\" is no number"));
    let colours = text.replacen("SCALARS a float", "COLOR_SCALARS a 1", 1);
    refused(&[folder.write("a.vtk", colours)], &options(), "type of colours as text is not supported");
}

#[test]
fn cells_lie_between_points() {
    let folder = Folder::new();
    let text = "DIMENSIONS 8 6 4\nASPECT_RATIO 0.5 1 2\nCELL_DATA 105\nCOLOR_SCALARS J 1\n";
    let file = [folder.write("a.vtk", vtk(&[text.as_bytes(), &bytes(SampleType::U8, 0)]))];
    check_inputs(&file, &options(), SampleType::U8, 1);
    let grid = open(&file, &options()).expect("opening").archive().grid;
    assert_eq!((grid.spacing, grid.origin), ([0.5, 1.0, 2.0], [0.25, 0.5, 1.0]));
    let plane = "DIMENSIONS 36 4 1\nCELL_DATA 105\nSCALARS J char\n";
    let file = [folder.write("a.vtk", vtk(&[plane.as_bytes(), &[0; 105]]))];
    assert_eq!(open(&file, &options()).expect("opening").archive().grid.dims, [35, 3, 1]);
}

#[test]
fn what_is_not_supported_is_named() {
    let folder = Folder::new();
    let good = String::from_utf8(scalars("float", &[0; 420])).expect("text");
    let with = |from: &str, to: &str, words: &str| {
        assert!(good.contains(from));
        refused(&[folder.write("a.vtk", good.replacen(from, to, 1))], &options(), words);
    };
    with("# vtk", "# VTK", "does not start as");
    with("BINARY", "ASCII", "is cut short: 104 of 105 numbers are missing");
    with("BINARY", "HEX", "neither BINARY nor ASCII");
    with("STRUCTURED_POINTS", "STRUCTURED_GRID", "is a STRUCTURED_GRID: only STRUCTURED_POINTS");
    with("float", "vtkIdType", "type vtkIdType is not supported");
    with("float", "string", "type string is not supported, nor");
    with("float", "double", "is cut short: an array ends");
    with("float", "float 3", "is cut short");
    with("float", "short", "where a keyword of VTK was expected");
    with("POINT_DATA 105", "POINT_DATA 104", "keyword");
    with("POINT_DATA 105", "CELL_DATA 105", "has 105 samples, but DIMENSIONS need 48");
    with("7 5 3", "7 5 4", "DIMENSIONS need 140");
    with("7 5 3", "7 0 3", "is empty");
    with("7 5 3", "7 5", "DIMENSIONS must be 3 numbers");
    with("DIMENSIONS 7 5 3\n", "", "does not say its DIMENSIONS");
    with("7 5 3", "7000000000 5000000000 3000000000", "too large");
    with("POINT_DATA 105", "POINT_DATA 18446744073709551615", "too large for any file");
    with("SCALARS J float\nLOOKUP_TABLE default", "FIELD f 2\nJ 1 105 float", "not so many follow");
    with(
        "POINT_DATA 105\nSCALARS J float\nLOOKUP_TABLE default\n",
        "FIELD f 1\nJ 1 105 float\n",
        "has no point or cell array",
    );
    with("0.5 1 2", "0.5 1 0", "not positive");
    let long = [good.as_bytes(), &[b'a'; 20_000]].concat();
    refused(&[folder.write("a.vtk", long)], &options(), "no end of a line");
}

#[test]
fn a_file_cut_anywhere_before_its_array_ends_is_an_error() {
    let folder = Folder::new();
    let good = scalars("unsigned_char", &bytes(SampleType::U8, 0));
    for len in 0..good.len() - 1 {
        assert!(open(&[folder.write("a.vtk", &good[..len])], &options()).is_err(), "{len} bytes");
    }
}

#[test]
fn no_damage_panics() {
    let scalars = "DIMENSIONS 2 1 1\nORIGIN 0 0 0\nPOINT_DATA 2\nSCALARS J short 1\nLOOKUP_TABLE default\n1234\n";
    survives_damage("a.vtk", &vtk(&[scalars.as_bytes()]));
    let field =
        "FIELD f 1\nTIME 1 1 int\n1234DIMENSIONS 2 1 1\nPOINT_DATA 2\nFIELD f 1\na%20 2 2 char\n5678\nMETADATA\n\n";
    survives_damage("a.vtk", &vtk(&[field.as_bytes()]));
}
