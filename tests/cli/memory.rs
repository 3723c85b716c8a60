//! `--memory` is a promise: programs run under a hard limit of the system on what they allocate.

use super::{Bench, program_path};
use std::fs::File;
use std::io::{BufWriter, Write};
use std::process::Command;

/// Bytes of the budget, and what a process takes beside it: stacks, the allocator's slack, the program's own data.
const MEMORY_MIB: usize = 24;
const BESIDE_MIB: usize = 24;

/// Runs a command line in which PROGRAMS stand for paths, with the size of the data segment limited.
fn limited(b: &Bench, line: &str) {
    let [wavesplat, render] = ["wavesplat", "wavesplat-render"].map(|p| program_path(p).to_str().unwrap());
    let line = line.replace("RENDER", render).replace("WAVESPLAT", wavesplat);
    let kib = (MEMORY_MIB + BESIDE_MIB) * 1024;
    let script = format!("set -e; ulimit -d {kib}; {line}");
    let output = Command::new("bash").args(["-c", &script]).current_dir(b.path("")).output().unwrap();
    assert!(output.status.success(), "{line}: {}", String::from_utf8_lossy(&output.stderr));
}

#[test]
fn an_archive_twenty_times_the_budget_stays_within_it() {
    let b = Bench::new(0);
    let mut out = BufWriter::new(File::create(b.path("all.raw")).unwrap());
    let [nx, ny, nz] = [64, 64, 32];
    let frames = ((20 * MEMORY_MIB) << 20) / (nx * ny * nz * 4);
    for t in 0..frames {
        let value = |i: usize| ((i / nx % ny + t / 2) % 251) as f32;
        let frame: Vec<u8> = (0..nx * ny * nz).flat_map(|i| value(i).to_le_bytes()).collect();
        out.write_all(&frame).unwrap();
    }
    drop(out);
    let options = format!("--threads 2 --memory {MEMORY_MIB}MiB");
    limited(
        &b,
        &format!("WAVESPLAT convert all.raw --dtype f32 --dims {nx}x{ny}x{nz}x{frames} -o a.wspl --block 16 {options}"),
    );
    limited(
        &b,
        &format!("cat all.raw | WAVESPLAT convert - --dtype f32 --dims {nx}x{ny}x{nz} -o p.wspl --block 16 {options}"),
    );
    assert_eq!(b.bytes("a.wspl"), b.bytes("p.wspl"));
    limited(&b, &format!("RENDER a.wspl -o a.npy --size 100x100 --frames 0:200:3 {options}"));
    limited(&b, &format!("WAVESPLAT extract a.wspl -o a.raw --frames 0:{frames}:7 {options}"));
    limited(&b, &format!("WAVESPLAT verify a.wspl {options}"));
}
