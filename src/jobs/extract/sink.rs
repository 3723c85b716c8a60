//! Writes extracted samples to files.

use super::{Contents, SampleFormat};
use flate2::Compression;
use flate2::write::GzEncoder;
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use wavesplat_core::base::error::{Error, Result};
use wavesplat_core::base::output::{Numbered, Output, OutputFolder, Placed, STANDARD, Takes, commit_together};
use wavesplat_formats::encoding::Encoding;
use wavesplat_formats::writer::{OutputFiles, SampleSink, Samples, Writer};

/// The files that an extraction writes.
#[derive(Debug)]
pub(super) struct Files {
    format: SampleFormat,
    /// The files of samples: one for all frames, or one for each.
    samples: Vec<PathBuf>,
    /// A list or a header that refers to `samples`, written last.
    last: Option<PathBuf>,
}

impl Files {
    /// The files for `path`: itself, or `-` for standard output. If each frame has its own file, `path` is a pattern
    /// like `out_%04d.vti`. Headers and lists also have files beside them.
    pub(super) fn new(path: &Path, format: SampleFormat, frames: &[usize]) -> Result<Self> {
        let writer = format.writer();
        let (samples, last) = match writer.files {
            OutputFiles::EachFrame => (numbered(path, format, frames)?, None),
            OutputFiles::Folder(_) if path == Path::new(STANDARD) => {
                let label = writer.label.unwrap_or_default();
                return Err(Error::path(
                    path,
                    format!("a {label} store is a folder, which standard output cannot take"),
                ));
            }
            OutputFiles::List { extension, .. } => {
                let (folder, names) = (path.with_extension(""), Numbered::after(&stem(path)?, extension));
                (frames.iter().map(|frame| folder.join(names.path(*frame))).collect(), Some(path.into()))
            }
            OutputFiles::WithHeader { extension, .. } => {
                stem(path)?;
                (vec![path.with_extension(extension)], Some(path.into()))
            }
            OutputFiles::One | OutputFiles::Folder(_) => (vec![path.into()], None),
        };
        Ok(Self { format, samples, last })
    }

    /// All files, in the order in which they are completed.
    pub(super) fn paths(&self) -> impl Iterator<Item = &Path> {
        self.samples.iter().chain(&self.last).map(PathBuf::as_path)
    }

    /// The folder of the files of a list.
    fn folder(&self) -> Option<&Path> {
        self.samples[0].parent().filter(|_| matches!(self.format.writer().files, OutputFiles::List { .. }))
    }

    /// Checks in advance, where possible, that the files can be created.
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

/// An output, perhaps in gzip.
#[derive(Debug)]
enum Stream {
    Plain(Output),
    Gzip(GzEncoder<Output>),
}

impl Stream {
    fn new(out: Output, gzip: bool) -> Self {
        if gzip { Self::Gzip(GzEncoder::new(out, GZIP_LEVEL)) } else { Self::Plain(out) }
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
pub(super) struct Sink<'a>(Box<dyn SampleSink + 'a>);

impl<'a> Sink<'a> {
    /// Opens the first file; existing files are an error unless `force` replaces them.
    pub(super) fn create(files: Files, contents: &'a Contents, force: bool) -> Result<Self> {
        let encoding = files.format.encoding(contents);
        Ok(Self(match files.format.writer().files {
            OutputFiles::Folder(create) => create(&files.samples[0], contents, encoding, force)?,
            _ => Box::new(FileSink::create(files, contents, encoding, force)?),
        }))
    }

    /// Writes the next samples, given little-endian.
    pub(super) fn write(&mut self, samples: &[u8]) -> Result<()> {
        self.0.write(samples)
    }

    /// The file of samples, if it is one that takes them as they are and at any place. Nothing must have been written.
    pub(super) fn placed(&mut self) -> Result<Option<Placed<'_>>> {
        self.0.placed()
    }

    /// Continues after all samples, which were [`placed`](Self::placed).
    pub(super) fn skip_placed(&mut self) -> Result<()> {
        self.0.skip_placed()
    }

