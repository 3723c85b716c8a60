//! Tests of lattice codes: documented bytes, round trips, the reference reader and hostile bytes.

use super::reference;
use super::*;
use proptest::prelude::*;

fn packed(codes: &[i32], boxes: &[[usize; 4]]) -> Vec<u8> {
    let mut out = Vec::new();
    pack_cells(codes, boxes, &mut out);
    out
}

fn unpacked(raw: &[u8], boxes: &[[usize; 4]]) -> Result<Vec<i32>, String> {
    let mut codes = vec![9; boxes.iter().map(volume).sum()];
    let count = unpack_cells(raw, boxes, &mut codes)?;
    assert_eq!(count, codes.iter().filter(|&&code| code != 0).count());
    Ok(codes)
}

#[test]
fn codes_have_the_documented_bytes() {
    let codes = [0, -1, 0, 0, 0, 0, 300, 0];
    let raw = [1, 0, 0, 0, 0, 0, 2, 0, 0, 0x0C, 0x42, 0x00, 0x88, 0x57];
    assert_eq!(packed(&codes, &[[2, 2, 2, 1]]), raw);
    assert_eq!(unpacked(&raw, &[[2, 2, 2, 1]]).expect("packed"), codes);
    let text = include_str!("../../FORMAT.md");
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
    assert!(unpack_cells(&good, &[[2, 2, 2, 1]], &mut [0; 7]).is_err());
    assert!(unpack_cells(&good, &[[usize::MAX; 4]; 2], &mut [0; 8]).is_err());
    assert_eq!(max_packed(&[[usize::MAX; 4]; 2]), usize::MAX);
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
    let raw = packed(&codes, &boxes);
    assert!(raw.len() <= max_packed(&boxes));
    assert_eq!(unpacked(&raw, &boxes).as_ref(), Ok(&codes));
    assert_eq!(reference::unpack(&raw, &boxes).as_ref(), Some(&codes));
}

proptest! {
    #[test]
    fn codes_round_trip((boxes, codes) in boxes()) {
        let raw = packed(&codes, &boxes);
        prop_assert!(raw.len() <= max_packed(&boxes));
        prop_assert_eq!(unpacked(&raw, &boxes).expect("packed"), codes.clone());
        prop_assert_eq!(reference::unpack(&raw, &boxes).expect("packed"), codes);
    }

    #[test]
    fn every_truncation_is_found((boxes, codes) in boxes()) {
        let mut raw = packed(&codes, &boxes);
        for len in 0..raw.len() {
            prop_assert!(unpacked(&raw[..len], &boxes).is_err(), "cut to {} bytes", len);
        }
        raw.push(0);
        prop_assert!(unpacked(&raw, &boxes).is_err());
    }

    #[test]
    fn changed_bytes_are_read_as_specified(
        (boxes, codes) in boxes(),
        changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..40),
        together in prop::bool::weighted(0.2),
    ) {
        let good = packed(&codes, &boxes);
        let mut raw = good.clone();
        for (at, byte) in changes {
            if !together {
                raw.clone_from(&good);
            }
            raw[at.index(good.len())] ^= byte;
            prop_assert_eq!(unpacked(&raw, &boxes).ok(), reference::unpack(&raw, &boxes));
        }
    }
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
        let (estimate, exact) = (estimate_cells(&codes, &boxes), packed(&codes, &boxes).len());
        assert!(estimate.abs_diff(exact) < exact / 50 + 100, "{estimate} for {exact}");
    }
}
