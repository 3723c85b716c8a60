//! Compares passes with a slow twin that follows `FORMAT.md`, section 8, node by node.

use super::*;
use wavesplat_format::{Packing, Stencil};

/// The next of some scattered numbers below `end`.
pub(super) fn below(end: usize, state: &mut u64) -> usize {
    *state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
    (*state >> 33) as usize % end
}

fn some_pyramid(state: &mut u64) -> Pyramid {
    let mut left = vec![Axis::X, Axis::Y, Axis::Z, Axis::T];
    let order = (0..below(5, state)).map(|_| left.swap_remove(below(left.len(), state))).collect();
    let stencil = [Stencil::Linear, Stencil::Cubic][below(2, state)];
    let packing = [Packing::Flat, Packing::Nested][below(2, state)];
    let ghosts = packing == Packing::Nested && below(2, state) == 0;
    let most = [1.0, 2.0, 9.0][below(3, state)];
    Pyramid { order, stencil, growth: 1.5, most, single: false, packing, ghosts, tiers: 0 }
}

fn some_shape(case: usize, state: &mut u64) -> [usize; 4] {
    std::array::from_fn(|a| 1 + below(if a == 3 { [5, 33, 12][case % 3] } else { [9, 4, 18][case % 3] }, state))
}

/// Mostly zeros.
pub(super) fn some_codes(count: usize, state: &mut u64) -> Vec<i32> {
    (0..count).map(|_| if below(3, state) == 0 { below(9, state) as i32 - 4 } else { 0 }).collect()
}

/// The extents with ghost nodes: one more node behind an even number of voxels along a refined axis.
fn with_ghosts(pyramid: &Pyramid, shape: [usize; 4]) -> [usize; 4] {
    let ghost = |a: usize| {
        a < 3 && pyramid.ghosts && shape[a].is_multiple_of(2) && pyramid.order.iter().any(|o| o.index() == a)
    };
    std::array::from_fn(|a| shape[a] + usize::from(ghost(a)))
}

/// The nodes of a pass as indices of a block, in the order of their codes. Ghost nodes are on lattices of stride 2 and more.
fn nodes_of(pass: &Pass, shape: [usize; 4], outer: [usize; 4]) -> Vec<[usize; 4]> {
    let end = |a: usize| if pass.strides[a] > 1 { outer[a] } else { shape[a] };
    let along = |a: usize| (pass.nodes(a).0..end(a)).step_by(pass.nodes(a).1);
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

fn index(shape: [usize; 4], at: [usize; 4]) -> usize {
    at[0] + shape[0] * (at[1] + shape[1] * (at[2] + shape[2] * at[3]))
}

/// The prediction of a node, from the table of the format's page.
fn predicted(pyramid: &Pyramid, pass: &Pass, outer: [usize; 4], at: [usize; 4], field: &[f64]) -> f64 {
    let Some(axis) = pass.axis.map(Axis::index) else { return 0.0 };
    let distance = 2 << pass.level;
    let (n, i) = (outer[axis].div_ceil(distance), at[axis] / distance);
    let e = |i: usize| {
        let mut at = at;
        at[axis] = i * distance;
        field[index(outer, at)]
    };
    let cubic = pyramid.stencil == Stencil::Cubic;
    if n == 1 {
        e(0)
    } else if i == n - 1 {
        -0.5 * e(i - 1) + 1.5 * e(i)
    } else if n == 2 || !cubic {
        0.5 * e(i) + 0.5 * e(i + 1)
    } else if i == 0 {
        0.375 * e(0) + 0.75 * e(1) + -0.125 * e(2)
    } else if i == n - 2 {
        -0.125 * e(i - 1) + 0.75 * e(i) + 0.375 * e(i + 1)
    } else {
        -0.0625 * e(i - 1) + 0.5625 * e(i) + 0.5625 * e(i + 1) + -0.0625 * e(i + 2)
    }
}

/// Visits every node in the order of codes; `value((pass, node), number of the code, prediction)` is its value. Returns
/// the nodes of the block, without ghosts.
fn twin(
    pyramid: &Pyramid,
    shape: [usize; 4],
    mut value: impl FnMut((&Pass, [usize; 4]), usize, f64) -> f64,
) -> Vec<f64> {
    let outer = with_ghosts(pyramid, shape);
    let mut field = vec![f64::NAN; outer.iter().product()];
    let mut code = 0;
    for pass in pyramid.passes([shape[0], shape[1], shape[2]], shape[3], 0) {
        for at in nodes_of(&pass, shape, outer) {
            field[index(outer, at)] = value((&pass, at), code, predicted(pyramid, &pass, outer, at, &field));
            code += 1;
        }
    }
    nodes(shape).map(|at| field[index(outer, at)]).collect()
}

/// All nodes of a block.
fn nodes([x, y, z, k]: [usize; 4]) -> impl Iterator<Item = [usize; 4]> {
    (0..x * y * z * k).map(move |i| [i % x, i / x % y, i / (x * y) % z, i / (x * y * z)])
}

/// The number of codes of a block.
fn codes_in(pyramid: &Pyramid, shape: [usize; 4]) -> usize {
    pyramid.passes([shape[0], shape[1], shape[2]], shape[3], 0).iter().map(Pass::codes).sum()
}

fn passes_of(pyramid: &Pyramid, [x, y, z, k]: [usize; 4]) -> PredictionPasses<'_> {
    PredictionPasses::new(pyramid, [x, y, z], k, 0)
}

