//! The header of a NIfTI: that of the source, if it was one, with what extraction changes; else a new one. Version 1,
//! or version 2 if the source or a length needs it.

use super::layout::{DATATYPES, FIRST, NiftiBytes, SECOND, SPACE_UNITS, TIME_UNITS};
use crate::contents::{Contents, Lattice};
use std::io::{self, Write};
use wavesplat_core::base::description::{LPS, NIFTI_HEADER, Values};
use wavesplat_core::base::sample::SampleType;

/// Bytes between the header and the samples: there are no extensions.
const GAP: usize = 4;

/// The longest axis that version 1 can store.
const LONGEST_OF_FIRST: usize = i16::MAX as usize;

/// Axes that are known to be aligned with something.
const ALIGNED: i64 = 2;

/// Steps whose relative difference is less than this are equal up to rounding.
const SAME_STEP: f64 = 1e-5;

/// Whether the samples have their most significant byte first, as in the source.
pub(super) fn is_big_endian(contents: &Contents) -> bool {
    source_header(contents).is_some_and(|bytes| bytes[0] == 0)
}

/// Writes the header.
pub(super) fn write_header(contents: &Contents, ty: SampleType, out: &mut dyn Write) -> io::Result<()> {
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

impl NiftiBytes<Vec<u8>> {
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

    fn set_magic(&mut self) {
        self.put(0, (self.bytes.len() as i32).to_le_bytes());
        let (at, magic) = self.offsets().magic;
        self.bytes[at..][..magic.len()].copy_from_slice(magic);
    }

    /// The units and the name of the variable, from a source of another format.
    fn set_new(&mut self, contents: &Contents) {
        let at = self.offsets();
        self.bytes[at.units] = units(contents);
        let name = &contents.name[..contents.name.floor_char_boundary(15)];
        self.bytes[at.intent_name..][..name.len()].copy_from_slice(name.as_bytes());
        self.set_real(at.pixdim, 0, 1.0); // the hand of a qform, which is not used
        self.set_sform_code(ALIGNED);
    }

    fn set_sform_code(&mut self, code: i64) {
        let at = self.offsets().form_codes;
        match self.is_first() {
            true => self.put(at + 2, (code as i16).to_le_bytes()),
            false => self.put(at + 4, (code as i32).to_le_bytes()),
        }
    }

    fn qform_code(&self) -> i64 {
        self.code(self.offsets().form_codes, 0)
    }

    fn sform_code(&self) -> i64 {
        self.code(self.offsets().form_codes, 1)
    }

    /// Numbers and type of the samples, which are stored as they are.
    fn set_samples(&mut self, contents: &Contents, ty: SampleType) {
        let (at, [x, y, z]) = (self.offsets(), contents.lattice().dims);
        let frames = contents.frames.len();
        let was_one = (self.length(at.dim, 0), self.length(at.dim, 4)) == (4, 1); // some programs ask for the fourth axis
        let lengths = [if frames == 1 && !was_one { 3 } else { 4 }, x, y, z, frames, 1, 1, 1];
        for (i, length) in lengths.into_iter().enumerate() {
            match self.is_first() {
                true => self.put(at.dim + 2 * i, (length as i16).to_le_bytes()),
                false => self.put(at.dim + 8 * i, (length as i64).to_le_bytes()),
            }
        }
        self.put(at.datatype, (DATATYPES.name(ty) as i16).to_le_bytes());
        self.put(at.datatype + 2, (8 * ty.size() as i16).to_le_bytes());
        let start = self.bytes.len() + GAP;
        match self.is_first() {
            true => self.put(at.vox_offset, (start as f32).to_le_bytes()),
            false => self.put(at.vox_offset, (start as i64).to_le_bytes()),
        }
        self.set_real(at.slope, 0, 1.0);
        self.set_real(at.slope, 1, 0.0);
    }

    /// The positions of voxels and frames. A header with the right positions is not changed.
    fn set_places(&mut self, contents: &Contents) {
        let (at, lattice) = (self.offsets(), contents.lattice().turned_from(LPS));
        for (axis, spacing) in lattice.spacing().into_iter().enumerate() {
            if (self.real(at.pixdim, axis + 1) / spacing - 1.0).abs() > SAME_STEP {
                self.set_real(at.pixdim, axis + 1, spacing);
            }
        }
        if let Some((first, step)) = contents.regular_times() {
            self.set_real(at.pixdim, 4, step);
            self.set_real(at.toffset, 0, first);
        } else if contents.frames.len() > 1 && self.real(at.pixdim, 4) > 0.0 {
            self.set_real(at.pixdim, 4, 0.0); // the step of the source is not that of these frames
        }
        if self.sform_code() > 0 {
            self.set_sform(&lattice);
        } else if self.qform_code() > 0 {
            (0..3).for_each(|axis| self.set_real(at.qoffset, axis, lattice.first[axis]));
        }
    }

    /// Sets the sform, and moves the qform by as much.
    fn set_sform(&mut self, lattice: &Lattice) {
        let at = self.offsets();
        for row in 0..3 {
            let moved = lattice.first[row] - self.real(at.sform, 4 * row + 3);
            let offset = self.real(at.qoffset, row);
            if moved != 0.0 && self.qform_code() > 0 {
                self.set_real(at.qoffset, row, offset + moved);
            }
            for column in 0..3 {
                self.set_real(at.sform, 4 * row + column, lattice.steps()[column][row]);
            }
            self.set_real(at.sform, 4 * row + 3, lattice.first[row]);
        }
    }

    /// Sets a number, unless the field already holds the nearest value.
    fn set_real(&mut self, at: usize, index: usize, number: f64) {
        let old = self.real(at, index);
        if old == number || (old - number).abs() <= f64::from(f32::EPSILON) * number.abs() && self.is_first() {
            return;
        }
        match self.is_first() {
            true => self.put(at + 4 * index, (number as f32).to_le_bytes()),
            false => self.put(at + 8 * index, number.to_le_bytes()),
        }
    }

    fn put<const N: usize>(&mut self, at: usize, mut bytes: [u8; N]) {
        if self.big_endian {
            bytes.reverse();
        }
        self.bytes[at..at + N].copy_from_slice(&bytes);
    }
}

/// The code of the units of space and time; 0 for others.
fn units(contents: &Contents) -> u8 {
    let code = |known: &[(u8, &[&str])], unit: Option<&str>| {
        known.iter().find(|(_, names)| unit.is_some_and(|unit| names.contains(&unit))).map_or(0, |(code, _)| *code)
    };
    code(SPACE_UNITS, contents.space_units.as_deref()) | code(TIME_UNITS, contents.time_units.as_deref())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::contents::testing::contents;
    use wavesplat_core::base::description::{Attribute, Description, NumberType, Numbers};

    fn written(contents: &Contents) -> NiftiBytes<Vec<u8>> {
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
        let step = |contents: &Contents| written(contents).real(76, 4);
        assert_eq!(step(&Contents { numbered: true, ..contents() }), 0.0, "no times were given");
        let mut long = contents();
        long.grid.dims[0] = LONGEST_OF_FIRST + 1;
        let header = written(&long);
        assert_eq!((header.bytes.len(), header.real(400, 3)), (SECOND, -1.0));
    }
    #[test]
    fn one_frame_keeps_the_fourth_axis_and_irregular_frames_have_no_step() {
        let of_source = |frames: i16| {
            let mut source = written(&contents());
            source.put(48, frames.to_le_bytes());
            let value = Values::Numbers(Numbers::new(NumberType::U8, &source.bytes));
            let global = vec![Attribute { name: NIFTI_HEADER.into(), value }];
            Contents { description: Some(Description { global, ..Description::default() }), ..contents() }
        };
        let axes = |frames| {
            let one = Contents { frames: vec![2], times: vec![0.25], ..of_source(frames) };
            i16::from_le_bytes(written(&one).get(40))
        };
        assert_eq!((axes(1), axes(3)), (4, 3));
        let irregular = Contents { times: vec![0.25, 0.5, 7.0], ..of_source(3) };
        assert_eq!(written(&irregular).real(76, 4), 0.0);
    }
}
