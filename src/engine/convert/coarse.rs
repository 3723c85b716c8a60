//! The coded blocks of the tiers above 0 of a window, from which the blocks below are coded.

use super::Plan;
use super::coded_blocks::CodedBlocks;
use crate::file::above::{AboveBlocks, AboveKey, PlaceAbove};
use rayon::prelude::*;
use std::io;
use std::sync::{Arc, Mutex, PoisonError};
use wavesplat_core::base::error::Result;
use wavesplat_core::codec::WindowCodec;
use wavesplat_core::codec::field::{Above, Field};
use wavesplat_format::{BlockId, EncodedBlock};

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
            let above = self.above(plan, codec, id)?;
            let coded = self.coded(|coded| coded.block(id))?.expect("blocks of a tier are coded before those below");
            let field = Field::from_encoded(codec, &coded, plan.size(id), above.as_ref());
            field.map(Arc::new).map_err(super::bug)
        })
    }

    fn coded<T>(&self, with: impl FnOnce(&mut CodedBlocks) -> io::Result<T>) -> Result<T> {
        let mut coded = self.coded.lock().unwrap_or_else(PoisonError::into_inner);
        with(&mut coded).map_err(CodedBlocks::failed)
    }
}
