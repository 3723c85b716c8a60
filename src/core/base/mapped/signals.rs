//! Signals of the programs: lost pages of a map, and Ctrl-C.

use super::SLOTS;
use std::ffi::{c_char, c_int, c_void};
use std::ptr;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;

/// After this, a SIGBUS in a mapped file ends the process with exit code 4 and a message that names the file. A write
/// beyond the limit on file sizes becomes an error and no longer ends the process.
///
/// For programs. Call once at the start. A library must not take over signals.
#[doc(hidden)]
pub fn explain_sigbus() {
    // SAFETY: `action` is zeroed (a valid value: no flags, empty mask) and then filled in; the handler only uses
    // async-signal-safe calls (`write`, `_exit`) and lock-free atomics. Ignoring a signal runs nothing.
    unsafe {
        let mut action: libc::sigaction = std::mem::zeroed();
        action.sa_sigaction = on_sigbus as *const () as usize;
        action.sa_flags = libc::SA_SIGINFO;
        libc::sigaction(libc::SIGBUS, &raw const action, ptr::null_mut());
        libc::signal(libc::SIGXFSZ, libc::SIG_IGN);
    }
}

/// Bytes of the stack of the thread that waits for signals. They are few, since they count where memory is limited.
const SIGNAL_STACK: usize = 256 << 10;

/// After this, SIGINT (Ctrl-C) and SIGTERM call `end` with the signal's number, on a separate thread. A second signal
/// ends the process at once. Signals that are ignored, as in some background jobs, stay ignored.
///
/// For programs. Call once at the start, before other threads start: they inherit the blocked signals.
#[doc(hidden)]
pub fn on_interrupt(end: impl FnOnce(c_int) + Send + 'static) {
    // SAFETY: both sets are made by `sigemptyset`, `was` is zeroed and then filled in by `sigaction`, which changes
    // nothing if it gets no new action. Only the signal masks of this thread and of the waiting thread change.
    unsafe {
        let mut asked: libc::sigset_t = std::mem::zeroed();
        libc::sigemptyset(&raw mut asked);
        for signal in [libc::SIGINT, libc::SIGTERM] {
            let mut was: libc::sigaction = std::mem::zeroed();
            libc::sigaction(signal, ptr::null(), &raw mut was);
            if was.sa_sigaction != libc::SIG_IGN {
                libc::sigaddset(&raw mut asked, signal);
            }
        }
        libc::pthread_sigmask(libc::SIG_BLOCK, &raw const asked, ptr::null_mut());
        let waits = thread::Builder::new().stack_size(SIGNAL_STACK).spawn(move || {
            let mut signal = 0;
            if libc::sigwait(&raw const asked, &raw mut signal) == 0 {
                libc::pthread_sigmask(libc::SIG_UNBLOCK, &raw const asked, ptr::null_mut());
                end(signal);
            }
        });
        if waits.is_err() {
            libc::pthread_sigmask(libc::SIG_UNBLOCK, &raw const asked, ptr::null_mut()); // signals act as before
        }
    }
}

/// Whether a thread reports a SIGBUS already.
static REPORTED: AtomicBool = AtomicBool::new(false);

extern "C" fn on_sigbus(_signal: c_int, info: *mut libc::siginfo_t, _context: *mut c_void) {
    // Several threads may read the same lost page: their messages would mix.
    while REPORTED.swap(true, Ordering::SeqCst) {
        // SAFETY: `pause` is async-signal-safe. The reporting thread ends the process.
        unsafe { libc::pause() };
    }
    // SAFETY: the kernel passes a valid `info` to a handler installed with SA_SIGINFO.
    let address = unsafe { (*info).si_addr() } as usize;
    let path = SLOTS.iter().find(|s| s.holds(address)).map(|s| s.path.load(Ordering::SeqCst));
    write_stderr(c"wavesplat: ".as_ptr());
    write_stderr(path.unwrap_or(c"a mapped file".as_ptr().cast_mut()));
    write_stderr(c": became shorter or unreadable while it was being read\n".as_ptr());
    // SAFETY: `_exit` is async-signal-safe.
    unsafe { libc::_exit(4) }
}

/// Writes a C string to standard error, from a signal handler.
fn write_stderr(text: *const c_char) {
    // SAFETY: `text` is NUL-terminated and alive: a literal, or the path of a registered map that is not dropped
    // while this thread reads from it. A failed write has nowhere to be reported.
    unsafe {
        libc::write(2, text.cast(), libc::strlen(text));
    }
}
