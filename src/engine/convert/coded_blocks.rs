//! Coded blocks that wait: in memory while they are few, else in a temporary file.

use super::plan::SPOOLED;
use std::collections::HashMap;
use std::io::{self, Read, Seek, SeekFrom, Write};
use tempfile::{SpooledTempFile, spooled_tempfile};
use wavesplat_core::base::error::Error;
use wavesplat_format::{BlockId, EncodedBlock, EncodedPart};

/// Coded blocks, their bytes one after another.
#[derive(Debug)]
pub(super) struct CodedBlocks {
    blocks: HashMap<BlockId, CodedBlock>,
    bytes: SpooledTempFile,
}

/// A block whose bytes are elsewhere.
#[derive(Debug)]
struct CodedBlock {
    /// Where they begin.
    start: u64,
    /// The number of bytes of each part.
    lengths: Vec<usize>,
    /// The rest.
    block: EncodedBlock,
}

impl Default for CodedBlocks {
    fn default() -> Self {
        Self { blocks: HashMap::new(), bytes: spooled_tempfile(SPOOLED) }
    }
}

impl CodedBlocks {
    /// Adds a block.
    pub(super) fn add(&mut self, block: &EncodedBlock) -> io::Result<()> {
        let start = self.bytes.seek(SeekFrom::End(0))?;
        block.parts.iter().try_for_each(|part| self.bytes.write_all(&part.stored))?;
        let lengths = block.parts.iter().map(|part| part.stored.len()).collect();
        let parts = block.parts.iter().map(|part| EncodedPart { stored: Vec::new(), ..*part }).collect();
        let block = EncodedBlock { parts, ..*block };
        self.blocks.insert(block.id, CodedBlock { start, lengths, block });
        Ok(())
    }

    /// A block that was added; none if there is no such block.
    pub(super) fn block(&mut self, id: BlockId) -> io::Result<Option<EncodedBlock>> {
        let Some(CodedBlock { start, lengths, block }) = self.blocks.get(&id) else { return Ok(None) };
        let mut block = block.clone();
        self.bytes.seek(SeekFrom::Start(*start))?;
        for (part, length) in block.parts.iter_mut().zip(lengths) {
            part.stored.resize(*length, 0);
            self.bytes.read_exact(&mut part.stored)?;
        }
        Ok(Some(block))
    }

    /// Removes and returns a block. Drops all bytes when no block is left.
    pub(super) fn take(&mut self, id: BlockId) -> io::Result<Option<EncodedBlock>> {
        let block = self.block(id)?;
        if self.blocks.remove(&id).is_some() && self.blocks.is_empty() {
            self.bytes.set_len(0)?;
        }
        Ok(block)
    }

    /// The error of one that cannot use its temporary file.
    pub(super) fn failed(error: io::Error) -> Error {
        Error::io(std::env::temp_dir(), "using a temporary file", error)
    }
}
