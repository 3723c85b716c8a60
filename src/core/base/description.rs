//! The [`Description`] of a source: its part for some frames and voxels, and those of several
//! sources one after another in time.

pub use wavesplat_format::{
    ArrayAxis, Attribute, AxisRole, Description, Dimension, NumberType, Numbers, Orientation, Values, Variable,
};

use crate::base::grid::Region;

/// The attribute with the header of a NIfTI file, as it was.
pub const NIFTI_HEADER: &str = "_nifti_header";

/// The world of NIfTI: x to the right of a patient, y to the front, z to the head.
pub const RAS: &str = "right-anterior-superior";

/// The world of ITK and DICOM: x to the left of a patient, y to the back, z to the head.
pub const LPS: &str = "left-posterior-superior";

/// The items of a dimension that are kept, in order.
type Kept = Option<Vec<usize>>;

/// The description of some frames, by number, and of the voxels of a region on the lattice of every `step`-th voxel.
///
/// Frames and voxels are those of the description's axes, with reversed axes turned: voxel 0 is the one at the low end.
pub fn narrowed(description: &Description, frames: &[usize], region: &Region, step: usize) -> Description {
    let mut narrow = description.clone();
    let mut kept: Vec<Kept> = vec![None; description.dimensions.len()];
    for axis in &description.axes {
        let length = description.dimensions[axis.dimension as usize].length as usize;
        let items: Vec<usize> = match axis.role.voxels() {
            Some(along) => {
                let voxels = (region.start[along]..region.end[along]).map(|voxel| voxel * step);
                if axis.reversed { voxels.rev().map(|voxel| length - 1 - voxel).collect() } else { voxels.collect() }
            }
            None if axis.role == AxisRole::Frames => frames.to_vec(),
            None => continue,
        };
        move_first(&mut narrow, description, axis, items.first().copied().unwrap_or(0), step);
        narrow.dimensions[axis.dimension as usize].length = items.len() as u64;
        kept[axis.dimension as usize] = Some(items);
    }
    for variable in &mut narrow.variables {
        variable.values = taken(&variable.values, &variable.dimensions, description, &kept);
    }
    narrow
}

/// Moves the first voxel to `index` along an axis of the array, and multiplies the step along this axis by `longer`.
fn move_first(narrow: &mut Description, description: &Description, axis: &ArrayAxis, index: usize, longer: usize) {
    let voxels = description.axes.iter().rev().filter(|axis| axis.role.voxels().is_some());
    let (Some(place), Some(orientation)) = (voxels.clone().position(|other| other == axis), &mut narrow.orientation)
    else {
        return;
    };
    let (direction, spacing) = (orientation.directions[place], orientation.spacing[place]);
    (0..3).for_each(|a| orientation.first[a] += direction[a] * spacing * index as f64);
    orientation.spacing[place] *= longer as f64;
}

/// The values at the kept items of each dimension.
fn taken(values: &Values, dimensions: &[u32], description: &Description, kept: &[Kept]) -> Values {
    if dimensions.iter().all(|dimension| kept[*dimension as usize].is_none()) {
        return values.clone();
    }
    let lengths: Vec<usize> = dimensions.iter().map(|d| description.dimensions[*d as usize].length as usize).collect();
    let kept: Vec<Kept> = dimensions.iter().map(|dimension| kept[*dimension as usize].clone()).collect();
    select(values, &lengths, &kept)
}

/// The values of an array of these lengths, the last axis fastest, at the kept items of each axis.
pub fn select(values: &Values, lengths: &[usize], kept: &[Kept]) -> Values {
    let places = places(lengths, kept.iter());
    match values {
        Values::Times(ty) => Values::Times(*ty),
        Values::Texts(texts) => Values::Texts(places.into_iter().map(|place| texts[place].clone()).collect()),
        Values::Numbers(numbers) => {
            let (bytes, size) = (numbers.bytes(), numbers.ty.size());
            let of = |place: usize| &bytes[place * size..(place + 1) * size];
            Values::Numbers(Numbers::new(numbers.ty, &places.into_iter().flat_map(of).copied().collect::<Vec<u8>>()))
        }
    }
}

