//! Finds the roles of a variable's axes: by the user's letters, the CF conventions, their names, or else their
//! order.

use super::Variable;
use wavesplat_core::base::description::AxisRole;
use wavesplat_core::base::error::{Note, Remedy};
use wavesplat_core::source::Advised;
use wavesplat_core::source::layout::Axis;

const ORDER: [AxisRole; 4] = [AxisRole::Frames, AxisRole::Z, AxisRole::Y, AxisRole::X];
const LETTERS: [char; 4] = ['t', 'z', 'y', 'x'];

/// A note on axes whose meaning was guessed from their order, because it is not `known`; `None` if there are no such
/// axes.
fn note(variable: &Variable, known: &[Option<AxisRole>], axes: &[Axis]) -> Option<Note> {
    let guessed = |at: &usize| known[*at].is_none() && axes[*at].role != AxisRole::Single;
    (0..axes.len()).find(guessed)?;
    let letter = |axis: &Axis| ORDER.iter().position(|role| *role == axis.role).map_or('c', |at| LETTERS[at]);
    let letters: String = axes.iter().map(letter).collect();
    let text = format!("the axes {:?} are taken as {letters}, slowest first", variable.lengths);
    Some(Note::with(text, Remedy::Set("axes")))
}

/// An axis that probably counts frames, by how the array is stored.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct TimeHint {
    axis: usize,
    why: &'static str,
}

impl TimeHint {
    /// By the axes along which the array may grow, or by its chunks: most programs write a step at a time.
    pub(crate) fn from_storage(variable: &Variable, growing: &[usize]) -> Option<Self> {
        if let [axis] = *growing {
            return Some(Self { axis, why: "the array may grow along it" });
        }
        let chunk = variable.chunk.as_ref()?;
        let is_single = |axis: &usize| chunk[*axis] == 1 && variable.lengths[*axis] > 1;
        let mut single = (0..chunk.len()).filter(is_single);
        let axis = single.next().filter(|_| single.next().is_none())?;
        let others = chunk.iter().filter(|length| **length > 1).count();
        (others >= 2).then_some(Self { axis, why: "each chunk has one item along it" })
    }

    /// Takes the axis as that of frames, unless it or another is known already. Says so if that is not the usual order.
    fn apply(self, variable: &Variable, known: &mut [Option<AxisRole>]) -> Option<Note> {
        let is_taken = known[self.axis].is_some() || is_beside(&variable.dims[self.axis]);
        if known.contains(&Some(AxisRole::Frames)) || is_taken {
            return None;
        }
        known[self.axis] = Some(AxisRole::Frames);
        let text = || format!("axis {} is taken as time: {}", self.axis, self.why);
        (self.axis > 0).then(|| Note::with(text(), Remedy::Set("axes")))
    }
}

/// Finds the role of each axis, the slowest first, with notes on guesses. `index` is the chosen index of an axis other
/// than space and time; `letters` is the user's choice.
pub(crate) fn axes(
    variable: &Variable,
    all: &[Variable],
    index: Option<usize>,
    letters: Option<&str>,
    hint: Option<TimeHint>,
) -> Advised<(Vec<Axis>, Vec<Note>)> {
    let Some(letters) = letters else {
        let mut known = known(variable, all);
        let hinted = hint.filter(|_| variable.lengths.len() > 3).and_then(|hint| hint.apply(variable, &mut known));
        let axes = complete(variable, by_order(variable, known.clone(), index.is_some()), index)?;
        let guessed = note(variable, &known, &axes);
        return Ok((axes, hinted.into_iter().chain(guessed).collect()));
    };
    Ok((complete(variable, by_letters(variable, letters)?, index)?, Vec::new()))
}

/// Sets the axes that count neither voxels nor frames to the chosen index, or to the only one.
fn complete(variable: &Variable, guess: Vec<Option<AxisRole>>, index: Option<usize>) -> Advised<Vec<Axis>> {
    let axis = |(axis, role): (usize, Option<AxisRole>)| match (role, variable.lengths[axis], index) {
        (Some(role), n, _) => Ok(Axis::new(role, n)),
        (None, 1, _) => Ok(Axis::single(0, 1)),
        (None, n, Some(index)) if index < n => Ok(Axis::single(index, n)),
        (None, n, Some(index)) => {
            Err(format!("{}: axis {} has no index {index}", shown(variable), named(variable, axis, n)).into())
        }
        (None, n, None) => Err(too_many(variable, axis, n)),
    };
    let axes = guess.into_iter().enumerate().map(axis).collect::<Advised<Vec<_>>>()?;
    match axes.iter().filter(|axis| axis.role == AxisRole::Single && axis.len > 1).count() {
        0 if index.is_some_and(|i| i > 0) => {
            Err(format!("{}: has no axis beside space and time", shown(variable)).into())
        }
        n if n > 1 => Err(format!("{}: has {n} axes beside space and time; one is supported", shown(variable)).into()),
        _ => Ok(axes),
    }
}

fn shown(variable: &Variable) -> String {
    format!("variable {} of {} axes {:?}", variable.shown(), variable.lengths.len(), variable.lengths)
}

