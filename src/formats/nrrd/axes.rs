//! What the axes of a NRRD count, and where they lie in the world.

use super::header::{NrrdHeader, vectors};
use crate::shared::directions::Directions;
use crate::shared::words::{list, numbers};
use wavesplat_core::source::Parsed;
use wavesplat_core::source::file_header::Units;

/// The axes of an array, numbered from the fastest as in the file.
#[derive(Debug)]
pub(super) struct Axes {
    pub(super) sizes: Vec<usize>,
    /// The axes of x, y, z.
    pub(super) voxels: [usize; 3],
    /// The axis of frames.
    pub(super) frames: Option<usize>,
    /// The axis that holds the components of a voxel.
    pub(super) components: Option<usize>,
    /// The step along each axis in the world, if the file states it; `None` for an axis that is not in space.
    directions: Option<Vec<Option<Vec<f64>>>>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum AxisKind {
    Voxels,
    Frames,
    Components,
}

impl Axes {
    pub(super) fn parse(header: &NrrdHeader) -> Parsed<Self> {
        let axes: usize = header.required("dimension")?.parse().map_err(|_| "dimension is no number")?;
        if !(3..=5).contains(&axes) {
            return Err(format!(
                "has {axes} dimension(s); supported are x y z, with time, with components, in any order"
            ));
        }
        let sizes: Vec<usize> = numbers(header.required("sizes")?, "sizes", axes)?;
        let directions = header.get("spacedirections").map(vectors).transpose()?;
        if let Some(found) = directions.as_ref().map(Vec::len).filter(|found| *found != axes) {
            return Err(format!("space directions must be {axes} vectors or none, not {found}"));
        }
        let counts = counts(header, axes, directions.as_deref())?;
        let numbers_of = |kind| (0..axes).filter(|axis| counts[*axis] == kind).collect::<Vec<_>>();
        let (voxels, frames, components) =
            (numbers_of(AxisKind::Voxels), numbers_of(AxisKind::Frames), numbers_of(AxisKind::Components));
        let (&[x, y, z], [] | [_], [] | [_]) = (&voxels[..], &frames[..], &components[..]) else {
            let found =
                format!("{} of space, {} of frames, {} of components", voxels.len(), frames.len(), components.len());
            return Err(format!("has axes {found}; three of space and at most one of each other are supported"));
        };
        let [frames, components] = [frames, components].map(|of| of.first().copied());
        Ok(Self { sizes, voxels: [x, y, z], frames, components, directions })
    }

    /// The length of an axis; 1 if there is no such axis.
    pub(super) fn len(&self, axis: Option<usize>) -> usize {
        axis.map_or(1, |axis| self.sizes[axis])
    }

    /// Where voxels are in the world.
    pub(super) fn placed(&self, header: &NrrdHeader) -> Parsed<Directions> {
        let steps = self.steps(header)?;
        if let Some(text) = header.get("spaceorigin") {
            let origin = vectors(text)?.into_iter().next().flatten().ok_or("space origin is no vector")?;
            return Ok(Directions::from_steps(steps, [origin[0], origin[1], origin[2]]));
        }
        let mins = per_axis(header, "axismins")?;
        let centers = header.get("centerings").or(header.get("centers")).unwrap_or_default().to_lowercase();
        let centers: Vec<&str> = centers.split_whitespace().collect();
        let first = std::array::from_fn(|a| {
            let axis = self.voxels[a];
            let half = if centers.get(axis) == Some(&"cell") { steps[a][a] / 2.0 } else { 0.0 };
            mins.get(axis).filter(|min| min.is_finite()).map_or(0.0, |min| min + half)
        });
        Ok(Directions::from_steps(steps, first))
    }

    fn steps(&self, header: &NrrdHeader) -> Parsed<[[f64; 3]; 3]> {
        let spacings = per_axis(header, "spacings")?;
        let mut steps = [[0.0; 3]; 3];
        for (a, (step, axis)) in steps.iter_mut().zip(self.voxels).enumerate() {
            match self.directions.as_ref().map(|all| &all[axis]) {
                Some(Some(vector)) => *step = [vector[0], vector[1], vector[2]],
                _ => step[a] = spacings.get(axis).copied().filter(|s| !s.is_nan()).unwrap_or(1.0),
            }
        }
        Ok(steps)
    }

