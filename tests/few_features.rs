//! Messages of programs that were built without some features: each says how to get the feature. Alone in its program, so that
//! programs with few features are tested without building all tests again.
#![allow(missing_docs, reason = "tests are read through their names")]
#![allow(clippy::unwrap_used, reason = "a panic is how a test fails")]

use std::fs;
use std::path::Path;
use std::process::{Command, Output};

const CONVERTER: &str = env!("CARGO_BIN_EXE_wavesplat");
const RENDERER: &str = env!("CARGO_BIN_EXE_wavesplat-render");

/// Runs a program in a folder.
fn run(folder: &Path, program: &str, words: &[&str]) -> Output {
    Command::new(program).args(words).current_dir(folder).output().unwrap()
}

/// Expects an exit code and words of the message.
fn fails(folder: &Path, program: &str, words: &[&str], code: i32, parts: &[&str]) {
    let Output { status, stderr, .. } = run(folder, program, words);
    let message = String::from_utf8(stderr).unwrap();
    assert_eq!(status.code(), Some(code), "{words:?}: {message}");
    assert!(parts.iter().all(|part| message.contains(part)), "{words:?}: {message}");
}

/// A file of 8 frames of 4 x 4 x 4 voxels, `a.wspl`, and nothing else.
fn folder_with_file() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let samples: Vec<u8> = (0..8_u16 * 64).flat_map(|n| (f32::from(n) / 512.0).to_le_bytes()).collect();
    fs::write(folder.path().join("a.raw"), samples).unwrap();
    let words = ["convert", "a.raw", "--dims", "4x4x4x8", "--dtype", "f32", "-o", "a.wspl"];
    let converted = run(folder.path(), CONVERTER, &words);
    assert!(converted.status.success(), "{converted:?}");
    fs::remove_file(folder.path().join("a.raw")).unwrap();
    folder
}

#[test]
fn formats_that_are_not_built_in_explain_how_to_get_them() {
    let formats = [
        (cfg!(feature = "hdf5"), "hdf5/gzip.h5", "hdf5"),
        (cfg!(feature = "netcdf"), "netcdf/cdf1.nc", "netcdf"),
        (cfg!(feature = "tiff"), "tiff/u8.tif", "tiff"),
        (cfg!(feature = "zarr"), "zarr/v3_zstd.zarr", "zarr"),
    ];
    let folder = tempfile::tempdir().unwrap();
    for (_, source, feature) in formats.into_iter().filter(|(is_built_in, ..)| !is_built_in) {
        let advice = format!("cargo build --release --features {feature}");
        let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/golden/inputs").join(source);
        let words = ["convert", source.to_str().unwrap(), "-o", "a.wspl"];
        fails(folder.path(), CONVERTER, &words, 3, &["not built in", &advice]);
    }
}

#[test]
fn exr_without_its_feature_explains_how_to_get_it() {
    if cfg!(feature = "exr") {
        return;
    }
    let (folder, advice) = (folder_with_file(), "cargo build --release --features exr");
    let fails = |words: &[&str], parts: &[&str]| fails(folder.path(), RENDERER, words, 2, parts);
    fails(&["a.wspl", "-o", "p_%d.exr"], &["p_%d.exr", advice]);
    fails(&["a.wspl", "-o", "-", "--format", "exr"], &[advice]);
    fails(&["a.wspl", "-o", "v.npy", "--error-image", "e_%d.exr"], &["e_%d.exr", advice]);
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1, "nothing is written");
}

#[test]
fn remote_files_without_their_feature_explain_how_to_get_it() {
    if cfg!(feature = "remote") {
        return;
    }
    let (folder, advice) = (tempfile::tempdir().unwrap(), "cargo build --release --features remote");
    let words = ["info", "https://example.org/a.wspl"];
    fails(folder.path(), CONVERTER, &words, 2, &["https://example.org/a.wspl", "not built in", advice]);
}