fn named(variable: &Variable, axis: usize, len: usize) -> String {
    let dim = &variable.dims[axis];
    if dim.is_empty() { format!("{axis} of length {len}") } else { format!("{dim} of length {len}") }
}

fn too_many(variable: &Variable, axis: usize, len: usize) -> Note {
    let axis = named(variable, axis, len);
    let text = format!("{}: axis {axis} counts neither voxels nor frames", shown(variable));
    Note::with(text, Remedy::ChooseIndex { name: variable.shown().into() })
}

/// One letter an axis; none for other letters.
fn by_letters(variable: &Variable, letters: &str) -> Advised<Vec<Option<AxisRole>>> {
    let role = |c: char| LETTERS.iter().position(|letter| *letter == c).map(|at| ORDER[at]);
    let roles: Vec<_> = letters.chars().map(role).collect();
    if let Some(twice) = ORDER.into_iter().position(|role| roles.iter().filter(|c| **c == Some(role)).count() > 1) {
        let text = format!("the axes {letters} have {} twice", LETTERS[twice]);
        return Err(Note::with(text, Remedy::Set("axes")));
    }
    if roles.len() != variable.lengths.len() {
        let text = format!("{}: the axes {letters} are {}", shown(variable), roles.len());
        return Err(Note::with(text, Remedy::Set("axes")));
    }
    Ok(roles)
}

/// The axes that are known by their coordinates or names.
fn known(variable: &Variable, all: &[Variable]) -> Vec<Option<AxisRole>> {
    let role = |axis: usize| {
        let by_coordinate = variable.coordinate(axis, all).and_then(role_of_coordinate);
        let by_label = || role_of_name(&variable.dims[axis]);
        by_coordinate.or_else(by_label).or_else(|| role_of_name(variable.scale(axis)))
    };
    let mut roles: Vec<_> = (0..variable.lengths.len()).map(role).collect();
    for which in ORDER {
        if roles.iter().filter(|c| **c == Some(which)).count() > 1 {
            roles.iter_mut().filter(|c| **c == Some(which)).for_each(|c| *c = None);
        }
    }
    roles
}

/// By the attributes that the CF conventions give coordinates.
pub(crate) fn role_of_coordinate(coordinate: &Variable) -> Option<AxisRole> {
    let text = |name| coordinate.text(name).unwrap_or_default().to_lowercase();
    let (axis, name, unit) = (text("axis"), text("standard_name"), text("units"));
    let by_axis = axis.chars().next().and_then(|c| LETTERS.iter().position(|letter| *letter == c)).map(|at| ORDER[at]);
    let by_name = match name.as_str() {
        "time" => Some(AxisRole::Frames),
        "latitude" | "grid_latitude" | "projection_y_coordinate" => Some(AxisRole::Y),
        "longitude" | "grid_longitude" | "projection_x_coordinate" => Some(AxisRole::X),
        "air_pressure" | "altitude" | "depth" | "height" => Some(AxisRole::Z),
        _ => None,
    };
    let by_unit = match unit.as_str() {
        unit if unit.contains(" since ") => Some(AxisRole::Frames),
        unit if unit.starts_with("degree") && unit.ends_with(['n', 'h']) => Some(AxisRole::Y),
        unit if unit.starts_with("degree") && unit.ends_with(['e', 't']) && unit != "degree" => Some(AxisRole::X),
        _ => None,
    };
    let vertical = coordinate.text("positive").map(|_| AxisRole::Z);
    by_axis.or(by_name).or(by_unit).or(vertical)
}

/// By the names that programs give to axes.
pub(crate) fn role_of_name(dim: &str) -> Option<AxisRole> {
    Some(match dim.to_lowercase().as_str() {
        "t" | "time" | "times" | "valid_time" | "step" | "steps" | "timestep" | "frame" | "frames" => AxisRole::Frames,
        "z" | "lev" | "level" | "levels" | "depth" | "height" | "alt" | "altitude" | "plev" | "pressure" | "layer"
        | "k" | "nz" | "zc" | "pressure_level" | "bottom_top" => AxisRole::Z,
        "y" | "lat" | "latitude" | "rlat" | "j" | "ny" | "yc" | "south_north" => AxisRole::Y,
        "x" | "lon" | "longitude" | "rlon" | "i" | "nx" | "xc" | "west_east" => AxisRole::X,
        _ => return None,
    })
}

/// Components that a vector or a tensor has at most.
const MOST_COMPONENTS: usize = 9;

/// Chooses, among one or more free axes, the one that probably counts components: the only short one, else the last. If
/// no axis is known to count frames, the slowest one probably does, so it is not considered short.
fn component_axis(variable: &Variable, free: &[usize], is_timed: bool) -> usize {
    let is_short = |axis: &usize| (2..=MOST_COMPONENTS).contains(&variable.lengths[*axis]);
    let mut short = (usize::from(!is_timed)..free.len()).filter(|at| is_short(&free[*at]));
    short.next().filter(|_| short.next().is_none()).unwrap_or(free.len() - 1)
}

