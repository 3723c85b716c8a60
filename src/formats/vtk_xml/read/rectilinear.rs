//! The positions of the points of a rectilinear grid: three lists of coordinates. Each piece has its part of them.

use super::extent::Extent;
use super::header::{VtiArray, VtiPiece};
use super::image::VtiFile;
use crate::shared::association::Association;
use crate::shared::directions::Directions;
use crate::shared::pieces::Packed;
use crate::vtk_xml::layout::{RECTILINEAR_GRID, TYPES};
use std::io::Read;
use std::path::Path;
use wavesplat_core::base::description::{Description, with_coordinates};
use wavesplat_core::base::error::{Error, Result};
use wavesplat_core::base::mapped::{Access, FileBytes};
use wavesplat_core::base::sample;
use wavesplat_core::source::Parsed;
use wavesplat_core::source::layout::Layout;

/// Points along an axis.
const MOST: usize = 1 << 24;

/// Steps along an axis may differ by so much of one: coordinates are often rounded to single precision.
const REGULAR: f64 = 1e-2;

/// The coordinates of all points along x, y, z.
pub(super) fn coordinates(image: &VtiFile) -> Result<[Vec<f64>; 3]> {
    let refused = |e| Error::input(image.file.path(), e);
    let points = image.header.whole.points().map_err(refused)?;
    if points.iter().any(|n| *n > MOST) {
        return Err(refused(format!("has more than {MOST} points along an axis")));
    }
    let mut runs = [const { Vec::new() }; 3];
    let pieces = image.header.pieces.iter().filter(|piece| !piece.extent.is_empty());
    if image.header.parallel {
        let folder = image.file.path().parent().unwrap_or(Path::new(""));
        for source in pieces.filter_map(|piece| piece.source.as_deref()) {
            let file = VtiFile::open(&folder.join(source))?;
            for piece in &file.header.pieces {
                add(&file, piece, &image.header.whole, &mut runs)?;
            }
        }
    } else {
        for piece in pieces {
            add(image, piece, &image.header.whole, &mut runs)?;
        }
    }
    let joined = runs.into_iter().zip(points).map(|(runs, points)| joined(runs, points));
    let joined = joined.collect::<Parsed<Vec<_>>>().map_err(refused)?;
    Ok(joined.try_into().unwrap_or_default())
}

/// Coordinates of consecutive points, and the index of the first point.
type Run = (usize, Vec<f64>);

/// Adds the coordinates of a piece, unless other pieces have given those of an axis.
fn add(image: &VtiFile, piece: &VtiPiece, whole: &Extent, runs: &mut [Vec<Run>; 3]) -> Result<()> {
    let refused = |e| Error::input(image.file.path(), e);
    let points = piece.extent.points().map_err(refused)?;
    let start = piece.extent.start_in(whole).ok_or_else(|| refused("has a piece outside of the whole".into()))?;
    let [x, y, z] = &piece.coordinates[..] else {
        let found = piece.coordinates.len();
        return Err(refused(format!("has a piece with {found} arrays of coordinates, not 3")));
    };
    for (axis, array) in [x, y, z].into_iter().enumerate() {
        let is_known = runs[axis].iter().any(|(at, run)| (*at, run.len()) == (start[axis], points[axis]));
        if !is_known {
            runs[axis].push((start[axis], numbers(image, array, points[axis])?));
        }
    }
    Ok(())
}

/// The numbers of an array that has so many.
fn numbers(image: &VtiFile, array: &VtiArray, count: usize) -> Result<Vec<f64>> {
    let path = image.file.path();
    let refused = |what: &str| Error::input(path, format!("coordinates {}: {what}", array.name));
    let Some(ty) = TYPES.stored(array.ty.as_str()).filter(|ty| !ty.is_64_bit()) else {
        return Err(refused(&format!("type {} is not supported", array.ty)));
    };
    let size = count.checked_mul(ty.size()).ok_or_else(|| refused("are too many"))?;
    let encoded = image.encoded(array, ty, size)?;
    let mut bytes = Vec::new();
    let reader = encoded.open(FileBytes::open(path, Access::Read)?);
    let read = reader.and_then(|reader| reader.take(size as u64).read_to_end(&mut bytes));
    read.map_err(|e| refused(&format!("cannot be read: {e}")))?;
    if bytes.len() < size {
        return Err(refused(&format!("are {}, not {count}", bytes.len() / ty.size())));
    }
    if image.header.big_endian {
        ty.swap_endian(&mut bytes);
    }
    let mut numbers = vec![0.0; count];
    sample::load(ty.sample(), &bytes, &mut numbers);
    Ok(numbers)
}

