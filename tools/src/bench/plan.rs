//! Which groups of methods are measured together.

use crate::synth::Kind;
use clap::ValueEnum;
use std::fmt;
use std::iter::successors;
use wavesplat::base::error::{Error, Result};
use wavesplat::convert::{Basis, Bound};
use wavesplat::render::{Quantity, default_splat_error, splat_method};
use wavesplat::view::footprint::Method;
use wavesplat_demo::textbook;

/// A basis, and the window it is measured with.
#[derive(Debug, PartialEq)]
pub struct BasisRow {
    /// The name in results.
    pub name: &'static str,
    /// The library's setting.
    pub basis: Basis,
    /// Frames of a window.
    pub window: usize,
}

/// All bases.
pub const BASES: [BasisRow; 2] = [
    BasisRow { name: "haar", basis: Basis::Haar, window: 32 },
    BasisRow { name: "multi", basis: Basis::Multi, window: 33 },
];

/// An error bound.
#[derive(Debug)]
pub struct BoundRow {
    /// The name in results.
    pub name: &'static str,
    /// The library's setting.
    pub bound: Bound,
    /// The largest error of one sample, and so of one pixel, in a window of this many frames, in units of the voxel
    /// bound; none if the bound is only an estimate.
    pub worst: fn(f64) -> Option<f64>,
}

/// All bounds. Splat methods are compared with the first.
pub const BOUNDS: [BoundRow; 4] = [
    BoundRow { name: "pointwise", bound: Bound::Pointwise, worst: |_| Some(1.0) },
    BoundRow { name: "relative", bound: Bound::Relative { floor: 0.01 }, worst: |_| Some(1.0) },
    BoundRow { name: "rms", bound: Bound::Rms, worst: |window| Some(window.sqrt()) },
    BoundRow { name: "sampled", bound: Bound::Sampled { samples: 300, seed: 0 }, worst: |_| None },
];

/// Frames that the conventional method with shared footprints splats together.
const SHARED_GROUP: usize = 32;

/// What to measure.
#[derive(Debug, Clone, PartialEq)]
pub struct Sweep {
    /// Voxels along x, y, z and the number of frames.
    pub dims: [usize; 4],
    /// Width and height of a picture in pixels.
    pub size: usize,
    /// The kinds of archives.
    pub kinds: Vec<Kind>,
    /// The tolerances of the first sweep.
    pub tolerances: Vec<f64>,
    /// The tolerance of the second sweep, that of splat methods.
    pub fine: f64,
    /// The splat methods of the second sweep.
    pub splats: Vec<Method>,
    /// Number of repetitions of every time.
    pub repeats: usize,
}

impl Default for Sweep {
    fn default() -> Self {
        Self {
            dims: [64, 64, 64, 33],
            size: 256,
            kinds: Kind::value_variants().to_vec(),
            tolerances: vec![1e-1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6],
            fine: 1e-6,
            splats: splat_methods(),
            repeats: 3,
        }
    }
}

impl Sweep {
    /// A sweep that takes seconds, to check that everything works.
    pub fn quick() -> Self {
        let splats = [splat_method(Quantity::Mean, f64::MAX), Method::EXACT].to_vec();
        Self { dims: [12, 10, 8, 33], size: 40, tolerances: vec![1e-1, 1e-3], splats, repeats: 1, ..Self::default() }
    }

    /// Checks that the archive is as long as a window, and that there is something to measure.
    ///
    /// # Errors
    /// A usage error that names the option.
    pub fn check(&self) -> Result<()> {
        let least = BASES.iter().map(|b| b.window).fold(SHARED_GROUP, usize::max);
        if self.dims[3] < least {
            return Err(Error::usage(format!("--dims: a window has up to {least} frames, so take as many or more")));
        }
        if self.repeats == 0 || self.kinds.is_empty() || self.tolerances.is_empty() {
            return Err(Error::usage("--repeats, --kinds, --tolerances: nothing is left to measure"));
        }
        Ok(())
    }

    /// All groups, archive by archive.
    pub fn groups(&self) -> Vec<Group> {
        self.kinds.iter().flat_map(|kind| self.by_tolerance(*kind).chain(self.by_splat(*kind))).collect()
    }

    /// Every basis and bound at each tolerance, with the default splat error.
    fn by_tolerance(&self, kind: Kind) -> impl Iterator<Item = Group> {
        self.tolerances.iter().map(move |tolerance| {
            let coefficients = BOUNDS.iter().flat_map(|bound| BASES.iter().map(|b| Contender::Coefficients(b, bound)));
            let contenders = coefficients.chain([Contender::Shared, Contender::Textbook(textbook::CUT)]).collect();
            let splat_error = default_splat_error(Some(*tolerance));
            Group { kind, tolerance: *tolerance, splat_error, splat: None, contenders }
        })
    }

