//! NRRD, attached (`.nrrd`) or with its samples elsewhere (`.nhdr`): axes x y z or x y z t, raw encoding.

mod data;
mod header;

pub(in crate::source) use header::MAGIC;

use crate::error::{Error, Result};
use crate::mapped::{Access, FileBytes};
use crate::sample::SampleType;
use crate::source::Parsed;
use crate::source::described::{Described, head};
use crate::source::frames::Shape;
use header::{Header, numbers};
use std::path::Path;

const MAX_HEADER: usize = 16 << 20; // bytes; a list of data files may be long
const FIRST_READ: usize = 4 << 10;

/// Reads the header and checks the size of every data file.
pub(super) fn describe(path: &Path) -> Result<Described> {
    let refused = |e| Error::input(path, e);
    let file = FileBytes::open(path, Access::Read)?;
    let header = read_header(&file)?;
    let Geometry { shape, frames, big_endian } = geometry(&header).map_err(refused)?;
    let mut notes = Vec::new();
    let (spacing, origin) = grid(&header, &mut notes).map_err(refused)?;
    let parts = data::parts(&file, &header, &shape, frames, big_endian)?;
    let times = times(&header, frames).map_err(refused)?;
    Ok(Described { spacing, origin, times, notes, ..Described::plain(shape, parts) })
}

fn read_header(file: &FileBytes) -> Result<Header> {
    let mut len = FIRST_READ;
    loop {
        let bytes = head(file, len)?;
        let whole = bytes.len() as u64 == file.len();
        if let Some(header) = Header::parse(&bytes, whole).map_err(|e| Error::input(file.path(), e))? {
            return Ok(header);
        }
        if len >= MAX_HEADER {
            return Err(Error::input(file.path(), format!("its header does not end within {MAX_HEADER} bytes")));
        }
        len *= 4;
    }
}

struct Geometry {
    shape: Shape,
    frames: usize,
    big_endian: bool,
}

fn geometry(header: &Header) -> Parsed<Geometry> {
    let encoding = header.required("encoding")?.to_lowercase();
    if encoding != "raw" {
        return Err(format!("encoding {encoding} is not supported; only raw is"));
    }
    let axes: usize = header.required("dimension")?.parse().map_err(|_| "dimension is no number")?;
    if axes != 3 && axes != 4 {
        return Err(format!("has {axes} dimension(s); supported are 3 (x y z) and 4 (x y z t)"));
    }
    let sizes: Vec<usize> = numbers(header.required("sizes")?, "sizes", axes)?;
    check_kinds(header, axes)?;
    let frames = sizes.get(3).copied().unwrap_or(1);
    if frames == 0 {
        return Err("has 0 frames".into());
    }
    let sample = sample_type(header.required("type")?)?;
    let shape = Shape::new([sizes[0], sizes[1], sizes[2]], sample)?;
    Ok(Geometry { shape, frames, big_endian: big_endian(header, sample)? })
}

fn big_endian(header: &Header, sample: SampleType) -> Parsed<bool> {
    match header.get("endian").map(str::to_lowercase).as_deref() {
        Some("big") => Ok(true),
        Some("little") => Ok(false),
        None if sample.size() == 1 => Ok(false),
        None => Err("does not say its endian".into()),
        Some(other) => Err(format!("endian {other:?} is not known")),
    }
}

fn sample_type(name: &str) -> Parsed<SampleType> {
    let plain = name.to_lowercase().split_whitespace().collect::<Vec<_>>().join(" ");
    Ok(match plain.as_str() {
        "signed char" | "int8" | "int8_t" => SampleType::I8,
        "uchar" | "unsigned char" | "uint8" | "uint8_t" => SampleType::U8,
        "short" | "short int" | "signed short" | "signed short int" | "int16" | "int16_t" => SampleType::I16,
        "ushort" | "unsigned short" | "unsigned short int" | "uint16" | "uint16_t" => SampleType::U16,
        "int" | "signed int" | "int32" | "int32_t" => SampleType::I32,
        "uint" | "unsigned int" | "uint32" | "uint32_t" => SampleType::U32,
        "float" => SampleType::F32,
        "double" => SampleType::F64,
        _ => return Err(format!("type {name} is not supported; integers up to 32 bits, float and double are")),
    })
}

