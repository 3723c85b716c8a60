//! Where voxels and frames are, by the coordinates of a variable's axes.

use super::auxiliary_times::{self, Auxiliary};
use super::sibling_times::StepArrays;
use super::{ArrayFile, FileArrays, Variable, axes, coordinates};
use wavesplat_core::base::description::{AxisRole, unwrap_degrees};
use wavesplat_core::base::error::{Note, Remedy};
use wavesplat_core::source::layout::Axis;

/// Steps along an axis may differ by so much of one: coordinates are often rounded to single precision.
const REGULAR: f64 = 1e-2;

/// Units of length, in metres.
const LENGTHS: [(&str, f64); 10] = [
    ("m", 1.0),
    ("metre", 1.0),
    ("metres", 1.0),
    ("meter", 1.0),
    ("meters", 1.0),
    ("km", 1e3),
    ("kilometers", 1e3),
    ("cm", 1e-2),
    ("mm", 1e-3),
    ("um", 1e-6),
];

/// The lattice and the times of a variable.
#[derive(Debug, Default)]
pub(crate) struct Places {
    pub(crate) spacing: [f64; 3],
    pub(crate) origin: [f64; 3],
    backwards: [bool; 3],
    pub(crate) times: Vec<f64>,
    pub(crate) space_unit: Option<String>,
    pub(crate) time_unit: Option<String>,
    pub(crate) calendar: Option<String>,
    /// The path of the variable with the times.
    pub(crate) time_path: Option<String>,
    pub(crate) notes: Vec<Note>,
}

/// A summary of the coordinates of an axis.
#[derive(Debug, Clone)]
struct AxisCoordinates {
    /// Name of the axis.
    name: String,
    /// The coordinate that is least.
    first: f64,
    /// To the next one.
    step: Option<f64>,
    backwards: bool,
    is_regular: bool,
    unit: String,
}

impl Places {
    /// Those of a variable. `spaced`: whether the user says how far voxels are apart.
    pub(crate) fn find(arrays: FileArrays<'_>, variable: &Variable, axes: &[Axis], spaced: bool) -> Self {
        let mut places = Self { spacing: [1.0; 3], ..Self::default() };
        let mut lines = [const { None }; 3];
        for (number, axis) in axes.iter().enumerate() {
            match (axis.role, axis.role.voxels(), variable.coordinate(number, arrays.all)) {
                (AxisRole::Frames, _, Some(times)) => places.take_times(arrays.file, times),
                (AxisRole::Frames, _, None) => places.take_times_beside(arrays, variable, number),
                (_, Some(along), Some(coordinate)) => lines[along] = places.line(arrays.file, coordinate),
                _ => {}
            }
        }
        if axes.iter().all(|axis| axis.role != AxisRole::Frames)
            && let Some(time) = scalar_time(arrays.all, variable)
        {
            places.take_times(arrays.file, time);
        }
        places.take_lines(&lines, spaced);
        places
    }

    /// Whether voxels are stored from the last to the first.
    pub(crate) fn is_backwards(&self, role: AxisRole) -> bool {
        role.voxels().is_some_and(|along| self.backwards[along])
    }

    /// The coordinates of an axis; None, with a note, if they neither ascend nor descend.
    fn line(&mut self, file: &dyn ArrayFile, coordinate: &Variable) -> Option<AxisCoordinates> {
        let line = coordinates(file, coordinate).ok().and_then(|at| AxisCoordinates::summarise(at, coordinate));
        if line.is_none() {
            let name = coordinate.name();
            self.notes.push(format!("{name} does not ascend or descend: its voxels are numbered").into());
        }
        line
    }

    fn take_times(&mut self, file: &dyn ArrayFile, times: &Variable) {
        match coordinates(file, times) {
            Ok(numbers) => (self.times, self.time_path) = (numbers, Some(times.path.clone())),
            Err(_) => self.notes.push(format!("{} cannot be read: frames are numbered", times.name()).into()),
        }
        self.time_unit = times.text("units").map(String::from);
        self.calendar = times.text("calendar").map(String::from);
    }

    /// Takes the times of an axis that has no coordinates: those of an auxiliary coordinate, or stored beside frames.
    fn take_times_beside<'a>(&mut self, arrays: FileArrays<'a>, variable: &'a Variable, axis: usize) {
        match auxiliary_times::find(arrays, variable, axis) {
            Ok(Some(Auxiliary::Numbers(times))) => self.take_times(arrays.file, times),
            Ok(Some(Auxiliary::Dates(dates))) => (self.times, self.time_unit) = (dates.times, Some(dates.unit)),
            Ok(None) => self.take_sibling_times(arrays, &StepArrays::along(variable, axis)),
            Err(note) => self.notes.push(note),
        }
    }

    /// Takes the times that are stored beside frames, if there are any.
    pub(crate) fn take_sibling_times<'a>(&mut self, arrays: FileArrays<'a>, steps: &StepArrays<'a>) {
        match steps.times(arrays) {
            Ok(Some(times)) => self.take_times(arrays.file, times),
            Ok(None) => {}
            Err(note) => self.notes.push(note),
        }
    }

    fn take_lines(&mut self, lines: &[Option<AxisCoordinates>; 3], spaced: bool) {
        for (along, line) in lines.iter().enumerate() {
            self.backwards[along] = line.as_ref().is_some_and(|line| line.backwards);
        }
        // Lengths compare along axes of one unit alone: x leads, then y, then z.
        let Some(leading) = lines.iter().flatten().find(|line| line.step.is_some()) else { return };
        let step = leading.step.unwrap_or(1.0);
        let mut is_one_unit = true;
        for (along, line) in lines.iter().enumerate() {
            match line.as_ref().map(|line| (line, factor(&line.unit, &leading.unit))) {
                Some((line, Some(factor))) => {
                    (self.origin[along], self.spacing[along]) =
                        (line.first * factor, line.step.map_or(step, |s| s * factor));
                    if !line.is_regular {
                        self.notes.push(format!("{} is not regular: its mean step is taken", line.name).into());
                    }
                }
                Some((line, None)) => {
                    self.spacing[along] = step;
                    is_one_unit &= line.step.is_none();
                    if line.step.is_some() && !spaced {
                        self.notes.push(line.other_unit(leading));
                    }
                }
                None => self.spacing[along] = step,
            }
        }
        self.space_unit = Some(leading.unit.clone()).filter(|unit| is_one_unit && !unit.is_empty());
    }
}

