//! The payloads of parts: packing and strict unpacking.
//!
//! Unpacking accepts exactly what packing writes; its errors name the reason. It allocates no more than the caller's
//! totals require.

use crate::bytes::{ParseResult, ensure};
use crate::planes::{bitmap_len, pack_bits, pack_planes, unpack_bits, unpack_planes};

/// Packs quantised coefficients, coefficient-major: `codes[k * voxels + voxel]`.
///
/// Appends one byte, the width `w`. If all codes are zero, `w` is 0 and nothing follows. Otherwise a bitmap of the nonzero
/// codes follows, then `w` (1 to 4) byte planes of their zig-zag values minus 1; `w` is the least width that holds the
/// largest of them.
pub fn pack_codes(codes: &[i32], out: &mut Vec<u8>) {
    let largest = codes.iter().map(|&code| zigzag(code)).max().unwrap_or(0);
    if largest == 0 {
        return out.push(0);
    }
    let width = width_of(largest - 1);
    out.push(width as u8);
    pack_bits(codes, |code| code != 0, out);
    (0..width).for_each(|plane| pack_nonzero(codes, |code| ((zigzag(code).wrapping_sub(1)) >> (8 * plane)) as u8, out));
}

/// Appends a byte of each code that is not zero.
fn pack_nonzero(codes: &[i32], byte_of: impl Fn(i32) -> u8, out: &mut Vec<u8>) {
    for codes in codes.chunks(64).filter(|codes| codes.iter().fold(0, |any, code| any | code) != 0) {
        let (start, mut count) = (out.len(), 0);
        out.resize(start + codes.len(), 0);
        for &code in codes {
            out[start + count] = byte_of(code); // overwritten by the next if the code is zero
            count += usize::from(code != 0);
        }
        out.truncate(start + count);
    }
}

/// Fills `codes`, which must have the length of the packed codes; returns how many are not zero.
///
/// # Errors
/// The reason if `raw` is not what [`pack_codes`] writes.
pub fn unpack_codes(raw: &[u8], codes: &mut [i32]) -> Result<usize, String> {
    codes.fill(0);
    let (&width, rest) = raw.split_first().ok_or("no width byte")?;
    if width == 0 {
        return ensure(rest.is_empty(), || "bytes after the width of all zeros".into()).map(|()| 0);
    }
    ensure(width <= 4, || format!("a width of {width} bytes"))?;
    let (bitmap, planes) = split_bitmap(rest, codes.len())?;
    let count = count_bits(bitmap);
    let expected = count * usize::from(width);
    ensure(count > 0 && planes.len() == expected, || {
        format!("{} bytes of planes instead of {expected}", planes.len())
    })?;
    let largest = match width {
        1 => scatter::<1>(bitmap, planes, count, codes),
        2 => scatter::<2>(bitmap, planes, count, codes),
        3 => scatter::<3>(bitmap, planes, count, codes),
        _ => scatter::<4>(bitmap, planes, count, codes),
    };
    ensure(width_of(largest) == usize::from(width), || "the width is larger than necessary".into())?;
    ensure(largest != u32::MAX, || "a code out of range".into())?;
    Ok(count)
}

/// Writes the values of `W` planes to the positions set in the bitmap; returns the largest.
fn scatter<const W: usize>(bitmap: &[u8], planes: &[u8], count: usize, codes: &mut [i32]) -> u32 {
    let planes: [&[u8]; W] = std::array::from_fn(|plane| &planes[plane * count..(plane + 1) * count]);
    let (mut next, mut largest) = (0, 0);
    for (&byte, codes) in bitmap.iter().zip(codes.chunks_mut(8)) {
        let mut bits = byte;
        while bits != 0 {
            let value = (0..W).fold(0, |value, plane| value | u32::from(planes[plane][next]) << (8 * plane));
            codes[bits.trailing_zeros() as usize] = unzigzag(value.wrapping_add(1));
            largest = largest.max(value);
            next += 1;
            bits &= bits - 1;
        }
    }
    largest
}

/// The least number of bytes, at least 1, that holds a value.
fn width_of(value: u32) -> usize {
    (4 - value.leading_zeros() as usize / 8).max(1)
}

/// Maps 0, -1, 1, -2, ... to 0, 1, 2, 3, ...
fn zigzag(code: i32) -> u32 {
    ((code << 1) ^ (code >> 31)) as u32
}

fn unzigzag(value: u32) -> i32 {
    (value >> 1) as i32 ^ -((value & 1) as i32)
}

/// Samples that are stored exactly.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Outliers {
    /// `frame * voxels + voxel` within the block and window, strictly ascending.
    pub positions: Vec<u32>,
    /// Their samples, little-endian, one after another.
    pub samples: Vec<u8>,
}

