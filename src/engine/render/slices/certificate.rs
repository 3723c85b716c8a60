//! Certified composites: a bound on the difference of every pixel from the same drawing of the original samples.
//!
//! A slice lets a share 1 - a of the light through and adds the light a c. A prime marks numbers of the original. T' is the
//! light that reaches a slice, and R is what the drawing shows behind the slice, if light of 1 comes through it. Replace the drawn slices by
//! those of the original, one after another from the front; each step changes the pixel by one term:
//!
//! ```text
//! |C' - C| <= sum over slices of T' (a' |c' - c| + |a' - a| |c - R|)                                      (eq 49)
//! ```
//!
//! The errors of the samples around a point bound that of the field. The steepness of the table then bounds those of c and of the
//! extinction, hence of a. The largest a' and T' that these allow stand for those of the original. The transmittance is like a colour
//! with c = 0 and a light of 1 behind all slices. Where a drawing ends because nearly no light comes through, the rest is at most T'. R follows
//! from the finished picture, so slices are swept a second time.
//!
//! Both drawings have the same slices, cells, weights and tables. Every ray takes its light from its own length, so that one formula
//! holds for all, and no slab stands in place of its slices.

use super::GROUP;
use super::batch::{SlicePass, Swept, bytes};
use super::blend::{Cells, Composite, add_part, four_entries, is_clear, opacity, places};
use super::field_errors::FieldErrors;
use super::filter::Sixteen;
use super::row::{Blend, CLOSED, Point, Row, RowGroups};
use super::shade::{Lit, Shader};
use super::steepest::{Steepest, Steepness};
use super::table::{ENTRIES, Entries};
use super::view::SlicedView;
use crate::render::batches::Units;
use crate::render::report::RenderReport;
use wavesplat_core::base::error::Result;
use wavesplat_core::base::grid::BlockGrid;
use wavesplat_core::base::vectors::dispatch;

/// The second sweep of a composite, which bounds its errors.
pub(in crate::render) struct Certificate<'a> {
    composite: &'a Composite,
    steepest: Steepest,
    errors: FieldErrors<'a>,
    /// The most light that a value has.
    brightest: f32,
    /// The rounding of the drawn light.
    rounding: f32,
}

/// Sixteen cells, each four numbers: red, green, blue and the transmittance.
#[derive(Debug, Clone, Copy)]
pub(in crate::render) struct Bounded {
    /// The number of the frame in its batch.
    frame: u32,
    /// The light of the slices so far, and of all slices.
    light: Cells,
    drawn: Cells,
    /// Bounds of the light of the original that comes through the slices so far, and of the errors that they make.
    through: Sixteen,
    errors: Cells,
}

/// Bounds of the errors of all frames' pixels: the largest of a pixel's light and opacity.
///
/// # Errors
/// Failed reads.
pub(in crate::render) fn pixel_errors(
    pass: &SlicePass<'_, Composite>,
    swept: &Swept<Composite>,
    report: &mut RenderReport,
) -> Result<Vec<Vec<f32>>> {
    let start = |frame: usize, drawn: &Cells| Bounded { frame: frame as u32, drawn: *drawn, ..Bounded::START };
    let bounded = second_sweep(pass, swept, &Certificate::new(pass), start, report)?;
    debug_assert!(bounded.groups().flatten().all(|group| group.light == group.drawn), "both sweeps draw the same");
    errors_of_pixels(bounded, pass, report)
}

/// Sweeps the slices again. `start` makes the group of a frame from the drawn one.
pub(super) fn second_sweep<B: Blend, C: Blend>(
    first: &SlicePass<'_, B>,
    drawn: &Swept<B>,
    certificate: &C,
    start: impl Fn(usize, &B::Group) -> C::Group,
    report: &mut RenderReport,
) -> Result<Swept<C>> {
    let SlicePass { number, view, stops, reader, .. } = *first;
    let second = SlicePass { number, view, stops, reader, blend: certificate };
    let starts =
        drawn.groups().enumerate().map(|(frame, groups)| groups.iter().map(|group| start(frame, group)).collect());
    second.sweep_from(starts.collect(), None, report)
}

/// The errors of all frames' pixels after a second sweep.
pub(super) fn errors_of_pixels<B: Blend, C: Blend>(
    bounded: Swept<C>,
    pass: &SlicePass<'_, B>,
    report: &mut RenderReport,
) -> Result<Vec<Vec<f32>>> {
    let mut all = Vec::new();
    bounded.pictures(pass.view, pass.number, report, |_, errors| {
        all.push(errors.to_vec());
        Ok(())
    })?;
    Ok(all)
}

/// The largest error of a pixel's light and opacity, from those of the cells around it.
pub(super) fn pixel_of_errors(cells: [&[[f32; 4]; 4]; 4], [across, down]: [[f32; 4]; 2], out: &mut [f32]) {
    let mut sums = [0.0; 4];
    for (row, down) in cells.into_iter().zip(down) {
        for (cell, across) in row.iter().zip(across) {
            (0..4).for_each(|i| sums[i] += (across * down).abs() * cell[i]);
        }
    }
    let largest = sums.into_iter().fold(0.0, f32::max);
    let error = if largest == 0.0 { 0.0 } else { largest + OF_PIXEL }; // nothing is seen where there is no error
    out.fill(if error < 1.0 { error } else { 1.0 }); // light and opacity are from 0 to 1
}