    /// Times where the axis of frames has a step.
    pub(super) fn times(&self, header: &NrrdHeader) -> Parsed<Vec<f64>> {
        let Some(axis) = self.frames else { return Ok(Vec::new()) };
        let finite = |n: Option<f64>| n.filter(|n| n.is_finite());
        let along = |field| per_axis(header, field).map(|all| finite(all.get(axis).copied()));
        let fourth = |vector: &[f64]| finite(vector.get(3).copied());
        let direction = self.directions.as_ref().and_then(|all| fourth(all[axis].as_ref()?));
        let Some(step) = along("spacings")?.or(direction) else { return Ok(Vec::new()) };
        let origin = header.get("spaceorigin").map(vectors).transpose()?.unwrap_or_default();
        let origin = origin.first().and_then(|vector| fourth(vector.as_ref()?));
        let first = along("axismins")?.or(origin).unwrap_or(0.0);
        Ok((0..self.sizes[axis]).map(|i| first + step * i as f64).collect())
    }

    /// Units of the axes, and of samples.
    pub(super) fn units(&self, header: &NrrdHeader) -> Units {
        let words = |field| quoted(header.get(field).unwrap_or_default());
        let (all, space) = (words("units"), words("spaceunits"));
        let known = |unit: Option<&String>| unit.filter(|u| !matches!(u.as_str(), "" | "???" | "none")).cloned();
        let first = known(space.first()).or(known(all.get(self.voxels[0])));
        let same = |a: usize| known(space.get(a)).or(known(all.get(self.voxels[a]))) == first;
        Units {
            samples: known(words("sampleunits").first()),
            times: self.frames.and_then(|axis| known(all.get(axis)).or(known(space.get(3)))),
            space: first.clone().filter(|_| same(1) && same(2)),
            calendar: None,
        }
    }
}

/// What each axis counts, by its kind and by whether it has a direction; where that says too little, x, y, z come
/// first.
fn counts(header: &NrrdHeader, axes: usize, directions: Option<&[Option<Vec<f64>>]>) -> Parsed<Vec<AxisKind>> {
    let kinds: Vec<String> =
        header.get("kinds").unwrap_or_default().split_whitespace().map(str::to_lowercase).collect();
    let mut counts = Vec::new();
    for axis in 0..axes {
        let aside = directions.is_some_and(|all| all[axis].is_none());
        let kind = kinds.get(axis).map_or("???", String::as_str);
        counts.push(match kind {
            "time" | "list" => AxisKind::Frames,
            "domain" | "space" | "none" | "???" if aside => AxisKind::Frames,
            "domain" | "space" | "none" | "???" => AxisKind::Voxels,
            _ if is_component(kind) => AxisKind::Components,
            _ => return Err(format!("axis {axis} is of kind {kind}, which is not known")),
        });
    }
    let many = counts.iter().filter(|c| **c == AxisKind::Voxels).count() > 3 && !counts.contains(&AxisKind::Frames);
    if let Some(slowest) = counts.iter().rposition(|c| many && *c == AxisKind::Voxels) {
        counts[slowest] = AxisKind::Frames;
    }
    Ok(counts)
}

/// Kinds of axes along which a voxel has several samples.
fn is_component(kind: &str) -> bool {
    let ends = ["vector", "color", "normal", "gradient", "matrix"];
    matches!(kind, "point" | "stub" | "scalar" | "complex" | "quaternion") || ends.iter().any(|end| kind.ends_with(end))
}

/// A number for each axis, or none at all.
fn per_axis(header: &NrrdHeader, field: &str) -> Parsed<Vec<f64>> {
    let name = if field == "axismins" { "axis mins" } else { field };
    list(header.get(field).unwrap_or_default(), name)
}

/// Words that may be in quotes.
fn quoted(text: &str) -> Vec<String> {
    if text.contains('"') {
        return text.split('"').skip(1).step_by(2).map(|word| word.trim().to_string()).collect();
    }
    text.split_whitespace().map(String::from).collect()
}
