//! The two levels of the directory: leaves of up to 512 blocks, and the root that lists the leaves.

use crate::block::{BlockId, PartKind};
use crate::bytes::{FieldReader, FieldWriter, ParseResult, ensure, finite_amount, is_amount, is_range};
use crate::directory::{BLOCK_ENTRY, BlockEntry, entry_len};
use crate::limits::{BLOCKS_PER_LEAF, MAX_PARTS, align};
use crate::metadata::Metadata;
use crate::section::{SectionExtent, section_end};
use crate::window::WINDOW_END;

/// Bytes of a leaf's entry in the root.
pub(crate) const LEAF_ENTRY: usize = 128;

/// Smallest size of a block in a file, with header and padding.
pub(crate) const MIN_BLOCK: u64 = 128;

/// A leaf's entry in the root. A leaf describes consecutive blocks of one window and channel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LeafEntry {
    /// Window of its blocks.
    pub window: u32,
    /// Number of its first block, a multiple of 512.
    pub first_block: u32,
    /// Channel of its blocks.
    pub channel: u16,
    /// Tier of its blocks.
    pub tier: u8,
    /// Number of its blocks, 1 to 512.
    pub count: u16,
    /// Bytes of the compressed leaf after its frame.
    pub stored_len: u32,
    /// Bytes of the leaf after decompression.
    pub raw_len: u32,
    /// Offset of its first block in the file.
    pub data_offset: u64,
    /// Offset in the file of the leaf's own frame, directly after its blocks.
    pub offset: u64,
    /// Checksum of the compressed leaf.
    pub checksum: u64,
    /// Smallest decoded finite sample; infinity if there is none.
    pub min: f64,
    /// Largest decoded finite sample; minus infinity if there is none.
    pub max: f64,
    /// Largest error of a sample.
    pub reached: f64,
    /// Sum of the squared errors of the samples.
    pub squared_error: f64,
    /// Energy of the stored coefficients.
    pub energy: f64,
    /// Energy of coefficients lost by dropping and quantisation.
    pub dropped: f64,
    /// Number of nonzero coefficients.
    pub coded: u64,
    /// Number of samples stored as outliers.
    pub outliers: u64,
    /// Number of samples stored as missing.
    pub missing: u64,
    /// Number of blocks stored exactly.
    pub exact: u32,
    /// Number of blocks whose data were missing when the file was recovered from a damaged one.
    pub lost: u64,
}

impl LeafEntry {
    /// An empty leaf whose first block will be `id` at `data_offset`.
    pub(crate) fn new(id: BlockId, data_offset: u64) -> Self {
        let BlockId { window, block: first_block, channel, tier } = id;
        let (min, max) = (f64::INFINITY, f64::NEG_INFINITY);
        let (count, stored_len, raw_len, offset, checksum) = (0, 0, 0, 0, 0);
        let (reached, squared_error, energy, dropped) = (0.0, 0.0, 0.0, 0.0);
        let (coded, outliers, missing, exact, lost) = (0, 0, 0, 0, 0);
        #[rustfmt::skip]
        let leaf = Self {
            window, first_block, channel, tier, count, stored_len, raw_len, data_offset, offset, checksum,
            min, max, reached, squared_error, energy, dropped, coded, outliers, missing, exact, lost,
        };
        leaf
    }

    /// Its first block.
    pub fn first(&self) -> BlockId {
        BlockId { window: self.window, block: self.first_block, channel: self.channel, tier: self.tier }
    }

    /// Adds a block's statistics. Sums run in the order of the blocks, so that writer and reader get the same bits.
    pub(crate) fn add(&mut self, block: &BlockEntry) {
        self.count = self.count.saturating_add(1);
        self.min = lesser(self.min, block.stats.min);
        self.max = -lesser(-self.max, -block.stats.max);
        self.reached = -lesser(-self.reached, -block.stats.reached);
        self.squared_error += block.stats.squared_error;
        self.dropped += block.stats.dropped;
        self.exact += u32::from(block.is_exact());
        self.lost += u64::from(block.lost);
        for part in &block.parts {
            let sum = match part.kind {
                PartKind::Level(_) => &mut self.coded,
                PartKind::Outliers => &mut self.outliers,
                PartKind::Missing => &mut self.missing,
                PartKind::Exact | PartKind::Listed | PartKind::Sides | PartKind::Sums => continue,
            };
            *sum = sum.saturating_add(part.stats.count);
            self.energy += if matches!(part.kind, PartKind::Level(_)) { part.stats.energy } else { 0.0 };
        }
    }