    /// Commits the last file of samples, and writes the list or header if there is one.
    pub(super) fn finish(self) -> Result<()> {
        self.0.finish()
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
    /// The complete file of samples, until its header is there too.
    complete: Option<Output>,
    /// The folder of the files of a list.
    folder: Option<OutputFolder>, // dropped after the open file
}

/// The file that says that an unfinished folder of files is ours.
const MARKER: &str = ".unfinished";

impl<'a> FileSink<'a> {
    fn create(files: Files, contents: &'a Contents, encoding: Encoding, force: bool) -> Result<Self> {
        files.check(force)?;
        let folder = files.folder().map(|path| OutputFolder::create(path, MARKER, Takes::Files, force)).transpose()?;
        folder.iter().try_for_each(|folder| folder.write(MARKER, b""))?;
        let mut sink = Self { contents, files, force, encoding, open: None, left: 0, begun: 0, complete: None, folder };
        sink.begin()?;
        Ok(sink)
    }
}

impl SampleSink for FileSink<'_> {
    fn placed(&mut self) -> Result<Option<Placed<'_>>> {
        let Some(Stream::Plain(out)) = self.open.as_mut().filter(|_| self.files.samples.len() == 1) else {
            return Ok(None);
        };
        if self.encoding.is_plain() { out.placed() } else { Ok(None) }
    }

    fn skip_placed(&mut self) -> Result<()> {
        match &mut self.open {
            Some(Stream::Plain(out)) => out.skip(std::mem::take(&mut self.left)),
            _ => Ok(()),
        }
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

    fn finish(mut self: Box<Self>) -> Result<()> {
        self.end()?;
        let Some(path) = &self.files.last else { return Ok(()) };
        let mut out = Output::create(path, self.force)?;
        self.write_last(&mut out).map_err(|e| Error::io(path, "writing", e))?;
        commit_together(self.folder.as_ref(), self.complete.take().into_iter().chain([out]).collect())
    }
}

impl FileSink<'_> {
    /// Opens the next file and writes its header.
    fn begin(&mut self) -> Result<()> {
        let path = &self.place(&self.files.samples[self.begun]);
        let frames = self.contents.frames.len() / self.files.samples.len();
        let mut out = Stream::new(Output::create(path, self.force)?, self.writer().gzip);
        (self.writer().before)(self.contents, self.samples(self.begun), &mut out)
            .map_err(|e| Error::io(path, "writing", e))?;
        self.left = self.contents.voxels().saturating_mul((frames * self.encoding.from.size()) as u64);
        (self.open, self.begun) = (Some(out), self.begun + 1);
        Ok(())
    }

    /// Writes the text after the samples and commits the file.
    fn end(&mut self) -> Result<()> {
        let Some(mut out) = self.open.take() else { return Ok(()) };
        let end = (self.writer().after)(self.contents, self.samples(self.begun - 1));
        let failed = |e| Error::io(&self.files.samples[self.begun - 1], "writing", e);
        out.write_all(&end).map_err(failed)?;
        let out = out.finish().map_err(failed)?;
        match self.writer().files {
            OutputFiles::WithHeader { .. } => self.complete = Some(out),
            _ => out.commit()?,
        }
        Ok(())
    }

    /// Where a file is written: those of a list are in another folder until all are there.
    fn place(&self, path: &Path) -> PathBuf {
        self.folder.as_ref().map_or(path.into(), |folder| folder.place(path.file_name().unwrap_or_default()))
    }

    fn writer(&self) -> &'static Writer {
        self.files.format.writer()
    }

    /// The samples of a file, by its number.
    fn samples(&self, file: usize) -> Samples {
        Samples { ty: self.encoding.to, frame: file }
    }

    fn write_last(&self, out: &mut Output) -> io::Result<()> {
        let samples = &self.files.samples;
        let name = |path: &Path| path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        match self.writer().files {
            OutputFiles::WithHeader { write, .. } => write(self.contents, self.encoding.to, &name(&samples[0]), out),
            OutputFiles::List { write, .. } => {
                let folder = self.files.folder().map(name).unwrap_or_default();
                write(self.contents, &mut samples.iter().map(|path| format!("{folder}/{}", name(path))), out)
            }
            OutputFiles::One | OutputFiles::EachFrame | OutputFiles::Folder(_) => Ok(()),
        }
    }
}
