//! The user's letters for the axes of every format, and what files say of their axes.

use super::open;
use crate::testing::{DIMS, Folder, check_inputs, gzip, payload, refused, zlib};
use std::path::PathBuf;
use wavesplat_core::base::npy::write_header;
use wavesplat_core::base::sample::SampleType;
use wavesplat_core::source::{Archive, OpenOptions};

const TY: SampleType = SampleType::I16;
const FRAMES: usize = 4;

fn lettered(axes: &str) -> OpenOptions {
    OpenOptions { axes: Some(axes.into()), ..OpenOptions::default() }
}

fn archive(path: &PathBuf, options: &OpenOptions) -> Archive {
    open(std::slice::from_ref(path), options).expect("opening").archive().clone()
}

/// The samples of some frames with their axes in an order, the slowest first.
fn stored(order: &str) -> Vec<u8> {
    let plain = payload(TY, 0..FRAMES, false);
    let length = |letter: char| "xyzt".find(letter).map_or(1, |at| [DIMS[0], DIMS[1], DIMS[2], FRAMES][at]);
    let lengths: Vec<usize> = order.chars().map(length).collect();
    let mut bytes = Vec::new();
    for mut index in 0..lengths.iter().product::<usize>() {
        let mut at = [0; 4];
        for (letter, length) in order.chars().rev().zip(lengths.iter().rev()) {
            at["xyzt".find(letter).expect("a letter")] = index % length;
            index /= length;
        }
        let sample = ((at[3] * DIMS[2] + at[2]) * DIMS[1] + at[1]) * DIMS[0] + at[0];
        bytes.extend(&plain[2 * sample..][..2]);
    }
    bytes
}

fn npy(lengths: &[usize], bytes: &[u8]) -> Vec<u8> {
    let mut out = Vec::new();
    write_header(TY, lengths, &mut out).expect("in memory");
    [out, bytes.to_vec()].concat()
}

fn metaimage(sizes: &str, fields: &str, bytes: &[u8]) -> Vec<u8> {
    let axes = sizes.split(' ').count();
    let head = format!("NDims = {axes}\nDimSize = {sizes}\nElementType = MET_SHORT\n{fields}ElementDataFile = LOCAL\n");
    [head.as_bytes(), bytes].concat()
}

fn nrrd(sizes: &str, fields: &str, bytes: &[u8]) -> Vec<u8> {
    let axes = sizes.split(' ').count();
    let head = format!("NRRD0005\ndimension: {axes}\nsizes: {sizes}\ntype: short\nendian: little\n{fields}\n");
    [head.as_bytes(), bytes].concat()
}

fn nifti(dim: &[i16], bytes: &[u8]) -> Vec<u8> {
    let mut head = vec![0; 352];
    head[..4].copy_from_slice(&348_u32.to_le_bytes());
    for (i, length) in std::iter::once(dim.len() as i16).chain(dim.iter().copied()).enumerate() {
        head[40 + 2 * i..][..2].copy_from_slice(&length.to_le_bytes());
        head[76 + 4 * i..][..4].copy_from_slice(&1_f32.to_le_bytes());
    }
    head[70..72].copy_from_slice(&4_i16.to_le_bytes());
    head[108..112].copy_from_slice(&352_f32.to_le_bytes());
    head[344..348].copy_from_slice(b"n+1\0");
    [head, bytes.to_vec()].concat()
}

#[test]
fn letters_say_what_the_axes_of_four_dimensions_count() {
    let folder = Folder::new();
    for (order, lengths, sizes) in [("ztyx", [3, 4, 5, 7], "7 5 4 3"), ("yzxt", [5, 3, 7, 4], "4 7 3 5")] {
        let bytes = stored(order);
        let options = lettered(order);
        let dim: Vec<i16> = lengths.iter().rev().map(|n| *n as i16).collect();
        for (name, bytes) in [
            ("a.npy", npy(&lengths, &bytes)),
            ("a.mha", metaimage(sizes, "", &bytes)),
            ("z.mha", metaimage(sizes, "CompressedData = True\n", &zlib(&bytes))),
            ("a.nrrd", nrrd(sizes, "encoding: raw\n", &bytes)),
            ("z.nrrd", nrrd(sizes, "encoding: gzip\n", &gzip(&bytes))),
            ("a.nii", nifti(&dim, &bytes)),
            ("a.nii.gz", gzip(&nifti(&dim, &bytes))),
        ] {
            check_inputs(&[folder.write(name, bytes)], &options, TY, FRAMES);
        }
        let dims = Some(lengths.iter().rev().copied().collect());
        let raw = OpenOptions { dims, sample: Some(TY), ..options };
        check_inputs(&[folder.write("a.raw", bytes)], &raw, TY, FRAMES);
    }
}

