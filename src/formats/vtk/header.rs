//! The text of a legacy VTK file, and where its arrays are.

use super::lines::Lines;
use crate::shared::association::Association;
use crate::shared::pieces::Packed;
use crate::shared::text::Words;
use crate::shared::types::Types;
use crate::shared::words::{array, number, shortened};
use std::io::Read;
use wavesplat_core::base::error::{Error, Result};
use wavesplat_core::base::mapped::{Access, FileBytes};
use wavesplat_core::base::sample;
use wavesplat_core::base::stored::StoredType;
use wavesplat_core::base::text::percent_decoded;
use wavesplat_core::source::Parsed;

/// How every such file starts.
pub(crate) const MAGIC: &[u8] = b"# vtk DataFile";

/// One array of points or cells.
#[derive(Debug)]
pub(super) struct VtkArray {
    pub(super) of: Association,
    pub(super) name: String,
    /// The type by its name in the file.
    pub(super) ty: String,
    pub(super) components: usize,
    /// How many have so many components.
    pub(super) tuples: usize,
    /// Its first byte.
    pub(super) start: u64,
}

/// The numbers of an array.
#[derive(Clone, Copy)]
struct ArraySize {
    components: usize,
    /// How many have so many components.
    tuples: usize,
}

/// The file, as it is written.
#[derive(Debug)]
pub(super) struct VtkHeader {
    /// Whether its arrays are text.
    pub(super) ascii: bool,
    /// Points along x, y, z.
    pub(super) points: [usize; 3],
    pub(super) spacing: [f64; 3],
    pub(super) origin: [f64; 3],
    pub(super) arrays: Vec<VtkArray>,
    /// Which of them are scalars.
    pub(super) scalars: Vec<usize>,
    pub(super) time: Option<f64>,
    /// Whether the following arrays are of points or cells, and their number of tuples.
    inside: Option<(Association, usize)>,
}

impl VtkHeader {
    /// Goes through the whole file, from array to array.
    pub(super) fn read(file: &FileBytes) -> Result<Self> {
        let mut lines = Lines { file, at: 0 };
        let refused = |e| Error::input(file.path(), e);
        let ascii = start(&mut lines)?;
        let (points, spacing, origin) = ([0; 3], [1.0; 3], [0.0; 3]);
        let mut header =
            Self { ascii, points, spacing, origin, arrays: Vec::new(), scalars: Vec::new(), time: None, inside: None };
        while let Some(words) = lines.words()? {
            let words: Vec<&str> = words.iter().map(String::as_str).collect();
            if !header.geometry(&words).map_err(refused)? {
                header.attribute(&words, &mut lines)?;
            }
        }
        if header.points == [0; 3] {
            return Err(refused("does not say its DIMENSIONS".into()));
        }
        Ok(header)
    }

    /// The arrays by their names and numbers of components.
    pub(super) fn names(&self) -> Vec<(&str, usize)> {
        self.arrays.iter().map(|array| (array.name.as_str(), array.components)).collect()
    }

    /// Whether a line describes the lattice, or says whether arrays are of points or cells.
    fn geometry(&mut self, words: &[&str]) -> Parsed<bool> {
        match (words[0].to_uppercase().as_str(), &words[1..]) {
            ("DATASET", [kind]) if kind.eq_ignore_ascii_case("STRUCTURED_POINTS") => {}
            ("DATASET", kind) => {
                return Err(format!("is a {}: only STRUCTURED_POINTS are supported", kind.join(" ").to_uppercase()));
            }
            ("DIMENSIONS", sizes) => self.points = array(&sizes.join(" "), "DIMENSIONS")?,
            ("SPACING" | "ASPECT_RATIO", sizes) => self.spacing = array(&sizes.join(" "), "SPACING")?,
            ("ORIGIN", place) => self.origin = array(&place.join(" "), "ORIGIN")?,
            ("POINT_DATA", count) => {
                self.inside = Some((Association::Points, number(&count.join(" "), "size of POINT_DATA")?));
            }
            ("CELL_DATA", count) => {
                self.inside = Some((Association::Cells, number(&count.join(" "), "size of CELL_DATA")?));
            }
            _ => return Ok(false),
        }
        Ok(true)
    }

