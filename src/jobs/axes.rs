//! The axes of all voxels: their names, units and coordinates, and positions along them in voxels.

use super::units::{attribute_text, in_letters};
use std::ops::Range;
use wavesplat_core::base::description::{Description, coordinates, sides, unwrap_degrees};
use wavesplat_core::base::error::{Error, Result};
use wavesplat_core::base::grid::{Grid, Region};
use wavesplat_core::base::position::{AxisPosition, Ends, RegionSpec};
use wavesplat_engine::file::{CoefficientFile, setting};
use wavesplat_engine::render::annotate::AxisLabels;

/// An axis of voxels.
#[derive(Debug, Clone, PartialEq)]
struct Axis {
    /// The names that options may use; the first is the one that is shown.
    names: Vec<String>,
    unit: String,
    /// The coordinate of every voxel.
    at: Vec<f64>,
    /// The sides of a patient at the ends, if they are known.
    sides: Option<[char; 2]>,
}

/// The axes x, y and z of all voxels, at their true places.
#[derive(Debug, Clone, PartialEq)]
pub struct Axes([Axis; 3]);

impl Axes {
    /// The axes of a grid with true heights, with names and units from the source's description. `unit` is that of the grid, if it is known.
    pub fn new(grid: &Grid, unit: Option<&str>, description: Option<&Description>) -> Self {
        Self(std::array::from_fn(|along| Axis::new(grid, unit, description, along)))
    }

    /// The axes of a coefficient file.
    pub fn from_file(file: &CoefficientFile) -> Result<Self> {
        let m = file.metadata();
        let grid = Grid { dims: m.dims.map(|n| n as usize), spacing: m.spacing, origin: m.origin };
        Ok(Self::new(&grid, setting(m, "space-units"), file.description()?.as_ref()))
    }

    /// The number of the axis with a name, or with the only name that begins like this.
    pub(crate) fn find(&self, field: &'static str, name: &str) -> Result<usize> {
        let is = |matches: &dyn Fn(&str) -> bool| -> Vec<usize> {
            (0..3).filter(|a| self.0[*a].names.iter().any(|own| matches(&own.to_lowercase()))).collect()
        };
        let name = name.trim().to_lowercase();
        let exact = is(&|own| own == name);
        let found = if exact.is_empty() && name.len() >= 3 { is(&|own| own.starts_with(&name)) } else { exact };
        match found[..] {
            [axis] => Ok(axis),
            _ => {
                let known: Vec<String> = self.0.iter().map(|axis| axis.names.join(" or ")).collect();
                Err(Error::setting(field, format!("no axis '{name}'; the axes are {}", known.join(", "))))
            }
        }
    }

    /// The voxels of a box that a field names.
    ///
    /// # Errors
    /// An end that is none, or a box that is empty or not within the volume.
    pub fn region(&self, field: &'static str, spec: &RegionSpec) -> Result<Region> {
        let [x, y, z] = [0, 1, 2].map(|axis| self.0[axis].range(&spec.0[axis]));
        let ranges = x.and_then(|x| Ok([x, y?, z?])).map_err(|what| Error::setting(field, what))?;
        let region = Region { start: ranges.each_ref().map(|range| range.start), end: ranges.map(|range| range.end) };
        let dims = self.0.each_ref().map(|axis| axis.at.len());
        if !(Region { start: [0; 3], end: dims }).contains(&region) || region.is_empty() {
            let [x, y, z] = dims;
            return Err(Error::setting(field, format!("empty, or not within the volume of {x}x{y}x{z} voxels")));
        }
        Ok(region)
    }

    /// A place along an axis, in voxels.
    pub(crate) fn voxel(&self, field: &'static str, axis: usize, place: &AxisPosition) -> Result<f64> {
        self.0[axis].voxel(place).map_err(|what| Error::setting(field, what))
    }

    /// Names, units and coordinates.
    pub(crate) fn labels(&self) -> [AxisLabels; 3] {
        self.0.each_ref().map(|axis| AxisLabels {
            name: axis.names[0].clone(),
            unit: in_letters(&axis.unit),
            at: axis.at.clone(),
            sides: axis.sides,
        })
    }

