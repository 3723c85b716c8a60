//! Composites the slices front to back (eq 31; the operator "over" of [PorterDuff](wavesplat_core::bibliography)).

use super::GROUP;
use super::filter::Sixteen;
use super::row::{Blend, CLOSED, Point, Row};
use super::shade::{Lit, Shader};
use super::table::{ENTRIES, Table};
use super::view::SlicedView;
use crate::render::batches::Units;
use crate::render::light::Light;
use wavesplat_core::base::vectors::dispatch;
use wavesplat_core::colour::TransferFunction;

/// Emission and absorption: the light of each slice passes through the slices before it.
pub(in crate::render) struct Composite {
    table: Table,
    /// The light on the colours, if they are shaded.
    shader: Option<Shader>,
}

impl Composite {
    /// For a view of voxels at most `spacing` apart. A path of the length `unit` has the opacity of the transfer function.
    pub(in crate::render) fn new(
        transfer: &TransferFunction,
        unit: f64,
        light: Option<Light>,
        view: &SlicedView,
        spacing: f64,
    ) -> Self {
        let table = Table::new(transfer, view.step / unit);
        let shader = light.map(|light| Shader::new(light, view, table.faint(spacing)));
        Self { table, shader }
    }
}

impl Blend for Composite {
    /// Red, green and blue of the light, and the transmittance.
    type Group = [[f32; 4]; GROUP];
    type Cell = [f32; 4];

    const EMPTY: Self::Group = [Self::NOTHING; GROUP];
    const NOTHING: [f32; 4] = [0.0, 0.0, 0.0, 1.0];
    /// The limit is at least the largest transmittance of a group.
    const OPEN: f32 = GROUP as f32;
    const LEAST: f32 = super::LEAST;

    fn units(&self, _: f64) -> Units {
        self.table.units
    }

    fn is_shaded(&self) -> bool {
        self.shader.is_some()
    }

    fn table_error(&self) -> Option<f64> {
        Some(self.table.error())
    }

    fn shows(&self, range: (f32, f32)) -> bool {
        self.table.shows(range.0, range.1)
    }

    fn add(&self, row: &Row<'_>, groups: &mut [Self::Group], limits: &mut [f32]) {
        match &self.shader {
            Some(shader) => dispatch!(add_shaded(row, &self.table.entries, shader, groups, limits)),
            None => dispatch!(add(row, &self.table.entries, groups, limits)),
        }
    }

    fn cells(group: &Self::Group) -> [[f32; 4]; GROUP] {
        *group
    }

    fn pixel(_: &Units, cells: [&[[f32; 4]; 4]; 4], weights: [[f32; 4]; 2], out: &mut [f32]) {
        pixel_of_light(cells, weights, out);
    }

    type Exact = ([f64; 4], bool);

    fn exact(&self) -> Self::Exact {
        ([0.0, 0.0, 0.0, 1.0], false)
    }

    fn step(&self, (light, met): &mut Self::Exact, point: &Point, share: f64) {
        let (through, mut slice) = (light[3], self.table.exact(point.value, point.density * share));
        if let Some(shader) = &self.shader {
            let [colour, gloss] = shader.shade_one(point.gradient);
            (0..3).for_each(|c| slice[c] = slice[c] * colour - slice[3] * gloss);
        }
        light.iter_mut().zip(slice).for_each(|(sum, number)| *sum += through * number);
        *met = true;
    }

    fn off((light, met): &Self::Exact, pixel: &[f32]) -> Option<f64> {
        met.then(|| off_light(light, pixel))
    }
}

/// The light and opacity of a pixel, from the light and transmittance of the cells around it.
pub(super) fn pixel_of_light(cells: [&[[f32; 4]; 4]; 4], [across, down]: [[f32; 4]; 2], out: &mut [f32]) {
    let mut sum = [0.0; 4];
    for (row, weight) in cells.into_iter().zip(down) {
        let mut of_row = [0.0; 4];
        for (cell, weight) in row.iter().zip(across) {
            (0..4).for_each(|i| of_row[i] += weight * cell[i]);
        }
        (0..4).for_each(|i| sum[i] += weight * of_row[i]);
    }
    let [r, g, b, through] = sum;
    let pixel = [r, g, b, 1.0 - through].map(|number| number.clamp(0.0, 1.0));
    out.iter_mut().zip(pixel).for_each(|(to, from)| *to = from);
}

/// The largest difference of a pixel from exact light and transmittance.
pub(super) fn off_light(exact: &[f64; 4], pixel: &[f32]) -> f64 {
    let exact = [exact[0], exact[1], exact[2], 1.0 - exact[3]].map(|number| number.min(1.0));
    let off = pixel.iter().zip(exact).map(|(found, exact)| (f64::from(*found) - exact).abs());
    off.fold(0.0, f64::max)
}

#[inline(always)]
fn add(row: &Row<'_>, entries: &[[f32; 8]; ENTRIES], groups: &mut [[[f32; 4]; GROUP]], limits: &mut [f32]) {
    for (n, (group, limit)) in groups.iter_mut().zip(limits).enumerate() {
        if !row.live[n] {
            continue;
        }
        *limit = if row.is_whole(n) {
            add_whole(&row.sums(n), entries, group)
        } else {
            let (means, lengths) = row.means(n);
            add_part(&means, &lengths, entries, group, *limit)
        };
    }
}

