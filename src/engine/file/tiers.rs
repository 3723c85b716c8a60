//! Blocks of files with tiers: they begin with the decoded nodes of the block above.

use super::above::{AboveKey, PlaceAbove, bytes_above, nodes_above, shared_bytes};
use super::coefficient_file::CoefficientFile;
use std::sync::Arc;
use wavesplat_core::base::error::Result;
use wavesplat_core::codec::WindowCodec;
use wavesplat_core::codec::decode::Block;
use wavesplat_core::codec::field::{Above, Field};
use wavesplat_format::limits::BLOCKS_PER_LEAF;
use wavesplat_format::{Axis, BlockEntry, BlockId};

impl CoefficientFile {
    /// The nodes of the block above that a block needs at the codec's level of detail, and the stored bytes read. None without
    /// tiers above.
    pub(super) fn above(&self, codec: &WindowCodec, id: BlockId, wanted: &[bool]) -> Result<(Option<Above>, u64)> {
        let Some(above) = codec.above() else { return Ok((None, 0)) };
        let place = PlaceAbove::new(self.metadata(), codec, &above, id);
        let wanted = wanted_above(codec, wanted);
        let (key, mut read) = (AboveKey { id: place.id, lod: above.lod, wanted: wanted.clone() }, 0);
        let decode = || {
            let (field, bytes) = self.decode_above(&above, place.id, &wanted)?;
            read = bytes;
            Ok(field)
        };
        let field = self.above.field(key, decode)?;
        Ok((Some(place.cut(&field)), read))
    }

    /// The block of a tier in which a block lies.
    pub(super) fn id_above(&self, mut id: BlockId, tier: u8) -> BlockId {
        while id.tier < tier {
            id = self.metadata().above(id);
        }
        id
    }

    /// The entry of a block of a tier above 0.
    pub(super) fn entry_above(&self, id: BlockId) -> Result<BlockEntry> {
        let [leaf, number] = [id.block / BLOCKS_PER_LEAF, id.block % BLOCKS_PER_LEAF].map(|n| n as usize);
        let Some(leaf) = self.reader.leaves_of(id.window, id.tier, id.channel).get(leaf) else {
            return Err(self.contradiction(format!("no {id}")));
        };
        let entries = self.above.leaf(leaf.first(), || self.leaf(leaf))?;
        entries.get(number).cloned().ok_or_else(|| self.contradiction(format!("no {id}")))
    }

    /// Decodes a block of a tier above 0; also returns the stored bytes read.
    fn decode_above(&self, codec: &WindowCodec, id: BlockId, wanted: &[bool]) -> Result<(Arc<Field<'static>>, u64)> {
        let entry = self.entry_above(id)?;
        let (above, bytes_above) = self.above(codec, id, wanted)?;
        let block = Block::read(&self.reader, codec, &entry, self.all_voxels(&entry)?, wanted, above);
        let block = block.map_err(|e| self.failed(e))?;
        Ok((Arc::new(block.refined(codec, wanted)), block.bytes_read + bytes_above))
    }

    /// Keeps decoded blocks above others within their share of a memory budget, for this file and its clones. At first, the
    /// budget is [`DEFAULT`](wavesplat_core::base::memory::DEFAULT).
    pub fn limit_shared(&self, memory: usize) {
        self.above.limit(memory, bytes_above(self.metadata()));
    }

    /// Bytes of the decoded blocks above others within their share of a memory budget.
    pub fn shared_bytes(&self, memory: usize) -> usize {
        shared_bytes(memory, bytes_above(self.metadata()))
    }

    /// Bytes of memory, beside those of a block, for the nodes of the block above that lie in it, and to decode that, with
    /// `each` bytes for a coefficient; 0 without tiers.
    pub(crate) fn bytes_to_begin(&self, each: usize) -> usize {
        let m = self.metadata();
        let longest = m.windows.iter().map(|window| window.coefficients as usize).max().unwrap_or(0);
        let (own, above) = (self.largest_block(), nodes_above(m) * longest);
        let known = if self.lod > 0 {
            own
        } else {
            self.blocks.region(0).dims().iter().map(|n| n / 2 + 1).product::<usize>() * longest
        };
        // The block above is decoded before its nodes are copied.
        let bytes = known * size_of::<f64>() + above.saturating_sub(own) * each;
        if bytes_above(m) > 0 { bytes } else { 0 }
    }

    /// An upper bound of the coefficients that blocks of tier 0 begin with.
    pub(crate) fn largest_above(&self, codec: &WindowCodec, window: u32, channel: usize) -> Result<f64> {
        let mut largest = 0.0;
        for tier in (1..=codec.tiers()).rev() {
            let mut own = 0.0_f64;
            for leaf in self.reader.leaves_of(window, tier, channel as u16) {
                let entries = self.leaf(leaf)?;
                let of_parts = entries.iter().flat_map(|entry| &entry.parts).map(|part| part.stats.largest);
                own = of_parts.fold(own, f64::max);
            }
            largest = largest * codec.at(tier, 0).prediction_gain() + own;
        }
        Ok(largest * codec.prediction_gain())
    }
}

/// The coefficients of a block above that those of a block need. If time is refined, all.
pub(super) fn wanted_above(codec: &WindowCodec, wanted: &[bool]) -> Vec<bool> {
    let refines_time = codec.scheme.pyramid.as_ref().is_some_and(|pyramid| pyramid.order.contains(&Axis::T));
    if refines_time { vec![true; wanted.len()] } else { wanted.to_vec() }
}
