//! The header of a NIfTI: that of the source, if it was one, with what extraction changes; else a new one. Version 1,
//! or version 2 if the source or a length needs it.

use super::contents::{Contents, Lattice};
use crate::base::description::{LPS, NIFTI_HEADER, Values};
use crate::base::sample::SampleType;
use std::io::{self, Write};

/// Bytes between the header and the samples: there are no extensions.
const GAP: usize = 4;

/// Bytes of the header of version 1.
const FIRST: usize = 348;

/// Bytes of the header of version 2.
const SECOND: usize = 540;

/// The longest axis that version 1 can say.
const LONGEST_OF_FIRST: usize = i16::MAX as usize;

/// Axes that are known to be aligned with something.
const ALIGNED: i32 = 2;

/// Steps whose relative difference is less than this are equal up to rounding.
const SAME_STEP: f64 = 1e-5;

/// Whether the samples have their most significant byte first, as in the source.
pub(super) fn is_big_endian(contents: &Contents) -> bool {
    source_header(contents).is_some_and(|bytes| bytes[0] == 0)
}

/// Writes the header.
pub(super) fn write_header(contents: &Contents, ty: SampleType, out: &mut impl Write) -> io::Result<()> {
    let mut header = NiftiBytes::new(contents);
    header.set_samples(contents, ty);
    header.set_places(contents);
    out.write_all(&header.bytes)?;
    out.write_all(&[0; GAP])
}

/// The header of the source, if it was a NIfTI.
fn source_header(contents: &Contents) -> Option<Vec<u8>> {
    let global = &contents.description.as_ref()?.global;
    match &global.iter().find(|attribute| attribute.name == NIFTI_HEADER)?.value {
        Values::Numbers(numbers) => Some(numbers.bytes()).filter(|bytes| matches!(bytes.len(), FIRST | SECOND)),
        Values::Texts(_) | Values::Times(_) => None,
    }
}

/// The bytes of a header.
struct NiftiBytes {
    bytes: Vec<u8>,
    big_endian: bool,
}

/// Offsets of fields in versions 1 and 2.
struct Places {
    datatype: usize,
    dim: usize,
    pixdim: usize,
    vox_offset: usize,
    slope: usize,
    toffset: usize,
    units: usize,
    qform_code: usize,
    qoffset: usize,
    sform: usize,
    intent_name: usize,
}

const OF_FIRST: Places = Places {
    datatype: 70,
    dim: 40,
    pixdim: 76,
    vox_offset: 108,
    slope: 112,
    toffset: 136,
    units: 123,
    qform_code: 252,
    qoffset: 268,
    sform: 280,
    intent_name: 328,
};

const OF_SECOND: Places = Places {
    datatype: 12,
    dim: 16,
    pixdim: 104,
    vox_offset: 168,
    slope: 176,
    toffset: 216,
    units: 500,
    qform_code: 344,
    qoffset: 376,
    sform: 400,
    intent_name: 508,
};

impl NiftiBytes {
    /// The header of the source, or an empty one.
    fn new(contents: &Contents) -> Self {
        let long = contents.lattice().dims.iter().chain([&contents.frames.len()]).any(|n| *n > LONGEST_OF_FIRST);
        let own = source_header(contents).filter(|bytes| bytes.len() == SECOND || !long);
        let is_new = own.is_none();
        let bytes = own.unwrap_or_else(|| vec![0; if long { SECOND } else { FIRST }]);
        let mut header = Self { big_endian: bytes[0] == 0 && !is_new, bytes };
        header.set_magic();
        if is_new {
            header.set_new(contents);
        }
        header
    }

    fn is_first(&self) -> bool {
        self.bytes.len() == FIRST
    }

    fn places(&self) -> Places {
        if self.is_first() { OF_FIRST } else { OF_SECOND }
    }

