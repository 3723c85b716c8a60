//! Which format a file has: by its extension, or by its first bytes where the extension says nothing.
//!
//! To add a format:
//!
//! 1. Read its header into a [`FileHeader`] in a file or folder of its own here. [`shared`] has what formats have in
//!    common. The header says where the frames are, or how to decode them (`source/parts.rs`).
//! 2. Add a variant to [`Format`] and extensions to `EXTENSIONS`; the compiler then asks for the rest. If files without
//!    an extension can be recognised, add their first bytes to `Format::by_content`.
//! 3. Name it in `tools/guide/formats.md` and the README, add it to the tests of inputs, and name its crate, if it has
//!    one, in `tests/layering.rs`.

pub(in crate::source) mod arrays;
pub(in crate::source) mod file_series;
mod metaimage;
mod nifti;
pub(in crate::source) mod npy;
mod npz;
mod nrrd;
pub(in crate::source) mod pvd;
pub(in crate::source) mod raw;
mod shared;
#[cfg(feature = "tiff")]
mod tif;
mod vti;
mod vtk;

pub use npy::{ArrayHeader, array_header};

use super::{Extent, OpenOptions, VariableInfo};
use crate::base::error::{Error, Note, Remedy, Result};
use crate::base::mapped::{Access, FileBytes};
use crate::base::npy::MAGIC;
use crate::source::file_header::{FileHeader, head};
use std::path::{Path, PathBuf};

/// The extensions by which formats are known.
const EXTENSIONS: [(&str, Format); 31] = [
    ("npy", Format::Npy),
    ("npz", Format::Npz),
    ("nrrd", Format::Nrrd),
    ("nhdr", Format::Nrrd),
    ("nii", Format::Nifti),
    ("nii.gz", Format::Nifti),
    ("hdr", Format::Nifti),
    ("hdr.gz", Format::Nifti),
    ("mha", Format::MetaImage),
    ("mhd", Format::MetaImage),
    ("vti", Format::Vti),
    ("pvti", Format::Vti),
    ("vtr", Format::Vtr),
    ("pvtr", Format::Vtr),
    ("vtk", Format::Vtk),
    ("tif", Format::Tiff),
    ("tiff", Format::Tiff),
    ("pvd", Format::Pvd),
    ("series", Format::FileSeries),
    ("nc", Format::NetCdf),
    ("nc3", Format::NetCdf),
    ("nc4", Format::NetCdf),
    ("cdf", Format::NetCdf),
    ("netcdf", Format::NetCdf),
    ("h5", Format::Hdf5),
    ("hdf5", Format::Hdf5),
    ("hdf", Format::Hdf5),
    ("he5", Format::Hdf5),
    ("vtkhdf", Format::Hdf5),
    ("zarr", Format::Zarr),
    ("wspl", Format::Coefficients),
];

/// Extensions of inputs that say themselves what they are.
pub fn extensions() -> impl Iterator<Item = &'static str> {
    EXTENSIONS.into_iter().filter(|(_, format)| *format != Format::Coefficients).map(|(ending, _)| ending)
}

/// How TIFF and BigTIFF start, in either byte order.
const TIFF_STARTS: [&[u8]; 4] = [b"II\x2a\0", b"MM\0\x2a", b"II\x2b\0", b"MM\0\x2b"];

const FIRST_READ: usize = 1 << 10; // bytes; what a format is known by is in them

/// Extensions of files that may be in gzip as a whole.
const COMPRESSED: [&str; 3] = ["nii", "hdr", "img"];

/// How a file of frames is read.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in crate::source) enum Format {
    Npy,
    /// NumPy arrays in a zip archive.
    Npz,
    Nrrd,
    Nifti,
    MetaImage,
    Vti,
    /// As the one before it, but for where the points are.
    Vtr,
    Vtk,
    Tiff,
    Hdf5,
    NetCdf,
    /// A folder.
    Zarr,
    /// A list of files, not frames itself.
    Pvd,
    /// As well.
    FileSeries,
    /// A coefficient file, which is no input.
    Coefficients,
}

impl Format {
    /// The format by extension; `None` for headerless data and unsupported formats.
    pub(in crate::source) fn by_name(path: &Path) -> Option<Self> {
        let found = extension(path);
        EXTENSIONS.into_iter().find(|(ending, _)| *ending == found).map(|(_, format)| format)
    }

    /// The format by extension, or Zarr for a folder that is a Zarr store.
    fn of_file(path: &Path) -> Option<Self> {
        let is_store = path.is_dir() && zarr_metadata(path).is_some();
        if is_store { Some(Self::Zarr) } else { Self::by_name(path) }
    }

    /// Whether a file of this format holds frames and describes them in a header.
    pub(in crate::source) fn holds_frames(self) -> bool {
        match self {
            Self::Npy
            | Self::Npz
            | Self::Nrrd
            | Self::Nifti
            | Self::MetaImage
            | Self::Vti
            | Self::Vtr
            | Self::Vtk
            | Self::Tiff
            | Self::Hdf5
            | Self::NetCdf
            | Self::Zarr => true,
            Self::Pvd | Self::FileSeries | Self::Coefficients => false,
        }
    }

