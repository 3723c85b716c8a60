//! The functions of JavaScript.
#![allow(unsafe_code)]

use std::panic::PanicHookInfo;

#[link(wasm_import_module = "page")]
unsafe extern "C" {
    /// 1 if the page has bytes of the file that is elsewhere. Else it takes note that they are wanted, and gives 0.
    fn has(offset: f64, bytes: usize) -> usize;
    /// Copies bytes that the page has.
    fn give(offset: f64, out: *mut u8, bytes: usize);
    /// Takes the message of a panic.
    fn panicked(text: *const u8, bytes: usize);
}

/// Whether the page has bytes of the file that is elsewhere. If not, it reads them before it asks again.
pub(crate) fn is_there(offset: u64, bytes: usize) -> bool {
    // SAFETY: the page touches no memory of this program.
    unsafe { has(offset as f64, bytes) == 1 }
}

/// Copies bytes that [are there](is_there).
pub(crate) fn copy(offset: u64, out: &mut [u8]) {
    // SAFETY: the page writes no more than `out.len()` bytes, all within `out`.
    unsafe { give(offset as f64, out.as_mut_ptr(), out.len()) }
}

/// Tells the page what went wrong before the program stops.
pub(crate) fn say(info: &PanicHookInfo<'_>) {
    let text = info.to_string();
    // SAFETY: the page copies the text before it returns.
    unsafe { panicked(text.as_ptr(), text.len()) };
}
