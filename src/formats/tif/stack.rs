//! How the pages of a file make up frames.

use wavesplat_core::base::description::AxisRole;
use wavesplat_core::base::error::{Note, Remedy};
use wavesplat_core::source::layout::{Axis, Layout};
use wavesplat_core::source::{Advised, Parsed};

/// Pages as planes of frames.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Stack {
    pub(super) frames: usize,
    /// Voxels along z.
    pub(super) planes: usize,
    pub(super) channels: usize,
    /// Pages from a frame, a plane and a channel to the next.
    pub(super) steps: [usize; 3],
    /// World units between voxels along x, y, z.
    pub(super) spacing: [f64; 3],
    pub(super) space_unit: Option<String>,
    /// Time between frames, and its unit.
    pub(super) interval: Option<(f64, String)>,
    /// Times of all frames, if they are said one by one; in the unit of the interval, else in seconds.
    pub(super) stamps: Vec<f64>,
    /// Whether the rows of a page go along y.
    pub(super) is_turned: bool,
}

/// What an axis counts, `T`, `Z`, `Y`, `X` or `C`, or `?` if that is not known, and how many.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Counts {
    pub(super) letter: char,
    pub(super) length: usize,
}

impl Stack {
    /// Pages in an order of axes, the fastest first: `Z`, `C` and `T`, with their lengths.
    pub(super) fn new(order: [char; 3], lengths: [usize; 3]) -> Parsed<Self> {
        let (mut step, mut found) = (1_usize, [(0, 0); 3]);
        for (axis, len) in order.into_iter().zip(lengths) {
            let at = ['T', 'Z', 'C'].iter().position(|name| *name == axis).ok_or("names an axis that is not known")?;
            found[at] = (len, step);
            step = step.checked_mul(len).filter(|n| *n > 0).ok_or("says a number of planes that cannot be")?;
        }
        if found.iter().any(|(len, _)| *len == 0) {
            return Err("says an order of axes that lacks one".into());
        }
        let [frames, planes, channels] = found.map(|(len, _)| len);
        let steps = found.map(|(_, step)| step);
        let (spacing, space_unit, interval) = ([1.0; 3], None, None);
        let (stamps, is_turned) = (Vec::new(), false);
        Ok(Self { frames, planes, channels, steps, spacing, space_unit, interval, stamps, is_turned })
    }

    /// Pages along axes, the slowest first, that end with those of a page.
    pub(super) fn along(axes: &[Counts]) -> Parsed<Self> {
        let letters: String = axes.iter().map(|axis| axis.letter).collect();
        let is_turned = letters.ends_with("XY");
        if !is_turned && !letters.ends_with("YX") {
            return Err(format!("has pages along y and x, which are not the last of the axes {letters}"));
        }
        let outer = &axes[..axes.len() - 2];
        let mut order: Vec<(char, usize)> = Vec::new();
        for axis in outer.iter().rev().filter(|axis| axis.length != 1) {
            if !['T', 'Z', 'C'].contains(&axis.letter) || order.iter().any(|(letter, _)| *letter == axis.letter) {
                return Err(format!("has the axes {letters}; one each of T, Z and C is supported beside Y and X"));
            }
            order.push((axis.letter, axis.length));
        }
        let absent = ['Z', 'C', 'T'].into_iter().filter(|letter| !order.iter().any(|(known, _)| known == letter));
        let all: Vec<(char, usize)> = order.iter().copied().chain(absent.map(|letter| (letter, 1))).collect();
        let stack = Self::new([0, 1, 2].map(|at| all[at].0), [0, 1, 2].map(|at| all[at].1))?;
        Ok(Self { is_turned, ..stack })
    }

    /// The lengths of all axes but those of length 1, the slowest first, for pages of this size.
    pub(super) fn axes(&self, [x, y]: [usize; 2]) -> Vec<Counts> {
        let lengths = [('T', self.frames), ('Z', self.planes), ('C', self.channels)];
        let mut outer: Vec<_> = lengths.into_iter().zip(self.steps).filter(|((_, length), _)| *length != 1).collect();
        outer.sort_by_key(|(_, step)| std::cmp::Reverse(*step));
        let outer = outer.into_iter().map(|(counts, _)| counts);
        let all = outer.chain([('Y', y), ('X', x)]);
        all.map(|(letter, length)| Counts { letter, length }).collect()
    }

    /// The number of pages; `None` if it is too large.
    pub(super) fn pages(&self) -> Option<usize> {
        self.frames.checked_mul(self.planes)?.checked_mul(self.channels)
    }

    /// The number of the page that a plane is on.
    pub(super) fn page(&self, frame: usize, plane: usize, channel: usize) -> usize {
        self.steps[0] * frame + self.steps[1] * plane + self.steps[2] * channel
    }