    /// Whether the option `axes` may say what the axes of its arrays count. Other formats say that themselves.
    fn takes_axes(self) -> bool {
        match self {
            Self::Hdf5 | Self::NetCdf | Self::Zarr => true,
            Self::Npy
            | Self::Npz
            | Self::Nrrd
            | Self::Nifti
            | Self::MetaImage
            | Self::Vti
            | Self::Vtr
            | Self::Vtk
            | Self::Tiff
            | Self::Pvd
            | Self::FileSeries
            | Self::Coefficients => false,
        }
    }

    /// What people call it.
    fn name(self) -> &'static str {
        match self {
            Self::Npy => "NumPy array",
            Self::Npz => "NumPy arrays (.npz)",
            Self::Nrrd => "NRRD",
            Self::Nifti => "NIfTI",
            Self::MetaImage => "MetaImage",
            Self::Vti => "VTK image data (.vti)",
            Self::Vtr => "VTK rectilinear grid (.vtr)",
            Self::Vtk => "legacy VTK",
            Self::Tiff => "TIFF",
            Self::Hdf5 => "HDF5",
            Self::NetCdf => "NetCDF",
            Self::Zarr => "Zarr",
            Self::Pvd | Self::FileSeries => "list of files",
            Self::Coefficients => "coefficient file",
        }
    }

    fn by_content(path: &Path) -> Result<Option<Self>> {
        let head = head(&FileBytes::open(path, Access::Read)?, FIRST_READ)?;
        let is_nifti = nifti::is_nifti(&head) || nifti::header_of(path).is_some();
        let formats = [
            (head.starts_with(MAGIC), Self::Npy),
            (head.starts_with(nrrd::MAGIC), Self::Nrrd),
            (head.starts_with(vtk::MAGIC), Self::Vtk),
            (head.starts_with(b"\x89HDF\r\n\x1a\n"), Self::Hdf5),
            (head.starts_with(b"CDF"), Self::NetCdf),
            (TIFF_STARTS.iter().any(|start| head.starts_with(start)), Self::Tiff),
            (is_nifti, Self::Nifti),
        ];
        Ok(formats.into_iter().find(|(is, _)| *is).map(|(_, format)| format))
    }
}

/// The file with the metadata of a folder that is a Zarr store.
pub(super) fn zarr_metadata(folder: &Path) -> Option<PathBuf> {
    let names = ["zarr.json", ".zmetadata", ".zgroup", ".zarray"].into_iter();
    names.map(|name| folder.join(name)).find(|path| path.is_file())
}

/// The extension in lower case, or an empty text. A compressed file keeps its inner extension: `nii.gz`.
pub(in crate::source) fn extension(path: &Path) -> String {
    let last = |path: &Path| path.extension().map(|e| e.to_string_lossy().to_lowercase()).unwrap_or_default();
    let (own, inner) = (last(path), last(&path.with_extension("")));
    if own == "gz" && COMPRESSED.contains(&inner.as_str()) { format!("{inner}.gz") } else { own }
}

/// Whether a file has a header that describes its contents.
pub(in crate::source) fn has_header(path: &Path) -> bool {
    Format::of_file(path).is_some() || Format::by_content(path).is_ok_and(|format| format.is_some())
}

/// Reads the header of a file of frames and checks its size; beside the samples, what `extent` says.
pub(in crate::source) fn describe(path: &Path, options: &OpenOptions, extent: Extent) -> Result<FileHeader> {
    let format = format_of(path, options)?;
    if let Some(format) = format {
        refuse_options(path, format, options)?;
    }
    let described = of_format(format, path, options, extent)?;
    Ok(FileHeader { format: format.map_or("headerless data", Format::name), ..described })
}

fn format_of(path: &Path, options: &OpenOptions) -> Result<Option<Format>> {
    match Format::of_file(path) {
        None if options.dims.is_none() => Format::by_content(path),
        format => Ok(format),
    }
}

/// The variables of a file among which the user must choose; none if it is clear which one is meant.
pub(in crate::source) fn undecided(path: &Path, options: &OpenOptions) -> Result<Vec<VariableInfo>> {
    let Some(format) = format_of(path, options)? else { return Ok(Vec::new()) };
    match format {
        #[cfg(feature = "hdf5")]
        Format::Hdf5 => arrays::open_hdf5(path, options)?.undecided(),
        #[cfg(feature = "netcdf")]
        Format::NetCdf => arrays::open_netcdf(path, options)?.undecided(),
        #[cfg(feature = "zarr")]
        Format::Zarr => arrays::open_zarr(path, options)?.undecided(),
        Format::Npz => npz::undecided(path),
        Format::Vti | Format::Vtr => vti::undecided(path),
        Format::Vtk => vtk::undecided(path),
        Format::Nrrd | Format::Nifti | Format::MetaImage | Format::Tiff => Ok(components(path, options)),
        #[cfg(not(feature = "hdf5"))]
        Format::Hdf5 => Ok(Vec::new()), // opening it says that it is not built in
        #[cfg(not(feature = "netcdf"))]
        Format::NetCdf => Ok(Vec::new()),
        #[cfg(not(feature = "zarr"))]
        Format::Zarr => Ok(Vec::new()),
        Format::Npy | Format::Pvd | Format::FileSeries | Format::Coefficients => Ok(Vec::new()),
    }
}

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

