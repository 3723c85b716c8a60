//! Tests of NIfTI files.

use crate::open;
use crate::testing::{Folder, check_inputs, gzip, message, payload, refused, survives_damage};
use wavesplat_core::base::sample::SampleType;
use wavesplat_core::source::{Archive, OpenOptions};

/// Places of fields in version 1 and version 2.
const DIM: [usize; 2] = [40, 16];
const DATATYPE: [usize; 2] = [70, 12];
const PIXDIM: [usize; 2] = [76, 104];
const VOX_OFFSET: [usize; 2] = [108, 168];
const SLOPE: [usize; 2] = [112, 176];
const INTER: [usize; 2] = [116, 184];
const UNITS: [usize; 2] = [123, 500];
const TOFFSET: [usize; 2] = [136, 216];
const QFORM_CODE: [usize; 2] = [252, 344];
const SFORM_CODE: [usize; 2] = [254, 348];
const QFORM: [usize; 2] = [256, 352];
const SFORM: [usize; 2] = [280, 400];
const INTENT_NAME: [usize; 2] = [328, 508];

/// A header that is being written.
#[derive(Clone)]
struct Written {
    bytes: Vec<u8>,
    second: bool,
    big_endian: bool,
}

impl Written {
    fn new(second: bool, big_endian: bool, datatype: i16, dim: &[i64]) -> Self {
        let len = if second { SECOND } else { FIRST };
        let mut file = Self { bytes: vec![0; len + 4], second, big_endian };
        file.put([0, 0], &(len as u32).to_le_bytes());
        let (at, magic) = if second { (4, &b"n+2\0\r\n\x1a\n"[..]) } else { (344, &b"n+1\0"[..]) };
        file.bytes[at..][..magic.len()].copy_from_slice(magic);
        file.put(DATATYPE, &datatype.to_le_bytes());
        for (i, n) in std::iter::once(dim.len() as i64).chain(dim.iter().copied()).enumerate() {
            file.dim(i, n);
        }
        (0..8).for_each(|i| file.real(PIXDIM, i, 1.0));
        if second {
            file.put(VOX_OFFSET, &544_u64.to_le_bytes());
        } else {
            file.real(VOX_OFFSET, 0, 352.0);
        }
        file
    }

    fn put(&mut self, at: [usize; 2], bytes: &[u8]) {
        let mut bytes = bytes.to_vec();
        if self.big_endian {
            bytes.reverse();
        }
        self.bytes[at[usize::from(self.second)]..][..bytes.len()].copy_from_slice(&bytes);
    }

    fn dim(&mut self, index: usize, n: i64) {
        let at = [DIM[0] + 2 * index, DIM[1] + 8 * index];
        if self.second { self.put(at, &n.to_le_bytes()) } else { self.put(at, &(n as i16).to_le_bytes()) }
    }

    fn real(&mut self, at: [usize; 2], index: usize, n: f64) {
        let at = [at[0] + 4 * index, at[1] + 8 * index];
        if self.second { self.put(at, &n.to_le_bytes()) } else { self.put(at, &(n as f32).to_le_bytes()) }
    }

    fn code(&mut self, at: [usize; 2], n: i16) {
        if self.second { self.put(at, &i32::from(n).to_le_bytes()) } else { self.put(at, &n.to_le_bytes()) }
    }

    fn with(&self, samples: &[u8]) -> Vec<u8> {
        [&self.bytes, samples].concat()
    }
}

const FIRST: usize = 348;
const SECOND: usize = 540;
const TYPES: [(i16, SampleType); 8] = [
    (2, SampleType::U8),
    (4, SampleType::I16),
    (8, SampleType::I32),
    (16, SampleType::F32),
    (64, SampleType::F64),
    (256, SampleType::I8),
    (512, SampleType::U16),
    (768, SampleType::U32),
];

fn options() -> OpenOptions {
    OpenOptions::default()
}

/// Four frames of 16 bits, version 1.
fn usual() -> Written {
    Written::new(false, false, 512, &[7, 5, 3, 4])
}

fn archive(header: &Written) -> Archive {
    let folder = Folder::new();
    let bytes = header.with(&payload(SampleType::U16, 0..4, header.big_endian));
    open(&[folder.write("a.nii", bytes)], &options()).expect("opening").archive().clone()
}

