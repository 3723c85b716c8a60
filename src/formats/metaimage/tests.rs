//! Tests of MetaImage files.

use crate::open;
use crate::testing::{Folder, check_inputs, gzip, payload, refused, survives_damage, zlib};
use wavesplat_core::base::sample::SampleType;
use wavesplat_core::source::OpenOptions;

fn options() -> OpenOptions {
    OpenOptions::default()
}

fn header(axes: usize, fields: &str, data: &str) -> String {
    let sizes = if axes == 3 { "7 5 3" } else { "7 5 3 4" };
    format!("ObjectType = Image\nNDims = {axes}\nDimSize = {sizes}\n{fields}ElementDataFile = {data}\n")
}

fn local(fields: &str, payload: &[u8]) -> Vec<u8> {
    [header(4, fields, "LOCAL").as_bytes(), payload].concat()
}

#[test]
fn every_type_and_byte_order_is_read() {
    let folder = Folder::new();
    let names = ["UCHAR", "CHAR", "USHORT", "SHORT", "UINT", "INT", "", "FLOAT", "DOUBLE"];
    for (name, ty) in names.into_iter().zip(SampleType::ALL).filter(|(name, _)| !name.is_empty()) {
        for (order, big_endian) in [("BinaryDataByteOrderMSB = False", false), ("ElementByteOrderMSB : true", true)] {
            let bytes = payload(ty, 0..4, big_endian);
            let fields = format!("{order}\nElementType = MET_{name}\r\n");
            check_inputs(&[folder.write("a.mha", local(&fields, &bytes))], &options(), ty, 4);
            let packed = local(&format!("CompressedData = True\n{fields}"), &zlib(&bytes));
            check_inputs(&[folder.write("a.mha", packed)], &options(), ty, 4);
        }
    }
}

#[test]
fn samples_may_be_elsewhere() {
    let folder = Folder::new();
    let (ty, all) = (SampleType::I16, payload(SampleType::I16, 0..4, false));
    folder.write("all of it.raw", &all);
    folder.write("skip.raw", [b"123", all.as_slice()].concat());
    folder.write("all.gz", gzip(&all));
    for t in 0..4 {
        folder.write(&format!("f {:02}.raw", 3 * t + 1), payload(ty, t..t + 1, false));
        folder.write(&format!("p{}.raw", t + 1), payload(ty, t..t + 1, false));
        folder.write(&format!("{t}.z"), zlib(&payload(ty, t..t + 1, false)));
    }
    for (fields, data) in [
        ("", "all of it.raw"),
        ("HeaderSize = 3\n", "skip.raw"),
        ("HeaderSize = -1\n", "skip.raw"),
        ("CompressedData = True\n", "all.gz"),
        ("", "f %02d.raw 1 10 3"),
        ("", "p%d.raw"),
        ("", "p%d.raw 1"),
        ("", "p%d.raw 1 4"),
        ("CompressedData = True\n", "%d.z 0 3 1"),
        ("", "LIST\nf 01.raw\nf 04.raw\n\nf 07.raw\nf 10.raw"),
        ("", "LIST 3D\r\nf 01.raw\r\nf 04.raw\r\nf 07.raw\r\nf 10.raw"),
        ("", "LIST 4\nall of it.raw"),
    ] {
        let file = folder.write("a.mhd", header(4, &format!("ElementType = MET_SHORT\n{fields}"), data));
        check_inputs(&[file], &options(), ty, 4);
    }
}

#[test]
fn slices_may_be_files() {
    let folder = Folder::new();
    let all = payload(SampleType::F32, 0..4, true);
    let mut list = "LIST 2D".to_string();
    for (i, slice) in all.chunks(7 * 5 * 4).enumerate() {
        folder.write(&format!("s{i:03}.raw"), slice);
        folder.write(&format!("z{i:03}.raw"), zlib(slice));
        list += &format!("\ns{i:03}.raw");
    }
    let fields = "ElementType = MET_FLOAT\nElementByteOrderMSB = True\n";
    for memory in [0, 256 << 20] {
        let options = OpenOptions { memory, ..options() };
        check_inputs(&[folder.write("a.mhd", header(4, fields, &list))], &options, SampleType::F32, 4);
        check_inputs(&[folder.write("a.mhd", header(3, fields, "s%03d.raw 0 2 1"))], &options, SampleType::F32, 1);
    }
    let packed = header(3, &format!("CompressedData = True\n{fields}"), "z%03d.raw 0 2 1");
    check_inputs(&[folder.write("a.mhd", packed)], &options(), SampleType::F32, 1);
    check_inputs(&[folder.path("")], &options(), SampleType::F32, 1);
    folder.write("s001.raw", "short");
    refused(&[folder.write("a.mhd", header(3, fields, "s%03d.raw 0 2 1"))], &options(), "s001.raw: expected 140 bytes");
}