/// Components that are listed, where one array has several.
const MOST_COMPONENTS: usize = 16;

#[cfg_attr(not(any(feature = "hdf5", feature = "netcdf", feature = "zarr")), allow(unused_variables))]
fn of_format(format: Option<Format>, path: &Path, options: &OpenOptions, extent: Extent) -> Result<FileHeader> {
    match format {
        Some(Format::Npy) => npy::describe(path),
        Some(Format::Npz) => npz::describe(path, options),
        Some(Format::Nrrd) => nrrd::describe(path, options.variable.as_deref()),
        Some(Format::Nifti) => nifti::describe(path, options.variable.as_deref()),
        Some(Format::MetaImage) => metaimage::describe(path, options.variable.as_deref()),
        Some(Format::Vti | Format::Vtr) => vti::describe(path, options.variable.as_deref()),
        Some(Format::Vtk) => vtk::describe(path, options.variable.as_deref()),
        #[cfg(feature = "tiff")]
        Some(Format::Tiff) => tif::describe(path, options),
        #[cfg(not(feature = "tiff"))]
        Some(Format::Tiff) => Err(not_built_in(path, Format::Tiff, "tiff")),
        #[cfg(feature = "hdf5")]
        Some(Format::Hdf5) => arrays::open_hdf5(path, options)?.describe(options, extent),
        #[cfg(feature = "netcdf")]
        Some(Format::NetCdf) => arrays::open_netcdf(path, options)?.describe(options, extent),
        #[cfg(feature = "zarr")]
        Some(Format::Zarr) => arrays::open_zarr(path, options)?.describe(options, extent),
        #[cfg(not(feature = "hdf5"))]
        Some(Format::Hdf5) => Err(not_built_in(path, Format::Hdf5, "hdf5")),
        #[cfg(not(feature = "netcdf"))]
        Some(Format::NetCdf) => Err(not_built_in(path, Format::NetCdf, "netcdf")),
        #[cfg(not(feature = "zarr"))]
        Some(Format::Zarr) => Err(not_built_in(path, Format::Zarr, "zarr")),
        Some(Format::Pvd | Format::FileSeries) => Err(Error::path(path, "a list of files must be the only input")),
        Some(Format::Coefficients) => Err(Error::path(path, "is a coefficient file already, not frames to convert")),
        None if options.dims.is_none() => Err(unknown(path)),
        None => raw::describe(path, options),
    }
}

/// The error of a format whose crates this build does not have.
#[cfg(not(all(feature = "hdf5", feature = "netcdf", feature = "tiff", feature = "zarr")))]
fn not_built_in(path: &Path, format: Format, feature: &'static str) -> Error {
    Error::input(path, Note::with(format!("{} is not built in", format.name()), Remedy::BuildWith(feature)))
}

fn unknown(path: &Path) -> Error {
    Error::path(path, Note::with("is of no known format", Remedy::DescribeSamples))
}

/// Refuses options that would be ignored, so that users do not think that they had an effect.
pub(in crate::source) fn refuse_options(path: &Path, format: Format, options: &OpenOptions) -> Result<()> {
    let given = [
        (options.dims.is_some(), "dims"),
        (options.sample.is_some(), "sample"),
        (options.big_endian, "big_endian"),
        (options.offset > 0, "offset"),
        (options.variable.is_some() && format == Format::Npy && !options.variable_is_remembered, "variable"),
        (options.axes.is_some() && !format.takes_axes(), "axes"),
    ];
    let Some((_, setting)) = given.into_iter().find(|(given, _)| *given) else { return Ok(()) };
    let what = match setting {
        "variable" => "has one array; this is for files that have names",
        "axes" => "says itself what its axes count; this is for HDF5, NetCDF and Zarr",
        _ if format.holds_frames() => "says itself what it holds; this is for headerless data, leave it out",
        _ => return Ok(()),
    };
    Err(Error::setting(setting, format!("{} {what}", path.display())))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_ending_is_known_once() {
        for (ending, format) in EXTENSIONS {
            assert_eq!(Format::by_name(Path::new(&format!("a.b.{}", ending.to_uppercase()))), Some(format));
        }
        let known: Vec<&str> = extensions().collect();
        assert!(
            known.starts_with(&["npy", "npz", "nrrd"]) && known.contains(&"hdf5") && !known.contains(&"wspl"),
            "{known:?}"
        );
    }
}
