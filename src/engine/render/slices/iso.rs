//! Isosurfaces: where the field passes a value between two slices. The light of each such point is that of its gradient,
//! and goes behind the surfaces in front of it. Surfaces end at the faces of the volume. At their edges they cover a part of
//! a cell ([`super::cover`]).

use super::blend::{off_light, pixel_of_light};
use super::cover::{CoverPoint, Rays, Slope};
use super::row::{Blend, Point, Row, RowGroups};
use super::shade::Shader;
use super::view::SlicedView;
use super::{BRICK_ROWS, GROUP};
use crate::render::batches::Units;
use crate::render::light::{Light, Surface};
use wavesplat_core::base::vectors::dispatch;

/// Surfaces of several values.
pub(in crate::render) struct Isosurfaces {
    /// In the order of their values.
    pub(super) surfaces: Vec<Surface>,
    /// Their values in units.
    pub(super) values: Vec<f32>,
    pub(super) shader: Shader,
    pub(super) rays: Rays,
    pub(super) units: Units,
    /// How far beyond the values of samples surfaces are looked for, in units, if errors are bounded.
    pub(super) beyond: Option<f32>,
}

/// Sixteen cells.
#[derive(Debug, Clone, Copy)]
pub(in crate::render) struct Front {
    /// Red, green and blue of the light, and the transmittance.
    pub(super) light: [[f32; 4]; GROUP],
    last: Slope,
    /// The number of the last slice.
    pub(super) slice: u32,
}

impl Isosurfaces {
    pub(in crate::render) fn new(surfaces: &[Surface], light: Light, view: &SlicedView) -> Self {
        let shader = Shader::new(light, view, 0.0);
        let mut surfaces = surfaces.to_vec();
        surfaces.sort_by(|a, b| a.value.total_cmp(&b.value));
        let most = surfaces.iter().map(|surface| surface.value.abs()).fold(0.0, f64::max);
        let zero = surfaces[0].value;
        let units = Units { zero, per: if most > 0.0 { 1.0 / most } else { 1.0 } };
        let values = surfaces.iter().map(|surface| units.number(surface.value)).collect();
        Self { surfaces, values, shader, rays: Rays::new(view), units, beyond: None }
    }

    /// Adds the surfaces between two points of a ray behind those in front of them.
    pub(super) fn pass(&self, light: &mut [f32; 4], from: &CoverPoint, to: &CoverPoint) {
        if from.value.is_nan() || to.value.is_nan() {
            return;
        }
        let mut add = |n: usize| {
            if let Some(meeting) = self.rays.meeting(self.values[n], from, to) {
                let lit = self.shader.shade_surface(meeting.gradient, from.value < self.values[n]);
                self.put(light, n, lit, meeting.opacity(self.surfaces[n].opacity as f32));
            }
        };
        let all = 0..self.values.len();
        if from.value < to.value { all.for_each(&mut add) } else { all.rev().for_each(&mut add) }
    }

    /// Adds a surface with this share of its colour, gloss and opacity.
    fn put(&self, light: &mut [f32; 4], n: usize, [colour, gloss]: [f32; 2], opacity: f32) {
        let through = light[3] * opacity;
        for (sum, c) in light.iter_mut().zip(self.surfaces[n].colour) {
            *sum += through * (c as f32 * colour + gloss).min(1.0);
        }
        light[3] -= through;
    }
}

impl Blend for Isosurfaces {
    type Group = Front;
    type Cell = [f32; 4];

    const EMPTY: Front = Front { light: [Self::NOTHING; GROUP], last: Slope::NOTHING, slice: u32::MAX - 1 };
    const NOTHING: [f32; 4] = [0.0, 0.0, 0.0, 1.0];
    /// The limit is the largest transmittance of a group.
    const OPEN: f32 = 1.0;

    /// Where hardly any sample supports a value, there is no surface.
    fn least(&self) -> f32 {
        0.01
    }

    fn units(&self, _: f64) -> Units {
        self.units
    }

    fn is_shaded(&self) -> bool {
        true
    }

    fn shows(&self, range: (f32, f32)) -> bool {
        let beyond = self.beyond.unwrap_or(0.0);
        let (least, largest) = (range.0 - beyond, range.1 + beyond);
        self.values.iter().any(|value| least <= *value && *value <= largest)
    }

    /// A surface that is almost reached shows in cells that are looked at because of others: their blocks must be true then.
    fn reads_beside(&self) -> [usize; 2] {
        if self.beyond.is_some() { [2 * GROUP, 2 * BRICK_ROWS] } else { [0; 2] }
    }

    fn add(&self, row: &Row<'_>, RowGroups { states, limits, live, .. }: RowGroups<'_, Front>) {
        for (n, (group, limit)) in states.iter_mut().zip(limits).enumerate().filter(|(n, _)| live[*n]) {
            let next = dispatch!(slope(row, n));
            let follows = group.slice.wrapping_add(1) == row.slice;
            let marks = if follows { self.rays.near(&self.values, &group.last, &next) } else { 0 };
            if marks != 0 {
                for i in (0..GROUP).filter(|i| marks >> i & 1 == 1) {
                    let [before, at] = self.rays.places(row, n * GROUP + i);
                    self.pass(&mut group.light[i], &group.last.point(i, before), &next.point(i, at));
                }
                *limit = group.light.iter().map(|cell| cell[3]).fold(0.0, f32::max);
            }
            (group.last, group.slice) = (next, row.slice);
        }
    }

    fn cells(group: &Front) -> [[f32; 4]; GROUP] {
        group.light
    }

    fn pixel(_: &Units, cells: [&[[f32; 4]; 4]; 4], weights: [[f32; 4]; 2], out: &mut [f32]) {
        pixel_of_light(cells, weights, out);
    }

    /// The light, and the last point.
    type Exact = ([f32; 4], Option<CoverPoint>);

    fn exact(&self) -> Self::Exact {
        (Self::NOTHING, None)
    }

    fn step(&self, (light, last): &mut Self::Exact, point: &Point, _: f64) {
        let [at, gradient] = [point.place, point.gradient].map(|numbers| numbers.map(|n| n as f32));
        let to = CoverPoint { at, value: self.units.number(point.value), gradient };
        if let Some(from) = last {
            self.pass(light, from, &to);
        }
        *last = Some(to);
    }

    fn off((light, last): &Self::Exact, pixel: &[f32]) -> Option<f64> {
        last.map(|_| off_light(&light.map(f64::from), pixel))
    }
}

/// The field at a group of cells.
#[inline(always)]
pub(super) fn slope(row: &Row<'_>, group: usize) -> Slope {
    if row.is_whole(group) {
        return Slope { values: row.sums(group), gradient: row.gradient(group, None) };
    }
    let (means, lengths) = row.means(group);
    let values = std::array::from_fn(|i| if lengths[i] > 0.0 { means[i] } else { f32::NAN });
    Slope { values, gradient: row.gradient(group, Some(&means)) }
}