/// Flat indices of the kept items in an array of these lengths, the last axis fastest.
fn places<'a>(lengths: &[usize], kept: impl Iterator<Item = &'a Kept>) -> Vec<usize> {
    lengths.iter().zip(kept).fold(vec![0], |places, (length, kept)| {
        let along = |place: usize| match kept {
            Some(items) => items.iter().map(|item| place * length + item).collect::<Vec<_>>(),
            None => (0..*length).map(|item| place * length + item).collect(),
        };
        places.into_iter().flat_map(along).collect()
    })
}

/// Joins descriptions in time: values along time follow each other, and everything else is taken from `first`. Leaves
/// out variables along time that one of them lacks or has in another form, and the largest ones if together they would be
/// too large for a file, and returns their names.
pub fn joined(mut first: Description, more: &[Description]) -> (Description, Vec<String>) {
    let Some(time) = frames_of(&first) else { return (first, Vec::new()) };
    let (mut lost, mut kept) = (Vec::new(), Vec::new());
    for mut variable in std::mem::take(&mut first.variables) {
        let is_along_time = variable.dimensions.contains(&time);
        match if is_along_time { appended(&variable, &first, more) } else { Some(variable.values.clone()) } {
            Some(values) => variable.values = values,
            None => {
                lost.push(variable.name);
                continue;
            }
        }
        kept.push(variable);
    }
    let frames = |other: &Description| frames_of(other).map_or(0, |time| other.dimensions[time as usize].length);
    first.dimensions[time as usize].length += more.iter().map(frames).sum::<u64>();
    first.variables = kept;
    while first.check_size().is_err()
        && let Some(at) = largest_along_time(&first)
    {
        lost.push(first.variables.remove(at).name);
    }
    (first, lost)
}

/// The variable along time and other axes that has the most values.
fn largest_along_time(all: &Description) -> Option<usize> {
    let time = frames_of(all)?;
    let count = |variable: &Variable| match &variable.values {
        Values::Numbers(numbers) => numbers.count(),
        Values::Texts(texts) => texts.len(),
        Values::Times(_) => 0,
    };
    let is_along =
        |at: &usize| all.variables[*at].dimensions.len() > 1 && all.variables[*at].dimensions.contains(&time);
    (0..all.variables.len()).filter(is_along).max_by_key(|at| count(&all.variables[*at]))
}

/// Extends a description to `frames` frames, without knowing values for the added ones. Leaves out the variables along
/// time, except those that hold the times, and returns the names of those left out.
pub fn extended(mut all: Description, frames: u64) -> (Description, Vec<String>) {
    let mut lost = Vec::new();
    let Some(time) = frames_of(&all) else { return (all, lost) };
    all.dimensions[time as usize].length = frames;
    let is_lost =
        |variable: &Variable| variable.dimensions.contains(&time) && !matches!(variable.values, Values::Times(_));
    lost.extend(all.variables.iter().filter(|variable| is_lost(variable)).map(|variable| variable.name.clone()));
    all.variables.retain(|variable| !is_lost(variable));
    (all, lost)
}

/// Adds a slowest axis of `frames` frames to a description that has no axis of frames. The axis is named after the
/// variable that holds the times.
pub fn with_frames(mut description: Description, frames: usize) -> Description {
    if frames_of(&description).is_some() {
        return description;
    }
    let dimension = description.dimensions.len() as u32;
    let mut times: Vec<_> =
        description.variables.iter_mut().filter(|variable| matches!(variable.values, Values::Times(_))).collect();
    times.iter_mut().for_each(|variable| variable.dimensions = vec![dimension]);
    let name = times.first().map_or("time".into(), |variable| variable.name.clone());
    description.dimensions.push(Dimension { name, length: frames as u64, unlimited: false });
    description.axes.insert(0, ArrayAxis { dimension, role: AxisRole::Frames, reversed: false });
    description
}

/// Whether its axes are as long as those of an archive with these voxels and frames.
pub fn is_of(description: &Description, dims: [usize; 3], frames: usize) -> bool {
    description.axes.iter().all(|axis| {
        let expected = match (axis.role, axis.role.voxels()) {
            (AxisRole::Frames, _) => frames,
            (_, Some(along)) => dims[along],
            (_, None) => 1,
        };
        description.dimensions[axis.dimension as usize].length == expected as u64
    })
}

/// The dimension of frames.
pub fn frames_of(description: &Description) -> Option<u32> {
    description.axes.iter().find(|axis| axis.role == AxisRole::Frames).map(|axis| axis.dimension)
}

