//! Headerless samples: the user says what they are.

use super::format::{Choices, Format, Reader};
use super::writer::Writer;
use crate::shared::meaning::Meaning;
use std::path::Path;
use wavesplat_core::base::description::AxisRole;
use wavesplat_core::base::error::{Error, Note, Remedy, Result};
use wavesplat_core::base::mapped::{Access, FileBytes, State};
use wavesplat_core::source::OpenOptions;
use wavesplat_core::source::file_header::{FileHeader, check_size};
use wavesplat_core::source::layout::Shape;
use wavesplat_core::source::parts::{DataLocation, Part, Stored};

pub(crate) static FORMAT: Format = Format {
    writers: &[Writer { has_halves: true, ..Writer::PLAIN }],
    ..Format::new("headerless data", &[], Reader::Frames(Ok(|path, options, _| describe(path, options)), Choices::None))
};

/// The frames that the options `dims` and `sample` describe, and how many of them if `dims` says so.
///
/// # Errors
/// [`Error::Setting`], if one of them is missing or makes no sense.
pub(crate) fn shape(options: &OpenOptions) -> Result<(Shape, Option<usize>)> {
    let dims = options.dims.as_deref().unwrap_or_default();
    let (dims, frames) = match *dims {
        [x, y, z] => ([x, y, z], None),
        [x, y, z, t] => ([x, y, z], Some(t)),
        _ => {
            return Err(Error::setting("dims", format!("needs NXxNYxNZ or NXxNYxNZxNT, not {} number(s)", dims.len())));
        }
    };
    let Some(sample) = options.sample else {
        return Err(Error::setting("sample", "headerless data needs a type of samples, for example f32"));
    };
    if frames == Some(0) {
        return Err(Error::setting("dims", "the number of frames must be at least 1"));
    }
    if options.variable.is_some() {
        return Err(Error::setting("variable", "is for files that have names; headerless data has one array"));
    }
    let shape = Shape::new(dims, sample).map_err(|e| Error::setting("dims", e))?;
    Ok((shape, frames))
}

/// Checks one file against the options.
fn describe(path: &Path, options: &OpenOptions) -> Result<FileHeader> {
    let (shape, frames) = shape(options)?;
    let state = FileBytes::open(path, Access::Read)?.state();
    let room = state.len.saturating_sub(options.offset) / shape.frame_bytes() as u64;
    let count = match frames {
        Some(_) if options.dims_are_remembered => usize::try_from(room).unwrap_or(usize::MAX).max(1),
        frames => frames.unwrap_or(1),
    };
    if let Some(letters) = options.axes.as_deref() {
        return relabelled(path, state, letters, options);
    }
    check_size(state.len, options.offset, &shape, shape.sample().into(), count)
        .map_err(|what| Error::input(path, Note::with(what, remedy(state.len, &shape, options))))?;
    let stored = Stored::plain(shape.dims(), count, shape.sample(), options.big_endian);
    let stored = stored.map_err(|e| Error::setting("dims", e))?;
    let at = DataLocation::Byte(options.offset);
    let part = Part { path: path.into(), state, frames: count, stored, at };
    Ok(FileHeader::plain(shape, vec![part]))
}

/// The samples whose axes count what the user's letters say, slowest first.
fn relabelled(path: &Path, state: State, letters: &str, options: &OpenOptions) -> Result<FileHeader> {
    let refused = |e| Error::setting("axes", e);
    let (dims, Some(sample)) = (options.dims.as_deref().unwrap_or_default(), options.sample) else {
        return Err(Error::setting("sample", "is needed"));
    };
    let meaning = Meaning::by_letters(dims, letters).map_err(refused)?;
    if meaning.components() > 1 {
        return Err(Error::setting("axes", "headerless data has voxels and frames alone"));
    }
    let layout = meaning.plain_layout(0);
    let shape = Shape::new(layout.dims(), sample).map_err(|e| Error::setting("dims", e))?;
    let frames = layout.len(AxisRole::Frames);
    check_size(state.len, options.offset, &shape, sample.into(), frames).map_err(|what| Error::input(path, what))?;
    let stored = Stored::new(&layout, sample, options.big_endian).map_err(|e| Error::setting("dims", e))?;
    let at = DataLocation::Byte(options.offset);
    Ok(FileHeader::plain(shape, vec![Part { path: path.into(), state, frames, stored, at }]))
}

