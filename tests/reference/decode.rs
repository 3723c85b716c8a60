//! Decodes codes to samples as `format/FORMAT.md` section 8 says, node by node.
//!
//! Arithmetic is in `f64`. Results that FORMAT.md computes in 32-bit floats are rounded to `f32` after every
//! operation. `f64` has more than twice the digits, so rounding twice gives the same as rounding once.

/// The pyramid of a window's record; axes are 0 to 3.
#[derive(Debug, Clone)]
pub(crate) struct Pyramid {
    pub(crate) order: Vec<usize>,
    pub(crate) cubic: bool,
    pub(crate) growth: f64,
    pub(crate) most: f64,
    pub(crate) single: bool,
    /// Whether parts are nested.
    pub(crate) nested: bool,
    /// Whether there are ghost nodes.
    pub(crate) ghosts: bool,
    /// The number of tiers above tier 0.
    pub(crate) tiers: u8,
}

/// The value of a node that the block above has.
pub(crate) type Known<'a> = &'a dyn Fn([usize; 4]) -> f64;

/// A pass: its level, and the axis along which it adds nodes (none for the first pass).
#[derive(Debug, Clone, Copy)]
pub(crate) struct Pass {
    pub(crate) level: u32,
    axis: Option<usize>,
}

impl Pyramid {
    /// The extents with ghost nodes.
    pub(crate) fn outer(&self, extents: [usize; 4]) -> [usize; 4] {
        let ghost = |a: usize| self.ghosts && a < 3 && self.order.contains(&a) && extents[a].is_multiple_of(2);
        std::array::from_fn(|a| extents[a] + usize::from(ghost(a)))
    }

    /// All nodes that a pass of a tier's block adds, with its known ones, in the order of their codes.
    pub(crate) fn added(&self, pass: Pass, extents: [usize; 4], tier: u8) -> impl Iterator<Item = [usize; 4]> {
        let added = move |node: &[usize; 4]| self.is_in_tier(*node, tier) && self.adds(pass, extents, tier, *node);
        nodes(self.outer(extents)).filter(added)
    }

    /// Whether a node is on the lattice of a tier.
    fn is_in_tier(&self, node: [usize; 4], tier: u8) -> bool {
        node[..3].iter().all(|at| at.is_multiple_of(1 << tier))
    }

    /// The nodes of a tier's block, in the order of their numbers.
    pub(crate) fn nodes_of(&self, extents: [usize; 4], tier: u8) -> impl Iterator<Item = [usize; 4]> {
        let all = if tier > 0 { self.outer(extents) } else { extents };
        nodes(all).filter(move |node| self.is_in_tier(*node, tier))
    }

    /// The passes over a tier's block of these extents, coarse to fine.
    pub(crate) fn passes(&self, extents: [usize; 4], tier: u8) -> Vec<Pass> {
        let level = u32::from(tier);
        let is_after = |axis: usize| self.order.first() != Some(&axis); // comes after a pass in space of its level
        let own = |pass: &Pass| match (pass.axis, tier == self.tiers) {
            (None, is_last) => is_last,
            (Some(3), is_last) => is_last || pass.level < level || pass.level == level && is_after(3),
            (Some(_), true) => pass.level >= level,
            (Some(_), false) => pass.level == level,
        };
        self.all_passes(extents).into_iter().filter(own).collect()
    }

    fn all_passes(&self, extents: [usize; 4]) -> Vec<Pass> {
        let extents = self.outer(extents);
        let mut top = u32::from(self.tiers);
        while self.order.iter().any(|&axis| extents[axis] > 1 << top) {
            top += 1;
        }
        let mut passes = vec![Pass { level: top, axis: None }];
        for level in (0..top).rev() {
            for &axis in &self.order {
                if extents[axis] > 1 << level {
                    passes.push(Pass { level, axis: Some(axis) });
                }
            }
        }
        passes
    }

    /// The level part that holds the code of a node that a pass of a tier's block adds.
    pub(crate) fn part(&self, pass: Pass, node: [usize; 4], tier: u8) -> usize {
        let multiples = |of: usize| (0..3).all(|a| !self.order.contains(&a) || node[a].is_multiple_of(of << tier));
        let is_last = tier == self.tiers;
        match (pass.axis, pass.level.saturating_sub(self.tiers.into())) {
            (None, _) => 0,
            (Some(3), _) if is_last && self.nested && multiples(4) => 0,
            (Some(3), _) if is_last && self.nested && multiples(2) => 1,
            (Some(3), _) if pass.level == 0 && self.order.last() == Some(&3) => 3,
            (_, 0) => 2,
            (_, 1) => 1,
            _ => 0,
        }
    }

