//! Compares blocks of tiers with a slow twin that follows `FORMAT.md`, section 8, node by node, in the positions of voxels.

use super::tests::{below, bits, coarse_codes, put_zeros, some_codes};
use super::*;
use std::collections::HashMap;
use wavesplat_format::{Packing, Stencil};

type Node = [usize; 4];

/// A block of some tier.
struct Case {
    pyramid: Pyramid,
    size: [usize; 3],
    ks: usize,
    tier: u8,
}

impl Case {
    fn random(state: &mut u64) -> Self {
        let orders: [&[Axis]; 5] = [
            &[Axis::X, Axis::Y, Axis::Z],
            &[Axis::Z, Axis::X, Axis::Y, Axis::T],
            &[Axis::T, Axis::Y, Axis::Z, Axis::X],
            &[Axis::X, Axis::Y, Axis::T, Axis::Z],
            &[Axis::Y, Axis::T, Axis::X, Axis::Z],
        ];
        let stencil = [Stencil::Linear, Stencil::Cubic][below(2, state)];
        let (order, ghosts) = (orders[below(5, state)].to_vec(), below(3, state) > 0);
        let (tiers, packing) = (1 + below(3, state) as u8, Packing::Nested);
        let pyramid = Pyramid { order, stencil, growth: 1.5, most: 2.0, single: false, packing, ghosts, tiers };
        let tier = below(usize::from(tiers) + 1, state) as u8;
        let size = std::array::from_fn(|_| 1 + below(9 << tier, state));
        Self { pyramid, size, ks: 1 + below([3, 9, 20][below(3, state)], state), tier }
    }

