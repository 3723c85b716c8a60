//! Blocks of files with tiers: they begin with the decoded nodes of the block above.

use super::above::{AboveKey, PlaceAbove, bytes_above, bytes_of_all_above, most_within, with_blocks_above};
use super::coefficient_file::CoefficientFile;
use rayon::prelude::*;
use std::collections::BTreeSet;
use std::sync::Arc;
use wavesplat_core::base::error::Result;
use wavesplat_core::base::grid::Region;
use wavesplat_core::base::memory::MOST_BLOCKS;
use wavesplat_core::codec::WindowCodec;
use wavesplat_core::codec::decode::Block;
use wavesplat_core::codec::field::{Above, Field};
use wavesplat_format::limits::BLOCKS_PER_LEAF;
use wavesplat_format::{Axis, BlockEntry, BlockId, LeafEntry};

impl CoefficientFile {
    /// The nodes of the block above with which a block begins at the codec's level of detail. None without tiers above.
    pub(super) fn above(&self, codec: &WindowCodec, id: BlockId, wanted: &[bool]) -> Result<Option<Above>> {
        let Some(above) = codec.above() else { return Ok(None) };
        let place = PlaceAbove::new(self.metadata(), codec, &above, id);
        let field = self.field(&above, place.id, wanted_above(codec, wanted))?;
        Ok(Some(place.cut(&field)))
    }

    /// As [`Self::above`], decoding only the nodes on which those of a part of the block depend; others are arbitrary.
    pub(super) fn above_part(
        &self,
        codec: &WindowCodec,
        entry: &BlockEntry,
        wanted: &[bool],
        part: &Region,
    ) -> Result<Option<Above>> {
        let Some(above) = codec.above() else { return Ok(None) };
        let place = PlaceAbove::new(self.metadata(), codec, &above, entry.id);
        let needed = codec.needed_above(self.all_voxels(entry)?, part);
        let (key, part) = (above_key(&above, place.id, wanted_above(codec, wanted)), place.in_block_above(&needed));
        let field = match self.above.kept(&key) {
            Some(field) => field,
            None => {
                let block = self.block_part(&above, &self.entry_above(place.id)?, &key.wanted, &part)?;
                Arc::new(block.refined_in(&above, &key.wanted, &part))
            }
        };
        Ok(Some(place.cut_part(&field, &needed)))
    }

    /// Reads a block to decode some of its voxels: it begins with the nodes that these need.
    pub(super) fn block_part(
        &self,
        codec: &WindowCodec,
        entry: &BlockEntry,
        wanted: &[bool],
        part: &Region,
    ) -> Result<Block> {
        let begins_above = entry.begins_above(codec.tiers());
        let above = if begins_above { self.above_part(codec, entry, wanted, part)? } else { None };
        let block = Block::read(&self.reader, codec, entry, self.all_voxels(entry)?, wanted, Some(part), above);
        block.map_err(|e| self.failed(e))
    }