/// Bytes of the second sweep of `frames` frames by a certificate.
pub(in crate::render) fn second_bytes<C: Blend>(
    view: &SlicedView,
    frames: usize,
    blocks: BlockGrid,
    is_shaded: bool,
) -> usize {
    let pixels = view.camera.size.iter().product::<usize>() * size_of::<f32>();
    bytes::<C>(view, frames, blocks, is_shaded) + frames * pixels + FieldErrors::bytes(blocks)
}

impl Bounded {
    /// Before the first slice.
    const START: Self = Self {
        frame: 0,
        light: Composite::EMPTY,
        drawn: Composite::EMPTY,
        through: [1.0; GROUP],
        errors: [[0.0; GROUP]; 4],
    };
}

impl<'a> Certificate<'a> {
    fn new(pass: &SlicePass<'a, Composite>) -> Self {
        let composite = pass.blend;
        let errors = FieldErrors::new(pass.view, pass.reader, &composite.table.units);
        let brightest = composite.shader.as_ref().map_or(1.0, Shader::brightest);
        let (steepest, rounding) =
            (Steepest::new(&composite.table.colours), pass.view.slices() as f32 * OF_SUM * brightest);
        Self { composite, steepest, errors, brightest, rounding }
    }
}

impl Blend for Certificate<'_> {
    type Group = Bounded;
    type Cell = [f32; 4];

    const EMPTY: Bounded = Bounded::START;
    const NOTHING: [f32; 4] = [0.0; 4];
    const OPEN: f32 = Composite::OPEN;
    const NUMBERS: usize = 1;

    fn units(&self, middle: f64) -> Units {
        self.composite.units(middle)
    }

    fn is_shaded(&self) -> bool {
        self.composite.is_shaded()
    }

    fn shows(&self, (least, largest): (f32, f32)) -> bool {
        self.composite.shows((least - self.errors.most, largest + self.errors.most))
    }

    fn add(&self, row: &Row<'_>, groups: RowGroups<'_, Bounded>) {
        dispatch!(add(row, self, groups));
    }

    fn cells(group: &Bounded) -> [[f32; 4]; GROUP] {
        Composite::cells(&group.errors)
    }

    fn pixel(_: &Units, cells: [&[[f32; 4]; 4]; 4], weights: [[f32; 4]; 2], out: &mut [f32]) {
        pixel_of_errors(cells, weights, out);
    }

    type Exact = ();

    fn exact(&self) {}

    fn step(&self, (): &mut (), _: &Point, _: f64) {}

    fn off((): &(), _: &[f32]) -> Option<f64> {
        None
    }
}

/// The rounding of a pixel: a sum of sixteen products.
const OF_PIXEL: f32 = 4e-6;
/// The rounding of a slice: of its opacity and light as a share of these, of the light through it, and of sums of light.
const OF_OPACITY: f32 = 1.5e-6;
pub(super) const OF_THROUGH: f32 = 3e-7;
pub(super) const OF_SUM: f32 = 1.5e-7;

/// The light of a group on its gradients, and how far it may be off.
struct Shaded {
    lit: Lit,
    off: Lit,
}

/// A slice where it meets a group of cells.
struct GroupSlice<'a> {
    means: Sixteen,
    lengths: Sixteen,
    /// The error of the means.
    error: f32,
    shaded: Option<Shaded>,
    colours: &'a Entries,
    /// How steep the colours are near each entry.
    steep: &'a [Steepness],
    /// The most light that a value has, and the rounding of the drawn light.
    brightest: f32,
    rounding: f32,
}

#[inline(always)]
fn add(row: &Row<'_>, of: &Certificate<'_>, groups: RowGroups<'_, Bounded>) {
    let RowGroups { states, limits, live, .. } = groups;
    let (colours, shader) = (&of.composite.table.colours, of.composite.shader.as_ref());
    for (n, ((group, limit), live)) in states.iter_mut().zip(limits).zip(live).enumerate() {
        if !*live {
            continue;
        }
        let error = of.errors.of_group(group.frame as usize, row.place, n);
        let (means, lengths) = row.means(n);
        let shaded = shader.map(|shader| {
            let present = |i: usize| lengths[i] / row.density;
            let off = std::array::from_fn(|i| of.errors.of_gradient(error, present(i)));
            Shaded::new(shader, &row.gradient(n, Some(&means)), &off)
        });
        if shaded.is_none() || !is_clear(&means, colours) {
            let lit = shaded.as_ref().map(|shaded| &shaded.lit);
            *limit = add_part(&means, &lengths, colours, lit, &mut group.light);
        }
        let (steep, brightest, rounding) = (of.steepest.within(error), of.brightest, of.rounding);
        bound(&GroupSlice { means, lengths, error, shaded, colours, steep, brightest, rounding }, group);
        if *limit < CLOSED {
            group.end(of.brightest);
        }
    }
}