fn twin_decoded(pyramid: &Pyramid, shape: [usize; 4], step: f64, codes: &[i32], parts: usize) -> Vec<f64> {
    twin(pyramid, shape, |(pass, at), n, p| {
        let code = if part_of(pyramid, pass, at) < parts { codes[n] } else { 0 };
        p + f64::from(code) * pyramid.step(step, pass.level)
    })
}

/// The level part of a node's code.
fn part_of(pyramid: &Pyramid, pass: &Pass, at: [usize; 4]) -> usize {
    let spatial = [Axis::X, Axis::Y, Axis::Z].into_iter().filter(|axis| pyramid.order.contains(axis));
    let multiples = |of: usize| spatial.clone().all(|axis| at[axis.index()].is_multiple_of(of));
    match pass.axis {
        Some(Axis::T) if pyramid.packing == Packing::Nested && multiples(4) => 0,
        Some(Axis::T) if pyramid.packing == Packing::Nested && multiples(2) => 1,
        _ => pass.part.into(),
    }
}

pub(super) fn bits(values: &[f64]) -> Vec<u64> {
    values.iter().map(|v| v.to_bits()).collect()
}

/// Puts zeros for every k that is not marked. Decoding must have left its nodes as they were.
pub(super) fn put_zeros(marked: &[bool], field: &mut [f64]) {
    let each = field.len() / marked.len().max(1);
    for (nodes, _) in field.chunks_exact_mut(each.max(1)).zip(marked).filter(|(_, marked)| !**marked) {
        assert!(nodes.iter().all(|node| node.is_nan()));
        nodes.fill(0.0);
    }
}

#[test]
fn decoded_nodes_are_those_of_the_format() {
    let state = &mut 3;
    for case in 0..1500 {
        let (pyramid, shape) = (some_pyramid(state), some_shape(case, state));
        let codes = some_codes(codes_in(&pyramid, shape), state);
        let passes = passes_of(&pyramid, shape);
        let mut field = vec![f64::NAN; shape.iter().product()];
        let marked = passes.decode_some(&vec![true; shape[3]], 0.3, &passes.list(&codes), None, &mut field);
        put_zeros(&marked, &mut field);
        assert_eq!(bits(&field), bits(&twin_decoded(&pyramid, shape, 0.3, &codes, PARTS)), "{pyramid:?} {shape:?}");
        assert_eq!(passes.dense(&passes.list(&codes)), codes);
        for (k, nodes) in field.chunks_exact(shape[0] * shape[1] * shape[2]).enumerate() {
            assert!(marked[k] || nodes.iter().all(|v| *v == 0.0));
            if !pyramid.order.contains(&Axis::T) {
                let mut one = Vec::new();
                assert_eq!(passes.decode_one(k, 0.3, &passes.list(&codes), None, &mut one), marked[k]);
                assert!(!marked[k] || bits(&one) == bits(nodes));
            }
        }
    }
}

