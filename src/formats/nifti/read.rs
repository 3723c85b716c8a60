//! Reads NIfTI.

use super::header::{LONGEST, NiftiHeader, is_nifti};
use super::layout::{DATATYPES, OTHER_UNITS, SPACE_UNITS, TIME_UNITS, UNSUPPORTED};
use crate::shared::deflated::{Compression, Stream};
use crate::shared::directions::Directions;
use crate::shared::extension::extension;
use crate::shared::meaning::{Kind, Meaning};
use std::io::Read;
use std::path::{Path, PathBuf};
use wavesplat_core::base::description::{
    Attribute, AxisRole, Description, NIFTI_HEADER, NumberType, Numbers, RAS, Values,
};
use wavesplat_core::base::error::{Error, Note, Result};
use wavesplat_core::base::mapped::{Access, FileBytes};
use wavesplat_core::base::stored::StoredType;
use wavesplat_core::source::file_header::{FileHeader, Units, check_size, head};
use wavesplat_core::source::layout::Layout;
use wavesplat_core::source::layout::Shape;
use wavesplat_core::source::packing::Packing;
use wavesplat_core::source::parts::{DataLocation, Part, Stored};
use wavesplat_core::source::{Advised, OpenOptions, Parsed};

const GZIP: &[u8] = b"\x1f\x8b";

/// Reads the header, and checks the size of an uncompressed file.
pub(super) fn describe(path: &Path, options: &OpenOptions) -> Result<FileHeader> {
    let path = &header_of(path).unwrap_or_else(|| path.into());
    let refused = |e| Error::input(path, e);
    let (bytes, compressed) = header_bytes(path)?;
    let header = NiftiHeader::parse(&bytes).map_err(refused)?;
    let (data, compressed) = if header.pair { image_of(path)? } else { (path.clone(), compressed) };
    let array = NiftiSamples::new(&header, options).map_err(|e| Error::input(path, e))?;
    let part = array.part(&header, &data, compressed)?;
    let description = array.description(&header, &bytes[..header.len]);
    Ok(FileHeader { description: Some(description), ..array.described(&header, part) })
}

/// The `.hdr` beside an `.img`, which other formats have too.
pub(crate) fn header_of(image: &Path) -> Option<PathBuf> {
    let first = |path: &Path| head(&FileBytes::open(path, Access::Read)?, LONGEST);
    let is_header = |path: &Path| first(path).is_ok_and(|bytes| is_nifti(&bytes) || bytes.starts_with(GZIP));
    beside(image, "img", &["hdr", "hdr.gz"]).find(|path| is_header(path))
}

/// The `.img` beside a `.hdr`, and whether it is compressed.
fn image_of(header: &Path) -> Result<(PathBuf, bool)> {
    let image = beside(header, "hdr", &["img", "img.gz"]).find(|path| path.is_file());
    let image = image.ok_or_else(|| Error::input(header, "has its samples in an .img, but there is none beside it"))?;
    let compressed = extension(&image).ends_with("gz");
    Ok((image, compressed))
}

/// The file with each of some extensions in place of its own, if that is `own`, perhaps in gzip; in capitals if it is.
fn beside(path: &Path, own: &str, others: &'static [&'static str]) -> impl Iterator<Item = PathBuf> {
    let bare = if extension(path).ends_with(".gz") { path.with_extension("") } else { path.to_path_buf() };
    let written = bare.extension().map(|e| e.to_string_lossy().into_owned()).unwrap_or_default();
    let others = if written.eq_ignore_ascii_case(own) { others } else { &[] };
    let capitals = written.chars().all(|c| c.is_ascii_uppercase());
    others.iter().map(move |e| bare.with_extension(if capitals { e.to_uppercase() } else { (*e).to_string() }))
}

/// The first bytes of the file after decompression, and whether it is compressed.
fn header_bytes(path: &Path) -> Result<(Vec<u8>, bool)> {
    let bytes = head(&FileBytes::open(path, Access::Read)?, LONGEST)?;
    if !bytes.starts_with(GZIP) {
        return Ok((bytes, false));
    }
    let mut bytes = Vec::new();
    let stream = Compression::Gzip.open(path, 0)?;
    match stream.take(LONGEST as u64).read_to_end(&mut bytes) {
        Ok(_) => Ok((bytes, true)),
        Err(e) => Err(Error::input(path, format!("its header cannot be decompressed: {e}"))),
    }
}

