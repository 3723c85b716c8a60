//! Certified isosurfaces: a bound on the difference of every pixel from the same drawing of the original samples.
//!
//! The errors of the samples say at which slices the field is on the same side of every value in both drawings. The slices from one of
//! these to the next are a run. A drawing covers a share a of the light in a run and adds the light a c; a prime marks numbers of the
//! original. As in eq 49, runs are replaced one after another from the front. T' is the light that reaches a run, and R is what
//! the drawing shows behind it, if light of 1 comes through:
//!
//! ```text
//! |C' - C| <= sum over runs of T' |a' (c' - R) - a (c - R)|                                               (eq 50)
//! ```
//!
//! Where a surface may show in a run, a' follows from how far its edges may move ([`super::cover_bounds`]), and c' from the gradients that
//! are possible. Whether a surface shows that a ray almost reaches depends on the samples far around, so nothing is known of its least
//! opacity. As for composites, the original is drawn to the end of its rays.

use super::GROUP;
use super::batch::{SlicePass, Swept};
use super::certificate::{OF_SUM, OF_THROUGH, errors_of_pixels, pixel_of_errors, second_sweep};
use super::cover::Slope;
use super::cover_bounds::{Interval, MayShow, Place, Step};
use super::field_errors::FieldErrors;
use super::filter::Sixteen;
use super::iso::{Front, Isosurfaces, slope};
use super::row::{Blend, CLOSED, Point, Row, RowGroups};
use super::view::SlicedView;
use crate::render::batches::{SampleReader, Units};
use crate::render::light::MOST_SURFACES;
use crate::render::report::RenderReport;
use wavesplat_core::base::error::Result;
use wavesplat_core::base::vectors::dispatch;

/// The second sweep of isosurfaces, which bounds their errors.
pub(in crate::render) struct IsoCertificate<'a> {
    surfaces: &'a Isosurfaces,
    errors: FieldErrors<'a>,
    /// World units between voxels along b, c and a.
    spacing: [f32; 3],
    /// The length of a ray in world units from one voxel along a to the next.
    ray: f32,
}

/// The field at sixteen cells of a slice, and how far that of the original may be off.
#[derive(Debug, Clone, Copy)]
struct Field {
    slope: Slope,
    /// Of all values, and of each gradient per world unit.
    error: f32,
    gradient_errors: Sixteen,
}

/// Slices between two at which all sides are certain.
#[derive(Debug, Clone, Copy)]
struct Run {
    /// The values that the field is below at the first slice; `None` if that is not certain.
    below: Option<u64>,
    /// The drawn light before the run.
    start: [f32; 4],
    /// The surfaces that may show.
    shown: u64,
    /// The opacities of a surface where the field passes its value, over all steps and surfaces.
    passed: Interval,
    /// Whether the field only rises, or only falls.
    is_monotone: bool,
    /// The least share of light that comes through.
    through: f32,
    /// The least and the largest light of all surfaces that may show.
    dark: [f32; 3],
    bright: [f32; 3],
}

/// Sixteen cells.
#[derive(Debug, Clone, Copy)]
pub(in crate::render) struct Bounded {
    /// The number of the frame in its batch.
    frame: u32,
    front: Front,
    last: Field,
    runs: [Option<Run>; GROUP],
    /// The light of all slices: red, green, blue and the transmittance.
    drawn: [[f32; 4]; GROUP],
    /// Bounds of the light of the original that comes through the runs so far, and of the errors that they make.
    through: Sixteen,
    errors: [[f32; 4]; GROUP],
}

/// The same surfaces, seen wherever those of an original may be.
pub(in crate::render) fn seen_with_errors(
    surfaces: Isosurfaces,
    view: &SlicedView,
    reader: &SampleReader<'_>,
) -> Isosurfaces {
    let beyond = FieldErrors::new(view, reader, &surfaces.units).most;
    Isosurfaces { beyond: Some(beyond), ..surfaces }
}

