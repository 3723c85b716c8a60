//! Where the samples of a MetaImage are: after the header, in another file, or in a file for each frame or slice.

use super::header::MetaImageHeader;
use crate::shared::deflated::{self, Compression, check_room};
use crate::shared::directions::Placed;
use crate::shared::meaning::{Kind, Meaning};
use crate::shared::pattern;
use crate::shared::pieces::{Piece, Pieces, Stream};
use std::path::{Path, PathBuf};
use wavesplat_core::base::description::AxisRole;
use wavesplat_core::base::error::{Error, Result};
use wavesplat_core::base::mapped::{Access, FileBytes};
use wavesplat_core::base::stored::StoredType;
use wavesplat_core::source::Parsed;
use wavesplat_core::source::file_header::check_size;
use wavesplat_core::source::layout::{Layout, Shape};
use wavesplat_core::source::parts::{DataLocation, Part, Stored};

/// The type and layout of the samples, whichever file has them.
pub(super) struct MetaImageSamples {
    pub(super) axes: usize,
    /// The lengths that the header says along x, y, z.
    pub(super) lengths: [usize; 3],
    /// What the axes count, components first.
    pub(super) meaning: Meaning,
    pub(super) placed: Placed,
    /// As they are when turned.
    pub(super) shape: Shape,
    /// The type of the stored numbers.
    pub(super) ty: StoredType,
    /// The length of a fourth axis.
    pub(super) frames: usize,
    pub(super) components: usize,
    /// Which of them is meant.
    pub(super) component: usize,
    pub(super) variable: Option<String>,
    pub(super) big_endian: bool,
    pub(super) compressed: bool,
}

impl MetaImageSamples {
    /// All samples.
    pub(super) fn layout(&self) -> Layout {
        self.meaning.layout(&self.placed, self.component)
    }

    /// How some frames are stored.
    pub(super) fn stored(&self, frames: usize) -> Parsed<Stored> {
        Stored::new(&self.layout().with_frames(frames), self.ty, self.big_endian)
    }

    /// Whether its axes count what the header says.
    fn is_usual(&self) -> bool {
        self.meaning == header_meaning(self.components, self.lengths, (self.axes == 4).then_some(self.frames))
    }

    /// Some planes as if components were voxels beside one another.
    pub(super) fn flat(&self, planes: usize) -> Parsed<Shape> {
        let [x, y, _] = self.lengths;
        let row = x.checked_mul(self.components).ok_or("a row of its size is too large")?;
        Shape::new([row, y, planes], self.shape.sample())
    }
}

/// Components, x, y, z and perhaps frames.
pub(super) fn header_meaning(components: usize, [x, y, z]: [usize; 3], frames: Option<usize>) -> Meaning {
    let usual = [(Kind::Components, components), (Kind::Voxels(0), x), (Kind::Voxels(1), y), (Kind::Voxels(2), z)];
    let (kinds, sizes) = usual.into_iter().chain(frames.map(|frames| (Kind::Frames, frames))).unzip();
    Meaning { sizes, kinds }
}

/// The files that hold the frames, checked for their size.
pub(super) fn parts(file: &FileBytes, header: &MetaImageHeader, samples: &MetaImageSamples) -> Result<Vec<Part>> {
    let refused = |e| Error::input(file.path(), e);
    let skip = skip(header).map_err(refused)?;
    let data = Data { file, samples, skip };
    let named = header.required("ElementDataFile").map_err(refused)?;
    if named.eq_ignore_ascii_case("local") {
        return Ok(vec![data.part(file, header.len, samples.frames)?]);
    }
    let names = Names::parse(named, header, samples).map_err(refused)?;
    let axes = names.checked_axes(samples).map_err(refused)?;
    if axes < samples.axes && !samples.is_usual() {
        return Err(refused("has its samples in several files: its axes count x, y, z and time alone".into()));
    }
    let folder = file.path().parent().unwrap_or(Path::new(""));
    let mut paths = names.names.map(|name| folder.join(name));
    let frames = if axes == samples.axes { samples.frames } else { 1 };
    match axes {
        2 => Ok(vec![data.slices(&mut paths)?]),
        _ => paths.map(|path| data.part(&FileBytes::open(&path, Access::Read)?, 0, frames)).collect(),
    }
}

/// Bytes before the samples of each data file; none if the samples are its end.
fn skip(header: &MetaImageHeader) -> Parsed<Option<u64>> {
    let text = header.get("headersize").unwrap_or("0");
    match text.parse::<i64>() {
        Ok(-1) => Ok(None),
        Ok(n) if n >= 0 => Ok(Some(n as u64)),
        _ => Err(format!("HeaderSize {text} is not supported")),
    }
}

struct Data<'a> {
    file: &'a FileBytes, // the header
    samples: &'a MetaImageSamples,
    skip: Option<u64>,
}

