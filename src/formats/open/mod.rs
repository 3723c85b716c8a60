//! Opens inputs: finds the files, recognises each format by its extension or first bytes, and reads the headers.

mod links;
pub(crate) mod inputs;
mod magnitude;
mod planes;
#[cfg(test)]
mod axes_tests;
#[cfg(test)]
mod series_tests;
mod stream;
mod follow;

use super::arrays::held::{self, NamedArrays};
use super::format::{Choices, Format, Reader};
use super::shared::extension::extension;
use super::shared::offer::Offer;
use super::{FORMATS, nifti, npy, raw, tif, zarr};
use std::io::Read;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use wavesplat_core::base::error::{Error, Note, Remedy, Result};
use wavesplat_core::base::mapped::{Access, FileBytes};
use wavesplat_core::base::output::STANDARD;
use wavesplat_core::source::file_header::{FileHeader, head};
use wavesplat_core::source::series::{FrameFiles, Series};
use wavesplat_core::source::{Extent, FrameSource, OpenOptions, VariableInfo};

/// Opens an archive: frame files in order, one directory, one pattern, one 4-D file, one list of files (`.pvd`,
/// `.series`), or `-` for standard input.
///
/// The header and size of every file are checked here; samples are read by [`FrameSource::window`].
///
/// # Errors
/// Files that are absent, damaged, of a format or with a feature that is not supported, or unlike the first one;
/// numbers in names that suggest a missing frame; options that do not apply to the format.
///
/// ```
/// # mod wavesplat { pub use wavesplat_core::{base, source}; pub use wavesplat_formats as formats; }
/// use wavesplat::base::error::{Error, Remedy};
/// use wavesplat::formats::open;
/// use wavesplat::source::OpenOptions;
///
/// let dims = Some(vec![4, 4]);
/// match open(&["run.raw".into()], &OpenOptions { dims, ..OpenOptions::default() }) {
///     Err(Error::Setting { setting, problem, .. }) => println!("the field {setting} {problem}"),
///     Err(Error::Io { path, source, .. }) => println!("{} cannot be read: {source}", path.display()),
///     Err(error) if error.remedy() == Some(Remedy::AllowGaps) => println!("frames are missing: {error}"),
///     Err(error) => println!("{error}"),
///     Ok(source) => println!("{:?} voxels", source.archive().grid.dims),
/// }
/// ```
pub fn open(inputs: &[PathBuf], options: &OpenOptions) -> Result<Box<dyn FrameSource>> {
    if let Some(end) = &options.follow {
        return follow::open(inputs, options, end);
    }
    if let [only] = inputs
        && only == Path::new(STANDARD)
    {
        return open_stream(std::io::stdin(), options);
    }
    if !options.magnitude.is_empty() {
        return magnitude::open(inputs, options);
    }
    if options.dims_are_remembered && inputs::have_headers(inputs, options) {
        return open_files(inputs, &options.for_headers());
    }
    open_files(inputs, options)
}

fn open_files(inputs: &[PathBuf], options: &OpenOptions) -> Result<Box<dyn FrameSource>> {
    let inputs::Expanded { files, planes } = inputs::expand(inputs, options)?;
    let open = |options: &OpenOptions| open_series(&files, options);
    match planes {
        Some(planes) => planes::stacked(&files.paths[0], options, planes, open),
        None => Ok(Box::new(open(options)?)),
    }
}

/// The frames of some files.
fn open_series(files: &FrameFiles, options: &OpenOptions) -> Result<Series> {
    let read = if files.paths.len() == 1 { describe } else { describe_frame };
    Series::open(files, options, |path, extent| read(path, options, extent))
}

/// The variables of the first file, if it has several and [`OpenOptions::variable`] must choose one; else none. A
/// stream has one.
///
/// # Errors
/// Files that are absent, damaged or of a format that is not supported.
pub fn undecided(inputs: &[PathBuf], options: &OpenOptions) -> Result<Vec<VariableInfo>> {
    let Offer { variables, is_undecided } = offer(inputs, options)?;
    Ok(if is_undecided { variables } else { Vec::new() })
}

/// The variables of the first file that [`OpenOptions::variable`] can choose; none of a stream, and of files whose only array has no name.
///
/// # Errors
/// Those of [`undecided`].
pub fn variables(inputs: &[PathBuf], options: &OpenOptions) -> Result<Vec<VariableInfo>> {
    offer(inputs, options).map(|offer| offer.variables)
}

/// The variables of the first file.
fn offer(inputs: &[PathBuf], options: &OpenOptions) -> Result<Offer> {
    if options.variable.is_some()
        || !options.magnitude.is_empty()
        || options.dims.is_some()
        || inputs == [Path::new(STANDARD)]
    {
        return Ok(Offer::default());
    }
    let first = match &options.follow {
        Some(end) => follow::first_file(inputs, options, end)?,
        None => inputs::expand(inputs, options)?.files.paths.into_iter().next(),
    };
    first.map_or(Ok(Offer::default()), |first| offer_of_file(&first, options))
}

/// Opens a stream of frames one after another: raw samples if `options` has dims, else one `.npy`, or one for each
/// frame.
///
/// # Errors
/// As [`open`]; messages call the stream `-`.
pub fn open_stream<R: Read + Send + 'static>(reader: R, options: &OpenOptions) -> Result<Box<dyn FrameSource>> {
    open_named_stream(STANDARD, reader, options)
}

/// As [`open_stream`]; `name` stands for the stream in messages.
///
/// # Errors
/// As [`open`].
pub fn open_named_stream<R: Read + Send + 'static>(
    name: impl AsRef<Path>,
    reader: R,
    options: &OpenOptions,
) -> Result<Box<dyn FrameSource>> {
    Ok(Box::new(stream::Stream::open(name.as_ref(), reader, options)?))
}

