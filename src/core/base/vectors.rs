//! Runs kernels compiled for the vector units of the machine, chosen when the program runs.
//!
//! A kernel is an `#[inline(always)]` function over slices; `dispatch!(kernel(a, b))` calls it compiled for `level`. Called
//! directly, it is compiled for the baseline processor. All levels give the same results.
//!
//! Large bodies of loops within kernels are no closures, or `#[inline(always)]` ones: others may stay functions for the baseline
//! processor.

use std::ffi::OsStr;
use std::sync::LazyLock;

/// The vector units that kernels use.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Level {
    /// Those that every processor of the architecture has.
    Baseline,
    /// The best of the machine.
    Machine,
}

/// The level of this process: the machine's, unless the environment variable `WAVESPLAT_VECTOR_UNITS` is `baseline`.
#[inline]
fn level() -> Level {
    static LEVEL: LazyLock<Level> = LazyLock::new(|| named(std::env::var_os("WAVESPLAT_VECTOR_UNITS").as_deref()));
    *LEVEL
}

fn named(name: Option<&OsStr>) -> Level {
    if name.is_some_and(|name| name == "baseline") { Level::Baseline } else { Level::Machine }
}

// The arguments are parameters of the functions below, and not captured by the closure: only of parameters do compilers
// know that slices do not overlap.
macro_rules! runners {
    ($($run:ident($($argument:ident: $Type:ident),+);)+) => {$(
        /// Runs a kernel compiled for `level`.
        #[inline]
        #[allow(clippy::too_many_arguments, reason = "the kernel's, and the kernel")]
        pub fn $run<$($Type,)+ R>(kernel: impl Fn($($Type),+) -> R, $($argument: $Type),+) -> R {
            #[allow(clippy::too_many_arguments, reason = "the kernel's, and the kernel")]
            fn baseline<$($Type,)+ R>(kernel: impl Fn($($Type),+) -> R, $($argument: $Type),+) -> R {
                kernel($($argument),+)
            }

            #[allow(clippy::too_many_arguments, reason = "the kernel's, and the kernel")]
            #[multiversion::multiversion(targets("x86_64+avx512f", "x86_64+avx2"))]
            fn machine<$($Type,)+ R, F: Fn($($Type),+) -> R>(kernel: F, $($argument: $Type),+) -> R {
                multiversion::target::match_target! {
                    "x86_64+avx512f" => kernel($($argument),+),
                    "x86_64+avx2" => kernel($($argument),+),
                    _ => baseline(kernel, $($argument),+), // not compiled a second time
                }
            }

            match level() {
                Level::Baseline => baseline(kernel, $($argument),+),
                Level::Machine => machine(kernel, $($argument),+),
            }
        }
    )+};
}

runners! {
    run1(a: A);
    run2(a: A, b: B);
    run3(a: A, b: B, c: C);
    run4(a: A, b: B, c: C, d: D);
    run5(a: A, b: B, c: C, d: D, e: E);
    run6(a: A, b: B, c: C, d: D, e: E, f: F1);
    run7(a: A, b: B, c: C, d: D, e: E, f: F1, g: G);
}

/// Calls an `#[inline(always)]` kernel compiled for the vector units of `level`.
#[doc(hidden)]
#[macro_export]
macro_rules! dispatch {
    ($kernel:ident $(::<$($generic:tt),+>)? ($($argument:expr),+ $(,)?)) => {
        $crate::base::vectors::dispatch!(@ [$kernel $(::<$($generic),+>)?] $($argument),+)
    };
    (@ [$($kernel:tt)+] $a:expr) => {
        $crate::base::vectors::run1(#[inline(always)] |a| $($kernel)+(a), $a)
    };
    (@ [$($kernel:tt)+] $a:expr, $b:expr) => {
        $crate::base::vectors::run2(#[inline(always)] |a, b| $($kernel)+(a, b), $a, $b)
    };
    (@ [$($kernel:tt)+] $a:expr, $b:expr, $c:expr) => {
        $crate::base::vectors::run3(#[inline(always)] |a, b, c| $($kernel)+(a, b, c), $a, $b, $c)
    };
    (@ [$($kernel:tt)+] $a:expr, $b:expr, $c:expr, $d:expr) => {
        $crate::base::vectors::run4(#[inline(always)] |a, b, c, d| $($kernel)+(a, b, c, d), $a, $b, $c, $d)
    };
    (@ [$($kernel:tt)+] $a:expr, $b:expr, $c:expr, $d:expr, $e:expr) => {
        $crate::base::vectors::run5(#[inline(always)] |a, b, c, d, e| $($kernel)+(a, b, c, d, e), $a, $b, $c, $d, $e)
    };
    (@ [$($kernel:tt)+] $a:expr, $b:expr, $c:expr, $d:expr, $e:expr, $f:expr) => {
        $crate::base::vectors::run6(
            #[inline(always)]
            |a, b, c, d, e, f| $($kernel)+(a, b, c, d, e, f),
            $a, $b, $c, $d, $e, $f,
        )
    };
    (@ [$($kernel:tt)+] $a:expr, $b:expr, $c:expr, $d:expr, $e:expr, $f:expr, $g:expr) => {
        $crate::base::vectors::run7(
            #[inline(always)]
            |a, b, c, d, e, f, g| $($kernel)+(a, b, c, d, e, f, g),
            $a, $b, $c, $d, $e, $f, $g,
        )
    };
}
pub use dispatch;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_baseline_lowers_the_level() {
        assert_eq!(named(Some(OsStr::new("baseline"))), Level::Baseline);
        for other in [None, Some(""), Some("avx2")] {
            assert_eq!(named(other.map(OsStr::new)), Level::Machine);
        }
    }

    #[inline(always)]
    fn add_scaled(sums: &mut [f64], values: &[f64], factor: f64) -> usize {
        sums.iter_mut().zip(values).for_each(|(sum, value)| *sum += factor * value);
        sums.len()
    }

    #[test]
    fn a_dispatched_kernel_does_what_it_does() {
        let values: Vec<f64> = (0..37).map(f64::from).collect();
        let (mut sums, mut expected) = (vec![0.5; 37], vec![0.5; 37]);
        let count = dispatch!(add_scaled(&mut sums[..], &values[..], 0.3));
        assert_eq!((count, &sums), (add_scaled(&mut expected, &values, 0.3), &expected));
    }
}
