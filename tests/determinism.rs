//! The same input gives the same bytes and pixels for any number of threads and any memory budget.

use crate::common::memory::Memory;
use crate::common::series::{Kind, Mask, volume};
use crate::common::views::view;
use crate::common::{BASES, direct, extracted, looking, pictures, settings, stored};
use crate::frame_pictures::bits;
use std::path::Path;
use std::process::Command;
use wavesplat::base::grid::Grid;
use wavesplat::base::progress::Silent;
use wavesplat::base::sample::SampleType;
use wavesplat::convert::{Basis, Bound, ConvertConfig, convert};
use wavesplat::render::{CoefficientScene, Quantity, RenderConfig, SplatSource};
use xxhash_rust::xxh3::xxh3_64;

const GRID: Grid = Grid { dims: [40, 33, 20], spacing: [1.0; 3], origin: [0.0; 3] };

fn memory(mask: Mask) -> Memory {
    Memory::new(GRID, SampleType::F32, volume(Kind::Wave, SampleType::F32, mask, GRID.whole().voxels(), 20, 4))
}

fn config(basis: Basis) -> ConvertConfig {
    let window = if basis == Basis::Haar { 16 } else { 9 };
    ConvertConfig { block: Some(8), ..settings(basis, window, 0.01) }
}

fn under<T: Send>(threads: usize, work: impl FnOnce() -> T + Send) -> T {
    rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap().install(work)
}

#[test]
fn threads_change_no_byte_and_no_pixel() {
    let masks = [Mask::None, Mask::Special, Mask::None, Mask::Special];
    for (basis, mask) in BASES.into_iter().zip(masks) {
        let run = |threads| {
            under(threads, || {
                let memory = memory(mask);
                let file = stored(&mut memory.clone(), &config(basis));
                let look = looking(view(30.0, 20.0, [140, 90]), 0.01, Quantity::Mean, &GRID, 20);
                let (a, _) = pictures(&mut direct(&memory, None), &look);
                let (b, _) = pictures(&mut CoefficientScene::new(file.open(), SplatSource::Coefficients), &look);
                (file.bytes(), extracted(&file.open()), bits(&a), bits(&b))
            })
        };
        let one = run(1);
        assert!([2, 5].into_iter().all(|n| run(n) == one), "{basis:?}");
    }
}

/// Digests of files, samples and pictures of every scheme. They are the same with every kind of vector units
/// and on every machine. They change when the content of files changes (which includes the versions of the program and of
/// zstd) or when splatting changes, and must then be updated.
#[test]
fn files_and_pictures_are_the_same_on_every_machine() {
    let sample = |i: usize| {
        let [x, y, z, t] = [i % 40, i / 40 % 33, i / 1320 % 20, i / 26_400].map(|n| n as f32);
        let square = |a: f32, b: f32| (a - b) * (a - b);
        let blob = 3.0 / (1.0 + 0.05 * (square(x, 2.0 * t) + square(y, 20.0 - t) + square(z, 9.0)));
        if z < 4.0 { 0.0 } else { blob + 0.25 / (1.0 + t + x) }
    };
    let samples = (0..20 * 26_400).flat_map(|i| sample(i).to_le_bytes()).collect();
    let memory = Memory::new(GRID, SampleType::F32, samples);
    let look = looking(view(30.0, 20.0, [70, 60]), 0.01, Quantity::Mean, &GRID, 20);
    let look = RenderConfig { splat_error: 1e-3, ..look };
    let digest = |pictures: Vec<f32>| xxh3_64(&pictures.iter().flat_map(|v| v.to_le_bytes()).collect::<Vec<u8>>());
    let mut found = vec![digest(pictures(&mut direct(&memory, None), &look).0)];
    for basis in BASES {
        let file = stored(&mut memory.clone(), &config(basis));
        let (of_file, _) = pictures(&mut CoefficientScene::new(file.open(), SplatSource::Coefficients), &look);
        found.extend([xxh3_64(&file.bytes()), xxh3_64(&extracted(&file.open())), digest(of_file)]);
    }
    assert_eq!(found, DIGESTS);
}

/// Runs the test before in another process, since a process keeps the vector units that it began with.
#[test]
fn files_and_pictures_are_the_same_with_the_vector_units_of_every_processor() {
    let mut tests = Command::new(std::env::current_exe().unwrap());
    tests.args(["--exact", "determinism::files_and_pictures_are_the_same_on_every_machine"]);
    let run = tests.env("WAVESPLAT_VECTOR_UNITS", "baseline").output().unwrap();
    let said = String::from_utf8_lossy(&run.stdout);
    assert!(run.status.success() && said.contains("1 passed"), "{said}");
}

/// Digests of the frames, then for each basis of its file, samples and pictures.
#[rustfmt::skip]
const DIGESTS: [u64; 13] = [
    0xb894_e013_7457_757a,
    0x0fcd_9710_a99e_e847,
    0x615f_7d18_e1af_2c92,
    0x8643_224e_c716_5cb8,
    0x1018_4458_5459_b2e1,
    0x6cbe_7967_a535_9214,
    0x3f78_dddd_80ef_54db,
    0x8f78_1f4b_e9d2_506e,
    0x41a3_eda1_42a1_b847,
    0x8d19_460f_0d65_5590,
    0xc3ab_b657_a03a_2d37,
    0x3e78_d1f7_e6a5_bbcc,
    0xcc87_3e79_4a4f_213f,
];

#[test]
fn memory_changes_no_byte_of_a_file() {
    let source = memory(Mask::Special);
    let mut files = Vec::new();
    for bound in [Bound::Pointwise, Bound::Relative { floor: 0.01 }, Bound::Sampled { samples: 30, seed: 0 }] {
        files.clear();
        for mib in [15, 16, 20, 40, 300] {
            let config = ConvertConfig { bound, memory: mib << 20, ..config(Basis::Haar) };
            let mut bytes = Vec::new();
            let done = convert(&mut source.clone(), &config, Path::new("a.wspl"), &mut bytes, &Silent);
            files.extend(done.is_ok().then_some(bytes));
        }
        assert!(files.len() >= 4, "{} budgets suffice", files.len());
        assert!(files.iter().all(|f| *f == files[0]), "{bound:?}");
    }
}

/// The stages of a conversion run in the program's own thread pool, which only the program can size.
#[test]
fn the_program_writes_the_same_bytes_with_any_number_of_threads() {
    let folder = tempfile::tempdir().unwrap();
    let frames = folder.path().join("frames.raw");
    std::fs::write(&frames, memory(Mask::None).frames.as_slice()).unwrap();
    let run = |bound: &str, threads: &str| {
        let out = folder.path().join(format!("{bound}{threads}.wspl"));
        let mut command = Command::new(env!("CARGO_BIN_EXE_wavesplat"));
        command.arg("convert").arg(&frames).args(["--dims", "40x33x20x20", "--dtype", "f32", "--threads", threads]);
        let done = command.args(["--bound", bound, "-o"]).arg(&out).output().unwrap();
        assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
        std::fs::read(out).unwrap()
    };
    for bound in ["pointwise", "relative", "sampled"] {
        let one = run(bound, "1");
        assert!(["2", "4", "5"].into_iter().all(|n| run(bound, n) == one), "{bound}");
    }
}