    /// Whether a pass adds the node. Ghost nodes are in lattices of more than distance 1.
    fn adds(&self, pass: Pass, extents: [usize; 4], tier: u8, node: [usize; 4]) -> bool {
        let place = |a: usize| self.order.iter().position(|&b| b == a);
        let stride = 1 << pass.level;
        let distance = |a: usize| match (place(a), pass.axis) {
            (None, _) => 1,
            (Some(_), None) => stride,
            (earlier, Some(axis)) if earlier <= place(axis) => stride,
            _ => 2 * stride,
        };
        if (0..4).any(|a| node[a] >= extents[a] && distance(a) == 1 && tier == 0) {
            return false;
        }
        let Some(axis) = pass.axis else { return self.order.iter().all(|&a| node[a] == 0) };
        let along = |a: usize| match place(a) {
            None => true,
            Some(_) if a == axis => node[a] % (2 * stride) == stride,
            earlier if earlier < place(axis) => node[a].is_multiple_of(stride),
            _ => node[a].is_multiple_of(2 * stride),
        };
        (0..4).all(along)
    }

    /// The step of a level.
    pub(crate) fn step(&self, step: f64, level: u32) -> f64 {
        let mut g: f64 = 1.0;
        for _ in 0..level {
            g = (g * self.growth).min(self.most);
        }
        step / g
    }

    fn round(&self, x: f64) -> f64 {
        if self.single { f64::from(x as f32) } else { x }
    }

    /// The prediction of a node in a pass.
    fn prediction(&self, pass: Pass, extents: [usize; 4], node: [usize; 4], values: &[f64]) -> f64 {
        let Some(axis) = pass.axis else { return 0.0 };
        let even = 2 << pass.level;
        let (i, n) = (node[axis] / even, extents[axis].div_ceil(even));
        let terms: Vec<(f64, usize)> = match (self.cubic, i) {
            _ if n == 1 => vec![(1.0, 0)],
            _ if i == n - 1 => vec![(-1.0 / 2.0, i - 1), (3.0 / 2.0, i)],
            (false, _) => vec![(1.0 / 2.0, i), (1.0 / 2.0, i + 1)],
            _ if n == 2 => vec![(1.0 / 2.0, i), (1.0 / 2.0, i + 1)],
            (true, 0) => vec![(3.0 / 8.0, 0), (3.0 / 4.0, 1), (-1.0 / 8.0, 2)],
            _ if i == n - 2 => vec![(-1.0 / 8.0, i - 1), (3.0 / 4.0, i), (3.0 / 8.0, i + 1)],
            _ => vec![(-1.0 / 16.0, i - 1), (9.0 / 16.0, i), (9.0 / 16.0, i + 1), (-1.0 / 16.0, i + 2)],
        };
        let mut sum = None;
        for (weight, e) in terms {
            let mut place = node;
            place[axis] = e * even;
            let product = self.round(weight * values[number(extents, place)]);
            sum = Some(sum.map_or(product, |sum| self.round(sum + product)));
        }
        sum.unwrap()
    }

    /// Computes all nodes of a block without tiers from all of its codes, pass after pass.
    pub(crate) fn decode(&self, extents: [usize; 4], step: f64, codes: &[i32]) -> Vec<f64> {
        self.decode_tier(extents, 0, step, codes, &|_| f64::NAN)
    }

    /// Computes all nodes of a tier's block from all of its codes, with zeros for known nodes, and from the block above.
    pub(crate) fn decode_tier(
        &self,
        extents: [usize; 4],
        tier: u8,
        step: f64,
        codes: &[i32],
        known: Known<'_>,
    ) -> Vec<f64> {
        let outer = self.outer(extents);
        let mut values = vec![f64::NAN; nodes(outer).count()];
        let is_known = |node: [usize; 4]| tier < self.tiers && self.is_in_tier(node, tier + 1);
        for node in nodes(outer).filter(|node| is_known(*node)) {
            values[number(outer, node)] = known(node);
        }
        let mut codes = codes.iter();
        for pass in self.passes(extents, tier) {
            let step = self.round(self.step(step, pass.level));
            for node in self.added(pass, extents, tier) {
                let q = self.round(f64::from(*codes.next().unwrap()));
                if is_known(node) {
                    assert_eq!(q, 0.0, "a code of a known node");
                    continue;
                }
                let p = self.prediction(pass, outer, node, &values);
                values[number(outer, node)] = self.round(p + self.round(q * step));
            }
        }
        assert!(codes.next().is_none(), "codes are left");
        self.nodes_of(extents, tier).map(|node| values[number(outer, node)]).collect()
    }
}

