//! Stand-in until the lattice codes are packed in cells.
use crate::payload::{pack_codes, unpack_codes};

/// Appends the packed codes of boxes.
pub fn pack_cells(codes: &[i32], _boxes: &[[usize; 4]], out: &mut Vec<u8>) {
    pack_codes(codes, out);
}

/// Fills `codes`.
pub fn unpack_cells(raw: &[u8], _boxes: &[[usize; 4]], codes: &mut [i32]) -> Result<usize, String> {
    unpack_codes(raw, codes)
}

/// An upper bound of the packed bytes.
pub fn max_packed(boxes: &[[usize; 4]]) -> usize {
    64 + 5 * boxes.iter().map(|b| b.iter().product::<usize>()).sum::<usize>()
}