/// Refuses axes that are not x y z \[t\] in this order.
fn check_kinds(header: &Header, axes: usize) -> Parsed<()> {
    let kinds = header.get("kinds").unwrap_or_default();
    for (axis, kind) in kinds.split_whitespace().enumerate() {
        match kind.to_lowercase().as_str() {
            "domain" | "space" | "none" | "???" => {}
            "time" | "list" if axis == 3 => {}
            "time" => {
                return Err(format!("axis {axis} of {axes} is time; it must be the slowest of four axes, after x y z"));
            }
            _ => return Err(format!("axis {axis} is of kind {kind}: one scalar for each voxel is supported")),
        }
    }
    let directions = header.get("spacedirections").unwrap_or_default();
    match directions.split_whitespace().position(|d| d.eq_ignore_ascii_case("none")) {
        Some(axis) if !directions.trim_end().to_lowercase().ends_with("none") => {
            Err(format!("axis {axis} has no space direction: the axes must be x y z, then time"))
        }
        _ => Ok(()),
    }
}

/// Spacing and origin of x, y, z.
fn grid(header: &Header, notes: &mut Vec<String>) -> Parsed<([f64; 3], [f64; 3])> {
    let spacing = spacing(header, notes)?;
    if let Some(text) = header.get("spaceorigin") {
        return Ok((spacing, vectors(text)?.first().copied().ok_or("space origin is no vector")?));
    }
    let mut origin = [0.0; 3];
    if let Some(text) = header.get("axismins") {
        let mins: Vec<f64> = numbers(text, "axis mins", 0)?;
        let centers = header.get("centerings").or(header.get("centers")).unwrap_or_default().to_lowercase();
        let cell = |axis| centers.split_whitespace().nth(axis) == Some("cell");
        for (axis, (origin, min)) in origin.iter_mut().zip(&mins).enumerate().filter(|(_, (_, min))| min.is_finite()) {
            *origin = min + if cell(axis) { spacing[axis] / 2.0 } else { 0.0 };
        }
    }
    Ok((spacing, origin))
}

fn spacing(header: &Header, notes: &mut Vec<String>) -> Parsed<[f64; 3]> {
    if let Some(text) = header.get("spacedirections") {
        let vectors = vectors(text)?;
        let [x, y, z] = vectors[..] else {
            return Err(format!("space directions must be three vectors of three numbers, not {text:?}"));
        };
        let spacing = [x, y, z].map(|v| v.iter().map(|c| c * c).sum::<f64>().sqrt());
        if [x[0], y[1], z[2]] != spacing {
            notes.push("the space directions of the NRRD are not kept: axes are taken as those of the world".into());
        }
        return Ok(spacing);
    }
    let Some(text) = header.get("spacings") else { return Ok([1.0; 3]) };
    let spacings: Vec<f64> = numbers(text, "spacings", 0)?;
    Ok(std::array::from_fn(|a| spacings.get(a).copied().filter(|s| !s.is_nan()).unwrap_or(1.0)))
}

/// Vectors such as `(1,0,0) (0,1,0) none`, without the `none`.
fn vectors(text: &str) -> Parsed<Vec<[f64; 3]>> {
    let wrong = || format!("{text:?} is not made of vectors of three numbers such as (1,0,0)");
    let inside = text.split('(').skip(1).map(|v| v.split(')').next().unwrap_or_default());
    let vector = |v: &str| -> Option<[f64; 3]> {
        let numbers: Option<Vec<f64>> = v.split(',').map(|n| n.trim().parse().ok()).collect();
        numbers?.try_into().ok()
    };
    inside.map(|v| vector(v).ok_or_else(wrong)).collect()
}

/// Times where the fourth axis has a spacing.
fn times(header: &Header, frames: usize) -> Parsed<Vec<f64>> {
    let fourth = |field, what| -> Parsed<Option<f64>> {
        let all: Vec<f64> = numbers(header.get(field).unwrap_or_default(), what, 0)?;
        Ok(all.get(3).copied().filter(|n| n.is_finite()))
    };
    let Some(step) = fourth("spacings", "spacings")? else { return Ok(Vec::new()) };
    let first = fourth("axismins", "axis mins")?.unwrap_or(0.0);
    Ok((0..frames).map(|i| first + step * i as f64).collect())
}

#[cfg(test)]
mod tests;
