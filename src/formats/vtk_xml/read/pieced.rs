//! The pieces of an image, in one file or in one file each, as one frame.

use super::ChosenArray;
use super::encoded::EncodedArray;
use super::extent::{Extent, check_pieces};
use super::header::{VtiArray, VtiPiece};
use super::image::VtiFile;
use crate::shared::pieces::{self, Pieces};
use std::path::Path;
use wavesplat_core::base::error::{Error, Result};
use wavesplat_core::source::layout::Layout;
use wavesplat_core::source::parts::{DataLocation, Part};

const MOST: usize = 1 << 14; // pieces: each is compared with every other one

/// Where the array of an image is, checked to be complete, and the time that its files give.
pub(super) fn part(image: &VtiFile, wanted: &ChosenArray<'_>) -> Result<(Part, Option<f64>)> {
    let path = image.file.path();
    let refused = |e| Error::input(path, e);
    let found = if image.header.parallel { listed(image, wanted)? } else { LocatedPieces::in_file(image, wanted)? };
    let extents: Vec<Extent> = found.pieces.iter().map(|located| located.extent).collect();
    check_pieces(&image.header.whole, &extents).map_err(refused)?;
    let stored = wanted.stored(found.big_endian).map_err(refused)?;
    if let [only] = &found.pieces[..]
        && let Some(start) = only.encoded.plain()
    {
        let pieces::Piece { path, state, .. } = &only.piece;
        return Ok((
            Part { path: path.clone(), state: *state, frames: 1, stored, at: DataLocation::Byte(start) },
            found.time,
        ));
    }
    let frames = vec![found.pieces.into_iter().map(|located| located.piece).collect()];
    let at = DataLocation::Decoded(Box::new(Pieces { dims: wanted.lengths, voxel: wanted.voxel, together: 1, frames }));
    Ok((Part { path: path.into(), state: image.file.state(), frames: 1, stored, at }, found.time))
}

/// The pieces that one file has.
struct LocatedPieces {
    pieces: Vec<LocatedPiece>,
    big_endian: bool,
    time: Option<f64>,
}

/// A piece, and where its samples are.
struct LocatedPiece {
    extent: Extent,
    encoded: EncodedArray,
    piece: pieces::Piece,
}

impl LocatedPieces {
    fn in_file(image: &VtiFile, wanted: &ChosenArray<'_>) -> Result<Self> {
        let refused = |what: String| Err(Error::input(image.file.path(), what));
        if image.header.parallel {
            return refused("is a list of pieces among the pieces of another".into());
        }
        check_count(image, image.header.pieces.len())?;
        let pieces = image.header.pieces.iter().filter(|piece| !piece.extent.is_empty());
        let pieces = pieces.map(|piece| locate(image, piece, wanted)).collect::<Result<Vec<_>>>()?;
        let (big_endian, time) = (image.header.big_endian, image.time()?);
        Ok(Self { pieces: pieces.into_iter().flatten().collect(), big_endian, time })
    }
}

/// Refuses more pieces than can be compared.
fn check_count(image: &VtiFile, pieces: usize) -> Result<()> {
    if pieces <= MOST {
        return Ok(());
    }
    Err(Error::input(image.file.path(), format!("has {pieces} pieces or more; up to {MOST} are supported")))
}

/// The pieces of the files that a file lists.
fn listed(image: &VtiFile, wanted: &ChosenArray<'_>) -> Result<LocatedPieces> {
    let folder = image.file.path().parent().unwrap_or(Path::new(""));
    check_count(image, image.header.pieces.len())?;
    let sources = image.header.pieces.iter().filter(|piece| !piece.extent.is_empty());
    let mut all: Option<LocatedPieces> = None;
    for source in sources.filter_map(|piece| piece.source.as_deref()) {
        let path = folder.join(source);
        let found = LocatedPieces::in_file(&VtiFile::open(&path)?, wanted)?;
        let Some(before) = &mut all else {
            all = Some(found);
            continue;
        };
        if before.big_endian != found.big_endian {
            return Err(Error::input(&path, "has another byte_order than the piece before it"));
        }
        before.pieces.extend(found.pieces);
        check_count(image, before.pieces.len())?;
    }
    all.ok_or_else(|| Error::input(image.file.path(), "lists no piece that holds anything"))
}

/// The array in a piece; `None` if the piece has no cell of the image.
fn locate(image: &VtiFile, piece: &VtiPiece, wanted: &ChosenArray<'_>) -> Result<Option<LocatedPiece>> {
    let refused = |e| Error::input(image.file.path(), e);
    let (extent, whole) = (piece.extent, &wanted.whole);
    let Some(start) = extent.start_in(whole) else {
        return Err(refused(format!("has the piece {:?} outside of the whole {:?}", extent.0, whole.0)));
    };
    if !extent.has_cells(whole) {
        return Ok(None);
    }
    let VtiArray { of, name, ty, components, .. } = wanted.array;
    let same = |a: &&VtiArray| a.of == *of && a.name == *name && a.ty == *ty && a.components == *components;
    let Some(array) = piece.arrays.iter().find(same) else {
        return Err(refused(format!("has a piece without the array {name} of {components} {ty}")));
    };
    let dims = of.dims(extent.points().map_err(refused)?);
    let bytes = Layout::plain(dims, 1).bytes(wanted.voxel).map_err(refused)?;
    let encoded = image.encoded(array, wanted.ty, bytes)?;
    let (path, state) = (image.file.path().into(), image.file.state());
    let piece = pieces::Piece { path, state, start, dims, samples: Box::new(encoded) };
    Ok(Some(LocatedPiece { extent, encoded, piece }))
}
