//! Reads partial sums. Every number is checked before memory is taken for what it counts.

use super::head::{Head, PictureRecord, RecordSpan, SCHEMA};
use super::{END, MAGIC};
use std::io::{self, Read};
use std::path::{Path, PathBuf};
use wavesplat_core::base::address::refuse_address;
use wavesplat_core::base::error::{Error, Result};
use wavesplat_core::base::files;
use wavesplat_core::base::system::FileExt;
use xxhash_rust::xxh3::xxh3_64;

/// The most bytes of a head, unpacked.
const MOST_HEAD: u64 = 256 << 20;

/// Memory of a head in units of its bytes, about.
const HEAD_SHARE: u64 = 4;

/// A file of partial sums.
#[derive(Debug)]
pub struct PartialFile {
    path: PathBuf,
    /// Its settings, sources and records.
    pub head: Head,
    /// Bytes of its head, unpacked.
    pub(super) head_bytes: usize,
}

/// Whether a file begins as one of partial sums.
pub fn is_partial(path: &Path) -> bool {
    let mut start = [0; MAGIC.len()];
    files::open(path).is_ok_and(|mut file| file.read_exact(&mut start).is_ok()) && start == MAGIC
}

impl PartialFile {
    /// Opens a file, and reads its head within `memory` bytes.
    ///
    /// # Errors
    /// A file that cannot be read, holds no partial sums, is damaged, or contradicts itself.
    pub fn open(path: &Path, memory: usize) -> Result<Self> {
        refuse_address(path)?;
        let doing = |e| Error::io(path, "reading", e);
        let length = std::fs::metadata(path).map_err(doing)?;
        if !length.is_file() {
            return Err(Error::path(path, "is no file: parts are read from their end"));
        }
        let length = length.len();
        if !is_partial(path) || length < (MAGIC.len() + END) as u64 {
            return Err(Error::input(path, "is no part of a picture, or has lost its beginning"));
        }
        let end = read_at(path, length - END as u64, END)?;
        let number = |n: usize| u64::from_le_bytes(std::array::from_fn(|i| end[8 * n + i]));
        let [offset, packed, bytes, checksum] = [0, 1, 2, 3].map(number);
        if end[32..] != MAGIC || offset.checked_add(packed) != Some(length - END as u64) {
            return Err(damaged(path, "it has lost its end"));
        }
        if bytes > MOST_HEAD || packed > MOST_HEAD || (bytes + packed).saturating_mul(HEAD_SHARE) > memory as u64 {
            return Err(Error::input(path, format!("its head of {bytes} bytes does not fit in memory")));
        }
        let json = unpacked(path, RecordSpan { offset, bytes: packed, checksum }, bytes as usize)?;
        let version = |v: &serde_json::Value| v.get("schema").and_then(serde_json::Value::as_u64);
        let head = serde_json::from_slice::<Head>(&json).map_err(|e| {
            let newer = serde_json::from_slice(&json).ok().as_ref().and_then(version);
            let newer = newer.filter(|schema| *schema > u64::from(SCHEMA));
            newer.map_or_else(
                || damaged(path, &format!("its head is none: {e}")),
                |schema| Error::input(path, format!("is a part of version {schema}, newer than this program")),
            )
        })?;
        if head.schema != SCHEMA {
            return Err(Error::input(path, format!("is a part of version {}, which is not known", head.schema)));
        }
        head.check(offset).map_err(|what| damaged(path, &format!("it {what}")))?;
        Ok(Self { path: path.into(), head, head_bytes: json.len() })
    }

    /// The name for messages.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Adds the weights of a view to sums.
    pub(super) fn add_weights(&self, view: usize, sums: &mut [f64]) -> Result<()> {
        let record = self.head.weights.iter().find(|record| record.view == view);
        let record = record.ok_or_else(|| damaged(&self.path, &format!("it has no weights of view {view}")))?;
        self.add(record.place, 1, &mut [sums])
    }

    /// Adds the sums of a picture to planes in the order of a record. `missing` says whether these have missing weights.
    pub(super) fn add_picture(&self, record: &PictureRecord, planes: &mut [Vec<f64>], missing: bool) -> Result<()> {
        let step = if missing && !record.missing { 2 } else { 1 };
        let mut own: Vec<&mut [f64]> = planes.iter_mut().step_by(step).map(Vec::as_mut_slice).collect();
        self.add(record.place, self.head.look.planes(record.missing), &mut own)
    }

    fn add(&self, span: RecordSpan, planes: usize, sums: &mut [&mut [f64]]) -> Result<()> {
        let pixels = self.head.look.pixels();
        let bytes = unpacked(&self.path, span, planes * pixels * size_of::<f64>())?;
        for (plane, sums) in bytes.chunks_exact(pixels * size_of::<f64>()).zip(sums) {
            let numbers = plane.as_chunks().0.iter().map(|bytes| f64::from_le_bytes(*bytes));
            sums.iter_mut().zip(numbers).for_each(|(sum, number)| *sum += number);
        }
        Ok(())
    }
}

/// The bytes of a record.
fn unpacked(path: &Path, span: RecordSpan, bytes: usize) -> Result<Vec<u8>> {
    let RecordSpan { offset, bytes: packed, checksum } = span;
    if packed > zstd::zstd_safe::compress_bound(bytes) as u64 {
        return Err(damaged(path, &format!("the record at byte {offset} is longer than its numbers")));
    }
    let packed = read_at(path, offset, packed as usize)?;
    if xxh3_64(&packed) != checksum {
        return Err(damaged(path, &format!("the record at byte {offset} has another checksum")));
    }
    let unpacked = zstd::bulk::decompress(&packed, bytes).ok().filter(|unpacked| unpacked.len() == bytes);
    unpacked.ok_or_else(|| damaged(path, &format!("the record at byte {offset} does not hold {bytes} bytes")))
}

/// Reads bytes. Files are opened for each record, since there may be more of them than a process may keep open.
fn read_at(path: &Path, offset: u64, bytes: usize) -> Result<Vec<u8>> {
    let mut buffer = vec![0; bytes];
    match files::open(path)?.read_exact_at(&mut buffer, offset) {
        Ok(()) => Ok(buffer),
        Err(e) if e.kind() == io::ErrorKind::UnexpectedEof => Err(damaged(path, "it ends too early")),
        Err(e) => Err(Error::io(path, "reading", e)),
    }
}

fn damaged(path: &Path, what: &str) -> Error {
    Error::input(path, format!("this part of a picture is damaged: {what}; make it anew"))
}