#[test]
fn encoded_nodes_are_those_of_the_format() {
    let state = &mut 5;
    for case in 0..1500 {
        let (pyramid, shape) = (some_pyramid(state), some_shape(case, state));
        let number = |state: &mut u64| if below(40, state) == 0 { f64::NAN } else { below(1000, state) as f64 / 70.0 };
        let outer = with_ghosts(&pyramid, shape);
        let source: Vec<f64> = (0..outer.iter().product()).map(|_| number(state)).collect();
        let passes = passes_of(&pyramid, shape);
        let mut codes = vec![99; codes_in(&pyramid, shape)];
        let mut field = vec![f64::NAN; shape.iter().product()];
        let size = [outer[0], outer[1], outer[2]];
        assert!(passes.encode(0.7, Nodes { values: &source, size, marked: None }, None, &mut field, &mut codes));
        let (mut in_place, mut same_codes) = (source.clone(), vec![99; codes.len()]);
        assert!(passes.encode_in_place(0.7, size, &vec![true; shape[3]], None, &mut in_place, &mut same_codes));
        assert_eq!((bits(&in_place[..field.len()]), &same_codes), (bits(&field), &codes), "{pyramid:?} {shape:?}");
        let mut expected = Vec::new();
        let decoded = twin(&pyramid, shape, |(pass, at), _, p| {
            let step = pyramid.step(0.7, pass.level);
            let q = (source[index(outer, at)] - p) * (1.0 / step);
            let code = if q.is_nan() { 0.0 } else { q.round_ties_even() };
            expected.push(code as i32);
            p + code * step
        });
        assert_eq!(bits(&field), bits(&decoded), "{pyramid:?} {shape:?}");
        assert_eq!(codes, expected);
        let listed = passes.list(&codes);
        assert_eq!(passes.list_coarse(&codes).1, passes.counts(&listed));
        let marked = passes.marked::<f64>(&listed, None);
        let nodes = Nodes { values: &field, size: [shape[0], shape[1], shape[2]], marked: Some(&marked) };
        let coded = passes.changes(&passes.counts(&listed), 0.7, &listed, None, nodes);
        let changes = passes.changes(&vec![[1; PARTS]; passes.counts(&listed).len()], 0.7, &listed, None, nodes);
        for part in 0..PARTS {
            let rest = twin_decoded(&pyramid, shape, 0.7, &codes, part);
            let largest = rest.iter().zip(&field).fold(0.0, |most: f64, (a, b)| most.max((a - b).abs()));
            let largest = if largest > 0.0 { largest.next_up() } else { 0.0 };
            assert_eq!(changes[part].largest(), largest, "{pyramid:?} {shape:?} {part}");
            let count = passes.count(part as u8, &passes.list(&codes));
            assert_eq!(coded[part].largest(), if count > 0 { largest } else { 0.0 });
        }
    }
}

#[test]
fn codes_that_do_not_fit_are_noticed() {
    let pyramid = Pyramid {
        order: vec![Axis::X],
        stencil: Stencil::Linear,
        growth: 1.0,
        most: 1.0,
        single: false,
        packing: Packing::Flat,
        ghosts: false,
        tiers: 0,
    };
    let passes = passes_of(&pyramid, [3, 1, 1, 1]);
    for (largest, fits) in [(1e9, true), (2e9, false), (-1e9, true), (-2e9, false), (f64::INFINITY, false)] {
        let source = [0.0, largest, 1.0];
        assert_eq!(
            passes.encode(
                1.0,
                Nodes { values: &source, size: [3, 1, 1], marked: None },
                None,
                &mut [0.0; 3],
                &mut [0; 3]
            ),
            fits,
            "{largest}"
        );
    }
}

/// The codes that a level of detail reads of all codes of a block: those of the parts that it needs.
pub(super) fn coarse_codes(
    whole: &PredictionPasses<'_>,
    passes: &PredictionPasses<'_>,
    codes: &[i32],
    lod: u32,
) -> SparseCodes {
    let (packing, needed) = (whole.pyramid.packing, crate::codec::coarsest_part(whole.pyramid, lod));
    let mut read = SparseCodes::default();
    for part in 0..Pyramid::PARTS {
        let mut raw = Vec::new();
        packing.pack(&whole.part_of(part, codes), &mut raw);
        if usize::from(part) <= needed {
            packing.unpack(&raw, &passes.placed_boxes(part), &mut read).expect("packed");
        } else {
            read.skip(&passes.placed_boxes(part));
        }
    }
    passes.thin(&mut read);
    read
}

