//! Which variable of a file is meant.

use super::Variable;
use super::steps::{self, Choice, STEP, grouped};
use crate::shared::component;
use crate::shared::offer::Offer;
use std::collections::HashSet;
use wavesplat_core::base::error::{Note, Remedy};
use wavesplat_core::source::variables::{self, VariableAxis};
use wavesplat_core::source::{self, Advised, Parsed};

/// What a file says of its arrays.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Wanted<'a> {
    /// The name of the array that is meant.
    pub(crate) active: Option<&'a str>,
    /// Whether it has one step of several, which are in files of their own.
    pub(crate) has_one_step: bool,
}

impl Choice<'_> {
    /// Whether a name is that of its array, or the end of its path.
    fn ends_with(&self, name: &str) -> bool {
        let path = self.arrays[0].shown();
        path == name || path.strip_suffix(name).is_some_and(|before| before.ends_with('/'))
    }

    fn is_active(&self, active: Option<&str>) -> bool {
        active == Some(self.arrays[0].name())
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

/// Finds the variable by its path, or by its name or the end of its path if only one variable has that. Also returns
/// the given index, such as that of a component.
pub(crate) fn named<'a>(all: &'a [Variable], given: &str) -> Parsed<(Choice<'a>, Option<usize>)> {
    let (name, index) = component::named(given);
    let found = found(all, given).map(|choice| (choice, None));
    let (choice, index) = match found.or_else(|| Some((self::found(all, name)?, index))) {
        Some(found) => found,
        None => return Err(not_found(all, name)),
    };
    if steps::has_twins(&choice) {
        return Err(format!("{}: two arrays have the same step number", choice.path));
    }
    Ok((choice, index))
}

fn found<'a>(all: &'a [Variable], given: &str) -> Option<Choice<'a>> {
    if given.contains(STEP) {
        return steps::matching(all, given);
    }
    let singles: Vec<_> = all.iter().map(Choice::single).collect();
    let only = |choices: Vec<Choice<'a>>| {
        let mut of_name = choices.into_iter().filter(|choice| choice.ends_with(given));
        of_name.next().filter(|_| of_name.next().is_none())
    };
    let by_path = singles.iter().find(|choice| choice.path == given.trim_start_matches('/')).cloned();
    let of_steps = || grouped(all.iter()).into_iter().filter(|choice| !choice.steps.is_empty()).collect();
    by_path.or_else(|| only(singles)).or_else(|| only(of_steps()))
}

/// An error that lists what there is, and the same path with another number.
fn not_found(all: &[Variable], name: &str) -> String {
    let other = steps::templates(name.trim_start_matches('/')).find(|path| steps::matching(all, path).is_some());
    let other = other.map_or_else(String::new, |path| format!("; {STEP} stands for a number that differs: {path}"));
    format!("has no variable {name}{other}; it has{}", listed(&grouped(all.iter())))
}

/// The one variable that can be an archive, or of several the one that is wanted.
pub(crate) fn only<'a>(all: &'a [Variable], wanted: &Wanted<'_>) -> Advised<Choice<'a>> {
    let mut volumes = volumes(all, wanted);
    if let Some(at) = active(&volumes, wanted) {
        return Ok(volumes.swap_remove(at));
    }
    match volumes.len() {
        1 => Ok(volumes.remove(0)),
        0 => Err(format!("has no array of numbers with three axes; it has{}", listed(&grouped(all.iter()))).into()),
        _ => Err(Note::with(format!("has several variables:{}", listed(&volumes)), Remedy::ChooseVariable)),
    }
}

/// The variables that can be an archive, and whether the user must choose one because [`only`] does not find it.
pub(crate) fn offer(all: &[Variable], wanted: &Wanted<'_>) -> Offer {
    let volumes = volumes(all, wanted);
    let is_undecided = volumes.len() > 1 && active(&volumes, wanted).is_none();
    Offer { variables: volumes.iter().map(Choice::info).collect(), is_undecided }
}

/// The place of the variable that is wanted of several.
fn active(volumes: &[Choice<'_>], wanted: &Wanted<'_>) -> Option<usize> {
    volumes.iter().position(|choice| choice.is_active(wanted.active))
}

/// The variables that can be an archive.
fn volumes<'a>(all: &'a [Variable], wanted: &Wanted<'_>) -> Vec<Choice<'a>> {
    let bounds = bounds(all);
    let least = if all.iter().any(|v| v.lengths.len() > 2) { 3 } else { 2 };
    let of_width = |is_64_bit: bool| {
        let is_so = move |v: &Variable| v.sample.as_ref().is_ok_and(|ty| ty.is_64_bit() == is_64_bit);
        grouped(all.iter().filter(|v| is_so(v) && is_volume(v, least) && !bounds.contains(v.name())))
    };
    let mut volumes = of_width(false);
    if volumes.is_empty() {
        volumes = of_width(true); // numbers of cells, say, where there is nothing else
    }
    if wanted.has_one_step {
        volumes = volumes.into_iter().map(Choice::numbered).collect();
    }
    volumes
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