    fn passes(&self) -> PredictionPasses<'_> {
        PredictionPasses::new(&self.pyramid, self.size, self.ks, self.tier)
    }

    fn is_last(&self) -> bool {
        self.tier == self.pyramid.tiers
    }

    /// The extents with ghost nodes.
    fn outer(&self) -> Node {
        let ghost = |n: usize| n + usize::from(self.pyramid.ghosts && n.is_multiple_of(2));
        let [x, y, z] = self.size.map(ghost);
        [x, y, z, self.ks]
    }

    /// All nodes on a lattice, in the order of node numbers.
    fn lattice(&self, first: Node, distance: Node, ends: Node) -> Vec<Node> {
        let along = |a: usize| (first[a]..ends[a]).step_by(distance[a]);
        let mut nodes = Vec::new();
        for k in along(3) {
            for z in along(2) {
                for y in along(1) {
                    nodes.extend(along(0).map(|x| [x, y, z, k]));
                }
            }
        }
        nodes
    }

    /// The nodes of the block's tier.
    fn all(&self) -> Vec<Node> {
        let (n, [x, y, z]) = (1 << self.tier, self.size);
        self.lattice([0; 4], [n, n, n, 1], if self.tier == 0 { [x, y, z, self.ks] } else { self.outer() })
    }

    /// Whether the block above has a node.
    fn is_known(&self, [x, y, z, _]: Node) -> bool {
        !self.is_last() && [x, y, z].iter().all(|at| at.is_multiple_of(2 << self.tier))
    }

    /// The passes: level, axis, first nodes, their distances and the ends of the lattice.
    fn listed(&self) -> Vec<(u32, Option<usize>, Node, Node, Node)> {
        let (outer, [x, y, z], tier) = (self.outer(), self.size, u32::from(self.tier));
        let order: Vec<usize> = self.pyramid.order.iter().map(|axis| axis.index()).collect();
        let mut levels = u32::from(self.pyramid.tiers);
        order.iter().for_each(|a| levels = levels.max(outer[*a].next_power_of_two().ilog2()));
        let mut strides = [1; 4];
        order.iter().for_each(|a| strides[*a] = 1 << levels);
        let least = [1 << tier, 1 << tier, 1 << tier, 1];
        let ends = |strides: Node| {
            let inner = [x, y, z, self.ks];
            std::array::from_fn(|a| if strides[a] > 1 || self.tier > 0 { outer[a] } else { inner[a] })
        };
        let mut found = Vec::new();
        if self.is_last() {
            found.push((levels, None, [0; 4], strides, ends(strides)));
        }
        let mut has_begun = self.is_last();
        for (level, axis) in (0..levels).rev().flat_map(|level| order.iter().map(move |axis| (level, *axis))) {
            strides[axis] = 1 << level;
            let is_own = if axis == 3 { has_begun } else { level == tier || self.is_last() && level > tier };
            has_begun |= axis < 3 && level <= tier; // also where the block is too small for the pass
            if is_own && outer[axis] > 1 << level {
                let mut distance: Node = std::array::from_fn(|a| strides[a].max(least[a]));
                let mut first = [0; 4];
                (first[axis], distance[axis]) = (1 << level, 2 << level);
                found.push((level, Some(axis), first, distance, ends(strides)));
            }
        }
        found
    }

    /// The values of all nodes; `value(level, node, number of the code, prediction)` is that of an own node.
    fn twin(&self, known: &HashMap<Node, f64>, mut value: impl FnMut(u32, Node, usize, f64) -> f64) -> Vec<f64> {
        let (mut field, mut code) = (known.clone(), 0);
        for (level, axis, first, distance, ends) in self.listed() {
            for node in self.lattice(first, distance, ends) {
                if !self.is_known(node) {
                    let predicted = axis.map_or(0.0, |axis| self.predicted(level, axis, node, &field));
                    field.insert(node, value(level, node, code, predicted));
                }
                code += 1;
            }
        }
        self.all().iter().map(|node| field[node]).collect()
    }

    fn predicted(&self, level: u32, axis: usize, node: Node, field: &HashMap<Node, f64>) -> f64 {
        let distance = 2 << level;
        let (n, i) = (self.outer()[axis].div_ceil(distance), node[axis] / distance);
        let e = |i: usize| {
            let mut at = node;
            at[axis] = i * distance;
            field[&at]
        };
        match n {
            1 => e(0),
            _ if i == n - 1 => -0.5 * e(i - 1) + 1.5 * e(i),
            _ if n == 2 || self.pyramid.stencil == Stencil::Linear => 0.5 * e(i) + 0.5 * e(i + 1),
            _ if i == 0 => 0.375 * e(0) + 0.75 * e(1) + -0.125 * e(2),
            _ if i == n - 2 => -0.125 * e(i - 1) + 0.75 * e(i) + 0.375 * e(i + 1),
            _ => -0.0625 * e(i - 1) + 0.5625 * e(i) + 0.5625 * e(i + 1) + -0.0625 * e(i + 2),
        }
    }

    /// The nodes of a random block above that lie in the block: as they are cut out of it, with their number along x, y, z, and
    /// each at its place. None in the last tier. Some k have none, and then arbitrary values.
    fn known(&self, state: &mut u64) -> Known {
        let (n, outer) = (2 << self.tier, self.outer());
        let start: [usize; 3] = std::array::from_fn(|_| below(4, state));
        let own = std::array::from_fn(|a| outer[a].div_ceil(n));
        let [nx, ny, nz]: [usize; 3] = std::array::from_fn(|a| start[a] + own[a] + below(3, state));
        let marked: Vec<bool> = (0..self.ks).map(|_| below(4, state) > 0).collect();
        let node = |i: usize, value: usize| if marked[i / (nx * ny * nz)] { value as f64 / 9.0 } else { f64::NAN };
        let nodes: Vec<f64> = (0..nx * ny * nz * self.ks).map(|i| node(i, below(1000, state))).collect();
        let at = |[x, y, z, k]: Node| {
            let place = start[0] + x / n + nx * (start[1] + y / n + ny * (start[2] + z / n + nz * k));
            if marked[k] { nodes[place] } else { 0.0 }
        };
        let known = self.lattice([0; 4], [n, n, n, 1], outer).into_iter().map(|node| (node, at(node))).collect();
        let mut cut = vec![f64::NAN; own.iter().product::<usize>() * self.ks];
        let region = Region { start, end: std::array::from_fn(|a| start[a] + own[a]) };
        let whole = Region { start: [0; 3], end: own };
        Nodes { values: &nodes, size: [nx, ny, nz], marked: Some(&marked) }.copy(&region, &whole, &mut cut);
        Known { cut, own, marked, nodes: if self.is_last() { HashMap::new() } else { known } }
    }
}

