//! One measurement in a process of its own.

use super::cold;
use super::convert::{self, Conversion};
use super::decode;
use super::measured::{Measured, Stopwatch};
use super::view::{self, View};
use crate::bench::process::ProcessTask;
use crate::bench::size::clock::{stay_on_one_core, work_with};
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};
use wavesplat::base::error::{Error, Result};
use wavesplat::base::mapped::{Access, FileBytes};

/// The task of a process, and its number of threads.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(in crate::bench) struct Task {
    pub(super) threads: usize,
    pub(super) work: Work,
}

#[derive(Debug, Clone, Serialize, Deserialize)]
pub(super) enum Work {
    /// Frames to a file.
    Convert(Conversion),
    /// The same, with memory sampled every few milliseconds.
    Heap(Conversion),
    /// A file from its first byte to its last.
    Read(PathBuf),
    /// All blocks of a file to codes.
    Codes(PathBuf),
    /// All parts of a file out of zstd, and no further.
    Payloads(PathBuf),
    /// All pictures of a view.
    View(View),
    /// How far pictures are from the first view's.
    Compare(View, Vec<View>),
}

impl ProcessTask for Task {
    const NAME: &'static str = "speed";
    type Measured = Measured;

    fn measure(&self) -> Result<Measured> {
        measure(self)
    }
}

/// Measures in this process.
fn measure(task: &Task) -> Result<Measured> {
    match task.threads {
        1 => stay_on_one_core(),
        more => work_with(more),
    }
    match &task.work {
        Work::Convert(conversion) => convert::run(conversion),
        Work::Heap(conversion) => cold::with_peak_heap(|| convert::run(conversion)),
        Work::Read(path) => read(path),
        Work::Codes(path) => twice(|| decode::codes(path)),
        Work::Payloads(path) => twice(|| decode::payloads(path)),
        Work::View(view) => view::measure(view),
        Work::Compare(truth, others) => view::compare(truth, others),
    }
}

/// The lesser time of two, and the bytes that `work` says.
fn twice(work: impl Fn() -> Result<u64>) -> Result<Measured> {
    let ((bytes, first), (_, second)) = (Stopwatch::time(&work)?, Stopwatch::time(&work)?);
    Ok(Measured { time: first.least(second), bytes, ..Measured::default() })
}

/// Bytes that are copied at a time, few enough to stay in the cache.
const PIECE: usize = 256 << 10;

/// Every byte of a new map, copied out in order.
fn read(path: &Path) -> Result<Measured> {
    twice(|| {
        let (file, mut piece) = (FileBytes::open(path, Access::Map)?, vec![0; PIECE]);
        for start in (0..file.len()).step_by(PIECE) {
            let len = PIECE.min((file.len() - start) as usize);
            file.read_at(start, &mut piece[..len]).map_err(|e| Error::io(path, "reading", e))?;
            std::hint::black_box(&piece);
        }
        Ok(file.len())
    })
}