    /// The ids of its blocks, in order.
    pub fn ids(&self) -> impl Iterator<Item = BlockId> + Clone + use<> {
        let first = self.first();
        (self.first_block..).take(self.count.into()).map(move |block| BlockId { block, ..first })
    }

    /// Upper bound on the bytes of its blocks' entries.
    pub(crate) fn max_raw_len(&self) -> usize {
        usize::from(self.count) * entry_len(MAX_PARTS)
    }

    /// Parses the entries of its blocks, in order, from its decompressed bytes. Does not check their offsets and values.
    pub(crate) fn parse(&self, raw: &[u8]) -> ParseResult<Vec<BlockEntry>> {
        let mut fields = FieldReader::new(raw);
        let mut entries = Vec::with_capacity(usize::from(self.count).min(raw.len() / BLOCK_ENTRY));
        for id in self.ids() {
            let entry = BlockEntry::decode(&mut fields)?;
            ensure(entry.id == id, || format!("{} instead of {id}", entry.id))?;
            entries.push(entry);
        }
        fields.end()?;
        Ok(entries)
    }

    /// Where its bytes are in the file.
    pub fn bytes(&self) -> std::ops::Range<u64> {
        self.offset..self.extent().end()
    }

    pub(crate) fn extent(&self) -> SectionExtent {
        let Self { offset, stored_len, raw_len, checksum, .. } = *self;
        SectionExtent { offset, stored_len, raw_len, checksum }
    }

    pub(crate) fn set_extent(&mut self, extent: &SectionExtent) {
        (self.offset, self.checksum) = (extent.offset, extent.checksum);
        (self.stored_len, self.raw_len) = (extent.stored_len, extent.raw_len);
    }

    pub(crate) fn encode(&self, out: &mut Vec<u8>) {
        out.put_u32(self.window);
        out.put_u32(self.first_block);
        out.put(&self.first().place());
        out.put_u16(self.count);
        out.put_u32(self.stored_len);
        out.put_u32(self.raw_len);
        out.put_u32(self.exact);
        out.put_u64(self.data_offset);
        out.put_u64(self.offset);
        out.put_u64(self.checksum);
        let floats = [self.min, self.max, self.reached, self.squared_error, self.energy, self.dropped];
        floats.into_iter().for_each(|value| out.put_f64(value));
        [self.coded, self.outliers, self.missing, self.lost].into_iter().for_each(|value| out.put_u64(value));
    }

    /// The encoded bytes; comparing these also distinguishes 0 from -0.
    pub(crate) fn encoded(&self) -> Vec<u8> {
        let mut out = Vec::new();
        self.encode(&mut out);
        out
    }

    pub(crate) fn decode(fields: &mut FieldReader<'_>) -> ParseResult<Self> {
        let BlockId { window, block: first_block, channel, tier } =
            BlockId::at_place(fields.u32()?, fields.u32()?, fields.array()?);
        Ok(Self {
            window,
            first_block,
            channel,
            tier,
            count: fields.u16()?,
            stored_len: fields.u32()?,
            raw_len: fields.u32()?,
            exact: fields.u32()?,
            data_offset: fields.u64()?,
            offset: fields.u64()?,
            checksum: fields.u64()?,
            min: fields.f64()?,
            max: fields.f64()?,
            reached: fields.f64()?,
            squared_error: fields.f64()?,
            energy: fields.f64()?,
            dropped: fields.f64()?,
            coded: fields.u64()?,
            outliers: fields.u64()?,
            missing: fields.u64()?,
            lost: fields.u64()?,
        })
    }

