//! Finds the changes of a block's decoded samples by which they keep what the file promises besides the bound.

use super::WindowCodec;
use super::field::Field;
use super::load::Source;
use super::refine::Coded;
use super::sides::CodedSides;
use wavesplat_format::SumCodes;

/// What moves the samples of a block.
#[derive(Default)]
pub(super) struct Mended {
    /// To sums of frames, if samples do not have them.
    pub(super) sums: Option<SumCodes>,
    /// To their sides, if not all are there.
    pub(super) sides: Option<CodedSides>,
}

impl WindowCodec {
    /// Whether decoded samples may have to move.
    pub(super) fn mends(&self) -> bool {
        self.sums || !self.sides.is_empty()
    }
}

impl Source<'_> {
    /// Finds what moves the samples of a coded block; `field` are its decoded coefficients. None if it must be stored exactly.
    pub(super) fn mend(&self, coded: &mut Coded, field: &Field<'_>) -> Option<Mended> {
        let sums = if self.codec.sums { Some(self.keep_sums(coded, field)?) } else { None };
        let sums = sums.filter(|sums| sums.count() > 0);
        let is_sided = !self.codec.sides.is_empty();
        let sides = if is_sided { self.sides(coded, field, sums.as_ref()) } else { None };
        Some(Mended { sums, sides })
    }
}
