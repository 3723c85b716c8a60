//! Files of named arrays, such as HDF5 and NetCDF, and named arrays that the caller holds ([`held`]). One variable is an
//! archive, read chunk by chunk.
//!
//! An [`ArrayFile`] lists the arrays. [`choose`] finds the variable, [`axes`] the meaning of its axes, [`places`] the
//! positions of voxels and frames, and [`values`] the meaning of its numbers. [`chunks`] reads it, unless it is stored as
//! it is ([`in_place`]).

mod axes;
mod beside;
mod choose;
mod chunks;
mod describe;
#[cfg(feature = "hdf5")]
mod hdf5;
pub(in crate::source) mod held;
#[cfg_attr(not(feature = "netcdf"), allow(dead_code, reason = "classic NetCDF alone says where numbers are"))]
mod in_place;
#[cfg(feature = "netcdf")]
mod netcdf;
mod openpmd;
mod places;
#[cfg(feature = "hdf5")]
mod scales;
mod values;
mod vtkhdf;
#[cfg(feature = "zarr")]
mod zarr;

use super::shared::component;
use crate::base::description::{self, Description};
use crate::base::error::{Error, Note, Result};
use crate::base::mapped::{Access, FileBytes, State};
use crate::base::stored::StoredType;
use crate::source::file_header::{FileHeader, Units};
use crate::source::layout::{Axis, Counts, Layout, Shape};
use crate::source::parts::{DataLocation, Part, Stored};
use crate::source::{Advised, Extent, OpenOptions, Parsed, numbering};
use choose::Choice;
use chunks::Chunks;
use in_place::InPlace;
use places::Places;
use std::collections::BTreeMap;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};
use values::Values;

/// An array and its attributes.
#[derive(Debug, Clone)]
struct Variable {
    /// Its name, with those of the groups that it is in.
    path: String,
    /// The type of its numbers, or the name of one that is not supported.
    sample: Parsed<StoredType>,
    /// The slowest axis first.
    lengths: Vec<usize>,
    /// Name of each axis; empty where it has none.
    dims: Vec<String>,
    /// Chunk lengths, if it is stored in chunks.
    chunk: Option<Vec<usize>>,
    attributes: Attributes,
}

type Attributes = BTreeMap<String, Attribute>;

/// The value of an attribute.
#[derive(Debug, Clone, PartialEq)]
enum Attribute {
    Text(String),
    Texts(Vec<String>),
    Numbers(Vec<f64>),
}

/// The numbers of an attribute; empty if it has none.
fn numbers<'a>(attributes: &'a Attributes, name: &str) -> &'a [f64] {
    match attributes.get(name) {
        Some(Attribute::Numbers(numbers)) => numbers,
        _ => &[],
    }
}

impl Variable {
    fn text(&self, attribute: &str) -> Option<&str> {
        match self.attributes.get(attribute)? {
            Attribute::Text(text) => Some(text.trim()),
            Attribute::Texts(_) | Attribute::Numbers(_) => None,
        }
    }

    fn numbers(&self, attribute: &str) -> &[f64] {
        numbers(&self.attributes, attribute)
    }

    fn number(&self, attribute: &str) -> Option<f64> {
        self.numbers(attribute).first().copied()
    }

    /// Its path, as users name it.
    fn shown(&self) -> &str {
        self.path.trim_start_matches('/')
    }

    /// The last part of its path.
    fn name(&self) -> &str {
        self.path.rsplit('/').next().unwrap_or_default()
    }

    /// The variable that says where the voxels or frames of an axis are: it has the axis' name, and this one only.
    fn coordinate<'a>(&self, axis: usize, all: &'a [Self]) -> Option<&'a Self> {
        let dim = self.dims[axis].as_str();
        let folder = &self.path[..self.path.len() - self.name().len()];
        let is = |v: &&Self| !dim.is_empty() && v.name() == dim && v.lengths == [self.lengths[axis]];
        let near = |v: &&Self| is(v) && v.path.strip_suffix(dim) == Some(folder);
        all.iter().find(near).or_else(|| all.iter().find(is))
    }
}

/// An open file of arrays.
trait ArrayFile: Send {
    /// All arrays that are in it.
    fn variables(&self) -> Parsed<Vec<Variable>>;

