//! Memory stays within the budget: archives of twenty times its size, under a limit of the system.
#![cfg(target_os = "linux")]

use super::{Work, all_but_options};
use crate::common::random::Random;
use std::fs::File;
use std::os::unix::fs::FileExt;

/// Memory that the programs may take in addition to `--memory`: code, stacks and the allocator's overhead.
pub(super) const SLACK_MIB: usize = 40;

/// A sparse archive with some structure in every frame.
fn write_sparse(work: &Work, name: &str, [nx, ny, nz, nt]: [usize; 4]) {
    let file = File::create(work.path(name)).unwrap();
    file.set_len((4 * nx * ny * nz * nt) as u64).unwrap();
    let slab: Vec<u8> = (0..nx * ny * 4).flat_map(|i| (2.0 + (i as f32 * 0.001).sin()).to_le_bytes()).collect();
    for t in 0..nt {
        let z = (3 * t) % (nz - 4);
        file.write_all_at(&slab, (4 * (t * nz + z) * nx * ny) as u64).unwrap();
    }
}

#[test]
fn archives_much_larger_than_the_budget_stay_within_it() {
    let work = Work::new();
    work.write("tiny.raw", [0; 32 * 16 * 16 * 2 * 4]);
    let tiny = "tiny.raw --dims 32x16x16x2 --dtype f32"; // two blocks, and one above them
    let ask = work.wavesplat(&format!("convert {tiny} -o t.wspl --block 16 --threads 2 --memory 1MiB"));
    let memory = ask.fails(2, &["--memory"]).mebibytes();
    let frame_mib = (20 * memory).div_ceil(32);
    let dims = [128, 128, 16 * frame_mib, 32]; // f32
    write_sparse(&work, "big.raw", dims);
    let limit = format!("ulimit -d {};", (memory + SLACK_MIB) << 10);
    let [x, y, z, t] = dims;
    let options = "--dtype f32 --block 16 --threads 2 --level 1";
    let files =
        format!("$WAVESPLAT convert big.raw --dims {x}x{y}x{z}x{t} {options} --memory {memory}MiB -o file.wspl");
    work.shell(&format!("{limit} exec {files}")).ok();
    let pipe = format!("$WAVESPLAT convert - --dims {x}x{y}x{z} {options} -o pipe.wspl");
    let memory = work.shell(&format!("exec {pipe} --memory {memory}MiB < big.raw")).fails(2, &["--memory"]).mebibytes(); // a pipe needs part of the budget
    let limit = format!("ulimit -d {};", (memory + SLACK_MIB) << 10);
    work.shell(&format!("{limit} exec {pipe} --memory {memory}MiB < big.raw")).ok();
    assert_eq!(all_but_options(&work, "file.wspl"), all_but_options(&work, "pipe.wspl")); // their --dims differ
    let ask =
        work.render("file.wspl --size 96x96 --frames 0,31 --threads 2 -o v.npy --memory 1MiB").fails(2, &["--memory"]);
    let memory = memory.max(ask.mebibytes());
    let limit = format!("ulimit -d {};", (memory + SLACK_MIB) << 10);
    let common = format!("--threads 2 --memory {memory}MiB");
    work.shell(&format!("{limit} exec $RENDER file.wspl --size 96x96 --frames 0,31 -o v.npy {common}")).ok();
    work.shell(&format!("{limit} exec $WAVESPLAT extract file.wspl --frames 5 -o e.raw {common}")).ok();
    work.shell(&format!("{limit} exec $WAVESPLAT verify file.wspl {common}")).ok();
    assert_eq!(work.read("e.raw").len(), 4 * x * y * z);
}

/// An archive of noise in 80^3 voxels and 16 frames: every code takes its place.
fn write_noise(work: &Work, name: &str) {
    let mut random = Random(1);
    let samples = (0..80 * 80 * 80 * 16).flat_map(|_| (random.unit() as f32).to_le_bytes());
    work.write(name, samples.collect::<Vec<u8>>());
}

/// Renders within the planned memory, and returns the share of it that was used.
fn used_share(work: &Work, command: &str) -> f64 {
    let report = work.render(&format!("{command} --json")).ok().json();
    let [planned, peak] = ["planned_bytes", "peak_bytes"].map(|key| report[key].as_u64().unwrap() as usize >> 20);
    assert!(planned <= 512 && peak <= planned + SLACK_MIB, "{command}: {peak} of {planned}");
    let limit = format!("ulimit -d {};", (planned + SLACK_MIB) << 10);
    work.shell(&format!("{limit} exec $RENDER {command}")).ok();
    peak as f64 / planned as f64
}

