//! Writes frames to one file, a folder with a file per frame, or standard output. One frame is in memory at a time.

use std::fs::{self, File};
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};
use std::str::FromStr;
use wavesplat_core::base::error::{Error, Result};
use wavesplat_core::base::sample::SampleType;

/// The size and the type of an archive's frames.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Shape {
    /// Voxels along x, y, z.
    pub dims: [usize; 3],
    /// Number of frames.
    pub frames: usize,
    /// The type of the samples.
    pub ty: SampleType,
}

impl Shape {
    /// Bytes of one frame's samples.
    pub fn frame_bytes(&self) -> usize {
        self.dims.iter().product::<usize>() * self.ty.size()
    }
}

/// How samples are stored. Both are little-endian with x fastest.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Format {
    /// NumPy's, with a header.
    Npy,
    /// Samples alone.
    Raw,
}

impl FromStr for Format {
    type Err = String;

    fn from_str(text: &str) -> std::result::Result<Self, String> {
        let known = [Self::Npy, Self::Raw].into_iter().find(|format| format.extension() == text);
        known.ok_or_else(|| "expected npy or raw".into())
    }
}

impl Format {
    /// The ending of a file's name.
    pub fn extension(self) -> &'static str {
        match self {
            Self::Npy => "npy",
            Self::Raw => "raw",
        }
    }

    /// Writes the bytes before the samples of an array whose last axis is the fastest.
    fn begin(self, writer: &mut impl Write, ty: SampleType, shape: &[usize]) -> io::Result<()> {
        if self == Self::Npy {
            wavesplat_core::base::npy::write_header(ty, shape, writer)?;
        }
        Ok(())
    }
}

/// The destination of frames.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Target {
    /// Standard output; all frames in one array.
    Stdout(Format),
    /// A file; all frames in one array.
    File(PathBuf, Format),
    /// A folder of `frame_0000.npy` and so on.
    Directory(PathBuf, Format),
}

impl Target {
    /// Parses `-`, `FILE.npy`, `FILE.raw`, or a folder, which exists already or ends with a slash.
    pub fn parse(name: &str, format: Option<Format>) -> Result<Self> {
        let (path, default) = (PathBuf::from(name), format.unwrap_or(Format::Npy));
        if name == "-" {
            return Ok(Self::Stdout(default));
        }
        if name.ends_with(std::path::is_separator) || path.is_dir() {
            return Ok(Self::Directory(path, default));
        }
        let of_name = [Format::Npy, Format::Raw].into_iter().find(|f| path.extension() == Some(f.extension().as_ref()));
        let unclear = || Error::usage(format!("{name}: name it .npy, .raw or with a / at its end, or give --format"));
        format.or(of_name).ok_or_else(unclear).map(|f| Self::File(path, f))
    }

    /// Writes an archive of f32 frames.
    pub fn write_f32(&self, dims: [usize; 3], frames: usize, mut values: impl Iterator<Item = Vec<f32>>) -> Result<()> {
        self.write(&Shape { dims, frames, ty: SampleType::F32 }, |_, bytes| {
            let frame = values.next().into_iter().flatten();
            bytes.as_chunks_mut().0.iter_mut().zip(frame).for_each(|(b, v)| *b = v.to_le_bytes());
        })
    }

    /// Writes an archive; `fill` supplies the frames one after another. A reader of standard output that stops early
    /// is no error.
    pub fn write(&self, shape: &Shape, fill: impl FnMut(usize, &mut [u8])) -> Result<()> {
        match self {
            Self::Directory(path, format) => directory(path, *format, shape, fill),
            Self::File(path, format) => {
                let file = File::create(path).map_err(|e| Error::io(path, "creating", e))?;
                stream(file, *format, shape, fill).map_err(|e| Error::io(path, "writing", e))
            }
            Self::Stdout(format) => match stream(io::stdout().lock(), *format, shape, fill) {
                Err(e) if e.kind() != io::ErrorKind::BrokenPipe => Err(Error::io("-", "writing", e)),
                _ => Ok(()),
            },
        }
    }
}

