//! Blocks that are read together.

use super::CoefficientFile;
use super::counted::Counted;
use crate::base::error::Result;
use crate::codec::WindowCodec;
use crate::codec::decode::Block;
use rayon::prelude::*;
use wavesplat_format::{BlockEntry, BlockId, ReadAhead, Reader, Storage};

/// Some blocks of a window; several threads may decode them.
#[derive(Debug)]
pub(crate) struct BlockBatch<'a> {
    file: &'a CoefficientFile,
    /// Holds the bytes of the batch; none where blocks are read one by one.
    ahead: Option<Reader<ReadAhead<'a, Counted>>>,
}

impl BlockBatch<'_> {
    /// Decodes the block of a directory entry, with the same codec and coefficients as for [`CoefficientFile::batch`].
    pub(crate) fn block(&self, codec: &WindowCodec, entry: &BlockEntry, wanted: &[bool]) -> Result<Block> {
        match &self.ahead {
            Some(ahead) => self.file.block_from(ahead, codec, entry, wanted),
            None => self.file.block(codec, entry, wanted),
        }
    }
}

impl CoefficientFile {
    /// Whether blocks should be read in batches: true for remote storages.
    pub(crate) fn prefers_batches(&self) -> bool {
        self.reader.storage().prefers_batches()
    }

    /// Blocks of these directory entries, to be decoded one by one; of their coefficients those that `wanted` marks. Where
    /// the storage prefers batches, this reads their bytes in one call of [`Storage::read_many`].
    pub(crate) fn batch<'a>(
        &'a self,
        codec: &WindowCodec,
        entries: &[BlockEntry],
        wanted: &[bool],
    ) -> Result<BlockBatch<'a>> {
        let parts = || entries.iter().flat_map(|entry| Block::parts(codec, entry, wanted));
        let ahead = self.prefers_batches().then(|| self.reader.read_ahead(parts())).transpose();
        Ok(BlockBatch { file: self, ahead: ahead.map_err(|e| self.failed(e))? })
    }

    /// The samples of whole blocks, decoded side by side: of each block all frames of its window, little-endian in the
    /// file's [type](Self::sample), x fastest, then y, z, and time slowest. [`Self::blocks`] says which voxels a block has.
    ///
    /// A remote storage gets one request for all blocks of a window, and some for the directory. The result is held in
    /// memory: ask for as many blocks as fit.
    ///
    /// # Errors
    /// [`Error::CoefficientFile`](crate::Error::CoefficientFile) for a block that is damaged or that the file lacks.
    pub fn read_blocks(&self, ids: &[BlockId]) -> Result<Vec<Vec<u8>>> {
        let mut blocks = Vec::with_capacity(ids.len());
        for ids in ids.chunk_by(|a, b| a.window == b.window) {
            let entries = self.entries_of(ids)?;
            let codec = self.codec(ids[0].window)?;
            let all = vec![true; codec.basis.coefficients()];
            let batch = self.batch(&codec, &entries, &all)?;
            let decode =
                |entry: &BlockEntry| batch.block(&codec, entry, &all).map(|block| block.samples(&codec).to_vec());
            blocks.extend(entries.par_iter().map(decode).collect::<Result<Vec<_>>>()?);
        }
        Ok(blocks)
    }

    /// The entries of some blocks; a leaf of the directory is read once for neighbours.
    fn entries_of(&self, ids: &[BlockId]) -> Result<Vec<BlockEntry>> {
        let mut leaf = Vec::new();
        let find = |leaf: &[BlockEntry], id| leaf.iter().find(|entry| entry.id == id).cloned();
        let mut entry = |id: BlockId| {
            if let Some(found) = find(&leaf, id) {
                return Ok(found);
            }
            let holds = |l: &&_| wavesplat_format::LeafEntry::ids(l).any(|held| held == id);
            leaf = self.leaves(id.window).iter().find(holds).map_or(Ok(Vec::new()), |l| self.leaf(l))?;
            find(&leaf, id).ok_or_else(|| self.contradiction(format!("{id}: the archive has no such block")))
        };
        ids.iter().map(|id| entry(*id)).collect()
    }
}