/// All coordinates of an axis from those of pieces, which may share some.
fn joined(mut runs: Vec<Run>, points: usize) -> Parsed<Vec<f64>> {
    runs.sort_by_key(|(start, _)| *start);
    let mut all: Vec<f64> = Vec::new();
    for (start, run) in runs {
        let known = all.len().checked_sub(start).ok_or("has pieces between which coordinates are missing")?;
        all.extend(run.iter().skip(known));
    }
    if all.len() == points { Ok(all) } else { Err(format!("has {} coordinates of {points} points", all.len())) }
}

/// Where samples of points or cells are, taken as evenly spaced; and the axes along which they are not.
pub(super) fn directions(points: &[Vec<f64>; 3], of: Association) -> Parsed<(Directions, Vec<&'static str>)> {
    let (mut steps, mut first, mut irregular) = ([[0.0; 3]; 3], [0.0; 3], Vec::new());
    for (axis, name) in ["x", "y", "z"].into_iter().enumerate() {
        let line = Line::through(&points[axis], of)
            .ok_or_else(|| format!("has coordinates along {name} that neither ascend nor descend"))?;
        (steps[axis][axis], first[axis]) = (line.step, line.first);
        if !line.is_regular {
            irregular.push(name);
        }
    }
    Ok((Directions::from_steps(steps, first), irregular))
}

/// The description of a rectilinear grid: the coordinates of samples along each axis, as they are stored.
pub(super) fn description(points: &[Vec<f64>; 3], of: Association, layout: &Layout) -> Description {
    let plain = Directions::from_steps([[0.0; 3]; 3], [0.0; 3]).description(RECTILINEAR_GRID, "", layout);
    let at = points.each_ref().map(|points| samples(points, of));
    with_coordinates(Description { orientation: None, ..plain }, &at)
}

/// The coordinates of samples along an axis: those of points, or the middles of cells.
fn samples(points: &[f64], of: Association) -> Vec<f64> {
    match of {
        Association::Cells if points.len() > 1 => {
            points.windows(2).map(|pair| f64::midpoint(pair[0], pair[1])).collect()
        }
        Association::Cells | Association::Points => points.to_vec(),
    }
}

/// Samples along an axis.
struct Line {
    first: f64,
    /// The mean; below 0 if they descend.
    step: f64,
    is_regular: bool,
}

