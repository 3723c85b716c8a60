//! Finds missing frames by the numbers in file names.

use std::collections::HashMap;
use std::path::{Path, PathBuf};
use wavesplat_core::base::error::{Error, Note, Remedy, Result};

const MAX_DIGITS: usize = 18; // longer numbers are left alone
const MARK: char = '\0'; // in no path

/// An error if at least three names differ in one number alone and its steps are not all the same.
pub(crate) fn check(paths: &[PathBuf]) -> Result<()> {
    let Some(numbers) = the_number(paths) else { return Ok(()) };
    let steps: Vec<i64> = numbers.windows(2).map(|n| n[1] - n[0]).collect();
    let usual = usual_step(&steps);
    match steps.iter().position(|s| *s != usual) {
        Some(_) if is_a_shells_order(&numbers) => Err(out_of_order(&paths[0])),
        Some(at) => Err(irregular(&paths[at], &paths[at + 1], steps[at], usual)),
        None => Ok(()),
    }
}

/// As [`check`], for the steps of a variable of a file; `what` names them in messages.
pub(crate) fn check_steps(file: &Path, variable: &str, what: &str, steps: &[u64]) -> Result<()> {
    let names: Vec<PathBuf> = steps.iter().map(|step| format!("{what} {step}").into()).collect();
    let refused = |e: Error| Error::input(file, Note { text: format!("{variable}: {e}"), remedy: e.remedy() });
    check(&names).map_err(refused)
}

/// Whether numbers are regular, but in the order of their digits: as a shell puts the names that match a pattern.
fn is_a_shells_order(numbers: &[i64]) -> bool {
    let (mut sorted, mut by_digits) = (numbers.to_vec(), numbers.to_vec());
    sorted.sort_unstable();
    by_digits.sort_by_key(i64::to_string);
    by_digits == numbers && sorted != numbers && sorted.windows(3).all(|n| n[1] - n[0] == n[2] - n[1])
}

fn out_of_order(first: &Path) -> Error {
    let what = "and the files after it are in the order that a shell gives, 10 before 2";
    Error::input(first, format!("{what}; quote the pattern or name the folder, to sort them by number"))
}

/// An error if numbered names differ in more than their numbers: a folder with frames of two variables, say.
pub(crate) fn check_one_series(paths: &[PathBuf]) -> Result<()> {
    let words = |p: &PathBuf| pieces(p).map(|(words, _)| words).filter(|w| w.contains(MARK));
    let Some((first, other)) = paths.first().zip(paths.iter().find(|p| words(p) != words(&paths[0]))) else {
        return Ok(());
    };
    if paths.iter().all(|p| words(p).is_none()) {
        return Ok(());
    }
    let names = [first, other].map(|p| p.file_name().unwrap_or_default().to_string_lossy().into_owned());
    let what = format!("{} and {} look like two series", names[0], names[1]);
    let text = format!("{what}; a pattern in quotes chooses one");
    Err(Error::input(other, Note::with(text, Remedy::AllowGaps)))
}

fn irregular(before: &Path, after: &Path, step: i64, usual: i64) -> Error {
    let name = |p: &Path| p.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let (a, b) = if before.parent() == after.parent() {
        (name(before), name(after))
    } else {
        (before.display().to_string(), after.display().to_string())
    };
    let why = if step.signum() == usual.signum() && step.abs() > usual.abs() {
        "a frame seems to be missing".into()
    } else {
        format!("the numbers usually go in steps of {usual}")
    };
    Error::input(after, Note::with(format!("{a} is followed by {b}: {why}"), Remedy::AllowGaps))
}

/// The most frequent step, the smallest of several.
fn usual_step(steps: &[i64]) -> i64 {
    let mut counts = HashMap::new();
    for step in steps {
        *counts.entry(*step).or_insert(0_usize) += 1;
    }
    let best = counts.into_iter().max_by_key(|(step, count)| (*count, std::cmp::Reverse(step.unsigned_abs()), *step));
    best.map_or(0, |(step, _)| step)
}

/// The one number in which the names differ, for each of them.
fn the_number(paths: &[PathBuf]) -> Option<Vec<i64>> {
    let (first, rest) = paths.split_first().filter(|_| paths.len() >= 3)?;
    let first = pieces(first)?;
    let mut rows = vec![first.1];
    for path in rest {
        let (words, numbers) = pieces(path)?;
        rows.push(numbers);
        if words != first.0 {
            return None;
        }
    }
    let mut columns = (0..rows[0].len()).filter(|c| rows.iter().any(|r| r[*c] != rows[0][*c]));
    let (only, None) = (columns.next()?, columns.next()) else { return None };
    Some(rows.iter().map(|r| r[only]).collect())
}

/// The path with a mark in place of each number, and the numbers.
fn pieces(path: &Path) -> Option<(String, Vec<i64>)> {
    let text = path.to_string_lossy();
    let mut words = String::new();
    for c in text.chars().map(|c| if c.is_ascii_digit() { MARK } else { c }) {
        if c != MARK || !words.ends_with(MARK) {
            words.push(c);
        }
    }
    let digits = text.split(|c: char| !c.is_ascii_digit()).filter(|n| !n.is_empty());
    let numbers = digits.map(|n| if n.len() <= MAX_DIGITS { n.parse().ok() } else { None }).collect::<Option<_>>()?;
    Some((words, numbers))
}

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
