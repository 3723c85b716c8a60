//! Compares passes with a slow twin that follows `FORMAT.md`, section 8, node by node.

use super::*;
use wavesplat_format::Stencil;

/// The next of some scattered numbers below `end`.
fn below(end: usize, state: &mut u64) -> usize {
    *state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
    (*state >> 33) as usize % end
}

fn some_pyramid(state: &mut u64) -> Pyramid {
    let mut left = vec![Axis::X, Axis::Y, Axis::Z, Axis::T];
    let order = (0..below(5, state)).map(|_| left.swap_remove(below(left.len(), state))).collect();
    let stencil = [Stencil::Linear, Stencil::Cubic][below(2, state)];
    Pyramid { order, stencil, growth: 1.5, most: [1.0, 2.0, 9.0][below(3, state)], single: false }
}

fn some_shape(case: usize, state: &mut u64) -> [usize; 4] {
    std::array::from_fn(|a| 1 + below(if a == 3 { [5, 33, 12][case % 3] } else { [9, 4, 18][case % 3] }, state))
}

/// Mostly zeros.
fn some_codes(count: usize, state: &mut u64) -> Vec<i32> {
    (0..count).map(|_| if below(3, state) == 0 { below(9, state) as i32 - 4 } else { 0 }).collect()
}

/// The nodes of a pass as indices of a block, in the order of their codes.
fn nodes_of(pass: &Pass, shape: [usize; 4]) -> Vec<[usize; 4]> {
    let along = |a: usize| (pass.nodes(a).0..shape[a]).step_by(pass.nodes(a).1);
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

/// The prediction of a node, from the table of the format's page.
fn predicted(pyramid: &Pyramid, pass: &Pass, shape: [usize; 4], at: [usize; 4], field: &[f64]) -> f64 {
    let Some(axis) = pass.axis.map(Axis::index) else { return 0.0 };
    let distance = 2 << pass.level;
    let (n, i) = (shape[axis].div_ceil(distance), at[axis] / distance);
    let e = |i: usize| {
        let mut at = at;
        at[axis] = i * distance;
        field[at[0] + shape[0] * (at[1] + shape[1] * (at[2] + shape[2] * at[3]))]
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

/// Visits every node in the order of codes; `value(pass, number of the code, prediction, index)` is its value.
fn twin(pyramid: &Pyramid, shape: [usize; 4], mut value: impl FnMut(&Pass, usize, f64, usize) -> f64) -> Vec<f64> {
    let mut field = vec![0.0; shape.iter().product()];
    let mut code = 0;
    for pass in pyramid.passes(shape) {
        for at in nodes_of(&pass, shape) {
            let index = at[0] + shape[0] * (at[1] + shape[1] * (at[2] + shape[2] * at[3]));
            field[index] = value(&pass, code, predicted(pyramid, &pass, shape, at, &field), index);
            code += 1;
        }
    }
    field
}

fn twin_decoded(pyramid: &Pyramid, shape: [usize; 4], step: f64, codes: &[i32], parts: usize) -> Vec<f64> {
    twin(pyramid, shape, |pass, n, p, _| {
        let code = if usize::from(pass.part) < parts { codes[n] } else { 0 };
        p + f64::from(code) * pyramid.step(step, pass.level)
    })
}

/// Codes, pass after pass, as they come from a file.
fn sparse(passes: &PredictionPasses<'_>, codes: &[i32]) -> SparseCodes {
    let mut rest = codes;
    let (mut found, mut raw) = (SparseCodes::default(), Vec::new());
    for part in 0..Pyramid::PARTS {
        let (boxes, placed) = (passes.boxes(part), passes.placed_boxes(part));
        let (own, after) = rest.split_at(boxes.iter().map(|b| b.iter().product::<usize>()).sum());
        raw.clear();
        wavesplat_format::pack_cells(own, &boxes, &mut raw);
        wavesplat_format::unpack_sparse_cells(&raw, &placed, &mut found).expect("packed");
        rest = after;
    }
    found
}

fn bits(values: &[f64]) -> Vec<u64> {
    values.iter().map(|v| v.to_bits()).collect()
}

#[test]
fn decoded_nodes_are_those_of_the_format() {
    let state = &mut 3;
    for case in 0..1500 {
        let (pyramid, shape) = (some_pyramid(state), some_shape(case, state));
        let codes = some_codes(shape.iter().product(), state);
        let passes = PredictionPasses::new(&pyramid, shape);
        let mut field = vec![f64::NAN; codes.len()];
        let marked = passes.decode(0.3, &sparse(&passes, &codes), &mut field);
        assert_eq!(bits(&field), bits(&twin_decoded(&pyramid, shape, 0.3, &codes, PARTS)), "{pyramid:?} {shape:?}");
        assert_eq!(marked, passes.marked_of(&codes));
        for (k, nodes) in field.chunks_exact(shape[0] * shape[1] * shape[2]).enumerate() {
            assert!(marked[k] || nodes.iter().all(|v| *v == 0.0));
            if !pyramid.order.contains(&Axis::T) {
                let mut one = Vec::new();
                assert_eq!(passes.decode_one(k, 0.3, &sparse(&passes, &codes), &mut one), marked[k]);
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
        let source: Vec<f64> = (0..shape.iter().product()).map(|_| number(state)).collect();
        let passes = PredictionPasses::new(&pyramid, shape);
        let (mut field, mut split, mut codes) = (source.clone(), Vec::new(), vec![99; source.len()]);
        assert!(passes.encode(0.7, &mut field, &mut split, &mut codes));
        let mut expected = Vec::new();
        let decoded = twin(&pyramid, shape, |pass, _, p, index| {
            let step = pyramid.step(0.7, pass.level);
            let q = (source[index] - p) * (1.0 / step);
            let code = if q.is_nan() { 0.0 } else { q.round_ties_even() };
            expected.push(code as i32);
            p + code * step
        });
        assert_eq!(bits(&field), bits(&decoded), "{pyramid:?} {shape:?}");
        assert_eq!(codes, expected);
        let coded = passes.changes_of_coded(0.7, &codes, &field);
        let changes = passes.changes(0.7, &sparse(&passes, &codes), &field);
        for part in 0..PARTS {
            let rest = twin_decoded(&pyramid, shape, 0.7, &codes, part);
            let largest = rest.iter().zip(&field).fold(0.0, |most: f64, (a, b)| most.max((a - b).abs()));
            let largest = if largest > 0.0 { largest.next_up() } else { 0.0 };
            assert_eq!(changes[part].largest(), largest, "{pyramid:?} {shape:?} {part}");
            let listed = passes.boxes(part as u8).iter().any(|b| b.iter().product::<usize>() > 0);
            assert!(coded[part].largest() == largest || !listed || coded[part].largest() == 0.0);
        }
    }
}

#[test]
fn codes_that_do_not_fit_are_noticed() {
    let pyramid = Pyramid { order: vec![Axis::X], stencil: Stencil::Linear, growth: 1.0, most: 1.0, single: false };
    let passes = PredictionPasses::new(&pyramid, [3, 1, 1, 1]);
    for (largest, fits) in [(1e9, true), (2e9, false), (-1e9, true), (-2e9, false), (f64::INFINITY, false)] {
        let mut field = [0.0, largest, 1.0];
        assert_eq!(passes.encode(1.0, &mut field, &mut Vec::new(), &mut [0; 3]), fits, "{largest}");
    }
}

#[test]
fn the_nodes_of_a_level_are_those_of_all_passes() {
    let state = &mut 7;
    let mut compared = 0;
    for case in 0..1500 {
        let (pyramid, shape) = (some_pyramid(state), some_shape(case, state));
        let codes = some_codes(shape.iter().product(), state);
        let whole = twin_decoded(&pyramid, shape, 0.3, &codes, PARTS);
        for level in 0..3 {
            let passes = PredictionPasses::down_to(&pyramid, shape, level);
            let [x, y, z, _] = passes.nodes();
            let mut coarse = vec![0.0_f64; passes.nodes().iter().product()];
            passes.decode(0.3, &sparse(&passes, &codes[..coarse.len()]), &mut coarse);
            let apart =
                [Axis::X, Axis::Y, Axis::Z, Axis::T].map(|a| usize::from(pyramid.order.contains(&a)) * level as usize);
            for (i, found) in coarse.iter().enumerate() {
                let node = [i % x, i / x % y, i / (x * y) % z, i / (x * y * z)];
                let at: [usize; 4] = std::array::from_fn(|a| node[a] << apart[a]);
                let expected = whole[at[0] + shape[0] * (at[1] + shape[1] * (at[2] + shape[2] * at[3]))];
                assert_eq!(found.to_bits(), expected.to_bits(), "{pyramid:?} {shape:?} {level} {at:?}");
                compared += 1;
            }
        }
    }
    assert!(compared > 1_000_000, "{compared}");
}

#[test]
fn some_ks_have_the_nodes_of_all_passes() {
    let state = &mut 11;
    let (mut compared, mut left_out) = (0, 0);
    for case in 0..1500 {
        let (pyramid, [x, y, z, k]) = (some_pyramid(state), some_shape(case, state));
        let codes = some_codes(x * y * z * k, state);
        let passes = PredictionPasses::new(&pyramid, [x, y, z, k]);
        let wanted: Vec<bool> = (0..k).map(|_| below(8, state) == 0).collect();
        let (mut some, sparse) = (vec![f64::NAN; codes.len()], sparse(&passes, &codes));
        let marked = passes.decode_some(&wanted, 0.3, &sparse, &mut some);
        assert_eq!(marked, passes.marked(&sparse));
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