/// The number of a node.
fn number(extents: [usize; 4], node: [usize; 4]) -> usize {
    node[0] + extents[0] * (node[1] + extents[1] * (node[2] + extents[2] * node[3]))
}

/// All nodes, in the order of their numbers.
pub(crate) fn nodes(extents: [usize; 4]) -> impl Iterator<Item = [usize; 4]> {
    let count = extents.iter().product();
    (0..count).map(move |i| {
        let (x, rest) = (i % extents[0], i / extents[0]);
        let (y, rest) = (rest % extents[1], rest / extents[1]);
        [x, y, rest % extents[2], rest / extents[2]]
    })
}

/// The frames of one voxel from its `haar` coefficients.
pub(crate) fn haar(coefficients: &[f64]) -> Vec<f64> {
    // The weights of the sums after each step, finest first.
    let mut weights = vec![vec![1.0_f64; coefficients.len()]];
    while weights[weights.len() - 1].len() > 1 {
        weights.push(weights[weights.len() - 1].chunks(2).map(|pair| pair.iter().sum()).collect());
    }
    let mut sums = vec![coefficients[0]];
    let mut details = coefficients[1..].iter();
    for fine in weights.iter().rev().skip(1) {
        let mut finer = Vec::new();
        for (pair, s) in fine.chunks(2).zip(&sums) {
            if pair.len() == 1 {
                finer.push(*s);
                continue;
            }
            let d = details.next().unwrap();
            let (a, b) = ((pair[0] / (pair[0] + pair[1])).sqrt(), (pair[1] / (pair[0] + pair[1])).sqrt());
            finer.push(a * s + b * d);
            finer.push(b * s - a * d);
        }
        sums = finer;
    }
    sums
}

/// The frames of one voxel from its 2N + 1 `multi` coefficients; returns all 2N + 1.
pub(crate) fn multi(coefficients: &[f64]) -> Vec<f64> {
    let intervals = (coefficients.len() - 1) / 2;
    let mut coarse = coefficients[..3].to_vec();
    let mut fine_intervals = 2;
    while fine_intervals <= intervals {
        let wavelets = &coefficients[fine_intervals + 1..2 * fine_intervals + 1];
        coarse = multi_level(&coarse, wavelets);
        fine_intervals *= 2;
    }
    let last = coarse.len() - 1;
    for node in (0..=last).step_by(2) {
        let end = node == 0 || node == last;
        coarse[node] /= if end { 0.5773502691896258 } else { 0.816496580927726 };
    }
    for mid in (1..last).step_by(2) {
        coarse[mid] = coarse[mid] / 0.7216878364870322 - 0.3 * (coarse[mid - 1] + coarse[mid + 1]);
    }
    coarse
}

/// The scaling coefficients of the next finer level.
#[allow(clippy::approx_constant, reason = "the digits of the specification")]
fn multi_level(scaling: &[f64], wavelets: &[f64]) -> Vec<f64> {
    const END_NODE: [f64; 4] = [0.7071067811865475, 0.6363961030678927, -0.3, -0.07071067811865475];
    const END_WAVELET: [f64; 4] = [-0.7071067811865475, 0.6363961030678927, -0.3, -0.07071067811865475];
    const Q3: f64 = 0.21213203435596428;
    const Q10: f64 = 0.7071067811865476;
    const NODE: [f64; 7] = [-0.05, -Q3, 0.45, Q10, 0.45, -Q3, -0.05];
    const EVEN: [f64; 7] = [-0.05, -Q3, 0.45, -Q10, 0.45, -Q3, -0.05];
    const ODD: [f64; 7] =
        [-0.07071067811865475, -0.3, 0.6363961030678927, 0.0, -0.6363961030678927, 0.3, 0.07071067811865475];
    const MID: [f64; 3] = [0.4242640687119285, 0.8, 0.4242640687119285];
    let intervals = wavelets.len();
    let (last, end) = (intervals / 2, 2 * intervals);
    let mut fine = vec![0.0; 2 * intervals + 1];
    let mut add = |coefficient: f64, taps: &[f64], at: &dyn Fn(usize) -> usize| {
        for (i, tap) in taps.iter().enumerate() {
            fine[at(i)] += tap * coefficient;
        }
    };
    add(scaling[0], &END_NODE, &|i| i);
    add(wavelets[0], &END_WAVELET, &|i| i);
    for c in 1..last {
        add(scaling[2 * c], &NODE, &|i| 4 * c - 3 + i);
        add(wavelets[2 * c - 1], &EVEN, &|i| 4 * c - 3 + i);
        add(wavelets[2 * c], &ODD, &|i| 4 * c - 3 + i);
    }
    for c in 0..last {
        add(scaling[2 * c + 1], &MID, &|i| 4 * c + 1 + i);
    }
    add(scaling[2 * last], &END_NODE, &|i| end - i);
    add(wavelets[intervals - 1], &END_WAVELET, &|i| end - i);
    fine
}