    /// Whether lengths along two axes compare.
    pub(crate) fn compare(&self, a: usize, b: usize) -> bool {
        let labels = self.labels();
        labels[a].compares_with(&labels[b])
    }

    /// The sides of a patient at the first and the last voxel of an axis, if they are known.
    pub(crate) fn sides(&self, axis: usize) -> Option<[char; 2]> {
        self.0[axis].sides
    }

    /// The name of an axis.
    pub(crate) fn name(&self, axis: usize) -> &str {
        &self.0[axis].names[0]
    }

    /// A place in voxels as the options accept it: `depth=120m`.
    pub(crate) fn text(&self, axis: usize, voxel: f64) -> String {
        let Axis { names, unit, .. } = &self.0[axis];
        format!("{}=@{}{unit}", names[0], without_rounding(self.0[axis].coordinate(voxel)))
    }
}

impl Axis {
    fn new(grid: &Grid, of_grid: Option<&str>, description: Option<&Description>, along: usize) -> Self {
        let letter = ["x", "y", "z"][along].to_string();
        let own = description.and_then(|all| coordinates(all, along)).filter(|at| at.len() == grid.dims[along]);
        let (mut names, mut unit) = description.map_or_else(Default::default, |all| named(all, along));
        let is_counted = description.is_some_and(|all| is_counted(all, grid, along));
        if own.is_none() && unit.is_empty() && !is_counted {
            unit = of_grid.unwrap_or_default().into();
        }
        let one = if is_counted { grid.spacing[along] } else { 1.0 };
        let regular = |n: usize| (grid.origin[along] + grid.spacing[along] * n as f64) / one;
        names.push(letter);
        names.retain(|name| !name.is_empty());
        names.dedup();
        let sides = description.and_then(|all| sides(all, along));
        let mut at = own.unwrap_or_else(|| (0..grid.dims[along]).map(regular).collect());
        if unit.starts_with("degree") {
            unwrap_degrees(&mut at);
        }
        Self { names, unit, at, sides }
    }

    fn voxel(&self, place: &AxisPosition) -> std::result::Result<f64, String> {
        let last = (self.at.len() - 1) as f64;
        match place {
            AxisPosition::Share(share) if (0.0..=1.0).contains(share) => Ok(share * last),
            AxisPosition::Share(share) => Err(format!("{share} is no share of the axis {}, 0 to 1", self.names[0])),
            AxisPosition::Voxel(voxel) if (0.0..=last).contains(voxel) => Ok(*voxel),
            AxisPosition::Voxel(voxel) => {
                Err(format!("#{voxel} is no voxel; the axis {} has #0 to #{last}", self.names[0]))
            }
            AxisPosition::Coordinate(at, unit) => self.check_unit(unit).and_then(|()| self.index(*at)),
        }
    }

    /// The voxels between the ends of a box.
    fn range(&self, Ends { from, to }: &Ends) -> std::result::Result<Range<usize>, String> {
        let is_coordinate = |end: &Option<AxisPosition>| matches!(end, Some(AxisPosition::Coordinate(..)));
        if !is_coordinate(from) && !is_coordinate(to) {
            let end = |end: &Option<AxisPosition>, open| end.as_ref().map_or(Ok(open), |place| self.end(place));
            return Ok(end(from, 0)?..end(to, self.at.len())?);
        }
        match (self.bound(from)?, self.bound(to)?) {
            (Some(from), Some(to)) => self.between(from, to),
            (from, to) => self.within(from.unwrap_or(f64::NEG_INFINITY), to.unwrap_or(f64::INFINITY)),
        }
    }

    /// The voxel at an end of a box that is no coordinate.
    fn end(&self, place: &AxisPosition) -> std::result::Result<usize, String> {
        match place {
            AxisPosition::Voxel(voxel) if *voxel >= 0.0 && voxel.fract() == 0.0 => Ok(*voxel as usize),
            AxisPosition::Voxel(voxel) => Err(format!("a box ends at whole voxels, not at #{voxel}")),
            AxisPosition::Share(share) if (0.0..=1.0).contains(share) => {
                Ok((share * self.at.len() as f64).round() as usize)
            }
            AxisPosition::Share(_) | AxisPosition::Coordinate(..) => self.voxel(place).map(|voxel| voxel as usize),
        }
    }