    /// The numbers of a box of an array, little-endian, the last axis fastest.
    fn read(&self, path: &str, ty: StoredType, ranges: &[Range<usize>]) -> Parsed<Vec<u8>>;

    /// All numbers of an array with one axis or none, which may be of any type.
    fn numbers(&self, path: &str) -> Parsed<Vec<f64>>;

    /// The attributes of an array, with their types and in the file's order; of the whole file with an empty path.
    fn described(&self, path: &str) -> Vec<description::Attribute> {
        let _ = path;
        Vec::new()
    }

    /// All values of an array.
    fn values(&self, path: &str) -> Parsed<description::Values> {
        self.numbers(path).map(|numbers| description::Values::floats(&numbers))
    }

    /// The type of an array's numbers.
    fn number_type(&self, path: &str) -> Parsed<description::NumberType> {
        let _ = path;
        Ok(description::NumberType::F64)
    }

    /// The axes along which an array may grow.
    fn growing_axes(&self, path: &str) -> Vec<usize> {
        let _ = path;
        Vec::new()
    }

    /// Whether the file may grow along a dimension.
    fn is_unlimited(&self, dimension: &str) -> bool {
        let _ = dimension;
        false
    }

    /// Where the numbers of an array are, if they are stored uncompressed.
    fn in_place(&self, path: &str) -> Option<InPlace> {
        let _ = path;
        None
    }

    /// The attributes of a group; empty if there is no such group.
    fn group(&self, path: &str) -> Attributes {
        let _ = path;
        Attributes::new()
    }
}

/// How a file is read.
#[derive(Debug, Clone, Copy)]
struct ReadConfig {
    #[cfg_attr(not(feature = "hdf5"), allow(dead_code, reason = "Zarr stores are folders, read by their crate"))]
    access: Access,
    /// Bytes that reading may take.
    memory: usize,
}

/// Opens a file of one format, or what the caller holds.
type OpenFile = Arc<dyn Fn(&Path, ReadConfig) -> Result<Box<dyn ArrayFile>> + Send + Sync>;

/// Opens a file of arrays, any number of times.
#[derive(Clone)]
struct Opener {
    path: PathBuf,
    how: ReadConfig,
    open: OpenFile,
    /// The file, while frames are taken of any of its arrays.
    opened: Arc<Mutex<Option<Box<dyn ArrayFile>>>>,
}

impl Opener {
    fn new(path: &Path, open: OpenFile, options: &OpenOptions) -> Self {
        let how = ReadConfig { access: options.access, memory: options.memory / SHARE };
        Self { path: path.into(), how, open, opened: Arc::default() }
    }

    fn open(&self) -> Result<Box<dyn ArrayFile>> {
        (self.open)(&self.path, self.how)
    }

    /// Hands out the open file, which is open until the next [`Opener::close`].
    fn with_file<T>(&self, use_it: impl FnOnce(&dyn ArrayFile) -> Result<T>) -> Result<T> {
        let mut opened = self.opened.lock().unwrap_or_else(PoisonError::into_inner);
        if opened.is_none() {
            *opened = Some(self.open()?);
        }
        opened.as_deref().map(use_it).expect("it was opened")
    }

    /// Closes the file, unless arrays besides the one that asks are read from it.
    fn close(&self) {
        if Arc::strong_count(&self.opened) == 1 {
            self.opened.lock().unwrap_or_else(PoisonError::into_inner).take();
        }
    }
}

/// A file of arrays that was opened to see what it holds.
pub(super) struct ArrayArchive {
    format: &'static str,
    opener: Opener,
    file: Box<dyn ArrayFile>,
    /// The file whose state shows whether the archive was changed; `None` if the caller holds the arrays.
    watched: Option<PathBuf>,
}

/// Opens an HDF5 file. One that the NetCDF library wrote is a NetCDF file, whatever its name is.
#[cfg(feature = "hdf5")]
pub(super) fn open_hdf5(path: &Path, options: &OpenOptions) -> Result<ArrayArchive> {
    let archive = ArrayArchive::open("HDF5", (path, Some(path)), Arc::new(hdf5::open), options)?;
    match archive.file.group("/").contains_key("_NCProperties") {
        #[cfg(feature = "netcdf")]
        true => open_netcdf(path, options),
        #[cfg(not(feature = "netcdf"))]
        true => Err(super::not_built_in(path, super::Format::NetCdf, "netcdf")),
        false => Ok(archive),
    }
}

