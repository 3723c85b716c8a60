//! Where the samples of a NRRD are: after the header, in another file, or in several.

use super::axes::Axes;
use super::files::DataFiles;
use super::header::NrrdHeader;
use crate::shared::deflated::{Compression, Stream, check_room};
use crate::shared::directions::Placed;
use crate::shared::pieces::{self, Piece, Pieces};
use std::path::Path;
use wavesplat_core::base::description::AxisRole;
use wavesplat_core::base::error::{Error, Result};
use wavesplat_core::base::mapped::{Access, FileBytes};
use wavesplat_core::base::stored::StoredType;
use wavesplat_core::source::Parsed;
use wavesplat_core::source::file_header::check_size;
use wavesplat_core::source::layout::{Layout, Shape};
use wavesplat_core::source::parts::{DataLocation, Part, Stored};

const PIECE: usize = 64 << 10; // bytes read at a time when lines are counted

/// The samples that are meant.
pub(super) struct NrrdSamples {
    pub(super) axes: Axes,
    pub(super) layout: Layout,
    pub(super) shape: Shape,
    /// The type of the stored numbers.
    pub(super) ty: StoredType,
    pub(super) big_endian: bool,
    pub(super) gzip: bool,
    pub(super) placed: Placed,
    pub(super) variable: Option<String>,
}

/// Bytes and lines to leave out before the samples of each data file.
struct Skip {
    lines: u64,
    bytes: Option<u64>, // none: the samples are at the end of the file
}

/// The files that hold the frames, checked for their size.
pub(super) fn parts(file: &FileBytes, header: &NrrdHeader, array: &NrrdSamples) -> Result<Vec<Part>> {
    let refused = |e| Error::input(file.path(), e);
    let skip = skip(header).map_err(refused)?;
    let Some(named) = header.get("datafile") else {
        if !header.closed {
            return Err(refused("ends inside its header: no empty line comes before the samples".into()));
        }
        return Ok(vec![array.part(file, header.len, &skip, &array.layout)?]);
    };
    let folder = file.path().parent().unwrap_or(Path::new(""));
    let open = |name: &str| FileBytes::open(&folder.join(name), Access::Read);
    let files = match DataFiles::parse(named, &header.list).map_err(refused)? {
        DataFiles::One(name) => return Ok(vec![array.part(&open(&name)?, 0, &skip, &array.layout)?]),
        many => many,
    };
    let (count, whole) = array.split(&files).map_err(refused)?;
    let names = files.names().map_err(refused)?;
    if whole {
        let frames = array.axes.len(array.axes.frames) / count;
        let layout = array.layout.clone().with_frames(frames);
        return names.map(|name| array.part(&open(&name)?, 0, &skip, &layout)).collect();
    }
    let bytes = array.layout.bytes(array.ty.size()).map_err(refused)? / count;
    let pieces = names.map(|name| array.piece(&open(&name)?, &skip, bytes)).collect::<Result<_>>()?;
    Ok(vec![array.joined(file, pieces, bytes).map_err(refused)?])
}

impl NrrdSamples {
    /// How many files there must be, and whether each holds whole frames.
    fn split(&self, files: &DataFiles) -> Parsed<(usize, bool)> {
        let sizes = &self.axes.meaning.sizes;
        let slowest = sizes.len() - 1;
        let (axes, count) = (files.axes().unwrap_or(slowest), files.count()?);
        if !(1..=sizes.len()).contains(&axes) {
            return Err(format!("has data files of {axes} axes, but {} axes", sizes.len()));
        }
        let wanted = sizes[axes..].iter().product::<usize>();
        let fits = if axes > slowest { count > 0 && sizes[slowest].is_multiple_of(count) } else { count == wanted };
        if !fits {
            let wanted = if axes > slowest {
                format!("one or several of the {}", sizes[slowest])
            } else {
                format!("one of the {wanted}")
            };
            return Err(format!("names {count} data files, of which each should hold {wanted} parts of {axes} axes"));
        }
        Ok((count, axes >= slowest && self.axes.frames == Some(slowest)))
    }

    /// Frames that are in one file.
    fn part(&self, data: &FileBytes, header: u64, skip: &Skip, layout: &Layout) -> Result<Part> {
        let refused = |e| Error::input(data.path(), e);
        let ty = self.ty;
        let bytes = layout.bytes(ty.size()).map_err(refused)?;
        if self.gzip {
            let (start, skip) = skip.compressed(data, header)?;
            let stream = Stream { compression: Compression::Gzip, start, skip };
            return stream.part(data.path(), data.state(), layout, ty, self.big_endian).map_err(refused);
        }
        let start = skip.start(data, header, bytes)?;
        let frame = self.shape.frame_bytes() / self.shape.sample().size() * ty.size();
        check_size(data.len(), start, &self.shape, ty, bytes / frame).map_err(refused)?;
        let stored = Stored::new(layout, ty, self.big_endian).map_err(refused)?;
        let frames = layout.len(AxisRole::Frames);
        Ok(Part { path: data.path().into(), state: data.state(), frames, stored, at: DataLocation::Byte(start) })
    }