    /// The coordinate at an end of a box; `None` if the end is open.
    fn bound(&self, end: &Option<AxisPosition>) -> std::result::Result<Option<f64>, String> {
        match end {
            None => Ok(None),
            Some(AxisPosition::Coordinate(at, unit)) => self.check_unit(unit).map(|()| Some(*at)),
            Some(_) => Err("takes two coordinates, or two voxels or shares".into()),
        }
    }

    /// The voxels between two coordinates. Those of a turn may be a whole turn away, in one piece.
    fn between(&self, from: f64, to: f64) -> std::result::Result<Range<usize>, String> {
        let name = &self.names[0];
        let turns = self.unit.starts_with("degree");
        if from > to && turns && self.at.first() < self.at.last() {
            return Err(format!("{from} is above {to}: the lower end of the axis {name} comes first"));
        }
        let (from, to) = (from.min(to), from.max(to));
        let mut widest = self.within(from, to)?;
        for turn in if turns { vec![360.0, -360.0] } else { Vec::new() } {
            let other = self.within(from + turn, to + turn)?;
            let holds = |a: &Range<usize>, b: &Range<usize>| b.is_empty() || a.start <= b.start && b.end <= a.end;
            match (holds(&widest, &other), holds(&other, &widest)) {
                (true, _) => {}
                (_, true) => widest = other,
                _ => {
                    return Err(format!(
                        "{from} to {to} crosses the ends of the axis {name}: take its two sides one by one"
                    ));
                }
            }
        }
        Ok(widest)
    }

    /// The voxels whose coordinates are from `low` to `high`.
    fn within(&self, low: f64, high: f64) -> std::result::Result<Range<usize>, String> {
        /// Coordinates this near to an end are at it, as shares of the least step: single precision rounds them.
        const NEAR: f64 = 1e-2;
        let descends = self.at.first() > self.at.last();
        let steps = || self.at.windows(2).map(|pair| if descends { pair[0] - pair[1] } else { pair[1] - pair[0] });
        if !steps().all(|step| step > 0.0) {
            return Err(format!("the coordinates of the axis {} do not ascend; take voxels", self.names[0]));
        }
        let near = steps().reduce(f64::min).map_or(0.0, |step| NEAR * step);
        let (low, high) = (low - near, high + near);
        let before = |before: &dyn Fn(&f64) -> bool| self.at.partition_point(before);
        Ok(match descends {
            false => before(&|at| *at < low)..before(&|at| *at <= high),
            true => before(&|at| *at > high)..before(&|at| *at >= low),
        })
    }

    fn check_unit(&self, unit: &str) -> std::result::Result<(), String> {
        let metres = ["m", "meter", "meters", "metre", "metres"];
        let alike = metres.contains(&unit) && metres.contains(&self.unit.as_str());
        let degrees = ["deg", "degree", "degrees", "\u{b0}"].contains(&unit) && self.unit.starts_with("degree");
        if unit.is_empty() || unit == self.unit || alike || degrees {
            return Ok(());
        }
        let own = if self.unit.is_empty() { "has no unit".into() } else { format!("is in {}", self.unit) };
        Err(format!("'{unit}' is another unit: the axis {} {own}", self.names[0]))
    }

