//! The functions of JavaScript.
#![allow(unsafe_code)]

use std::io;
use std::panic::PanicHookInfo;

#[link(wasm_import_module = "page")]
unsafe extern "C" {
    /// Reads bytes of the file that is elsewhere. Returns 0, or else the page has a text about what is wrong.
    fn read_far(offset: f64, out: *mut u8, bytes: usize) -> usize;
    /// Copies the text of the last failed read, at most so many bytes, and returns how many.
    fn problem(out: *mut u8, most: usize) -> usize;
    /// Takes the message of a panic.
    fn panicked(text: *const u8, bytes: usize);
}

/// Most bytes of a text about a failed read.
const MOST_TEXT: usize = 4096;

/// Tells the page what went wrong before the program stops.
pub(crate) fn say(info: &PanicHookInfo<'_>) {
    let text = info.to_string();
    // SAFETY: the page copies the text before it returns.
    unsafe { panicked(text.as_ptr(), text.len()) };
}

/// Reads bytes of the file that is elsewhere.
pub(crate) fn read(offset: u64, out: &mut [u8]) -> io::Result<()> {
    // SAFETY: the page writes no more than `out.len()` bytes, all within `out`.
    let failed = unsafe { read_far(offset as f64, out.as_mut_ptr(), out.len()) };
    if failed == 0 {
        return Ok(());
    }
    let mut text = vec![0; MOST_TEXT];
    // SAFETY: the page writes no more than `text.len()` bytes.
    let bytes = unsafe { problem(text.as_mut_ptr(), text.len()) };
    text.truncate(bytes);
    Err(io::Error::other(String::from_utf8_lossy(&text).into_owned()))
}
