//! The programs as programs: what a user types, and what comes of it.

mod errors;
mod memory;
mod pipes;
mod runs;

use assert_cmd::Command;
use std::fs;
use std::path::{Path, PathBuf};
use tempfile::TempDir;
use wavesplat::npy;
use wavesplat::sample::SampleType;

pub(crate) const DIMS: [usize; 3] = [11, 9, 7];

/// A fresh folder with `frames` frames of a smooth moving wave in `frames/frame_0000.npy` and so on.
pub(crate) struct Bench {
    folder: TempDir,
}

/// What a program said.
pub(crate) struct Said {
    pub(crate) code: i32,
    pub(crate) out: Vec<u8>,
    pub(crate) err: String,
}

impl Bench {
    pub(crate) fn new(frames: usize) -> Self {
        let bench = Self { folder: TempDir::new().unwrap() };
        fs::create_dir(bench.path("frames")).unwrap();
        for t in 0..frames {
            bench.write_npy(&format!("frames/frame_{t:04}.npy"), &[DIMS[2], DIMS[1], DIMS[0]], &frame(t));
        }
        bench
    }

    pub(crate) fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    pub(crate) fn write_npy(&self, name: &str, shape: &[usize], values: &[f32]) {
        let mut bytes = Vec::new();
        npy::write_header(SampleType::F32, shape, &mut bytes).unwrap();
        bytes.extend(values.iter().flat_map(|v| v.to_le_bytes()));
        fs::write(self.path(name), bytes).unwrap();
    }

    /// Runs `program` with arguments split at spaces, in the folder.
    pub(crate) fn run(&self, program: &str, args: &str) -> Said {
        self.run_with(program, args, Vec::new())
    }

    pub(crate) fn run_with(&self, program: &str, args: &str, input: Vec<u8>) -> Said {
        let output =
            command(program).current_dir(self.folder.path()).args(args.split(' ')).write_stdin(input).output().unwrap();
        let err = String::from_utf8(output.stderr).unwrap();
        assert!(!err.contains("panicked"), "{args}: {err}");
        Said { code: output.status.code().expect("an exit code, not a signal"), out: output.stdout, err }
    }

    /// Runs a program that must succeed.
    pub(crate) fn done(&self, program: &str, args: &str) -> Said {
        let said = self.run(program, args);
        assert_eq!(said.code, 0, "{program} {args}: {}", said.err);
        said
    }

    pub(crate) fn bytes(&self, name: &str) -> Vec<u8> {
        fs::read(self.path(name)).unwrap()
    }

    /// The f32 payload and the shape of an `.npy`.
    pub(crate) fn array(&self, name: &str) -> (Vec<u64>, Vec<f32>) {
        let bytes = self.bytes(name);
        let file = npyz::NpyFile::new(bytes.as_slice()).unwrap();
        (file.shape().to_vec(), file.into_vec().unwrap())
    }

    /// The names in the folder.
    pub(crate) fn names(&self) -> Vec<String> {
        let mut names: Vec<String> =
            fs::read_dir(self.folder.path()).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
        names.sort();
        names
    }
}

pub(crate) fn command(program: &str) -> Command {
    Command::new(program_path(program))
}

pub(crate) fn program_path(program: &str) -> &'static Path {
    Path::new(match program {
        "wavesplat" => env!("CARGO_BIN_EXE_wavesplat"),
        _ => env!("CARGO_BIN_EXE_wavesplat-render"),
    })
}

/// One frame of the wave.
pub(crate) fn frame(t: usize) -> Vec<f32> {
    let [nx, ny, nz] = DIMS;
    let value = |i: usize| {
        let [x, y, z] = [i % nx, i / nx % ny, i / (nx * ny)].map(|n| n as f64);
        ((x * 0.5 + y * 0.3 - z * 0.2 + t as f64 * 0.17).sin() * (1.0 + 0.02 * t as f64)) as f32
    };
    (0..nx * ny * nz).map(value).collect()
}

/// All frames as little-endian bytes.
pub(crate) fn raw(frames: usize) -> Vec<u8> {
    (0..frames).flat_map(frame).flat_map(f32::to_le_bytes).collect()
}

/// The largest difference; infinite where only one is NaN.
pub(crate) fn largest_difference(a: &[f32], b: &[f32]) -> f64 {
    assert_eq!(a.len(), b.len());
    let difference = |(a, b): (&f32, &f32)| match (a.is_nan(), b.is_nan()) {
        (true, true) => 0.0,
        (false, false) => (f64::from(*a) - f64::from(*b)).abs(),
        _ => f64::INFINITY,
    };
    a.iter().zip(b).map(difference).fold(0.0, f64::max)
}
