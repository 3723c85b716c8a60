//! Composites the slices front to back (eq 31; the operator "over" of [PorterDuff](wavesplat_core::bibliography)).

use super::GROUP;
use super::filter::Sixteen;
use super::row::{Blend, CLOSED, LastMeans, Point, Row, RowGroups};
use super::shade::{Lit, Shader};
use super::table::{ENTRIES, Entries, SlabTable, Table};
use super::view::SlicedView;
use crate::render::batches::Units;
use crate::render::light::Light;
use wavesplat_core::base::vectors::dispatch;
use wavesplat_core::colour::TransferFunction;

/// Emission and absorption: the light of each slice passes through the slices before it.
pub(in crate::render) struct Composite {
    pub(super) table: Table,
    /// The light of slabs of several slices.
    slabs: Option<SlabTable>,
    /// The light on the colours, if they are shaded.
    pub(super) shader: Option<Shader>,
    /// Whether the light of every ray follows from its own length (eq 30); else nearly whole rays count as whole.
    by_lengths: bool,
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
        let slabs = view.has_parts().then(|| SlabTable::new(&table, view.parts()));
        let shader = light.map(|light| Shader::new(light, view, table.faint(spacing)));
        Self { table, slabs, shader, by_lengths: false }
    }

    /// The same with the light of every ray from its own length, and so from one formula.
    pub(in crate::render) fn by_lengths(self) -> Self {
        Self { by_lengths: true, ..self }
    }
}

/// Sixteen cells as four vectors of four: red, green and blue of the light, and the transmittance.
pub(super) type Cells = [[f32; GROUP]; 4];

impl Blend for Composite {
    type Group = Cells;
    type Cell = [f32; 4];

    const EMPTY: Cells = [[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]; 4];
    const NOTHING: [f32; 4] = [0.0, 0.0, 0.0, 1.0];
    /// The limit is at least the largest transmittance of a group.
    const OPEN: f32 = GROUP as f32;

    fn units(&self, _: f64) -> Units {
        self.table.units
    }

    fn is_shaded(&self) -> bool {
        self.shader.is_some()
    }

    fn table_error(&self) -> Option<f64> {
        let of_table = |table: &Table| table.error().max(table.error_of_parts());
        let of_slabs = self.slabs.as_ref().map_or(0.0, |slabs| of_table(&slabs.table));
        Some(of_table(&self.table).max(of_slabs))
    }

    fn shows(&self, range: (f32, f32)) -> bool {
        self.table.shows(range.0, range.1)
    }

    fn add(&self, row: &Row<'_>, groups: RowGroups<'_, Cells>) {
        let slab = self.slabs.as_ref().filter(|_| row.thickness > 1);
        let table = slab.map_or(&self.table, |slab| &slab.table);
        let (steady, shader) = (slab.map(|slab| &*slab.steady), self.shader.as_ref());
        let slices =
            Slices { entries: &table.entries, colours: &table.colours, steady, shader, by_lengths: self.by_lengths };
        dispatch!(add(row, &slices, groups));
    }