/// Every 2^lod-th node, from the parts that hold them, is what all codes give.
#[test]
fn coarse_lattices_have_the_nodes_of_all_passes() {
    let state = &mut 7;
    let mut compared = 0;
    for case in 0..2000 {
        let (pyramid, shape) = (some_pyramid(state), some_shape(case, state));
        if ![Axis::X, Axis::Y, Axis::Z].iter().all(|axis| pyramid.order.contains(axis)) {
            continue;
        }
        let codes = some_codes(codes_in(&pyramid, shape), state);
        let decoded = twin_decoded(&pyramid, shape, 0.3, &codes, PARTS);
        let whole = passes_of(&pyramid, shape);
        for lod in 1..4 {
            let passes = PredictionPasses::with_detail(&pyramid, [shape[0], shape[1], shape[2]], shape[3], 0, lod);
            let read = coarse_codes(&whole, &passes, &codes, lod);
            let [x, y, z, k] = passes.nodes();
            let mut coarse = vec![f64::NAN; x * y * z * k];
            put_zeros(&passes.decode_some(&vec![true; k], 0.3, &read, None, &mut coarse), &mut coarse);
            for (i, found) in coarse.iter().enumerate() {
                let at = [i % x, i / x % y, i / (x * y) % z].map(|node| node << lod);
                let k = i / (x * y * z);
                let expected = decoded[at[0] + shape[0] * (at[1] + shape[1] * (at[2] + shape[2] * k))];
                assert_eq!(found.to_bits(), expected.to_bits(), "{pyramid:?} {shape:?} {lod} {at:?} {k}");
                compared += 1;
            }
        }
    }
    assert!(compared > 50_000, "{compared}");
}

#[test]
fn some_ks_have_the_nodes_of_all_passes() {
    let state = &mut 11;
    let (mut compared, mut left_out) = (0, 0);
    for case in 0..1500 {
        let (pyramid, [x, y, z, k]) = (some_pyramid(state), some_shape(case, state));
        let codes = some_codes(codes_in(&pyramid, [x, y, z, k]), state);
        let passes = passes_of(&pyramid, [x, y, z, k]);
        let wanted: Vec<bool> = (0..k).map(|_| below(8, state) == 0).collect();
        let (mut some, sparse) = (vec![f64::NAN; x * y * z * k], passes.list(&codes));
        let decoded = passes.decode_some(&wanted, 0.3, &sparse, None, &mut some);
        let marked = passes.marked::<f64>(&sparse, None);
        assert!((0..k).all(|k| decoded[k] == (marked[k] && wanted[k])));
        put_zeros(&marked, &mut some);
        let whole = twin_decoded(&pyramid, [x, y, z, k], 0.3, &codes, PARTS);
        let of_k = |nodes: &[f64], k: usize| bits(&nodes[k * x * y * z..][..x * y * z]);
        for k in 0..k {
            let equal = of_k(&some, k) == of_k(&whole, k);
            assert!(!wanted[k] || equal, "{pyramid:?} {wanted:?} {k}");
            compared += usize::from(wanted[k]);
            left_out += usize::from(!equal);
        }
    }
    assert!(compared > 1500 && left_out > 1500, "{compared} {left_out}");
}

/// The codes of parts, packed and unpacked, are those that were listed.
#[test]
fn parts_hold_all_codes_once() {
    let state = &mut 13;
    for case in 0..600 {
        let (pyramid, shape) = (some_pyramid(state), some_shape(case, state));
        let codes = some_codes(codes_in(&pyramid, shape), state);
        let passes = passes_of(&pyramid, shape);
        let (mut unpacked, mut raw) = (SparseCodes::default(), Vec::new());
        for part in 0..Pyramid::PARTS {
            raw.clear();
            pyramid.packing.pack(&passes.part_of(part, &codes), &mut raw);
            let count = pyramid.packing.unpack(&raw, &passes.placed_boxes(part), &mut unpacked).expect("packed");
            assert_eq!(count, passes.count(part, &passes.list(&codes)));
        }
        assert_eq!(passes.dense(&unpacked), codes, "{pyramid:?} {shape:?}");
    }
}
