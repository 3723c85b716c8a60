//! What the axes of a NRRD count, and where they lie in the world.

use super::header::NrrdHeader;
use crate::shared::directions::Directions;
use crate::shared::meaning::{Kind, Meaning};
use crate::shared::sequence::SequenceTimes;
use crate::shared::words::{list, numbers};
use wavesplat_core::source::file_header::Units;
use wavesplat_core::source::{Advised, Parsed};

/// The axes of an array, numbered from the fastest as in the file.
#[derive(Debug)]
pub(super) struct Axes {
    pub(super) meaning: Meaning,
    /// The axis of frames.
    pub(super) frames: Option<usize>,
    /// Whether time stamps alone say which axis this is.
    pub(super) is_stamped: bool,
    /// The step along each axis in the world, if the file states it; `None` for an axis that is not in space.
    directions: Option<Vec<Option<Vec<f64>>>>,
}

impl Axes {
    /// By the header, or by the user's letters, slowest first.
    pub(super) fn parse(header: &NrrdHeader, letters: Option<&str>) -> Advised<Self> {
        let axes: usize = header.required("dimension")?.parse().map_err(|_| "dimension is no number")?;
        if !(3..=5).contains(&axes) {
            let supported = "supported are x y z, with time, with components, in any order";
            return Err(format!("has {axes} dimension(s); {supported}").into());
        }
        let sizes: Vec<usize> = numbers(header.required("sizes")?, "sizes", axes)?;
        let directions = header.get("spacedirections").map(|text| header.vectors(text)).transpose()?;
        if let Some(found) = directions.as_ref().map(Vec::len).filter(|found| *found != axes) {
            return Err(format!("space directions must be {axes} vectors or none, not {found}").into());
        }
        let mut is_stamped = false;
        let meaning = match letters {
            Some(letters) => Meaning::by_letters(&sizes, letters)?,
            None => {
                let mut kinds = kinds(header, axes, directions.as_deref())?;
                is_stamped = take_sequence(header, &sizes, &mut kinds);
                number_voxels(&mut kinds);
                Meaning { sizes, kinds }
            }
        };
        let count = |kind: Kind| meaning.kinds.iter().filter(|known| **known == kind).count();
        let (voxels, frames, components) = (meaning.voxels().len(), count(Kind::Frames), count(Kind::Components));
        let is_known = matches!((voxels, frames, components), (3, 0 | 1, 0 | 1) | (2, 1, 0 | 1)) || letters.is_some();
        if !is_known {
            let found = format!("{voxels} of space, {frames} of frames, {components} of components");
            return Err(format!("has axes {found}; three of space and at most one of each other are supported").into());
        }
        let frames = meaning.frames();
        Ok(Self { meaning, frames, is_stamped, directions })
    }

    /// The length of an axis; 1 if there is no such axis.
    pub(super) fn len(&self, axis: Option<usize>) -> usize {
        self.meaning.len(axis)
    }

    /// Where voxels are in the world.
    pub(super) fn placed(&self, header: &NrrdHeader) -> Parsed<Directions> {
        let voxels = self.meaning.voxels();
        let steps = self.steps(header, &voxels)?;
        let first = self.first(header, &voxels, &steps)?;
        if let [a, b, c] = steps[..]
            && self.meaning.is_in_order()
        {
            return Ok(Directions::from_steps([a, b, c], first));
        }
        let step = |axis: usize| voxels.iter().position(|of| *of == axis).map(|a| steps[a]);
        Ok(self.meaning.directions(step, first))
    }

    /// World position of the first voxel.
    fn first(&self, header: &NrrdHeader, voxels: &[usize], steps: &[[f64; 3]]) -> Parsed<[f64; 3]> {
        if let Some(text) = header.get("spaceorigin") {
            let origin = header.vectors(text)?.into_iter().next().flatten().ok_or("space origin is no vector")?;
            return Ok([origin[0], origin[1], origin[2]]);
        }
        let mins = per_axis(header, "axismins")?;
        let centers = header.get("centerings").or(header.get("centers")).unwrap_or_default().to_lowercase();
        let centers: Vec<&str> = centers.split_whitespace().collect();
        let mut first = [0.0; 3];
        for (a, axis) in voxels.iter().enumerate() {
            let half = if centers.get(*axis) == Some(&"cell") { steps[a][a] / 2.0 } else { 0.0 };
            first[a] = mins.get(*axis).filter(|min| min.is_finite()).map_or(0.0, |min| min + half);
        }
        Ok(first)
    }

    fn steps(&self, header: &NrrdHeader, voxels: &[usize]) -> Parsed<Vec<[f64; 3]>> {
        let spacings = per_axis(header, "spacings")?;
        let mut steps = vec![[0.0; 3]; voxels.len()];
        for (a, (step, axis)) in steps.iter_mut().zip(voxels).enumerate() {
            match self.directions.as_ref().map(|all| &all[*axis]) {
                Some(Some(vector)) => *step = [vector[0], vector[1], vector[2]],
                _ => step[a] = spacings.get(*axis).copied().filter(|s| !s.is_nan()).unwrap_or(1.0),
            }
        }
        Ok(steps)
    }

