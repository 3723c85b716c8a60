//! The description of extracted samples, for the headers of all formats.

use super::order::{OutputAxis, SampleOrder};
use wavesplat_core::base::description::{Attribute, Description, Orientation, Values, coordinates, is_regular};
use wavesplat_core::base::grid::Grid;
use wavesplat_core::base::sample::SampleType;

/// The largest deviation of regular times from equal steps, in steps.
const REGULAR: f64 = 1e-6;

/// Voxels in the world, in the order in which they are written.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Lattice {
    /// Voxels along each axis, the fastest first.
    pub(super) dims: [usize; 3],
    /// World position of the first voxel.
    pub(super) first: [f64; 3],
    /// World direction of each axis, the fastest first; of any length.
    directions: [[f64; 3]; 3],
    /// A step along each axis is its direction times this.
    spacing: [f64; 3],
    /// The directions in which the world's axes ascend; empty if unknown.
    pub(super) space: String,
}

impl Lattice {
    /// The length of a step along each axis.
    pub(super) fn spacing(&self) -> [f64; 3] {
        std::array::from_fn(|axis| if self.is_unit(axis) { self.spacing[axis] } else { length(self.steps()[axis]) })
    }

    /// The directions of the axes, of length 1.
    pub(super) fn directions(&self) -> [[f64; 3]; 3] {
        let scaled = |axis: usize| self.directions[axis].map(|along| along / length(self.directions[axis]));
        std::array::from_fn(|axis| if self.is_unit(axis) { self.directions[axis] } else { scaled(axis) })
    }

    /// From a voxel to the next along each axis, the fastest first.
    pub(super) fn steps(&self) -> [[f64; 3]; 3] {
        std::array::from_fn(|axis| self.directions[axis].map(|along| along * self.spacing[axis]))
    }

    /// The lattice in a world that is `other`, or this one: those of ITK and NIfTI differ by the signs of x and y. A world
    /// without a name is taken as the wanted one.
    pub(super) fn turned_from(mut self, other: &str) -> Self {
        if self.space != other {
            return self;
        }
        for place in self.directions.iter_mut().chain([&mut self.first]) {
            (place[0], place[1]) = (-place[0], -place[1]);
        }
        self
    }

    /// Whether the direction of an axis has the length 1, but for rounding: then it is kept to the bit.
    fn is_unit(&self, axis: usize) -> bool {
        (length(self.directions[axis]) - 1.0).abs() < 1e-6
    }
}

fn length(vector: [f64; 3]) -> f64 {
    vector.iter().map(|along| along * along).sum::<f64>().sqrt()
}

/// A description of samples for the headers of files.
#[derive(Debug, Clone)]
pub struct Contents {
    /// The lattice of the voxels.
    pub grid: Grid,
    /// The type of the samples.
    pub sample: SampleType,
    /// The number of each frame in the coefficient file.
    pub frames: Vec<usize>,
    /// The time of each frame, or its number if the file has no times.
    pub times: Vec<f64>,
    /// Whether `times` are frame numbers.
    pub numbered: bool,
    /// The name of the variable. All texts here have no control characters.
    pub name: String,
    /// The unit of the samples.
    pub units: Option<String>,
    /// The unit of times.
    pub time_units: Option<String>,
    /// The calendar of times, if known.
    pub calendar: Option<String>,
    /// The unit of positions.
    pub space_units: Option<String>,
    /// The value of missing samples, if some may be missing: a number of the sample type, or NaN.
    pub missing: Option<f64>,
    /// The source's description of these frames and voxels; `None` for a channel of colours.
    pub description: Option<Description>,
}

impl Contents {
    /// Where the voxels of each frame are: in the order of the source's array if it says how its axes go in the world.
    pub(super) fn lattice(&self) -> Lattice {
        let described = self.description.as_ref().and_then(|all| Some((all, all.orientation.as_ref()?)));
        let Some((description, orientation)) = described else { return self.straight_lattice() };
        let Orientation { space, first, directions, spacing } = orientation.clone();
        let voxels = SampleOrder::of_lattice(description).axes().into_iter().rev().filter_map(OutputAxis::voxels);
        let mut lengths = voxels.map(|axis| self.grid.dims[axis]);
        Lattice { dims: std::array::from_fn(|_| lengths.next().unwrap_or(1)), first, directions, spacing, space }
    }

