//! Writes extracted samples to files.

use super::contents::{Contents, Lattice};
use super::encoding::Encoding;
use super::format::SampleFormat;
use super::store::StoreSink;
use super::{metaimage, netcdf, nifti, nrrd, vti, vtr};
use crate::base::error::{Error, Result};
use crate::base::npy;
use crate::base::output::{Numbered, Output, STANDARD};
use flate2::Compression;
use flate2::write::GzEncoder;
use std::fs;
use std::io::{self, Write};
use std::path::{Path, PathBuf};

/// The files that an extraction writes.
#[derive(Debug)]
pub struct Files {
    format: SampleFormat,
    /// The files of samples: one for all frames, or one for each.
    samples: Vec<PathBuf>,
    /// A list or a header that refers to `samples`, written last.
    last: Option<PathBuf>,
}

impl Files {
    /// The files for `path`: itself, or `-` for standard output. If each frame has its own file, `path` is a pattern
    /// like `out_%04d.vti`. Headers and lists also have files beside them.
    pub fn new(path: &Path, format: SampleFormat, frames: &[usize]) -> Result<Self> {
        let (samples, last) = match format {
            SampleFormat::Vti | SampleFormat::Vtr => (numbered(path, format, frames)?, None),
            SampleFormat::Zarr if path == Path::new(STANDARD) => {
                return Err(Error::path(path, "a Zarr store is a folder, which standard output cannot take"));
            }
            SampleFormat::Pvd => {
                let (folder, names) = (path.with_extension(""), Numbered::after(&stem(path)?, "vti"));
                (frames.iter().map(|frame| folder.join(names.path(*frame))).collect(), Some(path.into()))
            }
            SampleFormat::Nhdr => {
                stem(path)?;
                (vec![path.with_extension("raw")], Some(path.into()))
            }
            _ => (vec![path.into()], None),
        };
        Ok(Self { format, samples, last })
    }

    /// All files, in the order in which they are completed.
    pub fn paths(&self) -> impl Iterator<Item = &Path> {
        self.samples.iter().chain(&self.last).map(PathBuf::as_path)
    }

    /// The folder of the files of a list.
    fn folder(&self) -> Option<&Path> {
        self.samples[0].parent().filter(|_| self.format == SampleFormat::Pvd)
    }

    /// Checks in advance that the files can be created, as far as that is possible.
    fn check(&self, force: bool) -> Result<()> {
        if let Some(folder) = self.folder().filter(|folder| !folder.is_dir()) {
            self.last.iter().try_for_each(|list| Output::check(list, force))?;
            return if folder.exists() { Err(no_folder(folder)) } else { Ok(()) };
        }
        self.paths().filter(|path| *path != Path::new(STANDARD)).try_for_each(|path| match path.metadata() {
            Ok(other) if !other.is_file() && !other.is_dir() => Ok(()), // a device or a pipe
            _ => Output::check(path, force),
        })
    }
}

/// A name for each frame.
fn numbered(path: &Path, format: SampleFormat, frames: &[usize]) -> Result<Vec<PathBuf>> {
    if path == Path::new(STANDARD) && frames.len() > 1 {
        return Err(Error::path(
            path,
            format!("standard output takes one .{}, and these are {} frames", format.name(), frames.len()),
        ));
    }
    let names = Numbered::new(path, frames.len())?;
    Ok(frames.iter().map(|frame| names.path(*frame)).collect())
}

/// The name without its extension, which the files beside it share.
fn stem(path: &Path) -> Result<String> {
    let stem = path.file_stem().filter(|_| path != Path::new(STANDARD) && path.extension().is_some());
    let what = "other files are written beside this one and named after it, so its name needs an extension";
    stem.map(|stem| stem.to_string_lossy().into_owned()).ok_or_else(|| Error::path(path, what))
}

fn no_folder(path: &Path) -> Error {
    Error::path(path, "is a file, but the files of frames need a folder of this name")
}

