//! Variables with an array for each step: the paths of these arrays differ in one number.

use super::Variable;
use std::collections::{BTreeMap, BTreeSet};

/// The placeholder for the step number in the path of a variable that has one array per step.
pub(crate) const STEP: &str = "%T";

/// Words in names of groups that are numbered by time.
const TIMES: [&str; 7] = ["time", "step", "frame", "iter", "cycle", "snap", "dump"];

/// A variable: an array, or one for each step.
#[derive(Debug, Clone)]
pub(crate) struct Choice<'a> {
    /// Its path, with [`STEP`] where arrays differ.
    pub(crate) path: String,
    /// Not empty.
    pub(crate) arrays: Vec<&'a Variable>,
    /// Number of the step of each; none of a single array.
    pub(crate) steps: Vec<u64>,
}

impl<'a> Choice<'a> {
    pub(super) fn single(array: &'a Variable) -> Self {
        Self { path: array.shown().into(), arrays: vec![array], steps: Vec::new() }
    }

    /// A single array as one step, if its path has a number: those in other files differ in the first one.
    pub(super) fn numbered(self) -> Self {
        let part = numbered(&self.path).first().copied().filter(|_| self.steps.is_empty());
        let step = part.and_then(|part| Some((part, number(&self.path, part)?)));
        match step {
            Some((part, step)) => Self { path: template(&self.path, &[part]), steps: vec![step], ..self },
            None => self,
        }
    }

    fn of_steps(path: String, mut arrays: Vec<(u64, &'a Variable)>) -> Self {
        arrays.sort_by_key(|(step, _)| *step);
        let (steps, arrays) = arrays.into_iter().unzip();
        Self { path, arrays, steps }
    }

    /// The group of its steps.
    pub(crate) fn group(&self) -> &str {
        self.path.split(STEP).next().and_then(|before| before.rsplit_once('/')).map_or("", |(group, _)| group)
    }
}

/// Groups arrays into variables: arrays whose paths differ in the number of one group alone are one variable. Where
/// several numbers differ, that of the group named after time counts steps; without one, each array is a variable.
pub(super) fn grouped<'a>(all: impl Iterator<Item = &'a Variable>) -> Vec<Choice<'a>> {
    let (mut alike, mut found): (BTreeMap<String, Vec<_>>, _) = (BTreeMap::new(), Vec::new());
    for array in all {
        let numbered = numbered(array.shown());
        match numbered.is_empty() {
            true => found.push(Choice::single(array)),
            false => alike.entry(template(array.shown(), &numbered)).or_default().push(array),
        }
    }
    for arrays in alike.into_values() {
        match part_of_steps(&arrays) {
            Some(part) => found.extend(series(&arrays, part)),
            None => found.extend(arrays.into_iter().map(Choice::single)),
        }
    }
    found
}

/// The arrays whose paths have a number where `path` has [`STEP`].
pub(super) fn matching<'a>(all: &'a [Variable], path: &str) -> Option<Choice<'a>> {
    let (before, after) = path.trim_start_matches('/').split_once(STEP)?;
    let step = |array: &'a Variable| {
        let number = array.shown().strip_prefix(before)?.strip_suffix(after)?;
        let is_number = number.bytes().all(|c| c.is_ascii_digit());
        Some((number.parse().ok().filter(|_| is_number)?, array))
    };
    let arrays: Vec<_> = all.iter().filter_map(step).collect();
    (!arrays.is_empty()).then(|| Choice::of_steps(path.trim_start_matches('/').into(), arrays))
}

/// A path with [`STEP`] in place of each of its numbers in turn.
pub(super) fn templates(path: &str) -> impl Iterator<Item = String> {
    numbered(path).into_iter().map(move |part| template(path, &[part]))
}

/// Groups along a path that end in a number, the innermost first.
pub(crate) fn numbered_groups(path: &str) -> Vec<&str> {
    let end = |part: usize| path.split('/').take(part + 1).map(|part| part.len() + 1).sum::<usize>() - 1;
    let last = path.split('/').count() - 1;
    numbered(path).into_iter().rev().filter(|part| *part < last).map(|part| &path[..end(part)]).collect()
}

/// The parts of a path that end in a number: groups, and a last part that is a number altogether.
fn numbered(path: &str) -> Vec<usize> {
    let parts: Vec<&str> = path.split('/').collect();
    let is_numbered = |at: &usize| {
        let word = word(parts[*at]).len();
        word < parts[*at].len() && (at + 1 < parts.len() || word == 0)
    };
    (0..parts.len()).filter(is_numbered).collect()
}

/// A part without the number at its end.
fn word(part: &str) -> &str {
    part.trim_end_matches(|c: char| c.is_ascii_digit())
}

/// The path with [`STEP`] in place of the numbers of some parts.
fn template(path: &str, numbered: &[usize]) -> String {
    let named = |(at, part): (usize, &str)| match numbered.contains(&at) {
        true => format!("{}{STEP}", word(part)),
        false => part.into(),
    };
    path.split('/').enumerate().map(named).collect::<Vec<_>>().join("/")
}

/// The number of a part.
fn number(path: &str, part: usize) -> Option<u64> {
    let part = path.split('/').nth(part)?;
    part[word(part).len()..].parse().ok()
}

