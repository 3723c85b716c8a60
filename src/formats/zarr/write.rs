//! Writes extracted samples to a Zarr store. The folder has another name until it is complete.

use super::layout::{GROUP, METADATA};
use super::store::{LEVEL, Store};
use crate::contents::Contents;
use crate::encoding::Encoding;
use crate::writer::SampleSink;
use std::path::Path;
use wavesplat_core::base::error::{Error, Note, Remedy, Result};
use wavesplat_core::base::output::{OutputFolder, Takes};

/// A store that is being written.
#[derive(Debug)]
struct StoreSink {
    folder: OutputFolder,
    store: Store,
    encoding: Encoding,
    /// Name and samples of the chunks that are left, the next one last.
    chunks: Vec<(String, u64)>,
    /// The bytes of the chunk being filled, as they are stored.
    bytes: Vec<u8>,
    force: bool,
}

/// Writes everything but the samples; an existing store is an error unless `force` replaces it.
pub(super) fn create(path: &Path, contents: &Contents, encoding: Encoding, force: bool) -> Result<Box<dyn SampleSink>> {
    check(path, force)?;
    let store = Store::new(contents, encoding.to);
    let folder = OutputFolder::create(path, GROUP, Takes::Whole, force)?;
    for (name, bytes) in &store.files {
        folder.write(name, bytes)?;
    }
    let mut chunks = store.chunks.list();
    chunks.reverse();
    Ok(Box::new(StoreSink { folder, store, encoding, chunks, bytes: Vec::new(), force }))
}

impl SampleSink for StoreSink {
    fn write(&mut self, mut samples: &[u8]) -> Result<()> {
        while let (Some((_, count)), false) = (self.chunks.last(), samples.is_empty()) {
            let wanted = *count as usize * self.encoding.to.size() - self.bytes.len();
            let take = (wanted / self.encoding.to.size() * self.encoding.from.size()).min(samples.len());
            let (these, others) = samples.split_at(take);
            let failed = |e| Error::io(self.folder.path(), "writing", e);
            self.encoding.write(these, &mut self.bytes).map_err(failed)?;
            samples = others;
            if *count as usize * self.encoding.to.size() == self.bytes.len() {
                self.end_chunk()?;
            }
        }
        Ok(())
    }

    /// Gives the store its name.
    fn finish(self: Box<Self>) -> Result<()> {
        self.folder.write(METADATA, &self.store.metadata)?;
        check(self.folder.path(), self.force)?; // another may have come meanwhile
        self.folder.commit()
    }
}

impl StoreSink {
    /// Compresses and writes a chunk. One at the far end is filled up to its whole length.
    fn end_chunk(&mut self) -> Result<()> {
        let Some((name, _)) = self.chunks.pop() else { return Ok(()) };
        self.bytes.resize(self.store.chunks.samples() as usize * self.encoding.to.size(), 0);
        let packed = zstd::bulk::compress(&self.bytes, LEVEL);
        let packed = packed.map_err(|e| Error::io(self.folder.path(), "compressing", e))?;
        self.bytes.clear();
        self.folder.write(self.store.samples.join(name), &packed)
    }
}

/// Checks in advance, where possible, that the store can be created.
fn check(path: &Path, force: bool) -> Result<()> {
    if !path.exists() {
        return Ok(());
    }
    match (is_store(path), force) {
        (true, true) => Ok(()),
        (true, false) => Err(Error::path(path, Note::with("exists already", Remedy::Replace))),
        (false, _) => Err(Error::path(path, "exists already, and is no Zarr store")),
    }
}

fn is_store(path: &Path) -> bool {
    path.join(GROUP).is_file()
}