    /// The place of a coordinate, in voxels: linear between neighbours.
    fn index(&self, at: f64) -> std::result::Result<f64, String> {
        let name = &self.names[0];
        let ascends = self.at.windows(2).all(|pair| pair[0] < pair[1]);
        if !ascends && !self.at.windows(2).all(|pair| pair[0] > pair[1]) {
            return Err(format!("the coordinates of the axis {name} do not ascend; take a voxel like #0"));
        }
        let (first, last) = (self.at[0], self.at[self.at.len() - 1]);
        let turns = if self.unit.starts_with("degree") { [0.0, 360.0, -360.0] } else { [0.0; 3] };
        let within = |at: &f64| (first.min(last)..=first.max(last)).contains(at);
        let at = turns.into_iter().map(|turn| at + turn).find(within).unwrap_or(at);
        if !(first.min(last)..=first.max(last)).contains(&at) {
            let range = format!("{} to {} {}", first.min(last), first.max(last), self.unit);
            return Err(format!("{at} is beyond the axis {name}, which has {}", range.trim_end()));
        }
        let before = |own: &f64| if ascends { *own <= at } else { *own >= at };
        let low = self.at.partition_point(before).saturating_sub(1);
        let high = (low + 1).min(self.at.len() - 1);
        let share = if high == low { 0.0 } else { (at - self.at[low]) / (self.at[high] - self.at[low]) };
        Ok(low as f64 + share)
    }

    /// The coordinate of a place in voxels.
    fn coordinate(&self, voxel: f64) -> f64 {
        let low = (voxel.max(0.0) as usize).min(self.at.len() - 1);
        let high = (low + 1).min(self.at.len() - 1);
        let share = voxel - low as f64;
        if share == 0.0 { self.at[low] } else { self.at[low] + share * (self.at[high] - self.at[low]) }
    }
}

/// Whether an axis of an array has no coordinates, and only the spacing of one that has: its voxels are counted.
fn is_counted(description: &Description, grid: &Grid, along: usize) -> bool {
    let is_given = |along: usize| coordinates(description, along).is_some();
    let same = |other: usize| (grid.spacing[other] / grid.spacing[along] - 1.0).abs() < 1e-6;
    let is_array = description.orientation.is_none() && description.axes.iter().any(|a| a.role.voxels() == Some(along));
    is_array && !is_given(along) && (0..3).any(|other| is_given(other) && same(other))
}

/// A number without the digits that come from rounding.
fn without_rounding(v: f64) -> f64 {
    format!("{v:.12e}").parse().unwrap_or(v)
}