/// The factor from one unit to another; None if they are not both lengths.
fn factor(unit: &str, other: &str) -> Option<f64> {
    let metres = |unit: &str| LENGTHS.iter().find(|(name, _)| *name == unit).map(|(_, metres)| *metres);
    if unit == other { Some(1.0) } else { Some(metres(unit)? / metres(other)?) }
}

/// The time of a file of one frame: CF's scalar coordinate.
fn scalar_time<'a>(all: &'a [Variable], variable: &Variable) -> Option<&'a Variable> {
    let times = || {
        let is_time = |v: &&Variable| {
            axes::role_of_coordinate(v) == Some(AxisRole::Frames) || v.name().eq_ignore_ascii_case("time")
        };
        all.iter().filter(|v| v.lengths.iter().all(|n| *n == 1) && v.path != variable.path).filter(is_time)
    };
    let named = variable.text("coordinates").unwrap_or_default();
    let is_valid = |v: &&Variable| v.text("standard_name") == Some("time") || v.name().eq_ignore_ascii_case("time");
    let is_named = |v: &&Variable| named.split_whitespace().any(|name| name == v.name());
    times().find(is_valid).or_else(|| times().find(is_named)).or_else(|| times().next())
}

impl AxisCoordinates {
    /// None for coordinates that neither ascend nor descend.
    fn summarise(mut at: Vec<f64>, coordinate: &Variable) -> Option<Self> {
        let unit = unit(coordinate.text("units").unwrap_or_default());
        if unit == "degrees" {
            unwrap_degrees(&mut at);
        }
        if coordinate.text("positive").is_some_and(|positive| positive.eq_ignore_ascii_case("down")) {
            at.iter_mut().for_each(|v| *v = -*v);
        }
        let backwards = at.len() > 1 && at[at.len() - 1] < at[0];
        if backwards {
            at.reverse();
        }
        if at.is_empty() || at.iter().any(|v| !v.is_finite()) || at.windows(2).any(|pair| pair[0] >= pair[1]) {
            return None;
        }
        let step = (at.len() > 1).then(|| (at[at.len() - 1] - at[0]) / (at.len() - 1) as f64);
        let off = |(i, v): (usize, &f64)| (v - at[0] - step.unwrap_or_default() * i as f64).abs();
        let is_regular = at.iter().enumerate().map(off).all(|off| off <= REGULAR * step.unwrap_or(1.0));
        let name = coordinate.name().to_string();
        Some(Self { name, first: at[0], step, backwards, is_regular, unit })
    }

    /// A note on an axis whose unit is not comparable with that of the leading axis.
    fn other_unit(&self, leading: &Self) -> Note {
        let uneven = if self.is_regular { "" } else { " and not regular" };
        let text = format!(
            "{} is in {:?}{uneven}, {} in {:?}: its voxels are numbered, and drawn as far apart as those of {}",
            self.name, self.unit, leading.name, leading.unit, leading.name
        );
        Note::with(text, Remedy::Set("spacing"))
    }
}

/// The unit of a coordinate. Degrees north and east are one unit.
fn unit(text: &str) -> String {
    if text.to_lowercase().starts_with("degree") { "degrees".into() } else { text.into() }
}

#[cfg(test)]
mod tests {
    use super::super::{Attribute, Attributes};
    use super::*;

    fn line(at: &[f64], attributes: &[(&str, &str)]) -> Option<AxisCoordinates> {
        let text = |(name, text): &(&str, &str)| ((*name).to_string(), Attribute::Text((*text).into()));
        let attributes: Attributes = attributes.iter().map(text).collect();
        let (lengths, dims) = (vec![at.len()], vec!["a".into()]);
        AxisCoordinates::summarise(
            at.to_vec(),
            &Variable {
                path: "a".into(),
                sample: Err("f64".into()),
                lengths,
                dims,
                scales: Vec::new(),
                chunk: None,
                attributes,
            },
        )
    }

    #[test]
    fn coordinates_lead_from_one_end_to_the_other() {
        let found = |at: &[f64], attributes: &[(&str, &str)]| {
            line(at, attributes).map(|l| (l.first, l.step, l.backwards, l.is_regular))
        };
        let east = [("units", "degrees_east")];
        assert_eq!(found(&[350.0, 355.0, 0.0, 5.0], &east), Some((350.0, Some(5.0), false, true)));
        assert_eq!(found(&[90.0, 0.0, -90.0], &[("units", "degrees_north")]), Some((-90.0, Some(90.0), true, true)));
        assert_eq!(found(&[1.0, 2.0, 9.0], &[("positive", "down")]), Some((-9.0, Some(4.0), true, false)));
        assert_eq!(found(&[350.0, 0.0], &[]), Some((0.0, Some(350.0), true, true)));
        assert!(found(&[1.0, 3.0, 2.0, 5.0], &[]).is_none() && found(&[1.0, f64::NAN], &[]).is_none());
        assert_eq!((factor("km", "m"), factor("hPa", "m"), factor("", "")), (Some(1000.0), None, Some(1.0)));
    }
}
