//! Measures the errors of what is computed from decoded samples, so that estimates show what to promise.

use crate::base::sample::join_ranges;
use wavesplat_format::Side;

/// What is computed from the samples of a grid.
#[derive(Debug, Clone, Default)]
pub struct Computed {
    /// The distance of voxels along x, y, z.
    pub spacing: [f64; 3],
    /// The values whose isosurfaces matter.
    pub values: Vec<f64>,
}

/// The sums of squares of a result, and of its errors.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct ResultErrors {
    results: f64,
    errors: f64,
}

impl ResultErrors {
    /// Adds a result of the source, and of the decoded samples. Results of missing samples do not count.
    fn add(&mut self, source: f64, decoded: f64) {
        let (result, error) = (source * source, (decoded - source) * (decoded - source));
        if (result + error).is_finite() {
            self.results += result;
            self.errors += error;
        }
    }

    fn join(self, other: Self) -> Self {
        Self { results: self.results + other.results, errors: self.errors + other.errors }
    }

    /// The root mean square of the errors, as a share of that of the results; `None` if these are all 0.
    pub fn share(self) -> Option<f64> {
        (self.results > 0.0).then(|| (self.errors / self.results).sqrt())
    }
}

/// The edges of the lattice that an isosurface crosses, between neighbours along x, y, z.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Crossings {
    crossed: u64,
    changed: u64,
}

impl Crossings {
    fn join(self, other: Self) -> Self {
        Self { crossed: self.crossed + other.crossed, changed: self.changed + other.changed }
    }

    /// The edges that it crosses in only one of source and decoded samples, as a share of those that it crosses in the source; `None` if
    /// it crosses none.
    pub fn share(self) -> Option<f64> {
        (self.crossed > 0).then(|| self.changed as f64 / self.crossed as f64)
    }
}

/// Errors of what is computed from the samples of some blocks.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct DerivedErrors {
    /// Differences between frames.
    pub difference: ResultErrors,
    /// Gradients by central differences.
    pub gradient: ResultErrors,
    /// Laplacians.
    pub laplacian: ResultErrors,
    /// The largest error of the mean of a frame of a block.
    pub mean: f64,
    /// How far decoded samples lie beyond the extremes of a frame of a block, at most.
    pub overshoot: f64,
    /// For each value of [`Computed::values`].
    pub crossings: Vec<Crossings>,
}

/// A frame of a block: samples of the source, and decoded ones. Missing samples are NaN.
#[derive(Debug, Clone, Copy)]
pub struct FramePair<'a> {
    /// x fastest.
    pub source: &'a [f64],
    /// In the same order.
    pub decoded: &'a [f64],
}

impl FramePair<'_> {
    /// A function of the samples of the source, and of the decoded ones.
    fn map(&self, of: impl Fn(&[f64]) -> f64) -> [f64; 2] {
        [of(self.source), of(self.decoded)]
    }
}

/// The neighbours of voxels along an axis.
#[derive(Debug, Clone, Copy)]
struct AxisStep {
    spacing: f64,
    /// The numbers of neighbours differ by so much.
    step: usize,
}

impl AxisStep {
    fn slope(self, samples: &[f64], voxel: usize) -> f64 {
        (samples[voxel + self.step] - samples[voxel - self.step]) / (2.0 * self.spacing)
    }

    fn curvature(self, samples: &[f64], voxel: usize) -> f64 {
        let [left, right] = [samples[voxel - self.step], samples[voxel + self.step]];
        (left - 2.0 * samples[voxel] + right) / (self.spacing * self.spacing)
    }
}

impl DerivedErrors {
    /// Adds a frame of a block of `size` voxels; `before` is the frame before it.
    pub fn add_frame(&mut self, of: &Computed, size: [usize; 3], frame: FramePair<'_>, before: Option<FramePair<'_>>) {
        self.crossings.resize(of.values.len(), Crossings::default());
        let steps = [1, size[0], size[0] * size[1]];
        let along: Vec<usize> = (0..3).filter(|a| size[*a] >= 3).collect();
        let axes: Vec<_> = along.iter().map(|a| AxisStep { spacing: of.spacing[*a], step: steps[*a] }).collect();
        let (mut errors, mut count, none) = (0.0, 0_u64, (f64::INFINITY, f64::NEG_INFINITY));
        let mut ranges = [none; 2];
        for voxel in 0..frame.source.len() {
            let at = [voxel % size[0], voxel / size[0] % size[1], voxel / steps[2]];
            let [source, decoded] = frame.map(|samples| samples[voxel]);
            if (decoded - source).is_finite() {
                (errors, count) = (errors + (decoded - source), count + 1);
                ranges = [(ranges[0], source), (ranges[1], decoded)].map(|(range, v)| join_ranges(range, (v, v)));
            }
            if let Some(before) = before {
                let [then, decoded_then] = before.map(|samples| samples[voxel]);
                self.difference.add(source - then, decoded - decoded_then);
            }
            for a in (0..3).filter(|a| at[*a] + 1 < size[*a]) {
                self.add_edge(of, frame, [voxel, voxel + steps[a]]);
            }
            if along.iter().all(|a| at[*a] > 0 && at[*a] + 1 < size[*a]) {
                self.add_derivatives(frame, voxel, &axes);
            }
        }
        self.mean = self.mean.max((errors / count.max(1) as f64).abs());
        if count > 0 {
            self.overshoot = self.overshoot.max(ranges[0].0 - ranges[1].0).max(ranges[1].1 - ranges[0].1);
        }
    }

