//! Times that are stored beside frames: arrays that no convention ties to an axis, by the names that programs give them.

use super::{FileArrays, Variable, coordinates};
use wavesplat_core::base::error::Note;

/// Names of arrays of times, in lower case.
const NAMES: [&str; 4] = ["time", "times", "t", "timesteps"];

/// The arrays of steps that times are looked for.
pub(crate) struct StepArrays<'a> {
    /// The group of the samples, without slashes at its ends.
    pub(crate) group: &'a str,
    /// The name of their axis; empty if it has none.
    pub(crate) axis: &'a str,
    /// The number of steps.
    pub(crate) count: usize,
}

impl<'a> StepArrays<'a> {
    /// Those along an axis of an array.
    pub(crate) fn along(variable: &'a Variable, axis: usize) -> Self {
        Self { group: group(variable), axis: &variable.dims[axis], count: variable.lengths[axis] }
    }

    /// The one array of times in the group of the samples or in the root; none if there is none.
    ///
    /// # Errors
    /// A note on several arrays with different times.
    pub(crate) fn times(&self, arrays: FileArrays<'a>) -> Result<Option<&'a Variable>, Note> {
        let read = |array: &'a Variable| Some((array, coordinates(arrays.file, array).ok()?));
        let found: Vec<_> = arrays.all.iter().filter(|array| self.may_be(array)).filter_map(read).collect();
        let Some((first, times)) = found.first() else { return Ok(None) };
        match found.iter().find(|(_, others)| others != times) {
            Some((other, _)) => {
                let (first, other) = (first.shown(), other.shown());
                Err(format!("{first} and {other} give different times: frames are numbered").into())
            }
            None => Ok(Some(first)),
        }
    }

    /// Whether an array may have their times, by its name, place and size.
    fn may_be(&self, array: &Variable) -> bool {
        let is_number = !matches!(&array.sample, Err(kind) if !kind.starts_with("integer"));
        let is_near = [self.group, ""].contains(&group(array));
        let is_along = array.dims.iter().all(|axis| axis.is_empty() || self.axis.is_empty() || axis == self.axis);
        let is_named = NAMES.contains(&array.name().to_lowercase().as_str());
        is_named && is_near && is_number && is_along && array.lengths == [self.count]
    }
}

/// The group that an array is in.
fn group(array: &Variable) -> &str {
    array.shown().rsplit_once('/').map_or("", |(group, _)| group)
}
