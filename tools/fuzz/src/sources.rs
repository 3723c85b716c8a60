//! Frames written by other programs: streams and files.

use super::input::Input;
use std::io::Cursor;
use std::path::Path;
use wavesplat::base::mapped::Access;
use wavesplat::base::sample::{SampleType, swap_endian};
use wavesplat::formats::{open, open_stream};
use wavesplat::source::{FrameSource, OpenOptions};

/// Largest frame in bytes that is read; larger ones are only opened.
const MOST: usize = 1 << 20;

/// A stream: one `.npy` or several, or headerless samples. The samples read must be those in the stream.
pub fn stream(data: &[u8]) {
    let mut input = Input::new(data);
    let flags = input.byte();
    let mut options = OpenOptions { memory: if flags & 2 == 0 { 64 } else { MOST }, ..OpenOptions::default() };
    if flags & 1 != 0 {
        headerless(&mut input, &mut options);
    }
    let bytes = input.rest();
    let Ok(mut source) = open_stream(Cursor::new(bytes.to_vec()), &options) else { return };
    let Some(found) = read(&mut *source) else { return };
    if options.sample.is_some() {
        let skipped = &bytes[options.offset as usize..];
        same(&found, &skipped[..found.len()], options.big_endian, source.archive().sample);
    } else if is_one_plain_npy(bytes) {
        let big_endian = npy_is_big_endian(bytes);
        same(&found, &bytes[bytes.len() - found.len()..], big_endian, source.archive().sample);
    }
}

fn headerless(input: &mut Input<'_>, options: &mut OpenOptions) {
    let dims = [(); 3].map(|()| input.below(9));
    let frames = Some(input.below(9)).filter(|frames| *frames > 0);
    options.dims = Some(dims.into_iter().chain(frames).collect());
    options.sample = Some(input.pick(&SampleType::ALL));
    options.big_endian = input.below(2) == 1;
    options.offset = input.byte().into();
}

/// Whether the numbers of a stream are the samples: no integers of 64 bits, no headers between frames.
fn is_one_plain_npy(bytes: &[u8]) -> bool {
    let has = |word: &[u8]| bytes.windows(word.len()).filter(|found| *found == word).count();
    has(b"i8") + has(b"u8") == 0 && has(b"NUMPY") == 1
}

/// Finds the byte order by its first mark before the type.
fn npy_is_big_endian(bytes: &[u8]) -> bool {
    bytes.iter().find(|byte| b"<>|=".contains(byte)) == Some(&b'>')
}

fn same(found: &[u8], stored: &[u8], big_endian: bool, sample: SampleType) {
    let mut stored = stored.to_vec();
    if big_endian {
        swap_endian(sample, &mut stored);
    }
    assert_eq!(found, stored, "samples");
}

/// All frames, three at a time; none if a frame is too large or cannot be read.
fn read(source: &mut dyn FrameSource) -> Option<Vec<u8>> {
    let region = source.archive().grid.whole();
    let frame = region.voxels().checked_mul(source.archive().sample.size()).filter(|bytes| *bytes <= MOST)?;
    let mut found = Vec::new();
    for first in (0..).step_by(3) {
        let left = source.archive().frames.map_or(3, |all| all - first).min(3);
        let window = source.window(first, left).ok()?;
        for index in 0..window.frames() {
            let mut out = vec![0; frame];
            if let Err(refused) = window.read_box(index, &region, &mut out) {
                assert!(refused.to_string().contains("sample is exactly"), "a frame that is there: {refused}");
                return None; // an integer of 64 bits that does not fit
            }
            found.extend(out);
        }
        if window.frames() < 3 || source.archive().frames == Some(first + 3) || found.len() > 16 * MOST {
            break;
        }
    }
    Some(found)
}

/// Names of input files. The corpus refers to them by number, so new names are only appended.
const NAMES: [&str; 19] = [
    "a.nrrd",
    "a.nhdr",
    "a.vti",
    "a.pvd",
    "a.npy",
    "a.mha",
    "a.mhd",
    "a.vtk",
    "a.pvti",
    "a.vti.series",
    "a.nii",
    "a.nii.gz",
    "a.hdr",
    "a.nc",
    "a.h5",
    "a.npz",
    "a.vtr",
    "a.pvtr",
    "a.tif",
];

/// Writes an input file under its name, beside another with some data.
pub fn inputs(data: &[u8]) {
    let mut input = Input::new(data);
    let name = input.pick(&NAMES);
    let variable = (input.below(8) == 7).then(|| "a".to_string());
    let folder = tempfile::tempdir().expect("a temporary folder");
    let write = |name: &str, bytes: &[u8]| {
        let path = folder.path().join(name);
        std::fs::write(&path, bytes).expect("writing a temporary file");
        path
    };
    write("b.raw", &[7; 96]);
    write("b.npy", NPY);
    write("a.img", &[7; 96]);
    let path = write(name, input.rest());
    let options = OpenOptions { access: Access::Read, variable, ..OpenOptions::default() };
    describe(&path, &options);
}

fn describe(path: &Path, options: &OpenOptions) {
    let Ok(mut source) = open(&[path.to_path_buf()], options) else { return };
    let archive = source.archive();
    let frames = archive.frames.expect("files have a known number of frames");
    assert!(frames > 0 && !archive.grid.whole().is_empty());
    assert!(archive.times.is_empty() || archive.times.len() == frames);
    assert!(archive.grid.spacing.iter().all(|s| s.is_finite() && *s > 0.0));
    if frames < 1000 {
        read(&mut *source);
    }
}

/// One voxel of 2 bytes.
pub const NPY: &[u8] = b"\x93NUMPY\x01\x00\x3e\x00{'descr':'|u1', 'fortran_order':False, 'shape':(1,1,1,2)}    \nab";
