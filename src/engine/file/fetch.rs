//! Fetches parts of a remote file together: the ranges that will be read soon are requested in advance, in few
//! requests.

use super::CoefficientFile;
use super::tiers::wanted_above;
use crate::remote::{FETCHED, PageCount};
use std::collections::HashSet;
use std::ops::Range;
use std::sync::Arc;
use wavesplat_core::base::error::Result;
use wavesplat_core::base::grid::Region;
use wavesplat_core::codec::WindowCodec;
use wavesplat_core::codec::decode::Block;
use wavesplat_format::{BlockEntry, BlockId, LeafEntry, PartEntry, Storage};

/// Windows that are fetched together at most.
const WINDOWS_TOGETHER: usize = 256;

/// Fetches parts of many blocks of a remote file before they are read, in few requests.
#[derive(Debug)]
pub struct Prefetch<'a> {
    file: &'a CoefficientFile,
    parts: Vec<PartEntry>,
    /// The blocks above others whose parts were added.
    above: HashSet<BlockId>,
    pages: PageCount,
}

/// For a part of the volume, what is coarse in a window is fetched together with its directory if it has at most so many bytes:
/// about what a server sends in the time of one more request.
const FEW_BYTES: u64 = 128 << 10;

impl<'a> Prefetch<'a> {
    /// `None` for a local file, which needs none.
    pub fn new(file: &'a CoefficientFile) -> Option<Self> {
        file.is_remote().then(|| Self { file, parts: Vec::new(), above: HashSet::new(), pages: PageCount::default() })
    }

    /// Fetches the leaves of a channel that list blocks of a region, of the first windows. Each window is given by some of
    /// its frames.
    pub fn leaves<'f>(
        &self,
        windows: impl Iterator<Item = &'f [usize]>,
        channel: usize,
        region: &Region,
    ) -> Result<()> {
        let windows = windows.take(WINDOWS_TOGETHER).map(|frames| self.file.window_of(frames[0]));
        self.file.fetch_leaves_of(windows, channel, region)
    }

    /// Calls `add` for each item, until there are as many parts as should be fetched together. Returns the number of these
    /// items.
    pub fn gather<T>(
        &mut self,
        items: impl IntoIterator<Item = T>,
        mut add: impl FnMut(T, &mut Self) -> Result<()>,
    ) -> Result<usize> {
        let mut count = 0;
        for item in items.into_iter().take(WINDOWS_TOGETHER) {
            if self.is_full() {
                break;
            }
            add(item, self)?;
            count += 1;
        }
        Ok(count)
    }

    /// Adds the parts of a block that the coefficients marked by `wanted` need, and those of the blocks above it.
    pub fn add(&mut self, codec: &WindowCodec, entry: &BlockEntry, wanted: &[bool]) -> Result<()> {
        for part in Block::parts(codec, entry, wanted) {
            self.pages.add(&bytes_of(part));
            self.parts.push(*part);
        }
        let Some(above) = codec.above().filter(|codec| entry.begins_above(codec.tiers())) else { return Ok(()) };
        let id = self.file.metadata().above_in(entry.id, above.tier);
        match self.above.insert(id) {
            true => self.add(&above, &self.file.entry_above(id)?, &wanted_above(codec, wanted)),
            false => Ok(()),
        }
    }

    /// Whether the parts fill as many pages as should be fetched together.
    pub(crate) fn is_full(&self) -> bool {
        self.pages.is_full()
    }

    /// Fetches the parts that were added.
    pub fn finish(self) -> Result<()> {
        self.file.fetch_parts(self.parts.iter())
    }
}

fn bytes_of(part: &PartEntry) -> Range<u64> {
    part.offset..part.offset.saturating_add(part.stored_len.into())
}

