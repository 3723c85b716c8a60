//! A coefficient file of an older version as one of this version. Codes are packed anew; no value changes.

use super::CoefficientFile;
use super::budget::blocks_within;
use rayon::prelude::*;
use serde::Serialize;
use std::io::Write;
use std::path::Path;
use wavesplat_core::base::error::{Error, Result};
use wavesplat_core::base::progress::Progress;
use wavesplat_core::codec::WindowCodec;
use wavesplat_core::codec::encode::Encoder;
use wavesplat_format::{BlockEntry, EncodedBlock, Features, Metadata, Packing, Writer};

/// The report of a repacking.
#[derive(Debug, Clone, Default, Serialize)]
pub struct RepackReport {
    /// Frames of the file.
    pub frames: u64,
    /// Blocks of the file.
    pub blocks: u64,
    /// Bytes of the file before.
    pub input_bytes: u64,
    /// Bytes of the new file.
    pub output_bytes: u64,
}

/// Writes `file` to `out` as this version packs codes, with a zstd level. All samples, bounds and statistics stay as they
/// are. Messages call the new file `name`; `memory` is what may be allocated.
///
/// # Errors
/// `memory` is too small for a block, a block is damaged, or `out` cannot be written.
pub fn repack(
    file: &CoefficientFile,
    level: i32,
    memory: usize,
    name: &Path,
    out: impl Write,
    progress: &dyn Progress,
) -> Result<RepackReport> {
    let failed = |source| Error::CoefficientFile { path: name.into(), source };
    let metadata = nested(file.metadata());
    let first_digest = metadata.windows.first().map_or(0, |window| window.digest);
    let description = file.description()?;
    let (packing, described) = (metadata.features().packing, description.is_some());
    let features = Features { packing, described, ..file.reader.features() };
    let id = metadata.file_id(first_digest, features).map_err(failed)?;
    let mut writer = Writer::with_features(out, id, &metadata, features).map_err(failed)?;
    let at_once = blocks_within(memory, 0, |_| 0, file.block_bytes(), "rewriting")?;
    progress.start(Some(metadata.blocks()));
    for number in 0..metadata.windows.len() as u32 {
        let to = WindowCodec::from_metadata(&metadata, &metadata.windows[number as usize]).map_err(failed)?;
        let packing = BlockPacking { file, level, from: &file.codec(number)?, to: &to };
        writer.begin_window(metadata.window_record(number)).map_err(failed)?;
        for leaf in file.leaves(number) {
            for entries in file.leaf(leaf)?.chunks(at_once) {
                packing.append(entries, &mut writer).map_err(failed)?;
                progress.advance(entries.len() as u64);
            }
        }
        writer.end_window(&metadata.window_end(number)).map_err(failed)?;
    }
    let (mut out, summary) = writer.finish_described(description.as_ref()).map_err(failed)?;
    out.flush().map_err(|e| Error::io(name, "writing", e))?;
    progress.finish();
    let (frames, blocks, input_bytes) = (metadata.frames, summary.blocks, file.bytes());
    Ok(RepackReport { frames, blocks, input_bytes, output_bytes: summary.bytes })
}

/// The metadata with nested parts in all windows that have a pyramid.
fn nested(metadata: &Metadata) -> Metadata {
    let mut nested = metadata.clone();
    let pyramids = nested.windows.iter_mut().filter_map(|window| window.pyramid.as_mut());
    pyramids.for_each(|pyramid| pyramid.packing = Packing::Nested);
    nested
}

/// How the blocks of a window are packed.
struct BlockPacking<'a> {
    file: &'a CoefficientFile,
    level: i32,
    from: &'a WindowCodec,
    to: &'a WindowCodec,
}

impl BlockPacking<'_> {
    /// Packs some blocks side by side, and appends them in order.
    fn append<W: Write>(&self, entries: &[BlockEntry], writer: &mut Writer<W>) -> wavesplat_format::Result<()> {
        let encoder = || Encoder::new(self.level);
        let packed = entries.par_iter().map_init(encoder, |encoder, entry| {
            let encoder = encoder.as_mut().map_err(|_| wavesplat_format::Error::Invalid("zstd failed".into()))?;
            self.packed(encoder, entry)
        });
        let packed: Vec<Option<EncodedBlock>> = packed.collect::<wavesplat_format::Result<_>>()?;
        for (entry, block) in entries.iter().zip(packed) {
            match block {
                Some(block) => writer.append(&block)?,
                None => writer.append_lost(entry.id)?,
            }
        }
        Ok(())
    }

    /// A block, packed anew; none if it is lost.
    fn packed(&self, encoder: &mut Encoder, entry: &BlockEntry) -> wavesplat_format::Result<Option<EncodedBlock>> {
        if entry.lost {
            return Ok(None);
        }
        let size = self.file.reader.geometry(entry.id)?.size;
        encoder.repack(&self.file.reader, self.from, self.to, size, entry).map(Some)
    }
}
