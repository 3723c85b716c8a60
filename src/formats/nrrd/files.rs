//! The names of the data files of a NRRD.

use crate::shared::pattern;
use wavesplat_core::source::Parsed;

/// What `data file` says.
pub(super) enum DataFiles {
    One(String),
    Pattern { pattern: String, first: i64, last: i64, step: i64, axes: Option<usize> },
    List { names: Vec<String>, axes: Option<usize> },
}

impl DataFiles {
    pub(super) fn parse(text: &str, list: &[String]) -> Parsed<Self> {
        let words: Vec<&str> = text.split_whitespace().collect();
        let axes = |word: Option<&&str>| {
            word.map(|w| w.parse().map_err(|_| format!("{w:?} is no number of axes"))).transpose()
        };
        if words.first() == Some(&"LIST") {
            return Ok(Self::List { names: list.to_vec(), axes: axes(words.get(1))? });
        }
        let numbers: Vec<i64> = words.iter().skip(1).map_while(|w| w.parse().ok()).collect();
        match (words[..].first(), &numbers[..]) {
            (Some(pattern), [first, last, step, ..]) if pattern.contains('%') && numbers.len() + 1 == words.len() => {
                let (pattern, axes) = ((*pattern).into(), axes(words.get(4))?);
                Ok(Self::Pattern { pattern, first: *first, last: *last, step: *step, axes })
            }
            _ => Ok(Self::One(text.into())),
        }
    }

    /// The number of axes that each file holds, if the header states it.
    pub(super) fn axes(&self) -> Option<usize> {
        match self {
            Self::One(_) => None,
            Self::Pattern { axes, .. } | Self::List { axes, .. } => *axes,
        }
    }

    /// How many there are.
    pub(super) fn count(&self) -> Parsed<usize> {
        match self {
            Self::One(_) => Ok(1),
            Self::Pattern { first, last, step, .. } => pattern::count(*first, *last, *step),
            Self::List { names, .. } => Ok(names.len()),
        }
    }

    /// Their names, in order.
    pub(super) fn names(self) -> Parsed<Box<dyn Iterator<Item = String>>> {
        let count = self.count()?;
        Ok(match self {
            Self::List { names, .. } => Box::new(names.into_iter()),
            Self::One(name) => Box::new(std::iter::once(name)),
            Self::Pattern { pattern, first, step, .. } => Box::new(pattern::names(&pattern, first, count, step)?),
        })
    }
}
