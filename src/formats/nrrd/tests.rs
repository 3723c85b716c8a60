//! Tests of NRRD files.

use crate::open;
use crate::testing::{Folder, check_inputs, gzip, message, payload, refused, survives_damage};
use wavesplat_core::base::sample::SampleType;
use wavesplat_core::source::OpenOptions;

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
    let units = "units: \"mm\" \"mm\" \"mm\" \"s\"\nsample units: K\nspacings: 1 1 1 2\n";
    let a = archive(units);
    assert_eq!([a.units.samples, a.units.times, a.units.space].map(Option::unwrap_or_default), ["K", "s", "mm"]);
    let a = archive("space units: \"mm\" \"mm\" \"um\"\nunits: \"\" \"\" \"\" \"???\"\n");
    assert_eq!(a.units, wavesplat_core::source::Units::default());
    let a = archive("space directions: (2,0,0,0) (0,3,0,0) (0,0,4,0) (0,0,0,0.5)\nspace origin: (1,-1,0.5,7)\n");
    assert_eq!((a.grid.origin, a.times), ([1.0, -1.0, 0.5], vec![7.0, 7.5, 8.0, 8.5]));
    let a = archive("space dimension: 3\nspace directions: (2,0,0) (0,3,0) (0,0,4) none\nspace origin: (1,-1,0.5)\n");
    assert_eq!((a.grid.spacing, a.grid.origin), ([2.0, 3.0, 4.0], [1.0, -1.0, 0.5]));
    assert!(a.notes.is_empty() && a.times.is_empty());
    let a = archive("space directions: (-2,0,0) (0,3,4) (0,0,4) none\nkinds: space space space list\n");
    assert_eq!(a.grid.spacing, [2.0, 5.0, 4.0]);
    assert!(a.notes[0].text.contains("are oblique"));
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
fn axes_may_be_in_any_order() {
    let folder = Folder::new();
    let (ty, plain) = (SampleType::U16, payload(SampleType::U16, 0..4, false));
    let orders: [(&str, &str, &[i64], i64); 5] = [
        ("sizes: 4 7 5 3", "kinds: time domain domain domain", &[105, 1, 7, 35], 0),
        ("sizes: 7 5 4 3", "space directions: (1,0,0) (0,1,0) none (0,0,1)", &[1, 7, 105, 35], 0),
        ("sizes: 5 3 7 4", "space directions: (0,1,0) (0,0,1) (-1,0,0) none", &[7, 35, -1, 105], 6),
        ("sizes: 3 7 5 3 4", "kinds: 3-vector domain domain domain time", &[0, 1, 7, 35, 105], 0),
        ("sizes: 7 5 3 4 3", "kinds: space space space time RGB-color", &[1, 7, 35, 105, 0], 0),
    ];
    for (sizes, fields, strides, first) in orders {
        let lens: Vec<usize> = sizes[7..].split(' ').map(|n| n.parse().expect("a number")).collect();
        let mut stored = Vec::new();
        for i in 0..lens.iter().product::<usize>() {
            let (mut left, mut from) = (i, first);
            for (len, stride) in lens.iter().zip(strides) {
                from += (left % len) as i64 * stride;
                left /= len;
            }
            stored.extend(&plain[2 * from as usize..][..2]);
        }
        let variable = (lens.len() == 5).then(|| "samples[2]".to_string());
        let options = OpenOptions { variable, ..options() };
        let text = header(&format!("{fields}\ntype: ushort\nendian: little\n")).replace("sizes: 7 5 3 4", sizes);
        let text = text.replace("dimension: 4", &format!("dimension: {}", lens.len()));
        let packed = text.replace("encoding: raw", "encoding: gzip");
        let written = |text: &str, bytes: &[u8]| folder.write("a.nrrd", [text.as_bytes(), b"\n", bytes].concat());
        check_inputs(&[written(&text, &stored)], &options, ty, 4);
        check_inputs(&[written(&packed, &gzip(&stored))], &options, ty, 4);
    }
}

#[test]
fn samples_may_be_compressed() {
    let folder = Folder::new();
    let (ty, all) = (SampleType::I16, payload(SampleType::I16, 0..4, true));
    let text = header("type: short\nendian: big\nbyte skip: 3\n").replace("raw", "gzip");
    let packed = gzip(&[b"123", all.as_slice()].concat());
    let good = [text.as_bytes(), b"\n", &packed].concat();
    check_inputs(&[folder.write("a.nrrd", &good)], &options(), ty, 4);
    folder.write("b.gz", [b"one\ntwo\n", packed.as_slice()].concat());
    let detached = format!("{text}line skip: 2\ndata file: b.gz\n");
    check_inputs(&[folder.write("a.nhdr", &detached)], &options(), ty, 4);
    let wrong = detached.replace("byte skip: 3", "byte skip: -1");
    refused(&[folder.write("a.nhdr", wrong)], &options(), "byte skip -1 is for raw");
    let huge = folder.write("a.nhdr", detached.replace("7 5 3 4", "7000 5000 3 4"));
    refused(&[huge], &options(), "cannot be so many");
    let read = |bytes: &[u8]| open(&[folder.write("a.nrrd", bytes)], &options())?.window(0, 4);
    for at in good.len() - packed.len() + 10..good.len() {
        let mut bad = good.clone();
        bad[at] ^= 4;
        assert!(read(&bad).is_err(), "a bit of byte {at}");
        assert!(read(&good[..at]).is_err(), "{at} bytes");
    }
}

