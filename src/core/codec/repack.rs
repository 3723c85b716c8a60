//! Packs the codes of a block anew, without decoding to samples: no value changes.

use super::WindowCodec;
use super::codes::Codes;
use super::decode::Block;
use super::encode::Encoder;
use super::field::{Field, Stored};
use wavesplat_format::{BlockEntry, EncodedBlock, EncodedPart, PartKind, Pyramid, Reader, Result, Storage};

impl Encoder {
    /// Repacks a block of `size` voxels from the codec `from` to the codec `to`. The schemes may differ only in their
    /// packing.
    ///
    /// # Errors
    /// Those of reading the block.
    pub fn repack<S: Storage>(
        &mut self,
        reader: &Reader<S>,
        from: &WindowCodec,
        to: &WindowCodec,
        size: [usize; 3],
        entry: &BlockEntry,
    ) -> Result<EncodedBlock> {
        let mut parts = Vec::new();
        // Parts of windows with tiers are packed in the newest way.
        let is_packed_anew =
            |kind| to.scheme.pyramid.is_some() && to.tiers() == 0 && matches!(kind, PartKind::Level(_));
        for part in entry.parts.iter().filter(|part| !is_packed_anew(part.kind)) {
            let raw = reader.part(entry, part)?;
            parts.push(self.part(part.kind, part.stats, &raw)?);
        }
        if let Some(pyramid) = &to.scheme.pyramid
            && entry.parts.iter().any(|part| is_packed_anew(part.kind))
        {
            let block = Block::read(reader, from, entry, size, &vec![true; from.basis.coefficients()], None, None)?;
            parts.extend(self.level_parts(to, pyramid, size, block.step, &block.all_codes(from))?);
        }
        parts.sort_by_key(|part| part.kind);
        Ok(EncodedBlock { id: entry.id, stats: entry.stats, parts })
    }

    /// The level parts of a pyramid, from all codes.
    fn level_parts(
        &mut self,
        codec: &WindowCodec,
        pyramid: &Pyramid,
        size: [usize; 3],
        step: f64,
        codes: &[i32],
    ) -> Result<Vec<EncodedPart>> {
        let passes = codec.passes(pyramid, size);
        let listed = Codes::Sparse(passes.list(codes));
        let of = Stored { size, step, codes: &listed, above: None, part: None };
        let field = Field::refined(codec, of, &vec![true; codec.basis.coefficients()]);
        let listed = listed.sparse();
        let changes = field.changes(&passes, step, listed, None, field.marked());
        let mut parts = Vec::new();
        for (part, change) in (0..).zip(&changes) {
            let count = passes.count(part, listed);
            if count > 0 {
                let mut raw = Vec::new();
                pyramid.packing.pack(&passes.part_of(part, codes), &mut raw);
                parts.push(self.part(PartKind::Level(part), change.stats(count), &raw)?);
            }
        }
        Ok(parts)
    }
}
