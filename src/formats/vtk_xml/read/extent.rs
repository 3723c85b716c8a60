//! Boxes of a lattice by their first and last points, and whether boxes cover a larger one.

use wavesplat_core::source::Parsed;

/// First and last point along x, y, z.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(super) struct Extent(pub(super) [i64; 6]);

impl Extent {
    /// First and last point along an axis.
    pub(super) fn ends(&self, axis: usize) -> (i64, i64) {
        (self.0[2 * axis], self.0[2 * axis + 1])
    }

    /// Whether it has no point. VTK writes empty pieces in this way.
    pub(super) fn is_empty(&self) -> bool {
        [0, 1, 2].map(|axis| self.ends(axis)).iter().any(|(first, last)| first > last)
    }

    /// Points along x, y, z.
    pub(super) fn points(&self) -> Parsed<[usize; 3]> {
        let mut points = [0; 3];
        for (axis, points) in points.iter_mut().enumerate() {
            let (first, last) = self.ends(axis);
            let count = last.checked_sub(first).and_then(|n| n.checked_add(1)).filter(|n| *n > 0);
            let count = count.and_then(|n| usize::try_from(n).ok());
            *points = count.ok_or_else(|| format!("extent {:?} is empty", self.0))?;
        }
        Ok(points)
    }

    /// The first point counted from that of the whole, if both ends are within it.
    pub(super) fn start_in(&self, whole: &Self) -> Option<[usize; 3]> {
        let within = |axis| whole.ends(axis).0 <= self.ends(axis).0 && self.ends(axis).1 <= whole.ends(axis).1;
        let start = |axis| (self.ends(axis).0 - whole.ends(axis).0) as usize;
        [0, 1, 2].into_iter().all(within).then(|| [0, 1, 2].map(start))
    }

    /// Cells along an axis; an axis on which the whole has one point has one.
    fn cells(&self, whole: &Self, axis: usize) -> u128 {
        let flat = whole.ends(axis).0 == whole.ends(axis).1;
        if flat { 1 } else { (self.ends(axis).1 - self.ends(axis).0) as u128 }
    }

    /// Whether it has any cell.
    pub(super) fn has_cells(&self, whole: &Self) -> bool {
        [0, 1, 2].into_iter().all(|axis| self.cells(whole, axis) > 0)
    }

    fn volume(&self, whole: &Self) -> u128 {
        [0, 1, 2].map(|axis| self.cells(whole, axis)).iter().fold(1, |volume: u128, n| volume.saturating_mul(*n))
    }

    /// Whether two boxes have cells in common.
    fn overlaps(&self, other: &Self, whole: &Self) -> bool {
        let along = |axis| {
            let ((a, b), (c, d)) = (self.ends(axis), other.ends(axis));
            whole.ends(axis).0 == whole.ends(axis).1 || (a < d && c < b)
        };
        [0, 1, 2].into_iter().all(along)
    }
}

/// Checks that boxes, all within the whole and with cells, have each of its cells once.
pub(super) fn check_pieces(whole: &Extent, pieces: &[Extent]) -> Parsed<()> {
    if let [only] = pieces
        && only != whole
    {
        return Err(format!("has the piece {:?} of the whole {:?} only", only.0, whole.0));
    }
    let volume = pieces.iter().fold(0, |volume: u128, piece| volume.saturating_add(piece.volume(whole)));
    if volume < whole.volume(whole) {
        return Err(format!("has pieces that leave some of the whole {:?} out", whole.0));
    }
    for (i, piece) in pieces.iter().enumerate() {
        if let Some(other) = pieces[..i].iter().find(|other| other.overlaps(piece, whole)) {
            let hint = "write them without ghost levels";
            return Err(format!("has pieces that overlap, {:?} and {:?}; {hint}", other.0, piece.0));
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pieces_must_have_each_cell_once() {
        let whole = Extent([0, 6, 0, 4, 2, 2]);
        let [left, right] = [Extent([0, 3, 0, 4, 2, 2]), Extent([3, 6, 0, 4, 2, 2])];
        assert_eq!(check_pieces(&whole, &[whole]), Ok(()));
        assert_eq!(check_pieces(&whole, &[left, right]), Ok(()));
        let words = |pieces: &[Extent], words: &str| {
            let error = check_pieces(&whole, pieces).expect_err("not the whole");
            assert!(error.contains(words), "{error}");
        };
        words(&[left], "only");
        words(&[left, Extent([4, 6, 0, 4, 2, 2])], "leave some");
        words(&[left, Extent([2, 6, 0, 4, 2, 2])], "overlap");
        words(&[left, left], "overlap");
    }
}