/// Appends 4 byte planes of the gaps (position minus the previous one minus 1; the first position itself), then
/// `sample_size` byte planes of the samples. Positions must ascend strictly.
pub fn pack_outliers(outliers: &Outliers, sample_size: usize, out: &mut Vec<u8>) {
    let mut next = 0u32;
    let mut gaps = Vec::with_capacity(4 * outliers.positions.len());
    for &position in &outliers.positions {
        gaps.extend_from_slice(&position.wrapping_sub(next).to_le_bytes());
        next = position.wrapping_add(1);
    }
    pack_planes(&gaps, 4, out);
    pack_planes(&outliers.samples, sample_size, out);
}

/// Unpacks the outliers of a block of `total` samples (frames x voxels).
///
/// # Errors
/// The reason if `raw` is not what [`pack_outliers`] writes.
pub fn unpack_outliers(raw: &[u8], sample_size: usize, total: usize) -> Result<Outliers, String> {
    let each = 4 + sample_size;
    ensure(raw.len().is_multiple_of(each), || format!("{} bytes are not a multiple of {each}", raw.len()))?;
    let count = raw.len() / each;
    ensure(count <= total, || format!("{count} outliers among {total} samples"))?;
    let (gaps, samples) = raw.split_at(4 * count);
    Ok(Outliers { positions: ascend(&unpack_planes(gaps, 4), total)?, samples: unpack_planes(samples, sample_size) })
}

/// The positions that little-endian gaps give; all must be below `total`.
fn ascend(gaps: &[u8], total: usize) -> ParseResult<Vec<u32>> {
    let mut next = 0u64;
    let position = |gap: &[u8; 4]| {
        let position = next + u64::from(u32::from_le_bytes(*gap));
        next = position + 1;
        let position = u32::try_from(position).ok().filter(|&p| (p as usize) < total);
        position.ok_or_else(|| format!("an outlier outside the block's {total} samples"))
    };
    gaps.as_chunks::<4>().0.iter().map(position).collect()
}

/// Appends a bitmap of the missing samples (`mask` is indexed by `frame * voxels + voxel`), then `sample_size` byte planes
/// of these samples, given as little-endian bytes in the same order.
pub fn pack_missing(mask: &[bool], samples: &[u8], sample_size: usize, out: &mut Vec<u8>) {
    pack_bits(mask, |missing| missing, out);
    pack_planes(samples, sample_size, out);
}

/// Unpacks the mask and the bytes of the missing samples of a block of `total` samples.
///
/// # Errors
/// The reason if `raw` is not what [`pack_missing`] writes.
pub fn unpack_missing(raw: &[u8], sample_size: usize, total: usize) -> Result<(Vec<bool>, Vec<u8>), String> {
    let (bitmap, planes) = split_bitmap(raw, total)?;
    let expected = count_bits(bitmap) * sample_size;
    ensure(planes.len() == expected, || format!("{} bytes of planes instead of {expected}", planes.len()))?;
    Ok((unpack_bits(bitmap, total), unpack_planes(planes, sample_size)))
}

/// Appends `sample_size` byte planes of all samples (`frame * voxels + voxel`, little-endian).
pub fn pack_exact(samples: &[u8], sample_size: usize, out: &mut Vec<u8>) {
    pack_planes(samples, sample_size, out);
}

/// Unpacks the little-endian bytes of all `total` samples of a block.
///
/// # Errors
/// The reason if `raw` is not what [`pack_exact`] writes.
pub fn unpack_exact(raw: &[u8], sample_size: usize, total: usize) -> Result<Vec<u8>, String> {
    let exact = total.checked_mul(sample_size) == Some(raw.len());
    ensure(exact, || format!("{} bytes for {total} samples of {sample_size}", raw.len()))?;
    Ok(unpack_planes(raw, sample_size))
}

/// Splits off a bitmap of `total` bits, whose padding bits must be zero.
fn split_bitmap(raw: &[u8], total: usize) -> ParseResult<(&[u8], &[u8])> {
    let short = || format!("{} bytes are too few for a bitmap of {total}", raw.len());
    let (bitmap, rest) = raw.split_at_checked(bitmap_len(total)).ok_or_else(short)?;
    let padding = if total.is_multiple_of(8) { 0 } else { bitmap.last().map_or(0, |last| last >> (total % 8)) };
    ensure(padding == 0, || "padding bits are not zero".into())?;
    Ok((bitmap, rest))
}