#[test]
fn frames_may_be_gathered_from_files_of_their_own_or_of_parts() {
    let folder = Folder::new();
    let (ty, all) = (SampleType::I16, payload(SampleType::I16, 0..4, false));
    let lists: [(&str, usize); 4] = [("3", 210), ("2", 70), ("1", 14), ("4", 420)];
    for (axes, bytes) in lists {
        let names = |end: &str| (0..840 / bytes).map(|i| format!("{axes}_{i}.{end}\n")).collect::<String>();
        for (i, piece) in all.chunks(bytes).enumerate() {
            folder.write(&format!("{axes}_{i}.raw"), [b"12", piece].concat());
            folder.write(&format!("{axes}_{i}.gz"), gzip(&[b"12", piece].concat()));
        }
        for (encoding, end) in [("raw", "raw"), ("gzip", "gz")] {
            let fields = format!("type: short\nendian: little\nbyte skip: 2\ndata file: LIST {axes}\n{}", names(end));
            let text = header(&fields).replace("encoding: raw", &format!("encoding: {encoding}"));
            check_inputs(&[folder.write("a.nhdr", text)], &options(), ty, 4);
        }
    }
    let fields = "type: short\nendian: little\nbyte skip: 2\ndata file: 2_%d.gz 0 11 1 2\n";
    let text = header(fields).replace("encoding: raw", "encoding: gzip");
    folder.write("2_5.gz", gzip(&[0; 71]));
    let mut source = open(&[folder.write("a.nhdr", &text)], &options()).expect("opening");
    assert!(
        source.window(0, 1).is_ok()
            && message(source.window(1, 1)).contains("2_5.gz: its samples end early, after 69 bytes")
    );
    folder.write("2_5.gz", "");
    refused(&[folder.path("a.nhdr")], &options(), "2_5.gz: expected 72 bytes");
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
    for encoding in ["bzip2", "ascii", "hex"] {
        with("encoding: raw", &format!("encoding: {encoding}"), "only raw and gzip are");
    }
    with("encoding: raw", "encoding: raw\nencoding: raw", "twice");
    with("short", "block", "type block is not supported");
    with("short", "block", "type block is not supported");
    with("little", "middle", "endian \"middle\"");
    with("endian: little\n", "", "does not say its endian");
    with("sizes: 7 5 3 4\n", "", "does not say sizes");
    with("7 5 3 4", "7 5 3", "sizes must be 4 numbers");
    with("7 5 3 4", "7 5 3 0", "0 frames");
    with("7 5 3 4", "7 5 3 5", "expected");
    with("7 5 3 4", "7 5 3 18446744073709551615", "too large");
    with("dimension: 4", "dimension: 2", "2 dimension(s)");
    with("dimension: 4", "dimension: 6", "6 dimension(s)");
    with(
        "dimension: 4\nsizes: 7 5 3 4",
        "dimension: 3\nsizes: 7 5 12\nkinds: domain list time",
        "1 of space, 2 of frames",
    );
    with("dimension: 4\nsizes: 7 5 3 4", "dimension: 5\nsizes: 7 5 3 4 1", "axes 4 of space, 1 of frames");
    with("# a comment", "kinds: 2-vector domain domain domain", "ChooseComponent { name: \"samples\", components: 7 }");
    with("# a comment", "kinds: time list domain domain", "2 of space, 2 of frames");
    with("# a comment", "kinds: mood domain domain domain", "axis 0 is of kind mood");
    with("sizes: 7 5 3 4", "sizes: 0 5 3 4\nkinds: vector domain domain domain", "0 components");
    with("# a comment", "space directions: (1,0,0) (0,1,0) (0,0,1)", "must be 4 vectors or none, not 3");
    with("# a comment", "space directions: (1,0) (0,1)", "not made of vectors");
    with("# a comment", "space origin: none", "space origin is no vector");
    with("# a comment", "spacings: 0 1 1 1", "not positive");
    with("# a comment", "nonsense", "without a colon");
    with("# a comment", "byte skip: -2", "byte skip -2");
    with("# a comment", "line skip: 99", "line skip");
    with("# a comment", "data file: gone.raw", "gone.raw: opening");
    with("# a comment", "data file: a%d.raw 1 9 1", "names 9 data files, of which each should hold one of the 4");
    with("# a comment", "data file: a%x.raw 1 4 1", "needs one number");
    with("# a comment", "data file: a%d.raw 1 4 0", "make no sense");
    with("# a comment", "data file: a%d.raw 1 4 1 2", "one of the 12 parts of 2 axes");
    with("# a comment", "data file: a%d.raw 1 3 1 4", "one or several of the 4 parts of 4 axes");
    with("# a comment", "data file: a%d.raw 1 4 1 5", "of 5 axes, but 4 axes");
    with("NRRD0005", "NRRX0005", "does not start");
    refused(&[folder.write("a.nrrd", header("type: uchar\n"))], &options(), "no empty line");
}

#[test]
fn no_damage_panics() {
    let fields =
        "type: uchar\nspacings: 0.5 2 nan 0.25\naxis mins: 1 2 nan 10\nbyte skip: 0\nline skip: 0\nunits: \"m\" m\n";
    let small = [header(fields).replace("7 5 3 4", "2 2 1 2").as_bytes(), b"\n", &[7; 8]].concat();
    survives_damage("a.nrrd", &small);
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
