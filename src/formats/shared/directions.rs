//! The directions of an array's axes in the world: along the world's axes in any order and direction, or oblique.

use wavesplat_core::base::description::{ArrayAxis, AxisRole, Description, Dimension, Orientation};
use wavesplat_core::base::error::Note;
use wavesplat_core::source::Parsed;
use wavesplat_core::source::layout::{Axis, Layout};

/// Deviations from an axis by less than this share of a step count as straight: they are not visible.
const SLANT: f64 = 1e-3;

/// Axes of voxels in the world.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Directions {
    /// The direction of each axis of the array, the fastest first. Its length is arbitrary.
    directions: [[f64; 3]; 3],
    /// A step along each axis is its direction times this.
    spacing: [f64; 3],
    /// World position of the voxel that is stored first.
    pub(crate) first: [f64; 3],
}

/// The axes of an array as those of a grid.
#[derive(Debug, PartialEq)]
pub(crate) struct Placed {
    /// Which axis of the grid each axis of the array is, the fastest first, and whether it is stored backwards.
    pub(crate) axes: [(usize, bool); 3],
    /// World units between voxels along x, y, z of the grid.
    pub(crate) spacing: [f64; 3],
    /// World position of its first voxel.
    pub(crate) origin: [f64; 3],
    /// Notes for the user.
    pub(crate) note: Option<Note>,
}

impl Directions {
    /// Steps of these lengths along axes in these directions. Negative lengths are refused, because it is unclear
    /// whether they should reverse an axis.
    pub(crate) fn new(directions: [[f64; 3]; 3], spacing: [f64; 3], first: [f64; 3]) -> Parsed<Self> {
        if spacing.iter().any(|step| *step < 0.0) {
            return Err(format!("has the spacing {spacing:?}, which is not positive"));
        }
        Ok(Self { directions, spacing, first })
    }

    /// These steps along the axes.
    pub(crate) fn from_steps(steps: [[f64; 3]; 3], first: [f64; 3]) -> Self {
        Self { directions: steps, spacing: [1.0; 3], first }
    }

    /// From a voxel to the next along each axis.
    pub(crate) fn steps(&self) -> [[f64; 3]; 3] {
        std::array::from_fn(|axis| self.directions[axis].map(|c| c * self.spacing[axis]))
    }

    /// The same axes from another first voxel, whose place is given in steps from this one.
    pub(crate) fn starting_at(self, steps: [f64; 3]) -> Self {
        Self { first: self.place(steps), ..self }
    }

    /// World position of a place that is given in steps from the first voxel.
    fn place(&self, steps: [f64; 3]) -> [f64; 3] {
        let along = |axis: usize| (0..3).map(|a| self.steps()[a][axis] * steps[a]).sum::<f64>();
        std::array::from_fn(|axis| self.first[axis] + along(axis))
    }

    /// Turns an array of these lengths so that its axes ascend along x, y, z. An oblique array keeps its stored order.
    pub(crate) fn placed(&self, lengths: [usize; 3], what: &str) -> Placed {
        let norms = self.steps().map(|step| step.iter().map(|c| c * c).sum::<f64>().sqrt());
        let Some(along) = self.straight(&norms) else {
            let note = Some(format!("the {what} are oblique: pictures take the axes as those of the world").into());
            return Placed { axes: [0, 1, 2].map(|a| (a, false)), spacing: norms, origin: self.first, note };
        };
        let (mut spacing, mut origin) = (norms, self.first);
        let axes = [0, 1, 2].map(|a| {
            let backwards = self.steps()[a][along[a]] < 0.0;
            spacing[along[a]] = norms[a];
            origin[along[a]] -= if backwards { norms[a] * lengths[a].saturating_sub(1) as f64 } else { 0.0 };
            (along[a], backwards)
        });
        Placed { axes, spacing, origin, note: turned(&axes).map(Note::from) }
    }