/// The functions of a `learned` basis of `frames` frames.
pub(crate) fn learned_functions(values: &[i16], frames: usize) -> Vec<Vec<f64>> {
    let one_at = |k: usize| (0..frames).map(|i| if i == k { 1.0 } else { 0.0 }).collect::<Vec<f64>>();
    let mut candidates = Vec::new();
    for function in values.chunks(frames) {
        candidates.push(function.iter().map(|v| f64::from(*v) / 32768.0).collect());
    }
    candidates.extend((0..frames).map(|k| haar(&one_at(k))));
    candidates.extend((0..frames).map(one_at));
    let mut functions: Vec<Vec<f64>> = Vec::new();
    for mut f in candidates {
        if functions.len() == frames {
            break;
        }
        let before = dot(&f, &f);
        for _ in 0..2 {
            for u in &functions {
                let r = dot(&f, u);
                for t in 0..frames {
                    f[t] -= r * u[t];
                }
            }
        }
        let s = dot(&f, &f);
        if s > 1e-10 * before.max(1e-10) {
            functions.push(f.iter().map(|v| v / s.sqrt()).collect());
        }
    }
    functions
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    let mut sum = a[0] * b[0];
    for t in 1..a.len() {
        sum += a[t] * b[t];
    }
    sum
}

/// The frames of one voxel from its coefficients and the functions of a `learned` basis.
pub(crate) fn learned(coefficients: &[f64], functions: &[Vec<f64>]) -> Vec<f64> {
    let frames = functions[0].len();
    (0..frames).map(|t| (0..frames).fold(0.0, |sum, k| sum + coefficients[k] * functions[k][t])).collect()
}

mod tests {
    use super::*;

    #[test]
    fn five_nodes_by_hand() {
        let pyramid = Pyramid {
            order: vec![0],
            cubic: true,
            growth: 2.0,
            most: 4.0,
            single: false,
            nested: false,
            ghosts: false,
            tiers: 0,
        };
        let extents = [5, 1, 1, 1];
        assert_eq!(pyramid.decode(extents, 1.0, &[8, 4, 2, 1, -1]), [2.0, 4.0, 3.5, 2.5, 3.0]);
        let parts: Vec<usize> =
            pyramid.passes(extents, 0).into_iter().map(|pass| pyramid.part(pass, [0; 4], 0)).collect();
        assert_eq!(parts, [0, 0, 1, 2]);
    }

    #[test]
    fn every_node_is_added_once() {
        for order in [vec![0, 1, 2, 3], vec![3, 1], vec![2], vec![]] {
            let pyramid = Pyramid {
                order,
                cubic: false,
                growth: 1.0,
                most: 1.0,
                single: false,
                nested: false,
                ghosts: false,
                tiers: 0,
            };
            for extents in [[1, 1, 1, 1], [5, 3, 2, 9], [4, 8, 1, 2]] {
                let added = |node| {
                    pyramid.passes(extents, 0).iter().filter(|pass| pyramid.adds(**pass, extents, 0, node)).count()
                };
                assert!(nodes(extents).all(|node| added(node) == 1), "{pyramid:?} {extents:?}");
            }
        }
    }

    #[test]
    fn learned_functions_are_orthonormal_and_as_many_as_frames() {
        for values in [vec![], vec![0; 6], vec![1; 6], vec![1, 2, 3, 4, 5, 6, 2, 4, 6, 8, 10, 12, -9, 0, 0, 0, 0, 9]] {
            let functions = learned_functions(&values, 6);
            assert_eq!(functions.len(), 6);
            for (a, b) in (0..36).map(|i| (i / 6, i % 6)) {
                let expected = if a == b { 1.0 } else { 0.0 };
                assert!((dot(&functions[a], &functions[b]) - expected).abs() < 1e-15);
            }
        }
    }
}