/// Concatenates the values of a variable with those of the same variable in each of `more`. Frames must be its slowest
/// axis in all of them; `None` if the values cannot be joined.
fn appended(variable: &Variable, of: &Description, more: &[Description]) -> Option<Values> {
    let mut all = Appender::new(&variable.values);
    let shape = shape_after_time(variable, of)?;
    for next in more {
        let other = next.variables.iter().find(|other| other.name == variable.name)?;
        let is_alike = shape_after_time(other, next)? == shape;
        all.push(Some(&other.values).filter(|_| is_alike)?)?;
    }
    Some(all.values())
}

/// The lengths of the faster dimensions of a variable whose slowest one is that of frames.
fn shape_after_time(variable: &Variable, of: &Description) -> Option<Vec<u64>> {
    let (first, rest) = variable.dimensions.split_first()?;
    let lengths = rest.iter().map(|dimension| of.dimensions[*dimension as usize].length).collect();
    (Some(*first) == frames_of(of)).then_some(lengths)
}

/// Values that grow.
enum Appender {
    Texts(Vec<String>),
    Numbers(NumberType, Vec<u8>),
    Times(NumberType),
}

impl Appender {
    fn new(first: &Values) -> Self {
        match first {
            Values::Texts(texts) => Self::Texts(texts.clone()),
            Values::Numbers(numbers) => Self::Numbers(numbers.ty, numbers.bytes()),
            Values::Times(ty) => Self::Times(*ty),
        }
    }

    /// None for values of another kind or type.
    fn push(&mut self, next: &Values) -> Option<()> {
        match (self, next) {
            (Self::Texts(all), Values::Texts(texts)) => all.extend_from_slice(texts),
            (Self::Numbers(ty, all), Values::Numbers(numbers)) if *ty == numbers.ty => all.extend(numbers.bytes()),
            (Self::Times(_), Values::Times(_)) => {}
            _ => return None,
        }
        Some(())
    }

    fn values(self) -> Values {
        match self {
            Self::Texts(texts) => Values::Texts(texts),
            Self::Numbers(ty, bytes) => Values::Numbers(Numbers::new(ty, &bytes)),
            Self::Times(ty) => Values::Times(ty),
        }
    }
}

/// The coordinates of an axis of voxels at its low end first: those of the variable with the name of its dimension. None
/// if the source has none, or they are no numbers.
pub fn coordinates(description: &Description, along: usize) -> Option<Vec<f64>> {
    let axis = description.axes.iter().find(|axis| axis.role.voxels() == Some(along))?;
    let name = &description.dimensions[axis.dimension as usize].name;
    let own = |variable: &&Variable| variable.name == *name && variable.dimensions == [axis.dimension];
    let variable = description.variables.iter().find(own)?;
    let Values::Numbers(numbers) = &variable.values else { return None };
    let mut at = unpacked(numbers.to_f64(), |name| first_number(&variable.attributes, name));
    if axis.reversed {
        at.reverse();
    }
    Some(at)
}

/// The coordinates that stored numbers stand for, by the attributes of the NetCDF conventions.
pub fn unpacked(stored: Vec<f64>, attribute: impl Fn(&str) -> Option<f64>) -> Vec<f64> {
    let (scale, offset) = (attribute("scale_factor"), attribute("add_offset"));
    if scale.is_none() && offset.is_none() {
        return stored;
    }
    let (scale, offset) = (scale.unwrap_or(1.0), offset.unwrap_or(0.0));
    stored.into_iter().map(|number| number * scale + offset).collect()
}

/// The first number of an attribute.
fn first_number(attributes: &[Attribute], name: &str) -> Option<f64> {
    match &attributes.iter().find(|attribute| attribute.name == name)?.value {
        Values::Numbers(numbers) => numbers.to_f64().first().copied(),
        _ => None,
    }
}

/// Names the axes of voxels x, y and z, and adds the coordinates along each of them, in the order in which they are stored.
pub fn with_coordinates(mut description: Description, at: &[Vec<f64>; 3]) -> Description {
    for axis in description.axes.clone() {
        let Some(along) = axis.role.voxels() else { continue };
        let (name, values) = (["x", "y", "z"][along].to_string(), Values::floats(&at[along]));
        description.dimensions[axis.dimension as usize].name.clone_from(&name);
        description.variables.push(Variable { name, dimensions: vec![axis.dimension], values, attributes: Vec::new() });
    }
    description
}