#[test]
fn pictures_take_what_they_plan() {
    let work = Work::new();
    write_sparse(&work, "a.raw", [128, 128, 128, 32]);
    work.wavesplat("convert a.raw --dims 128x128x128x32 --dtype f32 --level 1 -o a.wspl").ok();
    for options in ["", "--tolerance 0.1", "--frames 3,4,9", "--error-image e.npy"] {
        used_share(&work, &format!("a.wspl --threads 2 -o v.npy --force {options}"));
    }
    write_noise(&work, "n.raw");
    work.wavesplat("convert n.raw --dims 80x80x80x16 --dtype f32 --level 1 -o n.wspl").ok();
    // A plan is an upper bound for any data, and takes all blocks as large as the largest. That of footprints counts vectors
    // that grow.
    for (options, least) in [
        ("", 0.5),
        ("--splat-error 1e-5", 0.6),
        ("--splat-error 0", 0.2),
        ("--mode composite", 0.6),
        ("--mode composite --error-image e.npy", 0.4),
        ("--mode iso --iso 0.5 --error-image e.npy --frames 0:8 --size 300x300", 0.4),
        ("--mode mip", 0.6),
        ("--mode iso --iso 0.5", 0.6),
        ("--mode slice --slice z=0.5", 0.5),
    ] {
        let share = used_share(&work, &format!("n.wspl --threads 2 -o v.npy --force {options}"));
        assert!(share >= least, "{options}: {share}");
    }
}

/// Waves with a few single samples that stand out, in 96^3 voxels and 16 frames.
fn write_waves(work: &Work, name: &str) {
    let mut random = Random(3);
    let mut sample = |t: usize, [x, y, z]: [usize; 3]| {
        let [x, y, z, t] = [x, y, z, t].map(|n| n as f64);
        let wave = (0.21 * x + 0.3 * t).sin() * (0.17 * y).cos() + (0.13 * z).sin();
        (wave + if random.unit() < 0.002 { 0.3 } else { 0.0 }) as f32
    };
    let mut bytes = Vec::new();
    for (t, z, y) in (0..16).flat_map(|t| (0..96).flat_map(move |z| (0..96).map(move |y| (t, z, y)))) {
        (0..96).for_each(|x| bytes.extend(sample(t, [x, y, z]).to_le_bytes()));
    }
    work.write(name, bytes);
}

#[test]
fn a_plan_knows_how_much_single_blocks_store() {
    let work = Work::new();
    write_waves(&work, "w.raw");
    work.wavesplat("convert w.raw --dims 96x96x96x16 --dtype f32 --block 16 --tolerance 1e-2 -o w.wspl").ok();
    let settings = "--size 96x96 --mode composite --opacity 0:0,1:0.3 --range=-2,2 --threads 2 --memory 24MiB";
    let report = work.render(&format!("w.wspl {settings} -o v.npy --json")).ok().json();
    let read = report["blocks_read"].as_u64().unwrap();
    assert!(read <= 2 * 216, "{read} blocks: no more than two batches of frames");
}

#[test]
fn verifying_and_rewriting_keep_their_budget_or_refuse_it() {
    let work = Work::new();
    for (ty, size, options) in [("f32", 4, ""), ("u8", 1, ""), ("f32", 4, "--transfer-function rainbow --range 0,3")] {
        let bytes: Vec<u8> =
            (0..64 * 64 * 48 * 32 * size).map(|i| if i % 4 < 3 { (i % 251) as u8 } else { 63 }).collect();
        work.write("a.raw", bytes);
        let input = format!("a.raw --dims 64x64x48x32 --dtype {ty}");
        work.wavesplat(&format!("convert {input} -o a.wspl --force --level 1 {options}")).ok();
        for line in ["verify a.wspl --against a.raw", "verify a.wspl", "convert a.wspl -o b.wspl --force"] {
            let memory = work.wavesplat(&format!("{line} --memory 1MiB")).fails(2, &["--memory"]).mebibytes();
            assert!((20..400).contains(&memory), "{line}: {memory}");
            let limit = format!("ulimit -d {};", (memory + SLACK_MIB) << 10);
            work.shell(&format!("{limit} exec $WAVESPLAT {line} --threads 2 --memory {memory}MiB")).ok();
            work.wavesplat(&format!("{line} --memory {}MiB", memory - 1)).fails(2, &["--memory"]);
        }
    }
}
