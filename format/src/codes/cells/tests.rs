//! Tests of lattice codes: documented bytes, round trips, the reference reader and hostile bytes.

use super::super::max_packed;
use super::super::sparse::{CodeBox, DenseCodes, Places, SparseCodes};
use super::super::volume;
use super::reference;
use crate::pyramid::Packing;
use proptest::prelude::*;

fn contiguous(boxes: &[[usize; 4]]) -> Vec<CodeBox> {
    boxes.iter().copied().map(CodeBox::contiguous).collect()
}

fn most(boxes: &[[usize; 4]]) -> usize {
    max_packed(&contiguous(boxes))
}

fn packed_as(packing: Packing, codes: &[i32], boxes: &[[usize; 4]]) -> Vec<u8> {
    let mut out = Vec::new();
    packing.pack(&DenseCodes::one_after_another(codes, &contiguous(boxes)), &mut out);
    out
}

fn unpacked_as(packing: Packing, raw: &[u8], boxes: &[[usize; 4]]) -> Result<Vec<i32>, String> {
    let mut codes = vec![9; boxes.iter().map(volume).sum()];
    let count = packing.unpack_all(raw, &contiguous(boxes), &mut codes)?;
    assert_eq!(count, codes.iter().filter(|&&code| code != 0).count());
    Ok(codes)
}

fn packed(codes: &[i32], boxes: &[[usize; 4]]) -> Vec<u8> {
    packed_as(Packing::Flat, codes, boxes)
}

fn unpacked(raw: &[u8], boxes: &[[usize; 4]]) -> Result<Vec<i32>, String> {
    unpacked_as(Packing::Flat, raw, boxes)
}

#[test]
fn codes_have_the_documented_bytes() {
    let codes = [0, -1, 0, 0, 0, 0, 300, 0];
    let raw = [1, 0, 0, 0, 0, 0, 2, 0, 0, 0x0C, 0x42, 0x00, 0x88, 0x57];
    assert_eq!(packed(&codes, &[[2, 2, 2, 1]]), raw);
    assert_eq!(unpacked(&raw, &[[2, 2, 2, 1]]).expect("packed"), codes);
    let text = include_str!("../../../FORMAT.md");
    assert!(text.contains("`01 00 00 00 00 00 02 00 00 | 0C 42 00 88 | 57`"));
    assert_eq!(packed(&[0; 1000], &[[10, 10, 10, 1]]), [125, 0, 0, 0, 0, 0, 0, 0, 0, 0xF5, 3, 0]);
    assert_eq!(packed(&[], &[[0, 3, 1, 1]]), [0; 9]);
    assert_eq!(packed(&[], &[]), [0; 9]);
}

#[test]
fn hostile_codes_are_refused() {
    let good = [1, 0, 0, 0, 0, 0, 2, 0, 0, 0x0C, 0x42, 0x00, 0x88, 0x57];
    let change = |at: usize, byte: u8| {
        let mut raw = good;
        raw[at] = byte;
        unpacked(&raw, &[[2, 2, 2, 1]]).expect_err("hostile")
    };
    assert!(change(0, 2).contains("2 significance bytes for 1 cells"));
    assert!(change(6, 9).contains("9 values for 8 codes"));
    assert!(change(9, 0x10).contains("a segment of 4 symbols where 3"));
    assert!(change(9, 0x01).contains("a segment of 0 symbols"));
    assert!(change(9, 0x0D).contains("too many"));
    assert!(change(10, 0x40).contains("lengths"));
    assert!(change(12, 228).contains("range"));
    assert!(change(13, 0xD7).contains("padding"));
    assert!(unpacked(&good, &[[1, 2, 2, 1]]).expect_err("outside").contains("outside"));
    assert!(unpacked(&good, &[[2, 1, 2, 1]]).expect_err("outside").contains("outside"));
    assert!(unpacked(&good, &[[2, 2, 1, 1]]).expect_err("outside").contains("outside"));
    let largest = [1, 0, 0, 0, 0, 1, 0, 0, 0, 8, 1, 227, 255, 255, 255, 0x1F];
    assert!(unpacked(&largest, &[[2, 2, 2, 1]]).expect_err("2^32").contains("range"));
    let flat = |boxes: &[[usize; 4]], codes: &mut [i32]| Packing::Flat.unpack_all(&good, &contiguous(boxes), codes);
    assert!(flat(&[[2, 2, 2, 1]], &mut [0; 7]).is_err());
    assert!(flat(&[[usize::MAX; 4]; 2], &mut [0; 8]).is_err());
    assert_eq!(most(&[[usize::MAX; 4]; 2]), usize::MAX);
}