/// Opens a NetCDF file.
#[cfg(feature = "netcdf")]
pub(super) fn open_netcdf(path: &Path, options: &OpenOptions) -> Result<ArrayArchive> {
    ArrayArchive::open("NetCDF", (path, Some(path)), Arc::new(netcdf::open), options)
}

/// Opens a Zarr store, a folder.
#[cfg(feature = "zarr")]
pub(super) fn open_zarr(path: &Path, options: &OpenOptions) -> Result<ArrayArchive> {
    let metadata = super::zarr_metadata(path).ok_or_else(|| Error::input(path, "is no Zarr store"))?;
    ArrayArchive::open("Zarr", (path, Some(&metadata)), Arc::new(zarr::open), options)
}

impl ArrayArchive {
    fn open(
        format: &'static str,
        (path, watched): (&Path, Option<&Path>),
        open: OpenFile,
        options: &OpenOptions,
    ) -> Result<Self> {
        let opener = Opener::new(path, open, options);
        Ok(Self { format, file: opener.open()?, opener, watched: watched.map(Path::to_path_buf) })
    }

    /// The state of the file that is watched.
    fn state(&self) -> Result<State> {
        self.watched.as_ref().map_or(Ok(State::HELD), |path| Ok(FileBytes::open(path, Access::Read)?.state()))
    }

    /// All arrays, or those of an image in VTKHDF.
    fn variables(&self) -> Parsed<(Vec<Variable>, Option<vtkhdf::Image>)> {
        let all = self.file.variables()?;
        let image = vtkhdf::Image::of(self.file.as_ref(), &all)?;
        Ok((image.as_ref().map_or(all, |image| image.variables.clone()), image))
    }

    /// The variables among which the user must choose; none if it is clear which one is meant.
    #[cfg(any(feature = "hdf5", feature = "netcdf", feature = "zarr"))]
    pub(super) fn undecided(&self) -> Result<Vec<crate::source::VariableInfo>> {
        let (all, image) = self.variables().map_err(|e| Error::input(&self.opener.path, e))?;
        Ok(choose::undecided(&all, active(image.as_ref())))
    }

    /// Describes the frames of the chosen variable.
    pub(super) fn describe(&self, options: &OpenOptions, extent: Extent) -> Result<FileHeader> {
        let (path, state) = (self.opener.path.as_path(), self.state()?);
        let refused = |e| Error::input(path, e);
        let (all, image) = self.variables().map_err(refused)?;
        let (choice, index) = match options.variable.as_deref() {
            Some(name) => choose::named(&all, name).map_err(Note::from),
            None => choose::only(&all, active(image.as_ref())).map(|choice| (choice, None)),
        }
        .map_err(|e| Error::input(path, e))?;
        check_steps(path, &choice, options)?;
        let (axes, spaced) = (options.axes.as_deref(), options.spacing.is_some());
        let (file, format) = (self.file.as_ref(), self.format);
        let context = Context { format, file, all: &all, image, index, axes, spaced, extent };
        let found = choice.arrays.iter().map(|array| context.found(array)).collect::<Advised<Vec<_>>>();
        let found = found.map_err(|e| Error::input(path, e))?;
        let mut parts = Vec::new();
        for found in &found {
            parts.push(self.part(found, state)?);
        }
        let mut described = joined(found, parts).map_err(refused)?;
        if let Some((times, are_seconds)) = openpmd::times(self.file.as_ref(), &choice) {
            (described.times, described.units.times) = (times, are_seconds.then(|| "s".into()));
        }
        if choice.arrays.len() > 1 {
            take_times(&mut described, (self.file.as_ref(), &all), &choice);
            described.notes.push(format!("frames are the {} arrays {}", choice.arrays.len(), choice.path).into());
        }
        Ok(described)
    }
}

