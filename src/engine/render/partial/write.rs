//! Writes partial sums.

use super::MAGIC;
use super::head::{Head, PartialSource, PictureRecord, PictureSetup, RecordSpan, SCHEMA, WeightRecord};
use crate::render::PartialSums;
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use wavesplat_core::base::error::{Error, Result};
use wavesplat_core::base::grid::Region;
use xxhash_rust::xxh3::{Xxh3, xxh3_64};

/// Sums are noise for the most part, so more work packs hardly better.
const LEVEL: i32 = 1;

/// Numbers that are packed at a time.
const TOGETHER: usize = 1 << 14;

/// A file of partial sums that is being written.
pub struct PartialWriter<W> {
    out: W,
    name: PathBuf,
    at: u64,
    head: Head,
}

impl<W: Write> PartialWriter<W> {
    /// Begins the sums over these voxels and files. Messages call the output `name`.
    ///
    /// # Errors
    /// Settings that no picture can have, or failed writes.
    pub fn new(
        name: &Path,
        mut out: W,
        setup: PictureSetup,
        boxes: Vec<Region>,
        sources: Vec<PartialSource>,
    ) -> Result<Self> {
        let software = concat!("wavesplat-render ", env!("CARGO_PKG_VERSION")).into();
        let head = Head {
            schema: SCHEMA,
            software,
            look: setup,
            boxes,
            sources,
            sample_error: 0.0,
            damage: None,
            weights: Vec::new(),
            pictures: Vec::new(),
        };
        head.check(0).map_err(|what| Error::path(name, what))?;
        out.write_all(&MAGIC).map_err(|e| Error::io(name, "writing", e))?;
        Ok(Self { out, name: name.into(), at: MAGIC.len() as u64, head })
    }

    /// Adds weights or a picture. Frames are numbered as in the archive.
    ///
    /// # Errors
    /// Failed writes.
    pub fn put(&mut self, sums: PartialSums<'_>) -> Result<()> {
        match sums {
            PartialSums::Weights { view, sums } => {
                let place = self.record(&[sums])?;
                self.head.weights.push(WeightRecord { view, place });
            }
            PartialSums::Picture { view, frame, planes, missing } => {
                let place = self.record(planes)?;
                self.head.pictures.push(PictureRecord { view, frame, missing, place });
            }
        }
        Ok(())
    }

    /// Ends the file. No splatted sample is off by more than `sample_error`, but for what was left out as damaged.
    ///
    /// # Errors
    /// Failed writes.
    pub fn finish(mut self, sample_error: f64, damage: Option<String>) -> Result<W> {
        (self.head.sample_error, self.head.damage) = (sample_error, damage);
        let failed = |e: io::Error| Error::io(&self.name, "writing", e);
        let json = serde_json::to_vec(&self.head).map_err(|e| failed(e.into()))?;
        let packed = zstd::bulk::compress(&json, LEVEL).map_err(failed)?;
        let numbers = [self.at, packed.len() as u64, json.len() as u64, xxh3_64(&packed)];
        let end: Vec<u8> = numbers.iter().flat_map(|n| n.to_le_bytes()).chain(MAGIC).collect();
        self.out.write_all(&packed).and_then(|()| self.out.write_all(&end)).map_err(failed)?;
        Ok(self.out)
    }

    fn record(&mut self, planes: &[&[f64]]) -> Result<RecordSpan> {
        let mut counted = Counted { out: &mut self.out, bytes: 0, digest: Xxh3::new() };
        pack(planes, &mut counted).map_err(|e| Error::io(&self.name, "writing", e))?;
        let place = RecordSpan { offset: self.at, bytes: counted.bytes, checksum: counted.digest.digest() };
        self.at += place.bytes;
        Ok(place)
    }
}

/// Packs numbers a few at a time, since those of all planes may be as large as the rest of the work.
fn pack(planes: &[&[f64]], out: impl Write) -> io::Result<()> {
    let (mut packer, mut bytes) = (zstd::stream::Encoder::new(out, LEVEL)?, Vec::new());
    for numbers in planes.iter().flat_map(|plane| plane.chunks(TOGETHER)) {
        bytes.clear();
        bytes.extend(numbers.iter().flat_map(|v| v.to_le_bytes()));
        packer.write_all(&bytes)?;
    }
    packer.finish().map(drop)
}

/// Counts and digests what passes.
struct Counted<W> {
    out: W,
    bytes: u64,
    digest: Xxh3,
}

impl<W: Write> Write for Counted<W> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let written = self.out.write(bytes)?;
        self.bytes += written as u64;
        self.digest.update(&bytes[..written]);
        Ok(written)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.out.flush()
    }
}
