//! What the header of a NIfTI says: 348 bytes in version 1, 540 in version 2, in either byte order.

use crate::source::Parsed;
use crate::source::formats::shared::directions::Directions;

/// Bytes of the longest header.
pub(super) const LONGEST: usize = SECOND;

const FIRST: usize = 348;
const SECOND: usize = 540;

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
    /// Quaternion b, c, d and offset x, y, z.
    qform: [f64; 6],
    /// Rows of an affine matrix.
    sform: [f64; 12],
    pub(super) intent_name: String,
}

/// Whether a file may start so.
pub(in crate::source) fn is_nifti(head: &[u8]) -> bool {
    Fields::of(head).is_ok_and(|fields| fields.pair().is_ok())
}

impl NiftiHeader {
    /// Reads a header that these bytes start with.
    pub(super) fn parse(bytes: &[u8]) -> Parsed<Self> {
        let fields = Fields::of(bytes)?;
        let pair = fields.pair()?;
        Ok(if fields.bytes.len() == FIRST { fields.first(pair) } else { fields.second(pair) })
    }

    /// Where voxels are in the world: by the sform, else by the qform, else by the steps alone.
    pub(super) fn directions(&self) -> Directions {
        let steps = [1, 2, 3].map(|axis| step(self.pixdim[axis]));
        match (self.sform_code > 0, self.qform_code > 0) {
            (true, _) => {
                let row = |row: usize, column: usize| self.sform[4 * row + column];
                let steps = [0, 1, 2].map(|column| [0, 1, 2].map(|r| row(r, column)));
                Directions::of_steps(steps, [0, 1, 2].map(|r| row(r, 3)))
            }
            (false, true) => self.by_quaternion(steps),
            (false, false) => {
                let along = |axis: usize| std::array::from_fn(|a| if a == axis { steps[axis] } else { 0.0 });
                Directions::of_steps([0, 1, 2].map(along), [0.0; 3])
            }
        }
    }

    fn by_quaternion(&self, steps: [f64; 3]) -> Directions {
        let [b, c, d, ..] = self.qform;
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
        let [.., x, y, z] = self.qform;
        Directions::of_steps(steps, [x, y, z])
    }
}

/// A step as others read it: without a sign, and 1 if there is none.
fn step(pixdim: f64) -> f64 {
    if pixdim.is_finite() && pixdim != 0.0 { pixdim.abs() } else { 1.0 }
}

/// Numbers at known places, in the byte order of the file.
#[derive(Clone, Copy)]
struct Fields<'a> {
    bytes: &'a [u8],
    big_endian: bool,
}

impl<'a> Fields<'a> {
    /// The header by its first number, which is its own length.
    fn of(head: &'a [u8]) -> Parsed<Self> {
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
    fn pair(&self) -> Parsed<bool> {
        let (at, version, rest) =
            if self.bytes.len() == FIRST { (344, b'1', &b""[..]) } else { (4, b'2', &b"\r\n\x1a\n"[..]) };
        let magic = &self.bytes[at..];
        match [magic[0], magic[1], magic[2], magic[3]] {
            _ if !magic[4..].starts_with(rest) => Err("was changed on its way as if it were text".into()),
            [b'n', b'+', v, 0] if v == version => Ok(false),
            [b'n', b'i', v, 0] if v == version => Ok(true),
            _ => Err("has no magic bytes of NIfTI; ANALYZE files are not supported".into()),
        }
    }

    fn bytes<const N: usize>(&self, at: usize) -> [u8; N] {
        let mut bytes = [0; N];
        bytes.copy_from_slice(&self.bytes[at..][..N]);
        if self.big_endian {
            bytes.reverse();
        }
        bytes
    }

    fn i16(&self, at: usize) -> i64 {
        i16::from_le_bytes(self.bytes(at)).into()
    }

    fn i32(&self, at: usize) -> i64 {
        i32::from_le_bytes(self.bytes(at)).into()
    }

    fn f32(&self, at: usize) -> f64 {
        f32::from_le_bytes(self.bytes(at)).into()
    }

    fn f64(&self, at: usize) -> f64 {
        f64::from_le_bytes(self.bytes(at))
    }

    fn text(&self, at: usize, len: usize) -> String {
        let bytes = self.bytes[at..][..len].split(|b| *b == 0).next().unwrap_or_default();
        String::from_utf8_lossy(bytes).trim().to_string()
    }

    fn first(&self, pair: bool) -> NiftiHeader {
        NiftiHeader {
            big_endian: self.big_endian,
            pair,
            len: FIRST,
            dim: std::array::from_fn(|i| self.i16(40 + 2 * i)),
            datatype: self.i16(70),
            pixdim: std::array::from_fn(|i| self.f32(76 + 4 * i)),
            vox_offset: self.f32(108),
            slope: self.f32(112),
            inter: self.f32(116),
            toffset: self.f32(136),
            units: self.bytes[123].into(),
            qform_code: self.i16(252),
            sform_code: self.i16(254),
            qform: std::array::from_fn(|i| self.f32(256 + 4 * i)),
            sform: std::array::from_fn(|i| self.f32(280 + 4 * i)),
            intent_name: self.text(328, 16),
        }
    }

    fn second(&self, pair: bool) -> NiftiHeader {
        NiftiHeader {
            big_endian: self.big_endian,
            pair,
            len: SECOND,
            dim: std::array::from_fn(|i| i64::from_le_bytes(self.bytes(16 + 8 * i))),
            datatype: self.i16(12),
            pixdim: std::array::from_fn(|i| self.f64(104 + 8 * i)),
            vox_offset: i64::from_le_bytes(self.bytes(168)) as f64,
            slope: self.f64(176),
            inter: self.f64(184),
            toffset: self.f64(216),
            units: self.i32(500),
            qform_code: self.i32(344),
            sform_code: self.i32(348),
            qform: std::array::from_fn(|i| self.f64(352 + 8 * i)),
            sform: std::array::from_fn(|i| self.f64(400 + 8 * i)),
            intent_name: self.text(508, 16),
        }
    }
}