/// Takes the times beside arrays for the steps, if these have none.
fn take_times(described: &mut FileHeader, (file, all): (&dyn ArrayFile, &[Variable]), choice: &Choice<'_>) {
    let count = choice.arrays.len();
    if described.times.len() == count {
        return;
    }
    let mut places = Places::default();
    places.take_times_beside((file, all), &beside::Frames { group: choice.group(), axis: "", count });
    if places.times.len() == count {
        (described.times, described.units.times) = (places.times, places.time_unit);
        described.units.calendar = places.calendar;
    }
    described.notes.extend(places.notes);
}

impl ArrayArchive {
    /// The frames of an array: where they are, or how to decode them.
    fn part(&self, found: &ResolvedArray, state: State) -> Result<Part> {
        let refused = |e| Error::input(&self.opener.path, e);
        let path = self.watched.as_ref().unwrap_or(&self.opener.path);
        let (file, variable) = ((path.as_path(), state), &found.variable);
        if let Some(place) = self.file.in_place(&variable.path).filter(|_| found.order.is_empty()) {
            return found.in_place(file, place).map_err(refused);
        }
        let chunks = Chunks::new(variable, &found.counts, found.order.clone(), &self.opener)?;
        found.part(file, chunks).map_err(refused)
    }
}

/// The name of the active array of an image.
fn active(image: Option<&vtkhdf::Image>) -> Option<&str> {
    image.and_then(|image| image.active.as_deref())
}

/// An error if steps are not numbered regularly.
fn check_steps(path: &Path, choice: &Choice<'_>, options: &OpenOptions) -> Result<()> {
    let names: Vec<PathBuf> = choice.steps.iter().map(|step| format!("step {step}").into()).collect();
    if options.allow_gaps {
        return Ok(());
    }
    numbering::check(&names)
        .map_err(|e| Error::input(path, Note { text: format!("{}: {e}", choice.path), remedy: e.remedy() }))
}

/// One archive of the arrays of all steps.
fn joined(mut found: Vec<ResolvedArray>, parts: Vec<Part>) -> Parsed<FileHeader> {
    let first = found.swap_remove(0);
    if let Some(other) = found.iter().find(|other| other.layout.dims() != first.layout.dims()) {
        let (a, b) = (&first.variable, &other.variable);
        return Err(format!("{} has {:?} samples, but {} has {:?}", b.path, b.lengths, a.path, a.lengths));
    }
    if let Some(other) = found.iter().find(|other| other.values.sample != first.values.sample) {
        return Err(format!("{} and {} have samples of different types", first.variable.path, other.variable.path));
    }
    first.described(parts)
}

/// Decoded chunks get one part in so many of the memory for a window.
const SHARE: usize = 4;

/// What variables are found in.
struct Context<'a> {
    /// Name of the format.
    format: &'static str,
    file: &'a dyn ArrayFile,
    all: &'a [Variable],
    image: Option<vtkhdf::Image>,
    /// Of an axis beside space and time.
    index: Option<usize>,
    /// What axes count, by the user's word.
    axes: Option<&'a str>,
    /// Whether the user gave the spacing of voxels.
    spaced: bool,
    /// What to read beside the samples.
    extent: Extent,
}

/// What an array is.
struct ResolvedArray {
    variable: Variable,
    name: String,
    counts: Vec<Counts>,
    /// The layout of the axes that are read in full (fixed-index axes left out).
    layout: Layout,
    /// Maps output frames to stored frames; empty if the orders agree.
    order: Vec<usize>,
    places: Places,
    values: Values,
    description: Description,
}

