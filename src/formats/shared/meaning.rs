//! What the axes of a stored array count: by the file's word, or by the user's letters.

use super::component;
use super::directions::{Directions, Placed};
use wavesplat_core::base::description::AxisRole;
use wavesplat_core::base::error::{Note, Remedy};
use wavesplat_core::source::Advised;
use wavesplat_core::source::layout::{Axis, Layout};

/// What an axis counts.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Kind {
    /// Voxels along x (0), y (1) or z (2).
    Voxels(usize),
    Frames,
    /// Anything else; one of them is chosen.
    Components,
}

/// The axes of an array, the fastest first.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Meaning {
    pub(crate) sizes: Vec<usize>,
    pub(crate) kinds: Vec<Kind>,
}

impl Meaning {
    /// By letters of t z y x, the slowest first, for all axes or for those that are longer than 1; another letter is one
    /// for another axis.
    pub(crate) fn by_letters(sizes: &[usize], letters: &str) -> Advised<Self> {
        let wrong = |text: String| Note::with(text, Remedy::Set("axes"));
        let count = letters.chars().count();
        let is_named = |axis: usize| count == sizes.len() || sizes[axis] > 1;
        let named: Vec<usize> = (0..sizes.len()).filter(|axis| is_named(*axis)).collect();
        if named.len() != count {
            let slowest: Vec<usize> = sizes.iter().rev().copied().collect();
            return Err(wrong(format!("has the axes {slowest:?}, slowest first, but the axes {letters} are {count}")));
        }
        let mut kinds = vec![Kind::Components; sizes.len()];
        for (axis, letter) in named.into_iter().zip(letters.chars().rev()) {
            let kind = match letter {
                't' => Kind::Frames,
                letter => "xyz".find(letter).map_or(Kind::Components, Kind::Voxels),
            };
            if kind != Kind::Components && kinds.contains(&kind) {
                return Err(wrong(format!("the axes {letters} have {letter} twice")));
            }
            kinds[axis] = kind;
        }
        let found = Self { sizes: sizes.to_vec(), kinds };
        let others = found.of(Kind::Components).filter(|axis| sizes[*axis] > 1).count();
        if others > 1 || found.voxels().is_empty() {
            return Err(wrong(format!(
                "the axes {letters} have {others} beside space and time; one is supported, and one of voxels at least"
            )));
        }
        Ok(found)
    }

    fn of(&self, kind: Kind) -> impl Iterator<Item = usize> {
        (0..self.kinds.len()).filter(move |axis| self.kinds[*axis] == kind)
    }

    /// The axes of voxels, the fastest first; at most three.
    pub(crate) fn voxels(&self) -> Vec<usize> {
        (0..self.kinds.len()).filter(|axis| matches!(self.kinds[*axis], Kind::Voxels(_))).collect()
    }

    /// The axis of frames.
    pub(crate) fn frames(&self) -> Option<usize> {
        self.of(Kind::Frames).next()
    }

    /// How many components there are.
    pub(crate) fn components(&self) -> usize {
        self.of(Kind::Components).map(|axis| self.sizes[axis]).product()
    }

    /// Voxels along the stored axes, the fastest first; 1 along those that it lacks.
    pub(crate) fn lengths(&self) -> [usize; 3] {
        let voxels = self.voxels();
        std::array::from_fn(|a| voxels.get(a).map_or(1, |axis| self.sizes[*axis]))
    }

    /// Finds the component that the option `variable` names, and its name; the array may have one of its own.
    pub(crate) fn component(&self, own: Option<&str>, variable: Option<&str>) -> Advised<(usize, Option<String>)> {
        component::only_array(own, self.components(), variable).map_err(|note| match note.remedy {
            Some(Remedy::ChooseComponent { .. }) if self.len(self.frames()) == 1 => {
                let text = format!("{} (if these are frames, the axes are {})", note.text, self.with_frames());
                Note { text, ..note }
            }
            _ => note,
        })
    }

    /// The length of an axis; 1 if there is no such axis.
    pub(crate) fn len(&self, axis: Option<usize>) -> usize {
        axis.map_or(1, |axis| self.sizes[axis])
    }

    /// Letters of its axes, the slowest first, with components as frames.
    fn with_frames(&self) -> String {
        let letter = |axis: usize| match self.kinds[axis] {
            Kind::Voxels(of) => ['x', 'y', 'z'][of.min(2)],
            Kind::Components if self.sizes[axis] > 1 => 't',
            Kind::Frames | Kind::Components => 'c',
        };
        (0..self.kinds.len()).rev().map(letter).collect()
    }

    /// How one component of the array is stored, with its voxels along the world's axes.
    pub(crate) fn layout(&self, placed: &Placed, component: usize) -> Layout {
        let voxels = self.voxels();
        self.laid_out(component, |axis| {
            let (of, backwards) = placed.axes[voxels.partition_point(|before| *before < axis)];
            Axis { backwards, ..Axis::new(AxisRole::of_voxels(of), self.sizes[axis]) }
        })
    }

    /// How one component of the array is stored, with its voxels along the axes that the letters name.
    pub(crate) fn plain_layout(&self, component: usize) -> Layout {
        let letter = |axis: usize| self.letter(axis).unwrap_or(0);
        self.laid_out(component, |axis| Axis::new(AxisRole::of_voxels(letter(axis)), self.sizes[axis]))
    }