/// Opens named arrays that the caller holds or computes; `name` stands for them in messages. The variable is chosen, and
/// the meaning of its axes found, as for a NetCDF file. So converting it gives the bytes that the file would give.
///
/// # Errors
/// No variable with three axes, or several; options for headerless data.
pub fn open_arrays(
    name: impl AsRef<Path>,
    arrays: &Arc<dyn NamedArrays>,
    options: &OpenOptions,
) -> Result<Box<dyn FrameSource>> {
    let name = name.as_ref();
    let header = held::describe(name, arrays, options)?;
    Ok(Box::new(Series::single(header, name, options)?))
}

/// The format by extension; `None` for headerless data and unsupported formats.
pub(super) fn by_name(path: &Path) -> Option<&'static Format> {
    let found = extension(path);
    FORMATS.into_iter().find(|format| format.extensions.contains(&found.as_str()))
}

/// The format by extension, or Zarr for a folder that is a Zarr store.
fn of_file(path: &Path) -> Option<&'static Format> {
    let is_store = path.is_dir() && zarr::metadata_file(path).is_some();
    if is_store { Some(&zarr::FORMAT) } else { by_name(path) }
}

const FIRST_READ: usize = 1 << 10; // bytes; what a format is known by is in them

fn by_content(path: &Path) -> Result<Option<&'static Format>> {
    let head = head(&FileBytes::open(path, Access::Read)?, FIRST_READ)?;
    let starts = |format: &&Format| format.starts.iter().any(|start| head.starts_with(start));
    let is_nifti = || nifti::is_nifti(&head) || nifti::header_of(path).is_some();
    Ok(FORMATS.into_iter().find(starts).or_else(|| is_nifti().then_some(&nifti::FORMAT)))
}

/// Whether a file has a header that describes its contents.
fn has_header(path: &Path) -> bool {
    of_file(path).is_some() || by_content(path).is_ok_and(|format| format.is_some())
}

fn format_of(path: &Path, options: &OpenOptions) -> Result<Option<&'static Format>> {
    match of_file(path) {
        None if options.dims.is_none() => by_content(path),
        format => Ok(format),
    }
}

/// Reads the header of a file of frames and checks its size; beside the samples, what `extent` says.
fn describe(path: &Path, options: &OpenOptions, extent: Extent) -> Result<FileHeader> {
    let Some(format) = format_of(path, options)? else {
        let unknown = || Error::path(path, Note::with("is of no known format", Remedy::DescribeSamples));
        return if options.dims.is_none() { Err(unknown()) } else { raw::FORMAT.describe(path, options, extent) };
    };
    refuse_options(path, format, options)?;
    format.describe(path, options, extent)
}

/// As [`describe`], for one of several files: each holds frames, so its axes are clear.
fn describe_frame(path: &Path, options: &OpenOptions, extent: Extent) -> Result<FileHeader> {
    let mut header = describe(path, options, extent)?;
    if of_file(path).is_some_and(|format| format.is(&npy::FORMAT) || format.is(&tif::FORMAT)) {
        header.notes.retain(|note| note.remedy != Some(Remedy::Set("axes")));
    }
    Ok(header)
}

/// The variables of a file.
fn offer_of_file(path: &Path, options: &OpenOptions) -> Result<Offer> {
    match format_of(path, options)?.map(|format| &format.reader) {
        Some(Reader::Arrays(Ok(open))) => open(path, options)?.offer(),
        Some(Reader::Frames(_, Choices::Variables(choice))) => choice(path),
        Some(Reader::Frames(_, Choices::Components)) => {
            let variables = components(path, options);
            Ok(Offer { is_undecided: !variables.is_empty(), variables })
        }
        _ => Ok(Offer::default()), // opening it says what is not built in
    }
}

/// Components that are listed, where one array has several.
const MOST_COMPONENTS: usize = 16;

/// The components of a file's only array, if it has several; none of a file that cannot be read.
fn components(path: &Path, options: &OpenOptions) -> Vec<VariableInfo> {
    let component = |index: usize| {
        let options = OpenOptions { variable: Some(format!("[{index}]")), ..options.clone() };
        let header = describe(path, &options, Extent::AlongTime).ok()?;
        let (name, shape) = (header.variable.unwrap_or_default(), header.shape);
        Some(VariableInfo {
            unit: header.units.samples,
            ..VariableInfo::volume(&name, shape.sample().name(), shape.dims(), 1)
        })
    };
    let found: Vec<_> = (0..MOST_COMPONENTS).map_while(component).collect();
    if found.len() > 1 { found } else { Vec::new() }
}

/// Refuses options that would be ignored, so that users do not think that they had an effect.
fn refuse_options(path: &Path, format: &Format, options: &OpenOptions) -> Result<()> {
    let is_named = options.variable.is_some() && !options.variable_is_remembered && options.axes.is_none();
    let given = [
        (options.dims.is_some(), "dims"),
        (options.sample.is_some(), "sample"),
        (options.big_endian, "big_endian"),
        (options.offset > 0, "offset"),
        (is_named && format.is(&npy::FORMAT), "variable"),
    ];
    let Some((_, setting)) = given.into_iter().find(|(given, _)| *given) else { return Ok(()) };
    let what = match setting {
        "variable" => "has a single array without a name; leave this out",
        _ if format.holds_frames() => "says itself what it holds; this is for headerless data, leave it out",
        _ => return Ok(()),
    };
    Err(Error::setting(setting, format!("{} {what}", path.display())))
}
