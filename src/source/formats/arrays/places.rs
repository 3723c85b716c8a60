//! Where voxels and frames are, by the coordinates of a variable's axes.

use super::{ArrayFile, Variable, axes};
use crate::source::Parsed;
use crate::source::layout::Counts;

/// Steps along an axis may differ by so much of one: coordinates are often rounded to single precision.
const REGULAR: f64 = 1e-2;

/// The lattice and the times of a variable.
#[derive(Debug, Default)]
pub(super) struct Places {
    pub(super) spacing: [f64; 3],
    pub(super) origin: [f64; 3],
    backwards: [bool; 3],
    pub(super) times: Vec<f64>,
    pub(super) space_unit: Option<String>,
    pub(super) time_unit: Option<String>,
    pub(super) notes: Vec<String>,
}

/// What the coordinates of an axis come to.
#[derive(Debug, Clone)]
struct Line {
    /// Name of the axis.
    name: String,
    /// Of the coordinate that is least.
    first: f64,
    /// To the next one.
    step: Option<f64>,
    backwards: bool,
    is_regular: bool,
    unit: String,
}

impl Places {
    pub(super) fn of(file: &dyn ArrayFile, all: &[Variable], variable: &Variable, counts: &[Counts]) -> Parsed<Self> {
        let mut places = Self { spacing: [1.0; 3], ..Self::default() };
        let mut lines = [const { None }; 3];
        for (axis, counts) in counts.iter().enumerate() {
            let coordinate = variable.coordinate(axis, all);
            match (counts, coordinate) {
                (Counts::Frames, Some(times)) => places.take_times(file, times)?,
                (Counts::Voxels(along), Some(coordinate)) => lines[*along] = Line::of(file, coordinate)?,
                _ => {}
            }
        }
        if !counts.contains(&Counts::Frames)
            && let Some(time) = all.iter().find(|v| v.lengths.iter().all(|n| *n == 1) && is_time(v))
        {
            places.take_times(file, time)?;
        }
        places.take_lines(&lines);
        Ok(places)
    }

    /// Whether voxels are stored from the last to the first.
    pub(super) fn is_backwards(&self, counts: Counts) -> bool {
        matches!(counts, Counts::Voxels(along) if self.backwards[along])
    }

    fn take_times(&mut self, file: &dyn ArrayFile, times: &Variable) -> Parsed<()> {
        self.times = file.numbers(&times.path)?;
        if self.times.iter().any(|t| !t.is_finite()) {
            self.times.clear();
            self.notes.push(format!("{} is not a number for every frame: frames are numbered", times.name()));
        }
        self.time_unit = times.text("units").map(String::from);
        Ok(())
    }

    fn take_lines(&mut self, lines: &[Option<Line>; 3]) {
        for (along, line) in lines.iter().enumerate() {
            self.backwards[along] = line.as_ref().is_some_and(|line| line.backwards);
        }
        // Lengths compare along axes of one unit alone: x leads, then y, then z.
        let Some(leading) = lines.iter().flatten().find(|line| line.step.is_some()) else { return };
        let step = leading.step.unwrap_or(1.0);
        self.space_unit = Some(leading.unit.clone()).filter(|unit| !unit.is_empty());
        for (along, line) in lines.iter().enumerate() {
            match line {
                Some(line) if line.unit == leading.unit => {
                    (self.origin[along], self.spacing[along]) = (line.first, line.step.unwrap_or(step));
                    if !line.is_regular {
                        self.notes.push(format!("{} is not regular: its mean step is taken", line.name));
                    }
                }
                Some(line) => {
                    self.spacing[along] = step;
                    if line.step.is_some() {
                        self.notes.push(format!(
                            "{} is in {:?} and {} in {:?}: its voxels are drawn as far apart as those of {}; --spacing sets \
                             another distance",
                            line.name, line.unit, leading.name, leading.unit, leading.name
                        ));
                    }
                }
                None => self.spacing[along] = step,
            }
        }
    }
}

fn is_time(variable: &Variable) -> bool {
    axes::of_coordinate(variable) == Some(Counts::Frames) || variable.name().eq_ignore_ascii_case("time")
}

impl Line {
    /// None for coordinates that do not lead from one end to the other.
    fn of(file: &dyn ArrayFile, coordinate: &Variable) -> Parsed<Option<Self>> {
        let mut at = file.numbers(&coordinate.path)?;
        let down = coordinate.text("positive").is_some_and(|positive| positive.eq_ignore_ascii_case("down"));
        if down {
            at.iter_mut().for_each(|v| *v = -*v);
        }
        let backwards = at.len() > 1 && at[at.len() - 1] < at[0];
        if backwards {
            at.reverse();
        }
        if at.is_empty() || at.iter().any(|v| !v.is_finite()) || at.windows(2).any(|pair| pair[0] >= pair[1]) {
            return Ok(None);
        }
        let step = (at.len() > 1).then(|| (at[at.len() - 1] - at[0]) / (at.len() - 1) as f64);
        let off = |(i, v): (usize, &f64)| (v - at[0] - step.unwrap_or_default() * i as f64).abs();
        let is_regular = at.iter().enumerate().map(off).all(|off| off <= REGULAR * step.unwrap_or(1.0));
        let unit = unit(coordinate.text("units").unwrap_or_default());
        let name = coordinate.name().to_string();
        Ok(Some(Self { name, first: at[0], step, backwards, is_regular, unit }))
    }
}

/// Degrees are degrees, wherever they lead.
fn unit(text: &str) -> String {
    if text.to_lowercase().starts_with("degree") { "degrees".into() } else { text.into() }
}