/// All frames as one array with the axes time, z, y, x.
fn stream(to: impl Write, format: Format, shape: &Shape, mut fill: impl FnMut(usize, &mut [u8])) -> io::Result<()> {
    let [nx, ny, nz] = shape.dims;
    let (mut writer, mut bytes) = (BufWriter::new(to), vec![0; shape.frame_bytes()]);
    format.begin(&mut writer, shape.ty, &[shape.frames, nz, ny, nx])?;
    for frame in 0..shape.frames {
        fill(frame, &mut bytes);
        writer.write_all(&bytes)?;
    }
    writer.flush()
}

/// Every frame as an array of its own with the axes z, y, x.
fn directory(path: &Path, format: Format, shape: &Shape, mut fill: impl FnMut(usize, &mut [u8])) -> Result<()> {
    fs::create_dir_all(path).map_err(|e| Error::io(path, "creating the folder", e))?;
    let mut bytes = vec![0; shape.frame_bytes()];
    for frame in 0..shape.frames {
        fill(frame, &mut bytes);
        let file = path.join(format!("frame_{frame:04}.{}", format.extension()));
        write_frame(&file, format, shape, &bytes).map_err(|e| Error::io(&file, "writing", e))?;
    }
    Ok(())
}

fn write_frame(path: &Path, format: Format, shape: &Shape, bytes: &[u8]) -> io::Result<()> {
    let [nx, ny, nz] = shape.dims;
    let mut writer = BufWriter::new(File::create(path)?);
    format.begin(&mut writer, shape.ty, &[nz, ny, nx])?;
    writer.write_all(bytes)?;
    writer.flush()
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use wavesplat_formats::array_header;

    const SHAPE: Shape = Shape { dims: [4, 3, 2], frames: 5, ty: SampleType::U16 };

    fn count_up(frame: usize, out: &mut [u8]) {
        out.iter_mut().for_each(|b| *b = frame as u8);
    }

    #[test]
    fn a_file_is_one_array_of_all_frames() {
        let mut bytes = Vec::new();
        stream(&mut bytes, Format::Npy, &SHAPE, count_up).unwrap();
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.npy");
        fs::write(&path, &bytes).unwrap();
        let header = array_header(&path).unwrap();
        assert_eq!((header.lengths, header.sample, header.big_endian), (vec![5, 2, 3, 4], SampleType::U16, false));
        let samples = &bytes[header.start as usize..];
        assert_eq!((samples.len(), samples[0], &samples[238..]), (240, 0, &[4, 4][..]));
    }

    #[test]
    fn raw_is_samples_alone() {
        let mut bytes = Vec::new();
        stream(&mut bytes, Format::Raw, &SHAPE, count_up).unwrap();
        assert_eq!(bytes.len(), 5 * SHAPE.frame_bytes());
    }

    #[test]
    fn a_folder_has_a_file_per_frame() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("new/frames");
        Target::Directory(path.clone(), Format::Npy).write(&SHAPE, count_up).unwrap();
        assert_eq!(fs::read_dir(&path).unwrap().count(), 5);
        assert_eq!(array_header(&path.join("frame_0004.npy")).unwrap().lengths, [2, 3, 4]);
    }

    #[test]
    fn names_tell_the_target() {
        let dir = tempfile::tempdir().unwrap();
        let (existing, parse) = (dir.path().to_string_lossy().into_owned(), |n: &str, f| Target::parse(n, f).unwrap());
        assert_eq!(parse("-", None), Target::Stdout(Format::Npy));
        assert_eq!(parse("-", Some(Format::Raw)), Target::Stdout(Format::Raw));
        assert_eq!(parse("a.raw", None), Target::File("a.raw".into(), Format::Raw));
        assert_eq!(parse("a.npy", None), Target::File("a.npy".into(), Format::Npy));
        assert_eq!(parse("new/", None), Target::Directory("new/".into(), Format::Npy));
        assert_eq!(parse(&existing, None), Target::Directory(existing.clone().into(), Format::Npy));
        assert_eq!(Target::parse("a.vti", None).unwrap_err().exit_code(), 2);
    }
}