    fn set_magic(&mut self) {
        self.put(0, (self.bytes.len() as i32).to_le_bytes());
        match self.is_first() {
            true => self.bytes[344..348].copy_from_slice(b"n+1\0"),
            false => self.bytes[4..12].copy_from_slice(b"n+2\0\r\n\x1a\n"),
        }
    }

    /// What a source of another format says: the units, and the name of the variable.
    fn set_new(&mut self, contents: &Contents) {
        let places = self.places();
        self.bytes[places.units] = units(contents);
        let name = &contents.name[..contents.name.floor_char_boundary(15)];
        self.bytes[places.intent_name..][..name.len()].copy_from_slice(name.as_bytes());
        self.set_real(places.pixdim, 0, 1.0); // the hand of a qform, which is not used
        self.set_sform_code(ALIGNED);
    }

    fn set_sform_code(&mut self, code: i32) {
        let at = self.places().qform_code;
        match self.is_first() {
            true => self.put(at + 2, (code as i16).to_le_bytes()),
            false => self.put(at + 4, code.to_le_bytes()),
        }
    }

    fn sform_code(&self) -> i32 {
        let at = self.places().qform_code;
        match self.is_first() {
            true => i16::from_le_bytes(self.get(at + 2)).into(),
            false => i32::from_le_bytes(self.get(at + 4)),
        }
    }

    fn qform_code(&self) -> i32 {
        let at = self.places().qform_code;
        match self.is_first() {
            true => i16::from_le_bytes(self.get(at)).into(),
            false => i32::from_le_bytes(self.get(at)),
        }
    }

    /// Numbers and type of the samples, which are stored as they are.
    fn set_samples(&mut self, contents: &Contents, ty: SampleType) {
        let (places, [x, y, z]) = (self.places(), contents.lattice().dims);
        let frames = contents.frames.len();
        let lengths = [if frames == 1 { 3 } else { 4 }, x, y, z, frames, 1, 1, 1];
        for (i, length) in lengths.into_iter().enumerate() {
            match self.is_first() {
                true => self.put(places.dim + 2 * i, (length as i16).to_le_bytes()),
                false => self.put(places.dim + 8 * i, (length as i64).to_le_bytes()),
            }
        }
        self.put(places.datatype, datatype(ty).to_le_bytes());
        self.put(places.datatype + 2, (8 * ty.size() as i16).to_le_bytes());
        let start = self.bytes.len() + GAP;
        match self.is_first() {
            true => self.put(places.vox_offset, (start as f32).to_le_bytes()),
            false => self.put(places.vox_offset, (start as i64).to_le_bytes()),
        }
        self.set_real(places.slope, 0, 1.0);
        self.set_real(places.slope, 1, 0.0);
    }

    /// Where voxels and frames are. A header whose places are right stays as it is.
    fn set_places(&mut self, contents: &Contents) {
        let (places, lattice) = (self.places(), in_ras(contents.lattice()));
        for (axis, spacing) in lattice.spacing().into_iter().enumerate() {
            if (self.real(places.pixdim, axis + 1) / spacing - 1.0).abs() > SAME_STEP {
                self.set_real(places.pixdim, axis + 1, spacing);
            }
        }
        if let Some((first, step)) = contents.regular_times() {
            self.set_real(places.pixdim, 4, step);
            self.set_real(places.toffset, 0, first);
        }
        if self.sform_code() > 0 {
            self.set_sform(&lattice);
        } else if self.qform_code() > 0 {
            (0..3).for_each(|axis| self.set_real(places.qoffset, axis, lattice.first[axis]));
        }
    }

    /// Sets the sform, and moves the qform by as much.
    fn set_sform(&mut self, lattice: &Lattice) {
        let places = self.places();
        for row in 0..3 {
            let moved = lattice.first[row] - self.real(places.sform, 4 * row + 3);
            let offset = self.real(places.qoffset, row);
            if moved != 0.0 && self.qform_code() > 0 {
                self.set_real(places.qoffset, row, offset + moved);
            }
            for column in 0..3 {
                self.set_real(places.sform, 4 * row + column, lattice.steps()[column][row]);
            }
            self.set_real(places.sform, 4 * row + 3, lattice.first[row]);
        }
    }