impl Context<'_> {
    fn found(&self, variable: &Variable) -> Advised<ResolvedArray> {
        let mesh = openpmd::Mesh::of(self.file, variable);
        let variable = mesh.as_ref().map_or_else(|| variable.clone(), |mesh| mesh.named(variable));
        let sample = variable.sample.clone().map_err(|ty| {
            let path = variable.shown();
            format!("{path} is of type {ty}, which is not supported; integers and floats are")
        })?;
        if variable.lengths.contains(&0) {
            return Err(format!("{} has no samples: its axes are {:?}", variable.shown(), variable.lengths).into());
        }
        let hint = axes::TimeHint::of(&variable, &self.file.growing_axes(&variable.path));
        let (counts, guessed) = axes::counts(&variable, self.all, self.index, self.axes, hint)?;
        let mut places = Places::of((self.file, self.all), &variable, &counts, self.spaced);
        places.notes.extend(guessed);
        let axis = |(i, counts): (usize, &Counts)| match *counts {
            Counts::Only(_) => None,
            counts => Some(Axis { counts, len: variable.lengths[i], backwards: places.is_backwards(counts) }),
        };
        let layout = Layout(counts.iter().enumerate().filter_map(axis).collect());
        layout.bytes(sample.size())?;
        if let Some(mesh) = mesh {
            (places.spacing, places.origin) = mesh.lattice();
            places.space_unit = Some("m".into());
            places.notes.clear();
        }
        let order = self.of_image(&variable, &layout, &mut places)?;
        let name = match self.index {
            Some(index) => format!("{}[{index}]", variable.name()),
            None => variable.name().to_string(),
        };
        let values = Values::of(&variable, sample)?;
        let description = self.described(&variable, &counts, &values, &mut places);
        Ok(ResolvedArray { name, counts, layout, order, places, values, variable, description })
    }

    /// The description of an array. Notes name the parts that are too large to be kept.
    fn described(&self, variable: &Variable, counts: &[Counts], values: &Values, places: &mut Places) -> Description {
        let samples = describe::Samples {
            variable,
            counts,
            backwards: &|counts| places.is_backwards(counts),
            times: places.time_path.as_deref(),
            packed: values.packing.is_some(),
            extent: self.extent,
        };
        let (description, left_out) = describe::description(self.format, self.file, self.all, &samples);
        if !left_out.is_empty() {
            places.notes.push(format!("{} is too large to be kept with the samples", left_out.join(", ")).into());
        }
        description
    }

    /// Takes spacing, origin and times from VTKHDF; returns the order of frames.
    fn of_image(&self, variable: &Variable, layout: &Layout, places: &mut Places) -> Parsed<Vec<usize>> {
        let Some(image) = &self.image else { return Ok(Vec::new()) };
        image.check(layout.dims(), variable)?;
        (places.spacing, places.origin) = image.lattice(variable);
        places.times.clone_from(&image.times);
        if image.is_turned {
            places.notes.push("the Direction of the VTKHDF is not kept: axes are taken as those of the world".into());
        }
        image.offsets(self.file, variable, layout.len(Counts::Frames))
    }
}

impl ResolvedArray {
    /// The frames of this array.
    fn part(&self, (path, state): (&Path, State), chunks: Chunks) -> Parsed<Part> {
        let stored = Stored { packing: self.values.packing.clone(), ..chunks.stored(&self.layout)? };
        let frames = if self.order.is_empty() { self.layout.len(Counts::Frames) } else { self.order.len() };
        Ok(Part { path: path.into(), state, frames, stored, at: DataLocation::Decoded(Box::new(chunks)) })
    }

    /// The frames of this array, which are in the file as they are.
    fn in_place(&self, (path, state): (&Path, State), place: InPlace) -> Parsed<Part> {
        let ty = self.variable.sample.clone()?;
        let axis = |(counts, len): (&Counts, &usize)| Axis {
            counts: *counts,
            len: *len,
            backwards: self.places.is_backwards(*counts),
        };
        let axes = self.counts.iter().zip(&self.variable.lengths).map(axis).collect();
        let stored = Stored { packing: self.values.packing.clone(), ..place.stored(axes, ty, state.len)? };
        let (path, frames) = (path.into(), self.layout.len(Counts::Frames));
        Ok(Part { path, state, frames, stored, at: DataLocation::Byte(place.start) })
    }

    fn described(self, parts: Vec<Part>) -> Parsed<FileHeader> {
        let shape = Shape::new(self.layout.dims(), self.values.sample)?;
        let Places { spacing, origin, times, space_unit, time_unit, calendar, notes, .. } = self.places;
        let units = Units { samples: self.values.unit, times: time_unit, space: space_unit, calendar };
        let (variable, missing, description) = (Some(self.name), self.values.missing, Some(self.description));
        Ok(FileHeader {
            description,
            spacing,
            origin,
            times,
            variable,
            units,
            missing,
            notes,
            ..FileHeader::plain(shape, parts)
        })
    }
}
