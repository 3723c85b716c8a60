//! Meshes of openPMD: arrays of an HDF5 file with a lattice of their own, and a time for each iteration.

use super::axes::MODES;
use super::steps::{Choice, STEP, numbered_groups};
use super::variable::numbers;
use super::{ArrayFile, Attribute, Attributes, Variable};
use wavesplat_core::base::error::Note;
use wavesplat_core::source::layout::Axis;

/// The lattice of a mesh, in the order of the array's axes.
pub(crate) struct Mesh {
    labels: Vec<String>,
    spacing: Vec<f64>,
    origin: Vec<f64>,
    units: Vec<f64>,
    /// A geometry whose axes are no straight lines.
    bent: Option<String>,
}

impl Mesh {
    /// `None` if neither the array nor the group of its components has the attributes of a mesh.
    ///
    /// # Errors
    /// A note on a mesh that does not fit the array.
    pub(crate) fn read(file: &dyn ArrayFile, variable: &Variable) -> Result<Option<Self>, Note> {
        let parent = variable.path.rsplit_once('/').map_or("", |(parent, _)| parent);
        let says = |attributes: &Attributes| attributes.contains_key("axisLabels");
        let of_group = || Some(file.group(parent)).filter(says);
        let Some(attributes) = Some(variable.attributes.clone()).filter(says).or_else(of_group) else {
            return Ok(None);
        };
        let mesh = Self::of_attributes(&attributes, variable);
        let unfit = || format!("the lattice of the mesh is not taken: it does not fit the axes {:?}", variable.lengths);
        mesh.map(Some).ok_or_else(|| unfit().into())
    }

    fn of_attributes(attributes: &Attributes, variable: &Variable) -> Option<Self> {
        let mut labels = match attributes.get("axisLabels")? {
            Attribute::Texts(labels) => labels.clone(),
            Attribute::Text(label) => vec![label.clone()],
            Attribute::Numbers(_) => return None,
        };
        let axes = labels.len();
        let of_axes = |name: &str| Some(numbers(attributes, name).to_vec()).filter(|all| all.len() == axes);
        let (mut spacing, mut origin) = (of_axes("gridSpacing")?, of_axes("gridGlobalOffset")?);
        let unit = numbers(attributes, "gridUnitSI").first().copied().unwrap_or(1.0);
        let mut units = of_axes("gridUnitSI").unwrap_or_else(|| vec![unit; axes]);
        let text = |name: &str| match attributes.get(name) {
            Some(Attribute::Text(text)) => text.as_str(),
            _ => "",
        };
        if text("dataOrder") == "F" {
            labels.reverse();
            [&mut spacing, &mut origin, &mut units].into_iter().for_each(|all| all.reverse());
        }
        let position = variable.numbers("position");
        for (axis, first) in origin.iter_mut().enumerate() {
            *first += position.get(axis).copied().unwrap_or(0.0) * spacing[axis];
        }
        let geometry = text("geometry");
        if geometry == "thetaMode" && axes + 1 == variable.lengths.len() {
            labels.insert(0, MODES.into());
            [&mut spacing, &mut units].into_iter().for_each(|all| all.insert(0, 1.0));
            origin.insert(0, 0.0);
        }
        let bent = Some(geometry).filter(|geometry| !matches!(*geometry, "" | "cartesian" | "thetaMode"));
        let mesh = Self { labels, spacing, origin, units, bent: bent.map(String::from) };
        (mesh.labels.len() == variable.lengths.len()).then_some(mesh)
    }

    /// A variable with the names of its axes.
    pub(crate) fn named(&self, variable: &Variable) -> Variable {
        Variable { dims: self.labels.clone(), ..variable.clone() }
    }

    /// Spacing and origin along x, y, z in metres; 1 and 0 along axes that it lacks.
    pub(crate) fn lattice(&self, axes: &[Axis]) -> ([f64; 3], [f64; 3]) {
        let (mut spacing, mut origin) = ([1.0; 3], [0.0; 3]);
        for (at, along) in axes.iter().enumerate().filter_map(|(at, axis)| Some((at, axis.role.voxels()?))) {
            spacing[along] = self.spacing[at] * self.units[at];
            origin[along] = self.origin[at] * self.units[at];
        }
        (spacing, origin)
    }

    /// A note on axes that are no straight lines.
    pub(crate) fn note(&self) -> Option<Note> {
        Some(format!("the axes of the {} mesh are taken as straight", self.bent.as_ref()?).into())
    }
}

/// Whether a file has one iteration, because each has a file of its own.
pub(crate) fn has_one_step(file: &dyn ArrayFile) -> bool {
    matches!(file.group("/").get("iterationEncoding"), Some(Attribute::Text(how)) if how == "fileBased")
}

/// The time of each step, and whether times are in seconds, if the groups of all steps state it. The step of a single
/// array is a numbered group that it is in.
pub(crate) fn times(file: &dyn ArrayFile, choice: &Choice<'_>) -> Option<(Vec<f64>, bool)> {
    let times: Vec<(f64, bool)> = match choice.path.split_once(STEP) {
        Some((before, _)) => {
            let group = |variable: &&Variable| {
                let rest = variable.shown()[before.len()..].find('/').unwrap_or_default();
                file.group(&variable.shown()[..before.len() + rest])
            };
            choice.arrays.iter().map(group).map(|attributes| time(&attributes)).collect::<Option<_>>()?
        }
        None => {
            let mut groups = numbered_groups(choice.arrays[0].shown()).into_iter();
            vec![groups.find_map(|group| time(&file.group(group)))?]
        }
    };
    let are_seconds = times.iter().all(|(_, second)| *second);
    Some((times.into_iter().map(|(time, _)| time).collect(), are_seconds))
}

/// The time that the attributes of a group state, and whether it is in seconds.
fn time(attributes: &Attributes) -> Option<(f64, bool)> {
    let number = |name: &str| numbers(attributes, name).first().copied();
    let second = number("timeUnitSI");
    Some((number("time")? * second.unwrap_or(1.0), second.is_some()))
}
