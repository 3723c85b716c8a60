//! The functions that JavaScript calls.
#![allow(unsafe_code, unreachable_pub)]

use crate::host;
use crate::session;
use std::cell::RefCell;
use std::sync::Once;

thread_local! {
    static ANSWER: RefCell<Vec<u8>> = const { RefCell::new(Vec::new()) };
}

/// Memory for so many bytes, which the caller writes and passes to [`ask`] as a whole.
#[unsafe(no_mangle)]
pub extern "C" fn reserve(bytes: usize) -> *mut u8 {
    Box::into_raw(vec![0_u8; bytes].into_boxed_slice()).cast()
}

/// Answers a question. Returns 0, or 1 if the answer is the text of an error. The answer is valid until the next question.
///
/// # Safety
/// Both ranges are those of [`reserve`], and are passed only once.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn ask(name: *mut u8, name_bytes: usize, body: *mut u8, body_bytes: usize) -> usize {
    static HOOK: Once = Once::new();
    HOOK.call_once(|| std::panic::set_hook(Box::new(host::say)));
    // SAFETY: the caller gives each of its own ranges once, as `reserve` made them.
    let [name, body] = unsafe { [taken(name, name_bytes), taken(body, body_bytes)] };
    let found = session::answer(&String::from_utf8_lossy(&name), body);
    let is_error = usize::from(found.is_err());
    ANSWER.set(found.unwrap_or_else(|e| e.to_string().into_bytes()));
    is_error
}

/// Where the answer begins.
#[unsafe(no_mangle)]
pub extern "C" fn answer() -> *const u8 {
    ANSWER.with_borrow(Vec::as_ptr)
}

/// Its length.
#[unsafe(no_mangle)]
pub extern "C" fn answer_bytes() -> usize {
    ANSWER.with_borrow(Vec::len)
}

/// The bytes of a range.
///
/// # Safety
/// [`reserve`] made the range, and this call is the last to use it.
unsafe fn taken(start: *mut u8, bytes: usize) -> Vec<u8> {
    // SAFETY: `reserve` made it as a box of a slice of so many bytes.
    unsafe { Box::from_raw(std::ptr::slice_from_raw_parts_mut(start, bytes)) }.into_vec()
}
