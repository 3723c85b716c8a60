//! The directory's entries of blocks and parts: their bytes and checks.

use crate::block::{BlockId, BlockStats, PartKind, PartStats};
use crate::bytes::{FieldReader, FieldWriter, ParseResult, ensure, finite_amount, is_amount, is_range};
use crate::file_id::FileId;
use crate::header::Features;
use crate::limits::{MAX_PART_RAW, MAX_PARTS, align};
use crate::section::{FRAME, SectionId, read, read_checked};
use crate::{Metadata, Result, Storage};

/// Bytes of a block's entry without its part entries.
pub(crate) const BLOCK_ENTRY: usize = 64;

/// Bytes of a part's entry.
const PART_ENTRY: usize = 56;

/// A part's entry in the directory: position, checksum and statistics.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PartEntry {
    /// The kind of its content.
    pub kind: PartKind,
    /// Statistics for skipping.
    pub stats: PartStats,
    /// Offset of its zstd frame in the file.
    pub offset: u64,
    /// Bytes of its zstd frame.
    pub stored_len: u32,
    /// Bytes after decompression.
    pub raw_len: u32,
    /// xxh3-64 of the stored bytes, seeded by file, block and kind.
    pub checksum: u64,
}

/// A block's entry in the directory.
#[derive(Debug, Clone, PartialEq)]
pub struct BlockEntry {
    /// The block's identity.
    pub id: BlockId,
    /// Statistics for skipping.
    pub stats: BlockStats,
    /// Its parts, ascending by kind.
    pub parts: Vec<PartEntry>,
    /// Whether its data were missing when the file was recovered from a damaged one, so that its samples are unknown.
    pub lost: bool,
}

impl BlockEntry {
    /// The entry of a lost block.
    pub fn lost(id: BlockId) -> Self {
        let (min, max) = (f64::INFINITY, f64::NEG_INFINITY);
        let stats = BlockStats { step: 0.0, min, max, reached: 0.0, squared_error: 0.0, dropped: 0.0 };
        Self { id, stats, parts: Vec::new(), lost: true }
    }

    /// The block's part of a kind, if it has one.
    pub fn part(&self, kind: PartKind) -> Option<&PartEntry> {
        self.parts.iter().find(|part| part.kind == kind)
    }

    /// Whether the block stores all its samples exactly.
    pub fn is_exact(&self) -> bool {
        self.parts.iter().any(|part| part.kind.is_exact())
    }

    /// Whether it begins with the nodes of the block above, in a window with so many tiers. Without a step, all samples of a
    /// block of tier 0 are zero.
    pub fn begins_above(&self, tiers: u8) -> bool {
        begins_above(self.id, self.stats, self.is_exact(), tiers)
    }

    /// The block above whose nodes it begins with, if any.
    pub fn block_above(&self, metadata: &Metadata) -> Option<BlockId> {
        self.begins_above(metadata.tiers(self.id.window)).then(|| metadata.above(self.id))
    }

    /// Bytes of its parts in the file, without header and padding.
    pub fn stored_len(&self) -> u64 {
        self.parts.iter().map(|part| u64::from(part.stored_len)).sum()
    }

    /// Bytes of its header in the file, frame included.
    pub(crate) fn header_len(&self) -> u64 {
        (FRAME + entry_len(self.parts.len())) as u64
    }

    pub(crate) fn encode(&self, out: &mut Vec<u8>) {
        out.put_u32(self.id.window);
        out.put_u32(self.id.block);
        out.put(&self.id.place());
        out.put_u16(self.parts.len() as u16);
        out.put_u32(self.lost.into());
        let BlockStats { step, min, max, reached, squared_error, dropped } = self.stats;
        [step, min, max, reached, squared_error, dropped].into_iter().for_each(|value| out.put_f64(value));
        self.parts.iter().for_each(|part| part.encode(out));
    }

    /// The encoded bytes; comparing these also distinguishes 0 from -0.
    pub(crate) fn encoded(&self) -> Vec<u8> {
        let mut out = Vec::new();
        self.encode(&mut out);
        out
    }

    pub(crate) fn decode(fields: &mut FieldReader<'_>) -> ParseResult<Self> {
        let id = BlockId::at_place(fields.u32()?, fields.u32()?, fields.array()?);
        let count = usize::from(fields.u16()?);
        let lost = fields.u32()?;
        ensure(lost <= 1, || format!("the field lost is {lost} instead of 0 or 1"))?;
        let stats = BlockStats {
            step: fields.f64()?,
            min: fields.f64()?,
            max: fields.f64()?,
            reached: fields.f64()?,
            squared_error: fields.f64()?,
            dropped: fields.f64()?,
        };
        ensure(count <= MAX_PARTS && count * PART_ENTRY <= fields.remaining(), || {
            format!("invalid number of parts, {count}")
        })?;
        let parts = (0..count).map(|_| PartEntry::decode(fields)).collect::<ParseResult<_>>()?;
        Ok(Self { id, stats, parts, lost: lost == 1 })
    }

