//! The settings of a run, and their defaults.

use crate::bench::size::Peers;
use crate::synth::Kind;
use std::path::PathBuf;

/// What archives show unless the user says.
pub const KINDS: [Kind; 3] = [Kind::Smooth, Kind::Moving, Kind::Sparse];

/// The sizes of archives and pictures.
#[derive(Debug)]
pub struct Sizes {
    /// Archives.
    pub dims: &'static [[usize; 4]],
    /// Archives for measuring the memory of a conversion.
    pub large: [[usize; 4]; 2],
    /// Pixels a side of a picture.
    pub size: usize,
    /// Rounds.
    pub repeats: usize,
}

/// The sizes that the targets refer to. Large archives have 4 and 20 GiB.
pub const USUAL: Sizes = Sizes {
    dims: &[[128, 128, 128, 32], [256, 256, 256, 32], [128, 128, 128, 64]],
    large: [[256, 256, 256, 64], [256, 256, 256, 320]],
    size: 512,
    repeats: 3,
};
/// Small sizes, to check in seconds that everything works.
pub const SMALL: Sizes =
    Sizes { dims: &[[20, 18, 16, 8]], large: [[48, 48, 48, 32], [48, 48, 48, 64]], size: 64, repeats: 1 };

/// What to measure, with what, and where results go.
#[derive(Debug, Clone)]
pub struct Config {
    /// Archives of the user.
    pub inputs: Vec<PathBuf>,
    /// Kinds of synthetic archives to make.
    pub kinds: Vec<Kind>,
    /// Their sizes.
    pub dims: Vec<[usize; 4]>,
    /// Pixels from a voxel to the next.
    pub spacings: Vec<f64>,
    /// Pixels a side of a picture.
    pub size: usize,
    /// Tolerances as shares of the value range; the targets apply to the first.
    pub tolerances: Vec<f64>,
    /// Numbers of threads.
    pub threads: Vec<usize>,
    /// Rounds through all measurements.
    pub repeats: usize,
    /// Sizes of the archives for measuring the memory of a conversion; empty to skip this.
    pub large: Vec<[usize; 4]>,
    /// Other programs.
    pub peers: Option<Peers>,
    /// The folder of results.
    pub output: PathBuf,
    /// The path of `wavesplat-tools`, which measures with its command `bench-step`.
    pub program: PathBuf,
    /// The day to write into the results; by default that of the clock.
    pub date: Option<String>,
}