    /// Every splat method at the fine tolerance; the textbook form has the same cut.
    fn by_splat(&self, kind: Kind) -> impl Iterator<Item = Group> {
        self.splats.iter().map(move |method| {
            let coefficients = BASES.iter().map(|b| Contender::Coefficients(b, &BOUNDS[0]));
            let contenders = coefficients.chain([Contender::Shared, Contender::Textbook(method.radius)]).collect();
            let splat_error = method.stated_error * (1.0 + 1e-9);
            Group { kind, tolerance: self.fine, splat_error, splat: Some(method.name), contenders }
        })
    }
}

/// All splat methods of the library for means, cheapest first.
fn splat_methods() -> Vec<Method> {
    let next = |m: &Method| (*m != Method::EXACT).then(|| Method::within(m.stated_error.next_down()));
    successors(Some(splat_method(Quantity::Mean, f64::MAX)), next).collect()
}

/// Methods that are measured in turns, so that other load on the machine affects all of them alike.
#[derive(Debug)]
pub struct Group {
    /// The kind of archive.
    pub kind: Kind,
    /// The tolerance of conversions.
    pub tolerance: f64,
    /// The error that splatting may add, as a share of the value range.
    pub splat_error: f64,
    /// The splat method if the group belongs to the second sweep.
    pub splat: Option<&'static str>,
    /// The methods that are measured.
    pub contenders: Vec<Contender>,
}

/// A method that makes pictures of frames.
#[derive(Debug, Clone, Copy)]
pub enum Contender {
    /// From a coefficient file.
    Coefficients(&'static BasisRow, &'static BoundRow),
    /// The conventional method with footprints shared by 32 frames.
    Shared,
    /// The conventional method with a table of footprints, cut at this many standard deviations.
    Textbook(f64),
}

impl Contender {
    /// The name of the method.
    pub fn method(&self) -> &'static str {
        match self {
            Self::Coefficients(basis, _) => basis.name,
            Self::Shared => "shared",
            Self::Textbook(_) => "textbook",
        }
    }

    /// The name of the bound; none for the conventional method.
    pub fn bound(&self) -> Option<&'static str> {
        if let Self::Coefficients(_, bound) = self { Some(bound.name) } else { None }
    }

    /// The number of timed runs. It is one for every bound but the first, since only sizes and errors of these are
    /// compared.
    pub fn rounds(&self, repeats: usize) -> usize {
        match self {
            Self::Coefficients(_, bound) if bound.name != BOUNDS[0].name => 1,
            _ => repeats,
        }
    }

    /// The number of frames to render: whole windows, so that times per frame can be compared.
    pub fn frames(&self, all: usize) -> usize {
        let window = if let Self::Coefficients(basis, _) = self { basis.window } else { SHARED_GROUP };
        all - all % window
    }
}

impl Group {
    /// The number of timed conversions. It is one in the second sweep, since its conversions are those of the first
    /// sweep.
    pub fn rounds(&self, repeats: usize) -> usize {
        if self.splat.is_some() { 1 } else { repeats }
    }

    /// The group's name: sweep, kind, tolerance and, in the second sweep, the splat method.
    pub fn name(&self) -> String {
        let kind = self.kind.name();
        match self.splat {
            Some(splat) => format!("splat/{kind}/{:e}/{splat}", self.tolerance),
            None => format!("tolerance/{kind}/{:e}", self.tolerance),
        }
    }

    /// The key of each contender's point.
    pub fn keys(&self) -> Vec<String> {
        let group = self.name();
        let of =
            |c: &Contender| format!("{group}/{}{}", c.method(), c.bound().map_or(String::new(), |b| format!("/{b}")));
        self.contenders.iter().map(of).collect()
    }
}

impl fmt::Display for Group {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}, tolerance {:e}", self.kind.name(), self.tolerance)?;
        self.splat.map_or(Ok(()), |splat| write!(f, ", {splat}"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::HashSet;

    #[test]
    fn every_point_has_a_name_of_its_own() {
        let keys: Vec<String> = Sweep::default().groups().iter().flat_map(Group::keys).collect();
        assert_eq!(keys.iter().collect::<HashSet<_>>().len(), keys.len());
        assert!(keys.contains(&"tolerance/smooth/1e-3/haar/rms".into()), "{keys:?}");
        assert!(keys.contains(&"splat/noise/1e-6/footprint-4/textbook".into()), "{keys:?}");
    }

    #[test]
    fn all_splat_methods_are_found_and_asked_for() {
        let methods = splat_methods();
        assert_eq!((methods[0].name, methods[methods.len() - 1]), ("footprint-3.5", Method::EXACT));
        for group in Sweep::default().by_splat(Kind::Smooth) {
            assert_eq!(splat_method(Quantity::Mean, group.splat_error).name, group.splat.unwrap_or_default());
        }
    }

    #[test]
    fn only_whole_windows_are_rendered() {
        let frames = |c: Contender| c.frames(66);
        assert_eq!(frames(Contender::Coefficients(&BASES[0], &BOUNDS[0])), 64);
        assert_eq!(frames(Contender::Coefficients(&BASES[1], &BOUNDS[0])), 66);
        assert_eq!(frames(Contender::Shared), 64);
        assert!(Sweep { dims: [8, 8, 8, 32], ..Sweep::quick() }.check().is_err());
    }
}
