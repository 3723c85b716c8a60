//! What colours mean, at the right: a colour bar, or the values of isosurfaces.

use super::canvas::Canvas;
use super::layout::BAR;
use super::text::{Letters, shortened};
use super::{over, ticks, volume};
use crate::render::Surface;
use wavesplat_core::colour::Scale;

/// Where a bar or a list of surfaces stands, in pixels.
struct Place {
    left: f64,
    top: f64,
    thick: f64,
    length: f64,
    /// The room for a text, to the left.
    room: f64,
}

impl Place {
    /// The place beside the name of the values; `None` if the picture is too small.
    fn new(canvas: &Canvas<'_>, has_name: bool) -> Option<Self> {
        let (size, [width, height]) = (canvas.letters.size, canvas.size());
        let name = if has_name { 1.9 } else { 0.6 };
        let thick = (1.1 * size).round();
        let left = (width - name * size - thick).round();
        let (top, length) = ((0.2 * height).max(2.5 * size).round(), (0.6 * height).round());
        let place = Self { left, top, thick, length, room: (BAR - name - 2.3) * size };
        (top + length + size <= height).then_some(place)
    }
}

/// Draws the colours of values, with round values to the left and their name to the right.
pub(super) fn draw(canvas: &mut Canvas<'_>, scale: &Scale, name: &str) {
    let Some(place) = Place::new(canvas, !name.is_empty()) else { return };
    let Place { left, top, thick, length, room } = place;
    let (size, texts) = (canvas.letters.size, canvas.taken.len());
    let rim = swatch(canvas, [left, top], [thick, length], |canvas, row| {
        canvas.fill(row, [thick as i64, 1], scale.colour_at(1.0 - (row[1] as f64 - top) / (length - 1.0).max(1.0)));
    });
    let values = ticks::ticks(scale, ((length / (2.0 * size)) as usize).clamp(2, 8));
    for (text, value) in bar_texts(&canvas.letters, &values, room).into_iter().zip(values) {
        let at = top + (1.0 - scale.share(value)) * (length - 1.0) + 0.5;
        let half = canvas.letters.width(&text) / 2.0;
        if 2.0 * half <= room && canvas.write(&text, [left - 0.8 * size - half, at]) {
            canvas.line([left - rim - 0.4 * size, at], [left - rim, at], rim);
        }
    }
    finish(canvas, &place, name, texts);
}

/// Draws the colour of each isosurface with its value to the left, the largest value at the top, and the name of the values to
/// the right. Surfaces that have no room are left out.
pub(super) fn draw_surfaces(canvas: &mut Canvas<'_>, surfaces: &[Surface], name: &str) {
    let Some(place) = Place::new(canvas, !name.is_empty()) else { return };
    let Place { left, top, thick, length, room } = place;
    let (size, texts, background) = (canvas.letters.size, canvas.taken.len(), canvas.background);
    let mut surfaces = surfaces.to_vec();
    surfaces.sort_by(|a, b| b.value.total_cmp(&a.value));
    for (n, surface) in surfaces.iter().take((length / (2.0 * size)) as usize).enumerate() {
        let (at, text) = ((top + 2.0 * n as f64 * size).round(), volume::text(four_digits(surface.value)));
        let colour = surface.colour.map(|share| (255.0 * share).round() as u8);
        let colour = over(background, colour, surface.opacity);
        swatch(canvas, [left, at], [thick, thick], |canvas, row| canvas.fill(row, [thick as i64, 1], colour));
        let half = canvas.letters.width(&text) / 2.0;
        if 2.0 * half <= room {
            canvas.write(&text, [left - 0.6 * size - half, at + thick / 2.0]);
        }
    }
    finish(canvas, &place, name, texts);
}

/// Fills a rectangle row by row, in a rim of ink. Returns the width of the rim.
fn swatch(canvas: &mut Canvas<'_>, corner: [f64; 2], size: [f64; 2], fill: impl Fn(&mut Canvas<'_>, [i64; 2])) -> f64 {
    let rim = (volume::THIN * canvas.letters.size).round().max(1.0);
    let ([x, y], [w, h], edge) = (corner.map(|n| n as i64), size.map(|n| n as i64), rim as i64);
    canvas.fill([x - edge, y - edge], [w + 2 * edge, h + 2 * edge], canvas.ink);
    (y..y + h).for_each(|row| fill(canvas, [x, row]));
    rim
}

/// Writes the name of the values, and takes the place of all but the first `texts` texts.
fn finish(canvas: &mut Canvas<'_>, place: &Place, name: &str, texts: usize) {
    let (size, [width, height]) = (canvas.letters.size, canvas.size());
    let name = shortened(name, |text| canvas.letters.width(text) <= 0.9 * height);
    let half = canvas.letters.width(&name) / 2.0;
    let middle = (place.top + place.length / 2.0).clamp(half, (height - half).max(half));
    canvas.write_upwards(&name, [width - 0.9 * size, middle]);
    canvas.taken.truncate(texts);
    canvas.taken.push([[width - BAR * size, place.top - size], [width, place.top + place.length + size]]);
}

/// The texts of a bar's values, in the form that has room.
fn bar_texts(letters: &Letters, values: &[f64], room: f64) -> Vec<String> {
    let texts = ticks::texts(values);
    let with_power: Vec<String> = values.iter().map(|value| ticks::with_power(*value)).collect();
    let width = |texts: &[String]| texts.iter().map(|text| letters.width(text)).fold(0.0, f64::max);
    if width(&texts) > room && width(&with_power) < width(&texts) { with_power } else { texts }
}

/// A value rounded to four digits.
fn four_digits(value: f64) -> f64 {
    format!("{value:.3e}").parse().unwrap_or(value)
}