/// The sides of a patient that the first and the last voxel along an axis lie towards: L, R, A, P, S or I. `None` unless the source says so, and
/// for axes between two sides.
pub fn sides(description: &Description, along: usize) -> Option<[char; 2]> {
    /// The least part of a direction along an axis of the world: 37 degrees from it.
    const MAIN: f64 = 0.8;
    let orientation = description.orientation.as_ref().filter(|_| !lacks_orientation(description))?;
    let mut voxels = description.axes.iter().rev().filter(|axis| axis.role.voxels().is_some()).enumerate();
    let (place, axis) = voxels.find(|(_, axis)| axis.role.voxels() == Some(along))?;
    let (direction, reversed) = (orientation.directions.get(place)?, axis.reversed);
    let length = direction.iter().map(|part| part * part).sum::<f64>().sqrt();
    let main = (0..3).find(|a| direction[*a].abs() >= MAIN * length && length > 0.0)?;
    let [low, high] = match orientation.space.split('-').nth(main)?.to_lowercase().as_str() {
        "right" => ['L', 'R'],
        "left" => ['R', 'L'],
        "anterior" => ['P', 'A'],
        "posterior" => ['A', 'P'],
        "superior" => ['I', 'S'],
        "inferior" => ['S', 'I'],
        _ => return None,
    };
    let ascends = (orientation.spacing[place] * direction[main] > 0.0) != reversed;
    Some(if ascends { [low, high] } else { [high, low] })
}

/// Whether a NIfTI header has neither of its two transforms, so that the directions of its axes are made up.
fn lacks_orientation(description: &Description) -> bool {
    let header = description.attributes.iter().find(|attribute| attribute.name == NIFTI_HEADER);
    let Some(Values::Numbers(numbers)) = header.map(|attribute| &attribute.value) else { return false };
    let bytes = numbers.bytes();
    let codes = if bytes.len() < 540 { 252..256 } else { 344..352 }; // of versions 1 and 2
    bytes.get(codes).is_some_and(|codes| codes.iter().all(|byte| *byte == 0))
}

/// Adds whole turns where longitudes jump back by most of one.
pub fn unwrap_degrees(at: &mut [f64]) {
    for i in 1..at.len() {
        if at[i] < at[i - 1] - 180.0 {
            at[i..].iter_mut().for_each(|v| *v += 360.0);
        }
    }
}

/// Whether coordinates are as far apart as each other, but for rounding to single precision.
pub fn is_regular(at: &[f64]) -> bool {
    let [first, .., last] = at else { return true };
    let step = (last - first) / (at.len() - 1) as f64;
    let is_near = |(i, at): (usize, &f64)| (first + step * i as f64 - at).abs() <= REGULAR * step.abs();
    at.iter().enumerate().all(is_near)
}

/// The largest deviation of regular coordinates from equal steps, in steps.
const REGULAR: f64 = 1e-2;

#[cfg(test)]
mod tests {
    use super::*;

    /// Axes (time 2, y 3 reversed, x 2) with a coordinate of each, a field over y and x and bounds of times.
    fn description(first_time: f64) -> Description {
        let dimension = |(name, length): (&str, u64)| Dimension { name: name.into(), length, unlimited: false };
        let axis = |(dimension, role)| ArrayAxis { dimension, role, reversed: role == AxisRole::Y };
        let variable = |name: &str, dimensions: &[u32], values| Variable {
            name: name.into(),
            dimensions: dimensions.to_vec(),
            values,
            attributes: Vec::new(),
        };
        Description {
            dimensions: [("time", 2), ("y", 3), ("x", 2), ("nv", 2)].map(dimension).into(),
            axes: [(0, AxisRole::Frames), (1, AxisRole::Y), (2, AxisRole::X)].map(axis).into(),
            variables: vec![
                variable("time", &[0], Values::Times(NumberType::F64)),
                variable("bounds", &[0, 3], Values::floats(&[0.0, 1.0, 1.0, 2.0].map(|t| t + first_time))),
                variable("y", &[1], Values::floats(&[30.0, 20.0, 10.0])),
                variable("lat", &[1, 2], Values::floats(&[31.0, 32.0, 21.0, 22.0, 11.0, 12.0])),
                variable("name", &[1], Values::Texts(["c", "b", "a"].map(String::from).into())),
            ],
            orientation: Some(Orientation {
                space: "RAS".into(),
                first: [5.0; 3],
                directions: [[1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0; 3]],
                spacing: [1.0, 2.0, 1.0],
            }),
            ..Description::default()
        }
    }