#[test]
fn one_component_of_several_is_read() {
    let folder = Folder::new();
    let ty = SampleType::U16;
    let [a, b] = [0..4, 1..5].map(|frames| payload(ty, frames, false));
    let both: Vec<u8> = a.chunks(2).zip(b.chunks(2)).flat_map(|(a, b)| [a, b].concat()).collect();
    let fields = "ElementNumberOfChannels = 2\nElementType = MET_USHORT_ARRAY\n";
    let named = |name: &str| OpenOptions { variable: Some(name.into()), ..options() };
    for (fields, bytes) in [(fields.into(), both.clone()), (format!("CompressedData = True\n{fields}"), zlib(&both))] {
        let file = [folder.write("a.mha", local(&fields, &bytes))];
        check_inputs(&file, &named("[0]"), ty, 4);
        let mut source = open(&file, &named("[y]")).expect("opening");
        assert_eq!(source.archive().variable.as_deref(), Some("samples[1]"));
        check_inputs(&file, &named("samples[x]"), ty, 4);
        crate::testing::check_window(&*source.window(0, 4).expect("window"), ty, 1);
        refused(&file, &options(), "samples has 2 components; ChooseComponent { name: \"samples\", components: 2 }");
        refused(&file, &named("[2]"), "none with number 2");
        refused(&file, &named("b"), "has no array b");
    }
}

#[test]
fn the_grid_and_times_are_read() {
    let folder = Folder::new();
    let archive = |fields: &str| {
        let bytes = local(&format!("ElementType = MET_UCHAR\n{fields}"), &payload(SampleType::U8, 0..4, false));
        open(&[folder.write("a.mha", bytes)], &options()).expect("opening").archive().clone()
    };
    let a = archive("ElementSpacing = 0.5 2 1 0.25\nOffset = 1 2 -3 10\n");
    assert_eq!((a.grid.spacing, a.grid.origin), ([0.5, 2.0, 1.0], [1.0, 2.0, -3.0]));
    assert_eq!(a.times, [10.0, 10.25, 10.5, 10.75]);
    assert!(a.notes.is_empty());
    let a = archive("ElementSize = 3 3 3 1\nPosition = 1 1 1 0\nTransformMatrix = 1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1\n");
    assert_eq!((a.grid.spacing, a.grid.origin), ([3.0; 3], [1.0; 3]));
    assert!(a.notes.is_empty());
    let a = archive("Orientation = 0.6 0.8 0 0 -0.8 0.6 0 0 0 0 1 0 0 0 0 1\nElementToIntensityFunctionSlope = 2\n");
    assert!(a.times.is_empty() && a.notes[0].text.contains("are oblique") && a.notes[1].text.contains("not applied"));
}

#[test]
fn straight_directions_are_turned() {
    let folder = Folder::new();
    let ty = SampleType::I16;
    let all = payload(ty, 0..4, false);
    let frames = all.chunks(2 * 7 * 5 * 3);
    let turned = |frame: &[u8]| -> Vec<u8> {
        let stored = (0..3).flat_map(|z| (0..5).flat_map(move |y| (0..7).map(move |x| (6 - x, 4 - y, z))));
        stored.flat_map(|(x, y, z)| frame[2 * ((z * 5 + y) * 7 + x)..][..2].to_vec()).collect()
    };
    let turned: Vec<u8> = frames.flat_map(turned).collect();
    let matrix = "TransformMatrix = -1 0 0 0 0 -1 0 0 0 0 1 0 0 0 0 1\n";
    let fields = format!("ElementType = MET_SHORT\nElementSpacing = 0.5 2 1 1\nOffset = 1 2 3 0\n{matrix}");
    for (i, slice) in turned.chunks(2 * 7 * 5).enumerate() {
        folder.write(&format!("s{i:03}.raw"), slice);
    }
    let packed = local(&format!("CompressedData = True\n{fields}"), &zlib(&turned));
    let slices = header(4, &fields, "LIST 2D") + &(0..12).map(|i| format!("s{i:03}.raw\n")).collect::<String>();
    for bytes in [local(&fields, &turned), packed, slices.into_bytes()] {
        let file = [folder.write("a.mhd", bytes)];
        check_inputs(&file, &options(), ty, 4);
        let source = open(&file, &options()).expect("opening");
        let grid = source.archive().grid;
        assert_eq!((grid.spacing, grid.origin), ([0.5, 2.0, 1.0], [-2.0, -6.0, 3.0]));
        assert!(source.archive().notes[0].text.contains("along -x -y +z of the world"));
    }
    let mixed = fields.replace("-1 0 0 0 0 -1", "-1 0 0 1 0 -1");
    let source = open(&[folder.write("a.mha", local(&mixed, &turned))], &options()).expect("opening");
    assert!(source.archive().notes[1].text.contains("mixes time with space"));
}