#[test]
fn letters_make_components_frames() {
    let folder = Folder::new();
    let bytes = stored("zyxt");
    let meta = folder.write("a.mha", metaimage("7 5 3", "ElementNumberOfChannels = 4\n", &bytes));
    let kinds = "encoding: raw\nkinds: vector domain domain domain\n";
    let nrrd = folder.write("a.nrrd", nrrd("4 7 5 3", kinds, &bytes));
    for file in [meta, nrrd] {
        check_inputs(std::slice::from_ref(&file), &lettered("zyxt"), TY, FRAMES);
        refused(
            std::slice::from_ref(&file),
            &OpenOptions::default(),
            "4 components (if these are frames, the axes are zyxt)",
        );
    }
    let file = folder.write("a.nii", nifti(&[7, 5, 3, 1, 4], &stored("tzyx")));
    check_inputs(std::slice::from_ref(&file), &lettered("tczyx"), TY, FRAMES);
    refused(&[file], &OpenOptions::default(), "the axes are tczyx");
    let file = folder.write("a.npy", npy(&[4, 3, 5, 7], &stored("tzyx")));
    let chosen = OpenOptions { variable: Some("[2]".into()), ..lettered("czyx") };
    let mut source = open(&[file], &chosen).expect("a component");
    let mut out = vec![0; 2];
    let whole = source.archive().grid.whole();
    assert_eq!((source.archive().frames, whole.voxels()), (Some(1), DIMS.iter().product()));
    let first = wavesplat_core::base::grid::Region { start: [0; 3], end: [1; 3] };
    source.window(0, 1).expect("a frame").read_box(0, &first, &mut out).expect("a voxel");
    assert_eq!(out, [2, 0]);
}

/// Checks that a file has the planes of a frame as frames of one plane.
fn check_planes(file: &PathBuf, options: &OpenOptions) {
    let mut source = open(std::slice::from_ref(file), options).expect("opening");
    assert_eq!((source.archive().grid.dims, source.archive().frames), ([7, 5, 1], Some(3)), "{}", file.display());
    let window = source.window(1, 2).expect("frames");
    let mut out = vec![0; 70];
    window.read_box(1, &source.archive().grid.whole(), &mut out).expect("a plane");
    assert_eq!(out, payload(TY, 0..1, false)[140..], "{}", file.display());
}

#[test]
fn planes_are_frames_by_the_users_word_in_every_format() {
    let folder = Folder::new();
    let bytes = payload(TY, 0..1, false);
    let spacing = "ElementSpacing = 0.5 0.25 0.125\n";
    let vtk = "# vtk DataFile Version 3.0\n\nBINARY\nDATASET STRUCTURED_POINTS\nDIMENSIONS 7 5 3\nPOINT_DATA 105\nSCALARS J short\nLOOKUP_TABLE default\n";
    let numbers: Vec<String> = bytes.chunks(2).map(|b| i16::from_le_bytes([b[0], b[1]]).to_string()).collect();
    let vti = format!(
        "<VTKFile type=\"ImageData\" byte_order=\"LittleEndian\"><ImageData WholeExtent=\"0 6 0 4 0 2\" Origin=\"0 0 0\" \
         Spacing=\"1 1 1\"><Piece Extent=\"0 6 0 4 0 2\"><PointData Scalars=\"J\"><DataArray type=\"Int16\" Name=\"J\" \
         format=\"ascii\">{}</DataArray></PointData></Piece></ImageData></VTKFile>",
        numbers.join(" ")
    );
    for (name, bytes) in [
        ("a.npy", npy(&[3, 5, 7], &bytes)),
        ("a.mha", metaimage("7 5 3", spacing, &bytes)),
        ("z.mha", metaimage("7 5 3", "CompressedData = True\n", &zlib(&bytes))),
        ("a.nrrd", nrrd("7 5 3", "encoding: raw\n", &bytes)),
        ("a.nii", nifti(&[7, 5, 3], &bytes)),
        ("a.nii.gz", gzip(&nifti(&[7, 5, 3], &bytes))),
        ("a.vtk", [vtk.as_bytes(), &payload(TY, 0..1, true)].concat()),
        ("a.vti", vti.into_bytes()),
    ] {
        let file = folder.write(name, bytes);
        check_planes(&file, &lettered("tyx"));
        let usual = archive(&file, &lettered("zyx"));
        assert_eq!((usual.grid.dims, usual.frames), (DIMS, Some(1)), "{name}");
        refused(std::slice::from_ref(&file), &lettered("ttx"), "twice");
        refused(std::slice::from_ref(&file), &lettered("ty"), "Set(\"axes\")");
    }
    let times = archive(&folder.path("a.mha"), &lettered("tyx"));
    assert_eq!((times.times, times.grid.spacing), (vec![0.0, 0.125, 0.25], [0.5, 0.25, 1.0]));
    let raw = OpenOptions { dims: Some(DIMS.into()), sample: Some(TY), ..lettered("tyx") };
    check_planes(&folder.write("a.raw", bytes), &raw);
}