    fn floats(description: &Description, name: &str) -> Vec<f64> {
        match &description.variables.iter().find(|variable| variable.name == name).expect("held").values {
            Values::Numbers(numbers) => numbers.to_f64(),
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn sides_follow_the_directions_of_voxels() {
        let axis = |along: usize, reversed| ArrayAxis {
            dimension: along as u32,
            role: [AxisRole::X, AxisRole::Y, AxisRole::Z][along],
            reversed,
        };
        let orientation = |space: &str, directions| {
            Some(Orientation { space: space.into(), first: [0.0; 3], directions, spacing: [2.0; 3] })
        };
        // The axes of the array are z, y, x: the fastest last, whose direction comes first.
        let of = |space: &str, directions, reversed| Description {
            axes: vec![axis(2, false), axis(1, reversed), axis(0, false)],
            orientation: orientation(space, directions),
            ..Description::default()
        };
        let straight = [[-1.0, 0.0, 0.0], [0.0, 0.9, 0.1], [0.0, 0.0, 1.0]];
        let all = |of: &Description| [0, 1, 2].map(|along| sides(of, along));
        let text =
            |found: [Option<[char; 2]>; 3]| found.map(|pair| pair.map_or(String::new(), String::from_iter)).join(" ");
        assert_eq!(text(all(&of(RAS, straight, false))), "RL PA IS");
        assert_eq!(text(all(&of(LPS, straight, true))), "LR PA IS");
        assert_eq!(text(all(&of("scanner-xyz", straight, false))), "  ");
        assert_eq!(text(all(&of(RAS, [[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, -1.0, 0.0]], false))), "IS LR AP");
        assert_eq!(text(all(&of(RAS, [[0.7, 0.7, 0.0], [0.0; 3], [f64::NAN; 3]], false))), "  ");
    }

    #[test]
    fn reversed_axes_are_narrowed_in_the_source() {
        let region = Region { start: [1, 0, 0], end: [2, 2, 1] };
        let narrow = narrowed(&description(0.0), &[1], &region, 1);
        assert_eq!(narrow.dimensions.iter().map(|d| d.length).collect::<Vec<_>>(), [1, 2, 1, 2]);
        assert_eq!((floats(&narrow, "y"), floats(&narrow, "lat")), (vec![20.0, 10.0], vec![22.0, 12.0]));
        assert_eq!((floats(&narrow, "bounds"), coordinates(&narrow, 1)), (vec![1.0, 2.0], Some(vec![10.0, 20.0])));
        assert_eq!(narrow.orientation.as_ref().expect("kept").first, [6.0, 3.0, 5.0]);
        let name = narrow.variables.iter().find(|variable| variable.name == "name").expect("held");
        assert_eq!(name.values, Values::Texts(["b", "a"].map(String::from).into()));
        assert_eq!(coordinates(&narrow, 0), None);
        let every = narrowed(&description(0.0), &[0], &Region { start: [0; 3], end: [1, 2, 1] }, 2);
        assert_eq!((floats(&every, "y"), every.orientation.expect("kept").spacing[1]), (vec![30.0, 10.0], 4.0));
    }

    #[test]
    fn axes_are_compared_with_those_of_an_archive() {
        let (all, turned) = (description(0.0), [2, 3, 1]);
        assert!(is_of(&all, turned, 2) && !is_of(&all, turned, 3) && !is_of(&all, [3, 2, 1], 2));
    }

    #[test]
    fn frames_follow_each_other() {
        let (mut all, lost) = joined(description(0.0), &[description(2.0)]);
        assert_eq!((floats(&all, "bounds"), lost.len()), (vec![0.0, 1.0, 1.0, 2.0, 2.0, 3.0, 3.0, 4.0], 0));
        assert_eq!((all.dimensions[0].length, floats(&all, "y")), (4, vec![30.0, 20.0, 10.0]));
        all.variables.retain(|variable| variable.name != "bounds");
        let (without, lost) = joined(description(0.0), &[all]);
        assert_eq!((lost, without.variables.len()), (vec!["bounds".to_string()], 4));
    }
}