/// Bounds of the errors of all frames' pixels: the largest of a pixel's light and opacity.
///
/// # Errors
/// Failed reads.
pub(in crate::render) fn iso_errors(
    pass: &SlicePass<'_, Isosurfaces>,
    swept: &Swept<Isosurfaces>,
    report: &mut RenderReport,
) -> Result<Vec<Vec<f32>>> {
    let certificate = IsoCertificate::new(pass);
    let start = |frame: usize, front: &Front| Bounded { frame: frame as u32, drawn: front.light, ..Bounded::START };
    let bounded = second_sweep(pass, swept, &certificate, start, report)?;
    debug_assert!(
        bounded.groups().flatten().all(|group| group.front.light == group.drawn),
        "both sweeps draw the same"
    );
    errors_of_pixels(bounded, pass, report)
}

impl<'a> IsoCertificate<'a> {
    fn new(pass: &SlicePass<'a, Isosurfaces>) -> Self {
        let SlicePass { view, blend: surfaces, reader, .. } = *pass;
        let spacing = view.per_world_unit().map(|per| (1.0 / per).abs() as f32);
        let along = |axis: usize| (surfaces.rays.direction[axis] * spacing[axis]).powi(2);
        let ray = (along(0) + along(1) + along(2)).sqrt();
        Self { surfaces, errors: FieldErrors::new(view, reader, &surfaces.units), spacing, ray }
    }

    /// The field at a group of cells.
    fn field(&self, row: &Row<'_>, group: usize, frame: u32) -> Field {
        let error = self.errors.of_group(frame as usize, row.place, group);
        let slope = dispatch!(slope(row, group));
        let (_, lengths) = row.means(group);
        let gradient_errors = std::array::from_fn(|i| self.errors.of_gradient(error, lengths[i] / row.density));
        Field { slope, error, gradient_errors }
    }

    /// The field of a cell. Its errors include the rounding of sums and products of few numbers.
    fn place(&self, field: &Field, i: usize, at: [f32; 3]) -> Place {
        let point = field.slope.point(i, at);
        let steep = (0..3).map(|i| point.gradient[i].abs() / self.spacing[i]).fold(0.0, f32::max);
        let gradient_error = field.gradient_errors[i] + ROUNDING * steep;
        let (rise, rise_error) = (self.surfaces.rays.rise(&point.gradient), gradient_error * self.ray);
        let errors_per_voxel = self.spacing.map(|spacing| spacing * gradient_error);
        let error = field.error + ROUNDING * point.value.abs();
        Place { point, error, gradient_error, errors_per_voxel, rise, rise_error }
    }

    /// The values that the field is below; `None` unless it is certain for all.
    fn below(&self, place: &Place) -> Option<u64> {
        let bit = |(n, value): (usize, &f32)| Some(u64::from(place.below(*value)?) << n);
        self.surfaces.values.iter().enumerate().try_fold(0, |below, surface| Some(below | bit(surface)?))
    }

    /// Goes on from one slice to the next in one cell.
    fn step(&self, group: &mut Bounded, i: usize, from: &Place, to: &Place) {
        if from.point.value.is_nan() || to.point.value.is_nan() {
            self.close(group, i, None);
            return;
        }
        let start = group.front.light[i];
        let run = group.runs[i].get_or_insert_with(|| Run::new(self.below(from), start));
        let step = Step { rays: &self.surfaces.rays, from, to };
        run.is_monotone &= step.is_monotone();
        (0..self.surfaces.values.len()).for_each(|n| self.add_surface(run, n, &step));
        self.surfaces.pass(&mut group.front.light[i], &from.point, &to.point);
        let below = self.below(to);
        if below.is_some() {
            self.close(group, i, below);
        }
    }

    /// Adds the ways in which a surface may show in a step.
    fn add_surface(&self, run: &mut Run, n: usize, step: &Step<'_>) {
        let MayShow { passed, turned } = step.may_show(self.surfaces.values[n], self.opacity(n));
        let Some(share) = [passed, turned].into_iter().flatten().map(|shown| shown.share).reduce(Interval::hull) else {
            return;
        };
        run.shown |= 1 << n;
        let most = [passed, turned].into_iter().flatten().map(|shown| shown.opacity.most).fold(0.0, f32::max);
        run.through *= 1.0 - most;
        if let Some(passed) = passed {
            run.passed = run.passed.hull(passed.opacity);
        }
        self.add_light(run, n, step, share);
    }

