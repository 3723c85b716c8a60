//! NumPy's `.npy`: one array, (z, y, x) or (t, z, y, x), in C or Fortran order.

use crate::base::error::{Error, Result};
use crate::base::mapped::{Access, FileBytes};
use crate::base::sample::SampleType;
use crate::source::Parsed;
use crate::source::file_header::{DataLocation, FileHeader, Part, Stored, check_size};
use crate::source::layout::Layout;
use crate::source::layout::Shape;
use npyz::{DType, Endianness, NpyHeader, Order, TypeChar, TypeStr};
use std::fs::File;
use std::io::{self, BufReader, Read};
use std::path::Path;

/// How every `.npy` starts.
pub(in crate::source) const MAGIC: &[u8] = b"\x93NUMPY";

const MAX_HEADER: usize = 1 << 20; // bytes; NumPy itself stops at 10,000
const MAX_NESTING: usize = 8; // brackets within brackets: the parser takes twice as long with each dictionary more

/// What the header of an array says.
#[derive(Debug)]
pub(in crate::source) struct Array {
    /// Voxels and sample type of a frame.
    pub(in crate::source) shape: Shape,
    /// Number of frames.
    pub(in crate::source) frames: usize,
    /// Whether samples have their most significant byte first.
    pub(in crate::source) big_endian: bool,
    /// Bytes before the first sample.
    pub(in crate::source) start: u64,
}

/// What the header of an array of any number of dimensions says.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ArrayHeader {
    /// Lengths of the axes, the slowest first.
    pub lengths: Vec<u64>,
    /// The type of the samples.
    pub sample: SampleType,
    /// Whether samples have their most significant byte first.
    pub big_endian: bool,
    /// Bytes before the first sample.
    pub start: u64,
}

/// Reads the header of an `.npy` of any number of dimensions; its size is not checked.
///
/// # Errors
/// A file that cannot be read, a damaged header, types of samples that are not supported, Fortran order.
pub fn array_header(path: &Path) -> Result<ArrayHeader> {
    let file = File::open(path).map_err(|e| Error::io(path, "opening", e))?;
    c_header(&mut BufReader::with_capacity(256, file), path)
}

/// Reads the header of one file and checks its size.
pub(in crate::source) fn describe(path: &Path) -> Result<FileHeader> {
    let state = FileBytes::open(path, Access::Read)?.state();
    let file = File::open(path).map_err(|e| Error::io(path, "opening", e))?;
    let refused = |e| Error::input(path, e);
    let (header, order) = any_header(&mut BufReader::with_capacity(256, file), path)?;
    let Array { shape, frames, big_endian, start } = header.of_volumes().map_err(refused)?;
    check_size(state.len, start, &shape, frames).map_err(refused)?;
    let mut layout = Layout::plain(shape.dims(), frames);
    if order == Order::Fortran {
        layout.0.reverse();
    }
    let stored = Stored::new(&layout, shape.sample(), big_endian).map_err(refused)?;
    let part = Part { path: path.into(), state, frames, stored, at: DataLocation::Byte(start) };
    Ok(FileHeader::plain(shape, vec![part]))
}

/// Reads up to the first sample, and not a byte further.
pub(in crate::source) fn read_header(reader: &mut impl Read, path: &Path) -> Result<Array> {
    c_header(reader, path)?.of_volumes().map_err(|e| Error::input(path, e))
}

/// The header of an array in C order.
fn c_header(reader: &mut impl Read, path: &Path) -> Result<ArrayHeader> {
    match any_header(reader, path)? {
        (header, Order::C) => Ok(header),
        (_, Order::Fortran) => {
            let what = "its array is in Fortran order; write it as np.save(name, np.ascontiguousarray(a))";
            Err(Error::input(path, what))
        }
    }
}

fn any_header(reader: &mut impl Read, path: &Path) -> Result<(ArrayHeader, Order)> {
    let bytes = header_bytes(reader).map_err(|e| match e.kind() {
        io::ErrorKind::UnexpectedEof => Error::input(path, "ends inside its npy header"),
        io::ErrorKind::InvalidData => Error::input(path, e.to_string()),
        _ => Error::io(path, "reading the npy header", e),
    })?;
    parse(&bytes).map_err(|e| Error::input(path, e))
}

fn header_bytes(reader: &mut impl Read) -> io::Result<Vec<u8>> {
    let mut bytes = vec![0; 8];
    reader.read_exact(&mut bytes)?;
    if !bytes.starts_with(MAGIC) {
        return Err(io::Error::new(io::ErrorKind::InvalidData, "does not start as an npy file does"));
    }
    let mut len = [0; 4];
    let width = if bytes[6] == 1 { 2 } else { 4 };
    reader.read_exact(&mut len[..width])?;
    let text = u32::from_le_bytes(len) as usize;
    if text > MAX_HEADER {
        let what = format!("its npy header claims {text} bytes; at most {MAX_HEADER} are accepted");
        return Err(io::Error::new(io::ErrorKind::InvalidData, what));
    }
    bytes.extend(&len[..width]);
    let before = bytes.len();
    bytes.resize(before + text, 0);
    reader.read_exact(&mut bytes[before..])?;
    Ok(bytes)
}