    /// The ascending coordinates of an axis of voxels, from the source or else from the lattice. Descending
    /// coordinates, such as depths, are negated.
    pub(super) fn coordinates(&self, axis: usize) -> Vec<f64> {
        let mut own = self.description.as_ref().and_then(|description| coordinates(description, axis));
        if let Some(at) = own.as_mut().filter(|at| at.last() < at.first()) {
            at.iter_mut().for_each(|at| *at = -*at);
        }
        own.unwrap_or_else(|| (0..self.grid.dims[axis]).map(|i| self.grid.position([i; 3])[axis]).collect())
    }

    /// The axes whose coordinates are not at regular steps.
    pub(super) fn irregular_axes(&self) -> Vec<&'static str> {
        let is_irregular = |axis: &usize| !is_regular(&self.coordinates(*axis));
        (0..3).filter(is_irregular).map(|axis| ["x", "y", "z"][axis]).collect()
    }

    /// Whether the source's axes go along those of the world, in any order and direction.
    pub(super) fn is_straight(&self) -> bool {
        let along = |step: &[f64; 3]| step.iter().filter(|along| **along != 0.0).count();
        self.lattice().directions.iter().all(|step| along(step) == 1)
    }

    /// The lattice with its axes along those of the world.
    pub(super) fn straight_lattice(&self) -> Lattice {
        let Grid { dims, spacing, origin } = self.grid;
        let along = |axis: usize| std::array::from_fn(|a| if a == axis { 1.0 } else { 0.0 });
        Lattice { dims, first: origin, directions: [0, 1, 2].map(along), spacing, space: String::new() }
    }

    /// The first time and the step between times, if all steps are equal; none of frames without times.
    pub(super) fn regular_times(&self) -> Option<(f64, f64)> {
        let [first, .., last] = self.times[..] else { return None };
        if self.numbered {
            return None;
        }
        let step = (last - first) / (self.times.len() - 1) as f64;
        let is_near = |(i, time): (usize, &f64)| (first + step * i as f64 - time).abs() <= REGULAR * step;
        (step > 0.0 && self.times.iter().enumerate().all(is_near)).then_some((first, step))
    }

    /// Names and texts that a source of a format has beside its samples.
    pub(super) fn texts_from(&self, format: &str) -> Vec<(String, String)> {
        let of_source = self.description.iter().filter(|description| description.source == format);
        let text = |attribute: &Attribute| match &attribute.value {
            Values::Texts(texts) => Some((plain(&attribute.name), plain(&texts.join(" ")))),
            Values::Numbers(_) | Values::Times(_) => None,
        };
        of_source.flat_map(|description| &description.global).filter_map(text).collect()
    }

    /// Whether the source is one of VTK's formats of XML.
    pub(super) fn is_from_vtk(&self) -> bool {
        self.description.as_ref().is_some_and(|description| description.source.starts_with("VTK"))
    }

    /// The number of samples in one frame.
    pub fn voxels(&self) -> u64 {
        self.grid.dims.iter().fold(1, |n: u64, dim| n.saturating_mul(*dim as u64))
    }
}

/// Text fit for one line of a header.
pub fn plain(text: &str) -> String {
    text.trim().chars().filter(|c| !c.is_control()).collect()
}

#[cfg(test)]
pub(super) mod testing {
    use super::*;

    /// Three frames of 5 x 4 x 3 voxels, with all units.
    pub(crate) fn contents() -> Contents {
        Contents {
            grid: Grid { dims: [5, 4, 3], spacing: [0.5, 2.0, 1.0], origin: [-1.0, 0.0, 7.5] },
            sample: SampleType::I16,
            frames: vec![2, 4, 6],
            times: vec![0.25, 0.5, 0.75],
            numbered: false,
            name: "a & \"b\"".into(),
            units: Some("<K>".into()),
            time_units: Some("s".into()),
            calendar: None,
            space_units: Some("mm".into()),
            missing: None,
            description: None,
        }
    }

    #[test]
    fn steps_of_times_are_all_the_same_or_none() {
        let regular = |times: &[f64]| Contents { times: times.to_vec(), ..contents() }.regular_times();
        assert_eq!(regular(&[0.25, 0.5, 0.75]), Some((0.25, 0.25)));
        assert_eq!(regular(&[0.0, 0.1, 0.2, 0.30000000000000004]).map(|(_, step)| (step * 1e9).round()), Some(1e8));
        for irregular in [&[0.0, 0.1, 0.3][..], &[3.0, 2.0, 1.0], &[1.0, 1.0], &[7.0], &[]] {
            assert_eq!(regular(irregular), None, "{irregular:?}");
        }
        assert_eq!(Contents { numbered: true, ..contents() }.regular_times(), None, "no times were given");
    }
}
