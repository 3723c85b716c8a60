//! Reads NumPy's `.npy`.

use crate::shared::meaning::{Kind, Meaning};
use std::io::{self, BufReader, Read};
use std::path::Path;
use wavesplat_core::base::description::AxisRole;
use wavesplat_core::base::error::{Error, Note, Remedy, Result};
use wavesplat_core::base::files;
use wavesplat_core::base::mapped::{Access, FileBytes};
use wavesplat_core::base::npy::{Header, MAGIC};
use wavesplat_core::base::sample::SampleType;
use wavesplat_core::base::stored::StoredType;
use wavesplat_core::source::file_header::{FileHeader, check_size};
use wavesplat_core::source::layout::{Layout, Shape};
use wavesplat_core::source::parts::{DataLocation, Part, Stored};
use wavesplat_core::source::{Advised, OpenOptions, Parsed};

const MAX_HEADER: usize = 1 << 20; // bytes; NumPy itself stops at 10,000

/// The header of an array of frames.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Array {
    /// Voxels and sample type of a frame.
    pub(crate) shape: Shape,
    /// The type of the stored numbers.
    pub(crate) ty: StoredType,
    /// Number of axes: 4, or 3 of a single frame.
    pub(crate) axes: usize,
    /// Number of frames.
    pub(crate) frames: usize,
    /// Whether numbers have their most significant byte first.
    pub(crate) big_endian: bool,
    /// The order in which its numbers lie.
    pub(crate) layout: Layout,
    /// The component that is meant, if the user's letters say that there are several.
    pub(crate) variable: Option<String>,
    /// Bytes before the first number.
    pub(crate) start: u64,
}

/// The header of an array of any number of dimensions.
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
    let file = files::open(path)?;
    let found = any_header(&mut BufReader::with_capacity(256, file), path)?;
    found.refuse_fortran(path)?;
    let AnyHeader { lengths, ty, big_endian, start, .. } = found;
    if ty.is_64_bit() {
        return Err(Error::input(path, format!("its samples are {ty}; convert with .astype(np.int32), say")));
    }
    Ok(ArrayHeader { lengths, sample: ty.sample(), big_endian, start })
}

/// Reads the header of one file and checks its size.
pub(crate) fn describe(path: &Path, options: &OpenOptions) -> Result<FileHeader> {
    let state = FileBytes::open(path, Access::Read)?.state();
    let file = files::open(path)?;
    let refused = |e| Error::input(path, e);
    let array = read_any(&mut BufReader::with_capacity(256, file), path, options)?;
    check_size(state.len, array.start, &array.shape, array.ty, array.numbers()).map_err(refused)?;
    let stored = Stored::new(&array.layout, array.ty, array.big_endian).map_err(refused)?;
    let notes = array.guess(options).into_iter().collect();
    let Array { shape, frames, start, variable, .. } = array;
    let part = Part { path: path.into(), state, frames, stored, at: DataLocation::Byte(start) };
    Ok(FileHeader { variable, notes, ..FileHeader::plain(shape, vec![part]) })
}

/// Reads up to the first number, and not a byte further; an array in Fortran order is refused.
pub(crate) fn read_header(reader: &mut impl Read, path: &Path) -> Result<Array> {
    let found = any_header(reader, path)?;
    found.refuse_fortran(path)?;
    found.volumes(&OpenOptions::default()).map_err(|e| Error::input(path, e))
}

/// Reads up to the first number of an array in any order, whose axes may be those of the options.
pub(crate) fn read_any(reader: &mut impl Read, path: &Path, options: &OpenOptions) -> Result<Array> {
    any_header(reader, path)?.volumes(options).map_err(|e| Error::input(path, e))
}

impl Array {
    /// Its size in frames, with all components.
    fn numbers(&self) -> usize {
        let single = self.layout.0.iter().filter(|axis| axis.role == AxisRole::Single);
        single.fold(self.frames, |all, axis| all.saturating_mul(axis.len))
    }

    /// A note on a single frame, whose axes may be others.
    pub(crate) fn guess(&self, options: &OpenOptions) -> Option<Note> {
        let [x, y, z] = self.shape.dims();
        let text = format!("the axes [{z}, {y}, {x}] are taken as zyx, slowest first: one frame");
        (self.axes == 3 && options.axes.is_none()).then(|| Note::with(text, Remedy::Set("axes")))
    }
}

/// The content of a header.
struct AnyHeader {
    lengths: Vec<u64>,
    ty: StoredType,
    big_endian: bool,
    is_fortran: bool,
    start: u64,
}

fn any_header(reader: &mut impl Read, path: &Path) -> Result<AnyHeader> {
    let (text, start) = header_text(reader).map_err(|e| match e.kind() {
        io::ErrorKind::UnexpectedEof => Error::input(path, "ends inside its npy header"),
        io::ErrorKind::InvalidData => Error::input(path, e.to_string()),
        _ => Error::io(path, "reading the npy header", e),
    })?;
    parse(&text, start).map_err(|e| Error::input(path, e))
}

/// The text of a header, and the number of bytes up to its end.
fn header_text(reader: &mut impl Read) -> io::Result<(Vec<u8>, u64)> {
    let mut head = [0; MAGIC.len() + 2];
    reader.read_exact(&mut head)?;
    let width = match head.strip_prefix(MAGIC) {
        Some([1, 0]) => 2,
        Some([2 | 3, 0]) => 4,
        Some(version) => return Err(invalid(format!("its npy header has an unsupported version: {version:?}"))),
        None => return Err(invalid("does not start as an npy file does".into())),
    };
    let mut len = [0; 4];
    reader.read_exact(&mut len[..width])?;
    let len = u32::from_le_bytes(len) as usize;
    if len > MAX_HEADER {
        return Err(invalid(format!("its npy header claims {len} bytes; at most {MAX_HEADER} are accepted")));
    }
    let mut text = vec![0; len];
    reader.read_exact(&mut text)?;
    Ok((text, (head.len() + width + len) as u64))
}

