//! The arithmetic of the caller: programs flush small numbers to zero, round otherwise, or let invalid numbers end them. The
//! library needs the usual arithmetic, or bounds would not hold. Threads have that of the thread that starts them.
#![allow(unsafe_code)]

#[cfg(any(target_arch = "x86_64", target_arch = "aarch64"))]
use std::arch::asm;

/// The caller's arithmetic, which comes back when this is dropped.
pub(crate) struct Arithmetic(u64);

/// All exceptions masked, rounding to nearest, nothing flushed to zero.
#[cfg(target_arch = "x86_64")]
const USUAL: u64 = 0x1F80;
#[cfg(not(target_arch = "x86_64"))]
const USUAL: u64 = 0;

impl Arithmetic {
    /// Changes to the usual arithmetic.
    pub(crate) fn usual() -> Self {
        let callers = Self(control());
        set_control(USUAL);
        callers
    }
}

impl Drop for Arithmetic {
    fn drop(&mut self) {
        set_control(self.0);
    }
}

#[cfg(target_arch = "x86_64")]
fn control() -> u64 {
    let mut control = 0_u32;
    // SAFETY: it stores the register in the variable.
    unsafe { asm!("stmxcsr [{}]", in(reg) &raw mut control, options(nostack, preserves_flags)) };
    control.into()
}

#[cfg(target_arch = "x86_64")]
fn set_control(control: u64) {
    let control = control as u32;
    // SAFETY: it loads the register: a value that was there before, or the one that every program begins with.
    unsafe { asm!("ldmxcsr [{}]", in(reg) &raw const control, options(nostack, readonly)) };
}

#[cfg(target_arch = "aarch64")]
fn control() -> u64 {
    let control;
    // SAFETY: it reads the register.
    unsafe { asm!("mrs {}, fpcr", out(reg) control, options(nomem, nostack, preserves_flags)) };
    control
}

#[cfg(target_arch = "aarch64")]
fn set_control(control: u64) {
    // SAFETY: it loads the register: a value that was there before, or the one that every program begins with.
    unsafe { asm!("msr fpcr, {}", in(reg) control, options(nomem, nostack, preserves_flags)) };
}

/// Elsewhere it stays as it is.
#[cfg(not(any(target_arch = "x86_64", target_arch = "aarch64")))]
fn control() -> u64 {
    USUAL
}

#[cfg(not(any(target_arch = "x86_64", target_arch = "aarch64")))]
fn set_control(_: u64) {}
