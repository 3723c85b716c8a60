//! Bitmaps and byte planes, the building blocks of payloads.

/// Bytes of a bitmap of `total` bits.
pub(crate) fn bitmap_len(total: usize) -> usize {
    total.div_ceil(8)
}

/// Appends a bit for each value, 1 if it is set: the first value in the lowest bit of the first byte, padding bits zero.
pub(crate) fn pack_bits<T: Copy>(values: &[T], is_set: impl Fn(T) -> bool, out: &mut Vec<u8>) {
    let (bytes, last) = values.as_chunks::<8>();
    out.extend(bytes.iter().map(|values| byte_of(values.map(|value| u8::from(is_set(value))))));
    if !last.is_empty() {
        out.push(byte_of(std::array::from_fn(|i| last.get(i).map_or(0, |value| u8::from(is_set(*value))))));
    }
}

/// The byte with these bits, each 0 or 1. The product moves bit n from the lowest place of byte n to place n of the highest byte.
fn byte_of(bits: [u8; 8]) -> u8 {
    (u64::from_le_bytes(bits).wrapping_mul(0x0102_0408_1020_4080) >> 56) as u8
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