impl ArrayHeader {
    fn of_volumes(self) -> Parsed<Array> {
        let (dims, frames) = dims(&self.lengths)?;
        if frames == 0 {
            return Err("its array has 0 frames".into());
        }
        let Self { sample, big_endian, start, .. } = self;
        Ok(Array { shape: Shape::new(dims, sample)?, frames, big_endian, start })
    }
}

fn parse(bytes: &[u8]) -> Parsed<(ArrayHeader, Order)> {
    check_harmless(&bytes[8..])?;
    let header = NpyHeader::from_reader(bytes).map_err(|e| format!("its npy header is damaged: {e}"))?;
    let (sample, big_endian) = sample_type(&header.dtype())?;
    let (lengths, start) = (header.shape().to_vec(), bytes.len() as u64);
    Ok((ArrayHeader { lengths, sample, big_endian, start }, header.order()))
}

/// Stops text on which the parser would run out of stack or multiply beyond 64 bits.
fn check_harmless(text: &[u8]) -> Parsed<()> {
    let mut depth = 0_usize;
    for byte in text {
        match byte {
            b'(' | b'[' | b'{' => depth += 1,
            b')' | b']' | b'}' => depth = depth.saturating_sub(1),
            _ => {}
        }
        if depth > MAX_NESTING {
            return Err("its npy header is nested too deeply".into());
        }
    }
    let numbers = text.split(|b| !b.is_ascii_digit()).filter(|n| !n.is_empty());
    let number = |n: &[u8]| std::str::from_utf8(n).ok()?.parse::<u64>().ok();
    let product = numbers.map(number).try_fold(1_u64, |all, n| all.checked_mul(n?.max(1)));
    product.map(|_| ()).ok_or_else(|| "the numbers in its npy header are too large".into())
}

fn dims(shape: &[u64]) -> Parsed<([usize; 3], usize)> {
    let number = |n: u64| usize::try_from(n).map_err(|_| format!("a length of {n} is too large"));
    match *shape {
        [z, y, x] => Ok(([number(x)?, number(y)?, number(z)?], 1)),
        [t, z, y, x] => Ok(([number(x)?, number(y)?, number(z)?], number(t)?)),
        _ => Err(format!("its array has {} dimension(s); supported are (z, y, x) and (t, z, y, x)", shape.len())),
    }
}

fn sample_type(dtype: &DType) -> Parsed<(SampleType, bool)> {
    let refused = || {
        let hint = "supported are u1 i1 u2 i2 u4 i4 f2 f4 f8 (bytes, not bits); convert with .astype(np.int32), say";
        format!("its samples are {}; {hint}", dtype.descr())
    };
    let DType::Plain(ty) = dtype else { return Err(refused()) };
    let sample = plain_type(ty).ok_or_else(refused)?;
    Ok((sample, ty.endianness() == Endianness::Big))
}

