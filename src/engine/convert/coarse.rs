//! The coded blocks of the tiers above 0 of a window, from which the blocks below are coded.

use super::Plan;
use super::plan::SPOOLED;
use crate::file::above::{AboveBlocks, AboveKey, PlaceAbove};
use rayon::prelude::*;
use std::collections::HashMap;
use std::io::{self, Read, Seek, SeekFrom, Write};
use std::sync::{Arc, Mutex, PoisonError};
use tempfile::{SpooledTempFile, spooled_tempfile};
use wavesplat_core::base::error::{Error, Result};
use wavesplat_core::codec::WindowCodec;
use wavesplat_core::codec::field::{Above, Field};
use wavesplat_format::{BlockId, EncodedBlock, EncodedPart};

/// The coded blocks of a window's tiers above 0. Some stay decoded.
#[derive(Debug)]
pub(super) struct CoarseBlocks {
    coded: Mutex<CodedBlocks>,
    decoded: AboveBlocks,
}

impl CoarseBlocks {
    /// No blocks yet, and room for so many decoded ones.
    pub(super) fn new(decoded: usize) -> Self {
        Self { coded: Mutex::default(), decoded: AboveBlocks::new(decoded) }
    }

    /// Adds a coded block and its decoded nodes.
    pub(super) fn add(&self, codec: &WindowCodec, block: &EncodedBlock, field: Field<'static>) -> Result<()> {
        let (id, all) = (block.id, vec![true; codec.basis.coefficients()]);
        self.coded(|coded| coded.add(block))?;
        self.decoded.field(&AboveKey { id, lod: 0, wanted: all }, || Ok(Arc::new(field)))?;
        Ok(())
    }

    /// Decodes in parallel the blocks above that some blocks share, as many as stay decoded. Otherwise threads would wait for each
    /// other.
    pub(super) fn decode_shared(
        &self,
        plan: &Plan<'_>,
        codec: &WindowCodec,
        ids: impl Iterator<Item = BlockId>,
    ) -> Result<()> {
        let above = ids.filter(|id| id.tier < codec.tiers()).map(|id| plan.start.above(id));
        let above = self.decoded.staying(&plan.start, codec.tiers(), above.collect());
        above.par_iter().try_for_each(|id| self.field(plan, &codec.at(id.tier, 0), *id).map(drop))
    }

    /// The nodes that a block begins with; none in the last tier.
    pub(super) fn above(&self, plan: &Plan<'_>, codec: &WindowCodec, id: BlockId) -> Result<Option<Above>> {
        let codec = codec.at(id.tier, 0);
        let Some(codec_above) = codec.above() else { return Ok(None) };
        let place = PlaceAbove::new(&plan.start, &codec, &codec_above, id);
        let field = self.field(plan, &codec_above, place.id)?;
        Ok(Some(place.cut(&field)))
    }

    /// The nodes of a coded block, kept or decoded now.
    fn field(&self, plan: &Plan<'_>, codec: &WindowCodec, id: BlockId) -> Result<Arc<Field<'static>>> {
        let key = AboveKey { id, lod: 0, wanted: vec![true; codec.basis.coefficients()] };
        self.decoded.field(&key, || {
            let (above, coded) = (self.above(plan, codec, id)?, self.coded(|coded| coded.block(id))?);
            let field = Field::from_encoded(codec, &coded, plan.size(id), above.as_ref());
            field.map(Arc::new).map_err(super::bug)
        })
    }

    fn coded<T>(&self, with: impl FnOnce(&mut CodedBlocks) -> io::Result<T>) -> Result<T> {
        let mut coded = self.coded.lock().unwrap_or_else(PoisonError::into_inner);
        with(&mut coded).map_err(|e| Error::io(std::env::temp_dir(), "using a temporary file", e))
    }
}

/// Coded blocks, their bytes one after another.
#[derive(Debug)]
struct CodedBlocks {
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
    fn add(&mut self, block: &EncodedBlock) -> io::Result<()> {
        let start = self.bytes.seek(SeekFrom::End(0))?;
        block.parts.iter().try_for_each(|part| self.bytes.write_all(&part.stored))?;
        let lengths = block.parts.iter().map(|part| part.stored.len()).collect();
        let parts = block.parts.iter().map(|part| EncodedPart { stored: Vec::new(), ..*part }).collect();
        let block = EncodedBlock { parts, ..*block };
        self.blocks.insert(block.id, CodedBlock { start, lengths, block });
        Ok(())
    }

    fn block(&mut self, id: BlockId) -> io::Result<EncodedBlock> {
        let CodedBlock { start, lengths, block } =
            self.blocks.get(&id).expect("blocks of a tier are coded before those below");
        let mut block = block.clone();
        self.bytes.seek(SeekFrom::Start(*start))?;
        for (part, length) in block.parts.iter_mut().zip(lengths) {
            part.stored.resize(*length, 0);
            self.bytes.read_exact(&mut part.stored)?;
        }
        Ok(block)
    }
}
