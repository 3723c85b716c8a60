//! Which of the numbers in names counts frames.

use super::names::{Column, Reading, Style};
use super::{dates, name};
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use wavesplat_core::base::error::{Error, Result};

/// What the numbers in names say.
pub(super) enum Found {
    /// No order.
    Nothing,
    /// One number of each name counts frames.
    One {
        numbers: Column,
        /// Whether names differ in nothing else, so that each step matters.
        is_alone: bool,
    },
    /// Names count two or more things.
    Several(Several),
    /// Two orders are as likely; these files are first in one and the other.
    Unclear { at: [usize; 2] },
}

/// The numbers of names that count several things.
#[derive(Debug)]
pub(super) struct Several {
    reading: Reading,
    columns: Vec<Column>,
    /// Whether there is a name for every combination.
    is_complete: bool,
}

/// Files that hold planes: as many for each frame, one after another.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Planes(pub(crate) usize);

/// Sorts the files of a folder or a pattern by the numbers in their names.
///
/// # Errors
/// Numbers that count several things, unless these are frames and their planes; numbers that can be read in two ways.
pub(crate) fn sort(paths: &mut Vec<PathBuf>) -> Result<Option<Planes>> {
    alphanumeric_sort::sort_path_slice(paths);
    let (order, planes) = match found(paths) {
        Found::Nothing => return Ok(None),
        Found::One { numbers, .. } => (numbers.order(), None),
        Found::Several(several) => match several.planes() {
            Some((order, planes)) => (order, Some(planes)),
            None => return Err(several.refused(paths)),
        },
        Found::Unclear { at } => return Err(unclear(at.map(|at| paths[at].as_path()))),
    };
    *paths = order.into_iter().map(|at| paths[at].clone()).collect();
    Ok(planes)
}

/// The order of names by the numbers in them, for a series that has one number.
///
/// # Errors
/// Numbers that can be read in two ways.
pub(crate) fn order(names: &[PathBuf]) -> Result<Vec<usize>> {
    match found(names) {
        Found::One { numbers, .. } => Ok(numbers.order()),
        Found::Several(several) => Err(several.refused(names)),
        Found::Unclear { at } => Err(unclear(at.map(|at| names[at].as_path()))),
        Found::Nothing => {
            let mut order: Vec<usize> = (0..names.len()).collect();
            order.sort_by(|a, b| alphanumeric_sort::compare_path(&names[*a], &names[*b]));
            Ok(order)
        }
    }
}

fn unclear([a, b]: [&Path; 2]) -> Error {
    let text = format!("{} or {} may come first: the numbers in their names can be read in two ways", name(a), name(b));
    Error::input(a, format!("{text}; list the files in their order"))
}

/// Finds the number that counts frames: of decimals and of integers the one that is regular.
pub(super) fn found(paths: &[PathBuf]) -> Found {
    if paths.len() < 2 {
        return Found::Nothing;
    }
    let decimals = [Style::Decimals, Style::Signed].into_iter().find_map(|style| Reading::of(paths, style));
    let [decimals, integers] = [decimals, Reading::of(paths, Style::Integers)].map(|reading| reading.map(in_reading));
    match (decimals, integers) {
        (None, None) => Found::Nothing,
        (Some(only), None) | (None, Some(only)) => only,
        (Some(decimals), Some(integers)) => of_both(decimals, integers),
    }
}

fn of_both(decimals: Found, integers: Found) -> Found {
    match (&decimals, &integers) {
        (Found::One { numbers: a, .. }, Found::One { numbers: b, .. }) => {
            let is_likely = |column: &Column| column.is_unique() && column.is_regular();
            match (is_likely(a), is_likely(b), a.order() == b.order()) {
                (_, _, true) => decimals,
                (true, false, _) => decimals,
                (false, true, _) => integers,
                _ if !a.is_unique() => integers,
                (_, _, false) => differing(&a.order(), &b.order()),
            }
        }
        (Found::One { numbers, .. }, Found::Several(several)) => {
            let is_likely = numbers.is_unique() && (numbers.is_regular() || !several.is_complete);
            if is_likely { decimals } else { integers }
        }
        (Found::Several(_), Found::One { .. }) => integers,
        _ => decimals,
    }
}

fn differing(a: &[usize], b: &[usize]) -> Found {
    let at = a.iter().zip(b).find(|(a, b)| a != b);
    at.map_or(Found::Nothing, |(a, b)| Found::Unclear { at: [*a, *b] })
}

