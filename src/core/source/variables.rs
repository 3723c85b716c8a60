//! The variables of a file, from which the user must choose one.

use crate::base::stored::StoredType;
use serde::Serialize;
use std::fmt::{self, Display, Write};

/// Variables that a message lists.
const MOST_LISTED: usize = 20;

/// A variable of a file.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct VariableInfo {
    /// Its name, as [`super::OpenOptions::variable`] takes it.
    pub name: String,
    /// The type of its samples; also one that is not supported.
    pub sample: String,
    /// Its axes, the slowest first.
    pub axes: Vec<VariableAxis>,
    /// Numbers of a sample; of several, one is meant by `name[0]` and so on.
    pub components: usize,
    /// Arrays that follow one another in time.
    pub steps: usize,
    /// The unit of its samples, if the file states it.
    pub unit: Option<String>,
}

/// An axis of a variable.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct VariableAxis {
    /// Its name, empty if it has none.
    pub name: String,
    /// Samples along it.
    pub length: usize,
}

impl VariableInfo {
    /// Whether its type is one that samples can have.
    pub fn has_samples(&self) -> bool {
        StoredType::all().any(|ty| ty.name() == self.sample)
    }

    /// One array of a volume with `dims` voxels along x, y, z.
    pub fn volume(name: &str, sample: &str, dims: [usize; 3], components: usize) -> Self {
        let axis = |(name, length): (&str, usize)| VariableAxis { name: name.into(), length };
        let axes = ["z", "y", "x"].into_iter().zip([dims[2], dims[1], dims[0]]).map(axis).collect();
        Self { name: name.into(), sample: sample.into(), axes, components, steps: 1, unit: None }
    }
}

impl Display for VariableAxis {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let space = if self.name.is_empty() { "" } else { " " };
        write!(f, "{}{space}{}", self.name, self.length)
    }
}

impl Display for VariableInfo {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let axes: Vec<String> = self.axes.iter().map(ToString::to_string).collect();
        write!(f, "{}: {}", self.name, self.sample)?;
        if !axes.is_empty() {
            write!(f, " ({})", axes.join(", "))?;
        }
        if self.components > 1 {
            let (name, last) = (&self.name, self.components - 1);
            write!(f, ", {} components {name}[0] to {name}[{last}]", self.components)?;
        }
        if self.steps > 1 {
            write!(f, ", {} steps", self.steps)?;
        }
        self.unit.as_ref().map_or(Ok(()), |unit| write!(f, " in {unit}"))
    }
}

/// Variables for a message, each on a line of its own.
pub fn listed(all: &[VariableInfo]) -> String {
    let mut text = String::new();
    for variable in all.iter().take(MOST_LISTED) {
        let _ = write!(text, "\n  {variable}");
    }
    match all.len() {
        0 => " none".into(),
        n if n > MOST_LISTED => text + &format!("\n  and {} more", n - MOST_LISTED),
        _ => text,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_list_says_name_type_size_and_unit_and_how_many_more() {
        let vector = VariableInfo { unit: Some("m s-1".into()), ..VariableInfo::volume("v", "f32", [4, 3, 2], 3) };
        assert_eq!(vector.to_string(), "v: f32 (z 2, y 3, x 4), 3 components v[0] to v[2] in m s-1");
        let unnamed = vec![VariableAxis { name: String::new(), length: 7 }];
        let steps = VariableInfo { axes: unnamed, steps: 5, ..VariableInfo::volume("p", "i64", [1; 3], 1) };
        assert_eq!(steps.to_string(), "p: i64 (7), 5 steps");
        let alone = VariableInfo { axes: Vec::new(), ..VariableInfo::volume("v", "a virtual dataset", [1; 3], 1) };
        assert_eq!(alone.to_string(), "v: a virtual dataset");
        assert_eq!(listed(&[]), " none");
        assert!(listed(&vec![steps; 25]).ends_with("\n  and 5 more"));
    }
}