    /// Checks a leaf whose blocks follow the byte `end`; returns the end of the leaf.
    fn check(&self, end: u64) -> ParseResult<u64> {
        let first = self.first();
        let place = |what: &str| format!("leaf of {first}: {what}");
        ensure(self.data_offset == align(end), || place("its blocks do not follow the preceding section"))?;
        let least = self.data_offset.saturating_add(MIN_BLOCK * u64::from(self.count));
        ensure(self.offset == align(self.offset) && self.offset >= least, || place("its offset is wrong"))?;
        let sums = [self.squared_error, self.energy, self.dropped].into_iter().all(is_amount);
        ensure(sums && finite_amount(self.reached), || place("an error or energy out of range"))?;
        ensure(is_range(self.min, self.max), || place("a value range out of order"))?;
        ensure(self.lost <= self.count.into(), || place("more lost blocks than blocks"))?;
        Ok(self.extent().end())
    }
}

/// The smaller value, where -0 is smaller than 0: `f64::min` may return either.
fn lesser(a: f64, b: f64) -> f64 {
    if b.total_cmp(&a).is_lt() { b } else { a }
}

/// The first block and the number of blocks of each leaf of a window with these tiers, in order.
pub(crate) fn leaves_of(metadata: &Metadata, window: u32, tiers: u8) -> impl Iterator<Item = (BlockId, u32)> {
    (0..=tiers).rev().flat_map(move |tier| {
        let blocks = metadata.blocks_per_channel(tier);
        let runs = move || (0..blocks).step_by(BLOCKS_PER_LEAF as usize);
        (0..metadata.channels)
            .flat_map(move |channel| runs().map(move |block| BlockId { window, block, channel, tier }))
            .map(move |id| (id, BLOCKS_PER_LEAF.min(blocks - id.block)))
    })
}

/// Checks that these are all leaves of the archive, window after window from the end of the start section. Returns the
/// end of the last window.
pub(crate) fn check_leaves(metadata: &Metadata, leaves: &[LeafEntry]) -> ParseResult<u64> {
    let windows = 0..metadata.windows.len() as u32;
    let count = windows.clone().fold(0u64, |sum, window| sum.saturating_add(metadata.leaves_of_window(window)));
    ensure(leaves.len() as u64 == count, || format!("{} leaves instead of {count}", leaves.len()))?;
    let (mut rest, mut end) = (leaves, metadata.start_end()?);
    for number in windows {
        let (own, after) = rest.split_at(metadata.leaves_of_window(number) as usize);
        (rest, end) = (after, check_window(metadata, number, own, end)?);
    }
    Ok(end)
}

/// Checks that these are all leaves of a window that starts after the byte `end`; returns the window's end.
pub(crate) fn check_window(metadata: &Metadata, number: u32, leaves: &[LeafEntry], mut end: u64) -> ParseResult<u64> {
    let window = metadata.windows.get(number as usize).ok_or("no such window")?;
    end = section_end(align(end), metadata.window_record(number).encode()?.len());
    for ((id, count), leaf) in leaves_of(metadata, number, window.tiers()).zip(leaves) {
        let same = leaf.first() == id && u32::from(leaf.count) == count;
        ensure(same, || format!("leaf of {count} blocks from {id} expected, not from {}", leaf.first()))?;
        end = leaf.check(end)?;
    }
    let sum = |of: fn(&LeafEntry) -> u64| leaves.iter().fold(0u64, |sum, leaf| sum.saturating_add(of(leaf)));
    let same = sum(|l| l.coded) == window.coded && sum(|l| l.outliers) == window.outliers;
    ensure(same, || format!("window {number}: coefficients or outliers differ from its record"))?;
    let held = |l: &LeafEntry| l.reached <= window.reached && window.min <= l.min && l.max <= window.max;
    ensure(leaves.iter().all(held) && sum(|l| l.missing) <= window.missing, || {
        format!("window {number}: errors, values or missing samples differ from its record")
    })?;
    Ok(section_end(align(end), WINDOW_END))
}
