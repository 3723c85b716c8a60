//! Headerless samples: the user says what they are.

use super::OpenOptions;
use super::frames::Shape;
use super::series::{At, Described, Part, check_size};
use crate::error::{Error, Result};
use crate::mapped::{Access, FileBytes};
use std::path::Path;

/// The frames that `--dims` and `--dtype` describe, and how many of them if `--dims` says so.
///
/// # Errors
/// Usage, if one of them is missing or makes no sense.
pub(super) fn shape(options: &OpenOptions) -> Result<(Shape, Option<usize>)> {
    let dims = options.dims.as_deref().unwrap_or_default();
    let (dims, frames) = match *dims {
        [x, y, z] => ([x, y, z], None),
        [x, y, z, t] => ([x, y, z], Some(t)),
        _ => return Err(Error::usage(format!("--dims needs NXxNYxNZ or NXxNYxNZxNT, not {} number(s)", dims.len()))),
    };
    let Some(sample) = options.sample else {
        return Err(Error::usage("headerless data needs --dtype, for example --dtype f32"));
    };
    if frames == Some(0) {
        return Err(Error::usage("--dims with 0 frames describes nothing"));
    }
    if options.variable.is_some() {
        return Err(Error::usage("--variable is for .vti files; headerless data has one array"));
    }
    let shape = Shape::new(dims, sample).map_err(|e| Error::usage(format!("--dims: {e}")))?;
    Ok((shape, frames))
}

/// Checks one file against the options.
pub(super) fn describe(path: &Path, options: &OpenOptions) -> Result<Described> {
    let (shape, frames) = shape(options)?;
    let len = FileBytes::open(path, Access::Read)?.len();
    let count = frames.unwrap_or(1);
    check_size(len, options.offset, &shape, count)
        .map_err(|what| Error::input(path, format!("{what}{}", advice(len, &shape, options))))?;
    let at = At::Byte(options.offset);
    let part = Part { path: path.into(), len, frames: count, big_endian: options.big_endian, at };
    Ok(Described::plain(shape, vec![part]))
}

/// What to try when the size is wrong.
fn advice(len: u64, shape: &Shape, options: &OpenOptions) -> String {
    let [x, y, z] = shape.dims();
    let payload = len.saturating_sub(options.offset);
    match (payload / shape.frame_bytes() as u64, payload % shape.frame_bytes() as u64) {
        (1, 0) => format!(": say --dims {x}x{y}x{z}"),
        (k, 0) if k > 1 => format!(": say --dims {x}x{y}x{z}x{k}"),
        _ => "; check --dims, --dtype and --offset".into(),
    }
}
