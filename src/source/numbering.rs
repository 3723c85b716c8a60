//! Missing frames, seen from the numbers in file names.

use crate::error::{Error, Result};
use std::collections::HashMap;
use std::path::{Path, PathBuf};

const MAX_DIGITS: usize = 18; // longer numbers are left alone
const MARK: char = '\0'; // in no path

/// An error if at least three names differ in one number alone and its steps are not all the same.
pub(super) fn check(paths: &[PathBuf]) -> Result<()> {
    let Some(numbers) = the_number(paths) else { return Ok(()) };
    let steps: Vec<i64> = numbers.windows(2).map(|n| n[1] - n[0]).collect();
    let usual = usual_step(&steps);
    match steps.iter().position(|s| *s != usual) {
        Some(at) => Err(irregular(&paths[at], &paths[at + 1], steps[at], usual)),
        None => Ok(()),
    }
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
    Error::input(after, format!("{a} is followed by {b}: {why}; --allow-gaps takes the files as they are"))
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
