//! The coded blocks of the tiers above 0 of a window, from which the blocks below are coded.

use super::Plan;
use crate::file::above::{AboveBlocks, AboveKey, PlaceAbove};
use std::collections::HashMap;
use std::sync::{Arc, Mutex, PoisonError};
use wavesplat_core::base::error::Result;
use wavesplat_core::codec::WindowCodec;
use wavesplat_core::codec::decode::Block;
use wavesplat_core::codec::field::{Above, Field};
use wavesplat_format::{BlockId, EncodedBlock};

/// The coded blocks of a window's tiers above 0. Some stay decoded.
#[derive(Debug)]
pub(super) struct CoarseBlocks {
    coded: Mutex<HashMap<BlockId, Arc<EncodedBlock>>>,
    decoded: AboveBlocks,
}

impl CoarseBlocks {
    /// Room for so many decoded blocks.
    pub(super) fn new(most: usize) -> Self {
        Self { coded: Mutex::default(), decoded: AboveBlocks::new(most) }
    }

    /// Adds a coded block and its decoded nodes.
    pub(super) fn add(&self, codec: &WindowCodec, block: &EncodedBlock, field: Field<'static>) {
        let (id, all) = (block.id, vec![true; codec.basis.coefficients()]);
        self.coded.lock().unwrap_or_else(PoisonError::into_inner).insert(id, Arc::new(block.clone()));
        _ = self.decoded.field(AboveKey { id, lod: 0, wanted: all }, || Ok(Arc::new(field)));
    }

    /// The nodes of the block above a block; none in the last tier.
    pub(super) fn above(&self, plan: &Plan<'_>, codec: &WindowCodec, id: BlockId) -> Result<Option<Above>> {
        if id.tier >= codec.tiers() {
            return Ok(None);
        }
        let (tier, all) = (id.tier + 1, vec![true; codec.basis.coefficients()]);
        let place = PlaceAbove::new(&plan.start, codec, id, tier, 0);
        let key = AboveKey { id: place.id, lod: 0, wanted: all.clone() };
        let decode = || {
            let codec = codec.at(tier, 0);
            let above = self.above(plan, &codec, place.id)?;
            let coded = self.coded.lock().unwrap_or_else(PoisonError::into_inner).get(&place.id).cloned();
            let coded = coded.expect("blocks of a tier are coded before those below");
            let block = Block::from_encoded(&codec, &coded, plan.size(place.id), above).map_err(super::bug)?;
            Ok(Arc::new(block.refined(&codec, &all)))
        };
        let field = self.decoded.field(key, decode)?;
        Ok(Some(place.with(field)))
    }
}