fn count_bits(bitmap: &[u8]) -> usize {
    bitmap.iter().map(|byte| byte.count_ones() as usize).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn packed(codes: &[i32]) -> Vec<u8> {
        let mut out = Vec::new();
        pack_codes(codes, &mut out);
        out
    }

    #[test]
    fn codes_have_the_documented_bytes() {
        assert_eq!(packed(&[0, -1, 0, 1, 0, 0, 0, 0, -2]), [1, 0b1010, 1, 0, 1, 2]);
        assert_eq!(packed(&[0; 100]), [0]);
        assert_eq!(packed(&[128, -128]), [1, 3, 255, 254]);
        assert_eq!(packed(&[129]), [2, 1, 1, 1]);
        assert_eq!(packed(&[i32::MIN]), [4, 1, 0xFE, 0xFF, 0xFF, 0xFF]);
    }

    #[test]
    fn hostile_codes_are_refused() {
        let cases: [&[u8]; 9] = [
            &[],
            &[0, 0],
            &[5, 1, 1, 1, 1, 1, 1],
            &[1],
            &[1, 0],
            &[1, 1],
            &[1, 1, 7, 7],
            &[1, 0b1000, 7],
            &[4, 1, 255, 255, 255, 255],
        ];
        for raw in cases.into_iter().chain([&[2, 1, 7, 0][..]]) {
            assert!(unpack_codes(raw, &mut [0; 3]).is_err(), "{raw:?}");
        }
    }

    #[test]
    fn hostile_outliers_and_masks_are_refused() {
        assert!(unpack_outliers(&[5, 0, 0, 0, 1], 1, 5).is_err());
        assert!(unpack_outliers(&[0, 255, 0, 255, 0, 255, 0, 255, 1, 1], 1, 1 << 20).is_err());
        assert!(unpack_outliers(&[0; 6], 1, 5).is_err());
        assert!(unpack_outliers(&[0; 40], 1, 5).is_err());
        assert!(unpack_missing(&[0x20], 1, 5).is_err());
        assert!(unpack_missing(&[1], 1, 5).is_err());
        assert!(unpack_exact(&[1; 9], 2, 5).is_err());
        assert!(unpack_exact(&[], 8, usize::MAX).is_err());
    }

    proptest! {
        #[test]
        fn codes_round_trip(codes in codes()) {
            let mut back = vec![9; codes.len()];
            let count = unpack_codes(&packed(&codes), &mut back).expect("packed");
            prop_assert_eq!(count, codes.iter().filter(|&&c| c != 0).count());
            prop_assert_eq!(back, codes);
        }

        #[test]
        fn outliers_round_trip(set in prop::collection::btree_set(0u32..5000, 0..200), size in sizes(), seed: u8) {
            let samples = (0..set.len() * size).map(|i| (i as u8).wrapping_mul(seed)).collect();
            let outliers = Outliers { positions: set.into_iter().collect(), samples };
            let mut raw = Vec::new();
            pack_outliers(&outliers, size, &mut raw);
            prop_assert_eq!(unpack_outliers(&raw, size, 5000).expect("packed"), outliers);
        }

        #[test]
        fn masks_and_exact_samples_round_trip(mask in prop::collection::vec(any::<bool>(), 1..300), size in sizes()) {
            let count = mask.iter().filter(|&&m| m).count();
            let samples: Vec<u8> = (0..count * size).map(|i| i as u8).collect();
            let (mut missing, mut exact) = (Vec::new(), Vec::new());
            pack_missing(&mask, &samples, size, &mut missing);
            pack_exact(&samples, size, &mut exact);
            let back = unpack_missing(&missing, size, mask.len()).expect("packed");
            prop_assert_eq!(back, (mask, samples.clone()));
            prop_assert_eq!(unpack_exact(&exact, size, count).expect("packed"), samples);
        }

        #[test]
        fn unpacked_payloads_pack_to_the_same_bytes(raw in prop::collection::vec(0u8..6, 0..40), total in 0usize..40, size in sizes()) {
            let mut codes = vec![0; total];
            if unpack_codes(&raw, &mut codes).is_ok() && total > 0 {
                prop_assert_eq!(packed(&codes), raw.clone());
            }
            if let Ok(outliers) = unpack_outliers(&raw, size, total) {
                let mut again = Vec::new();
                pack_outliers(&outliers, size, &mut again);
                prop_assert_eq!(&again, &raw);
            }
            if let Ok((mask, samples)) = unpack_missing(&raw, size, total) {
                let mut again = Vec::new();
                pack_missing(&mask, &samples, size, &mut again);
                prop_assert_eq!(&again, &raw);
            }
        }
    }

    fn codes() -> impl Strategy<Value = Vec<i32>> {
        let code = prop_oneof![6 => Just(0), 2 => -3i32..3, 1 => -70_000i32..70_000, 1 => any::<i32>()];
        prop::collection::vec(code, 0..300)
    }

    fn sizes() -> impl Strategy<Value = usize> {
        prop::sample::select(vec![1usize, 2, 4, 8])
    }
}
