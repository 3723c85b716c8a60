//! A transfer function as what light meets: a table of colours and extinctions.

use crate::colour::TransferFunction;

/// What is along the rays: colour and extinction for every value.
#[derive(Debug, Clone)]
pub(super) struct Medium {
    /// The value of the first entry, and entries per unit of value.
    first: f64,
    per_value: f64,
    /// Red, green, blue, and extinction per world unit.
    entries: Vec<[f32; 4]>,
}

/// Entries of a table: from one to the next a transfer function is taken to be straight.
const ENTRIES: usize = 4096;
/// No opacity is larger: what then comes through is less than half a level of an 8-bit picture.
const MOST_OPAQUE: f64 = 1.0 - 1.0 / 512.0;

impl Medium {
    /// Of opacities that are of a path of `unit` world units.
    pub(super) fn new(transfer: &TransferFunction, unit: f64) -> Self {
        let (colours, opacities) = (transfer.range(), transfer.opacity_range());
        let (lo, hi) = (colours.0.min(opacities.0), colours.1.max(opacities.1));
        let step = (hi - lo) / (ENTRIES - 1) as f64;
        let entry = |n: usize| {
            let value = if n == ENTRIES - 1 { hi } else { lo + n as f64 * step };
            let [r, g, b] = transfer.colour(value).unwrap_or_default();
            let extinction = -libm::log1p(-transfer.opacity(value).min(MOST_OPAQUE)) / unit;
            [r, g, b, extinction].map(|v| v as f32)
        };
        Self { first: lo, per_value: 1.0 / step, entries: (0..ENTRIES).map(entry).collect() }
    }

    /// Red, green, blue and extinction of a value: beyond the table that of its end.
    pub(super) fn at(&self, value: f64) -> [f32; 4] {
        let place = ((value - self.first) * self.per_value).clamp(0.0, (ENTRIES - 1) as f64);
        let n = (place as usize).min(ENTRIES - 2);
        let (share, from, to) = ((place - n as f64) as f32, &self.entries[n], &self.entries[n + 1]);
        std::array::from_fn(|i| from[i] + share * (to[i] - from[i]))
    }

    /// Whether no value from `lo` to `hi` can be seen.
    pub(super) fn is_clear(&self, (lo, hi): (f64, f64)) -> bool {
        let place = |value: f64| ((value - self.first) * self.per_value).clamp(0.0, (ENTRIES - 1) as f64);
        let entries = &self.entries[place(lo).floor() as usize..=place(hi).ceil() as usize];
        entries.iter().all(|entry| entry[3] == 0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_path_of_a_unit_has_the_opacity_that_was_asked_for() {
        let grey = TransferFunction::open("grey").expect("a map").over((10.0, 20.0)).expect("a range");
        let medium = Medium::new(&grey, 0.25);
        for (value, opacity) in [(10.0, 0.0), (12.5, 0.25), (15.0, 0.5), (19.0, 0.9), (25.0, MOST_OPAQUE), (0.0, 0.0)] {
            let extinction = f64::from(medium.at(value)[3]);
            assert!((1.0 - (-extinction * 0.25).exp() - opacity).abs() < 1e-5, "{value}");
        }
        assert!((medium.at(15.0)[0] - 0.5).abs() < 1e-6);
    }

    #[test]
    fn what_no_value_shows_is_clear() {
        let grey = TransferFunction::open("grey").expect("a map");
        let band = grey.with_opacity(&[(0.4, 0.0), (0.5, 1.0), (0.6, 0.0)]).expect("points");
        let medium = Medium::new(&band, 1.0);
        for (lo, hi, clear) in [
            (0.0, 0.39, true),
            (0.61, 1.0, true),
            (-5.0, -1.0, true),
            (0.3, 0.45, false),
            (0.3, 0.8, false),
            (2.0, 9.0, true),
        ] {
            assert_eq!(medium.is_clear((lo, hi)), clear, "{lo} to {hi}");
        }
        assert!(!medium.is_clear((f64::NEG_INFINITY, f64::INFINITY)));
    }
}
