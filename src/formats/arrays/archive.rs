//! One variable of a file of arrays as frames.

use super::choose::{self, Wanted};
use super::chunks::Chunks;
use super::opener::{OpenFile, Opener};
use super::places::Places;
use super::resolve::{Context, ResolvedArray};
use super::sibling_times::StepArrays;
use super::steps::Choice;
use super::{ArrayFile, FileArrays, Variable, minc, openpmd, vtkhdf};
use crate::numbering;
use crate::shared::offer::Offer;
use std::path::{Path, PathBuf};
use wavesplat_core::base::error::{Error, Note, Result};
use wavesplat_core::base::mapped::{Access, FileBytes, State};
use wavesplat_core::source::file_header::FileHeader;
use wavesplat_core::source::parts::Part;
use wavesplat_core::source::{Advised, Extent, OpenOptions, Parsed};

/// Names that lead elsewhere, each with a note.
const MOST_NOTES: usize = 3;

/// An open file of arrays.
pub(crate) struct ArrayArchive {
    format: &'static str,
    opener: Opener,
    file: Box<dyn ArrayFile>,
    /// The file whose state shows whether the archive was changed; `None` if the caller holds the arrays.
    watched: Option<PathBuf>,
}

impl ArrayArchive {
    /// Opens a file by `open`. The state of the file `watched` shows whether the archive was changed.
    pub(crate) fn open(
        format: &'static str,
        path: &Path,
        watched: Option<&Path>,
        open: OpenFile,
        options: &OpenOptions,
    ) -> Result<Self> {
        let opener = Opener::new(path, open, options);
        Ok(Self { format, file: opener.open()?, opener, watched: watched.map(Path::to_path_buf) })
    }

    /// Whether the NetCDF library wrote it.
    #[cfg(feature = "hdf5")]
    pub(crate) fn is_of_netcdf(&self) -> bool {
        self.file.group("/").contains_key("_NCProperties")
    }

    /// The state of the file that is watched.
    fn state(&self) -> Result<State> {
        self.watched.as_ref().map_or(Ok(State::HELD), |path| Ok(FileBytes::open(path, Access::Read)?.state()))
    }

    /// All arrays, or those of an image in VTKHDF.
    fn variables(&self) -> Parsed<(Vec<Variable>, Option<vtkhdf::Image>)> {
        let all = self.file.variables()?;
        minc::refuse(&all)?;
        let image = vtkhdf::Image::read(self.file.as_ref(), &all)?;
        Ok((image.as_ref().map_or(all, |image| image.variables.clone()), image))
    }

    /// The variables of the file.
    pub(crate) fn offer(&self) -> Result<Offer> {
        let (all, image) = self.variables().map_err(|e| Error::input(&self.opener.path, e))?;
        Ok(choose::offer(&all, &self.wanted(image.as_ref())))
    }

    /// What the file says of its arrays.
    fn wanted<'a>(&self, image: Option<&'a vtkhdf::Image>) -> Wanted<'a> {
        let active = image.and_then(|image| image.active.as_deref());
        Wanted { active, has_one_step: openpmd::has_one_step(self.file.as_ref()) }
    }

    /// Describes the frames of the chosen variable.
    pub(crate) fn describe(&self, options: &OpenOptions, extent: Extent) -> Result<FileHeader> {
        let (path, state) = (self.opener.path.as_path(), self.state()?);
        let refused = |e| Error::input(path, e);
        let (all, image) = self.variables().map_err(refused)?;
        let (choice, index) = match options.variable.as_deref() {
            Some(name) => choose::named(&all, name).map_err(Note::from),
            None => choose::only(&all, &self.wanted(image.as_ref())).map(|choice| (choice, None)),
        }
        .map_err(|e| Error::input(path, e))?;
        if !options.allow_gaps {
            numbering::check_steps(path, &choice.path, "step", &choice.steps)?;
        }
        let (axes, spaced) = (options.axes.as_deref(), options.spacing.is_some());
        let (arrays, format) = (FileArrays { file: self.file.as_ref(), all: &all }, self.format);
        let context = Context { format, arrays, image, index, axes, spaced, extent };
        let found = choice.arrays.iter().map(|array| context.resolve(array)).collect::<Advised<Vec<_>>>();
        let found = found.map_err(|e| Error::input(path, e))?;
        let mut parts = Vec::new();
        for found in &found {
            parts.push(self.part(found, state)?);
        }
        let mut described = joined(found, parts).map_err(refused)?;
        take_times_of_groups(&mut described, self.file.as_ref(), &choice);
        if choice.arrays.len() > 1 {
            take_times(&mut described, arrays, &choice);
            described.notes.push(format!("frames are the {} arrays {}", choice.arrays.len(), choice.path).into());
        }
        described.notes.extend(on_elsewhere(self.file.elsewhere()).into_iter().map(Note::from));
        Ok(described)
    }

    /// The frames of an array: where they are, or how to decode them.
    fn part(&self, found: &ResolvedArray, state: State) -> Result<Part> {
        let refused = |e| Error::input(&self.opener.path, e);
        let path = self.watched.as_ref().unwrap_or(&self.opener.path);
        if let Some(place) = self.file.in_place(&found.variable.path).filter(|_| found.order.is_empty()) {
            return found.in_place(path, state, place).map_err(refused);
        }
        let chunks = Chunks::new(&found.variable, &found.axes, found.order.clone(), &self.opener)?;
        found.decoded(path, state, chunks).map_err(refused)
    }
}

/// Notes on some of the names that lead elsewhere, and on how many more there are.
fn on_elsewhere(mut all: Vec<String>) -> Vec<String> {
    let more = all.len().saturating_sub(MOST_NOTES);
    all.truncate(MOST_NOTES);
    all.extend((more > 0).then(|| format!("{more} more names lead to what is not read")));
    all
}

/// Uses the times that the groups of the steps state, for steps or for a single frame that has no time.
fn take_times_of_groups(described: &mut FileHeader, file: &dyn ArrayFile, choice: &Choice<'_>) {
    let frames: usize = described.parts.iter().map(|part| part.frames).sum();
    let has_none = choice.arrays.len() > 1 || described.times.is_empty() && frames == 1;
    if let Some((times, are_seconds)) = openpmd::times(file, choice).filter(|_| has_none) {
        (described.times, described.units.times) = (times, are_seconds.then(|| "s".into()));
    }
}

/// Uses the times stored beside the arrays, if the steps have no times of their own.
fn take_times(described: &mut FileHeader, arrays: FileArrays<'_>, choice: &Choice<'_>) {
    let count = choice.arrays.len();
    if described.times.len() == count {
        return;
    }
    let mut places = Places::default();
    places.take_sibling_times(arrays, &StepArrays { group: choice.group(), axis: "", count });
    if places.times.len() == count {
        (described.times, described.units.times) = (places.times, places.time_unit);
        described.units.calendar = places.calendar;
    }
    described.notes.extend(places.notes);
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
