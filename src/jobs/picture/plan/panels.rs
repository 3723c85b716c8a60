//! Three slices side by side, each face-on in its own part of the picture.

use super::annotations::picture_margins;
use super::views::{across_and_up, are_panels, view_across};
use crate::axes::Axes;
use crate::picture::request::PictureRequest;
use wavesplat_core::base::error::Result;
use wavesplat_core::base::grid::Grid;
use wavesplat_core::view::camera::{Camera, View};
use wavesplat_engine::render::Plane;
use wavesplat_engine::render::annotate::{Margins, line};

/// The axes that panels cut, row by row: side by side, in two rows, or one below the other.
const ARRANGEMENTS: [&[&[usize]]; 3] = [&[&[1, 0, 2]], &[&[1, 0], &[2]], &[&[1], &[0], &[2]]];

/// Gaps between panels, in lines of letters: one line with room around.
const GAP: f64 = 1.6;

/// The views of three slices across three axes, one for each; none for other slices, or if a view or a scale is given.
pub(in crate::picture) fn panels(
    request: &PictureRequest,
    axes: &Axes,
    grid: &Grid,
    planes: &[Plane],
) -> Result<Vec<View>> {
    if !are_panels(request, axes)? {
        return Ok(Vec::new());
    }
    let layouts = ARRANGEMENTS.map(|cuts| Layout::new(request, grid, cuts));
    let best = layouts.into_iter().max_by(|a, b| a.scale.total_cmp(&b.scale));
    let shortest = (0..3).map(|axis| grid.dims[axis] as f64 * grid.spacing[axis]).fold(f64::INFINITY, f64::min);
    let best = best.filter(|layout| layout.scale * shortest >= LEAST);
    let view = |layout: &Layout<'_>, plane: &Plane| layout.view(request, axes, grid, plane.axis);
    best.map_or(Ok(Vec::new()), |layout| planes.iter().map(|plane| view(&layout, plane)).collect())
}

/// The least pixels along a side of a panel. Where there is less room, slices stand in the volume.
const LEAST: f64 = 4.0;

/// Where panels lie.
struct Layout<'a> {
    /// The axes that the panels cut, row by row.
    cuts: &'a [&'a [usize]],
    /// Pixels per world unit.
    scale: f64,
    /// World units of the columns and rows.
    columns: Vec<f64>,
    rows: Vec<f64>,
    /// The margins of each panel, and the distance of two panels, in pixels.
    margins: [f64; 2],
    gap: f64,
    /// The first pixel of the first panel, with its margins.
    corner: [f64; 2],
}

impl<'a> Layout<'a> {
    /// Panels as large as they fit beside what is drawn around them.
    fn new(request: &PictureRequest, grid: &Grid, cuts: &'a [&'a [usize]]) -> Self {
        let Margins { left, right, top, bottom } = picture_margins(request);
        let [width, height] = request.size.0.map(|n| n as f64);
        let length = |axis: usize| grid.dims[axis] as f64 * grid.spacing[axis];
        let side = |cut: &usize, i: usize| length(across_and_up(*cut)[i]);
        let widest =
            |column: usize| cuts.iter().filter_map(|row| row.get(column)).map(|cut| side(cut, 0)).fold(0.0, f64::max);
        let columns: Vec<f64> = (0..cuts[0].len()).map(widest).collect();
        let rows: Vec<f64> = cuts.iter().map(|row| row.iter().map(|cut| side(cut, 1)).fold(0.0, f64::max)).collect();
        let (gap, margins) = (GAP * line(request.size.0), [left as f64, bottom as f64]);
        let room = [width - right as f64, height - top as f64];
        let taken = |i: usize, count: usize| count as f64 * margins[i] + (count + 1) as f64 * gap;
        let fit = |i: usize, sides: &[f64]| (room[i] - taken(i, sides.len())) / sides.iter().sum::<f64>();
        let scale = fit(0, &columns).min(fit(1, &rows));
        let spare = |i: usize, sides: &[f64]| room[i] - taken(i, sides.len()) - scale * sides.iter().sum::<f64>();
        let corner = [gap + spare(0, &columns) / 2.0, top as f64 + gap + spare(1, &rows) / 2.0];
        Self { cuts, scale, columns, rows, margins, gap, corner }
    }

    /// The middle of the panel that cuts an axis, in pixels.
    fn middle(&self, cut: usize) -> Option<[f64; 2]> {
        let find = |row: &&[usize]| row.iter().position(|other| *other == cut);
        let (row, column) = self.cuts.iter().enumerate().find_map(|(n, row)| Some((n, find(row)?)))?;
        let before =
            |sides: &[f64], margin: f64| sides.iter().map(|side| self.scale * side + margin + self.gap).sum::<f64>();
        let x = self.corner[0] + before(&self.columns[..column], self.margins[0]) + self.margins[0];
        let y = self.corner[1] + before(&self.rows[..row], self.margins[1]);
        Some([x + self.scale * self.columns[column] / 2.0, y + self.scale * self.rows[row] / 2.0])
    }

    /// The view whose picture has the panel that cuts an axis in its place.
    fn view(&self, request: &PictureRequest, axes: &Axes, grid: &Grid, cut: usize) -> Result<View> {
        let view = View { scale: Some(self.scale), ..view_across(request, axes, cut) };
        let camera = Camera::new(&view, grid)?;
        let middle = view.size.map(|n| n as f64 / 2.0);
        let [x, y] = self.middle(cut).unwrap_or(middle);
        let center = camera.moved((middle[0] - x) / self.scale, (y - middle[1]) / self.scale);
        Ok(View { center: Some(center), ..view })
    }
}
