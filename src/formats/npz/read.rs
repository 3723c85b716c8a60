//! Reads NumPy's `.npz`.

use super::directory::{self, Member};
use crate::npy::{self, Array};
use crate::numbering;
use crate::shared::deflated::{FileReader, Stream};
use crate::shared::offer::Offer;
use std::collections::BTreeMap;
use std::io::{BufReader, Read};
use std::path::{Path, PathBuf};
use wavesplat_core::base::error::{Error, Note, Remedy, Result};
use wavesplat_core::base::mapped::{Access, FileBytes};
use wavesplat_core::source::file_header::FileHeader;
use wavesplat_core::source::parts::{DataLocation, Part, Stored};
use wavesplat_core::source::{Advised, OpenOptions, VariableInfo, variables};

/// The placeholder for the number in the names of arrays that are frames.
const STEP: &str = "%T";

/// Reads the directory and the headers of all arrays, and checks the sizes of the chosen ones.
pub(super) fn describe(path: &Path, options: &OpenOptions) -> Result<FileHeader> {
    let file = FileBytes::open(path, Access::Read)?;
    let variables = all(&file, options)?;
    let chosen = choose(variables, options.variable.as_deref()).map_err(|e| Error::input(path, e))?;
    if !options.allow_gaps {
        numbering::check_steps(path, &chosen.name, "array", &chosen.steps)?;
    }
    let parts = chosen.arrays.iter().map(|found| found.part(&file)).collect::<Result<_>>()?;
    let count = chosen.arrays.len();
    let notes = match count {
        1 => chosen.arrays[0].array.guess(options).into_iter().collect(),
        _ => vec![format!("frames are the {count} arrays {}", chosen.name).into()],
    };
    let variable = Some(chosen.short_name().to_string()).filter(|name| !name.is_empty());
    Ok(FileHeader { variable, notes, ..FileHeader::plain(chosen.arrays[0].array.shape, parts) })
}

/// The arrays of a file.
pub(super) fn offer(path: &Path) -> Result<Offer> {
    let all = all(&FileBytes::open(path, Access::Read)?, &OpenOptions::default())?;
    Ok(Offer { variables: all.iter().map(Variable::info).collect(), is_undecided: all.len() > 1 })
}

/// An array of the archive.
#[derive(Debug, Clone)]
struct Found {
    /// Its name, without its extension.
    name: String,
    member: Member,
    array: Array,
}

/// One array, or several that are frames one after another.
#[derive(Debug)]
struct Variable {
    /// With [`STEP`] for the number in which the names of several differ.
    name: String,
    /// Not empty; ascending by their numbers.
    arrays: Vec<Found>,
    /// These numbers.
    steps: Vec<String>,
}

impl Variable {
    /// The name without the number and the separator before it.
    fn short_name(&self) -> &str {
        self.name.strip_suffix(STEP).map_or(self.name.as_str(), |name| name.trim_end_matches(['_', '-', '.', ' ']))
    }

    fn info(&self) -> VariableInfo {
        let Array { shape, ty, .. } = self.arrays[0].array;
        let steps = self.arrays.iter().map(|found| found.array.frames).sum();
        VariableInfo { steps, ..VariableInfo::volume(&self.name, ty.name(), shape.dims(), 1) }
    }
}

/// The variables of an archive: every array of numbers with three or four axes is in one.
fn all(file: &FileBytes, options: &OpenOptions) -> Result<Vec<Variable>> {
    let options = &OpenOptions { variable: None, ..options.clone() };
    let mut others = Vec::new();
    let mut found = Vec::new();
    for member in directory::members(file)? {
        let Some(name) = member.name.strip_suffix(".npy").map(String::from) else { continue };
        match header(file, &member, options) {
            Ok(array) => found.push(Found { name, member, array }),
            Err(e) => others.push(e),
        }
    }
    match others.pop() {
        Some(why) if found.is_empty() => Err(why),
        None if found.is_empty() => Err(Error::input(file.path(), "has no array: none of its files is an .npy")),
        _ => grouped(file.path(), found),
    }
}

