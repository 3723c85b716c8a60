//! Files written by earlier versions must read to the same bits forever.

use crate::common::memory::Memory;
use crate::common::series::{Kind, Mask, volume};
use crate::common::{BASES, MEMORY, extracted, settings, stored};
use std::fs;
use std::path::{Path, PathBuf};
use wavesplat::base::grid::Grid;
use wavesplat::base::mapped::{Access, FileBytes};
use wavesplat::base::progress::Silent;
use wavesplat::base::sample::SampleType;
use wavesplat::convert::{
    Basis, Bound, ConvertConfig, ResumePoint, SchemeConstraint, SpatialPredictor, Stencil, Target, convert_into,
};
use wavesplat::file::CoefficientFile;
use wavesplat::file::recover::recover;
use wavesplat::file::repack::repack;
use wavesplat::file::verify::verify;
use wavesplat_format::{CompletePrefix, Metadata, Packing, Window};
use xxhash_rust::xxh3::xxh3_64;

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/golden")
}

/// The files' names and the digests of their samples.
fn digests() -> Vec<(String, u64)> {
    let text = fs::read_to_string(folder().join("digests.txt")).unwrap();
    let line = |line: &str| {
        let (name, digest) = line.split_once(' ').unwrap();
        (name.to_string(), u64::from_str_radix(digest, 16).unwrap())
    };
    text.lines().map(line).collect()
}

fn open(path: &Path) -> CoefficientFile {
    CoefficientFile::open_with(path, Access::Read).unwrap()
}

#[test]
fn golden_files_are_read_to_the_same_bits() {
    let digests = digests();
    let mut names: Vec<_> = fs::read_dir(folder()).unwrap().map(|e| e.unwrap().path()).collect();
    names.retain(|path| path.extension().is_some_and(|e| e == "wspl"));
    assert_eq!(names.len(), digests.len(), "every file has a digest");
    for (name, digest) in digests {
        let path = folder().join(format!("{name}.wspl"));
        let lost = name == "lost";
        assert_eq!(verify(&open(&path), None, MEMORY, &Silent).unwrap().damaged, u64::from(lost), "{name}");
        let file = if lost { open(&path).skip_damaged().unwrap() } else { open(&path) };
        assert_eq!(xxh3_64(&extracted(&file)), digest, "{name}");
        let record = file.metadata().encode().unwrap();
        assert_eq!(&Metadata::decode(&record).unwrap(), file.metadata(), "{name}");
    }
}

/// The features: a name, a sample type and a coding.
fn features() -> Vec<(String, SampleType, Kind, Mask, ConvertConfig)> {
    use SampleType::*;
    let mut found = Vec::new();
    for (ty, basis) in [U8, I8, U16, I16, U32, I32, F16, F32, F64].into_iter().zip(BASES.into_iter().cycle()) {
        let name = format!("{}-{}", basis.name(), ty);
        found.push((name, ty, Kind::Wave, Mask::None, settings(basis, window(basis), 0.01)));
    }
    let plain = |basis| settings(basis, window(basis), 0.01);
    let pyramid = |basis, stencil, tolerance| {
        let coding = SchemeConstraint { basis: Some(basis), space: SpatialPredictor::Pyramid(stencil) };
        ConvertConfig { coding, tolerance, ..plain(basis) }
    };
    let mut add = |name: &str, kind, mask, config| found.push((name.to_string(), F32, kind, mask, config));
    add("linear-single", Kind::Wave, Mask::None, pyramid(Basis::Samples, Stencil::Linear, 0.01));
    add("cubic-double", Kind::Wave, Mask::None, pyramid(Basis::Samples, Stencil::Cubic, 1e-7));
    add("haar-cubic", Kind::Ramp, Mask::None, pyramid(Basis::Haar, Stencil::Cubic, 0.01));
    add("multi-linear", Kind::Ramp, Mask::None, pyramid(Basis::Multi, Stencil::Linear, 0.01));
    add("missing", Kind::Wave, Mask::Special, plain(Basis::Samples));
    add("exact", Kind::Noise, Mask::None, ConvertConfig { tolerance: 0.0, ..plain(Basis::Haar) });
    add("rms", Kind::Wave, Mask::None, ConvertConfig { bound: Bound::Rms, ..plain(Basis::Haar) });
    add(
        "relative",
        Kind::Wave,
        Mask::None,
        ConvertConfig { bound: Bound::Relative { floor: 0.25 }, ..plain(Basis::Multi) },
    );
    let sampled = Bound::Sampled { samples: 30, seed: 1 };
    add("sampled", Kind::Wave, Mask::None, ConvertConfig { bound: sampled, ..plain(Basis::Haar) });
    // Version 1.1: nested parts, and ghost nodes.
    add("nested-samples", Kind::Wave, Mask::None, plain(Basis::Samples));
    add("nested-learned", Kind::Wave, Mask::None, plain(Basis::Learned));
    add("nested-missing", Kind::Mixed, Mask::Special, pyramid(Basis::Samples, Stencil::Cubic, 1e-3));
    add("nested-double", Kind::Wave, Mask::None, pyramid(Basis::Haar, Stencil::Linear, 1e-7));
    // Version 1.2: tiers.
    let mut add_tiered = |name: &str, block, kind, mask, config| {
        add(&format!("tiered-{name}"), kind, mask, ConvertConfig { block: Some(block), ..config });
    };
    let over_time = pyramid(Basis::Samples, Stencil::Cubic, 1e-3);
    add_tiered("samples", 2, Kind::Wave, Mask::None, plain(Basis::Samples));
    add_tiered("learned", 2, Kind::Wave, Mask::None, plain(Basis::Learned));
    add_tiered("missing", 4, Kind::Mixed, Mask::Special, over_time.clone());
    add_tiered("zeros", 2, Kind::Flash, Mask::None, over_time);
    add_tiered("double", 4, Kind::Wave, Mask::None, pyramid(Basis::Haar, Stencil::Linear, 1e-7));
    // Version 1.2: listed values.
    found.push(("listed-labels".into(), U8, Kind::Steps, Mask::None, plain(Basis::Samples)));
    found.push((
        "listed-missing".into(),
        F64,
        Kind::Steps,
        Mask::Special,
        ConvertConfig { tolerance: 0.0, ..plain(Basis::Samples) },
    ));
    found
}