impl Data<'_> {
    /// Frames that are all in one file.
    fn part(&self, file: &FileBytes, header: u64, frames: usize) -> Result<Part> {
        let refused = |e| Error::input(file.path(), e);
        let start = self.start(file, header, self.samples.lengths[2], frames)?;
        let whole = self.samples.layout();
        let layout = if self.samples.is_usual() { whole.with_frames(frames) } else { whole };
        let (path, state) = (file.path(), file.state());
        if self.samples.compressed {
            let stream = deflated::Stream { compression: Compression::at(file, start)?, start, skip: 0 };
            return stream.part(path, state, &layout, self.samples.ty, self.samples.big_endian).map_err(refused);
        }
        let stored = Stored::new(&layout, self.samples.ty, self.samples.big_endian).map_err(refused)?;
        let frames = layout.len(AxisRole::Frames);
        Ok(Part { path: path.into(), state, frames, stored, at: DataLocation::Byte(start) })
    }

    /// Where the samples start. Uncompressed samples must fill the rest of the file.
    fn start(&self, file: &FileBytes, header: u64, planes: usize, times: usize) -> Result<u64> {
        let refused = |e| Error::input(file.path(), e);
        let (shape, ty) = (self.samples.flat(planes).map_err(refused)?, self.samples.ty);
        let bytes = Layout::plain(shape.dims(), times).bytes(ty.size()).map_err(refused)? as u64;
        let start = match self.skip {
            Some(0) => header,
            Some(n) if n >= header => n,
            Some(n) => return Err(refused(format!("HeaderSize {n} ends inside its header of {header} bytes"))),
            None if self.samples.compressed => {
                return Err(refused("HeaderSize -1 says nothing of where compressed samples start".into()));
            }
            None => file.len().saturating_sub(bytes).max(header),
        };
        let checked = if self.samples.compressed {
            check_room(file.len().saturating_sub(start), bytes)
        } else {
            check_size(file.len(), start, &shape, ty, times)
        };
        checked.map(|()| start).map_err(refused)
    }

    /// Frames with each slice along z in its own file.
    fn slices(&self, paths: &mut dyn Iterator<Item = PathBuf>) -> Result<Part> {
        let [x, y, z] = self.samples.lengths;
        let stored = self.samples.stored(1).map_err(|e| Error::input(self.file.path(), e))?;
        let mut frames: Vec<Vec<Piece>> = Vec::new();
        for (i, path) in paths.enumerate() {
            let slice = FileBytes::open(&path, Access::Read)?;
            let start = self.start(&slice, 0, 1, 1)?;
            let compression = if self.samples.compressed { Some(Compression::at(&slice, start)?) } else { None };
            let samples = Box::new(Stream { start, skip: 0, bytes: stored.bytes / z, compression });
            if i % z == 0 {
                frames.push(Vec::new());
            }
            let piece = Piece { path, state: slice.state(), start: [0, 0, i % z], dims: [x, y, 1], samples };
            frames[i / z].push(piece);
        }
        let (count, voxel) = (frames.len(), stored.bytes / (x * y * z));
        let at = DataLocation::Decoded(Box::new(Pieces { dims: [x, y, z], voxel, together: 1, frames }));
        Ok(Part { path: self.file.path().into(), state: self.file.state(), frames: count, stored, at })
    }
}

/// The files that `ElementDataFile` names.
struct Names<'a> {
    names: Box<dyn Iterator<Item = String> + 'a>,
    count: usize,
    /// Axes of each file.
    axes: usize,
}

impl<'a> Names<'a> {
    fn parse(text: &'a str, header: &'a MetaImageHeader, samples: &MetaImageSamples) -> Parsed<Self> {
        let words: Vec<&str> = text.split_whitespace().collect();
        match words[..] {
            [] => Err("ElementDataFile names no file".into()),
            ["LIST", ref rest @ ..] => {
                let axes = list_axes(rest.first(), samples.axes)?;
                Ok(Self { names: Box::new(header.list.iter().cloned()), count: header.list.len(), axes })
            }
            _ if text.contains('%') => Self::from_pattern(&words, samples),
            _ => Ok(Self { names: Box::new(std::iter::once(text.into())), count: 1, axes: samples.axes }),
        }
    }

    /// A pattern and up to three numbers: the first, the last, and the step.
    fn from_pattern(words: &[&str], samples: &MetaImageSamples) -> Parsed<Self> {
        let mut numbers: Vec<i64> = words[1..].iter().rev().take(3).map_while(|word| word.parse().ok()).collect();
        numbers.reverse();
        let name = words[..words.len() - numbers.len()].join(" ");
        let along = if samples.axes == 4 { samples.frames } else { samples.lengths[2] } as i64;
        let (first, last, step) = match numbers[..] {
            [] => (1, along, 1),
            [first] => (first, first.saturating_add(along - 1), 1),
            [first, last] => (first, last, 1),
            [first, last, step, ..] => (first, last, step),
        };
        let count = pattern::count(first, last, step)?;
        let names = pattern::names(&name, first, count, step)?;
        Ok(Self { names: Box::new(names), count, axes: samples.axes - 1 })
    }

    /// Axes of each file, where there are as many files as it takes.
    fn checked_axes(&self, samples: &MetaImageSamples) -> Parsed<usize> {
        let (axes, frames, planes) = (self.axes, samples.frames, samples.lengths[2]);
        let expected = match axes {
            _ if axes == samples.axes => Some(1),
            3 => Some(frames),
            2 => frames.checked_mul(planes),
            _ => return Err("has data files of 1 dimension each; slices and whole frames are supported".into()),
        };
        if expected == Some(self.count) {
            return Ok(axes);
        }
        let files = self.count;
        Err(format!("names {files} data file(s) of {axes} axes for {frames} frame(s) of {planes} slice(s)"))
    }
}

/// Axes of each file of a list, as `3` or `3D`; without a word all but the last.
fn list_axes(word: Option<&&str>, axes: usize) -> Parsed<usize> {
    let Some(word) = word else { return Ok(axes - 1) };
    match word.trim_end_matches(['d', 'D']).parse() {
        Ok(n) if (1..=axes).contains(&n) => Ok(n),
        _ => Err(format!("LIST {word} says no number of dimensions up to {axes}")),
    }
}