/// The known nodes of a block: as they are cut out of the block above, and each at its place.
struct Known {
    cut: Vec<f64>,
    own: [usize; 3],
    marked: Vec<bool>,
    nodes: HashMap<Node, f64>,
}

impl Known {
    fn nodes(&self) -> Nodes<'_, f64> {
        Nodes { values: &self.cut, size: self.own, marked: Some(&self.marked) }
    }

    /// As they are cut out, without those outside of a part.
    fn cut_part(&self, part: &Region) -> Vec<f64> {
        let whole = Region { start: [0; 3], end: self.own };
        let mut cut = vec![f64::NAN; self.cut.len()];
        self.nodes().copy(&whole, part, &mut cut);
        cut
    }
}

/// A region of at least one node.
fn some_region(nodes: [usize; 3], state: &mut u64) -> Region {
    let start = nodes.map(|n| below(n, state));
    Region { start, end: std::array::from_fn(|a| start[a] + 1 + below(nodes[a] - start[a], state).min(2)) }
}

/// Decodes all k; those without nodes are zero.
fn decoded(passes: &PredictionPasses<'_>, codes: &SparseCodes, known: Option<Nodes<'_, f64>>) -> Vec<f64> {
    let [x, y, z, ks] = passes.nodes();
    let mut field = vec![f64::NAN; x * y * z * ks];
    put_zeros(&passes.decode_some(&vec![true; ks], 0.3, codes, known, &mut field), &mut field);
    field
}

/// Parts need no known nodes but those that they name, and leave others out.
#[test]
fn parts_have_the_nodes_of_whole_blocks() {
    let state = &mut 29;
    let (mut compared, mut left_out, mut unneeded) = (0, 0, 0);
    for n in 0..3000 {
        let mut case = Case::random(state);
        let lod = if n % 3 == 0 { 1 + below(3, state) as u32 } else { 0 };
        case.tier = if lod > 0 { case.pyramid.tiers } else { case.tier };
        let passes = || PredictionPasses::with_detail(&case.pyramid, case.size, case.ks, case.tier, lod);
        let known = case.known(state);
        let whole = case.passes();
        let codes = whole.dense(&whole.list(&some_codes(whole.codes(), state)));
        let coarse = (lod > 0).then(|| coarse_codes(&whole, &passes(), &codes, lod));
        let all = whole.list(&codes);
        let listed = coarse.as_ref().unwrap_or(&all);
        let [x, y, z, _] = passes().nodes();
        let region = some_region([x, y, z], state);
        let narrow = passes().within(&region);
        let needed = if case.is_last() { Region { start: [0; 3], end: [0; 3] } } else { narrow.needed_above() };
        let cut = known.cut_part(&needed);
        let part = (!case.is_last()).then_some(Nodes { values: &cut, ..known.nodes() });
        let of_part = decoded(&narrow, listed, part);
        let of_whole = decoded(&passes(), listed, (!case.is_last()).then_some(known.nodes()));
        for (i, (found, expected)) in of_part.iter().zip(&of_whole).enumerate() {
            let node = [i % x, i / x % y, i / (x * y) % z];
            let is_inside = (0..3).all(|a| (region.start[a]..region.end[a]).contains(&node[a]));
            let what = || format!("{:?} {:?} {} {lod} {region:?} {node:?}", case.pyramid, case.size, case.tier);
            assert!(!is_inside || found.to_bits() == expected.to_bits(), "{}", what());
            compared += usize::from(is_inside);
            left_out += usize::from(found.to_bits() != expected.to_bits());
        }
        unneeded += cut.iter().zip(&known.cut).filter(|(part, whole)| part.is_nan() && !whole.is_nan()).count();
    }
    assert!(compared > 10_000 && left_out > 10_000 && unneeded > 10_000, "{compared} {left_out} {unneeded}");
}