    /// Takes note of the arrays that a line begins.
    fn attribute(&mut self, words: &[&str], lines: &mut Lines<'_>) -> Result<()> {
        let refused = |e| Error::input(lines.file.path(), e);
        let keyword = words[0].to_uppercase();
        let tuples = self.inside.map_or(0, |(_, tuples)| tuples);
        let size = |components| ArraySize { components, tuples };
        let mut array = |name: &str, ty: &str, components: usize| self.array(name, ty, size(components), lines);
        match (keyword.as_str(), &words[1..]) {
            ("SCALARS", [name, ty, rest @ ..]) => {
                let components = rest.first().map_or(Ok(1), |n| number(n, "components of SCALARS")).map_err(refused)?;
                self.scalars.push(self.arrays.len());
                skip_table(lines)?;
                self.array(name, ty, size(components), lines)
            }
            ("COLOR_SCALARS", [name, components]) => {
                let components = number(components, "components of COLOR_SCALARS").map_err(refused)?;
                self.scalars.push(self.arrays.len());
                let ty = if self.ascii { "of colours as text" } else { "unsigned_char" };
                self.array(name, ty, size(components), lines)
            }
            ("VECTORS" | "NORMALS", [name, ty]) => array(name, ty, 3),
            ("TENSORS", [name, ty]) => array(name, ty, 9),
            ("TENSORS6", [name, ty]) => array(name, ty, 6),
            ("GLOBAL_IDS" | "PEDIGREE_IDS" | "EDGE_FLAGS", [name, ty]) => array(name, ty, 1),
            ("TEXTURE_COORDINATES", [name, components, ty]) => {
                let components = number(components, "components of TEXTURE_COORDINATES").map_err(refused)?;
                array(name, ty, components)
            }
            ("LOOKUP_TABLE", [_, size]) => {
                let size: usize = number(size, "size of a LOOKUP_TABLE").map_err(refused)?;
                self.pass(lines, size.checked_mul(4), 8).map(|_| ())
            }
            ("FIELD", [_, count]) => self.field(number(count, "arrays of a FIELD").map_err(refused)?, lines),
            ("METADATA", _) => skip_metadata(lines),
            _ => Err(refused(format!(
                "has {:?} where a keyword of VTK was expected, before byte {}",
                shortened(words[0]),
                lines.at
            ))),
        }
    }

    fn field(&mut self, count: usize, lines: &mut Lines<'_>) -> Result<()> {
        for _ in 0..count {
            let words = loop {
                match lines.words()? {
                    Some(words) if words[0].eq_ignore_ascii_case("METADATA") => skip_metadata(lines)?,
                    words => break words,
                }
            };
            let words = words.unwrap_or_default();
            let [name, components, tuples, ty] = &words[..] else {
                let what = format!("has a FIELD of {count} arrays, but not so many follow");
                return Err(Error::input(lines.file.path(), what));
            };
            let [components, tuples] = [components, tuples].map(|n| number(n, "size of an array of a FIELD"));
            let refused = |e| Error::input(lines.file.path(), e);
            let size = ArraySize { components: components.map_err(refused)?, tuples: tuples.map_err(refused)? };
            self.array(name, ty, size, lines)?;
        }
        Ok(())
    }

    /// An array that begins at the next byte.
    fn array(&mut self, name: &str, ty: &str, size: ArraySize, lines: &mut Lines<'_>) -> Result<()> {
        let (name, ArraySize { components, tuples }) = (decoded(name), size);
        let Some(bits) = bits_of(ty) else {
            let what = format!("array {name}: type {ty} is not supported, nor what comes after it");
            return Err(Error::input(lines.file.path(), what));
        };
        let start = self.pass(lines, components.checked_mul(tuples), bits)?;
        match self.inside {
            Some((of, _)) => self.arrays.push(VtkArray { of, name, ty: ty.into(), components, tuples, start }),
            None if is_time(&name) && (components, tuples) == (1, 1) => self.time = self.time(lines.file, start, ty)?,
            None => {}
        }
        Ok(())
    }