    fn cells(group: &Cells) -> [[f32; 4]; GROUP] {
        std::array::from_fn(|i| std::array::from_fn(|c| group[i / 4][i % 4 * 4 + c]))
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

/// How the means of a slice, or of a slab, become light.
struct Slices<'a> {
    /// The light of whole rays.
    entries: &'a Entries,
    colours: &'a Entries,
    /// For a slab, the largest change of the means at each entry for which it counts as one slice.
    steady: Option<&'a [f32; ENTRIES]>,
    shader: Option<&'a Shader>,
    by_lengths: bool,
}

#[inline(always)]
fn add(row: &Row<'_>, slices: &Slices<'_>, groups: RowGroups<'_, Cells>) {
    let RowGroups { states, limits, live, last } = groups;
    for (n, ((group, limit), live)) in states.iter_mut().zip(limits).zip(live).enumerate() {
        if !*live {
            continue;
        }
        let (means, lengths) = if row.is_whole(n) && !slices.by_lengths {
            (row.sums(n), None)
        } else {
            let (means, lengths) = row.means(n);
            (means, Some(lengths))
        };
        if let Some(steady) = slices.steady {
            *live = !is_steady(&filled(&means, lengths.as_ref()), &mut last[n], row, steady);
            if *live {
                continue;
            }
        }
        *limit = match (slices.shader, &lengths) {
            (None, None) => add_whole(&means, slices.entries, group),
            (None, Some(lengths)) => add_part(&means, lengths, slices.colours, None, group),
            (Some(_), _) if is_clear(&means, slices.colours) => continue,
            (Some(shader), lengths) => {
                let lit = shader.shade(&row.gradient(n, lengths.as_ref().map(|_| &means)));
                add_part(&means, &lengths.unwrap_or([1.0; GROUP]), slices.colours, Some(&lit), group)
            }
        };
    }
}

/// The means, with that of a cell beside it for a cell that has none.
#[inline(always)]
fn filled(means: &Sixteen, lengths: Option<&Sixteen>) -> Sixteen {
    let Some(lengths) = lengths else { return *means };
    let first = lengths.iter().position(|length| *length > 0.0).unwrap_or(0);
    let (mut filled, mut near) = (*means, means[first]);
    for i in 0..GROUP {
        near = if lengths[i] > 0.0 { means[i] } else { near };
        filled[i] = near;
    }
    filled
}

/// Whether the means change so little from slab to slab that this slab counts as one slice. Keeps the means.
#[inline(always)]
fn is_steady(means: &Sixteen, last: &mut LastMeans, row: &Row<'_>, steady: &[f32; ENTRIES]) -> bool {
    let (places, _) = places(means);
    let mut most = [0.0; GROUP];
    for i in 0..GROUP {
        most[i] = steady[places[i] as usize % ENTRIES];
    }
    let mut beyond = u32::from(last.next != row.slice);
    for i in 0..GROUP {
        beyond |= u32::from((means[i] - last.means[i]).abs() > most[i]);
    }
    *last = LastMeans { means: *means, next: row.slice + row.thickness };
    beyond == 0
}

/// The numbers of the values of cells 4q to 4q + 3.
#[inline(always)]
pub(super) fn four_entries(q: usize, places: &[u32; GROUP], rests: &Sixteen, entries: &Entries) -> [f32; GROUP] {
    let [mut numbers, mut changes, mut shares] = [[0.0; GROUP]; 3];
    for i in 0..4 {
        let entry = &entries[places[4 * q + i] as usize % ENTRIES];
        for c in 0..4 {
            (numbers[4 * i + c], changes[4 * i + c], shares[4 * i + c]) = (entry[c], entry[4 + c], rests[4 * q + i]);
        }
    }
    for n in 0..GROUP {
        numbers[n] += shares[n] * changes[n];
    }
    numbers
}

/// A number of each of four cells, for all four numbers of a cell.
#[inline(always)]
fn spread(of_cells: [f32; 4]) -> [f32; GROUP] {
    let mut all = [0.0; GROUP];
    for i in 0..4 {
        for c in 0..4 {
            all[4 * i + c] = of_cells[i];
        }
    }
    all
}

/// The numbers of cells 4q to 4q + 3.
#[inline(always)]
fn four(q: usize, numbers: &Sixteen) -> [f32; 4] {
    [numbers[4 * q], numbers[4 * q + 1], numbers[4 * q + 2], numbers[4 * q + 3]]
}

/// The fourth numbers of four cells.
#[inline(always)]
fn fourths(cells: &[f32; GROUP]) -> [f32; 4] {
    [cells[3], cells[7], cells[11], cells[15]]
}

/// For each number, the entry before it, and how far it is towards the next, from 0 to 1.
#[inline(always)]
pub(super) fn places(numbers: &Sixteen) -> ([u32; GROUP], Sixteen) {
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

/// Adds a slice of full length behind a group of cells. Returns their limit.
#[inline(always)]
fn add_whole(means: &Sixteen, entries: &Entries, group: &mut Cells) -> f32 {
    let (places, rests) = places(means);
    let mut sum = [0.0; GROUP];
    for (q, cells) in group.iter_mut().enumerate() {
        let (lights, through) = (four_entries(q, &places, &rests, entries), spread(fourths(cells)));
        for n in 0..GROUP {
            cells[n] += through[n] * lights[n];
            sum[n] += cells[n];
        }
    }
    limit(group, &sum)
}

/// Whether none of these values has an opacity.
#[inline(always)]
pub(super) fn is_clear(means: &Sixteen, colours: &Entries) -> bool {
    let (places, _) = places(means);
    let mut sum = 0.0;
    for place in places {
        let entry = &colours[place as usize % ENTRIES];
        sum += entry[3].abs() + entry[7].abs();
    }
    sum == 0.0
}

/// Which of the four numbers of cells are colours.
const COLOURS: Sixteen = [1.0, 1.0, 1.0, 0.0, 1.0, 1.0, 1.0, 0.0, 1.0, 1.0, 1.0, 0.0, 1.0, 1.0, 1.0, 0.0];

/// Adds a slice whose rays have these lengths behind a group of cells (eq 30), with light on the colours if there is any (eq
/// 42). Returns their limit.
#[inline(always)]
pub(super) fn add_part(
    means: &Sixteen,
    lengths: &Sixteen,
    colours: &Entries,
    lit: Option<&Lit>,
    group: &mut Cells,
) -> f32 {
    let (places, rests) = places(means);
    let mut sum = [0.0; GROUP];
    for (q, cells) in group.iter_mut().enumerate() {
        let numbers = four_entries(q, &places, &rests, colours);
        let (extinctions, lengths) = (spread(fourths(&numbers)), spread(four(q, lengths)));
        let (shades, gloss) = match lit {
            Some(lit) => (spread(four(q, &lit.colour)), spread(four(q, &lit.gloss))),
            None => ([1.0; GROUP], [0.0; GROUP]),
        };
        let through = spread(fourths(cells));
        for n in 0..GROUP {
            let colour = COLOURS[n] * (numbers[n] * shades[n] + gloss[n]) - (1.0 - COLOURS[n]);
            cells[n] += through[n] * opacity(extinctions[n] * lengths[n]) * colour;
            sum[n] += cells[n];
        }
    }
    limit(group, &sum)
}

/// The largest transmittance of a group; or, if some cell is open for sure, their sum. `sum` has the sums of four vectors.
#[inline(always)]
fn limit(group: &Cells, sum: &[f32; GROUP]) -> f32 {
    let [a, b, c, d] = fourths(sum);
    let sum = a + b + c + d;
    if sum >= GROUP as f32 * CLOSED {
        return sum;
    }
    group.iter().flat_map(fourths).fold(0.0, f32::max)
}

/// The opacity where light falls by a power of two: 1 - 2^-power for a power of at least 0, to 2e-7.
#[inline(always)]
pub(super) fn opacity(power: f32) -> f32 {
    const WHOLE: f32 = 12_582_912.0;
    let power = -power.min(100.0);
    let rounded = power + WHOLE;
    let x = (power - (rounded - WHOLE)) * std::f32::consts::LN_2;
    let square = x * x;
    let rest = (1.0 / 6.0 + x * (1.0 / 24.0)) + square * (1.0 / 120.0 + x * (1.0 / 720.0));
    let grown = (x + square * 0.5) + (square * x) * rest;
    let exponent = (rounded.to_bits() as i32).wrapping_sub(WHOLE.to_bits() as i32) + 127;
    let scale = f32::from_bits((exponent << 23) as u32);
    (1.0 - scale) - scale * grown
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shorter_rays_have_the_opacity_of_their_length() {
        for full in [0.0_f64, 1e-9, 1e-4, 9.9e-4, 1.1e-3, 0.1, 0.199, 0.201, 0.5, 0.9, 0.998, 0.999_99] {
            for length in (0..=14).map(|i| if i == 0 { 0.01 } else { f64::from(i) / 14.0 }) {
                let extinction = -libm::log1p(-full) * length;
                let (found, exact) =
                    (opacity((extinction * std::f64::consts::LOG2_E) as f32), -libm::expm1(-extinction));
                let off = (f64::from(found) - exact).abs();
                assert!(off < 2e-7 && off <= 1e-6 * exact, "{full} {length}: {found} {exact}");
            }
        }
        assert_eq!(opacity(1e9), 1.0);
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