/// Long enough for several states, segments with fine frequencies, and frequencies that change.
#[test]
fn long_streams_round_trip() {
    let boxes = [[61, 40, 35, 9], [64, 33, 17, 2]];
    let total: usize = boxes.iter().map(volume).sum();
    let mut state = 1u64;
    let mut random = |below: u64| {
        state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (state >> 33) % below
    };
    let rarity = |i: usize| if i < total / 2 { 400 } else { 2 };
    let codes: Vec<i32> = (0..total)
        .map(|i| if random(rarity(i)) == 0 { random(1 << (i * 12 / total)) as i32 - (i % 7) as i32 } else { 0 })
        .collect();
    for packing in [Packing::Flat, Packing::Nested] {
        let raw = packed_as(packing, &codes, &boxes);
        assert!(raw.len() <= most(&boxes));
        assert_eq!(unpacked_as(packing, &raw, &boxes).as_ref(), Ok(&codes));
        assert_eq!(reference::unpack(&raw, packing, &boxes).as_ref(), Some(&codes));
    }
    assert!(packed_as(Packing::Nested, &codes, &boxes) != packed(&codes, &boxes), "32 states");
}

proptest! {
    #[test]
    fn codes_round_trip((boxes, codes) in boxes(), packing in packings()) {
        let raw = packed_as(packing, &codes, &boxes);
        prop_assert!(raw.len() <= most(&boxes));
        prop_assert_eq!(unpacked_as(packing, &raw, &boxes).expect("packed"), codes.clone());
        prop_assert_eq!(reference::unpack(&raw, packing, &boxes).expect("packed"), codes);
    }

    #[test]
    fn every_truncation_is_found((boxes, codes) in boxes(), packing in packings()) {
        let mut raw = packed_as(packing, &codes, &boxes);
        for len in 0..raw.len() {
            prop_assert!(unpacked_as(packing, &raw[..len], &boxes).is_err(), "cut to {} bytes", len);
        }
        raw.push(0);
        prop_assert!(unpacked_as(packing, &raw, &boxes).is_err());
    }

    #[test]
    fn changed_bytes_are_read_as_specified(
        (boxes, codes) in boxes(),
        packing in packings(),
        changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..40),
        together in prop::bool::weighted(0.2),
    ) {
        let good = packed_as(packing, &codes, &boxes);
        let mut raw = good.clone();
        for (at, byte) in changes {
            if !together {
                raw.clone_from(&good);
            }
            raw[at.index(good.len())] ^= byte;
            prop_assert_eq!(unpacked_as(packing, &raw, &boxes).ok(), reference::unpack(&raw, packing, &boxes));
        }
    }

    /// Codes at some places of larger arrays, without those of another box.
    #[test]
    fn boxes_of_other_places_round_trip(
        extents in prop::array::uniform4(1usize..7),
        every in prop::array::uniform3(1usize..4),
        allowed in any::<u8>(),
        seed in any::<u32>(),
        needed in (0usize..900, 0usize..900),
    ) {
        let [x, y, z, t] = extents;
        let needed = Places { start: needed.0, end: needed.1 };
        let all = [x * every[0], y * every[1], z * every[2]];
        let slice = all.iter().product::<usize>() + 3;
        let scramble = |i: usize| (i as u32 ^ seed).wrapping_mul(0x9E37_79B1) >> 20;
        let codes: Vec<i32> = (0..slice * t).map(|i| if scramble(i) % 3 == 0 { scramble(i + 1) as i32 % 9 - 4 } else { 0 }).collect();
        let strides = [every[0], all[0] * every[1], all[0] * all[1] * every[2]];
        let at = CodeBox { extents, first: 2, strides, allowed, needed: Places::ALL };
        let dense = DenseCodes { codes: &codes, slice, at };
        let (mut raw, mut found, mut listed) = (Vec::new(), SparseCodes::default(), SparseCodes::default());
        Packing::Nested.pack(&[dense], &mut raw);
        let count = Packing::Nested.unpack(&raw, &[at], &mut found).expect("packed");
        listed.list(&dense, &at);
        prop_assert_eq!(count, listed.count());
        let [mut some, mut none] = [needed, Places::NONE].map(|needed| (CodeBox { needed, ..at }, SparseCodes::default()));
        for (at, found) in [&mut some, &mut none] {
            prop_assert_eq!(Packing::Nested.unpack(&raw, &[*at], found), Ok(count));
        }
        prop_assert_eq!((none.1.count(), none.1.runs()), (0, t));
        for t in 0..t {
            let pairs = |of: &SparseCodes| {
                let (places, values) = of.run(t);
                let mut pairs: Vec<(u32, i32)> = places.iter().copied().zip(values.iter().copied()).collect();
                pairs.sort_unstable();
                pairs
            };
            let mut expected = Vec::new();
            for (z, y, x) in (0..z).flat_map(|z| (0..y).flat_map(move |y| (0..x).map(move |x| (z, y, x)))) {
                let place = 2 + x * strides[0] + y * strides[1] + z * strides[2];
                let code = codes[t * slice + place];
                if code != 0 && allowed >> (x % 2 + 2 * (y % 2) + 4 * (z % 2)) & 1 == 1 {
                    expected.push((place as u32, code));
                }
            }
            expected.sort_unstable();
            prop_assert_eq!(pairs(&found), expected.clone());
            prop_assert_eq!(pairs(&listed), expected.clone());
            let some = pairs(&some.1);
            prop_assert!(some.iter().all(|pair| expected.contains(pair)));
            let is_needed = |place: u32| (needed.start..needed.end).contains(&(place as usize));
            prop_assert!(expected.iter().filter(|pair| is_needed(pair.0)).all(|pair| some.contains(pair)));
        }
        let other = CodeBox { allowed: 0, ..at };
        prop_assert_eq!(Packing::Nested.unpack(&raw, &[other], &mut found).is_ok(), count == 0);
    }
}

