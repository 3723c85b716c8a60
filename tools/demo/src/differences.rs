//! Differences of two pictures, number by number.

/// |a - b|; none if both are background (NaN), infinite if only one is. Equal infinities do not differ.
pub fn difference(a: impl Into<f64>, b: impl Into<f64>) -> Option<f64> {
    let (a, b): (f64, f64) = (a.into(), b.into());
    match (a.is_nan(), b.is_nan()) {
        (true, true) => None,
        (false, false) if a == b => Some(0.0),
        (false, false) => Some((a - b).abs()),
        _ => Some(f64::INFINITY),
    }
}

/// The largest difference in each pixel of `channels` numbers; none if all are background in both.
pub fn of_pixels<T: Copy + Into<f64>>(a: &[T], b: &[T], channels: usize) -> Vec<Option<f64>> {
    let of_pixel = |(a, b): (&[T], &[T])| largest(a.iter().zip(b).map(|(a, b)| difference(*a, *b)));
    a.chunks_exact(channels).zip(b.chunks_exact(channels)).map(of_pixel).collect()
}

/// The largest of some differences, unless there is none.
pub fn largest(differences: impl Iterator<Item = Option<f64>>) -> Option<f64> {
    differences.flatten().reduce(f64::max)
}

/// Sums over the numbers of two pictures, or of several pairs of pictures.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Differences {
    /// Numbers that neither has as background.
    pub compared: u64,
    /// Numbers that both have as background.
    pub in_neither: u64,
    /// Numbers that one alone has as background.
    pub in_one: u64,
    /// The largest difference where neither has background.
    pub largest_compared: f64,
    /// Sum of the differences where neither has background.
    pub sum: f64,
    /// Sum of their squares.
    pub squares: f64,
    /// Position of the first largest difference. Background in only one picture counts as larger than all others. None
    /// if nothing differs.
    pub at: Option<u64>,
}

impl Differences {
    /// Of two runs of numbers; places count from the first number.
    ///
    /// # Panics
    /// If they differ in length.
    pub fn of<T: Copy + Into<f64>>(a: &[T], b: &[T]) -> Self {
        assert_eq!(a.len(), b.len(), "numbers to compare");
        let mut all = Self::default();
        let pairs = a.iter().zip(b).map(|(a, b)| ((*a).into(), (*b).into()));
        (0..).zip(pairs).for_each(|(at, (a, b))| all.add(at, a, b));
        all
    }

    /// Adds the numbers `a` and `b`, which are at `at`.
    fn add(&mut self, at: u64, a: f64, b: f64) {
        let Some(difference) = difference(a, b) else {
            self.in_neither += 1;
            return;
        };
        if difference > self.largest() {
            self.at = Some(at);
        }
        if a.is_nan() || b.is_nan() {
            self.in_one += 1;
            return;
        }
        self.compared += 1;
        self.largest_compared = self.largest_compared.max(difference);
        self.sum += difference;
        self.squares += difference * difference;
    }

    /// Adds the sums over numbers that lie `offset` after the first.
    pub fn join(&mut self, other: &Self, offset: u64) {
        if other.largest() > self.largest() {
            self.at = other.at.map(|at| at + offset);
        }
        self.compared += other.compared;
        self.in_neither += other.in_neither;
        self.in_one += other.in_one;
        self.largest_compared = self.largest_compared.max(other.largest_compared);
        self.sum += other.sum;
        self.squares += other.squares;
    }

    /// The largest difference; infinite where one alone has background, 0 where there is nothing to compare.
    pub fn largest(&self) -> f64 {
        if self.in_one > 0 { f64::INFINITY } else { self.largest_compared }
    }

    /// Whether nothing differs.
    pub fn is_identical(&self) -> bool {
        self.largest() == 0.0
    }

    /// The mean difference where neither has background; none if that is nowhere.
    pub fn mean(&self) -> Option<f64> {
        (self.compared > 0).then(|| self.sum / self.compared as f64)
    }

    /// The root of the mean square where neither has background; none if that is nowhere.
    pub fn rms(&self) -> Option<f64> {
        (self.compared > 0).then(|| (self.squares / self.compared as f64).sqrt())
    }

    /// The ratio of `peak` to the root of the mean square, in dB: infinite if nothing compared differs; none if nothing
    /// can be compared or the peak is 0.
    pub fn psnr(&self, peak: f64) -> Option<f64> {
        let rms = self.rms()?;
        match (rms == 0.0, peak > 0.0) {
            (true, _) => Some(f64::INFINITY),
            (false, true) => Some(20.0 * libm::log10(peak / rms)),
            (false, false) => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const NAN: f32 = f32::NAN;

    #[test]
    fn sums_are_those_of_the_numbers() {
        let found = Differences::of(&[1.0f32, 2.0, 3.0, 4.0], &[1.0, 5.0, 3.0, 0.0]);
        assert_eq!((found.largest(), found.at), (4.0, Some(3)));
        assert_eq!((found.mean(), found.rms()), (Some(7.0 / 4.0), Some(2.5)));
        assert!((found.psnr(250.0).unwrap_or_default() - 40.0).abs() < 1e-12);
        assert_eq!(found.psnr(0.0), None);
    }

    #[test]
    fn the_first_of_equal_differences_is_named() {
        assert_eq!(Differences::of(&[1u8, 2, 3], &[1, 4, 1]).at, Some(1));
        assert_eq!(Differences::of(&[NAN, 1.0, NAN], &[0.0, NAN, NAN]).at, Some(0));
    }

    #[test]
    fn background_in_one_differs_and_background_in_both_does_not() {
        let found = Differences::of(&[NAN, 1.0, 1.0, NAN], &[NAN, 9.0, NAN, 0.0]);
        assert_eq!((found.in_neither, found.in_one, found.compared), (1, 2, 1));
        assert_eq!((found.largest(), found.largest_compared, found.at), (f64::INFINITY, 8.0, Some(2)));
        assert_eq!((found.mean(), found.rms()), (Some(8.0), Some(8.0)));
        let nothing = Differences::of(&[NAN], &[NAN]);
        assert!(nothing.is_identical() && nothing.mean().is_none() && nothing.psnr(1.0).is_none());
    }

    #[test]
    fn a_pixel_is_its_channel_that_differs_most() {
        let found =
            of_pixels(&[1.0, 2.0, f64::NAN, f64::NAN, f64::NAN, 1.0], &[1.5, 5.0, f64::NAN, f64::NAN, 0.0, 1.0], 2);
        assert_eq!(found, [Some(3.0), None, Some(f64::INFINITY)]);
    }

    #[test]
    fn identical_pictures_have_infinite_psnr() {
        let found = Differences::of(&[f32::INFINITY, 2.0], &[f32::INFINITY, 2.0]);
        assert!(found.is_identical() && found.at.is_none());
        assert_eq!(found.psnr(1.0), Some(f64::INFINITY));
    }

    #[test]
    fn frames_join_to_what_they_are_together() {
        let (a, b) = ([1.0f32, 2.0, NAN, 4.0, 8.0, NAN], [1.5, 2.0, NAN, 7.0, 8.0, 1.0]);
        for middle in 0..=6 {
            let mut joined = Differences::of(&a[..middle], &b[..middle]);
            joined.join(&Differences::of(&a[middle..], &b[middle..]), middle as u64);
            assert_eq!(joined, Differences::of(&a, &b), "{middle}");
        }
    }
}