/// The same as [`add`] with light on the colours (eq 42).
#[inline(always)]
fn add_shaded(
    row: &Row<'_>,
    entries: &[[f32; 8]; ENTRIES],
    shader: &Shader,
    groups: &mut [[[f32; 4]; GROUP]],
    limits: &mut [f32],
) {
    for (n, (group, limit)) in groups.iter_mut().zip(limits).enumerate() {
        if !row.live[n] {
            continue;
        }
        let is_whole = row.is_whole(n);
        let (means, lengths) = if is_whole { (row.sums(n), [1.0; GROUP]) } else { row.means(n) };
        let Looked { lights, opacities, any } = look_up(&means, entries);
        if any {
            let lit = shader.shade(&row.gradient(n, (!is_whole).then_some(&means)));
            let shares = if is_whole { [1.0; GROUP] } else { shares(&opacities, &lengths) };
            *limit = put_lit_behind(group, &lights, &opacities, &lit, &shares);
        }
    }
}

/// The table's entries for sixteen values.
struct Looked {
    /// Red, green and blue times the opacity, and minus the opacity.
    lights: [[f32; 4]; GROUP],
    opacities: Sixteen,
    /// Whether any is not transparent.
    any: bool,
}

#[inline(always)]
fn look_up(means: &Sixteen, entries: &[[f32; 8]; ENTRIES]) -> Looked {
    let (places, rests) = places(means);
    let (mut lights, mut opacities, mut sum) = ([[0.0; 4]; GROUP], [0.0; GROUP], [0.0; 4]);
    for i in 0..GROUP {
        let entry = &entries[places[i] as usize % ENTRIES];
        for c in 0..4 {
            lights[i][c] = entry[c] + rests[i] * entry[4 + c];
            sum[c] += lights[i][c];
        }
        opacities[i] = -lights[i][3];
    }
    Looked { lights, opacities, any: sum[3] != 0.0 }
}

/// The same as [`put_behind`] with shaded colours and highlights (eq 42).
#[inline(always)]
fn put_lit_behind(
    group: &mut [[f32; 4]; GROUP],
    lights: &[[f32; 4]; GROUP],
    opacities: &Sixteen,
    lit: &Lit,
    shares: &Sixteen,
) -> f32 {
    /// Which of the four numbers are colours.
    const COLOURS: [f32; 4] = [1.0, 1.0, 1.0, 0.0];
    let mut sum = [0.0; 4];
    for i in 0..GROUP {
        let (through, more, gloss) = (group[i][3] * shares[i], lit.colour[i] - 1.0, lit.gloss[i] * opacities[i]);
        for c in 0..4 {
            let light = lights[i][c] + COLOURS[c] * (lights[i][c] * more + gloss);
            group[i][c] += through * light;
            sum[c] += group[i][c];
        }
    }
    limit(group, sum[3])
}

/// Adds these shares of light behind a group of cells. Returns their limit.
#[inline(always)]
fn put_behind(group: &mut [[f32; 4]; GROUP], lights: &[[f32; 4]; GROUP], shares: &Sixteen) -> f32 {
    let mut sum = [0.0; 4];
    for i in 0..GROUP {
        let through = group[i][3] * shares[i];
        for c in 0..4 {
            group[i][c] += through * lights[i][c];
            sum[c] += group[i][c];
        }
    }
    limit(group, sum[3])
}

/// For each number, the entry before it, and how far it is towards the next, from 0 to 1.
#[inline(always)]
fn places(numbers: &Sixteen) -> ([u32; GROUP], Sixteen) {
    /// Adding this rounds a number to a whole one, which the last bits then hold.
    const WHOLE: f32 = 12_582_912.0;
    let (mut entries, mut rests) = ([0; GROUP], [0.0; GROUP]);
    for i in 0..GROUP {
        let number = numbers[i].clamp(0.0, (ENTRIES - 1) as f32);
        let rounded = (number - 0.5) + WHOLE;
        entries[i] = rounded.to_bits() & (ENTRIES as u32 - 1);
        rests[i] = number - (rounded - WHOLE);
    }
    (entries, rests)
}

// The loops over cells below sum up what they compute, in order. So compilers keep the four numbers of a cell together,
// and do not gather entries number by number, which takes several times as long.

/// Adds a slice of full length behind a group of cells. Returns their limit.
#[inline(always)]
fn add_whole(means: &Sixteen, entries: &[[f32; 8]; ENTRIES], group: &mut [[f32; 4]; GROUP]) -> f32 {
    let (places, rests) = places(means);
    let mut sum = [0.0; 4];
    for i in 0..GROUP {
        let (entry, through) = (&entries[places[i] as usize % ENTRIES], group[i][3]);
        for c in 0..4 {
            group[i][c] += through * (entry[c] + rests[i] * entry[4 + c]);
            sum[c] += group[i][c];
        }
    }
    limit(group, sum[3])
}