/// What to try when the size is wrong.
fn remedy(len: u64, shape: &Shape, options: &OpenOptions) -> Remedy {
    let payload = len.saturating_sub(options.offset);
    match (payload / shape.frame_bytes() as u64, payload % shape.frame_bytes() as u64) {
        (frames, 0) if frames > 0 => Remedy::SetDims { dims: shape.dims(), frames },
        _ => Remedy::Adjust(&["dims", "sample", "offset"]),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{DIMS, Folder, check_inputs, payload, refused};
    use wavesplat_core::base::sample::SampleType;

    fn options(frames: Option<usize>, sample: SampleType) -> OpenOptions {
        let dims = DIMS.into_iter().chain(frames).collect();
        OpenOptions { dims: Some(dims), sample: Some(sample), ..OpenOptions::default() }
    }

    #[test]
    fn every_type_and_byte_order_is_read() {
        let folder = Folder::new();
        for ty in SampleType::ALL {
            for big_endian in [false, true] {
                let files = [0, 1, 2].map(|t| {
                    let bytes = payload(ty, t..t + 1, big_endian);
                    folder.write(&format!("f{t}.raw"), [b"12345", bytes.as_slice()].concat())
                });
                check_inputs(&files, &OpenOptions { big_endian, offset: 5, ..options(None, ty) }, ty, 3);
            }
        }
    }

    #[test]
    fn frames_of_one_file_follow_one_another() {
        let folder = Folder::new();
        let file = [folder.write("all", payload(SampleType::I16, 0..5, false))];
        check_inputs(&file, &options(Some(5), SampleType::I16), SampleType::I16, 5);
    }

    #[test]
    fn wrong_sizes_are_explained() {
        let folder = Folder::new();
        let file = [folder.write("all.raw", payload(SampleType::F32, 0..4, false))];
        refused(&file, &options(None, SampleType::F32), "SetDims { dims: [7, 5, 3], frames: 4 }");
        refused(&file, &options(Some(5), SampleType::F32), "expected 2100 bytes");
        refused(&file, &options(Some(4), SampleType::U8), "SetDims { dims: [7, 5, 3], frames: 16 }");
        refused(&file, &options(Some(4), SampleType::F64), "this size fits samples of 4 byte(s)");
        refused(
            &file,
            &OpenOptions { offset: 3, ..options(Some(4), SampleType::F32) },
            "Adjust([\"dims\", \"sample\", \"offset\"])",
        );
        let empty = [folder.write("empty.raw", "")];
        refused(&empty, &options(None, SampleType::F32), "found 0");
    }

    #[test]
    fn senseless_options_are_refused() {
        let folder = Folder::new();
        let file = [folder.write("a.raw", "abc")];
        let of = |dims: &[usize]| OpenOptions { dims: Some(dims.into()), ..options(None, SampleType::F32) };
        refused(&file, &of(&[2, 2]), "not 2 number(s)");
        refused(&file, &of(&[2, 0, 2]), "is empty");
        refused(&file, &of(&[2, 2, 2, 0]), "frames must be at least 1");
        refused(&file, &of(&[usize::MAX, 2, 2]), "too large");
        refused(&file, &of(&[2, 2, 2, usize::MAX]), "too large");
        refused(&file, &OpenOptions { sample: None, ..of(&[2, 2, 2]) }, "sample: headerless data needs");
        refused(
            &file,
            &OpenOptions { variable: Some("a".into()), ..of(&[2, 2, 2]) },
            "variable: is for files that have names",
        );
        refused(&file, &OpenOptions::default(), "is of no known format");
    }
}