fn window(basis: Basis) -> usize {
    if basis == Basis::Multi { 9 } else { 8 }
}

/// The source of a feature's golden file.
fn source(seed: usize, (ty, kind, mask): (SampleType, Kind, Mask)) -> Memory {
    let grid = Grid { dims: [11, 7, 6], spacing: [1.0, 0.5, 2.0], origin: [0.0, -1.0, 3.0] };
    Memory::new(grid, ty, volume(kind, ty, mask, grid.whole().voxels(), 20, seed as u64))
}

/// Packing a file anew changes no sample, no statistics and no lost block.
#[test]
fn golden_files_are_repacked_with_the_same_samples() {
    let work = tempfile::tempdir().unwrap();
    for (name, digest) in digests() {
        let (old, mut bytes) = (open(&folder().join(format!("{name}.wspl"))), Vec::new());
        let report = repack(&old, 3, MEMORY, Path::new("new.wspl"), &mut bytes, &Silent).unwrap();
        assert_eq!((report.output_bytes, report.frames), (bytes.len() as u64, old.frames() as u64), "{name}");
        let path = work.path().join(format!("{name}.wspl"));
        fs::write(&path, &bytes).unwrap();
        let new = open(&path);
        let has_pyramid = new.metadata().windows.iter().any(|window| window.pyramid.is_some());
        assert_eq!(new.metadata().features().packing == Packing::Nested, has_pyramid, "{name}");
        assert_eq!(totals(&new), totals(&old), "{name}");
        assert_eq!(verify(&new, None, MEMORY, &Silent).unwrap().damaged, u64::from(name == "lost"), "{name}");
        let new = if name == "lost" { new.skip_damaged().unwrap() } else { new };
        assert_eq!(xxh3_64(&extracted(&new)), digest, "{name}");
    }
}

/// Of each window what does not depend on packing.
fn totals(file: &CoefficientFile) -> Vec<(u64, [f64; 6], [u64; 4])> {
    let of_window = |w: &Window| {
        let reals = [w.delta, w.reached, w.share, w.squared_error, w.min, w.max];
        (w.digest, reals, [w.missing, w.coded, w.outliers, w.frames.into()])
    };
    file.metadata().windows.iter().map(of_window).collect()
}

