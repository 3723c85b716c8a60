//! Reads NRRD.

use super::axes::Axes;
use super::data::{self, NrrdSamples};
use super::header::NrrdHeader;
use super::layout::{NAME, TYPES};
use crate::shared::directions::Placed;
use crate::shared::sequence::stamped_note;
use std::path::Path;
use wavesplat_core::base::description::{Attribute, Description, LPS, RAS, Values};
use wavesplat_core::base::error::{Error, Result};
use wavesplat_core::base::mapped::{Access, FileBytes};
use wavesplat_core::base::stored::StoredType;
use wavesplat_core::source::file_header::{FileHeader, growing_head};
use wavesplat_core::source::layout::Shape;
use wavesplat_core::source::{Advised, OpenOptions, Parsed};

/// Reads the header and checks the size of every data file that is not compressed.
pub(super) fn describe(path: &Path, options: &OpenOptions) -> Result<FileHeader> {
    let refused = |e| Error::input(path, e);
    let file = FileBytes::open(path, Access::Read)?;
    let header = growing_head(&file, NrrdHeader::parse)?;
    let array = NrrdSamples::new(&header, options).map_err(|e| Error::input(path, e))?;
    let parts = data::parts(&file, &header, &array)?;
    let description = description(&header, &array).map_err(refused)?;
    let times = array.axes.times(&header).map_err(refused)?;
    let units = array.axes.units(&header);
    let stamped = array.axes.is_stamped.then(stamped_note);
    let NrrdSamples { shape, placed, variable, .. } = array;
    let Placed { spacing, origin, note, .. } = placed;
    let notes = note.into_iter().chain(stamped).collect();
    Ok(FileHeader { spacing, origin, times, units, variable, notes, description, ..FileHeader::plain(shape, parts) })
}

/// The directions of the axes, and the keys and values of users; none if axes ascend along those of an unnamed world.
fn description(header: &NrrdHeader, array: &NrrdSamples) -> Parsed<Option<Description>> {
    let space = &space(header.get("space").unwrap_or_default());
    let is_plain = space.is_empty() && header.keys.is_empty() && array.placed.is_plain();
    let text = |(name, value): &(String, String)| Attribute { name: name.clone(), value: Values::text(value) };
    let described = array.axes.placed(header)?.description(NAME, space, &array.layout);
    Ok((!is_plain).then(|| Description { global: header.keys.iter().map(text).collect(), ..described }))
}

/// The name of a space of three axes: that of one with time, too, and of one that is named by its first letters.
fn space(name: &str) -> String {
    let bare = name.trim().to_lowercase();
    let bare = bare.strip_suffix("-time").unwrap_or(&bare);
    match bare {
        "ras" | "rast" => RAS.into(),
        "lps" | "lpst" => LPS.into(),
        "las" | "last" => "left-anterior-superior".into(),
        RAS | LPS => bare.into(),
        _ => name.trim().trim_end_matches("-time").into(),
    }
}

impl NrrdSamples {
    fn new(header: &NrrdHeader, options: &OpenOptions) -> Advised<Self> {
        let gzip = is_gzip(header.required("encoding")?)?;
        let axes = Axes::parse(header, options.axes.as_deref())?;
        if axes.len(axes.frames) == 0 {
            return Err("has 0 frames".into());
        }
        if axes.meaning.components() == 0 {
            return Err("has 0 components".into());
        }
        let (index, variable) = axes.meaning.component(None, options.variable.as_deref())?;
        let placed = axes.placed(header)?.placed(axes.meaning.lengths(), "space directions of the NRRD");
        let layout = axes.meaning.layout(&placed, index);
        let ty = stored_type(header.required("type")?)?;
        let shape = Shape::new(layout.dims(), ty.sample())?;
        layout.bytes(ty.size())?;
        Ok(Self { layout, shape, ty, big_endian: big_endian(header, ty)?, gzip, axes, placed, variable })
    }
}

fn is_gzip(encoding: &str) -> Parsed<bool> {
    match encoding.to_lowercase().as_str() {
        "raw" => Ok(false),
        "gzip" | "gz" => Ok(true),
        other => Err(format!("encoding {other} is not supported; only raw and gzip are")),
    }
}

fn big_endian(header: &NrrdHeader, ty: StoredType) -> Parsed<bool> {
    match header.get("endian").map(str::to_lowercase).as_deref() {
        Some("big") => Ok(true),
        Some("little") => Ok(false),
        None if ty.size() == 1 => Ok(false),
        None => Err("does not say its endian".into()),
        Some(other) => Err(format!("endian {other:?} is not known")),
    }
}

fn stored_type(name: &str) -> Parsed<StoredType> {
    let plain = name.to_lowercase().split_whitespace().collect::<Vec<_>>().join(" ");
    let unsupported = || format!("type {name} is not supported; integers, float and double are");
    TYPES.stored(plain.as_str()).ok_or_else(unsupported)
}
