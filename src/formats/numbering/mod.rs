//! The order of frames by the numbers in file names, and frames that are missing by these.
//!
//! [`names`] reads the numbers, [`order()`] decides which of them counts frames.

mod dates;
mod names;
mod order;

pub(crate) use order::{Planes, order, sort};

use names::{Column, Name, Reading, Style};
use order::{Found, found};
use std::collections::HashMap;
use std::path::{Path, PathBuf};
use wavesplat_core::base::error::{Error, Note, Remedy, Result};

/// An error if at least three names differ in one number alone and its steps are not all the same, or if names count two
/// things.
pub(crate) fn check(paths: &[PathBuf]) -> Result<()> {
    if paths.len() < 3 {
        return Ok(());
    }
    let (numbers, is_one) = match found(paths) {
        Found::One { numbers, is_alone } => (numbers, is_alone),
        Found::Several(several) => return Err(several.refused(paths)),
        Found::Nothing | Found::Unclear { .. } => return Ok(()),
    };
    let steps: Vec<i128> = numbers.values.windows(2).map(|n| n[1] - n[0]).collect();
    if is_a_shells_order(paths, &numbers) {
        return Err(out_of_order(&paths[0]));
    }
    let usual = usual_step(&steps);
    match steps.iter().position(|s| is_one && !numbers.is_near(*s, usual)) {
        Some(at) => Err(irregular(&paths[at], &paths[at + 1], &Steps { step: steps[at], usual, unit: numbers.unit })),
        None => Ok(()),
    }
}

/// As [`check`], for the steps of a variable of a file; `what` names them in messages.
pub(crate) fn check_steps<T: std::fmt::Display>(file: &Path, variable: &str, what: &str, steps: &[T]) -> Result<()> {
    let names: Vec<PathBuf> = steps.iter().map(|step| format!("{what} {step}").into()).collect();
    let refused = |e: Error| Error::input(file, Note { text: format!("{variable}: {e}"), remedy: e.remedy() });
    check(&names).map_err(refused)
}

/// Whether numbers would be regular, but names are in the order of their letters: as a shell puts the names that match a
/// pattern.
fn is_a_shells_order(paths: &[PathBuf], numbers: &Column) -> bool {
    let order = numbers.order();
    let is_sorted = order.windows(2).all(|pair| pair[0] < pair[1]);
    let by_digits = || numbers.values.iter().map(ToString::to_string).is_sorted();
    let by_letters = || paths.is_sorted_by_key(|path| path.as_os_str());
    !is_sorted && numbers.is_regular() && numbers.is_unique() && (by_digits() || by_letters())
}

fn out_of_order(first: &Path) -> Error {
    let what = "and the files after it are in the order that a shell gives, 10 before 2";
    Error::input(first, format!("{what}; quote the pattern or name the folder, to sort them by number"))
}

/// An error if numbered names differ in more than their numbers: a folder with frames of two variables, say.
pub(crate) fn check_one_series(paths: &[PathBuf]) -> Result<()> {
    if [Style::Decimals, Style::Signed, Style::Integers].into_iter().any(|style| Reading::of(paths, style).is_some()) {
        return Ok(());
    }
    let words = |p: &PathBuf| Name::parse(p, Style::Decimals).filter(Name::is_numbered).map(|name| name.words);
    let Some((first, other)) = paths.first().zip(paths.iter().find(|p| words(p) != words(&paths[0]))) else {
        return Ok(());
    };
    if paths.iter().all(|p| words(p).is_none()) {
        return Ok(());
    }
    let what = format!("{} and {} look like two series", name(first), name(other));
    let text = format!("{what}; a pattern in quotes chooses one");
    Err(Error::input(other, text))
}

/// The name of a file without its folder.
fn name(path: &Path) -> String {
    path.file_name().unwrap_or_default().to_string_lossy().into_owned()
}

/// A step, and the usual one, in units of a power of 10.
struct Steps {
    step: i128,
    usual: i128,
    unit: i32,
}

fn irregular(before: &Path, after: &Path, steps: &Steps) -> Error {
    let (a, b) = if before.parent() == after.parent() {
        (name(before), name(after))
    } else {
        (before.display().to_string(), after.display().to_string())
    };
    let Steps { step, usual, unit } = *steps;
    let why = if step.signum() == usual.signum() && step.abs() > usual.abs() {
        "a frame seems to be missing".into()
    } else if unit >= 0 {
        format!("the numbers usually go in steps of {usual}{}", "0".repeat(unit as usize))
    } else {
        format!("the numbers usually go in steps of {}", usual as f64 / 10_f64.powi(-unit))
    };
    Error::input(after, Note::with(format!("{a} is followed by {b}: {why}"), Remedy::AllowGaps))
}

/// The most frequent step, the smallest of several.
fn usual_step(steps: &[i128]) -> i128 {
    let mut counts = HashMap::new();
    for step in steps {
        *counts.entry(*step).or_insert(0_usize) += 1;
    }
    let best = counts.into_iter().max_by_key(|(step, count)| (*count, std::cmp::Reverse(step.unsigned_abs()), *step));
    best.map_or(0, |(step, _)| step)
}

#[cfg(test)]
mod order_tests;

#[cfg(test)]
mod tests {
    use super::super::testing::message;
    use super::*;

    fn checked(names: &[&str]) -> Result<()> {
        check(&names.iter().map(PathBuf::from).collect::<Vec<_>>())
    }

    #[test]
    fn a_missing_frame_is_named_by_its_neighbours() {
        let message = message(checked(&["d/f_08.npy", "d/f_09.npy", "d/f_10.npy", "d/f_12.npy", "d/f_13.npy"]));
        assert!(message.contains("f_10.npy is followed by f_12.npy: a frame seems to be missing"), "{message}");
        assert!(message.contains("AllowGaps"), "{message}");
    }

    #[test]
    fn the_order_of_a_shell_is_named() {
        let names: Vec<String> = [0, 1, 10, 11, 2, 3, 4, 5, 6, 7, 8, 9].map(|n| format!("f_{n}.vti")).to_vec();
        let message = message(checked(&names.iter().map(String::as_str).collect::<Vec<_>>()));
        assert!(message.contains("quote the pattern"), "{message}");
    }

    #[test]
    fn steps_that_are_all_the_same_pass() {
        for names in [["a10", "a20", "a30"], ["3/a", "2/a", "1/a"], ["x1y7", "x2y7", "x3y7"]] {
            checked(&names).expect("regular");
        }
    }

    #[test]
    fn names_that_say_nothing_pass() {
        for names in [vec!["a1", "a7"], vec!["1a", "a5", "b6"], vec!["a1b1", "a2b3", "a9b7"], vec!["x", "y", "z"]] {
            checked(&names).expect("no numbering");
        }
        checked(&["a1234567890123456789012", "a2", "a9"]).expect("too long to be a frame's number");
    }

    #[test]
    fn files_out_of_order_are_noticed() {
        assert!(message(checked(&["a1", "a2", "a3", "a5", "a4", "a6", "a7", "a8"])).contains("a3 is followed by a5"));
        assert!(message(checked(&["a1", "a2", "a3", "a1"])).contains("steps of 1"));
        assert!(message(checked(&["a1", "a2", "a02"])).contains("steps of"));
    }
}