    /// The samples of some frames of one channel, plane by plane, for pages of this size.
    pub(super) fn layout(&self, dims: [usize; 2]) -> Layout {
        let [row, column] = self.in_page(dims);
        Layout(vec![Axis::new(AxisRole::Frames, 1), Axis::new(AxisRole::Z, self.planes), column, row])
    }

    /// All pages one after another, with one channel chosen.
    pub(super) fn contiguous(&self, dims: [usize; 2], channel: usize) -> Layout {
        let outer = [
            (Axis::new(AxisRole::Frames, self.frames), self.steps[0]),
            (Axis::new(AxisRole::Z, self.planes), self.steps[1]),
            (Axis::single(channel, self.channels), self.steps[2]),
        ];
        let mut outer: Vec<_> = outer.into_iter().filter(|(axis, _)| axis.len > 1).collect();
        outer.sort_by_key(|(_, step)| std::cmp::Reverse(*step));
        let [row, column] = self.in_page(dims);
        Layout(outer.into_iter().map(|(axis, _)| axis).chain([column, row]).collect())
    }

    /// The axes of a page, the fastest first.
    fn in_page(&self, [row, column]: [usize; 2]) -> [Axis; 2] {
        let roles = if self.is_turned { [AxisRole::Y, AxisRole::X] } else { [AxisRole::X, AxisRole::Y] };
        [Axis::new(roles[0], row), Axis::new(roles[1], column)]
    }

    /// Times of several frames, if it says how far they are apart.
    pub(super) fn times(&self) -> Vec<f64> {
        match &self.interval {
            _ if self.frames > 1 && self.stamps.len() == self.frames => self.stamps.clone(),
            Some((interval, _)) if self.frames > 1 => (0..self.frames).map(|t| t as f64 * interval).collect(),
            _ => Vec::new(),
        }
    }

    /// What these are measured in.
    pub(super) fn time_unit(&self) -> Option<String> {
        self.interval.as_ref().filter(|_| self.frames > 1).map(|(_, unit)| unit.clone())
    }
}

/// Gives the axes whose meaning is not known the usual one, slowest first: frames and planes, or one of the two. Also
/// returns a note on this guess.
pub(super) fn guessed(mut axes: Vec<Counts>) -> Advised<(Vec<Counts>, Option<Note>)> {
    let lengths: Vec<usize> = axes.iter().map(|axis| axis.length).collect();
    let is_free = |letter: char, axes: &[Counts]| axes.iter().all(|axis| axis.letter != letter || axis.length == 1);
    let unknown: Vec<usize> = (0..axes.len()).filter(|at| axes[*at].letter == '?' && lengths[*at] != 1).collect();
    let roles: Vec<char> = ['T', 'Z'].into_iter().filter(|letter| is_free(*letter, &axes)).collect();
    if unknown.len() > roles.len() {
        let text = format!("does not say what the axes {lengths:?} count, slowest first");
        return Err(Note::with(text, Remedy::Set("axes")));
    }
    let first = roles.len() - unknown.len();
    unknown.iter().zip(&roles[first..]).for_each(|(at, letter)| axes[*at].letter = *letter);
    if unknown.is_empty() {
        return Ok((axes, None));
    }
    let letters: String =
        axes.iter().map(|axis| if axis.letter == '?' { 'c' } else { axis.letter.to_ascii_lowercase() }).collect();
    let text = format!("the axes {lengths:?} are taken as {letters}, slowest first");
    Ok((axes, Some(Note::with(text, Remedy::Set("axes")))))
}

/// Gives axes the meaning of the user's letters. There is a letter for each axis, perhaps without those of length 1; or
/// three letters, of all pages and of the axes of a page.
pub(super) fn named(axes: &[Counts], pages: Option<usize>, letters: &str) -> Advised<Vec<Counts>> {
    let count = letters.chars().count();
    let lengths: Vec<usize> = axes.iter().map(|axis| axis.length).collect();
    let several: Vec<usize> = lengths.iter().copied().filter(|length| *length != 1).collect();
    let flat = pages.into_iter().chain(lengths[lengths.len() - 2..].iter().copied()).collect();
    let named = [&lengths, &several, &flat].into_iter().find(|lengths| lengths.len() == count);
    let Some(named) = named else {
        let text = format!("has the axes {lengths:?}, but the letters {letters} are {count}");
        return Err(Note::with(text, Remedy::Set("axes")));
    };
    let letter = |letter: char| match letter.to_ascii_uppercase() {
        known @ ('T' | 'Z' | 'Y' | 'X') => known,
        _ => 'C',
    };
    Ok(letters.chars().map(letter).zip(named).map(|(letter, length)| Counts { letter, length: *length }).collect())
}

/// A length, if it is positive.
pub(super) fn positive(value: f64) -> Option<f64> {
    Some(value).filter(|value| value.is_finite() && *value > 0.0)
}