/// The same for a slice with shorter rays. `before` is the limit.
#[inline(always)]
fn add_part(
    means: &Sixteen,
    lengths: &Sixteen,
    entries: &[[f32; 8]; ENTRIES],
    group: &mut [[f32; 4]; GROUP],
    before: f32,
) -> f32 {
    let Looked { lights, opacities, any } = look_up(means, entries);
    if any { put_behind(group, &lights, &shares(&opacities, lengths)) } else { before }
}

/// The largest transmittance of a group; or, if some cell is open for sure, their sum.
#[inline(always)]
fn limit(group: &[[f32; 4]; GROUP], sum: f32) -> f32 {
    if sum < GROUP as f32 * CLOSED { group.iter().map(|cell| cell[3]).fold(0.0, f32::max) } else { sum }
}

/// The opacities of shorter rays as shares of those of full length: (1 - (1 - opacity)^length) / opacity (eq 30).
#[inline(always)]
fn shares(opacities: &Sixteen, lengths: &Sixteen) -> Sixteen {
    let mut shares = [0.0; GROUP];
    for i in 0..GROUP {
        shares[i] = series(opacities[i], lengths[i]);
    }
    if opacities.iter().any(|opacity| *opacity > FAINTER) {
        for i in 0..GROUP {
            let exact = power(opacities[i], lengths[i]);
            shares[i] = if opacities[i] > FAINTER { exact } else { shares[i] };
        }
    }
    shares
}

/// Up to this opacity, six terms of the binomial series suffice: the rest is less than 2e-5 of the opacity.
const FAINTER: f32 = 0.2;

/// The share of a small opacity, by the binomial series.
#[inline(always)]
fn series(opacity: f32, length: f32) -> f32 {
    let term = |n: f32, rest: f32| 1.0 + (n - length) * (opacity * (1.0 / (n + 1.0))) * rest;
    length * term(1.0, term(2.0, term(3.0, term(4.0, term(5.0, 1.0)))))
}

/// The share of a larger opacity.
#[inline(always)]
fn power(opacity: f32, length: f32) -> f32 {
    (1.0 - exp2(length * log2((1.0 - opacity).max(1e-7)))) / opacity.max(FAINTER)
}

/// The logarithm to base 2 of a number above 0, to 1e-7.
#[inline(always)]
fn log2(number: f32) -> f32 {
    const HALF_ROOT: i32 = 0x3f35_04f3; // the bits of sqrt(1/2)
    let bits = number.to_bits() as i32;
    let exponent = (bits - HALF_ROOT) >> 23;
    let mantissa = f32::from_bits((bits - (exponent << 23)) as u32);
    let s = (mantissa - 1.0) / (mantissa + 1.0);
    let square = s * s;
    let series = 1.0 + square * (1.0 / 3.0 + square * (0.2 + square * (1.0 / 7.0 + square * (1.0 / 9.0))));
    exponent as f32 + 2.0 * std::f32::consts::LOG2_E * s * series
}

/// 2 to a power of at most 0, to 1e-6.
#[inline(always)]
fn exp2(power: f32) -> f32 {
    const WHOLE: f32 = 12_582_912.0;
    let rounded = power.max(-100.0) + WHOLE;
    let x = (power.max(-100.0) - (rounded - WHOLE)) * std::f32::consts::LN_2;
    let series =
        1.0 + x * (1.0 + x * (0.5 + x * (1.0 / 6.0 + x * (1.0 / 24.0 + x * (1.0 / 120.0 + x * (1.0 / 720.0))))));
    let exponent = (rounded.to_bits() as i32).wrapping_sub(WHOLE.to_bits() as i32) + 127;
    f32::from_bits((exponent << 23) as u32) * series
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shorter_rays_have_the_opacity_of_their_length() {
        for opacity in [0.0_f32, 1e-9, 1e-4, 9.9e-4, 1.1e-3, 0.1, 0.199, 0.201, 0.5, 0.9, 0.998, 0.999_99] {
            let lengths: Sixteen = std::array::from_fn(|i| if i == 0 { 0.01 } else { i as f32 / 14.0 });
            let found = shares(&[opacity; GROUP], &lengths);
            for (share, length) in found.into_iter().zip(lengths) {
                let exact = -f64::exp_m1(f64::ln_1p(-f64::from(opacity)) * f64::from(length));
                let off = (f64::from(share * opacity) - exact).abs();
                assert!(off < 4e-6, "{opacity} {length}: {share} {exact}");
            }
        }
    }

    #[test]
    fn places_are_between_two_entries() {
        let numbers: Sixteen =
            std::array::from_fn(|i| [0.0, 0.5, 1.0, 1.49, 1.5, 2.0, -3.0, 511.0, 510.9, 1e30][i % 10]);
        let (entries, rests) = places(&numbers);
        for ((entry, rest), number) in entries.into_iter().zip(rests).zip(numbers) {
            assert!((0.0..=1.0).contains(&rest));
            assert_eq!(entry as f32 + rest, number.clamp(0.0, 511.0));
        }
    }
}
