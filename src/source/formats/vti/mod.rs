//! VTK's image data, `.vti`: one array of one piece, uncompressed, raw or base64.

mod header;

use crate::error::{Error, Result};
use crate::mapped::{Access, FileBytes};
use crate::sample::SampleType;
use crate::source::Parsed;
use crate::source::described::{At, Decode, Described, Part, Stored, head};
use crate::source::formats::base64::{Count, Place};
use crate::source::frames::Shape;
use crate::source::held::Held;
use header::{Array, Association, Header};
use std::ops::Range;
use std::path::Path;

const FIRST_READ: usize = 16 << 10; // bytes; holds the XML of nearly all files with appended arrays
const IDENTITY: [f64; 9] = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0];

/// Reads the XML of one file and checks that the array is all there.
pub(super) fn describe(path: &Path, variable: Option<&str>) -> Result<Described> {
    let file = FileBytes::open(path, Access::Read)?;
    let refused = |e| Error::input(path, e);
    let (text, data) = xml(&file)?;
    let text = std::str::from_utf8(&text).map_err(|e| refused(format!("is not UTF-8 text: {e}")))?;
    let header = header::parse(text).map_err(refused)?;
    let array = choose(&header.arrays, &header.scalars, variable).map_err(refused)?;
    let shape = shape(&header, array).map_err(refused)?;
    let at = place(&file, &header, array, data, &shape)?;
    let stored = Stored::plain(&shape, 1, header.big_endian).map_err(refused)?;
    Ok(described(&header, array, (shape, stored), &file, at))
}

/// The text up to the end of the `<AppendedData>` tag or of the file, and the length of that text.
fn xml(file: &FileBytes) -> Result<(Vec<u8>, u64)> {
    let mut len = FIRST_READ;
    loop {
        let mut text = head(file, len)?;
        if let Some(end) = appended_tag(&text) {
            text.truncate(end);
        } else if (text.len() as u64) < file.len() {
            len = len.saturating_mul(4);
            continue;
        }
        let end = text.len() as u64;
        return Ok((text, end));
    }
}

/// Where the tag ends: what follows it is not XML.
fn appended_tag(text: &[u8]) -> Option<usize> {
    const TAG: &[u8] = b"<AppendedData";
    let start = text.windows(TAG.len()).position(|w| w == TAG)?;
    let end = text[start..].iter().position(|b| *b == b'>')?;
    Some(start + end + 1)
}

/// The array by name, else the active one, else the only one.
fn choose<'a>(arrays: &'a [Array], scalars: &[(Association, String)], name: Option<&str>) -> Parsed<&'a Array> {
    let names = || arrays.iter().map(|a| a.name.as_str()).collect::<Vec<_>>().join(", ");
    if let Some(name) = name {
        let found = arrays.iter().find(|a| a.name == name);
        return found.ok_or_else(|| format!("has no array {name}; it has {}", names()));
    }
    let active = |(of, name): &(Association, String)| arrays.iter().find(|a| a.of == *of && a.name == *name);
    match (scalars.iter().find_map(active), arrays) {
        (Some(array), _) | (None, [array]) => Ok(array),
        (None, []) => Err("has no point or cell array".into()),
        (None, _) => Err(format!("has several arrays and none is active: --variable chooses one of {}", names())),
    }
}

fn shape(header: &Header, array: &Array) -> Parsed<Shape> {
    let refused = |what: String| Err(format!("array {}: {what}", array.name));
    if array.components != "1" {
        return refused(format!(
            "{} components are not supported; write each as an array of its own",
            array.components
        ));
    }
    let cells = usize::from(array.of == Association::Cells);
    let points = header.points()?;
    if points.iter().any(|n| *n <= cells) {
        return refused(format!("an extent of {points:?} points holds none of its samples"));
    }
    match sample_type(&array.ty) {
        Some(sample) => Shape::new(points.map(|n| n - cells), sample),
        None => refused(format!("type {} is not supported; UInt8 to Int32, Float32 and Float64 are", array.ty)),
    }
}

fn sample_type(name: &str) -> Option<SampleType> {
    Some(match name {
        "UInt8" => SampleType::U8,
        "Int8" => SampleType::I8,
        "UInt16" => SampleType::U16,
        "Int16" => SampleType::I16,
        "UInt32" => SampleType::U32,
        "Int32" => SampleType::I32,
        "Float32" => SampleType::F32,
        "Float64" => SampleType::F64,
        _ => return None,
    })
}

