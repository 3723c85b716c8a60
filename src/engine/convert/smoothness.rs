//! How well samples are predicted along each axis. A pyramid's last pass adds half of all nodes, the one before a quarter,
//! and so on. So files are smallest if the roughest axis comes first and the smoothest last.

use wavesplat_core::codec::scheme::Axis;

/// The axes in the order of an array's strides.
pub(super) const AXES: [Axis; 4] = [Axis::X, Axis::Y, Axis::Z, Axis::T];

/// Sorts the axes, the roughest first, by the prediction errors along them in some boxes, in units of `delta`. A box gives
/// the sample with a number, and has a size `[x, y, z, t]`; missing samples are NaN. Few are read.
pub(super) fn roughest_first<S: Fn(usize) -> f64>(
    boxes: impl Iterator<Item = (S, [usize; 4])>,
    delta: f64,
) -> [Axis; 4] {
    let mut axes = AXES;
    let mut sums = [(0.0, 0); 4];
    for (sample, dims) in boxes {
        for (axis, (bits, nodes)) in sums.iter_mut().enumerate() {
            let (more_bits, more_nodes) = bits_left(&sample, dims, axis, delta);
            (*bits, *nodes) = (*bits + more_bits, *nodes + more_nodes);
        }
    }
    let bits = sums.map(|(bits, nodes)| if nodes > 0 { bits / nodes as f64 } else { f64::INFINITY });
    axes.sort_by(|a, b| bits[b.index()].total_cmp(&bits[a.index()]));
    axes
}

/// Estimates the bits to code some nodes that are predicted from their neighbours on both sides along an axis (eq 33).
/// Returns the bits and the number of nodes.
fn bits_left(sample: &impl Fn(usize) -> f64, dims: [usize; 4], axis: usize, delta: f64) -> (f64, usize) {
    let [inner, outer] = [&dims[..axis], &dims[axis + 1..]].map(|dims| dims.iter().product::<usize>());
    let (n, odds) = (dims[axis], dims[axis].saturating_sub(1) / 2);
    let nodes = odds * inner * outer;
    let residual = |number: usize| {
        let (i, line) = (2 * (number % odds) + 1, number / odds);
        let at = |i: usize| sample(line % inner + inner * (i + n * (line / inner)));
        let near = at(i - 1) + at(i + 1);
        let predicted = if i >= 3 && i + 3 < n { (9.0 * near - (at(i - 3) + at(i + 3))) / 16.0 } else { near / 2.0 };
        (at(i) - predicted).abs()
    };
    // An odd distance meets nodes of all lines and places.
    let residuals = (0..nodes).step_by((nodes / NODES) | 1).map(residual).filter(|residual| residual.is_finite());
    residuals.fold((0.0, 0), |(bits, nodes), residual| (bits + libm::log2(1.0 + residual / delta), nodes + 1))
}

/// About this many nodes of a box are predicted along each axis.
const NODES: usize = 1 << 15;

#[cfg(test)]
mod tests {
    use super::*;

    fn sampled(dims: [usize; 4], value: impl Fn([f64; 4]) -> f64) -> (impl Fn(usize) -> f64, [usize; 4]) {
        let [x, y, z, _] = dims;
        let at = move |i: usize| value([i % x, i / x % y, i / (x * y) % z, i / (x * y * z)].map(|n| n as f64));
        (at, dims)
    }

    #[test]
    fn the_roughest_axis_comes_first() {
        let waves = sampled([20, 18, 16, 12], |[x, y, z, t]| (0.1 * x + 2.0 * y + 0.7 * z + 1.2 * t).sin());
        assert_eq!(roughest_first([waves].into_iter(), 1e-3), [Axis::Y, Axis::T, Axis::Z, Axis::X]);
        let flat = sampled([20, 1, 2, 12], |[x, .., t]| (x + 0.1 * t).sin());
        assert_eq!(roughest_first([flat].into_iter(), 1e-3), [Axis::Y, Axis::Z, Axis::X, Axis::T]);
    }

    #[test]
    fn equal_axes_and_missing_samples_keep_their_order() {
        assert_eq!(roughest_first([sampled([9; 4], |_| 3.0)].into_iter(), 1e-3), AXES);
        assert_eq!(roughest_first([sampled([9; 4], |_| f64::NAN)].into_iter(), 1e-3), AXES);
        assert_eq!(roughest_first(std::iter::empty::<(fn(usize) -> f64, _)>(), 1e-3), AXES);
    }
}