    /// Goes past numbers of so many bits that must be there, and says where they start.
    fn pass(&self, lines: &mut Lines<'_>, numbers: Option<usize>, bits: usize) -> Result<u64> {
        let (start, len) = (lines.at, lines.file.len());
        let refused = |what: String| Err(Error::input(lines.file.path(), what));
        let bits = numbers.and_then(|numbers| numbers.checked_mul(bits));
        let (Some(numbers), Some(end)) = (numbers, bits.and_then(|n| start.checked_add(n.div_ceil(8) as u64))) else {
            return refused("an array's size is too large for any file".into());
        };
        if self.ascii {
            return lines.skip_words(numbers).map(|()| start);
        }
        if end > len {
            return refused(format!("is cut short: an array ends at byte {end}, the file at {len}"));
        }
        lines.at = end;
        Ok(start)
    }

    /// A stored number, if its type is that of samples.
    fn time(&self, file: &FileBytes, start: u64, ty: &str) -> Result<Option<f64>> {
        let Some(ty) = stored_type(ty).filter(|ty| !ty.is_64_bit()) else { return Ok(None) };
        let failed = |e| Error::io(file.path(), "reading its time", e);
        let mut bytes = vec![0; ty.size()];
        if self.ascii {
            let words = Words { start, count: 1, ty };
            let file = FileBytes::open(file.path(), Access::Read)?;
            words.open(file).and_then(|mut reader| reader.read_exact(&mut bytes)).map_err(failed)?;
        } else {
            file.read_at(start, &mut bytes).map_err(failed)?;
        }
        ty.swap_endian(&mut bytes);
        let mut value = [0.0];
        sample::load(ty.sample(), &bytes, &mut value);
        Ok(Some(value[0]))
    }
}

/// The three lines that every file has, and whether they say that its arrays are text.
fn start(lines: &mut Lines<'_>) -> Result<bool> {
    let refused = |what: &str| Err(Error::input(lines.file.path(), what));
    if !lines.peek(MAGIC.len())?.starts_with(MAGIC) {
        return refused("does not start as a legacy VTK file does");
    }
    let mut next = || Result::Ok(lines.line()?.unwrap_or_default());
    let (_version, _title, encoding) = (next()?, next()?, next()?);
    match encoding.trim().to_uppercase().as_str() {
        "BINARY" => Ok(false),
        "ASCII" => Ok(true),
        _ => refused("says neither BINARY nor ASCII in its third line"),
    }
}

/// Skips the line with the name of a colour table, which may precede the values of SCALARS.
fn skip_table(lines: &mut Lines<'_>) -> Result<()> {
    if lines.peek(12)?.eq_ignore_ascii_case(b"LOOKUP_TABLE") {
        lines.line()?;
    }
    Ok(())
}

/// Skips the metadata that VTK writes after an array: the lines up to an empty one.
fn skip_metadata(lines: &mut Lines<'_>) -> Result<()> {
    while lines.line()?.is_some_and(|line| !line.trim().is_empty()) {}
    Ok(())
}

/// The number of bits of a type; `None` if the type is not known.
fn bits_of(ty: &str) -> Option<usize> {
    Some(match ty.to_lowercase().as_str() {
        "bit" => 1,
        "vtkidtype" => 32,
        ty => 8 * stored_type(ty)?.size(),
    })
}

/// Names of types in lower case; `long` has 64 bits but on Windows.
const TYPES: Types<&str> = Types(&[
    (StoredType::U8, &["unsigned_char"]),
    (StoredType::I8, &["char", "signed_char"]),
    (StoredType::U16, &["unsigned_short"]),
    (StoredType::I16, &["short"]),
    (StoredType::U32, &["unsigned_int"]),
    (StoredType::I32, &["int"]),
    (StoredType::F32, &["float"]),
    (StoredType::F64, &["double"]),
    (StoredType::I64, &["vtktypeint64", "long"]),
    (StoredType::U64, &["vtktypeuint64", "unsigned_long"]),
]);

/// The type of numbers that a name stands for.
pub(super) fn stored_type(name: &str) -> Option<StoredType> {
    TYPES.stored(name.to_lowercase().as_str())
}

fn is_time(name: &str) -> bool {
    ["time", "timevalue"].iter().any(|time| name.eq_ignore_ascii_case(time))
}

/// A name in which VTK has written some characters as `%20`.
fn decoded(name: &str) -> String {
    String::from_utf8_lossy(&percent_decoded(name)).into_owned()
}