#[test]
fn every_type_version_and_byte_order_is_read() {
    let folder = Folder::new();
    for (datatype, ty) in TYPES {
        for (second, big_endian) in [(false, false), (false, true), (true, false), (true, true)] {
            let bytes = Written::new(second, big_endian, datatype, &[7, 5, 3, 4]).with(&payload(ty, 0..4, big_endian));
            check_inputs(&[folder.write("a.nii.gz", gzip(&bytes))], &options(), ty, 4);
            check_inputs(&[folder.write("a.nii", &bytes)], &options(), ty, 4);
            check_inputs(&[folder.write("without an extension", bytes)], &options(), ty, 4);
        }
    }
}

#[test]
fn samples_may_be_in_a_file_beside() {
    let folder = Folder::new();
    let samples = payload(SampleType::U16, 0..4, false);
    let mut header = usual();
    header.bytes[344..348].copy_from_slice(b"ni1\0");
    header.real(VOX_OFFSET, 0, 16.0);
    let head = folder.write("a.hdr", &header.bytes);
    refused(std::slice::from_ref(&head), &options(), "none beside it");
    let image = [&[9; 16], samples.as_slice()].concat();
    folder.write("a.img.gz", gzip(&image));
    check_inputs(std::slice::from_ref(&head), &options(), SampleType::U16, 4);
    let named = folder.write("a.img", image);
    for inputs in [head, named, folder.path("")] {
        check_inputs(&[inputs], &options(), SampleType::U16, 4);
    }
    folder.write("other.hdr", "ENVI");
    refused(&[folder.write("other.img", &samples)], &options(), "is of no known format");
    std::fs::remove_file(folder.path("other.hdr")).expect("removing");
    folder.write("B.HDR", &header.bytes[..FIRST]);
    check_inputs(&[folder.write("B.IMG", [&[9; 16], samples.as_slice()].concat())], &options(), SampleType::U16, 4);
}

#[test]
fn frames_may_be_files_of_three_axes() {
    let folder = Folder::new();
    for t in 0..3 {
        let bytes = Written::new(true, false, 512, &[7, 5, 3, 1, 1]).with(&payload(SampleType::U16, t..t + 1, false));
        folder.write(&format!("f{t}.nii.gz"), gzip(&bytes));
    }
    check_inputs(&[folder.path("")], &options(), SampleType::U16, 3);
    check_inputs(&[folder.path("f*.nii.gz")], &options(), SampleType::U16, 3);
}

#[test]
fn numbers_that_are_scaled_are_samples_of_floats() {
    let folder = Folder::new();
    for (datatype, ty, sample) in [(512, SampleType::U16, SampleType::F32), (8, SampleType::I32, SampleType::F64)] {
        let mut header = Written::new(false, true, datatype, &[7, 5, 3, 4]);
        header.real(SLOPE, 0, 0.25);
        header.real(INTER, 0, -3.0);
        let bytes = header.with(&payload(ty, 0..4, true));
        check_inputs(&[folder.write("a.nii.gz", gzip(&bytes))], &options(), sample, 4);
        check_inputs(&[folder.write("a.nii", bytes)], &options(), sample, 4);
    }
    for (slope, inter) in [(1.0, 0.0), (0.0, 7.0), (f64::NAN, f64::NAN)] {
        let mut header = usual();
        header.real(SLOPE, 0, slope);
        header.real(INTER, 0, inter);
        assert_eq!(archive(&header).sample, SampleType::U16);
    }
}

#[test]
fn times_units_and_the_name_are_read() {
    for second in [false, true] {
        let mut header = Written::new(second, second, 512, &[7, 5, 3, 4]);
        header.real(PIXDIM, 4, 0.5);
        header.real(TOFFSET, 0, 10.0);
        let unit = 2 | 16;
        if second {
            header.put(UNITS, &i32::to_le_bytes(unit));
        } else {
            header.bytes[UNITS[0]] = unit as u8;
        }
        header.bytes[INTENT_NAME[usize::from(second)]..][..7].copy_from_slice(b"density");
        let a = archive(&header);
        assert_eq!(a.times, [10.0, 10.5, 11.0, 11.5]);
        assert_eq!((a.units.space.as_deref(), a.units.times.as_deref()), (Some("mm"), Some("ms")));
        assert_eq!(a.variable.as_deref(), Some("density"));
        header.real(PIXDIM, 4, 0.0);
        let a = archive(&header);
        assert_eq!((a.times.len(), a.units.times), (0, None));
    }
}