    /// Times that are written beside the samples.
    pub(super) fn sequence(&self, header: &NrrdHeader) -> Option<SequenceTimes> {
        self.frames.and_then(|axis| header.sequence(axis, self.len(Some(axis))))
    }

    /// Times where the axis of frames has a step.
    pub(super) fn times(&self, header: &NrrdHeader) -> Parsed<Vec<f64>> {
        let Some(axis) = self.frames else { return Ok(Vec::new()) };
        if let Some(sequence) = self.sequence(header) {
            return Ok(sequence.times);
        }
        let finite = |n: Option<f64>| n.filter(|n| n.is_finite());
        let along = |field| per_axis(header, field).map(|all| finite(all.get(axis).copied()));
        let fourth = |vector: &[f64]| finite(vector.get(3).copied());
        let direction = self.directions.as_ref().and_then(|all| fourth(all[axis].as_ref()?));
        let Some(step) = along("spacings")?.or(direction) else { return Ok(Vec::new()) };
        let origin = header.get("spaceorigin").map(|text| header.vectors(text)).transpose()?.unwrap_or_default();
        let origin = origin.first().and_then(|vector| fourth(vector.as_ref()?));
        let first = along("axismins")?.or(origin).unwrap_or(0.0);
        Ok((0..self.len(Some(axis))).map(|i| first + step * i as f64).collect())
    }

    /// Units of the axes, and of samples.
    pub(super) fn units(&self, header: &NrrdHeader) -> Units {
        let words = |field| quoted(header.get(field).unwrap_or_default());
        let (all, space) = (words("units"), words("spaceunits"));
        let known = |unit: Option<&String>| unit.filter(|u| !matches!(u.as_str(), "" | "???" | "none")).cloned();
        let of = |(a, axis): (usize, &usize)| known(space.get(a)).or(known(all.get(*axis)));
        let voxels: Vec<Option<String>> = self.meaning.voxels().iter().enumerate().map(of).collect();
        let own = self.frames.and_then(|axis| known(all.get(axis)).or(known(space.get(3))));
        Units {
            samples: known(words("sampleunits").first()),
            times: self.sequence(header).and_then(|sequence| sequence.unit).or(own),
            space: voxels.first().cloned().flatten().filter(|first| voxels.iter().all(|v| v.as_ref() == Some(first))),
            calendar: None,
        }
    }
}

/// What each axis counts, by its kind and by whether it has a direction; where that says too little, x, y, z come
/// first.
fn kinds(header: &NrrdHeader, axes: usize, directions: Option<&[Option<Vec<f64>>]>) -> Parsed<Vec<Kind>> {
    let words: Vec<String> =
        header.get("kinds").unwrap_or_default().split_whitespace().map(str::to_lowercase).collect();
    let mut kinds = Vec::new();
    for axis in 0..axes {
        let aside = directions.is_some_and(|all| all[axis].is_none());
        let kind = words.get(axis).map_or("???", String::as_str);
        kinds.push(match kind {
            "time" | "list" => Kind::Frames,
            "domain" | "space" | "none" | "???" if aside => Kind::Frames,
            "domain" | "space" | "none" | "???" => VOXELS,
            _ if is_component(kind) => Kind::Components,
            _ => return Err(format!("axis {axis} is of kind {kind}, which is not known")),
        });
    }
    let many = kinds.iter().filter(|kind| **kind == VOXELS).count() > 3 && !kinds.contains(&Kind::Frames);
    if let Some(slowest) = kinds.iter().rposition(|kind| many && *kind == VOXELS) {
        kinds[slowest] = Kind::Frames;
    }
    Ok(kinds)
}

/// An axis of voxels before it is known which.
const VOXELS: Kind = Kind::Voxels(0);

/// Numbers the axes of voxels as x, y, z.
fn number_voxels(kinds: &mut [Kind]) {
    let voxels = kinds.iter_mut().filter(|kind| **kind == VOXELS);
    voxels.enumerate().for_each(|(letter, kind)| *kind = Kind::Voxels(letter));
}

/// Takes components or planes as frames if they have times of their own. Says whether these are planes.
fn take_sequence(header: &NrrdHeader, sizes: &[usize], kinds: &mut [Kind]) -> bool {
    if kinds.contains(&Kind::Frames) {
        return false;
    }
    let is_timed = |axis: &usize| sizes[*axis] > 1 && header.sequence(*axis, sizes[*axis]).is_some();
    let components = kinds.iter().position(|kind| *kind == Kind::Components).filter(is_timed);
    let planes = kinds.iter().rposition(|kind| *kind == VOXELS).filter(is_timed);
    if let Some(axis) = components.or(planes) {
        kinds[axis] = Kind::Frames;
    }
    components.is_none() && planes.is_some()
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
