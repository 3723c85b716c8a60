//! Values of options on the command line.

use super::input::Input;
use std::fmt::{Debug, Display};
use std::str::FromStr;
use wavesplat::axes::Axes;
use wavesplat::base::grid::Grid;
use wavesplat::base::position::RegionSpec;
use wavesplat::base::values::{FrameList, FrameRange, Pair, Triple, Whole};
use wavesplat_cli::{Dims, Size};

/// Parses text as every kind of value, for an archive of at most 999 frames and 256 voxels along an axis.
pub fn values(data: &[u8]) {
    let mut input = Input::new(data);
    let (frames, dims) = (1 + input.short() % 999, [(); 3].map(|()| 1 + usize::from(input.byte())));
    let Ok(text) = std::str::from_utf8(input.rest()) else { return };
    if let Some(range) = reads_back::<FrameRange>(text) {
        if let Ok((first, step, count)) = range.resolve(Some(frames)) {
            let count = count.expect("all frames are known");
            assert!(count > 0 && first + (count - 1) * step < frames, "{range}: {first} {step} {count}");
        }
        let _ = range.resolve(None);
    }
    if let Ok(list) = text.parse::<FrameList>()
        && let Ok(chosen) = list.resolve(frames)
    {
        assert!(chosen.is_sorted_by(|a, b| a < b) && chosen.last().is_some_and(|&last| last < frames), "{list:?}");
    }
    if let Some(spec) = reads_back::<RegionSpec>(text) {
        let grid = Grid::unit(dims);
        if let Ok(region) = Axes::new(&grid, Some("m"), None).region("region", &spec) {
            assert!(!region.is_empty() && grid.whole().contains(&region), "{spec}");
        }
    }
    if let Ok(Dims(dims)) = text.parse() {
        assert!(matches!(dims.len(), 3 | 4) && !dims.contains(&0));
    }
    let _ = (text.parse::<Size>(), text.parse::<Whole<2>>());
    let finite = |numbers: &[f64]| assert!(numbers.iter().all(|n| n.is_finite()));
    let _ = text.parse::<Pair>().map(|pair| finite(&pair.0));
    let _ = text.parse::<Triple>().map(|triple| finite(&triple.0));
}

/// The value, which must parse again from its own text.
fn reads_back<T: FromStr + Display + PartialEq + Debug>(text: &str) -> Option<T> {
    let value: T = text.parse().ok()?;
    assert_eq!(value.to_string().parse().ok().as_ref(), Some(&value), "{text:?}");
    Some(value)
}
