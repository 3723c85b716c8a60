//! How extracted samples are written in a format.

use super::FORMATS;
use super::contents::Contents;
use super::encoding::Encoding;
use super::order::SampleOrder;
use std::fmt;
use std::io::{self, Write};
use std::path::Path;
use wavesplat_core::base::error::Result;
use wavesplat_core::base::output::Placed;
use wavesplat_core::base::sample::SampleType;

/// A way to write samples.
pub struct Writer {
    /// Its name, which is also its file extension.
    pub(crate) name: &'static str,
    /// Its place among the names in messages.
    pub(crate) place: usize,
    /// The format's name in notes; `None` if it stores everything.
    pub label: Option<&'static str>,
    /// The files of one extraction.
    pub files: OutputFiles,
    pub(crate) axes: Axes,
    /// Whether samples may be floats of 16 bits.
    pub(crate) has_halves: bool,
    /// Whether samples have their most significant byte first.
    pub(crate) is_big_endian: fn(&Contents) -> bool,
    /// Whether it can store times that are not at regular steps.
    pub(crate) has_times: bool,
    /// Whether it can store positions of voxels that are not at regular steps.
    pub(crate) has_coordinates: bool,
    /// Whether the whole file is in gzip.
    pub gzip: bool,
    /// Writes the header before the samples of a file.
    pub before: fn(&Contents, Samples, &mut dyn Write) -> io::Result<()>,
    /// The bytes after the samples.
    pub after: fn(&Contents, Samples) -> Vec<u8>,
}

/// The samples of a file.
#[derive(Debug, Clone, Copy)]
pub struct Samples {
    /// Their type in the file.
    pub ty: SampleType,
    /// The first of their frames, counted from the first extracted one.
    pub frame: usize,
}

/// The files of one extraction.
pub enum OutputFiles {
    /// One for all frames.
    One,
    /// One for each frame.
    EachFrame,
    /// One for each frame in a folder, with this extension, and a list of them.
    List {
        /// The extension of the frames' files.
        extension: &'static str,
        /// Writes the list.
        write: WriteList,
    },
    /// One for all frames, with this extension, and a header beside it.
    WithHeader {
        /// The extension of the file of samples.
        extension: &'static str,
        /// Writes the header.
        write: WriteHeader,
    },
    /// A folder.
    Folder(CreateFolder),
}

/// Writes a list of files by their names.
pub(crate) type WriteList = fn(&Contents, &mut dyn Iterator<Item = String>, &mut dyn Write) -> io::Result<()>;

/// Writes the header of samples of a type that are in the file of a name.
pub(crate) type WriteHeader = fn(&Contents, SampleType, &str, &mut dyn Write) -> io::Result<()>;

/// Creates a folder; an existing one is an error unless the flag says to replace it.
pub(crate) type CreateFolder = fn(&Path, &Contents, Encoding, bool) -> Result<Box<dyn SampleSink>>;

/// Takes samples in their order.
pub trait SampleSink: fmt::Debug {
    /// Writes the next samples, given little-endian.
    fn write(&mut self, samples: &[u8]) -> Result<()>;

    /// The file of samples, if it is one that takes them as they are and at any place. Nothing must have been written.
    fn placed(&mut self) -> Result<Option<Placed<'_>>> {
        Ok(None)
    }

    /// Continues after all samples, which were placed.
    fn skip_placed(&mut self) -> Result<()> {
        Ok(())
    }

    /// Completes the output.
    fn finish(self: Box<Self>) -> Result<()>;
}

/// The axes of the written array.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Axes {
    /// Frame by frame, x fastest.
    Plain,
    /// Those of the source's array.
    Source,
    /// Frame by frame, with the voxels in the order of the source's array and its directions in the world.
    Lattice,
    /// The same where it cannot be said otherwise: programs that show such files rarely turn them.
    LatticeIfNeeded,
}

impl Writer {
    /// Samples alone, in one file.
    pub(crate) const PLAIN: Self = Self {
        name: "raw",
        place: 1,
        label: None,
        files: OutputFiles::One,
        axes: Axes::Plain,
        has_halves: false,
        is_big_endian: |_| false,
        has_times: true,
        has_coordinates: false,
        gzip: false,
        before: |_, _, _| Ok(()),
        after: |_, _| Vec::new(),
    };
}

/// A format of extracted samples.
#[derive(Clone, Copy)]
pub struct SampleFormat(&'static Writer);

impl fmt::Debug for SampleFormat {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_tuple("SampleFormat").field(&self.name()).finish()
    }
}

impl SampleFormat {
    /// All formats, in the order of messages.
    pub fn all() -> Vec<Self> {
        let mut all: Vec<Self> = FORMATS.iter().flat_map(|format| format.writers).map(Self).collect();
        all.sort_by_key(|format| format.0.place);
        all
    }

    /// Its name, which is also its file extension.
    pub fn name(self) -> &'static str {
        self.0.name
    }

    /// The format of a name.
    pub fn named(name: &str) -> Option<Self> {
        Self::all().into_iter().find(|format| format.name() == name)
    }

    /// The format for a path's extension.
    pub fn of_ending(path: &Path) -> Option<Self> {
        let name = path.file_name()?.to_str()?;
        let has = |ending: &str| name.strip_suffix(ending).is_some_and(|stem| stem.ends_with('.'));
        let known = Self::all().into_iter().find(|format| has(format.name()));
        known.or_else(|| Self::named("raw").filter(|_| has("bin")))
    }

    /// How it is written.
    pub fn writer(self) -> &'static Writer {
        self.0
    }

    /// How the samples are written in this format.
    pub fn encoding(self, contents: &Contents) -> Encoding {
        let from = contents.sample;
        let to = if from == SampleType::F16 && !self.0.has_halves { SampleType::F32 } else { from };
        Encoding { from, to, big_endian: (self.0.is_big_endian)(contents) }
    }

    /// The order in which this format has the samples.
    pub fn order(self, contents: &Contents) -> SampleOrder {
        match &contents.description {
            Some(description) if self.0.axes == Axes::Source => SampleOrder::of_source(description),
            Some(description) if self.0.axes.are_of_lattice(contents) => SampleOrder::of_lattice(description),
            _ => SampleOrder::default(),
        }
    }

    /// Notes for the user on what the format cannot store exactly.
    pub fn notes(self, contents: &Contents) -> Vec<String> {
        let Writer { label: Some(name), has_times, has_coordinates, .. } = self.0 else { return Vec::new() };
        let Encoding { from, to, .. } = self.encoding(contents);
        let retyped = (from != to).then(|| format!("{name} has no {from}: the samples are written as {to}, exactly"));
        let untimed =
            !has_times && !contents.numbered && contents.times.len() > 1 && contents.regular_times().is_none();
        let untimed = untimed
            .then(|| format!("{name} can store only times at regular steps: the times of these frames are left out"));
        let irregular = contents.irregular_axes();
        let irregular = (!has_coordinates && !irregular.is_empty()).then(|| {
            format!("{name} has only regular steps: .vtr, .nc and .zarr keep the places along {}", irregular.join(", "))
        });
        retyped.into_iter().chain(untimed).chain(irregular).collect()
    }
}

impl Axes {
    /// Whether voxels are written in the order of the source's array, with its directions in the world.
    pub(crate) fn are_of_lattice(self, contents: &Contents) -> bool {
        let is_oriented = contents.description.as_ref().is_some_and(|all| all.orientation.is_some());
        is_oriented
            && match self {
                Self::Lattice => true,
                Self::LatticeIfNeeded => contents.is_from_vtk() || !contents.is_straight(),
                Self::Plain | Self::Source => false,
            }
    }
}