fn plain_type(ty: &TypeStr) -> Option<SampleType> {
    Some(match (ty.type_char(), ty.size_field()) {
        (TypeChar::Uint, 1) => SampleType::U8,
        (TypeChar::Int, 1) => SampleType::I8,
        (TypeChar::Uint, 2) => SampleType::U16,
        (TypeChar::Int, 2) => SampleType::I16,
        (TypeChar::Uint, 4) => SampleType::U32,
        (TypeChar::Int, 4) => SampleType::I32,
        (TypeChar::Float, 2) => SampleType::F16,
        (TypeChar::Float, 4) => SampleType::F32,
        (TypeChar::Float, 8) => SampleType::F64,
        _ => return None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::source::OpenOptions;
    use crate::source::testing::{Folder, check_inputs, payload, refused, survives_damage};

    fn npy(version: u8, dict: &str, payload: &[u8]) -> Vec<u8> {
        let text = format!("{dict}\n");
        let len = (text.len() as u32).to_le_bytes();
        let len = &len[..if version == 1 { 2 } else { 4 }];
        [MAGIC, &[version, 0], len, text.as_bytes(), payload].concat()
    }

    fn dict(descr: &str, shape: &str) -> String {
        format!("{{'descr': {descr}, 'fortran_order': False, 'shape': {shape}, }}")
    }

    #[test]
    fn every_type_byte_order_and_version_is_read() {
        let folder = Folder::new();
        let names = ["u1", "i1", "u2", "i2", "u4", "i4", "f2", "f4", "f8"];
        for (i, (name, ty)) in names.into_iter().zip(SampleType::ALL).enumerate() {
            for (order, big_endian) in [('<', false), ('>', true)] {
                let order = if ty.size() == 1 { '|' } else { order };
                let dict = dict(&format!("'{order}{name}'"), "(4, 3, 5, 7)");
                let bytes = npy(1 + (i % 3) as u8, &dict, &payload(ty, 0..4, big_endian));
                check_inputs(&[folder.write("a.npy", bytes)], &OpenOptions::default(), ty, 4);
            }
        }
    }

    #[test]
    fn three_dimensions_are_one_frame_and_the_extension_is_not_needed() {
        let folder = Folder::new();
        let files = [0, 1, 2].map(|t| {
            let bytes = npy(1, &dict("'<f4'", "(3, 5, 7)"), &payload(SampleType::F32, t..t + 1, false));
            folder.write(&format!("f{t}.data"), bytes)
        });
        check_inputs(&files, &OpenOptions::default(), SampleType::F32, 3);
    }

    #[test]
    fn what_is_not_supported_is_named() {
        let folder = Folder::new();
        let header = |descr: &str, shape: &str, words: &str| {
            let file = folder.write("a.npy", npy(1, &dict(descr, shape), &[0; 64]));
            refused(&[file], &OpenOptions::default(), words);
        };
        for descr in ["'<i8'", "'<u8'", "'|b1'", "'<c8'", "'<U3'", "[('a', '<f4'), ('b', '<i2')]"] {
            header(descr, "(2, 2, 2)", "its samples are");
        }
        header("'<f4'", "(4, 4)", "2 dimension(s)");
        header("'<f4'", "(1, 1, 4, 2, 2)", "5 dimension(s)");
        header("'<f4'", "(0, 2, 2, 2)", "0 frames");
        header("'<f4'", "(2, 0, 2)", "is empty");
        header("'<f4'", "(4, 4, 4)", "expected");
        header("'<f4'", "(9223372036854775808, 2, 2)", "too large");
        header("'<f4'", "(99999999999999999999, 2, 2)", "too large");
        header(&"[".repeat(100_000)[..60_000], "(4, 4, 4)", "nested");
    }

    #[test]
    fn arrays_in_fortran_order_are_read() {
        let folder = Folder::new();
        let plain = payload(SampleType::U16, 0..4, true);
        let mut stored = Vec::new();
        for (x, y, z) in (0..7).flat_map(|x| (0..5).flat_map(move |y| (0..3).map(move |z| (x, y, z)))) {
            for t in 0..4 {
                stored.extend(&plain[2 * (((t * 3 + z) * 5 + y) * 7 + x)..][..2]);
            }
        }
        let dict = dict("'>u2'", "(4, 3, 5, 7)").replace("False", "True");
        let file = folder.write("a.npy", npy(1, &dict, &stored));
        check_inputs(std::slice::from_ref(&file), &OpenOptions::default(), SampleType::U16, 4);
        assert!(array_header(&file).is_err_and(|e| e.to_string().contains("ascontiguousarray")));
    }

    #[test]
    fn headers_of_any_number_of_dimensions_are_read() {
        let folder = Folder::new();
        for lengths in [vec![], vec![7], vec![4, 6], vec![1, 1, 4, 2, 2]] {
            let shape: String = lengths.iter().map(|n: &u64| format!("{n}, ")).collect();
            let bytes = npy(1, &dict("'>u2'", &format!("({shape})")), &[]);
            let expected =
                ArrayHeader { lengths, sample: SampleType::U16, big_endian: true, start: bytes.len() as u64 };
            assert_eq!(array_header(&folder.write("a.npy", bytes)).expect("a header"), expected);
        }
        assert!(array_header(&folder.write("a.npy", "text")).is_err() && array_header(&folder.path("gone")).is_err());
    }

    #[test]
    fn no_damage_panics() {
        survives_damage("a.npy", &npy(1, &dict("'<f4'", "(2, 2, 4)"), &[0; 64]));
    }

    #[test]
    fn damaged_headers_are_errors() {
        let folder = Folder::new();
        let good = npy(2, &dict("'<f4'", "(2, 2, 4)"), &[0; 64]);
        for len in 0..good.len() {
            let file = folder.write("a.npy", &good[..len]);
            assert!(crate::source::open(&[file], &OpenOptions::default()).is_err(), "{len} bytes");
        }
        let mut huge = good.clone();
        huge[8..12].copy_from_slice(&u32::MAX.to_le_bytes());
        refused(&[folder.write("a.npy", huge)], &OpenOptions::default(), "claims 4294967295 bytes");
        refused(&[folder.write("a.npy", npy(4, "{}", &[]))], &OpenOptions::default(), "unsupported version");
        refused(
            &[folder.write("a.npy", [good.clone(), vec![0; 64]].concat())],
            &OpenOptions::default(),
            "2 whole frame",
        );
    }
}
