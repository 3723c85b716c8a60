//! Texts and numbers behind pointers of the caller.
#![allow(unsafe_code)]

use std::ffi::{CStr, c_char};
use wavesplat::{Error, Result};

/// A text; none for null.
///
/// # Safety
/// `text` is null or ends with a 0, and stays as it is for `'a`.
pub(crate) unsafe fn optional<'a>(name: &'static str, text: *const c_char) -> Result<Option<&'a str>> {
    if text.is_null() {
        return Ok(None);
    }
    // SAFETY: the caller's.
    let text = unsafe { CStr::from_ptr(text) };
    text.to_str().map(Some).map_err(|_| Error::setting(name, "is not UTF-8"))
}

/// As [`optional`], for a text that must be there.
///
/// # Safety
/// As of [`optional`].
pub(crate) unsafe fn required<'a>(name: &'static str, text: *const c_char) -> Result<&'a str> {
    // SAFETY: the caller's.
    unsafe { optional(name, text) }?.ok_or_else(|| missing(name))
}

/// Numbers that follow each other; none for null.
///
/// # Safety
/// `numbers` is null or points to `count` of them.
pub(crate) unsafe fn listed(name: &'static str, numbers: *const f64, count: usize) -> Result<Option<Vec<f64>>> {
    if numbers.is_null() {
        return Ok(None);
    }
    if count.checked_mul(size_of::<f64>()).is_none_or(|bytes| bytes > isize::MAX as usize) {
        return Err(Error::setting(name, format!("{count} are too many")));
    }
    // SAFETY: the caller's.
    Ok(Some((0..count).map(|n| unsafe { numbers.add(n).read_unaligned() }).collect()))
}

/// What a pointer points to, unless it is null.
///
/// # Safety
/// `at` is null or points to a `T` that nobody changes for `'a`.
pub(crate) unsafe fn pointed<'a, T>(name: &'static str, at: *const T) -> Result<&'a T> {
    // SAFETY: the caller's.
    unsafe { at.as_ref() }.ok_or_else(|| missing(name))
}

/// As [`pointed`], for the only user of a `T`.
///
/// # Safety
/// `at` is null or points to a `T` that nobody else uses for `'a`.
pub(crate) unsafe fn pointed_mut<'a, T>(name: &'static str, at: *mut T) -> Result<&'a mut T> {
    // SAFETY: the caller's.
    unsafe { at.as_mut() }.ok_or_else(|| missing(name))
}

fn missing(name: &'static str) -> Error {
    Error::setting(name, "is null")
}

/// Gives the caller a value.
///
/// # Safety
/// `at` is null, or has room for a `T`.
pub(crate) unsafe fn give<T>(name: &'static str, at: *mut T, value: T) -> Result<()> {
    if at.is_null() {
        return Err(missing(name));
    }
    // SAFETY: the caller's.
    unsafe { at.write_unaligned(value) };
    Ok(())
}