    /// Adds the light of a surface that may show at some share of a step.
    fn add_light(&self, run: &mut Run, n: usize, step: &Step<'_>, share: Interval) {
        let ends = [step.from, step.to].map(|place| place.point.gradient);
        let off = step.from.gradient_error.max(step.to.gradient_error);
        let rises = step.rises_through(self.surfaces.values[n]);
        let [least, largest] = self.surfaces.shader.between(ends, [share.least, share.most], off, rises);
        for (c, colour) in self.surfaces.surfaces[n].colour.into_iter().enumerate() {
            let light = |[share, gloss]: [f32; 2]| (colour as f32 * share + gloss).min(1.0);
            run.dark[c] = run.dark[c].min(light(least));
            run.bright[c] = run.bright[c].max(light(largest));
        }
    }

    fn opacity(&self, n: usize) -> f32 {
        self.surfaces.surfaces[n].opacity as f32
    }

    /// Ends the run of a cell, if there is one, at a slice where the field is below these values.
    fn close(&self, group: &mut Bounded, i: usize, below: Option<u64>) {
        if let Some(run) = group.runs[i].take() {
            group.charge(i, &run, run.opacity(below));
        }
    }
}

impl Run {
    const fn new(below: Option<u64>, start: [f32; 4]) -> Self {
        let (passed, is_monotone) = (Interval::NONE, true);
        Self { below, start, shown: 0, passed, is_monotone, through: 1.0, dark: [1.0; 3], bright: [0.0; 3] }
    }

    /// The opacity that the original may have in a run that ends where the field is below these values. If it passes a value for sure, that
    /// surface shows, whatever else does. It passes one value once if it only rises or only falls.
    fn opacity(&self, below: Option<u64>) -> Interval {
        let passes = self.below.zip(below).is_some_and(|(from, to)| from != to);
        let is_single = passes && self.is_monotone && self.shown.is_power_of_two();
        Interval {
            least: if passes { self.passed.least } else { 0.0 },
            most: if is_single { self.passed.most } else { 1.0 - self.through },
        }
    }
}

impl Bounded {
    /// Before the first slice.
    const START: Self = Self {
        frame: 0,
        front: Isosurfaces::EMPTY,
        last: Field { slope: Slope::NOTHING, error: 0.0, gradient_errors: [0.0; GROUP] },
        runs: [None; GROUP],
        drawn: [Isosurfaces::NOTHING; GROUP],
        through: [1.0; GROUP],
        errors: [[0.0; 4]; GROUP],
    };

    /// Adds the errors that a run makes (eq 50), if the original has an opacity of `least` to `most` there.
    fn charge(&mut self, i: usize, run: &Run, Interval { least, most }: Interval) {
        let (start, end, drawn) = (run.start, self.front.light[i], self.drawn[i]);
        let per_light = |drawn: f64| if start[3] > 0.0 { drawn / f64::from(start[3]) } else { 0.0 };
        let covered = per_light(f64::from(start[3]) - f64::from(end[3]));
        for c in 0..4 {
            let behind = rest(&drawn, &end, c);
            let light = if c < 3 { per_light(f64::from(end[c]) - f64::from(start[c])) } else { 0.0 };
            let term = light - covered * behind; // a (c - R)
            let at = |opacity: f32, light: f32| f64::from(opacity) * (f64::from(light) - behind) - term;
            let [dark, bright] = if c < 3 { [run.dark[c], run.bright[c]] } else { [0.0; 2] };
            let ends = [at(least, dark), at(least, bright), at(most, dark), at(most, bright)];
            let off =
                ends.into_iter().fold(0.0, |most, end: f64| if end.abs() <= most { most } else { end.abs() }) as f32;
            if off > 0.0 || most > 0.0 {
                self.errors[i][c] += self.through[i] * (off + OF_THROUGH) + OF_SUM;
            }
        }
        self.through[i] *= (1.0 - least) * (1.0 + OF_THROUGH);
    }

    /// Adds the errors of a drawing that ends here: the rest of the original has at most this much light.
    fn end(&mut self) {
        for (errors, through) in self.errors.iter_mut().zip(self.through) {
            errors.iter_mut().for_each(|error| *error += through);
        }
    }
}

/// What is drawn behind the light so far, if light of 1 comes through: nothing, if none does.
fn rest(drawn: &[f32; 4], light: &[f32; 4], c: usize) -> f64 {
    let [drawn, light, through] = [drawn[c], light[c], light[3]].map(f64::from);
    match (through > 0.0, c) {
        (true, 3) => drawn / through,
        (true, _) => (drawn - light) / through,
        (false, 3) => 1.0,
        (false, _) => 0.0,
    }
}

