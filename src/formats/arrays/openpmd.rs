//! Meshes of openPMD: arrays of an HDF5 file with a lattice of their own, and a time for each iteration.

use super::choose::{Choice, STEP};
use super::variable::numbers;
use super::{ArrayFile, Attribute, Attributes, Variable};

/// The lattice of a mesh, in the order of the array's axes.
pub(crate) struct Mesh {
    labels: Vec<String>,
    spacing: Vec<f64>,
    origin: Vec<f64>,
    unit: f64,
}

impl Mesh {
    /// `None` if neither the array nor the group of its components has the attributes of a mesh.
    pub(crate) fn read(file: &dyn ArrayFile, variable: &Variable) -> Option<Self> {
        let parent = variable.path.rsplit_once('/').map_or("", |(parent, _)| parent);
        let says = |attributes: &Attributes| attributes.contains_key("axisLabels");
        let attributes =
            Some(variable.attributes.clone()).filter(says).or_else(|| Some(file.group(parent)).filter(says))?;
        let Some(Attribute::Texts(labels)) = attributes.get("axisLabels") else { return None };
        let numbers = |name: &str| numbers(&attributes, name).to_vec();
        let (mut labels, mut spacing, mut first) =
            (labels.clone(), numbers("gridSpacing"), numbers("gridGlobalOffset"));
        if attributes.get("dataOrder") == Some(&Attribute::Text("F".into())) {
            labels.reverse();
            spacing.reverse();
            first.reverse();
        }
        let fits =
            labels.len() == variable.lengths.len() && spacing.len() == labels.len() && first.len() == labels.len();
        let position = variable.numbers("position");
        let inside = |i: usize| position.get(i).copied().unwrap_or(0.0) * spacing[i];
        let unit = numbers("gridUnitSI").first().copied().unwrap_or(1.0);
        let origin = fits.then(|| (0..labels.len()).map(|i| first[i] + inside(i)).collect())?;
        Some(Self { labels, spacing, origin, unit })
    }

    /// A variable with the names of its axes.
    pub(crate) fn named(&self, variable: &Variable) -> Variable {
        Variable { dims: self.labels.clone(), ..variable.clone() }
    }

    /// Spacing and origin along x, y, z in metres; 1 and 0 along axes that it lacks.
    pub(crate) fn lattice(&self) -> ([f64; 3], [f64; 3]) {
        let along = |axis: usize, of: &[f64], none: f64| {
            let at = self.labels.iter().position(|label| *label == ["x", "y", "z"][axis]);
            at.map_or(none, |at| of[at] * self.unit)
        };
        (
            std::array::from_fn(|axis| along(axis, &self.spacing, 1.0)),
            std::array::from_fn(|axis| along(axis, &self.origin, 0.0)),
        )
    }
}

/// The time of each step, and whether times are in seconds, if the groups of all steps state it.
pub(crate) fn times(file: &dyn ArrayFile, choice: &Choice<'_>) -> Option<(Vec<f64>, bool)> {
    let (before, _) = choice.path.split_once(STEP)?;
    let group = |variable: &&Variable| {
        let rest = variable.shown()[before.len()..].find('/').unwrap_or_default();
        file.group(&variable.shown()[..before.len() + rest])
    };
    let time = |attributes: Attributes| {
        let number = |name: &str| numbers(&attributes, name).first().copied();
        let second = number("timeUnitSI");
        Some((number("time")? * second.unwrap_or(1.0), second.is_some()))
    };
    let times: Vec<(f64, bool)> = choice.arrays.iter().map(group).map(time).collect::<Option<_>>()?;
    let are_seconds = times.iter().all(|(_, second)| *second);
    Some((times.into_iter().map(|(time, _)| time).collect(), are_seconds))
}
