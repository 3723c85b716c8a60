//! Bitmaps and byte planes, the building blocks of payloads.

/// Bytes of a bitmap of `total` bits.
pub(crate) fn bitmap_len(total: usize) -> usize {
    total.div_ceil(8)
}

/// Appends a bitmap, least significant bit first, padding bits zero.
pub(crate) fn pack_bits(bits: impl ExactSizeIterator<Item = bool>, out: &mut Vec<u8>) {
    let start = out.len();
    out.resize(start + bitmap_len(bits.len()), 0);
    for (i, bit) in bits.enumerate() {
        out[start + i / 8] |= u8::from(bit) << (i % 8);
    }
}

/// The first `total` bits of a bitmap. Panics if it is shorter.
pub(crate) fn unpack_bits(bitmap: &[u8], total: usize) -> Vec<bool> {
    (0..total).map(|i| bitmap[i / 8] >> (i % 8) & 1 == 1).collect()
}

/// Splits values of `size` bytes into byte planes: all first bytes, then all second bytes, and so on.
pub(crate) fn pack_planes(values: &[u8], size: usize, out: &mut Vec<u8>) {
    for plane in 0..size {
        out.extend(values.chunks_exact(size).map(|value| value[plane]));
    }
}

/// Joins byte planes into values of `size` bytes.
pub(crate) fn unpack_planes(planes: &[u8], size: usize) -> Vec<u8> {
    let count = planes.len() / size;
    let mut values = vec![0; count * size];
    for (plane, bytes) in planes.chunks_exact(count.max(1)).take(size).enumerate() {
        for (value, byte) in values.chunks_exact_mut(size).zip(bytes) {
            value[plane] = *byte;
        }
    }
    values
}