#[test]
fn the_grid_is_that_of_the_sform_or_the_qform_or_of_the_steps() {
    let mut header = usual();
    [-1.0, 0.5, 0.0, -2.0].into_iter().enumerate().for_each(|(i, n)| header.real(PIXDIM, i, n));
    let grid = archive(&header).grid;
    assert_eq!((grid.spacing, grid.origin), ([0.5, 1.0, 2.0], [0.0; 3]));
    header.code(QFORM_CODE, 1);
    [0.0, 0.0, 0.0, -1.0, 10.0, 104.0].into_iter().enumerate().for_each(|(i, n)| header.real(QFORM, i, n));
    let a = archive(&header);
    assert_eq!((a.grid.spacing, a.grid.origin), ([0.5, 1.0, 2.0], [-1.0, 10.0, 100.0]));
    assert!(a.notes[0].text.contains("along +x +y -z"), "{:?}", a.notes);
    header.code(SFORM_CODE, 1);
    let rows = [3.0, 0.0, 0.0, 1.0, 0.0, 4.0, 0.0, 2.0, 0.0, 0.0, 5.0, 3.0];
    rows.into_iter().enumerate().for_each(|(i, n)| header.real(SFORM, i, n));
    let a = archive(&header);
    assert_eq!((a.grid.spacing, a.grid.origin, a.notes.len()), ([3.0, 4.0, 5.0], [1.0, 2.0, 3.0], 0));
    header.real(SFORM, 1, 4.0);
    assert!(archive(&header).notes[0].text.contains("directions of the NIfTI are oblique"));
}

#[test]
fn voxels_that_are_stored_otherwise_are_turned() {
    let folder = Folder::new();
    let mut header = Written::new(false, false, 512, &[5, 3, 7, 4]);
    header.code(SFORM_CODE, 1);
    let rows = [0.0, 0.0, -0.5, 2.0, 1.0, 0.0, 0.0, 10.0, 0.0, 2.0, 0.0, 100.0];
    rows.into_iter().enumerate().for_each(|(i, n)| header.real(SFORM, i, n));
    let plain = payload(SampleType::U16, 0..4, false);
    let mut stored = Vec::new();
    for (t, x, z, y) in places(4, 7, 3, 5) {
        let from = ((t * 3 + z) * 5 + y) * 7 + (6 - x);
        stored.extend(&plain[2 * from..][..2]);
    }
    for (name, bytes) in [("a.nii", header.with(&stored)), ("a.nii.gz", gzip(&header.with(&stored)))] {
        let file = folder.write(name, bytes);
        check_inputs(std::slice::from_ref(&file), &options(), SampleType::U16, 4);
        let grid = open(&[file], &options()).expect("opening").archive().grid;
        assert_eq!((grid.spacing, grid.origin), ([0.5, 1.0, 2.0], [-1.0, 10.0, 100.0]));
    }
}

/// All places of an array of four axes, the slowest first.
fn places(a: usize, b: usize, c: usize, d: usize) -> impl Iterator<Item = (usize, usize, usize, usize)> {
    (0..a * b * c * d).map(move |i| (i / (b * c * d), i / (c * d) % b, i / d % c, i % d))
}

#[test]
fn one_component_of_vectors_is_read() {
    let folder = Folder::new();
    let header = Written::new(false, false, 512, &[7, 5, 3, 4, 3]);
    let (frames, other) = (payload(SampleType::U16, 0..4, false), payload(SampleType::U16, 9..13, false));
    let bytes = header.with(&[other.as_slice(), &frames, &other].concat());
    let taken = |name: &str| OpenOptions { variable: Some(name.into()), ..options() };
    for (name, bytes) in [("a.nii", bytes.clone()), ("a.nii.gz", gzip(&bytes))] {
        let file = [folder.write(name, bytes)];
        check_inputs(&file, &taken("samples[1]"), SampleType::U16, 4);
        check_inputs(&file, &taken("[y]"), SampleType::U16, 4);
        refused(&file, &options(), "ChooseComponent { name: \"samples\", components: ");
        refused(&file, &taken("samples[3]"), "none with number 3");
        refused(&file, &taken("speed"), "has no array speed");
    }
    let cut = folder.write("a.nii.gz", gzip(&bytes[..bytes.len() - 1]));
    let mut source = open(&[cut], &taken("[1]")).expect("opening");
    assert!(message(source.window(0, 4)).contains("holds less than its header says"));
}