/// A folder created for files; it is removed on drop if it is empty.
#[derive(Debug)]
struct Folder(PathBuf);

impl Folder {
    /// Creates the folder; none if it exists already.
    fn create(path: &Path) -> Result<Option<Self>> {
        match fs::create_dir(path) {
            Ok(()) => Ok(Some(Self(path.into()))),
            Err(e) if e.kind() == io::ErrorKind::AlreadyExists => Ok(None),
            Err(e) => Err(Error::io(path, "creating the folder", e)),
        }
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = fs::remove_dir(&self.0); // fails if the folder is not empty
    }
}

/// An output, perhaps in gzip.
#[derive(Debug)]
enum Stream {
    Plain(Output),
    Gzip(GzEncoder<Output>),
}

impl Stream {
    fn new(out: Output, format: SampleFormat) -> Self {
        match format {
            SampleFormat::NiftiGz => Self::Gzip(GzEncoder::new(out, GZIP_LEVEL)),
            _ => Self::Plain(out),
        }
    }

    /// Completes the gzip.
    fn finish(self) -> io::Result<Output> {
        match self {
            Self::Plain(out) => Ok(out),
            Self::Gzip(out) => out.finish(),
        }
    }
}

impl Write for Stream {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        match self {
            Self::Plain(out) => out.write(bytes),
            Self::Gzip(out) => out.write(bytes),
        }
    }

    fn flush(&mut self) -> io::Result<()> {
        match self {
            Self::Plain(out) => out.flush(),
            Self::Gzip(out) => out.flush(),
        }
    }
}

/// Fast, as nearly all of the time of an extraction goes to gzip.
const GZIP_LEVEL: Compression = Compression::new(3);

/// Writes samples to the files of an extraction.
#[derive(Debug)]
pub struct Sink<'a>(Kind<'a>);

#[derive(Debug)]
enum Kind<'a> {
    Files(FileSink<'a>),
    Store(StoreSink),
}

impl<'a> Sink<'a> {
    /// Opens the first file; existing files are an error unless `force` replaces them.
    pub fn create(files: Files, contents: &'a Contents, force: bool) -> Result<Self> {
        let encoding = files.format.encoding(contents);
        Ok(Self(match files.format {
            SampleFormat::Zarr => Kind::Store(StoreSink::create(&files.samples[0], contents, encoding, force)?),
            _ => Kind::Files(FileSink::create(files, contents, encoding, force)?),
        }))
    }

    /// Writes the next samples, given little-endian.
    pub fn write(&mut self, samples: &[u8]) -> Result<()> {
        match &mut self.0 {
            Kind::Files(files) => files.write(samples),
            Kind::Store(store) => store.write(samples),
        }
    }

    /// Commits the last file of samples, and writes the list or header if there is one.
    pub fn finish(self) -> Result<()> {
        match self.0 {
            Kind::Files(files) => files.finish(),
            Kind::Store(store) => store.finish(),
        }
    }
}

/// Writes samples to files.
#[derive(Debug)]
struct FileSink<'a> {
    contents: &'a Contents,
    files: Files,
    force: bool,
    encoding: Encoding,
    /// The file being written.
    open: Option<Stream>,
    /// Bytes of samples still missing in the open file.
    left: u64,
    /// The number of files of samples begun.
    begun: usize,
    _folder: Option<Folder>, // dropped after the open file
}

impl<'a> FileSink<'a> {
    fn create(files: Files, contents: &'a Contents, encoding: Encoding, force: bool) -> Result<Self> {
        files.check(force)?;
        let folder = files.folder().map(Folder::create).transpose()?.flatten();
        let mut sink = Self { contents, files, force, encoding, open: None, left: 0, begun: 0, _folder: folder };
        sink.begin()?;
        Ok(sink)
    }