/// Ids of older files follow from another rule; what continues such a file keeps its id and its windows.
#[test]
fn golden_files_are_continued_under_their_own_id() {
    for (seed, (name, ty, kind, mask, config)) in features().into_iter().enumerate() {
        let config = ConvertConfig { block: config.block.or(Some(6)), ..config };
        let golden = fs::read(folder().join(format!("{name}.wspl"))).unwrap();
        let unfinished = CompletePrefix::read(&&golden[..golden.len() * 2 / 3]).unwrap();
        let (id, windows) = (unfinished.id(), unfinished.metadata().windows.clone());
        let kept = golden[..unfinished.bytes() as usize].to_vec();
        assert!(!windows.is_empty(), "{name}: whole windows are left");
        let resume_from = Some(ResumePoint { complete: unfinished, first_window: windows.len(), description: None });
        let mut bytes = kept.clone();
        let target = Target { name: Path::new("a.wspl"), out: &mut bytes, resume_from };
        convert_into(&mut source(seed, (ty, kind, mask)), &config, target, &Silent).unwrap();
        let work = tempfile::tempdir().unwrap();
        let path = work.path().join("continued.wspl");
        fs::write(&path, &bytes).unwrap();
        let file = open(&path);
        assert_eq!((file.id(), &bytes[..kept.len()]), (id, &kept[..]), "{name}");
        assert_eq!(file.metadata().windows[..windows.len()], windows, "{name}");
        assert_eq!(verify(&file, None, MEMORY, &Silent).unwrap().damaged, 0, "{name}");
        assert_eq!(file.frames(), windows.iter().map(|w| w.frames as usize).sum::<usize>() + 20, "{name}");
    }
}

#[test]
fn a_file_id_follows_from_the_encoded_start_and_the_first_digest() {
    let (_, ty, kind, mask, config) = features().swap_remove(0);
    let file = stored(&mut source(0, (ty, kind, mask)), &config).open();
    let mut bytes = file.metadata().start().encode().unwrap();
    bytes.extend(file.metadata().windows[0].digest.to_le_bytes());
    assert_eq!(file.id().0, xxhash_rust::xxh3::xxh3_128(&bytes).to_le_bytes());
}

/// Writes the missing golden files, and changes no others.
#[test]
#[ignore = "writes golden files of new features"]
fn golden_files_are_made() {
    for (seed, (name, ty, kind, mask, config)) in features().into_iter().enumerate() {
        let config = ConvertConfig { block: config.block.or(Some(6)), ..config };
        keep(&name, &stored(&mut source(seed, (ty, kind, mask)), &config).bytes());
    }
    let mut damaged = fs::read(folder().join("haar-u8.wspl")).unwrap();
    let place = damaged.windows(4).position(|bytes| bytes == b"BLCK").unwrap();
    damaged[place + 30] ^= 1;
    let leaf = damaged.windows(4).position(|bytes| bytes == b"LEAF").unwrap();
    damaged[leaf + 30] ^= 1;
    let work = tempfile::tempdir().unwrap();
    let path = work.path().join("damaged.wspl");
    fs::write(&path, damaged).unwrap();
    let mut saved = Vec::new();
    recover(&FileBytes::open(&path, Access::Read).unwrap(), &path, &mut saved, [&Silent, &Silent]).unwrap();
    keep("lost", &saved);
}

fn keep(name: &str, bytes: &[u8]) {
    let path = folder().join(format!("{name}.wspl"));
    if path.exists() {
        return;
    }
    fs::write(&path, bytes).unwrap();
    let digest = xxh3_64(&extracted(&open(&path).skip_damaged().unwrap()));
    let list = folder().join("digests.txt");
    let before = fs::read_to_string(&list).unwrap_or_default();
    fs::write(list, format!("{before}{name} {digest:016x}\n")).unwrap();
}

#[test]
fn features_of_later_versions_are_refused_by_name() {
    let mut file = fs::read(folder().join("haar-u8.wspl")).unwrap();
    let work = tempfile::tempdir().unwrap();
    let refused = |file: &mut [u8]| {
        let checksum = xxh3_64(&file[..120]).to_le_bytes();
        file[120..128].copy_from_slice(&checksum);
        let path = work.path().join("later.wspl");
        fs::write(&path, file).unwrap();
        CoefficientFile::open_with(&path, Access::Read).err().map(|e| (e.exit_code(), e.to_string()))
    };
    file[10] = 7; // the minor version
    file[24] = 0xFF; // optional features
    assert_eq!(refused(&mut file), None);
    file[16] = 0b100_0000; // a required feature
    file[48..48 + 20].copy_from_slice(b"bases by wavesplat 3");
    let (code, message) = refused(&mut file).unwrap();
    assert!(code == 3 && message.contains("required feature bit 6 (bases by wavesplat 3)"), "{message}");
    file[16] = 0;
    file[8] = 2;
    let (code, message) = refused(&mut file).unwrap();
    assert!(code == 3 && message.contains("version 2.7 (bases by wavesplat 3)"), "{message}");
}
