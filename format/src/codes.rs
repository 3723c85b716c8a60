//! Quantised codes on lattices.
//!
//! Few codes are not zero. [`cells`] packs them, [`sparse`] lists them.

mod cells;
pub(crate) mod sparse;
mod values;

use crate::bytes::ensure;
use crate::pyramid::Packing;
use crate::segments::Heads;
use sparse::{CodeBox, DenseCodes, SparseCodes};

/// Number of codes in a box.
fn volume(extents: &[usize; 4]) -> usize {
    extents.iter().fold(1, |product, &extent| product.saturating_mul(extent))
}

/// Number of codes in all boxes.
pub(crate) fn volumes(boxes: &[CodeBox]) -> usize {
    boxes.iter().map(|of| volume(&of.extents)).fold(0, usize::saturating_add)
}

/// Upper bound on the packed bytes of boxes.
pub fn max_packed(boxes: &[CodeBox]) -> usize {
    cells::max_packed(boxes)
}

impl Packing {
    /// Packs the codes of several boxes.
    pub fn pack(self, boxes: &[DenseCodes<'_>], out: &mut Vec<u8>) {
        cells::pack_cells(boxes, self.heads(), out);
    }

    /// Estimates how many bytes [`Self::pack`] appends.
    pub fn estimate(self, boxes: &[DenseCodes<'_>]) -> usize {
        cells::estimate_cells(boxes)
    }

    /// Appends the codes of all boxes that are not zero; returns how many they are. Codes that are [not needed](CodeBox::needed) may be
    /// left out, but count.
    ///
    /// # Errors
    /// The reason if `raw` does not follow the format, or a place does not fit in 32 bits.
    pub fn unpack(self, raw: &[u8], boxes: &[CodeBox], codes: &mut SparseCodes) -> Result<usize, String> {
        cells::unpack_cells(raw, boxes, self.heads(), codes)
    }

    /// Fills `codes` with all codes of contiguous boxes, one box after another; returns how many are not zero.
    ///
    /// # Errors
    /// As [`Self::unpack`], and if `codes` does not have the length that `boxes` require.
    pub fn unpack_all(self, raw: &[u8], boxes: &[CodeBox], codes: &mut [i32]) -> Result<usize, String> {
        let total = volumes(boxes);
        ensure(total == codes.len(), || format!("boxes of {total} codes instead of {}", codes.len()))?;
        let mut sparse = SparseCodes::default();
        let count = self.unpack(raw, boxes, &mut sparse)?;
        sparse.fill(boxes, codes);
        Ok(count)
    }

    fn heads(self) -> Heads {
        match self {
            Self::Flat => Heads::Narrow,
            Self::Nested => Heads::Wide,
        }
    }
}