impl Shaded {
    /// The light on gradients that are off by at most these vectors' lengths.
    #[inline(always)]
    fn new(shader: &Shader, gradient: &[Sixteen; 3], off: &Sixteen) -> Self {
        let mut shaded = Self { lit: shader.shade(gradient), off: Lit { colour: [0.0; GROUP], gloss: [0.0; GROUP] } };
        for i in 0..GROUP {
            let doubt = shader.doubt([gradient[0][i], gradient[1][i], gradient[2][i]], off[i]);
            (shaded.off.colour[i], shaded.off.gloss[i]) = (doubt[0], doubt[1]);
        }
        shaded
    }
}

/// Adds the errors that a slice makes (eq 49). The group has the drawn light of the slice already.
#[inline(always)]
fn bound(slice: &GroupSlice<'_>, group: &mut Bounded) {
    let (places, rests) = places(&slice.means);
    for q in 0..GROUP / 4 {
        let numbers = four_entries(q, &places, &rests, slice.colours);
        for k in 0..4 {
            let i = 4 * q + k;
            if slice.lengths[i] == 0.0 {
                continue;
            }
            let steep = &slice.steep[places[i] as usize % ENTRIES];
            let power = Uncertain { number: numbers[4 * k + 3], off: slice.error * steep[3] + steep[4] };
            let opacity = power.opacities(slice.lengths[i]);
            if opacity.largest == 0.0 {
                continue;
            }
            let colours = slice.colours_of(i, &numbers, steep);
            let (behind, through) = (group.behind(i, slice.rounding), group.through[i]);
            let rounding = slice.brightest * (through * (OF_OPACITY * opacity.largest + OF_THROUGH) + OF_SUM);
            let errors = group.errors[q][4 * k..4 * k + 4].iter_mut();
            for ((error, colour), light) in errors.zip(colours).zip(behind.light) {
                let differs = (colour.number - light).abs() + behind.rounding;
                *error += through * (opacity.largest * colour.off + opacity.off * differs) + rounding;
            }
            group.through[i] = through * (1.0 - opacity.least) * (1.0 + OF_THROUGH);
        }
    }
}

/// A number, and how far that of the original may be off.
#[derive(Clone, Copy)]
struct Uncertain {
    number: f32,
    off: f32,
}

/// The least and the largest opacity that the original may have, and how far it may be off.
struct Opacities {
    least: f32,
    largest: f32,
    off: f32,
}

impl Uncertain {
    /// The opacities for powers of two by which light falls, on rays of this length.
    #[inline(always)]
    fn opacities(&self, length: f32) -> Opacities {
        let drawn = opacity(self.number * length);
        let least = opacity((self.number - self.off).max(0.0) * length);
        let largest = opacity((self.number + self.off) * length);
        Opacities { least, largest, off: (drawn - least).max(largest - drawn) }
    }
}

impl GroupSlice<'_> {
    /// The colours of a cell; the transmittance has none.
    #[inline(always)]
    fn colours_of(&self, i: usize, numbers: &Sixteen, steep: &Steepness) -> [Uncertain; 4] {
        let mut colours = [Uncertain { number: 0.0, off: 0.0 }; 4];
        for c in 0..3 {
            let (number, off) = (numbers[i % 4 * 4 + c], (self.error * steep[c]).min(1.0));
            colours[c] = match &self.shaded {
                None => Uncertain { number, off },
                Some(Shaded { lit, off: doubt }) => Uncertain {
                    number: number * lit.colour[i] + lit.gloss[i],
                    off: off * (lit.colour[i] + doubt.colour[i]) + number * doubt.colour[i] + doubt.gloss[i],
                },
            };
        }
        colours
    }
}

/// The drawn light of all slices behind, and the transmittance of these, per light that comes to them.
struct LightBehind {
    light: [f32; 4],
    rounding: f32,
}

impl Bounded {
    #[inline(always)]
    fn behind(&self, i: usize, rounding: f32) -> LightBehind {
        let [light, drawn] = [&self.light, &self.drawn].map(|cells| &cells[i / 4][i % 4 * 4..i % 4 * 4 + 4]);
        let through = light[3].max(f32::MIN_POSITIVE);
        let mut behind = LightBehind { light: [0.0; 4], rounding: (rounding / through).min(MOST_LIGHT) };
        for c in 0..3 {
            behind.light[c] = ((drawn[c] - light[c]) / through).clamp(0.0, MOST_LIGHT);
        }
        behind.light[3] = (drawn[3] / through).clamp(0.0, 1.0);
        behind
    }

    /// Adds the errors of a drawing that ends here: the rest of the original has at most this much light.
    #[inline(always)]
    fn end(&mut self, brightest: f32) {
        for i in 0..GROUP {
            for c in 0..4 {
                self.errors[i / 4][i % 4 * 4 + c] += brightest * self.through[i];
            }
        }
    }
}

/// No light is brighter, whatever the lamp.
const MOST_LIGHT: f32 = 6.0;
