//! Which variable of a file is meant.

use super::Variable;
use crate::shared::component;
use std::collections::{BTreeMap, HashSet};
use wavesplat_core::base::error::{Note, Remedy};
use wavesplat_core::source::variables::{self, VariableAxis};
use wavesplat_core::source::{self, Advised, Parsed};

/// The placeholder for the step number in the path of a variable that has one array per step.
pub(crate) const STEP: &str = "%T";

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
    fn single(array: &'a Variable) -> Self {
        Self { path: array.shown().into(), arrays: vec![array], steps: Vec::new() }
    }

    fn name(&self) -> &str {
        self.arrays[0].name()
    }

    /// The group of its steps.
    pub(crate) fn group(&self) -> &str {
        self.path.split(STEP).next().and_then(|before| before.rsplit_once('/')).map_or("", |(group, _)| group)
    }

    /// Name, size, type and unit for users.
    fn info(&self) -> source::VariableInfo {
        let first = self.arrays[0];
        let axis = |(length, name): (&usize, &String)| VariableAxis { name: name.clone(), length: *length };
        source::VariableInfo {
            name: self.path.clone(),
            sample: first.sample.as_ref().map_or_else(Clone::clone, ToString::to_string),
            axes: first.lengths.iter().zip(&first.dims).map(axis).collect(),
            components: 1,
            steps: self.arrays.len(),
            unit: first.text("units").map(String::from),
        }
    }
}

/// Finds the variable by its path, or by its name if only one variable has that name. Also returns the given index,
/// such as that of a component.
pub(crate) fn named<'a>(all: &'a [Variable], given: &str) -> Parsed<(Choice<'a>, Option<usize>)> {
    let stepped = choices(all.iter());
    let singles: Vec<_> = all.iter().map(Choice::single).collect();
    let choices = if given.contains(STEP) { &stepped } else { &singles };
    let find = |name: &str| {
        let mut of_name = choices.iter().filter(|c| c.name() == name);
        let by_path = choices.iter().find(|c| c.path == name.trim_start_matches('/'));
        by_path.or(of_name.next().filter(|_| of_name.next().is_none())).cloned()
    };
    let (name, index) = component::named(given);
    let of_steps = |name: &str| {
        let mut of_name = stepped.iter().filter(|c| c.name() == name && !c.steps.is_empty());
        of_name.next().filter(|_| of_name.next().is_none()).cloned()
    };
    let found = find(given).or_else(|| of_steps(given)).map(|choice| (choice, None));
    let found = found.or_else(|| Some((find(name).or_else(|| of_steps(name))?, index)));
    found.ok_or_else(|| format!("has no variable {name}; it has{}", listed(&stepped)))
}

/// The one variable that can be an archive, or of several the one that is `active`.
pub(crate) fn only<'a>(all: &'a [Variable], active: Option<&str>) -> Advised<Choice<'a>> {
    let mut volumes = volumes(all, active);
    match volumes.len() {
        1 => Ok(volumes.remove(0)),
        0 => Err(format!("has no array of numbers with three axes; it has{}", listed(&choices(all.iter()))).into()),
        _ => Err(Note::with(format!("has several variables:{}", listed(&volumes)), Remedy::ChooseVariable)),
    }
}

/// The variables among which the user must choose; none if [`only`] finds the one.
pub(crate) fn undecided(all: &[Variable], active: Option<&str>) -> Vec<source::VariableInfo> {
    let volumes = volumes(all, active);
    if volumes.len() > 1 { volumes.iter().map(Choice::info).collect() } else { Vec::new() }
}

/// The variables that can be an archive, or of several the one that is `active`.
fn volumes<'a>(all: &'a [Variable], active: Option<&str>) -> Vec<Choice<'a>> {
    let bounds = bounds(all);
    let least = if all.iter().any(|v| v.lengths.len() > 2) { 3 } else { 2 };
    let of_width = |is_64_bit: bool| {
        let is_so = move |v: &Variable| v.sample.as_ref().is_ok_and(|ty| ty.is_64_bit() == is_64_bit);
        choices(all.iter().filter(|v| is_so(v) && is_volume(v, least) && !bounds.contains(v.name())))
    };
    let mut volumes = of_width(false);
    if volumes.is_empty() {
        volumes = of_width(true); // numbers of cells, say, where there is nothing else
    }
    match volumes.iter().position(|c| active == Some(c.name())) {
        Some(at) => vec![volumes.swap_remove(at)],
        None => volumes,
    }
}

/// Groups arrays into variables: arrays whose paths differ only in the number of one group are one variable.
fn choices<'a>(all: impl Iterator<Item = &'a Variable>) -> Vec<Choice<'a>> {
    let (mut steps, mut found): (BTreeMap<_, Vec<_>>, _) = (BTreeMap::new(), Vec::new());
    for array in all {
        match templated(&array.path) {
            Some((path, step)) => steps.entry(path).or_default().push((step, array)),
            None => found.push(Choice::single(array)),
        }
    }
    for (path, mut arrays) in steps {
        arrays.sort_by_key(|(step, _)| *step);
        match &arrays[..] {
            [(_, only)] => found.push(Choice::single(only)),
            _ => {
                let (steps, arrays) = arrays.into_iter().unzip();
                found.push(Choice { path, arrays, steps });
            }
        }
    }
    found
}

/// A path with [`STEP`] for the number at the end of its first group that has one, or of all of its last part.
fn templated(path: &str) -> Option<(String, u64)> {
    let path = path.trim_start_matches('/');
    let parts: Vec<&str> = path.split('/').collect();
    let stem = |part: &str| part.trim_end_matches(|c: char| c.is_ascii_digit()).len();
    let (at, stem) = parts
        .iter()
        .map(|part| stem(part))
        .enumerate()
        .find(|(i, stem)| *stem < parts[*i].len() && (*i + 1 < parts.len() || *stem == 0))?;
    let step = parts[at][stem..].parse().ok()?;
    let part = format!("{}{STEP}", &parts[at][..stem]);
    let named = parts.iter().enumerate().map(|(i, part_of)| if i == at { part.as_str() } else { part_of });
    Some((named.collect::<Vec<_>>().join("/"), step))
}

/// Names of variables that other variables name as their coordinates.
fn bounds(all: &[Variable]) -> HashSet<&str> {
    let says = ["bounds", "climatology", "coordinates"];
    let texts = all.iter().flat_map(|v| says.into_iter().filter_map(|what| v.text(what)));
    texts.flat_map(str::split_whitespace).collect()
}

/// Whether an array can hold frames: it has a supported number type, at least `least` axes, and no empty axis.
fn is_volume(variable: &Variable, least: usize) -> bool {
    variable.sample.is_ok() && variable.lengths.len() >= least && !variable.lengths.contains(&0)
}

fn listed(all: &[Choice<'_>]) -> String {
    variables::listed(&all.iter().map(Choice::info).collect::<Vec<_>>())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_of_groups_are_steps() {
        let found = |path: &str| templated(path).map(|(path, step)| format!("{path} {step}"));
        assert_eq!(found("/data/10/fields/E1").as_deref(), Some("data/%T/fields/E1 10"));
        assert_eq!(found("Timestep_007/u2").as_deref(), Some("Timestep_%T/u2 7"));
        assert_eq!(found("frames/3").as_deref(), Some("frames/%T 3"));
        assert_eq!((found("u1"), found("fields/u1"), found("")), (None, None, None));
    }
}
