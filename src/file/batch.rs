//! Blocks that are read together.

use super::CoefficientFile;
use super::counted::Counted;
use crate::base::error::Result;
use crate::codec::WindowCodec;
use crate::codec::decode::Block;
use wavesplat_format::{BlockEntry, ReadAhead, Reader};

/// Some blocks of a window, made by [`CoefficientFile::batch`]; several threads may decode them.
#[derive(Debug)]
pub struct BlockBatch<'a> {
    pub(super) file: &'a CoefficientFile,
    pub(super) codec: &'a WindowCodec,
    pub(super) wanted: &'a [bool],
    /// Holds the bytes of the batch; none where blocks are read one by one.
    pub(super) ahead: Option<Reader<ReadAhead<'a, Counted>>>,
}

impl BlockBatch<'_> {
    /// Decodes the block of a directory entry.
    pub fn block(&self, entry: &BlockEntry) -> Result<Block> {
        match &self.ahead {
            Some(ahead) => self.file.block_from(ahead, self.codec, entry, self.wanted),
            None => self.file.block(self.codec, entry, self.wanted),
        }
    }
}
