//! Targets for payloads: those that unpack must pack to the same bytes, and packed values must unpack.

use super::input::Input;
use wavesplat_format::*;

/// Codes of coefficients: as payload of at most 65535 codes, and as codes to pack.
pub fn codes(data: &[u8]) {
    let mut input = Input::new(data);
    let mut codes = vec![-1; input.short()];
    let mut again = Vec::new();
    if let Ok(count) = unpack_codes(input.rest(), &mut codes) {
        assert_eq!(count, nonzero(&codes));
        pack_codes(&codes, &mut again);
        assert_eq!(again, input.rest(), "packs to what it was");
    }
    let codes = numbers(input.rest());
    let (mut raw, mut back) = (Vec::new(), vec![-1; codes.len()]);
    pack_codes(&codes, &mut raw);
    assert_eq!(unpack_codes(&raw, &mut back), Ok(nonzero(&codes)));
    assert_eq!(back, codes);
}

/// Codes on lattices, of at most 3 boxes with at most 12 codes along an axis, and samples of the first box by their values.
pub fn cells(data: &[u8]) {
    let mut input = Input::new(data);
    let mut extents = |_| [(); 4].map(|()| input.below(13));
    let boxes: Vec<[usize; 4]> = (0..3).map(&mut extents).filter(|extents| !extents.contains(&0)).collect();
    let volume = boxes.iter().map(|extents| extents.iter().product::<usize>()).sum();
    let first = boxes.first().copied();
    let boxes: Vec<CodeBox> = boxes.into_iter().map(CodeBox::contiguous).collect();
    let packing = [Packing::Flat, Packing::Nested][input.below(2)];
    let mut codes = vec![-1; volume];
    if let Ok(count) = packing.unpack_all(input.rest(), &boxes, &mut codes) {
        assert_eq!(count, nonzero(&codes));
        cells_round_trip(packing, &codes, &boxes);
    }
    first.into_iter().for_each(|extents| listed(input.rest(), extents));
    let mut codes = numbers(input.rest());
    codes.resize(volume, 0);
    cells_round_trip(packing, &codes, &boxes);
}

/// Bytes as a payload of listed samples, and as samples.
fn listed(raw: &[u8], extents: [usize; 4]) {
    for size in [1, 2, 4, 8] {
        if let Ok(samples) = unpack_listed(raw, size, extents) {
            listed_round_trip(&samples, size, extents);
        }
        if let Some(samples) = raw.get(..size * extents.iter().product::<usize>()) {
            listed_round_trip(samples, size, extents);
        }
    }
}

fn listed_round_trip(samples: &[u8], size: usize, extents: [usize; 4]) {
    let listed = Listed::new([samples], size, extents, usize::MAX).expect("few values");
    let (mut codes, mut raw) = (Vec::new(), Vec::new());
    listed.pack(&mut codes, &mut raw);
    assert_eq!(unpack_listed(&raw, size, extents).expect("packed"), samples);
}

fn cells_round_trip(packing: Packing, codes: &[i32], boxes: &[CodeBox]) {
    let (mut raw, mut back) = (Vec::new(), vec![-1; codes.len()]);
    let dense = DenseCodes::one_after_another(codes, boxes);
    packing.pack(&dense, &mut raw);
    assert!(raw.len() <= max_packed(boxes), "{} bytes of {boxes:?}", raw.len());
    packing.estimate(&dense);
    assert_eq!(packing.unpack_all(&raw, boxes, &mut back), Ok(nonzero(codes)));
    assert_eq!(back, codes);
}

/// Outliers, missing and exact samples of a block of at most 65535 samples.
pub fn payloads(data: &[u8]) {
    let mut input = Input::new(data);
    let (size, total) = (input.pick(&[1, 2, 4, 8]), input.short());
    let (raw, mut again) = (input.rest(), Vec::new());
    if let Ok(outliers) = unpack_outliers(raw, size, total) {
        assert!(outliers.positions.is_sorted_by(|a, b| a < b));
        assert!(outliers.positions.iter().all(|&at| (at as usize) < total));
        pack_outliers(&outliers, size, &mut again);
        assert_eq!(again, raw, "outliers");
    }
    if let Ok((mask, samples)) = unpack_missing(raw, size, total) {
        assert_eq!(mask.len(), total);
        again.clear();
        pack_missing(&mask, &samples, size, &mut again);
        assert_eq!(again, raw, "missing samples");
    }
    if let Ok(samples) = unpack_exact(raw, size, total) {
        again.clear();
        pack_exact(&samples, size, &mut again);
        assert_eq!(again, raw, "exact samples");
    }
}

fn nonzero(codes: &[i32]) -> usize {
    codes.iter().filter(|&&code| code != 0).count()
}

/// Most codes are small: one byte each. After a byte 128, four bytes are one code.
fn numbers(data: &[u8]) -> Vec<i32> {
    let (mut input, mut codes) = (Input::new(data), Vec::new());
    while !input.is_empty() {
        codes.push(match input.byte() as i8 {
            i8::MIN => {
                let mut code = [0; 4];
                input.bytes(4).iter().zip(&mut code).for_each(|(from, to)| *to = *from);
                i32::from_le_bytes(code)
            }
            small => small.into(),
        });
    }
    codes
}
