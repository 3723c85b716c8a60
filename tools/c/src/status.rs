//! What functions return, and the message of an error.
#![allow(unsafe_code)]

use crate::arithmetic::Arithmetic;
use std::cell::RefCell;
use std::ffi::{CStr, CString, c_char};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::OnceLock;
use wavesplat::{Error, Result};

/// Success.
pub const WAVESPLAT_OK: i32 = 0;
/// An argument or a setting is wrong, or a path cannot be used.
pub const WAVESPLAT_ARGUMENT: i32 = 1;
/// Reading or writing failed.
pub const WAVESPLAT_IO: i32 = 2;
/// The frames cannot be converted: samples are missing, say.
pub const WAVESPLAT_INPUT: i32 = 3;
/// A coefficient file is damaged, or is none.
pub const WAVESPLAT_DAMAGED: i32 = 4;
/// A file changed while it was open.
pub const WAVESPLAT_CHANGED: i32 = 5;
/// A bug in the library. Please report it.
pub const WAVESPLAT_BUG: i32 = 6;

thread_local! {
    static MESSAGE: RefCell<CString> = RefCell::default();
}

/// What went wrong in the last call of this thread that failed, in English and UTF-8. It is valid until the next call that fails.
#[unsafe(no_mangle)]
pub extern "C" fn wavesplat_message() -> *const c_char {
    let kept = MESSAGE.try_with(|message| message.borrow().as_ptr());
    kept.unwrap_or(c"".as_ptr()) // a thread that ends has none
}

/// The version of the library, such as "0.1.0". Versions with the same first number, or 0 and the same second, fit together.
#[unsafe(no_mangle)]
pub extern "C" fn wavesplat_version() -> *const c_char {
    const VERSION: &CStr = match CStr::from_bytes_with_nul(concat!(env!("CARGO_PKG_VERSION"), "\0").as_bytes()) {
        Ok(version) => version,
        Err(_) => c"",
    };
    VERSION.as_ptr()
}

/// Does what a function of the library is asked for, with the usual arithmetic. Keeps the message of an error, and of a panic.
pub(crate) fn answer(work: impl FnOnce() -> Result<()>) -> i32 {
    let _usual = Arithmetic::usual();
    let work = AssertUnwindSafe(|| check_process().and_then(|()| work()));
    let (status, message) = match catch_unwind(work) {
        Ok(Ok(())) => return WAVESPLAT_OK,
        Ok(Err(error)) => (status_of(&error), error.to_string()),
        Err(_) => (WAVESPLAT_BUG, "this is a bug in wavesplat; please report it".into()),
    };
    let text = CString::new(message.replace('\0', "\u{fffd}")).unwrap_or_default();
    let _ = MESSAGE.try_with(|message| message.replace(text)); // a thread that ends keeps none
    status
}

/// An error in a process that was forked after the library was used: its threads did not follow, and waiting for them takes for ever.
fn check_process() -> Result<()> {
    static FIRST: OnceLock<u32> = OnceLock::new();
    match *FIRST.get_or_init(std::process::id) == std::process::id() {
        true => Ok(()),
        false => Err(Error::setting("process", "was forked after wavesplat was used, and cannot use it")),
    }
}

fn status_of(error: &Error) -> i32 {
    match error {
        Error::Io { .. } => WAVESPLAT_IO,
        Error::CoefficientFile { source, .. } if source.is_io() => WAVESPLAT_IO,
        Error::CoefficientFile { .. } | Error::BoundMissed { .. } => WAVESPLAT_DAMAGED,
        Error::Input { .. } => WAVESPLAT_INPUT,
        Error::Changed { .. } => WAVESPLAT_CHANGED,
        _ => WAVESPLAT_ARGUMENT,
    }
}
