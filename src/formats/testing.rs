//! Helpers for the tests of the formats: files, and checks of opening them.

pub(crate) use wavesplat_core::source::testing::{DIMS, check_source, check_window, message, payload, value};

use crate::open::open;
use flate2::Compression;
use flate2::write::{GzEncoder, ZlibEncoder};
use std::fs;
use std::io::Write;
use std::path::PathBuf;
use wavesplat_core::base::mapped::Access;
use wavesplat_core::base::sample::SampleType;
use wavesplat_core::source::OpenOptions;

/// The bytes, packed by gzip.
pub(crate) fn gzip(bytes: &[u8]) -> Vec<u8> {
    let mut packed = GzEncoder::new(Vec::new(), Compression::fast());
    packed.write_all(bytes).expect("packing");
    packed.finish().expect("packing")
}

/// The bytes, packed by zlib.
pub(crate) fn zlib(bytes: &[u8]) -> Vec<u8> {
    let mut packed = ZlibEncoder::new(Vec::new(), Compression::fast());
    packed.write_all(bytes).expect("packing");
    packed.finish().expect("packing")
}

/// A folder that vanishes with the test.
pub(crate) struct Folder(tempfile::TempDir);

impl Folder {
    pub(crate) fn new() -> Self {
        Self(tempfile::tempdir().expect("temporary folder"))
    }

    pub(crate) fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    pub(crate) fn write(&self, name: &str, bytes: impl AsRef<[u8]>) -> PathBuf {
        let path = self.path(name);
        fs::write(&path, bytes).expect("writing");
        path
    }
}

/// Checks that inputs hold `frames` frames of the tests' values, by map and by read.
pub(crate) fn check_inputs(inputs: &[PathBuf], options: &OpenOptions, ty: SampleType, frames: usize) {
    for access in [Access::Map, Access::Read] {
        let mut source = open(inputs, &OpenOptions { access, ..options.clone() }).expect("opening");
        assert_eq!(source.archive().frames, Some(frames));
        check_source(&mut *source, ty, frames);
        assert!(source.window(frames, 1).is_err(), "beyond the end");
        assert_eq!(source.window(frames, 0).expect("nothing").frames(), 0);
    }
}

/// Checks that opening fails and that the message has these words.
pub(crate) fn refused(inputs: &[PathBuf], options: &OpenOptions, words: &str) {
    let message = message(open(inputs, options));
    assert!(message.contains(words), "{words:?} is not in {message:?}");
}

/// Opens and reads a file with each of its bytes changed in turn: nothing may panic.
pub(crate) fn survives_damage(name: &str, good: &[u8]) {
    survives_damage_in(0..good.len(), name, good);
}

/// As [`survives_damage`], of some of its bytes.
pub(crate) fn survives_damage_in(bytes: std::ops::Range<usize>, name: &str, good: &[u8]) {
    let folder = Folder::new();
    for (at, byte) in bytes.flat_map(|at| b"\0\xff9-<(% ".map(|byte| (at, byte))) {
        let mut bad = good.to_vec();
        bad[at] = byte;
        let Ok(mut source) = open(&[folder.write(name, bad)], &OpenOptions::default()) else { continue };
        let whole = source.archive().grid.whole();
        let mut out = vec![0; whole.voxels() * source.archive().sample.size()];
        let frames = source.archive().frames.expect("files have a known number of frames");
        if let Ok(window) = source.window(0, frames) {
            let _ = window.read_box(0, &whole, &mut out);
        }
    }
}