    /// A file of less than a frame, or of some samples of every frame; where its samples come, [`Self::joined`] says.
    fn piece(&self, data: &FileBytes, skip: &Skip, bytes: usize) -> Result<Piece> {
        let refused = |what| Error::input(data.path(), what);
        let stream = if self.gzip {
            let (start, skip) = skip.compressed(data, 0)?;
            check_room(data.len(), skip.saturating_add(bytes as u64)).map_err(refused)?;
            pieces::Stream { start, skip, bytes, compression: Some(Compression::Gzip) }
        } else {
            let start = skip.start(data, 0, bytes)?;
            let found = data.len().saturating_sub(start);
            if found != bytes as u64 {
                return Err(refused(format!("expected {bytes} bytes of samples after {start}, found {found}")));
            }
            pieces::Stream { start, skip: 0, bytes, compression: None }
        };
        let (path, state, samples) = (data.path().into(), data.state(), Box::new(stream));
        Ok(Piece { path, state, start: [0; 3], dims: [bytes, 1, 1], samples })
    }

    /// Frames that are in several files: one after another, or all together. Bytes count as voxels, which lie in a row.
    fn joined(&self, file: &FileBytes, pieces: Vec<Piece>, bytes: usize) -> Parsed<Part> {
        let frames = self.axes.len(self.axes.frames);
        let in_turn = frames == 1 || self.axes.frames == Some(self.axes.meaning.sizes.len() - 1);
        let together = if in_turn { 1 } else { frames };
        let layout = self.layout.clone().with_frames(together);
        let stored = Stored::new(&layout, self.ty, self.big_endian)?;
        let (each, mut pieces) = (pieces.len() / (frames / together), pieces.into_iter());
        let placed = |(i, piece)| Piece { start: [i * bytes, 0, 0], ..piece };
        let groups = (0..frames / together).map(|_| pieces.by_ref().take(each).enumerate().map(placed).collect());
        let at = DataLocation::Decoded(Box::new(Pieces {
            dims: [each * bytes, 1, 1],
            voxel: 1,
            together,
            frames: groups.collect(),
        }));
        Ok(Part { path: file.path().into(), state: file.state(), frames, stored, at })
    }
}

fn skip(header: &NrrdHeader) -> Parsed<Skip> {
    let number = |name| header.get(name).unwrap_or("0").parse::<i64>().map_err(|_| format!("{name} is no number"));
    let lines = u64::try_from(number("lineskip")?).map_err(|_| "line skip is negative")?;
    match number("byteskip")? {
        -1 => Ok(Skip { lines, bytes: None }),
        n => Ok(Skip { lines, bytes: Some(u64::try_from(n).map_err(|_| format!("byte skip {n} is not supported"))?) }),
    }
}

impl Skip {
    /// Where samples of so many bytes start.
    fn start(&self, file: &FileBytes, header: u64, bytes: usize) -> Result<u64> {
        let Some(skipped) = self.bytes else {
            return Ok(file.len().saturating_sub(bytes as u64).max(header));
        };
        let start = after_lines(file, header, self.lines)?.checked_add(skipped);
        start.ok_or_else(|| Error::input(file.path(), "byte skip is too large"))
    }

    /// Where a compressed stream starts, and the number of decompressed bytes to skip.
    fn compressed(&self, file: &FileBytes, header: u64) -> Result<(u64, u64)> {
        let skip = self.bytes.ok_or_else(|| Error::input(file.path(), "byte skip -1 is for raw samples alone"))?;
        Ok((after_lines(file, header, self.lines)?, skip))
    }
}

/// The byte after so many ends of lines.
fn after_lines(file: &FileBytes, start: u64, lines: u64) -> Result<u64> {
    let (mut at, mut left, mut piece) = (start, lines, vec![0; if lines > 0 { PIECE } else { 0 }]);
    while left > 0 {
        let len = usize::try_from(file.len().saturating_sub(at)).unwrap_or(PIECE).min(PIECE);
        if len == 0 {
            return Err(Error::input(file.path(), format!("ends before the {lines} lines of its line skip")));
        }
        file.read_at(at, &mut piece[..len]).map_err(|e| Error::io(file.path(), "counting lines", e))?;
        let ends = piece[..len].iter().enumerate().filter(|(_, b)| **b == b'\n');
        let (mut used, mut seen) = (len, 0);
        for (i, _) in ends.take(usize::try_from(left).unwrap_or(usize::MAX)) {
            seen += 1;
            used = if seen == left { i + 1 } else { used };
        }
        left -= seen;
        at += used as u64;
    }
    Ok(at)
}