    /// The description of an array with these directions, in a world whose axes ascend as `space` says.
    pub(crate) fn description(&self, source: &str, space: &str, layout: &Layout) -> Description {
        let known = layout.0.iter().filter(|axis| axis.role != AxisRole::Single);
        let dimension = |axis: &Axis| Dimension { name: String::new(), length: axis.len as u64, unlimited: false };
        let axis =
            |(number, axis): (u32, &Axis)| ArrayAxis { dimension: number, role: axis.role, reversed: axis.backwards };
        Description {
            source: source.into(),
            dimensions: known.clone().map(dimension).collect(),
            axes: (0..).zip(known).map(axis).collect(),
            orientation: Some(Orientation {
                space: space.into(),
                first: self.first,
                directions: self.directions,
                spacing: self.spacing,
            }),
            ..Description::default()
        }
    }

    /// The axis of the world that each axis of the array goes along.
    fn straight(&self, norms: &[f64; 3]) -> Option<[usize; 3]> {
        let mut along = [0; 3];
        for ((along, step), norm) in along.iter_mut().zip(&self.steps()).zip(norms) {
            *along = (0..3).max_by(|a, b| step[*a].abs().total_cmp(&step[*b].abs()))?;
            let slant = |a: usize| a != *along && step[a].abs() > SLANT * norm;
            if !norm.is_finite() || *norm == 0.0 || (0..3).any(slant) {
                return None;
            }
        }
        (0..3).all(|axis| along.contains(&axis)).then_some(along)
    }
}

impl Placed {
    /// Whether the axes are those of the world, in order and ascending.
    pub(crate) fn is_plain(&self) -> bool {
        self.note.is_none()
    }

    /// The axes of an array of these lengths, its slowest first.
    pub(crate) fn voxels(&self, lengths: [usize; 3]) -> [Axis; 3] {
        [2, 1, 0].map(|a| {
            let (of, backwards) = self.axes[a];
            Axis { backwards, ..Axis::new(AxisRole::of_voxels(of), lengths[a]) }
        })
    }
}

/// A note on the axes that are turned, if any are.
fn turned(axes: &[(usize, bool); 3]) -> Option<String> {
    let stored =
        axes.map(|(axis, backwards)| format!("{}{}", if backwards { '-' } else { '+' }, ["x", "y", "z"][axis]));
    let stored = stored.join(" ");
    let note = || format!("voxels are stored along {stored} of the world, and are turned to go along +x +y +z");
    (stored != "+x +y +z").then(note)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn placed(steps: [[f64; 3]; 3]) -> Placed {
        Directions::from_steps(steps, [1.0, 2.0, 3.0]).placed([7, 5, 3], "directions")
    }

    #[test]
    fn straight_axes_are_turned() {
        let plain = placed([[0.5, 0.0, 0.0], [0.0, 1.0, 1e-7], [0.0, 0.0, 2.0]]);
        assert_eq!((plain.origin, plain.note), ([1.0, 2.0, 3.0], None));
        assert_eq!(plain.axes, [(0, false), (1, false), (2, false)]);
        let turned = placed([[0.0, 0.0, -0.5], [4.0, 0.0, 0.0], [0.0, 2.0, 0.0]]);
        assert_eq!((turned.spacing, turned.origin), ([4.0, 2.0, 0.5], [1.0, 2.0, 0.0]));
        assert_eq!(turned.axes, [(2, true), (0, false), (1, false)]);
        assert!(turned.note.expect("a note").text.contains("along -z +x +y of the world"));
    }

    #[test]
    fn places_are_counted_in_steps() {
        let turned = Directions::new([[0.0, 0.0, -1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], [2.0, 3.0, 4.0], [1.0; 3]);
        assert_eq!(turned.expect("steps").place([1.0, 0.5, 2.0]), [2.5, 9.0, -1.0]);
        assert!(Directions::new([[1.0, 0.0, 0.0]; 3], [1.0, -1.0, 1.0], [0.0; 3]).is_err());
    }

    #[test]
    fn what_is_aslant_stays_as_it_is() {
        let (x, y, z) = ([1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, -1.0]);
        for steps in [[x, [0.0, 3.0, 4.0], z], [x, x, z], [x, [0.0; 3], z], [x, y, [f64::NAN; 3]]] {
            let found = placed(steps);
            assert_eq!(found.axes, [(0, false), (1, false), (2, false)]);
            assert!(found.note.expect("a note").text.contains("directions are oblique"));
        }
        assert_eq!(placed([x, [0.0, 3.0, 4.0], z]).spacing, [1.0, 5.0, 1.0]);
    }
}
