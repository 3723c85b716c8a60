//! Tests of NRRD files.

use super::*;
use crate::source::testing::{Folder, check_inputs, payload, refused, survives_damage};
use crate::source::{OpenOptions, open};

fn options() -> OpenOptions {
    OpenOptions::default()
}

fn header(fields: &str) -> String {
    let common = "NRRD0005\n# a comment\ndimension: 4\nsizes: 7 5 3 4\nencoding: raw\nby:=me: too\n";
    format!("{common}{fields}")
}

fn attached(fields: &str, payload: &[u8]) -> Vec<u8> {
    [header(fields).as_bytes(), b"\n", payload].concat()
}

#[test]
fn every_type_and_byte_order_is_read() {
    let folder = Folder::new();
    let names = ["uchar", "int8", "unsigned  short", "short int", "uint32_t", "signed int", "", "float", "double"];
    for (name, ty) in names.into_iter().zip(SampleType::ALL).filter(|(name, _)| !name.is_empty()) {
        for (endian, big_endian) in [("little", false), ("big", true)] {
            let fields = format!("type: {name}\nendian: {endian}\n");
            let file = folder.write("a.nrrd", attached(&fields, &payload(ty, 0..4, big_endian)));
            check_inputs(&[file], &options(), ty, 4);
        }
    }
}

#[test]
fn the_grid_and_times_are_read() {
    let folder = Folder::new();
    let bytes = payload(SampleType::U8, 0..4, false);
    let archive = |fields: &str| {
        let file = folder.write("a.nrrd", attached(&format!("type: uchar\n{fields}"), &bytes));
        open(&[file], &options()).expect("opening").archive().clone()
    };
    let a = archive("spacings: 0.5 2 nan 0.25\naxis mins: 1 2 nan 10\ncenterings: cell node none none\n");
    assert_eq!((a.grid.spacing, a.grid.origin), ([0.5, 2.0, 1.0], [1.25, 2.0, 0.0]));
    assert_eq!(a.times, [10.0, 10.25, 10.5, 10.75]);
    let a = archive("space dimension: 3\nspace directions: (2,0,0) (0,3,0) (0,0,4) none\nspace origin: (1,-1,0.5)\n");
    assert_eq!((a.grid.spacing, a.grid.origin), ([2.0, 3.0, 4.0], [1.0, -1.0, 0.5]));
    assert!(a.notes.is_empty() && a.times.is_empty());
    let a = archive("space directions: (-2,0,0) (0,3,4) (0,0,4) none\nkinds: space space space list\n");
    assert_eq!(a.grid.spacing, [2.0, 5.0, 4.0]);
    assert!(a.notes[0].contains("not kept"));
}

#[test]
fn samples_may_be_elsewhere() {
    let folder = Folder::new();
    let (ty, all) = (SampleType::I16, payload(SampleType::I16, 0..4, true));
    folder.write("all.raw", &all);
    folder.write("skip.raw", [b"one\ntwo\n123", all.as_slice()].concat());
    for t in 0..4 {
        folder.write(&format!("f{:02}.raw", 3 * t + 1), payload(ty, t..t + 1, true));
    }
    for data in [
        "data file: all.raw\n",
        "datafile: skip.raw\nline skip: 2\nbyte skip: 3\n",
        "data file: skip.raw\nbyteskip: -1\n",
        "data file: f%02d.raw 1 10 3\n",
        "data file: f%02d.raw 1 10 3 3\n",
        "data file: LIST\nf01.raw\nf04.raw\nf07.raw\nf10.raw\n",
        "data file: LIST 3\r\nf01.raw\r\nf04.raw\r\nf07.raw\r\nf10.raw",
    ] {
        let file = folder.write("a.nhdr", header(&format!("type: short\nendian: big\n{data}")));
        check_inputs(&[file], &options(), ty, 4);
    }
}

#[test]
fn frames_may_be_files_of_three_axes() {
    let folder = Folder::new();
    let files = [0, 1, 2].map(|t| {
        let text = "NRRD0004\r\ntype: float\r\ndimension: 3\r\nsizes: 7 5 3\r\nendian: little\r\nencoding: raw\r\n\r\n";
        let bytes = [text.as_bytes(), &payload(SampleType::F32, t..t + 1, false)].concat();
        folder.write(&format!("f{t}.nrrd"), bytes)
    });
    check_inputs(&files, &options(), SampleType::F32, 3);
}

#[test]
fn what_is_not_supported_is_named() {
    let folder = Folder::new();
    let good = String::from_utf8(attached("type: short\nendian: little\n", &[0; 840])).expect("text");
    let with = |from: &str, to: &str, words: &str| {
        assert!(good.contains(from));
        refused(&[folder.write("a.nrrd", good.replacen(from, to, 1))], &options(), words);
    };
    with("encoding: raw", "encoding: gzip", "encoding gzip is not supported");
    with("encoding: raw", "encoding: raw\nencoding: raw", "twice");
    with("short", "long long", "type long long is not supported");
    with("short", "block", "type block is not supported");
    with("little", "middle", "endian \"middle\"");
    with("endian: little\n", "", "does not say its endian");
    with("sizes: 7 5 3 4\n", "", "does not say sizes");
    with("7 5 3 4", "7 5 3", "sizes must be 4 numbers");
    with("7 5 3 4", "7 5 3 0", "0 frames");
    with("7 5 3 4", "7 5 3 5", "expected");
    with("7 5 3 4", "7 5 3 18446744073709551615", "too large");
    with("dimension: 4", "dimension: 5", "5 dimension(s)");
    with("# a comment", "kinds: vector domain domain domain", "axis 0 is of kind vector");
    with("# a comment", "kinds: time domain domain domain", "axis 0 of 4 is time");
    with("# a comment", "space directions: none (1,0,0) (0,1,0) (0,0,1)", "axis 0 has no space direction");
    with("# a comment", "space directions: (1,0) (0,1)", "not made of vectors");
    with("# a comment", "spacings: 0 1 1 1", "not positive");
    with("# a comment", "nonsense", "without a colon");
    with("# a comment", "byte skip: -2", "byte skip -2");
    with("# a comment", "line skip: 99", "line skip");
    with("# a comment", "data file: gone.raw", "gone.raw: opening");
    with("# a comment", "data file: a%d.raw 1 9 1", "9 data files for 4 frames");
    with("# a comment", "data file: a%x.raw 1 4 1", "needs one number");
    with("# a comment", "data file: a%d.raw 1 4 0", "make no sense");
    with("# a comment", "data file: a%d.raw 1 4 1 2", "less than a frame each");
    with("NRRD0005", "NRRX0005", "does not start");
    refused(&[folder.write("a.nrrd", header("type: uchar\n"))], &options(), "no empty line");
}

#[test]
fn no_damage_panics() {
    let fields = "type: uchar\nspacings: 0.5 2 nan 0.25\naxis mins: 1 2 nan 10\nbyte skip: 0\nline skip: 0\n";
    survives_damage("a.nrrd", &attached(fields, &[0; 420]));
    let fields = "type: uchar\nspace directions: (1,0,0) (0,1,0) (0,0,1) none\ndata file: f%02d.raw 1 4 1\n";
    survives_damage("a.nhdr", header(fields).as_bytes());
}

#[test]
fn a_file_cut_anywhere_is_an_error() {
    let folder = Folder::new();
    let good = attached("type: uchar\n", &payload(SampleType::U8, 0..4, false));
    for len in 0..good.len() {
        assert!(open(&[folder.write("a.nrrd", &good[..len])], &options()).is_err(), "{len} bytes");
    }
}
