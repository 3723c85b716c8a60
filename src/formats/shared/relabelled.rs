//! Files of one frame x y z whose axes count something else, by the user's word.

use super::meaning::{Kind, Meaning};
use std::ops::Range;
use std::path::Path;
use wavesplat_core::base::error::{Error, Note, Result};
use wavesplat_core::source::Advised;
use wavesplat_core::source::file_header::{FileHeader, Units};
use wavesplat_core::source::layout::{Shape, Strides};
use wavesplat_core::source::parts::{DataLocation, Decode, Part, Stored};
use wavesplat_core::source::spill_buffer::SpillBuffer;

/// The header of a file of one frame, with its axes as the user's letters say, if there are any.
pub(crate) fn relabelled(path: &Path, header: FileHeader, letters: Option<&str>) -> Result<FileHeader> {
    match letters {
        Some(letters) => by_letters(header, letters).map_err(|e| Error::input(path, e)),
        None => Ok(header),
    }
}

fn by_letters(mut header: FileHeader, letters: &str) -> Advised<FileHeader> {
    let meaning = Meaning::by_letters(&header.shape.dims(), letters)?;
    if meaning.components() > 1 {
        return Err(format!("has only axes of voxels and frames, not {letters}").into());
    }
    let (Some(part), true) = (header.parts.pop(), header.parts.is_empty()) else {
        return Err("is in several parts: its axes count voxels alone".into());
    };
    let shape = Shape::new(meaning.plain_layout(0).dims(), header.shape.sample())?;
    let frames = meaning.len(meaning.frames());
    let part = relabelled_part(part, &meaning, frames)?;
    let (old_spacing, old_origin) = (header.spacing, header.origin);
    (header.spacing, header.origin) = ([1.0; 3], [0.0; 3]);
    for (axis, kind) in meaning.kinds.iter().enumerate() {
        if let Kind::Voxels(letter) = kind {
            (header.spacing[*letter], header.origin[*letter]) = (old_spacing[axis], old_origin[axis]);
        }
    }
    let is_said = |axis: &usize| (old_spacing[*axis], old_origin[*axis]) != (1.0, 0.0);
    if let Some(axis) = meaning.frames() {
        let along = |axis: usize| (0..frames).map(|t| old_origin[axis] + old_spacing[axis] * t as f64).collect();
        header.times = Some(axis).filter(is_said).map_or_else(Vec::new, along);
        header.units = Units { times: None, calendar: None, ..header.units };
    }
    if header.description.take().is_some() {
        header.notes.push(Note::from("coordinates and attributes are not kept: frames are not those of the array"));
    }
    Ok(FileHeader { shape, parts: vec![part], ..header })
}

fn relabelled_part(part: Part, meaning: &Meaning, frames: usize) -> Advised<Part> {
    let old = part.stored.strides;
    let mut strides = Strides { first: old.first, frame: 0, voxel: [0; 3] };
    for (axis, kind) in meaning.kinds.iter().enumerate() {
        match kind {
            Kind::Voxels(letter) => strides.voxel[*letter] = old.voxel[axis],
            Kind::Frames => {
                let frame = u64::try_from(old.voxel[axis]);
                strides.frame = frame.map_err(|_| "has its frames stored from the last to the first".to_string())?;
            }
            Kind::Components => {}
        }
    }
    let at = match part.at {
        DataLocation::Byte(start) => DataLocation::Byte(start),
        DataLocation::Decoded(inner) => DataLocation::Decoded(Box::new(Whole { inner, frames })),
    };
    Ok(Part { frames, stored: Stored { strides, ..part.stored }, at, ..part })
}

/// All frames together are what was one.
#[derive(Debug)]
struct Whole {
    inner: Box<dyn Decode>,
    frames: usize,
}

impl Decode for Whole {
    fn frames_per_chunk(&self) -> usize {
        self.frames
    }

    fn decode(&mut self, path: &Path, _frames: Range<usize>, out: &mut SpillBuffer) -> Result<()> {
        self.inner.decode(path, 0..1, out)
    }

    fn close_file(&mut self) {
        self.inner.close_file();
    }
}