/// Where the samples are, checked to be all there.
fn place(file: &FileBytes, header: &Header, array: &Array, data: u64, shape: &Shape) -> Result<At> {
    let refused = |e| Error::input(file.path(), e);
    let count = Count { wide: header.wide, big_endian: header.big_endian };
    match (array.format.as_str(), header.encoding.as_deref()) {
        ("binary", _) => base64(file, Place { start: array.text, count }, shape, true),
        ("appended", Some("raw")) => raw(file, appended(file, array, data)?, count, shape),
        ("appended", Some("base64")) => {
            base64(file, Place { start: appended(file, array, data)?, count }, shape, false)
        }
        ("appended", None) => Err(refused("ends before its <AppendedData>".into())),
        ("appended", Some(other)) => Err(refused(format!("appended data in encoding {other:?} is not supported"))),
        (other, _) => Err(refused(format!("data in format {other:?} is not supported; write it appended or binary"))),
    }
}

fn base64(file: &FileBytes, place: Place, shape: &Shape, whole: bool) -> Result<At> {
    place.check(file, shape.frame_bytes(), whole)?;
    Ok(At::Decoded(Box::new(Base64 { place, bytes: shape.frame_bytes() })))
}

/// The samples of one frame as text.
#[derive(Debug)]
struct Base64 {
    place: Place,
    bytes: usize,
}

impl Decode for Base64 {
    fn decode(&mut self, path: &Path, _frames: Range<usize>, out: &mut Held) -> Result<()> {
        let samples = self.place.decode(&FileBytes::open(path, Access::Read)?, self.bytes)?;
        out.write_at(0, &samples).map_err(|e| Error::io(path, "holding its samples", e))
    }
}

fn raw(file: &FileBytes, start: u64, count: Count, shape: &Shape) -> Result<At> {
    let refused = |e| Error::input(file.path(), e);
    let after = |at: u64, bytes: usize| match at.checked_add(bytes as u64) {
        Some(end) if end <= file.len() => Ok(end),
        Some(end) => Err(refused(format!("is cut short: its array ends at byte {end}, the file at {}", file.len()))),
        None => Err(refused("its array's offset is too large".into())),
    };
    let samples = after(start, count.size())?;
    let mut stored = vec![0; count.size()];
    file.read_at(start, &mut stored).map_err(|e| Error::io(file.path(), "reading an array's length", e))?;
    count.check(&stored, shape.frame_bytes()).map_err(refused)?;
    after(samples, shape.frame_bytes())?;
    Ok(At::Byte(samples))
}

/// Where an appended array starts: its offset counts from the `_` after the tag.
fn appended(file: &FileBytes, array: &Array, tag_end: u64) -> Result<u64> {
    let mut gap = [0; 64];
    let len = usize::try_from(file.len().saturating_sub(tag_end)).unwrap_or(gap.len()).min(gap.len());
    file.read_at(tag_end, &mut gap[..len]).map_err(|e| Error::io(file.path(), "reading the appended data", e))?;
    let mark = gap[..len].iter().position(|b| !b.is_ascii_whitespace()).filter(|at| gap[*at] == b'_');
    let refused = |what| Error::input(file.path(), what);
    let mark = mark.ok_or_else(|| refused("its appended data does not start with an underscore"))?;
    let offset = array.offset.ok_or_else(|| refused("its appended array has no offset"))?;
    (tag_end + mark as u64 + 1).checked_add(offset).ok_or_else(|| refused("its array's offset is too large"))
}

fn described(header: &Header, array: &Array, (shape, stored): (Shape, Stored), file: &FileBytes, at: At) -> Described {
    let decoded = matches!(at, At::Decoded(_));
    let part = Part { path: file.path().into(), state: file.state(), frames: 1, stored, at };
    let mut described = Described::plain(shape, vec![part]);
    let shift = if array.of == Association::Cells { 0.5 } else { 0.0 };
    described.spacing = header.spacing;
    described.origin =
        std::array::from_fn(|a| header.origin[a] + (header.extent[2 * a] as f64 + shift) * header.spacing[a]);
    described.variable = Some(array.name.clone());
    if header.direction != IDENTITY {
        described.notes.push("the Direction of the .vti is not kept: axes are taken as those of the world".into());
    }
    if decoded {
        described.notes.push("base64 arrays are decoded in memory; appended raw arrays read faster".into());
    }
    described
}

#[cfg(test)]
mod tests;