/// The names of an axis in a description, and its unit.
fn named(description: &Description, along: usize) -> (Vec<String>, String) {
    let Some(axis) = description.axes.iter().find(|axis| axis.role.voxels() == Some(along)) else {
        return Default::default();
    };
    let name = description.dimensions[axis.dimension as usize].name.clone();
    let own = description.variables.iter().find(|v| v.name == name && v.dimensions == [axis.dimension]);
    let attribute = |key| own.and_then(|own| attribute_text(&own.attributes, key));
    let unit = attribute("units").unwrap_or_default();
    (std::iter::once(name).chain(attribute("standard_name")).collect(), unit)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn axis(at: &[f64]) -> Axis {
        Axis { names: vec!["depth".into(), "z".into()], unit: "m".into(), at: at.to_vec(), sides: None }
    }

    #[test]
    fn axes_of_a_grid_have_its_unit() {
        let grid = Grid { spacing: [0.5, 2.0, 3.0], ..Grid::unit([3, 4, 5]) };
        let axes = Axes::new(&grid, Some("mm"), None);
        let titles = axes.labels().map(|axis| (axis.name, axis.unit, axis.at.last().copied()));
        let expected = [("x", 1.0), ("y", 6.0), ("z", 12.0)].map(|(name, at)| (name.into(), "mm".into(), Some(at)));
        assert_eq!(titles, expected);
        assert!(axes.compare(0, 2) && Axes::new(&grid, None, None).labels()[0].unit.is_empty());
    }

    #[test]
    fn boxes_end_at_voxels_shares_and_coordinates() {
        let (up, down) = (axis(&[0.0, 10.0, 50.0, 100.0]), axis(&[100.0, 50.0, 10.0, 0.0]));
        let range = |axis: &Axis, text: &str| text.parse().and_then(|ends| axis.range(&ends));
        for (text, ascending, descending) in [
            ("1:3", 1..3, 1..3),
            (":", 0..4, 0..4),
            ("50%:#4", 2..4, 2..4),
            ("@10:@50", 1..3, 1..3),
            ("@50:@10", 1..3, 1..3),
            ("@5m:@60m", 1..3, 1..3),
            ("@-10:@200", 0..4, 0..4),
            ("@11:", 2..4, 0..2), // from 11 on
            (":@11", 0..2, 2..4),
            ("@60:@70", 3..3, 1..1),
            ("@200:@300", 4..4, 0..0),
        ] {
            assert_eq!((range(&up, text), range(&down, text)), (Ok(ascending), Ok(descending)), "{text}");
        }
        for wrong in ["#1.5:", "120%:", "@5km:", "@-5s:", "@5:50%", "3:@50"] {
            assert!(range(&up, wrong).is_err(), "{wrong}");
        }
        assert_eq!(range(&axis(&[3.0]), "@5:@-5"), Ok(0..1));
        for odd in [[0.0, 100.0, 50.0], [f64::NAN, 1.0, 2.0], [1.0, 1.0, 2.0]] {
            assert!(range(&axis(&odd), ":@60").is_err_and(|what| what.contains("do not ascend")));
        }
        let singles: Vec<f64> = (400..500).map(|n| f64::from(n as f32 / 10.0)).collect();
        assert_eq!(range(&axis(&singles), "@40.1:@40.2"), Ok(1..3));
    }

    #[test]
    fn boxes_of_longitudes_may_be_a_turn_away() {
        let degrees = |first: f64| -> Axis {
            Axis { unit: "degrees_east".into(), ..axis(&(0..360).map(|n| first + f64::from(n)).collect::<Vec<_>>()) }
        };
        let range = |axis: &Axis, text: &str| text.parse().and_then(|ends| axis.range(&ends));
        let (positive, signed, centres) = (degrees(0.0), degrees(-180.0), degrees(0.5));
        assert_eq!(range(&positive, "@0:@360"), Ok(0..360));
        assert_eq!(range(&positive, "@-20:@-10"), Ok(340..351));
        assert_eq!(range(&signed, "@-180:@180"), Ok(0..360));
        assert_eq!(range(&signed, "@190:@200"), Ok(10..21));
        assert_eq!(range(&centres, "@-30:@0"), Ok(330..360));
        for crossing in ["@-180:@180", "@-10:@355", "@-100:@100", "@350:@370"] {
            assert!(range(&positive, crossing).is_err_and(|what| what.contains("crosses")), "{crossing}");
        }
        assert!(range(&positive, "@350:@10").is_err_and(|what| what.contains("comes first")));
    }

    #[test]
    fn coordinates_are_interpolated_on_irregular_and_descending_axes() {
        let (up, down) = (axis(&[0.0, 10.0, 50.0]), axis(&[50.0, 10.0, 0.0]));
        for (at, voxel) in [(0.0, 0.0), (5.0, 0.5), (10.0, 1.0), (20.0, 1.25), (50.0, 2.0)] {
            assert_eq!((up.index(at), down.index(at)), (Ok(voxel), Ok(2.0 - voxel)));
            assert_eq!((up.coordinate(voxel), down.coordinate(2.0 - voxel)), (at, at));
        }
        let beyond = up.index(50.5).expect_err("beyond");
        assert!(["50.5", "depth", "0 to 50 m"].iter().all(|word| beyond.contains(word)), "{beyond}");
        assert!(axis(&[0.0, 2.0, 1.0]).index(1.0).is_err());
        assert_eq!(axis(&[3.0]).index(3.0), Ok(0.0));
        let mut lon = axis(&[350.0, 355.0, 0.0, 5.0]);
        unwrap_degrees(&mut lon.at);
        lon.unit = "degrees_east".into();
        for (at, voxel) in [(350.0, 0.0), (-5.0, 1.0), (2.5, 2.5), (362.5, 2.5)] {
            assert_eq!(lon.index(at), Ok(voxel));
        }
        assert!(lon.index(10.0).is_err() && lon.at[3] == 365.0);
        assert!(up.check_unit("metres").is_ok() && up.check_unit("km").is_err());
    }
}