    fn size_of_real(&self) -> usize {
        if self.is_first() { 4 } else { 8 }
    }

    /// The number at `index` of an array of floating-point numbers.
    fn real(&self, at: usize, index: usize) -> f64 {
        let at = at + self.size_of_real() * index;
        match self.is_first() {
            true => f32::from_le_bytes(self.get(at)).into(),
            false => f64::from_le_bytes(self.get(at)),
        }
    }

    /// Sets a number unless the field says it as exactly as it can.
    fn set_real(&mut self, at: usize, index: usize, number: f64) {
        let old = self.real(at, index);
        if old == number || (old - number).abs() <= f64::from(f32::EPSILON) * number.abs() && self.is_first() {
            return;
        }
        let at = at + self.size_of_real() * index;
        match self.is_first() {
            true => self.put(at, (number as f32).to_le_bytes()),
            false => self.put(at, number.to_le_bytes()),
        }
    }

    fn put<const N: usize>(&mut self, at: usize, mut bytes: [u8; N]) {
        if self.big_endian {
            bytes.reverse();
        }
        self.bytes[at..at + N].copy_from_slice(&bytes);
    }

    fn get<const N: usize>(&self, at: usize) -> [u8; N] {
        let mut bytes = [0; N];
        bytes.copy_from_slice(&self.bytes[at..at + N]);
        if self.big_endian {
            bytes.reverse();
        }
        bytes
    }
}

/// A lattice in the world of NIfTI. A world without a name is taken as that.
fn in_ras(lattice: Lattice) -> Lattice {
    if lattice.space == LPS { lattice.turned() } else { lattice }
}

/// The code of the units of space and time; 0 for others.
fn units(contents: &Contents) -> u8 {
    let space = match contents.space_units.as_deref() {
        Some("m" | "metre" | "meter") => 1,
        Some("mm") => 2,
        Some("um" | "\u{b5}m") => 3,
        _ => 0,
    };
    let time = match contents.time_units.as_deref() {
        Some("s" | "sec" | "seconds") => 8,
        Some("ms") => 16,
        Some("us" | "\u{b5}s") => 24,
        _ => 0,
    };
    space | time
}

fn datatype(ty: SampleType) -> i16 {
    match ty {
        SampleType::U8 => 2,
        SampleType::I16 => 4,
        SampleType::I32 => 8,
        SampleType::F16 | SampleType::F32 => 16,
        SampleType::F64 => 64,
        SampleType::I8 => 256,
        SampleType::U16 => 512,
        SampleType::U32 => 768,
    }
}

#[cfg(test)]
mod tests {
    use super::super::contents::testing::contents;
    use super::*;

    fn written(contents: &Contents) -> NiftiBytes {
        let mut bytes = Vec::new();
        write_header(contents, SampleType::I16, &mut bytes).expect("written");
        bytes.truncate(bytes.len() - GAP);
        NiftiBytes { bytes, big_endian: false }
    }

    #[test]
    fn a_new_header_says_lengths_places_and_units() {
        let header = written(&contents());
        assert_eq!((header.bytes.len(), header.bytes[123]), (FIRST, 10));
        let dim = |i: usize| i16::from_le_bytes(header.get(40 + 2 * i));
        assert_eq!([0, 1, 2, 3, 4].map(dim), [4, 5, 4, 3, 3]);
        assert_eq!([1, 2, 3, 4].map(|i| header.real(76, i)), [0.5, 2.0, 1.0, 0.25]);
        assert_eq!((header.sform_code(), header.real(280, 3), header.real(280, 11)), (ALIGNED, -1.0, 7.5));
        let mut long = contents();
        long.grid.dims[0] = LONGEST_OF_FIRST + 1;
        let header = written(&long);
        assert_eq!((header.bytes.len(), header.real(400, 3)), (SECOND, -1.0));
    }
}
