//! Images in VTKHDF: arrays of an HDF5 file with axes, lattice and steps by VTK's conventions.

use super::{ArrayFile, Attribute, Variable};
use crate::shared::association::Association;
use wavesplat_core::source::Parsed;

/// The arrays of such a file, and their lattice.
pub(crate) struct Image {
    /// Those of points and of cells, by axes with names.
    pub(crate) variables: Vec<Variable>,
    /// The name of the active one.
    pub(crate) active: Option<String>,
    extent: [i64; 6],
    spacing: [f64; 3],
    origin: [f64; 3],
    pub(crate) is_turned: bool,
    /// Of each step.
    pub(crate) times: Vec<f64>,
}

const ROOT: &str = "/VTKHDF";

impl Image {
    /// The file's arrays and lattice; `None` if the file is no VTKHDF.
    pub(crate) fn read(file: &dyn ArrayFile, all: &[Variable]) -> Parsed<Option<Self>> {
        let attributes = file.group(ROOT);
        let Some(Attribute::Text(kind)) = attributes.get("Type") else { return Ok(None) };
        if kind != "ImageData" {
            return Err(format!("is a VTKHDF file of type {kind}; ImageData is supported"));
        }
        let numbers = |name: &str| match attributes.get(name) {
            Some(Attribute::Numbers(numbers)) => Ok(numbers.clone()),
            _ => Err(format!("its VTKHDF group does not say {name}")),
        };
        let three = |name: &str| -> Parsed<[f64; 3]> {
            numbers(name)?.try_into().map_err(|_| format!("{name} of its VTKHDF group must be three numbers"))
        };
        let extent: [f64; 6] =
            numbers("WholeExtent")?.try_into().map_err(|_| "WholeExtent of its VTKHDF group must be six numbers")?;
        let values = format!("{ROOT}/Steps/Values");
        let times = if all.iter().any(|v| v.path == values) { file.numbers(&values)? } else { Vec::new() };
        let identity = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0];
        Ok(Some(Self {
            variables: all.iter().filter(|v| data(v).is_some()).map(|v| with_axes(v, !times.is_empty())).collect(),
            active: active(file, all),
            extent: extent.map(|n| n as i64),
            spacing: three("Spacing")?,
            origin: three("Origin")?,
            is_turned: numbers("Direction").is_ok_and(|direction| direction != identity),
            times,
        }))
    }

    /// Spacing, and the place of the first sample.
    pub(crate) fn lattice(&self, variable: &Variable) -> ([f64; 3], [f64; 3]) {
        let first = std::array::from_fn(|a| self.origin[a] + self.extent[2 * a] as f64 * self.spacing[a]);
        (self.spacing, association(variable).origin(self.points(), first, self.spacing))
    }

    /// An error if an array is not of the image's size.
    pub(crate) fn check(&self, dims: [usize; 3], variable: &Variable) -> Parsed<()> {
        let expected = association(variable).dims(self.points());
        match dims == expected {
            true => Ok(()),
            false => Err(format!("{} has {dims:?} samples, but the extent asks for {expected:?}", variable.path)),
        }
    }

    /// Points along x, y, z; 0 where the extent makes no sense.
    fn points(&self) -> [usize; 3] {
        let length = |a: usize| self.extent[2 * a + 1].saturating_sub(self.extent[2 * a]).saturating_add(1);
        std::array::from_fn(|a| usize::try_from(length(a)).unwrap_or(0))
    }

    /// Which of an array's frames each step has.
    pub(crate) fn offsets(&self, file: &dyn ArrayFile, variable: &Variable, frames: usize) -> Parsed<Vec<usize>> {
        let path = format!("{ROOT}/Steps/{}Offsets/{}", data(variable).unwrap_or_default(), variable.name());
        if self.times.is_empty() {
            return Ok(Vec::new());
        }
        let Ok(offsets) = file.numbers(&path) else { return Ok(Vec::new()) };
        // VTK itself writes one more than there are steps.
        let offsets: Vec<f64> = offsets.into_iter().take(self.times.len()).collect();
        let is_there = |n: &f64| n.fract() == 0.0 && (0.0..frames as f64).contains(n);
        match offsets.len() == self.times.len() && offsets.iter().all(is_there) {
            true => Ok(offsets.into_iter().map(|n| n as usize).collect()),
            false => Err(format!("{path} leads to steps that {} does not have", variable.path)),
        }
    }
}

/// Whether an array has samples of points or of cells: `PointData` or `CellData`.
fn data(variable: &Variable) -> Option<&str> {
    let (data, name) = variable.path.strip_prefix(ROOT)?.strip_prefix('/')?.split_once('/')?;
    Some(data).filter(|data| matches!(*data, "PointData" | "CellData") && name != "vtkGhostType")
}

fn association(variable: &Variable) -> Association {
    if data(variable) == Some("CellData") { Association::Cells } else { Association::Points }
}

fn with_axes(variable: &Variable, steps: bool) -> Variable {
    let names = ["time", "z", "y", "x", "component"];
    let names = names[usize::from(!steps)..].iter().map(|name| (*name).to_string());
    let rest = std::iter::repeat(String::new());
    Variable { dims: names.chain(rest).take(variable.lengths.len()).collect(), ..variable.clone() }
}

fn active(file: &dyn ArrayFile, all: &[Variable]) -> Option<String> {
    let of_group = |data: &str| match file.group(&format!("{ROOT}/{data}")).remove("Scalars") {
        Some(Attribute::Text(name)) => Some(name),
        _ => None,
    };
    let is_active = |v: &&Variable| data(v).is_some() && v.text("Attribute") == Some("Scalars");
    let of_array = all.iter().find(is_active).map(|v| v.name().to_string());
    of_group("PointData").or_else(|| of_group("CellData")).or(of_array)
}
