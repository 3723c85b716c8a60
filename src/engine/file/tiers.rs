//! Blocks of files with tiers: they begin with the decoded nodes of the block above.

use super::above::{AboveBlocks, AboveKey, PlaceAbove};
use super::coefficient_file::CoefficientFile;
use std::sync::Arc;
use wavesplat_core::base::error::Result;
use wavesplat_core::codec::WindowCodec;
use wavesplat_core::codec::decode::Block;
use wavesplat_core::codec::field::{Above, Field};
use wavesplat_format::{Axis, BlockId, Window};

impl CoefficientFile {
    /// The nodes of the block above that a block needs at the codec's level of detail, and the stored bytes read. None without
    /// tiers above.
    pub(super) fn above(&self, codec: &WindowCodec, id: BlockId, wanted: &[bool]) -> Result<(Option<Above>, u64)> {
        let tiers = codec.tiers();
        if id.tier >= tiers {
            return Ok((None, 0));
        }
        let (tier, lod) = match codec.lod {
            0 => (id.tier + 1, 0),
            lod => (tiers.min(lod as u8), lod.saturating_sub(tiers.into())),
        };
        let place = PlaceAbove::new(self.metadata(), codec, id, tier, lod);
        let refines_time = codec.scheme.pyramid.as_ref().is_some_and(|pyramid| pyramid.order.contains(&Axis::T));
        let wanted = if refines_time { vec![true; wanted.len()] } else { wanted.to_vec() };
        let (key, mut read) = (AboveKey { id: place.id, lod, wanted: wanted.clone() }, 0);
        let decode = || {
            let (field, bytes) = self.decode_above(&codec.at(tier, lod), place.id, &wanted)?;
            read = bytes;
            Ok(field)
        };
        let field = self.above.field(key, decode)?;
        Ok((Some(place.with(field)), read))
    }

    /// Decodes a block of a tier above 0; also returns the stored bytes read.
    fn decode_above(&self, codec: &WindowCodec, id: BlockId, wanted: &[bool]) -> Result<(Arc<Field<'static>>, u64)> {
        let entry = self.reader.entry(id).map_err(|e| self.failed(e))?;
        let (above, bytes_above) = self.above(codec, id, wanted)?;
        let block = Block::read(&self.reader, codec, &entry, self.all_voxels(&entry)?, wanted, above);
        let block = block.map_err(|e| self.failed(e))?;
        Ok((Arc::new(block.refined(codec, wanted)), block.bytes_read + bytes_above))
    }

    /// Bytes of the decoded blocks above others that are held for each block in memory.
    pub(crate) fn bytes_above(&self) -> usize {
        let tiered = self.metadata().windows.iter().filter(|window| window.tiers() > 0);
        let nodes: usize = self.blocks.region(0).dims().iter().map(|n| n + 1).product();
        let bytes = |window: &Window| {
            let is_single = window.pyramid.as_ref().is_some_and(|pyramid| pyramid.single);
            let each = if is_single { size_of::<f32>() } else { size_of::<f64>() };
            nodes * window.coefficients as usize * each * AboveBlocks::HELD_BY_A_THREAD
        };
        tiered.map(bytes).max().unwrap_or(0)
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
            largest = (largest + own) * codec.prediction_gain();
        }
        Ok(largest)
    }
}