#[test]
fn an_axis_of_the_array_is_a_row_of_the_matrix() {
    let folder = Folder::new();
    let all = payload(SampleType::U8, 0..1, false);
    // Axes of 5, 3, 7 voxels that go along y, z, x.
    let stored = (0..7).flat_map(|x| (0..3).flat_map(move |z| (0..5).map(move |y| (z * 5 + y) * 7 + x)));
    let samples: Vec<u8> = stored.map(|at| all[at]).collect();
    let fields = "ElementType = MET_UCHAR\nElementSpacing = 1 2 3\nTransformMatrix = 0 1 0 0 0 1 1 0 0\n";
    let text = header(3, fields, "LOCAL").replace("7 5 3", "5 3 7");
    let file = [folder.write("a.mha", [text.as_bytes(), &samples].concat())];
    check_inputs(&file, &options(), SampleType::U8, 1);
    assert_eq!(open(&file, &options()).expect("opening").archive().grid.spacing, [3.0, 1.0, 2.0]);
}

#[test]
fn what_is_not_supported_is_named() {
    let folder = Folder::new();
    let good = String::from_utf8(local("ElementType = MET_SHORT\n", &[0; 840])).expect("text");
    let with = |from: &str, to: &str, words: &str| {
        assert!(good.contains(from));
        refused(&[folder.write("a.mha", good.replacen(from, to, 1))], &options(), words);
    };
    with("MET_SHORT", "MET_OTHER", "ElementType MET_OTHER is not supported");
    with("ElementType = MET_SHORT", "", "does not say ElementType");
    with("ObjectType", "BinaryData = False\nObjectType", "as text");
    with("ObjectType", "CompressedData = Perhaps\nObjectType", "neither True nor False");
    with("NDims = 4", "NDims = 2", "has 2 dimension(s)");
    with("NDims = 4", "NDims = four", "NDims is no number");
    with("NDims", "DimSize = 1\nNDims", "says DimSize twice");
    with("7 5 3 4", "7 5 3", "DimSize must be 4 numbers");
    with("7 5 3 4", "7 5 3 0", "0 frames");
    with("7 5 3 4", "7 5 3 5", "expected");
    with("7 5 3 4", "7 5 3 99999999999999999", "too large");
    with("NDims", "CompressedData = True\nHeaderSize = -1\nNDims", "HeaderSize -1 says nothing");
    with("NDims", "HeaderSize = 9\nNDims", "ends inside its header");
    with("NDims", "HeaderSize = -2\nNDims", "HeaderSize -2");
    with("NDims", "ElementNumberOfChannels = 0\nNDims", "samples has no component");
    with("NDims", "nonsense\nNDims", "without a =");
    with("NDims", "ElementSpacing = 1 1 -1 1\nNDims", "not positive");
    with("LOCAL", "gone.raw", "gone.raw: opening");
    with("LOCAL", "", "names no file");
    with("LOCAL", "LIST 5\na", "LIST 5 says no number");
    with("LOCAL", "LIST 1\na", "of 1 dimension each");
    with("LOCAL", "LIST\na", "names 2 data file(s) of 3 axes for 4 frame(s)");
    with("LOCAL", "a%d 1 9 1", "names 9 data file(s)");
    with("LOCAL", "a%x 1 4 1", "needs one number");
    with("LOCAL", "a%d 1 4 0", "make no sense");
    refused(&[folder.write("a.mha", "ObjectType = Image\n")], &options(), "without ElementDataFile");
    let many = good.replacen("7 5 3 4", "7 5 3 9999999999", 1).replacen("NDims", "CompressedData = True\nNDims", 1);
    refused(&[folder.write("a.mha", many)], &options(), "cannot be so many");
}

#[test]
fn a_file_cut_anywhere_is_an_error() {
    let folder = Folder::new();
    for (fields, bytes) in [("", payload(SampleType::U8, 0..4, false)), ("CompressedData = True\n", zlib(&[7; 420]))] {
        let good = local(&format!("ElementType = MET_UCHAR\n{fields}"), &bytes);
        for len in 0..good.len() {
            let source = open(&[folder.write("a.mha", &good[..len])], &options());
            assert!(source.is_err() || source.is_ok_and(|mut source| source.window(0, 4).is_err()), "{len} bytes");
        }
    }
}

#[test]
fn no_damage_panics() {
    let fields = "ElementType = MET_CHAR\nElementSpacing = 1 2 3 4\nHeaderSize = 0\n";
    survives_damage("a.mha", &local(fields, &[0; 420])[..180]);
    let fields = format!("{fields}ElementNumberOfChannels = 1\nCompressedData = 1\n");
    survives_damage("a.mha", &local(&fields, &zlib(&[7; 420])));
    survives_damage("a.mhd", header(4, "ElementType = MET_CHAR\n", "LIST 2\na\nb").as_bytes());
    survives_damage("a.mhd", header(3, "ElementType = MET_CHAR\n", "f%02d 1 3 1").as_bytes());
}