/// The axis of the modes around an axis of symmetry, as openPMD has them.
pub(crate) const MODES: &str = "thetamode";

/// Names of axes along which an archive is not continued.
const BESIDE: [&str; 9] = ["member", "ens", "ensemble", "realization", "number", "component", "channel", "band", MODES];

fn is_beside(dim: &str) -> bool {
    BESIDE.contains(&dim.to_lowercase().as_str())
}

/// Assigns the remaining roles to the unknown axes, in the usual order t z y x. With an index, or if there are too many, the
/// axis that probably counts components gets none.
fn by_order(variable: &Variable, mut found: Vec<Option<AxisRole>>, indexed: bool) -> Vec<Option<AxisRole>> {
    let is_free = |axis: &usize| found[*axis].is_none() && !is_beside(&variable.dims[*axis]);
    let mut free: Vec<usize> = (0..found.len()).filter(is_free).collect();
    let mut roles: Vec<AxisRole> = ORDER.into_iter().filter(|role| !found.contains(&Some(*role))).collect();
    if indexed && !free.is_empty() && found.len() - free.len() == found.iter().flatten().count() {
        free.remove(component_axis(variable, &free, found.contains(&Some(AxisRole::Frames))));
    }
    while free.len() > roles.len()
        && let Some(at) = free.iter().position(|axis| variable.lengths[*axis] == 1)
    {
        free.remove(at);
    }
    if free.len() > roles.len() {
        free.remove(component_axis(variable, &free, found.contains(&Some(AxisRole::Frames))));
    }
    roles.drain(..roles.len().saturating_sub(free.len()));
    for (axis, role) in free.into_iter().zip(roles) {
        found[axis] = Some(role);
    }
    found
}

#[cfg(test)]
mod tests {
    use super::super::Attributes;
    use super::*;

    fn variable(lengths: &[usize], chunk: Option<&[usize]>) -> Variable {
        Variable {
            path: "a".into(),
            sample: Err("none".into()),
            lengths: lengths.to_vec(),
            dims: vec![String::new(); lengths.len()],
            scales: Vec::new(),
            chunk: chunk.map(<[usize]>::to_vec),
            attributes: Attributes::new(),
        }
    }

    #[test]
    fn the_only_short_axis_counts_components() {
        let found = |lengths: &[usize]| {
            let variable = variable(lengths, None);
            let named = |index| axes(&variable, &[], index, None, None).map(|(axes, _)| axes);
            assert!(named(None).is_err_and(|note| note.remedy.is_some()));
            named(Some(1)).expect("a component").iter().position(|axis| *axis == Axis::single(1, axis.len))
        };
        assert_eq!(found(&[50, 3, 64, 65, 66]), Some(1));
        assert_eq!(found(&[50, 64, 65, 66, 3]), Some(4));
        assert_eq!(found(&[6, 3, 64, 65, 66]), Some(1));
        assert_eq!(found(&[50, 3, 64, 65, 4]), Some(4));
    }

    #[test]
    fn time_is_the_axis_along_which_arrays_grow_or_chunks_are_single() {
        let found = |chunk: Option<&[usize]>, growing: &[usize]| {
            let variable = variable(&[128, 128, 128, 40], chunk);
            let hint = TimeHint::from_storage(&variable, growing);
            let (axes, notes) = axes(&variable, &[], None, None, hint).expect("four axes");
            (axes.iter().position(|axis| axis.role == AxisRole::Frames), notes.len())
        };
        assert_eq!(found(Some(&[128, 128, 128, 1]), &[]), (Some(3), 2));
        assert_eq!(found(None, &[3]), (Some(3), 2));
        assert_eq!(found(Some(&[1, 64, 64, 40]), &[]), (Some(0), 1));
        for no_hint in [None, Some(&[32, 32, 32, 8][..]), Some(&[1, 1, 128, 40]), Some(&[1, 128, 128, 1])] {
            assert_eq!(found(no_hint, &[]), (Some(0), 1), "{no_hint:?}");
        }
        assert_eq!(found(Some(&[128, 128, 128, 1]), &[0, 3]), (Some(3), 2));
    }

    #[test]
    fn axes_beside_space_and_time_are_never_frames() {
        for name in ["channel", "member"] {
            let dims = [name, "z", "y", "x"].map(String::from).to_vec();
            let variable = Variable { dims, ..variable(&[4, 5, 6, 7], Some(&[1, 5, 6, 7])) };
            let hint = TimeHint::from_storage(&variable, &[]);
            assert!(axes(&variable, &[], None, None, hint).is_err_and(|note| note.remedy.is_some()), "{name}");
            let (found, _) = axes(&variable, &[], Some(2), None, hint).expect("an index");
            assert_eq!(found[0], Axis::single(2, 4));
        }
        let dims = ["time", "z", "y", "x"].map(String::from).to_vec();
        let variable = Variable { dims, ..variable(&[4, 5, 6, 7], None) };
        assert!(axes(&variable, &[], Some(1), None, None).is_err_and(|note| note.text.contains("no axis beside")));
    }
}
