//! Which variable of a file is meant.

use super::{Variable, component};
use crate::source::Parsed;
use std::fmt::Write;

const MOST_LISTED: usize = 20;

/// The variable of a path, or of a name that only one has; and an index, as of a component.
pub(super) fn named<'a>(all: &'a [Variable], given: &str) -> Parsed<(&'a Variable, Option<usize>)> {
    let find = |name: &str| {
        let is = |v: &&Variable| v.path.trim_start_matches('/') == name.trim_start_matches('/');
        let mut of_name = all.iter().filter(|v| v.name() == name);
        all.iter().find(is).or(of_name.next().filter(|_| of_name.next().is_none()))
    };
    let (name, index) = component::named(given);
    if let Some(variable) = find(given) {
        return Ok((variable, None));
    }
    let found = find(name).map(|variable| (variable, index));
    found.ok_or_else(|| format!("has no variable {name}; it has{}", listed(all)))
}

/// The one variable that can be an archive.
pub(super) fn only(all: &[Variable]) -> Parsed<&Variable> {
    let volumes: Vec<_> = all.iter().filter(|v| is_volume(v, all)).collect();
    let most = volumes.iter().map(|v| v.lengths.len()).max().unwrap_or_default();
    match volumes[..] {
        [only] => Ok(only),
        [] => Err(format!("has no array of numbers with three axes or more; it has{}", listed(all))),
        _ if most < 3 => Err(format!("has several arrays of two axes: --variable chooses one of{}", listed(all))),
        _ => {
            let volumes: Vec<_> = volumes.into_iter().cloned().collect();
            Err(format!("has several variables: --variable chooses one of{}", listed(&volumes)))
        }
    }
}

/// Whether frames can be in it: numbers that have a place, and are not places themselves.
fn is_volume(variable: &Variable, all: &[Variable]) -> bool {
    let axes = variable.lengths.len();
    let bounds =
        |v: &Variable| v.text("bounds") == Some(variable.name()) || v.text("climatology") == Some(variable.name());
    let least = if all.iter().any(|v| v.lengths.len() > 2) { 3 } else { 2 };
    variable.sample.is_ok() && axes >= least && !variable.lengths.contains(&0) && !all.iter().any(bounds)
}

/// Variables by name and size, for messages.
fn listed(all: &[Variable]) -> String {
    let mut text = String::new();
    for variable in all.iter().take(MOST_LISTED) {
        let of = |(n, dim): (&usize, &String)| match dim.as_str() {
            "" => n.to_string(),
            dim => format!("{dim} {n}"),
        };
        let axes: Vec<_> = variable.lengths.iter().zip(&variable.dims).map(of).collect();
        let _ = write!(text, "\n  {} ({})", variable.path.trim_start_matches('/'), axes.join(", "));
        if let Some(unit) = variable.text("units") {
            let _ = write!(text, " in {unit}");
        }
    }
    match all.len() {
        0 => " none".into(),
        n if n > MOST_LISTED => text + &format!("\n  and {} more", n - MOST_LISTED),
        _ => text,
    }
}
