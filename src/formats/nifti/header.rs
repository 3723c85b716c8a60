//! The header of a NIfTI.

use super::layout::{FIRST, NiftiBytes, SECOND};
use crate::shared::directions::Directions;
use wavesplat_core::source::Parsed;

/// Bytes of the longest header.
pub(super) const LONGEST: usize = SECOND;

/// A header, as it is written.
#[derive(Debug)]
pub(super) struct NiftiHeader {
    pub(super) big_endian: bool,
    /// Whether the samples are in another file.
    pub(super) pair: bool,
    /// Bytes of the header itself.
    pub(super) len: usize,
    /// The number of axes, and their lengths.
    pub(super) dim: [i64; 8],
    pub(super) datatype: i64,
    /// The hand of the axes, and the steps along each.
    pub(super) pixdim: [f64; 8],
    /// Where the samples start.
    pub(super) vox_offset: f64,
    pub(super) slope: f64,
    pub(super) inter: f64,
    /// Time of the first frame.
    pub(super) toffset: f64,
    /// Codes of the units of space and time.
    pub(super) units: i64,
    qform_code: i64,
    sform_code: i64,
    /// Quaternion b, c, d.
    quaternion: [f64; 3],
    qoffset: [f64; 3],
    /// Rows of an affine matrix.
    sform: [f64; 12],
    pub(super) intent_name: String,
}

/// Whether a file may start so.
pub(crate) fn is_nifti(head: &[u8]) -> bool {
    NiftiBytes::at_start(head).is_ok_and(|header| header.is_pair().is_ok())
}

impl NiftiHeader {
    /// Reads a header that these bytes start with.
    pub(super) fn parse(bytes: &[u8]) -> Parsed<Self> {
        let header = NiftiBytes::at_start(bytes)?;
        let at = header.offsets();
        Ok(Self {
            big_endian: header.big_endian,
            pair: header.is_pair()?,
            len: header.bytes.len(),
            dim: std::array::from_fn(|i| header.length(at.dim, i)),
            datatype: i16::from_le_bytes(header.get(at.datatype)).into(),
            pixdim: std::array::from_fn(|i| header.real(at.pixdim, i)),
            vox_offset: match header.is_first() {
                true => header.real(at.vox_offset, 0),
                false => header.length(at.vox_offset, 0) as f64,
            },
            slope: header.real(at.slope, 0),
            inter: header.real(at.slope, 1),
            toffset: header.real(at.toffset, 0),
            units: if header.is_first() { header.bytes[at.units].into() } else { header.code(at.units, 0) },
            qform_code: header.code(at.form_codes, 0),
            sform_code: header.code(at.form_codes, 1),
            quaternion: std::array::from_fn(|i| header.real(at.quaternion, i)),
            qoffset: std::array::from_fn(|i| header.real(at.qoffset, i)),
            sform: std::array::from_fn(|i| header.real(at.sform, i)),
            intent_name: header.text(at.intent_name, 16),
        })
    }

    /// Where voxels are in the world: by the sform, else by the qform, else by the steps alone.
    pub(super) fn directions(&self) -> Directions {
        let steps = [1, 2, 3].map(|axis| step(self.pixdim[axis]));
        match (self.sform_code > 0, self.qform_code > 0) {
            (true, _) => {
                let row = |row: usize, column: usize| self.sform[4 * row + column];
                let steps = [0, 1, 2].map(|column| [0, 1, 2].map(|r| row(r, column)));
                Directions::from_steps(steps, [0, 1, 2].map(|r| row(r, 3)))
            }
            (false, true) => self.by_quaternion(steps),
            (false, false) => {
                let along = |axis: usize| std::array::from_fn(|a| if a == axis { steps[axis] } else { 0.0 });
                Directions::from_steps([0, 1, 2].map(along), [0.0; 3])
            }
        }
    }

    fn by_quaternion(&self, steps: [f64; 3]) -> Directions {
        let [b, c, d] = self.quaternion;
        let rest = 1.0 - (b * b + c * c + d * d);
        // A quaternion of rounded numbers may be longer than 1, and is then half a turn.
        let (length, a) = if rest < 1e-7 { ((1.0 - rest).sqrt(), 0.0) } else { (1.0, rest.sqrt()) };
        let [b, c, d] = [b, c, d].map(|n| n / length);
        let hand = if self.pixdim[0] < 0.0 { -1.0 } else { 1.0 };
        let columns = [
            [a * a + b * b - c * c - d * d, 2.0 * (b * c + a * d), 2.0 * (b * d - a * c)],
            [2.0 * (b * c - a * d), a * a + c * c - b * b - d * d, 2.0 * (c * d + a * b)],
            [2.0 * (b * d + a * c), 2.0 * (c * d - a * b), a * a + d * d - b * b - c * c].map(|n| n * hand),
        ];
        let steps = std::array::from_fn(|axis| columns[axis].map(|n: f64| n * steps[axis]));
        Directions::from_steps(steps, self.qoffset)
    }
}

/// A step as others read it: without a sign, and 1 if there is none.
fn step(pixdim: f64) -> f64 {
    if pixdim.is_finite() && pixdim != 0.0 { pixdim.abs() } else { 1.0 }
}

impl<'a> NiftiBytes<&'a [u8]> {
    /// The header by its first number, which is its own length.
    fn at_start(head: &'a [u8]) -> Parsed<Self> {
        for len in [FIRST, SECOND] {
            for big_endian in [false, true] {
                let said = (len as u32).to_le_bytes();
                let said = if big_endian { [said[3], said[2], said[1], said[0]] } else { said };
                if head.starts_with(&said) {
                    let bytes =
                        head.get(..len).ok_or_else(|| format!("ends inside its NIfTI header of {len} bytes"))?;
                    return Ok(Self { bytes, big_endian });
                }
            }
        }
        Err("does not start as a NIfTI file does".into())
    }

    /// Whether the magic bytes say that samples are in another file.
    fn is_pair(&self) -> Parsed<bool> {
        let (at, expected) = self.offsets().magic;
        let (found, rest) = self.bytes[at..].split_at(4);
        match found {
            _ if !rest.starts_with(&expected[4..]) => Err("was changed on its way as if it were text".into()),
            found if found == &expected[..4] => Ok(false),
            [b'n', b'i', after @ ..] if after == &expected[2..4] => Ok(true),
            _ => Err("has no magic bytes of NIfTI; ANALYZE files are not supported".into()),
        }
    }

    fn text(&self, at: usize, len: usize) -> String {
        let bytes = self.bytes[at..][..len].split(|b| *b == 0).next().unwrap_or_default();
        String::from_utf8_lossy(bytes).trim().to_string()
    }
}