#[test]
fn one_array_of_three_axes_is_a_guess_that_is_said() {
    let folder = Folder::new();
    let file = |t: usize| folder.write(&format!("f{t}.npy"), npy(&[3, 5, 7], &payload(TY, t..t + 1, false)));
    let files = [file(0), file(1)];
    let notes = |inputs: &[PathBuf]| open(inputs, &OpenOptions::default()).expect("opening").archive().notes.clone();
    assert!(notes(&files[..1])[0].text.contains("[3, 5, 7] are taken as zyx"));
    assert_eq!(notes(&files), [], "a frame in each file");
}

#[test]
fn planes_with_time_stamps_are_frames() {
    let folder = Folder::new();
    let bytes = payload(TY, 0..1, false);
    let stamps = |separator: &str| -> String {
        (0..3).map(|t| format!("Seq_Frame{t:04}_Timestamp{separator}{}\n", 10.0 + 0.5 * f64::from(t))).collect()
    };
    let meta = folder.write("a.mha", metaimage("7 5 3", &stamps(" = "), &bytes));
    let plain = folder.write("a.nrrd", nrrd("7 5 3", &format!("encoding: raw\n{}", stamps(":=")), &bytes));
    let fields = format!("encoding: raw\nkinds: domain domain list\n{}", stamps(":="));
    let list = folder.write("list.nrrd", nrrd("7 5 3", &fields, &bytes));
    for file in [meta, plain, list] {
        check_planes(&file, &OpenOptions::default());
        let found = archive(&file, &OpenOptions::default());
        assert_eq!((found.times, found.units.times.as_deref()), (vec![10.0, 10.5, 11.0], Some("s")));
        assert_eq!(archive(&file, &lettered("zyx")).frames, Some(1));
    }
    let missing = metaimage("7 5 3", &stamps(" = ").replace("0002", "0007"), &bytes);
    assert_eq!(archive(&folder.write("b.mha", missing), &OpenOptions::default()).frames, Some(1));
}

#[test]
fn components_with_times_are_frames() {
    let folder = Folder::new();
    let bytes = stored("zyxt");
    let fields = |kind: &str, keys: &str| format!("encoding: raw\nkinds: {kind} domain domain domain\n{keys}");
    let multi = "MultiVolume.FrameLabels:=0,5,10,15\nMultiVolume.FrameIdentifyingDICOMTagUnits:=ms\n";
    let values = "axis 0 index type:=numeric\naxis 0 index values:=0 5 10 15\naxis 0 index unit:=ms\n";
    for (kind, keys) in [("vector", multi), ("vector", values), ("list", values)] {
        let file = folder.write("a.nrrd", nrrd("4 7 5 3", &fields(kind, keys), &bytes));
        check_inputs(std::slice::from_ref(&file), &OpenOptions::default(), TY, FRAMES);
        let found = archive(&file, &OpenOptions::default());
        assert_eq!((found.times, found.units.times.as_deref()), (vec![0.0, 5.0, 10.0, 15.0], Some("ms")));
    }
}

#[test]
fn a_stream_has_no_letters() {
    let bytes = npy(&[3, 5, 7], &payload(TY, 0..1, false));
    let refused = super::open_stream(std::io::Cursor::new(bytes), &lettered("tyx"));
    assert!(refused.is_err_and(|e| e.to_string().starts_with("axes: is for files")));
}