#[test]
fn blocks_of_tiers_decode_as_the_format_says() {
    let state = &mut 17;
    for _ in 0..3000 {
        let case = Case::random(state);
        let known = case.known(state);
        let of = (!case.is_last()).then_some(known.nodes());
        let known = &known.nodes;
        let passes = case.passes();
        let listed = passes.list(&some_codes(passes.codes(), state));
        let codes = passes.dense(&listed);
        let mut field = vec![f64::NAN; passes.nodes().iter().product()];
        put_zeros(&passes.decode_some(&vec![true; case.ks], 0.3, &listed, of, &mut field), &mut field);
        let twin = case.twin(known, |level, _, code, p| p + f64::from(codes[code]) * case.pyramid.step(0.3, level));
        let what = format!("{:?} {:?} {} {}", case.pyramid, case.size, case.ks, case.tier);
        assert_eq!(bits(&field), bits(&twin), "{what}");
        if !case.pyramid.order.contains(&Axis::T) {
            let each = field.len() / case.ks;
            for (k, all) in field.chunks_exact(each).enumerate() {
                let mut one = Vec::new();
                assert!(!passes.decode_one(k, 0.3, &listed, of, &mut one) || bits(&one) == bits(all), "{what} {k}");
            }
        }
    }
}

#[test]
fn blocks_of_tiers_are_encoded_as_the_format_says() {
    let state = &mut 19;
    for _ in 0..2000 {
        let case = Case::random(state);
        let known = case.known(state);
        let of = (!case.is_last()).then_some(known.nodes());
        let known = &known.nodes;
        let passes = case.passes();
        let n = 1 << case.tier;
        let [x, y, z, _] = case.outer().map(|extent| extent.div_ceil(n));
        let source: Vec<f64> = (0..x * y * z * case.ks).map(|_| below(1000, state) as f64 / 70.0).collect();
        let mut codes = vec![99; passes.codes()];
        let mut field = vec![f64::NAN; passes.nodes().iter().product()];
        let of_source = Nodes { values: &source, size: [x, y, z], marked: None };
        assert!(passes.encode(0.7, of_source, of, &mut field, &mut codes));
        let mut expected = vec![0; codes.len()];
        let twin = case.twin(known, |level, [i, j, l, k], code, p| {
            let step = case.pyramid.step(0.7, level);
            let q = ((source[i / n + x * (j / n + y * (l / n + z * k))] - p) * (1.0 / step)).round_ties_even();
            expected[code] = q as i32;
            p + q * step
        });
        assert_eq!(bits(&field), bits(&twin));
        assert_eq!(codes, expected);
        assert_eq!(passes.dense(&passes.list(&codes)), codes);
    }
}

/// Lattices that are coarser than the last tier come from its first parts.
#[test]
fn coarse_lattices_of_the_last_tier_have_the_nodes_of_all_passes() {
    let state = &mut 23;
    for _ in 0..1000 {
        let mut case = Case::random(state);
        case.tier = case.pyramid.tiers;
        let whole = case.passes();
        let listed = whole.list(&some_codes(whole.codes(), state));
        let codes = whole.dense(&listed);
        let [nx, ny, nz, ks] = whole.nodes();
        let mut field = vec![f64::NAN; nx * ny * nz * ks];
        put_zeros(&whole.decode_some(&vec![true; ks], 0.3, &listed, None, &mut field), &mut field);
        for lod in 1..4 {
            let passes = PredictionPasses::with_detail(&case.pyramid, case.size, ks, case.tier, lod);
            let read = coarse_codes(&whole, &passes, &codes, lod);
            let [x, y, z, k] = passes.nodes();
            let mut coarse = vec![f64::NAN; x * y * z * k];
            put_zeros(&passes.decode_some(&vec![true; k], 0.3, &read, None, &mut coarse), &mut coarse);
            for (i, found) in coarse.iter().enumerate() {
                let at = [i % x, i / x % y, i / (x * y) % z].map(|node| node << lod);
                let expected = field[at[0] + nx * (at[1] + ny * (at[2] + nz * (i / (x * y * z))))];
                assert_eq!(found.to_bits(), expected.to_bits(), "{:?} {:?} {lod} {at:?}", case.pyramid, case.size);
            }
        }
    }
}