    /// As above, with what `of_voxels` says of each axis of voxels.
    fn laid_out(&self, component: usize, of_voxels: impl Fn(usize) -> Axis) -> Layout {
        let axis = |axis: usize| match (self.kinds[axis], self.sizes[axis]) {
            (Kind::Voxels(_), _) => of_voxels(axis),
            (Kind::Frames, len) => Axis::new(AxisRole::Frames, len),
            (Kind::Components, len) => Axis::single(if len > 1 { component } else { 0 }, len),
        };
        Layout((0..self.kinds.len()).rev().map(axis).collect())
    }

    /// Where voxels are, by the step along each stored axis that is known. Letters that are not in the order of x, y, z go
    /// along the world's axes.
    pub(crate) fn directions(&self, step: impl Fn(usize) -> Option<[f64; 3]>, first: [f64; 3]) -> Directions {
        let voxels = self.voxels();
        let letters: Vec<usize> = voxels.iter().filter_map(|axis| self.letter(*axis)).collect();
        let known = |axis: &usize| step(*axis).filter(|step| length(*step) > 0.0);
        let mut steps: Vec<Option<[f64; 3]>> = voxels.iter().map(known).collect();
        if !letters.is_sorted() {
            for (step, letter) in steps.iter_mut().zip(&letters) {
                *step = Some(along(*letter).map(|unit| unit * step.map_or(1.0, length)));
            }
        }
        steps.resize(3, None);
        Directions::from_steps(completed([steps[0], steps[1], steps[2]]), first)
    }

    /// Whether x, y and z are there, and in this order.
    pub(crate) fn is_in_order(&self) -> bool {
        self.voxels().iter().filter_map(|axis| self.letter(*axis)).eq(0..3)
    }

    fn letter(&self, axis: usize) -> Option<usize> {
        match self.kinds[axis] {
            Kind::Voxels(letter) => Some(letter),
            _ => None,
        }
    }
}

fn along(axis: usize) -> [f64; 3] {
    std::array::from_fn(|a| if a == axis { 1.0 } else { 0.0 })
}

fn length(step: [f64; 3]) -> f64 {
    step.iter().map(|part| part * part).sum::<f64>().sqrt()
}

/// Steps of length 1 at right angles to the others, in place of those that are not known.
fn completed(steps: [Option<[f64; 3]>; 3]) -> [[f64; 3]; 3] {
    let mut found = steps;
    for missing in 0..3 {
        if found[missing].is_some() {
            continue;
        }
        let [a, b] = [(missing + 1) % 3, (missing + 2) % 3];
        found[missing] = match (found[a], found[b]) {
            (Some(a), Some(b)) => {
                let normal: [f64; 3] = std::array::from_fn(|i| {
                    let [j, k] = [(i + 1) % 3, (i + 2) % 3];
                    a[j] * b[k] - a[k] * b[j]
                });
                let all = length(normal);
                Some(if all > 0.0 { normal.map(|part| part / all) } else { along(missing) })
            }
            _ => {
                let is_free = |axis: &usize| found.iter().flatten().all(|step| step[*axis].abs() < 0.5 * length(*step));
                let mut axes = [missing, a, b].into_iter();
                Some(along(axes.find(is_free).unwrap_or(missing)))
            }
        };
    }
    found.map(|step| step.unwrap_or([0.0; 3]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn letters_name_axes_from_the_slowest() {
        let kinds = |letters: &str| Meaning::by_letters(&[8, 9, 4], letters).map(|found| found.kinds);
        assert_eq!(kinds("tyx").expect("planes"), [Kind::Voxels(0), Kind::Voxels(1), Kind::Frames]);
        assert_eq!(kinds("zyc").expect("components"), [Kind::Components, Kind::Voxels(1), Kind::Voxels(2)]);
        for wrong in ["tx", "xyx", "tcc", "tab"] {
            assert!(kinds(wrong).is_err_and(|note| note.remedy == Some(Remedy::Set("axes"))), "{wrong}");
        }
        let single = Meaning::by_letters(&[8, 9, 1, 4], "tyx").expect("those longer than 1");
        assert_eq!((single.lengths(), single.frames(), single.components()), ([8, 9, 1], Some(3), 1));
    }

    #[test]
    fn missing_steps_are_at_right_angles() {
        let planes = Meaning::by_letters(&[8, 9, 4], "tyx").expect("planes");
        let turned = [[0.0, 0.0, 2.0], [3.0, 0.0, 0.0]];
        let placed =
            planes.directions(|axis| turned.get(axis).copied(), [0.0; 3]).placed(planes.lengths(), "directions");
        assert_eq!((placed.axes, placed.spacing), ([(2, false), (0, false), (1, false)], [3.0, 1.0, 2.0]));
        let row = Meaning::by_letters(&[8, 4], "tx").expect("rows");
        let placed = row.directions(|_| Some([2.0, 0.0, 0.0]), [0.0; 3]).placed(row.lengths(), "directions");
        assert_eq!((placed.axes, placed.spacing), ([(0, false), (1, false), (2, false)], [2.0, 1.0, 1.0]));
    }

    #[test]
    fn letters_in_another_order_go_along_the_world() {
        let turned = Meaning::by_letters(&[8, 9, 4], "xyz").expect("voxels");
        let directions = turned.directions(|axis| Some(along(axis).map(|unit| unit * (axis + 1) as f64)), [0.0; 3]);
        let placed = directions.placed(turned.lengths(), "directions");
        assert_eq!((placed.axes.map(|(axis, _)| axis), placed.spacing), ([2, 1, 0], [3.0, 2.0, 1.0]));
        assert_eq!(turned.layout(&placed, 0).dims(), [4, 9, 8]);
    }
}