/// For the rounding of products.
const ALLOWANCE: f32 = 1.0 + 1e-3;
/// The rounding of sums and products of few numbers.
const ROUNDING: f32 = 1e-6;

/// Surfaces are the bits of a word.
const _: () = assert!(MOST_SURFACES <= u64::BITS as usize);

impl Blend for IsoCertificate<'_> {
    type Group = Bounded;
    type Cell = [f32; 4];

    const EMPTY: Bounded = Bounded::START;
    const NOTHING: [f32; 4] = [0.0; 4];
    const OPEN: f32 = Isosurfaces::OPEN;
    const NUMBERS: usize = 1;

    fn least(&self) -> f32 {
        self.surfaces.least()
    }

    fn units(&self, middle: f64) -> Units {
        self.surfaces.units(middle)
    }

    fn is_shaded(&self) -> bool {
        true
    }

    fn shows(&self, range: (f32, f32)) -> bool {
        self.surfaces.shows(range)
    }

    fn reads_beside(&self) -> [usize; 2] {
        self.surfaces.reads_beside()
    }

    fn add(&self, row: &Row<'_>, RowGroups { states, limits, live, .. }: RowGroups<'_, Bounded>) {
        for (n, (group, limit)) in states.iter_mut().zip(limits).enumerate().filter(|(n, _)| live[*n]) {
            let next = self.field(row, n, group.frame);
            let follows = group.front.slice.wrapping_add(1) == row.slice;
            if follows {
                let marks = dispatch!(near(&group.last, &next, self));
                for i in (0..GROUP).filter(|i| marks >> i & 1 == 1) {
                    let [before, at] = self.surfaces.rays.places(row, n * GROUP + i);
                    let [from, to] = [self.place(&group.last, i, before), self.place(&next, i, at)];
                    self.step(group, i, &from, &to);
                }
                if marks != 0 {
                    *limit = group.front.light.iter().map(|cell| cell[3]).fold(0.0, f32::max);
                }
            } else {
                (0..GROUP).for_each(|i| self.close(group, i, None));
            }
            (group.last, group.front.slice) = (next, row.slice);
            if *limit < CLOSED {
                (0..GROUP).for_each(|i| self.close(group, i, None));
                group.end();
            }
        }
    }

    fn cells(group: &Bounded) -> [[f32; 4]; GROUP] {
        let mut ended = *group;
        for i in 0..GROUP {
            if let Some(run) = ended.runs[i].take() {
                ended.charge(i, &run, run.opacity(None));
            }
        }
        ended.errors
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

/// Marks the cells where a surface may show between two slices in either drawing, or where there is no field: cell i by bit i.
#[inline(always)]
fn near(from: &Field, to: &Field, of: &IsoCertificate<'_>) -> u32 {
    let (mut reached, mut is_near) = ([0.0; GROUP], [false; GROUP]);
    let (rays, error) = (&of.surfaces.rays, from.error.max(to.error));
    for (i, reached) in reached.iter_mut().enumerate() {
        let [first, last] = [from, to].map(|field| {
            let [b, c, a] = [0, 1, 2].map(|axis| field.slope.gradient[axis][i]);
            (a + rays.direction[0] * b + rays.direction[1] * c).abs() + field.gradient_errors[i] * of.ray
        });
        let [one, other] = [from, to].map(|field| {
            let across = field.slope.gradient[0][i].abs() + field.slope.gradient[1][i].abs();
            across + field.gradient_errors[i] * (of.spacing[0] + of.spacing[1])
        });
        let across = if one > other { one } else { other };
        let rounding = ROUNDING * (from.slope.values[i].abs() + to.slope.values[i].abs());
        *reached = error + rounding + ALLOWANCE * (0.5 * rays.between * (first + last) + 0.5 * rays.width * across);
    }
    for value in &of.surfaces.values {
        for i in 0..GROUP {
            let (a, b) = (from.slope.values[i] - value, to.slope.values[i] - value);
            let least = if a.abs() < b.abs() { a.abs() } else { b.abs() };
            let is_far = (least > reached[i]) & ((a < 0.0) == (b < 0.0));
            is_near[i] |= !is_far;
        }
    }
    (0..GROUP).fold(0, |marks, i| marks | u32::from(is_near[i]) << i)
}