#[test]
fn what_is_not_supported_is_named() {
    let folder = Folder::new();
    let samples = payload(SampleType::U16, 0..4, false);
    let with = |change: &dyn Fn(&mut Written), words: &str| {
        let mut header = usual();
        change(&mut header);
        refused(&[folder.write("a.nii", header.with(&samples))], &options(), words);
    };
    for (datatype, words) in [(32, "complex"), (128, "colours of 3"), (1536, "floats of 128 bits"), (7, "not known")] {
        with(&|h| h.put(DATATYPE, &i16::to_le_bytes(datatype)), words);
    }
    with(&|h| h.dim(0, 2), "2 dimension(s)");
    with(&|h| h.dim(0, 9), "dim[0] is 9");
    with(&|h| h.dim(3, -3), "dim[3] is -3");
    with(&|h| h.dim(4, 0), "there are no samples");
    with(&|h| h.dim(4, 5), "expected");
    with(&|h| (1..5).for_each(|i| h.dim(i, 32767)), "found 1192");
    with(
        &|h| {
            (5..8).for_each(|i| {
                h.dim(0, 7);
                h.dim(i, 2);
            });
        },
        "has 7 dimensions",
    );
    with(&|h| h.real(VOX_OFFSET, 0, 340.0), "vox_offset 340 is no place");
    with(&|h| h.real(VOX_OFFSET, 0, 352.5), "vox_offset 352.5 is no place");
    with(&|h| h.real(VOX_OFFSET, 0, f64::NAN), "vox_offset NaN is no place");
    with(&|h| h.real(VOX_OFFSET, 0, 1e12), "found 1192");
    with(
        &|h| {
            h.real(SLOPE, 0, 2.0);
            h.real(INTER, 0, f64::NAN);
        },
        "scl_inter NaN is not finite",
    );
    with(&|h| h.code(SFORM_CODE, 1), "not positive");
    with(&|h| h.bytes[344] = 0, "ANALYZE");
    with(&|h| h.bytes[0] = 0, "does not start as a NIfTI file does");
    let mut second = Written::new(true, false, 512, &[7, 5, 3, 4]);
    let mut huge = second.clone();
    (1..5).for_each(|i| huge.dim(i, i64::MAX / 3));
    refused(&[folder.write("a.nii", huge.with(&samples))], &options(), "too large");
    let huge = Written::new(true, false, 512, &[7, 5, 3, 1 << 40]);
    refused(&[folder.write("a.nii.gz", gzip(&huge.with(&samples)))], &options(), "cannot be so many");
    second.bytes[8] = b'\n';
    refused(&[folder.write("a.nii", second.with(&samples))], &options(), "as if it were text");
    refused(&[folder.write("a.nii.gz", b"\x1f\x8bnonsense")], &options(), "cannot be decompressed");
    let sized = OpenOptions { dims: Some(vec![7, 5, 3]), ..options() };
    refused(&[folder.write("a.nii.gz", "")], &sized, "a.nii.gz says itself what it holds; this is for headerless data");
}

#[test]
fn damage_is_an_error_and_never_a_panic() {
    let folder = Folder::new();
    let whole = usual().with(&payload(SampleType::U16, 0..4, false));
    for len in (0..whole.len()).step_by(7) {
        assert!(open(&[folder.write("a.nii", &whole[..len])], &options()).is_err(), "{len} bytes");
    }
    let packed = gzip(&whole);
    let read = |bytes: &[u8]| {
        let mut source = open(&[folder.write("a.nii.gz", bytes)], &options())?;
        let frames = source.archive().frames.expect("known");
        source.window(0, frames)
    };
    assert!(read(&packed).is_ok());
    for len in (0..packed.len()).step_by(3) {
        assert!(read(&packed[..len]).is_err(), "{len} bytes");
    }
    for at in 10..packed.len() {
        let mut bad = packed.clone();
        bad[at] ^= 1;
        assert!(read(&bad).is_err(), "a bit of byte {at}");
    }
    let more = message(read(&gzip(&[whole.as_slice(), b"x"].concat())));
    assert!(more.contains("holds more than its header says"), "{more}");
    survives_damage("a.nii", &Written::new(false, true, 2, &[2, 2, 2, 1, 1]).with(&[7; 8]));
}