    /// Decodes in parallel the blocks above that some blocks share, as many as stay decoded. Otherwise threads would wait for each
    /// other.
    pub fn decode_shared<'e>(
        &self,
        codec: &WindowCodec,
        entries: impl IntoIterator<Item = &'e BlockEntry>,
        wanted: &[bool],
    ) -> Result<()> {
        let Some(above) = codec.above() else { return Ok(()) };
        let (metadata, wanted) = (self.metadata(), wanted_above(codec, wanted));
        let begin = entries.into_iter().filter_map(|entry| entry.block_above(metadata));
        let ids: BTreeSet<BlockId> = begin.map(|id| metadata.above_in(id, above.tier)).collect();
        let ids = self.above.staying(metadata, codec.tiers(), ids);
        ids.par_iter().try_for_each(|id| self.field(&above, *id, wanted.clone()).map(drop))
    }

    /// Some blocks of a window in groups whose blocks above all stay decoded, if one of them does. Groups have at most [`MOST_BLOCKS`]
    /// blocks and, but for single blocks, 16 MiB of stored bytes.
    pub fn by_shared<'e>(&self, entries: impl IntoIterator<Item = &'e BlockEntry>) -> Vec<Vec<&'e BlockEntry>> {
        let above = |entry: &BlockEntry| entry.block_above(self.metadata());
        let mut sorted: Vec<&BlockEntry> = entries.into_iter().collect();
        sorted.sort_by_key(|entry| (above(entry).is_none(), above(entry).unwrap_or(entry.id)));
        let needs = |id: BlockId| with_blocks_above(self.metadata(), self.metadata().tiers(id.window), id);
        let mut groups: Vec<Vec<&BlockEntry>> = Vec::new();
        let (mut needed, mut stored) = (BTreeSet::new(), 0);
        for entry in sorted {
            let more: BTreeSet<BlockId> = above(entry).into_iter().flat_map(needs).collect();
            let count = needed.union(&more).count();
            let is_full = count > self.above.most() && count > needed.len()
                || groups.last().is_some_and(|group| group.len() == MOST_BLOCKS)
                || stored + entry.stored_len() > STORED_TOGETHER;
            match groups.last_mut().filter(|_| !is_full) {
                Some(group) => group.push(entry),
                None => {
                    groups.push(vec![entry]);
                    (needed, stored) = (BTreeSet::new(), 0);
                }
            }
            needed.extend(more);
            stored += entry.stored_len();
        }
        groups
    }

    /// The decoded nodes of a block above others, kept or decoded now.
    pub(super) fn field(&self, codec: &WindowCodec, id: BlockId, wanted: Vec<bool>) -> Result<Arc<Field<'static>>> {
        let key = above_key(codec, id, wanted);
        self.above.field(&key, || {
            let (entry, above) = (self.entry_above(id)?, self.above(codec, id, &key.wanted)?);
            let block = Block::read(&self.reader, codec, &entry, self.all_voxels(&entry)?, &key.wanted, None, above);
            Ok(Arc::new(block.map_err(|e| self.failed(e))?.refined(codec, &key.wanted)))
        })
    }

    /// The entry of a block of a tier above 0.
    pub(super) fn entry_above(&self, id: BlockId) -> Result<BlockEntry> {
        let [leaf, number] = [id.block / BLOCKS_PER_LEAF, id.block % BLOCKS_PER_LEAF].map(|n| n as usize);
        let Some(leaf) = self.reader.leaves_of(id.window, id.tier, id.channel).get(leaf) else {
            return Err(self.contradiction(format!("no {id}")));
        };
        let entries = self.kept_leaf(leaf)?;
        entries.get(number).cloned().ok_or_else(|| self.contradiction(format!("no {id}")))
    }

    /// The entries of a leaf, which stay in memory for a while.
    pub(crate) fn kept_leaf(&self, leaf: &LeafEntry) -> Result<Arc<Vec<BlockEntry>>> {
        self.above.leaf(leaf.first(), || self.leaf(leaf))
    }

    /// Keeps decoded blocks above others within their share of a memory budget, for this file and its clones. At first, the
    /// budget is [`DEFAULT`](wavesplat_core::base::memory::DEFAULT).
    pub fn limit_shared(&self, memory: usize) {
        self.above.limit(most_within(memory, bytes_above(self.metadata()), self.lod));
    }

    /// An upper bound of the bytes of the decoded blocks above others within their share of a memory budget.
    pub fn shared_bytes(&self, memory: usize) -> usize {
        let each = bytes_above(self.metadata());
        (most_within(memory, each, self.lod) * each).min(bytes_of_all_above(self.metadata()))
    }

    /// Extra bytes to decode a block in a file with tiers: its known nodes, and the block above while that is decoded, with `each`
    /// bytes for a coefficient.
    pub(crate) fn bytes_to_begin(&self, each: usize) -> usize {
        // The block above is decoded before its nodes are copied.
        self.known_bytes() + self.largest_block_above().saturating_sub(self.largest_block()) * each
    }

    /// Bytes of the known nodes of a block.
    pub(crate) fn known_bytes(&self) -> usize {
        let known = if self.lod > 0 {
            self.largest_block()
        } else {
            self.blocks.region(0).dims().iter().map(|n| n / 2 + 1).product::<usize>() * self.most_coefficients()
        };
        if bytes_above(self.metadata()) > 0 { known * self.coefficient_size() } else { 0 }
    }

    /// The coefficients of the largest block above others; 0 without tiers.
    pub(crate) fn largest_block_above(&self) -> usize {
        let m = self.metadata();
        if bytes_above(m) > 0 { self.most_codes() } else { 0 }
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

/// Stored bytes of blocks that are read together: fewer than a remote file fetches at a time.
const STORED_TOGETHER: u64 = 16 << 20;

fn above_key(codec: &WindowCodec, id: BlockId, wanted: Vec<bool>) -> AboveKey {
    AboveKey { id, lod: codec.lod, wanted }
}

/// The coefficients of a block above that those of a block need. If time is refined, all.
pub(super) fn wanted_above(codec: &WindowCodec, wanted: &[bool]) -> Vec<bool> {
    let refines_time = codec.scheme.pyramid.as_ref().is_some_and(|pyramid| pyramid.order.contains(&Axis::T));
    if refines_time { vec![true; wanted.len()] } else { wanted.to_vec() }
}