/// The header of an array. In messages it is called as if the archive were a folder.
fn header(file: &FileBytes, member: &Member, options: &OpenOptions) -> Result<Array> {
    let name = file.path().join(&member.name);
    let bytes = FileReader::new(FileBytes::open(file.path(), Access::Read)?, member.start).take(member.stored);
    let array = match member.compression {
        Some(compression) => npy::read_any(&mut compression.reader(bytes), &name, options)?,
        None => npy::read_any(&mut BufReader::with_capacity(256, bytes), &name, options)?,
    };
    let size = array.layout.bytes(array.ty.size()).ok().and_then(|n| array.start.checked_add(n as u64));
    match size {
        Some(size) if size == member.size => Ok(array),
        _ => Err(Error::input(name, format!("has {} bytes, but its header says otherwise", member.size))),
    }
}

/// Groups arrays into variables: arrays whose names differ only in the number at the end are one variable, if they have
/// the same shape and type.
fn grouped(path: &Path, found: Vec<Found>) -> Result<Vec<Variable>> {
    let (mut numbered, mut variables): (BTreeMap<String, Vec<Found>>, _) = (BTreeMap::new(), Vec::new());
    let single = |found: Found| Variable { name: found.name.clone(), arrays: vec![found], steps: Vec::new() };
    for found in found {
        match numbered_name(&found.name) {
            Some((stem, _)) => numbered.entry(stem.into()).or_default().push(found),
            None => variables.push(single(found)),
        }
    }
    for (stem, group) in numbered {
        let Array { shape, ty, .. } = group[0].array;
        let is_one = group.iter().all(|found| (found.array.shape, found.array.ty) == (shape, ty));
        if group.len() == 1 || !is_one {
            variables.extend(group.into_iter().map(single));
            continue;
        }
        let names: Vec<PathBuf> = group.iter().map(|found| PathBuf::from(&found.name)).collect();
        let order = numbering::order(&names).map_err(|e| Error::input(path, e.to_string()))?;
        let arrays: Vec<Found> = order.into_iter().map(|at| group[at].clone()).collect();
        let step = |found: &Found| numbered_name(&found.name).map_or_else(String::new, |(_, step)| step.into());
        variables.push(Variable { name: format!("{stem}{STEP}"), steps: arrays.iter().map(step).collect(), arrays });
    }
    Ok(variables)
}

/// A name before the number at its end, and this: perhaps with a sign, a fraction and an exponent.
fn numbered_name(name: &str) -> Option<(&str, &str)> {
    let bytes = name.as_bytes();
    let is_digit = |at: usize| bytes.get(at).is_some_and(u8::is_ascii_digit);
    let starts = |at: &usize| is_digit(*at) && (*at == 0 || !is_digit(*at - 1)) && name[*at..].parse::<f64>().is_ok();
    let at = (0..bytes.len()).find(starts)?;
    let is_signed = at > 0 && bytes[at - 1] == b'-' && (at == 1 || !bytes[at - 2].is_ascii_alphanumeric());
    Some(name.split_at(at - usize::from(is_signed)))
}

/// The variable or the array of a name, else the only variable.
fn choose(mut variables: Vec<Variable>, name: Option<&str>) -> Advised<Variable> {
    let listed = variables::listed(&variables.iter().map(Variable::info).collect::<Vec<_>>());
    let Some(name) = name else {
        return match variables.len() {
            1 => Ok(variables.remove(0)),
            n => Err(Note::with(format!("has {n} variables, not one:{listed}"), Remedy::ChooseVariable)),
        };
    };
    let find = |is: &dyn Fn(&Variable) -> bool| variables.iter().position(is);
    if let Some(at) = find(&|v| v.name == name).or_else(|| find(&|v| v.short_name() == name)) {
        return Ok(variables.swap_remove(at));
    }
    let array = variables.iter().flat_map(|variable| &variable.arrays).find(|found| found.name == name);
    let array = array.ok_or_else(|| format!("has no array {name}; it has{listed}"))?;
    Ok(Variable { name: name.into(), arrays: vec![array.clone()], steps: Vec::new() })
}

impl Found {
    /// Its frames.
    fn part(&self, file: &FileBytes) -> Result<Part> {
        let Self { member, array, .. } = self;
        let (path, state) = (file.path(), file.state());
        let refused = |e| Error::input(path.join(&member.name), e);
        let Array { ty, big_endian, frames, .. } = *array;
        if let Some(compression) = member.compression {
            let stream = Stream { compression, start: member.start, skip: array.start };
            return stream.part(path, state, &array.layout, ty, big_endian).map_err(refused);
        }
        let stored = Stored::new(&array.layout, ty, big_endian).map_err(refused)?;
        let at = DataLocation::Byte(member.start + array.start);
        Ok(Part { path: path.into(), state, frames, stored, at })
    }
}