    fn write(&mut self, mut samples: &[u8]) -> Result<()> {
        while !samples.is_empty() {
            if self.left == 0 {
                self.end()?;
                self.begin()?;
            }
            let (these, others) = samples.split_at(self.left.min(samples.len() as u64) as usize);
            if let Some(out) = &mut self.open {
                self.encoding
                    .write(these, out)
                    .map_err(|e| Error::io(&self.files.samples[self.begun - 1], "writing", e))?;
            }
            self.left -= these.len() as u64;
            samples = others;
        }
        Ok(())
    }

    fn finish(mut self) -> Result<()> {
        self.end()?;
        let Some(path) = &self.files.last else { return Ok(()) };
        let mut out = Output::create(path, self.force)?;
        self.write_last(&mut out).map_err(|e| Error::io(path, "writing", e))?;
        out.commit()
    }

    /// Opens the next file and writes its header.
    fn begin(&mut self) -> Result<()> {
        let path = &self.files.samples[self.begun];
        let frames = self.contents.frames.len() / self.files.samples.len();
        let mut out = Stream::new(Output::create(path, self.force)?, self.files.format);
        self.write_header(&mut out).map_err(|e| Error::io(path, "writing", e))?;
        self.left = self.contents.voxels().saturating_mul((frames * self.encoding.from.size()) as u64);
        (self.open, self.begun) = (Some(out), self.begun + 1);
        Ok(())
    }

    /// Writes the text after the samples and commits the file.
    fn end(&mut self) -> Result<()> {
        let Some(mut out) = self.open.take() else { return Ok(()) };
        let end = match self.files.format {
            SampleFormat::Vti | SampleFormat::Pvd | SampleFormat::Vtr => vti::END.to_vec(),
            SampleFormat::Netcdf => netcdf::padding(self.contents, self.encoding.to),
            _ => Vec::new(),
        };
        let failed = |e| Error::io(&self.files.samples[self.begun - 1], "writing", e);
        out.write_all(&end).map_err(failed)?;
        out.finish().map_err(failed)?.commit()
    }

    fn write_header(&self, out: &mut Stream) -> io::Result<()> {
        let (contents, ty) = (self.contents, self.encoding.to);
        match self.files.format {
            SampleFormat::Npy => {
                let [x, y, z] = contents.grid.dims;
                npy::write_header(ty, &[contents.frames.len(), z, y, x], out)
            }
            SampleFormat::Nrrd => nrrd::write_header(contents, ty, None, out),
            SampleFormat::Vti | SampleFormat::Pvd => {
                let lattice = self.lattice();
                vti::write_header(contents, &lattice, (ty, contents.times[self.begun]), out)
            }
            SampleFormat::Nifti | SampleFormat::NiftiGz => nifti::write_header(contents, ty, out),
            SampleFormat::MetaImage => metaimage::write_header(contents, ty, out),
            SampleFormat::Netcdf => netcdf::write_header(contents, ty, out),
            SampleFormat::Vtr => vtr::write_header(contents, (ty, contents.times[self.begun]), out),
            SampleFormat::Raw | SampleFormat::Nhdr | SampleFormat::Zarr => Ok(()),
        }
    }

    /// Where the voxels are, in the order in which they are written.
    fn lattice(&self) -> Lattice {
        match self.files.format.has_lattice(self.contents) {
            true => self.contents.lattice(),
            false => self.contents.straight_lattice(),
        }
    }

    fn write_last(&self, out: &mut Output) -> io::Result<()> {
        let samples = &self.files.samples;
        let name = |path: &Path| path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        if self.files.format == SampleFormat::Nhdr {
            return nrrd::write_header(self.contents, self.encoding.to, Some(&name(&samples[0])), out);
        }
        let folder = self.files.folder().map(name).unwrap_or_default();
        let within = samples.iter().map(|path| format!("{folder}/{}", name(path)));
        vti::write_list(self.contents, within, out)
    }
}