    /// Checks of a block in a window with so many tiers, of a file with these features, that do not depend on the rest of the
    /// metadata.
    pub(crate) fn check(&self, tiers: u8, announced: Features) -> ParseResult {
        let BlockStats { step, min, max, reached, squared_error, dropped } = self.stats;
        ensure(finite_amount(step) && finite_amount(reached), || "a step or an error out of range".into())?;
        ensure(is_amount(squared_error) && is_amount(dropped), || "an energy out of range".into())?;
        ensure(is_range(min, max), || format!("invalid value range {min} to {max}"))?;
        ensure(self.parts.len() <= MAX_PARTS, || format!("{} parts, at most {MAX_PARTS}", self.parts.len()))?;
        let ascend = self.parts.is_sorted_by(|a, b| a.kind < b.kind);
        ensure(ascend, || "parts out of order".into())?;
        let lossy = |part: &PartEntry| {
            matches!(part.kind, PartKind::Level(_) | PartKind::Outliers | PartKind::Sides | PartKind::Sums)
        };
        let both = self.is_exact() && self.parts.iter().any(lossy);
        ensure(!both, || "both exact samples and coefficients, outliers, sides or sums".into())?;
        let is_listed = self.part(PartKind::Listed).is_some();
        ensure(!is_listed || self.part(PartKind::Exact).is_none(), || "exact samples twice".into())?;
        ensure(!is_listed || announced.listed, || "listed values, which the header does not announce".into())?;
        let has_sides = self.part(PartKind::Sides).is_some();
        ensure(!has_sides || announced.sided, || "sides, which the header does not announce".into())?;
        let has_sums = self.part(PartKind::Sums).is_some();
        ensure(!has_sums || announced.summed, || "sums, which the header does not announce".into())?;
        let lost = !self.lost || self.encoded() == Self::lost(self.id).encoded();
        ensure(lost, || "a lost block with parts or statistics".into())?;
        self.check_tier(tiers)?;
        self.parts.iter().try_for_each(PartEntry::check)
    }

    /// Checks what only blocks of a window with tiers must satisfy.
    fn check_tier(&self, tiers: u8) -> ParseResult {
        let nothing = BlockStats { step: self.stats.step, ..Self::lost(self.id).stats };
        ensure(self.id.tier == 0 || self.stats == nothing, || "errors or a value range without samples".into())?;
        let is_coded = self.parts.iter().any(|part| matches!(part.kind, PartKind::Level(_)));
        let has_step = self.id.tier > 0 || tiers == 0 || self.stats.step > 0.0;
        ensure(has_step || !is_coded, || "coefficients without a step".into())
    }

    /// Checks that the parts of a block at `start` follow its header without a gap; returns its aligned end.
    pub(crate) fn check_place(&self, start: u64) -> ParseResult<u64> {
        let mut at = start.saturating_add(self.header_len());
        for part in &self.parts {
            ensure(part.offset == at, || format!("{} at byte {} instead of {at}", part.kind, part.offset))?;
            at = at.saturating_add(part.stored_len.into());
        }
        Ok(align(at))
    }
}

/// Bytes of a block's entry with so many parts.
pub(crate) fn entry_len(parts: usize) -> usize {
    BLOCK_ENTRY + PART_ENTRY * parts
}

/// As [`BlockEntry::begins_above`].
pub(crate) fn begins_above(id: BlockId, stats: BlockStats, is_exact: bool, tiers: u8) -> bool {
    id.tier < tiers && !is_exact && (id.tier > 0 || stats.step > 0.0)
}

impl PartEntry {
    /// Reads its stored bytes and checks their checksum.
    pub(crate) fn read(&self, storage: &impl Storage, file: FileId, block: BlockId) -> Result<Vec<u8>> {
        let section = SectionId::Part(block, self.kind);
        let range = self.offset..self.offset.saturating_add(self.stored_len.into());
        read_checked(storage, std::slice::from_ref(&range), || {
            let stored = read(storage, section, self.offset, self.stored_len.into())?;
            match section.checksum(file, &stored) == self.checksum {
                true => Ok(stored),
                false => Err(section.corrupt(self.offset, "the checksum does not match")),
            }
        })
    }

    fn encode(&self, out: &mut Vec<u8>) {
        out.put(&self.kind.code());
        out.put_u16(0);
        out.put_u32(self.stored_len);
        out.put_u32(self.raw_len);
        out.put_u32(0);
        out.put_u64(self.offset);
        out.put_u64(self.checksum);
        out.put_u64(self.stats.count);
        out.put_f64(self.stats.energy);
        out.put_f64(self.stats.largest);
    }

    fn decode(fields: &mut FieldReader<'_>) -> ParseResult<Self> {
        let code = fields.array()?;
        let kind = PartKind::from_code(code).ok_or_else(|| format!("an unknown kind of part, {code:?}"))?;
        fields.reserved::<2>()?;
        let (stored_len, raw_len) = (fields.u32()?, fields.u32()?);
        fields.reserved::<4>()?;
        let (offset, checksum) = (fields.u64()?, fields.u64()?);
        let stats = PartStats { count: fields.u64()?, energy: fields.f64()?, largest: fields.f64()? };
        Ok(Self { kind, stats, offset, stored_len, raw_len, checksum })
    }

    fn check(&self) -> ParseResult {
        let PartStats { count, energy, largest } = self.stats;
        let sane = count > 0 && is_amount(energy) && finite_amount(largest);
        ensure(sane, || format!("{}: count, energy or largest coefficient out of range", self.kind))?;
        let amounts = matches!(self.kind, PartKind::Level(_)) || [energy, largest].map(f64::to_bits) == [0; 2];
        ensure(amounts, || format!("{}: an energy or largest coefficient in a part without coefficients", self.kind))?;
        let sized = self.stored_len > 0 && self.raw_len > 0 && u64::from(self.raw_len) <= MAX_PART_RAW;
        ensure(sized, || format!("{}: a length out of range", self.kind))
    }
}