/// The part whose number counts the steps of arrays whose paths differ in numbers alone.
fn part_of_steps(arrays: &[&Variable]) -> Option<usize> {
    let path = arrays[0].shown();
    let differs = |part: &usize| arrays.iter().any(|array| number(array.shown(), *part) != number(path, *part));
    let differing: Vec<usize> = numbered(path).into_iter().filter(differs).collect();
    let only = |found: Vec<usize>| Some(found).filter(|found| found.len() == 1).map(|found| found[0]);
    let of_word = |is: fn(&str) -> bool| {
        let is_so = |part: &&usize| path.split('/').nth(**part).is_some_and(|part| is(&word(part).to_lowercase()));
        only(differing.iter().filter(is_so).copied().collect())
    };
    only(differing.clone()).or_else(|| of_word(is_of_time)).or_else(|| of_word(str::is_empty))
}

fn is_of_time(word: &str) -> bool {
    let letters = word.trim_matches(|c: char| !c.is_alphabetic());
    letters == "t" || TIMES.iter().any(|time| letters.contains(time))
}

/// Variables of arrays that differ in the number of a part, and perhaps in others.
fn series<'a>(arrays: &[&'a Variable], part: usize) -> Vec<Choice<'a>> {
    let mut found: BTreeMap<String, Vec<_>> = BTreeMap::new();
    for array in arrays {
        match number(array.shown(), part) {
            Some(step) => found.entry(template(array.shown(), &[part])).or_default().push((step, *array)),
            None => found.entry(array.shown().into()).or_default().push((0, *array)), // too long a number
        }
    }
    let choice = |(path, arrays): (String, Vec<(u64, &'a Variable)>)| match arrays[..] {
        [(_, only)] => Choice::single(only),
        _ => Choice::of_steps(path, arrays),
    };
    found.into_iter().map(choice).collect()
}

/// Whether two arrays have the same number, as `step_1` and `step_01` do.
pub(super) fn has_twins(choice: &Choice<'_>) -> bool {
    choice.steps.iter().collect::<BTreeSet<_>>().len() < choice.steps.len()
}

#[cfg(test)]
mod tests {
    use super::super::Attributes;
    use super::*;

    fn arrays(paths: &[&str]) -> Vec<Variable> {
        let array = |path: &&str| Variable {
            path: format!("/{path}"),
            sample: Err("none".into()),
            lengths: vec![1; 3],
            dims: vec![String::new(); 3],
            scales: Vec::new(),
            chunk: None,
            attributes: Attributes::new(),
        };
        paths.iter().map(array).collect()
    }

    fn found(paths: &[&str]) -> Vec<String> {
        let all = arrays(paths);
        let shown = |choice: Choice<'_>| format!("{} {:?}", choice.path, choice.steps);
        grouped(all.iter()).into_iter().map(shown).collect()
    }

    #[test]
    fn the_number_that_differs_counts_steps() {
        assert_eq!(found(&["data/10/fields/E1", "data/9/fields/E1"]), ["data/%T/fields/E1 [9, 10]"]);
        assert_eq!(found(&["Timestep_007/u2", "Timestep_008/u2"]), ["Timestep_%T/u2 [7, 8]"]);
        assert_eq!(found(&["frames/3", "frames/4"]), ["frames/%T [3, 4]"]);
        assert_eq!(found(&["run2/t0/v", "run2/t1/v"]), ["run2/t%T/v [0, 1]"]);
        assert_eq!(found(&["u1", "fields/u1", "data/10/v"]), ["u1 []", "fields/u1 []", "data/10/v []"]);
    }

    #[test]
    fn of_several_numbers_that_of_time_counts_steps() {
        let imaris = |t: usize, level: usize| format!("DataSet/ResolutionLevel {level}/TimePoint {t}/Channel 0/Data");
        let paths = [imaris(0, 0), imaris(1, 0), imaris(0, 1), imaris(1, 1)];
        let expected =
            [0, 1].map(|level| format!("DataSet/ResolutionLevel {level}/TimePoint %T/Channel 0/Data [0, 1]"));
        assert_eq!(found(&paths.each_ref().map(String::as_str)), expected);
        assert_eq!(found(&["t0/s0/c", "t0/s1/c", "t1/s0/c"]), ["t%T/s0/c [0, 1]", "t0/s1/c []"]);
        assert_eq!(found(&["a0/b0/v", "a0/b1/v", "a1/b0/v"]).len(), 3, "nothing says which is time");
    }

    #[test]
    fn users_say_which_number_is_time() {
        let all = arrays(&["a0/b0/v", "a0/b1/v", "a1/b0/v", "a1/b1/v", "a1/bx/v"]);
        let steps = |path: &str| matching(&all, path).map(|choice| choice.steps);
        assert_eq!((steps("a%T/b1/v"), steps("/a1/b%T/v")), (Some(vec![0, 1]), Some(vec![0, 1])));
        assert_eq!((steps("a%T/b7/v"), steps("a1/v")), (None, None));
        assert_eq!(templates("a1/b0/v").collect::<Vec<_>>(), ["a%T/b0/v", "a1/b%T/v"]);
        assert_eq!(numbered_groups("data/0/fields/E/x"), ["data/0"]);
    }
}
