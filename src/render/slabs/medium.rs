//! A transfer function ([Levoy](crate::bibliography)) as a medium: tables of colours and extinctions kappa (eq 30).

use crate::colour::TransferFunction;

/// The medium along the rays: colour and extinction of every value.
#[derive(Debug, Clone)]
pub(in crate::render) struct Medium {
    colours: Table<3>,
    /// Extinctions of a path of unit length.
    extinctions: Table<1>,
}

/// The largest opacity: the rest is less than half a level of an 8-bit picture.
const MOST_OPAQUE: f64 = 1.0 - 1.0 / 512.0;

impl Medium {
    pub(in crate::render) fn new(transfer: &TransferFunction) -> Self {
        let extinction = |value| -libm::log1p(-transfer.opacity(value).min(MOST_OPAQUE));
        Self {
            colours: Table::new(transfer.range(), |value| transfer.colour(value).unwrap_or_default()),
            extinctions: Table::new(transfer.opacity_range(), |value| [extinction(value)]),
        }
    }

    /// Red, green and blue of a value.
    pub(in crate::render) fn colour(&self, value: f64) -> [f32; 3] {
        self.colours.at(value)
    }

    /// -ln(1 - opacity) of a value: the extinction of eq 30 times the unit.
    pub(in crate::render) fn extinction(&self, value: f64) -> f32 {
        self.extinctions.at(value)[0]
    }

    /// Whether all values from `lo` to `hi` are transparent.
    pub(in crate::render) fn is_clear(&self, (lo, hi): (f64, f64)) -> bool {
        let index = |value: f64| self.extinctions.index(value);
        self.extinctions.entries[index(lo).floor() as usize..=index(hi).ceil() as usize].iter().all(|e| e[0] == 0.0)
    }
}

/// A function tabulated at even steps, with linear interpolation; constant beyond its ends.
#[derive(Debug, Clone)]
struct Table<const N: usize> {
    first: f64,
    per_value: f64,
    entries: Vec<[f32; N]>,
}

const ENTRIES: usize = 4096;

impl<const N: usize> Table<N> {
    fn new((lo, hi): (f64, f64), at: impl Fn(f64) -> [f64; N]) -> Self {
        let step = (hi - lo) / (ENTRIES - 1) as f64;
        let value = |n: usize| if n == ENTRIES - 1 { hi } else { lo + n as f64 * step };
        let entries = (0..ENTRIES).map(|n| at(value(n)).map(|v| v as f32)).collect();
        Self { first: lo, per_value: 1.0 / step, entries }
    }

    fn index(&self, value: f64) -> f64 {
        ((value - self.first) * self.per_value).clamp(0.0, (ENTRIES - 1) as f64)
    }

    fn at(&self, value: f64) -> [f32; N] {
        let index = self.index(value);
        let n = (index as usize).min(ENTRIES - 2);
        let (share, from, to) = ((index - n as f64) as f32, &self.entries[n], &self.entries[n + 1]);
        std::array::from_fn(|i| from[i] + share * (to[i] - from[i]))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_path_of_unit_length_has_the_requested_opacity() {
        let grey = TransferFunction::open("grey").expect("a map").over((10.0, 20.0)).expect("a range");
        let medium = Medium::new(&grey);
        for (value, opacity) in [(10.0, 0.0), (12.5, 0.25), (15.0, 0.5), (19.0, 0.9), (25.0, MOST_OPAQUE), (0.0, 0.0)] {
            let extinction = f64::from(medium.extinction(value));
            assert!((1.0 - (-extinction).exp() - opacity).abs() < 1e-5, "{value}");
        }
        assert!((medium.colour(15.0)[0] - 0.5).abs() < 1e-6);
    }

    #[test]
    fn ranges_without_opacity_are_clear() {
        let grey = TransferFunction::open("grey").expect("a map");
        let band = grey.with_opacity(&[(0.4, 0.0), (0.5, 1.0), (0.6, 0.0)]).expect("points");
        let medium = Medium::new(&band);
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
