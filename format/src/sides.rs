//! On which side of some values the samples of a block are, where decoded samples are on another.

use crate::bytes::{FieldReader, FieldWriter, ensure, finite_amount};
use crate::limits::MAX_SIDES;

/// Where a sample is relative to a value.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Side {
    /// It is less.
    Below,
    /// It equals the value.
    Equal,
    /// It is more.
    Above,
}

impl Side {
    /// All, by their number.
    pub const ALL: [Self; 3] = [Self::Below, Self::Equal, Self::Above];

    /// The side of a sample that is a number.
    pub fn of(sample: f64, value: f64) -> Self {
        match () {
            () if sample < value => Self::Below,
            () if sample > value => Self::Above,
            () => Self::Equal,
        }
    }
}

/// Which sides occur.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct SideSet(u8);

impl SideSet {
    /// Adds a side.
    pub fn insert(&mut self, side: Side) {
        self.0 |= 1 << side as u8;
    }

    /// Whether a side occurs.
    pub fn has(self, side: Side) -> bool {
        self.0 >> side as u8 & 1 == 1
    }

    /// The sides that occur, but one.
    pub fn without(self, side: Side) -> impl Iterator<Item = Side> {
        Side::ALL.into_iter().filter(move |other| *other != side && self.has(*other))
    }
}

/// How the samples of a block get to their sides of a value.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct SideCodes {
    /// The sides that samples of the source have; empty if no decoded sample changes its side.
    pub sides: SideSet,
    /// No decoded sample that changes its side is further away from the value.
    pub reach: f64,
    /// A bit or two for each decoded sample that is so near, as [`BitEncoder`](crate::BitEncoder) writes them.
    pub bits: Vec<u8>,
}

/// Packs the codes of a block for each value.
pub fn pack_sides(codes: &[SideCodes], out: &mut Vec<u8>) {
    for of_value in codes {
        out.push(of_value.sides.0);
        if of_value.sides != SideSet::default() {
            out.put_f64(of_value.reach);
            out.put_u32(of_value.bits.len() as u32);
            out.extend(&of_value.bits);
        }
    }
}

/// Unpacks what [`pack_sides`] packed, for a block of so many samples.
///
/// # Errors
/// The reason, if that is impossible.
pub fn unpack_sides(raw: &[u8], samples: usize) -> Result<Vec<SideCodes>, String> {
    let (mut fields, mut found) = (FieldReader::new(raw), Vec::new());
    while fields.remaining() > 0 {
        ensure(found.len() < MAX_SIDES, || format!("sides of more than {MAX_SIDES} values"))?;
        let [sides] = fields.array()?;
        ensure(sides < 1 << Side::ALL.len(), || format!("sides {sides}"))?;
        let mut codes = SideCodes { sides: SideSet(sides), ..SideCodes::default() };
        if sides > 0 {
            codes.reach = fields.f64()?;
            ensure(finite_amount(codes.reach), || format!("a reach of {}", codes.reach))?;
            let len = fields.u32()? as usize;
            ensure(len <= most_bits(samples), || format!("{len} bytes of bits for {samples} samples"))?;
            codes.bits = fields.take(len)?.to_vec();
        }
        found.push(codes);
    }
    ensure(!found.is_empty(), || "sides of no value".into())?;
    Ok(found)
}

/// The most bytes of a payload for so many samples.
pub(crate) fn max_sides(samples: usize) -> usize {
    MAX_SIDES * (FIELDS + most_bits(samples))
}

/// The most bytes of the bits of a value: a bit costs no more than 12.
fn most_bits(samples: usize) -> usize {
    3 * samples + 8
}

/// Bytes of the codes of a value without its bits.
const FIELDS: usize = 13;