fn invalid(what: String) -> io::Error {
    io::Error::new(io::ErrorKind::InvalidData, what)
}

impl AnyHeader {
    fn refuse_fortran(&self, path: &Path) -> Result<()> {
        if !self.is_fortran {
            return Ok(());
        }
        let what = "its array is in Fortran order; write it as np.save(name, np.ascontiguousarray(a))";
        Err(Error::input(path, what))
    }

    fn volumes(self, options: &OpenOptions) -> Advised<Array> {
        let (meaning, component, variable) = self.meaning(options)?;
        let Self { ty, big_endian, is_fortran, start, lengths } = self;
        let axes = lengths.len();
        let mut layout = meaning.plain_layout(component);
        let frames = layout.len(AxisRole::Frames);
        if frames == 0 {
            return Err("its array has 0 frames".into());
        }
        layout.bytes(ty.size())?;
        let shape = Shape::new(layout.dims(), ty.sample())?;
        if is_fortran {
            layout.0.reverse();
        }
        Ok(Array { shape, ty, axes, frames, big_endian, layout, variable, start })
    }

    /// What its axes count, the component that is meant, and its name.
    fn meaning(&self, options: &OpenOptions) -> Advised<(Meaning, usize, Option<String>)> {
        let number = |n: &u64| usize::try_from(*n).map_err(|_| format!("a length of {n} is too large"));
        let sizes: Vec<usize> = self.lengths.iter().rev().map(number).collect::<Parsed<_>>()?;
        if let Some(letters) = options.axes.as_deref() {
            let meaning = Meaning::by_letters(&sizes, letters)?;
            let variable = options.variable.as_deref().filter(|_| meaning.components() > 1);
            let (component, variable) = meaning.component(None, variable)?;
            return Ok((meaning, component, variable));
        }
        if !(3..=4).contains(&sizes.len()) {
            let supported = "supported are (z, y, x) and (t, z, y, x)";
            let text = format!("its array has {} dimension(s); {supported}", sizes.len());
            return Err(Note::with(text, Remedy::Set("axes")));
        }
        let kinds = [Kind::Voxels(0), Kind::Voxels(1), Kind::Voxels(2), Kind::Frames][..sizes.len()].to_vec();
        Ok((Meaning { sizes, kinds }, 0, None))
    }
}

fn parse(text: &[u8], start: u64) -> Parsed<AnyHeader> {
    let Header { samples, is_fortran, shape } = Header::parse(text).map_err(|e| format!("its npy header {e}"))?;
    let (ty, big_endian) = samples.map_err(|descr| {
        let hint = "supported are u1 i1 u2 i2 u4 i4 u8 i8 f2 f4 f8 (bytes, not bits)";
        format!("its samples are {descr}; {hint}; convert with .astype(np.float32), say")
    })?;
    Ok(AnyHeader { lengths: shape, ty, big_endian, is_fortran, start })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{Folder, check_inputs, payload, refused, survives_damage};

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
        for descr in ["'<i16'", "'|b1'", "'<c8'", "'<U3'", "[('a', '<f4'), ('b', '<i2')]"] {
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
    fn integers_of_64_bits_are_read_where_32_hold_them() {
        let folder = Folder::new();
        for (name, ty) in [("i8", SampleType::I32), ("u8", SampleType::U32)] {
            for (order, big_endian) in [('<', false), ('>', true)] {
                let wide = |b: &[u8]| if big_endian { [[0; 4].as_slice(), b].concat() } else { [b, &[0; 4]].concat() };
                let stored: Vec<u8> = payload(ty, 0..4, big_endian).chunks(4).flat_map(wide).collect();
                let dict = dict(&format!("'{order}{name}'"), "(4, 3, 5, 7)");
                let file = folder.write("a.npy", npy(1, &dict, &stored));
                check_inputs(std::slice::from_ref(&file), &OpenOptions::default(), ty, 4);
                assert!(array_header(&file).is_err_and(|e| e.to_string().contains("np.int32")));
            }
        }
    }

    #[test]
    fn an_integer_that_no_sample_is_has_its_place_named() {
        let folder = Folder::new();
        let values = (0..24).map(|i| if i == 21 { -5_000_000_000 } else { i });
        let stored: Vec<u8> = values.flat_map(i64::to_le_bytes).collect();
        let file = folder.write("a.npy", npy(1, &dict("'<i8'", "(2, 3, 2, 2)"), &stored));
        let mut source = crate::open(&[file], &OpenOptions::default()).expect("a header");
        let (whole, mut out) = (source.archive().grid.whole(), vec![0; 48]);
        let window = source.window(0, 2).expect("frames");
        window.read_box(0, &whole, &mut out).expect("a frame whose integers fit");
        let error = window.read_box(1, &whole, &mut out).expect_err("too small").to_string();
        assert!(error.contains("a.npy, frame 1: voxel (1, 0, 2) is -5000000000, which no i32"), "{error}");
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
            assert!(crate::open(&[file], &OpenOptions::default()).is_err(), "{len} bytes");
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