/// The samples that are meant.
struct NiftiSamples {
    meaning: Meaning,
    layout: Layout,
    shape: Shape,
    ty: StoredType,
    packing: Option<Packing>,
    /// The properties that do not depend on where the samples are.
    known: Placement,
}

/// The grid and the name.
struct Placement {
    spacing: [f64; 3],
    origin: [f64; 3],
    variable: Option<String>,
    notes: Vec<Note>,
}

impl NiftiSamples {
    fn new(header: &NiftiHeader, options: &OpenOptions) -> Advised<Self> {
        let meaning = meaning(header, options.axes.as_deref())?;
        let own = Some(header.intent_name.as_str()).filter(|name| !name.is_empty());
        let (index, variable) = meaning.component(own, options.variable.as_deref())?;
        let placed = directions(header, &meaning).placed(meaning.lengths(), "directions of the NIfTI");
        let layout = meaning.layout(&placed, index);
        let ty = stored_type(header.datatype)?;
        let packing = packing(header)?;
        let sample = packing.as_ref().map_or(ty.sample(), |packing| packing.sample(ty.sample()));
        let shape = Shape::new(layout.dims(), sample)?;
        let known = Placement {
            spacing: placed.spacing,
            origin: placed.origin,
            variable,
            notes: placed.note.into_iter().collect(),
        };
        Ok(Self { meaning, layout, shape, ty, packing, known })
    }

    fn part(&self, header: &NiftiHeader, data: &Path, compressed: bool) -> Result<Part> {
        let refused = |e| Error::input(data, e);
        let file = FileBytes::open(data, Access::Read)?;
        let start = start(header).map_err(refused)?;
        let frames = self.layout.len(AxisRole::Frames);
        let big_endian = header.big_endian;
        let mut part = if compressed {
            let stream = Stream { compression: Compression::Gzip, start: 0, skip: start };
            stream.part(data, file.state(), &self.layout, self.ty, big_endian).map_err(refused)?
        } else {
            let stored = Stored::new(&self.layout, self.ty, big_endian).map_err(refused)?;
            check_size(file.len(), start, &self.shape, self.ty, frames * self.meaning.components()).map_err(refused)?;
            Part { path: data.into(), state: file.state(), frames, stored, at: DataLocation::Byte(start) }
        };
        part.stored.packing.clone_from(&self.packing);
        Ok(part)
    }

    /// The directions of the axes, and the whole header, which extracted files of the format repeat.
    fn description(&self, header: &NiftiHeader, bytes: &[u8]) -> Description {
        let described = directions(header, &self.meaning).description("NIfTI", RAS, &self.layout);
        let value = Values::Numbers(Numbers::new(NumberType::U8, bytes));
        Description { global: vec![Attribute { name: NIFTI_HEADER.into(), value }], ..described }
    }

    fn described(self, header: &NiftiHeader, part: Part) -> FileHeader {
        let Placement { spacing, origin, variable, notes } = self.known;
        let times = self.meaning.frames().map_or_else(Vec::new, |axis| times(header, axis, part.frames));
        let units = Units {
            space: space_unit(header.units).map(String::from),
            times: time_unit(header.units)
                .filter(|_| !times.is_empty() && self.meaning.frames() == Some(FRAMES))
                .map(String::from),
            ..Units::default()
        };
        FileHeader { spacing, origin, times, variable, units, notes, ..FileHeader::plain(self.shape, vec![part]) }
    }
}

/// The axis of frames.
const FRAMES: usize = 3;

/// What the axes count: x, y, z, frames and components, or what the user's letters say.
fn meaning(header: &NiftiHeader, letters: Option<&str>) -> Advised<Meaning> {
    let sizes = lengths(&header.dim)?.to_vec();
    let mut usual = vec![Kind::Voxels(0), Kind::Voxels(1), Kind::Voxels(2), Kind::Frames, Kind::Components];
    let Some(letters) = letters else { return Ok(Meaning { sizes, kinds: usual }) };
    let own = (header.dim[0] as usize).min(sizes.len());
    let Meaning { mut kinds, .. } = Meaning::by_letters(&sizes[..own], letters)?;
    kinds.extend(usual.split_off(own).into_iter().map(|_| Kind::Components));
    Ok(Meaning { sizes, kinds })
}