fn in_reading(reading: Reading) -> Found {
    let mut columns = reading.columns();
    match columns.len() {
        0 => return Found::Nothing,
        1 => return Found::One { numbers: columns.remove(0), is_alone: true },
        _ => {}
    }
    let are_a_date = dates::of(&reading).is_some_and(|date| reading.varying.iter().all(|at| date.contains(at)));
    if are_a_date {
        return Found::One { numbers: ranks(&columns), is_alone: false };
    }
    match counting(&columns) {
        Some(at) => Found::One { numbers: columns.swap_remove(at), is_alone: false },
        None => {
            let all = columns.iter().try_fold(1_usize, |all, column| all.checked_mul(distinct(column).len()));
            let is_complete = all == Some(reading.names.len()) && ranks(&columns).is_unique();
            Found::Several(Several { reading, columns, is_complete })
        }
    }
}

/// The column that counts frames: all others go along with it, or it is the only regular one.
fn counting(columns: &[Column]) -> Option<usize> {
    let unique: Vec<usize> = (0..columns.len()).filter(|at| columns[*at].is_unique()).collect();
    let first = *unique.first()?;
    let order = columns[first].order();
    let goes_along = |column: &Column| order.is_sorted_by_key(|at| column.values[*at]);
    if columns.iter().all(goes_along) {
        return Some(first);
    }
    let mut regular = unique.into_iter().filter(|at| columns[*at].is_regular());
    let only = regular.next()?;
    (only == 0 || regular.next().is_none()).then_some(only)
}

/// The place of each name among all, by the first number, then by the next.
fn ranks(columns: &[Column]) -> Column {
    let row = |at: usize| columns.iter().map(|column| column.values[at]).collect::<Vec<_>>();
    let rows: Vec<Vec<i128>> = (0..columns[0].values.len()).map(row).collect();
    let all: BTreeSet<&Vec<i128>> = rows.iter().collect();
    let sorted: Vec<&Vec<i128>> = all.into_iter().collect();
    let rank = |row: &Vec<i128>| sorted.binary_search(&row).map_or(0, |at| at as i128);
    Column { values: rows.iter().map(rank).collect(), unit: 0 }
}

fn distinct(column: &Column) -> BTreeSet<i128> {
    column.values.iter().copied().collect()
}

/// What programs call planes.
const PLANES: [&str; 10] = ["z", "slice", "slices", "plane", "planes", "layer", "level", "depth", "sl", "iz"];

/// What programs call frames.
const FRAMES: [&str; 12] =
    ["t", "time", "tp", "timepoint", "frame", "f", "step", "timestep", "volume", "vol", "iter", "it"];

impl Several {
    /// The column that counts planes, if the other one may count frames.
    fn along_z(&self) -> Option<usize> {
        let labels: Vec<String> = self.reading.varying.iter().map(|at| self.reading.label(*at)).collect();
        let is_plane = |at: usize| PLANES.contains(&labels[at].as_str());
        let is_frame = |at: usize| labels[at].is_empty() || FRAMES.contains(&labels[at].as_str());
        match labels.len() {
            2 if is_plane(1) && is_frame(0) => Some(1),
            2 if is_plane(0) && is_frame(1) => Some(0),
            _ => None,
        }
    }

    /// The order of the files by frame, then by plane.
    fn planes(&self) -> Option<(Vec<usize>, Planes)> {
        let z = self.along_z().filter(|_| self.is_complete)?;
        let columns = [self.columns[1 - z].clone(), self.columns[z].clone()];
        Some((ranks(&columns).order(), Planes(distinct(&columns[1]).len())))
    }

    /// The error that the names count several things.
    pub(super) fn refused(&self, paths: &[PathBuf]) -> Error {
        let count = |(at, column): (&usize, &Column)| {
            let label = self.reading.label(*at);
            let after = if label.is_empty() { String::new() } else { format!(" after {label:?}") };
            format!("{} numbers{after}", distinct(column).len())
        };
        let counts: Vec<String> = self.reading.varying.iter().zip(&self.columns).map(count).collect();
        let what = format!("names count several things: {}", counts.join(", "));
        let pattern = self.pattern(&paths[0]);
        let how = match self.planes() {
            Some(_) => "name the folder, or quote the pattern, to stack planes".into(),
            None => format!("a pattern in quotes such as '{pattern}' chooses one series of frames"),
        };
        Error::input(&paths[0], format!("{what}; {how}"))
    }

    /// The first name with a star for the number that counts frames.
    fn pattern(&self, first: &Path) -> String {
        let labels = self.reading.varying.iter().map(|at| self.reading.label(*at));
        let labels: Vec<String> = labels.collect();
        let of_frames = labels.iter().position(|label| FRAMES.contains(&label.as_str()));
        let number = &self.reading.names[0].numbers[self.reading.varying[of_frames.unwrap_or(0)]];
        let text = first.to_string_lossy();
        let part = |range: std::ops::Range<usize>| text.get(range).unwrap_or_default().to_string();
        format!("{}*{}", part(0..number.start), part(number.end..text.len()))
    }
}