impl CoefficientFile {
    /// Frames by windows.
    pub fn by_window<'f>(&self, frames: &'f [usize]) -> impl Iterator<Item = &'f [usize]> {
        frames.chunk_by(|a, b| self.window_of(*a) == self.window_of(*b))
    }

    /// Whether the file is remote, so that bytes should be fetched before they are read.
    pub(super) fn is_remote(&self) -> bool {
        self.reader.storage().is_remote()
    }

    /// Fetches bytes of a remote file that will be read soon: the first ones, as many as it keeps.
    fn fetch(&self, ranges: impl Iterator<Item = Range<u64>>) -> Result<()> {
        if !self.is_remote() {
            return Ok(());
        }
        let ranges: Vec<Range<u64>> = ranges.collect();
        self.reader.storage().fetch(&ranges).map_err(|e| self.failed(e.into()))
    }

    /// Fetches the leaves of a channel of some windows that list blocks of a region, and those above them.
    pub(super) fn fetch_leaves_of(
        &self,
        windows: impl Iterator<Item = u32>,
        channel: usize,
        region: &Region,
    ) -> Result<()> {
        let is_part = *region != self.grid.whole(); // a whole volume fetches it with its blocks
        let ranges = |window| {
            let above = self.leaves_above(window, channel, region).map(LeafEntry::bytes);
            let coarse = self.coarse_bytes(window).filter(|bytes| is_part && bytes.end - bytes.start <= FEW_BYTES);
            coarse.into_iter().chain(above).chain(self.reached(window, channel, region).map(LeafEntry::bytes))
        };
        self.fetch(windows.flat_map(ranges))
    }

    /// Fetches the bytes of a remote file from `offset` on, as many as it keeps; returns where they end.
    pub(crate) fn fetch_on(&self, offset: u64) -> Result<u64> {
        let end = if self.is_remote() { self.bytes().min(offset.saturating_add(FETCHED)) } else { u64::MAX };
        self.fetch(std::iter::once(offset..end))?;
        Ok(end)
    }

    /// Where the blocks of tiers above 0 and their leaves lie.
    fn coarse_bytes(&self, window: u32) -> Option<Range<u64>> {
        let mut leaves = self.leaves(window).iter().take_while(|leaf| leaf.tier > 0);
        let first = leaves.next()?;
        Some(first.data_offset..leaves.last().unwrap_or(first).bytes().end)
    }

    /// The entries of the blocks above those of a region, and of their neighbours, a leaf of the directory at a time.
    pub(crate) fn entries_above(
        &self,
        window: u32,
        channel: usize,
        region: &Region,
    ) -> impl Iterator<Item = Result<Arc<Vec<BlockEntry>>>> {
        self.leaves_above(window, channel, region).map(|leaf| self.kept_leaf(leaf))
    }

    /// The leaves that list the blocks above those of a region.
    fn leaves_above<'a>(
        &'a self,
        window: u32,
        channel: usize,
        region: &Region,
    ) -> impl Iterator<Item = &'a LeafEntry> + use<'a> {
        let last = Region { start: region.end.map(|end| end.saturating_sub(1)), end: region.end };
        let ends = [region, &last].map(|region| self.blocks.touching(region).next().unwrap_or(0));
        let of_tier = move |tier: u8| {
            let [first, last] = ends.map(|block| {
                let id = BlockId::new(window, channel as u16, block as u32);
                self.metadata().above_in(id, tier).block
            });
            let leaves = self.reader.leaves_of(window, tier, channel as u16).iter();
            leaves.filter(move |leaf| leaf.first_block <= last && first < leaf.first_block + u32::from(leaf.count))
        };
        (1..=self.metadata().tiers(window)).rev().flat_map(of_tier)
    }

    /// Fetches parts that will be read soon.
    fn fetch_parts<'a>(&self, parts: impl Iterator<Item = &'a PartEntry>) -> Result<()> {
        self.fetch(parts.map(bytes_of))
    }

    /// Fetches the parts of some blocks that the coefficients marked by `wanted` need.
    pub fn fetch_blocks<'e>(
        &self,
        codec: &WindowCodec,
        entries: impl IntoIterator<Item = &'e BlockEntry>,
        wanted: &[bool],
    ) -> Result<()> {
        let Some(mut prefetch) = Prefetch::new(self) else { return Ok(()) };
        entries.into_iter().try_for_each(|entry| prefetch.add(codec, entry, wanted))?;
        prefetch.finish()
    }

    /// Fetches all of some blocks.
    pub(crate) fn fetch_whole(&self, entries: &[BlockEntry]) -> Result<()> {
        self.fetch_parts(entries.iter().flat_map(|entry| &entry.parts))
    }
}