impl Line {
    fn through(points: &[f64], of: Association) -> Option<Self> {
        let ascends = points.windows(2).all(|pair| pair[0] < pair[1]);
        let descends = points.windows(2).all(|pair| pair[0] > pair[1]);
        if points.iter().any(|v| !v.is_finite()) || !(ascends || descends) {
            return None;
        }
        let at = samples(points, of);
        let (first, last) = (*at.first()?, *at.last()?);
        let step = match (&at[..], points) {
            ([_], [a, b]) => b - a,
            ([_], _) => 1.0,
            _ => (last - first) / (at.len() - 1) as f64,
        };
        let off = |(i, v): (usize, &f64)| (v - first - step * i as f64).abs();
        let is_regular = at.iter().enumerate().map(off).all(|off| off <= REGULAR * step.abs());
        Some(Self { first, step, is_regular })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::open;
    use crate::testing::{Folder, refused, survives_damage};
    use wavesplat_core::source::OpenOptions;

    /// A grid of 3 x 2 x 1 points as text.
    fn grid(coordinates: &[&str]) -> String {
        let array = |text: &&str| format!("<DataArray type=\"Float32\" format=\"ascii\">{text}</DataArray>");
        let coordinates: String = coordinates.iter().map(array).collect();
        format!(
            "<VTKFile type=\"RectilinearGrid\"><RectilinearGrid WholeExtent=\"0 2 0 1 0 0\">\
             <Piece Extent=\"0 2 0 1 0 0\"><PointData><DataArray type=\"UInt8\" Name=\"a\" format=\"ascii\">1 2 3 4 5 6\
             </DataArray></PointData><Coordinates>{coordinates}</Coordinates></Piece></RectilinearGrid></VTKFile>"
        )
    }

    #[test]
    fn places_are_those_of_the_coordinates() {
        let folder = Folder::new();
        let file = folder.write("a.vtr", grid(&["1 2 5", "7 4", "3"]));
        let mut source = open(&[file], &OpenOptions::default()).expect("a grid");
        let found = source.archive().clone();
        assert_eq!((found.grid.spacing, found.grid.origin), ([2.0, 3.0, 1.0], [1.0, 4.0, 3.0]));
        let notes: Vec<_> = found.notes.iter().map(|note| note.text.as_str()).collect();
        assert!(notes[0].contains("+x -y +z") && notes[1].contains("along x are not regular"), "{notes:?}");
        let mut samples = [0; 6];
        source.window(0, 1).and_then(|w| w.read_box(0, &found.grid.whole(), &mut samples)).expect("samples");
        assert_eq!(samples, [4, 5, 6, 1, 2, 3]);
    }

    #[test]
    fn coordinates_that_cannot_be_are_refused() {
        let folder = Folder::new();
        let with = |coordinates: &[&str], words: &str| {
            refused(&[folder.write("a.vtr", grid(coordinates))], &OpenOptions::default(), words);
        };
        with(&["1 2 5", "7 4"], "2 arrays of coordinates, not 3");
        with(&["1 2", "7 4", "3"], "are 2, not 3");
        with(&["1 2 2", "7 4", "3"], "along x that neither ascend nor descend");
        with(&["1 2 x", "7 4", "3"], "cannot be read");
        let huge = grid(&["1 2 5", "7 4", "3"]).replace("0 2 0 1", "0 20000000 0 1");
        refused(&[folder.write("a.vtr", huge)], &OpenOptions::default(), "points along an axis");
        survives_damage("a.vtr", grid(&["1 2 5", "7 4", "3"]).as_bytes());
    }

    #[test]
    fn coordinates_of_pieces_are_joined() {
        let of = |runs: &[(usize, &[f64])], points| {
            joined(runs.iter().map(|(at, run)| (*at, run.to_vec())).collect(), points)
        };
        assert_eq!(of(&[(2, &[3.0, 4.0]), (0, &[1.0, 2.0, 3.0])], 4), Ok(vec![1.0, 2.0, 3.0, 4.0]));
        assert_eq!(of(&[(0, &[1.0, 2.0]), (0, &[1.0]), (1, &[2.0])], 2), Ok(vec![1.0, 2.0]));
        assert!(of(&[(0, &[1.0]), (2, &[3.0])], 3).is_err() && of(&[(0, &[1.0])], 2).is_err());
    }

    #[test]
    fn steps_are_means_and_uneven_ones_are_noticed() {
        let line = |points: &[f64], of| Line::through(points, of).map(|line| (line.first, line.step, line.is_regular));
        let (points, cells) = (Association::Points, Association::Cells);
        assert_eq!(line(&[1.0, 2.0, 5.0], points), Some((1.0, 2.0, false)));
        assert_eq!(line(&[5.0, 3.0, 1.0], points), Some((5.0, -2.0, true)));
        assert_eq!(line(&[1.0, 3.0, 5.0], cells), Some((2.0, 2.0, true)));
        assert_eq!((line(&[1.0, 3.0], cells), line(&[7.0], cells)), (Some((2.0, 2.0, true)), Some((7.0, 1.0, true))));
        for bad in [&[1.0, 1.0][..], &[1.0, 3.0, 2.0], &[f64::NAN], &[]] {
            assert_eq!(line(bad, points), None, "{bad:?}");
        }
    }
}