    /// Adds the edge between two neighbours.
    fn add_edge(&mut self, of: &Computed, frame: FramePair<'_>, ends: [usize; 2]) {
        for (value, found) in of.values.iter().zip(&mut self.crossings) {
            let is_above = |samples: &[f64], end: usize| Side::of(samples[end], *value) == Side::Above;
            let crosses = |samples: &[f64]| is_above(samples, ends[0]) != is_above(samples, ends[1]);
            let [source, decoded] = [crosses(frame.source), crosses(frame.decoded)];
            found.crossed += u64::from(source);
            found.changed += u64::from(source != decoded);
        }
    }

    /// Adds the gradient and the Laplacian at a voxel.
    fn add_derivatives(&mut self, frame: FramePair<'_>, voxel: usize, axes: &[AxisStep]) {
        for axis in axes {
            let [source, decoded] = frame.map(|samples| axis.slope(samples, voxel));
            self.gradient.add(source, decoded);
        }
        let [source, decoded] = frame.map(|samples| axes.iter().map(|axis| axis.curvature(samples, voxel)).sum());
        self.laplacian.add(source, decoded);
    }

    /// These and those of other blocks.
    pub fn join(self, other: &Self) -> Self {
        let longest = self.crossings.len().max(other.crossings.len());
        let at = |of: &[Crossings], i: usize| of.get(i).copied().unwrap_or_default();
        Self {
            difference: self.difference.join(other.difference),
            gradient: self.gradient.join(other.gradient),
            laplacian: self.laplacian.join(other.laplacian),
            mean: self.mean.max(other.mean),
            overshoot: self.overshoot.max(other.overshoot),
            crossings: (0..longest).map(|i| at(&self.crossings, i).join(at(&other.crossings, i))).collect(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIZE: [usize; 3] = [4, 3, 3];

    fn of(value: f64) -> Computed {
        Computed { spacing: [0.5, 1.0, 2.0], values: vec![value] }
    }

    /// Samples of a function of the voxel's place.
    fn samples(of: impl Fn([f64; 3]) -> f64) -> Vec<f64> {
        (0..36).map(|i| of([i % 4, i / 4 % 3, i / 12].map(|n| n as f64))).collect()
    }

    #[test]
    fn errors_of_derivatives_are_shares_of_them() {
        // 3 x^2 has the slope 12 x per unit (x in voxels of 0.5) and the curvature 24; twice of it is off by all of it.
        let source = samples(|[x, ..]| 3.0 * x * x);
        let decoded: Vec<f64> = source.iter().map(|v| 2.0 * v).collect();
        let (frame, before) = (
            FramePair { source: &source, decoded: &decoded },
            FramePair { source: &vec![0.0; 36], decoded: &vec![0.0; 36] },
        );
        let mut found = DerivedErrors::default();
        found.add_frame(&of(5.0), SIZE, frame, Some(before));
        assert_eq!([found.difference, found.gradient, found.laplacian].map(ResultErrors::share), [Some(1.0); 3]);
        assert_eq!(found.laplacian, ResultErrors { results: 2.0 * 24.0 * 24.0, errors: 2.0 * 24.0 * 24.0 });
        assert_eq!(found.gradient.results, 12.0 * 12.0 + 24.0 * 24.0);
        assert_eq!((found.mean, found.overshoot), (source.iter().sum::<f64>() / 36.0, 27.0));
        // 0, 3, 12, 27 cross 5 between x = 1 and 2; 0, 6, 24, 54 between 0 and 1.
        assert_eq!(found.crossings, [Crossings { crossed: 9, changed: 18 }]);
        let twice = found.clone().join(&found);
        assert_eq!((twice.gradient.share(), twice.crossings[0].share()), (Some(1.0), Some(2.0)));
    }

    #[test]
    fn missing_samples_do_not_count() {
        let (mut source, decoded) = (samples(|[x, y, z]| x + y + z), samples(|[x, y, z]| x + y + z + 0.25));
        source[0] = f64::NAN;
        let mut found = DerivedErrors::default();
        found.add_frame(&of(9.0), SIZE, FramePair { source: &source, decoded: &decoded }, None);
        assert_eq!((found.mean, found.gradient.errors, found.crossings[0].share()), (0.25, 0.0, None));
        assert_eq!(found.difference.share(), None);
    }
}
