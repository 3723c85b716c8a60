//! The arrays of an HDF5 file, and the names in it that lead elsewhere.

use super::attributes::described_all;
use super::links::{elsewhere, is_absent, links};
use super::numbers::stored_type;
use super::scales::Scales;
use crate::arrays::hdf5_storage::{check_lengths, reason};
use crate::arrays::{Variable, attributes};
use hdf5_reader::group::Group;
use hdf5_reader::messages::link::LinkMessage;
use hdf5_reader::{Dataset, Hdf5File};
use std::collections::HashSet;
use wavesplat_core::source::Parsed;

/// Groups within groups that are looked at, and all objects.
const MOST_DEPTH: usize = 16;
const MOST_OBJECTS: usize = 100_000;

/// What is in a file.
#[derive(Default)]
pub(super) struct Listed {
    pub(super) variables: Vec<Variable>,
    /// Names that lead to something that is not read, and what that is.
    pub(super) elsewhere: Vec<String>,
}

impl Listed {
    pub(super) fn read(file: &Hdf5File) -> Parsed<Self> {
        let mut listing = Listing::default();
        listing.add(&file.root_group().map_err(|e| reason(&e))?, "", 0)?;
        let Listing { mut listed, scales, .. } = listing;
        scales.tie(&mut listed.variables);
        Ok(listed)
    }
}

#[derive(Default)]
struct Listing {
    listed: Listed,
    scales: Scales,
    /// Addresses of groups that were looked at: links may lead in circles.
    seen: HashSet<u64>,
}

impl Listing {
    fn add(&mut self, group: &Group, path: &str, depth: usize) -> Parsed<()> {
        if depth > MOST_DEPTH || !self.seen.insert(group.address()) {
            return Ok(());
        }
        let refused = |e| format!("group {path}/: {}", reason(&e));
        let mut groups = Vec::new();
        for link in links(group).map_err(refused)? {
            if self.seen.len() + self.listed.variables.len() > MOST_OBJECTS {
                return Err(format!("has more than {MOST_OBJECTS} objects"));
            }
            match group.group(&link.name) {
                Ok(group) => groups.push((group, link.name)),
                Err(_) => self.add_array(group, &link, path)?,
            }
        }
        groups.iter().try_for_each(|(group, name)| self.add(group, &format!("{path}/{name}"), depth + 1))
    }

    /// Adds what a name leads to that is no group.
    fn add_array(&mut self, group: &Group, link: &LinkMessage, path: &str) -> Parsed<()> {
        let path = format!("{path}/{}", link.name);
        let error = match group.dataset(&link.name) {
            Ok(array) => {
                check_lengths(&array).map_err(|e| format!("{path}: {e}"))?;
                self.scales.add(&array, group.offset_size());
                self.listed.variables.push(variable(&array, path));
                return Ok(());
            }
            Err(error) => error,
        };
        match elsewhere(link, &error) {
            Some(what) => {
                self.listed.elsewhere.push(format!("{} is not read: it is {what}", path.trim_start_matches('/')));
                self.scales.skip();
                self.listed.variables.push(Variable::elsewhere(path, what));
                Ok(())
            }
            None if is_absent(&error) => Ok(()), // a named type
            None => Err(format!("{path}: {}", reason(&error))),
        }
    }
}

fn variable(dataset: &Dataset, path: String) -> Variable {
    let lengths: Vec<usize> = dataset.shape().iter().map(|n| usize::try_from(*n).unwrap_or(usize::MAX)).collect();
    let sample = stored_type(dataset.dtype());
    let chunk = dataset.chunks().filter(|c| c.len() == lengths.len());
    let chunk = chunk.map(|c| c.into_iter().map(|n| n as usize).collect());
    let scales = vec![String::new(); lengths.len()];
    let mut dims = vec![String::new(); lengths.len()];
    if let Ok(labels) = dataset.attribute("DIMENSION_LABELS").and_then(|labels| labels.read_strings()) {
        dims.iter_mut().zip(labels).for_each(|(dim, label)| *dim = label);
    }
    let attributes = attributes(&described_all(&dataset.attributes()));
    Variable { path, sample, lengths, dims, scales, chunk, attributes }
}