fn packings() -> impl Strategy<Value = Packing> {
    prop::sample::select(vec![Packing::Flat, Packing::Nested])
}

/// Random boxes and codes: all zero, sparse or dense, small or of any magnitude.
fn boxes() -> impl Strategy<Value = (Vec<[usize; 4]>, Vec<i32>)> {
    let axis = || prop_oneof![1 => 0usize..2, 8 => 1usize..8, 1 => 15usize..36];
    let extents = (axis(), axis(), axis(), 0usize..5).prop_map(|(x, y, z, t)| [x, y, z, t]);
    let boxes = prop::collection::vec(extents.prop_filter("small", |e| volume(e) < 9000), 0..4);
    (boxes, 0u32..101, prop::sample::select(vec![1u32, 2, 4, 8, 16, 32])).prop_flat_map(|(boxes, filled, bits)| {
        let total: usize = boxes.iter().map(volume).sum();
        let code = (0u32..100, any::<i32>(), 0..bits);
        let code =
            code.prop_map(move |(chance, code, less)| if chance < filled { code >> (32 - bits) >> less } else { 0 });
        let code = prop_oneof![200 => code, 1 => prop::sample::select(vec![i32::MIN, i32::MAX, 64, -64, 65, -65])];
        (Just(boxes), prop::collection::vec(code, total))
    })
}

#[test]
fn estimates_are_close_to_what_is_packed() {
    let scramble = |i: usize| (i as u32).wrapping_mul(0x9E37_79B1) >> 12;
    for rare in [2, 9, 60] {
        let code = |i: usize| if scramble(i) % rare == 0 { (scramble(i + 7) % 9) as i32 - 4 } else { 0 };
        let codes: Vec<i32> = (0..24 * 20 * 18 * 8).map(code).collect();
        let boxes = [[24, 20, 18, 5], [24, 20, 18, 3]];
        let estimate = Packing::Nested.estimate(&DenseCodes::one_after_another(&codes, &contiguous(&boxes)));
        let exact = packed_as(Packing::Nested, &codes, &boxes).len();
        assert!(estimate.abs_diff(exact) < exact / 50 + 100, "{estimate} for {exact}");
    }
}