/// Where voxels are in the world.
fn directions(header: &NiftiHeader, meaning: &Meaning) -> Directions {
    let own = header.directions();
    if meaning.is_in_order() && meaning.voxels() == [0, 1, 2] {
        return own;
    }
    let first = own.first;
    meaning.directions(|axis| own.steps().get(axis).copied(), first)
}

/// Lengths of x, y, z, time and components.
fn lengths(dim: &[i64; 8]) -> Parsed<[usize; 5]> {
    let [axes, all @ ..] = dim;
    let axes = usize::try_from(*axes).ok().filter(|axes| (1..=7).contains(axes));
    let axes = axes.ok_or_else(|| format!("dim[0] is {}, not a number of axes from 1 to 7", dim[0]))?;
    if axes < 3 {
        return Err(format!("has {axes} dimension(s); supported are 3 (x y z), 4 (x y z t) and 5 (x y z t v)"));
    }
    let mut lengths = [1; 7];
    for (axis, (len, dim)) in lengths.iter_mut().zip(&all[..axes]).enumerate() {
        let found = usize::try_from(*dim).ok().filter(|len| *len > 0);
        *len = found.ok_or_else(|| format!("dim[{}] is {dim}: there are no samples", axis + 1))?;
    }
    let [x, y, z, t, v, rest @ ..] = lengths;
    if rest != [1, 1] {
        return Err(format!("has {axes} dimensions; supported are 3 (x y z), 4 (x y z t) and 5 (x y z t v)"));
    }
    Ok([x, y, z, t, v])
}

fn stored_type(datatype: i64) -> Parsed<StoredType> {
    DATATYPES.stored(datatype).ok_or_else(|| match UNSUPPORTED.iter().find(|(code, _)| *code == datatype) {
        Some((_, name)) => {
            format!("its samples are {name} (datatype {datatype}); supported are integers, float32 and float64")
        }
        None => format!("datatype {datatype} is not known"),
    })
}

/// None if the stored numbers are the samples.
fn packing(header: &NiftiHeader) -> Parsed<Option<Packing>> {
    let NiftiHeader { slope, inter, .. } = *header;
    if slope == 0.0 || !slope.is_finite() || (slope == 1.0 && inter == 0.0) {
        return Ok(None);
    }
    if !inter.is_finite() {
        return Err(format!("its scl_slope is {slope}, but its scl_inter {inter} is not finite"));
    }
    Ok(Some(Packing::scaled(slope, inter)))
}

/// Where the samples start in their file.
fn start(header: &NiftiHeader) -> Parsed<u64> {
    let offset = header.vox_offset;
    let least = if header.pair { 0 } else { header.len };
    if offset.fract() != 0.0 || !(least as f64..9e15).contains(&offset) {
        return Err(format!("its vox_offset {offset} is no place after its header of {least} bytes"));
    }
    Ok(offset as u64)
}

/// Times of several frames along an axis, if a step says how far they are apart.
fn times(header: &NiftiHeader, axis: usize, frames: usize) -> Vec<f64> {
    let first = if axis == FRAMES { header.toffset } else { 0.0 };
    let step = if axis <= FRAMES { header.pixdim[axis + 1] } else { f64::NAN };
    if frames == 1 || !(step.is_finite() && step > 0.0 && first.is_finite()) {
        return Vec::new();
    }
    (0..frames).map(|i| first + step * i as f64).collect()
}

fn space_unit(code: i64) -> Option<&'static str> {
    SPACE_UNITS.iter().find(|(known, _)| i64::from(*known) == code & 0x07).map(|(_, names)| names[0])
}

fn time_unit(code: i64) -> Option<&'static str> {
    let mut known = TIME_UNITS.iter().chain(OTHER_UNITS);
    known.find(|(known, _)| i64::from(*known) == code & 0x38).map(|(_, names)| names[0])
}
