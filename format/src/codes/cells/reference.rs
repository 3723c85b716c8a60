//! A reader of lattice codes that follows `FORMAT.md` literally. It is slow and obvious, and shares no code with the fast one.

use crate::pyramid::Packing;

/// Reads bytes in order.
struct Input<'a>(&'a [u8]);

impl Input<'_> {
    fn byte(&mut self) -> Option<u8> {
        let (&byte, rest) = self.0.split_first()?;
        self.0 = rest;
        Some(byte)
    }

    fn little_endian(&mut self, bytes: u32) -> Option<u64> {
        (0..bytes).try_fold(0, |value, i| Some(value + (u64::from(self.byte()?) << (8 * i))))
    }

    fn number(&mut self) -> Option<u64> {
        let mut value = 0;
        for i in 0..5 {
            let byte = self.byte()?;
            value += u64::from(byte % 128) << (7 * i);
            if byte < 128 {
                return (byte > 0 || i == 0).then_some(value);
            }
        }
        None
    }
}

/// Reads bits in order.
struct Bits<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl<'a> Bits<'a> {
    fn take(&mut self, count: u32) -> Option<u64> {
        let mut value = 0;
        for i in 0..count {
            let byte = self.bytes.get(self.at / 8)?;
            value += u64::from(byte / (1 << (self.at % 8)) % 2) << i;
            self.at += 1;
        }
        Some(value)
    }

    /// The bytes after the padding; fails unless the padding is zero.
    fn rest(mut self) -> Option<&'a [u8]> {
        while !self.at.is_multiple_of(8) {
            (self.take(1)? == 0).then_some(())?;
        }
        Some(&self.bytes[self.at / 8..])
    }
}

fn frequencies(input: &mut Input, b: u64) -> Option<Vec<u64>> {
    let mut bits = Bits { bytes: input.0, at: 0 };
    let (mut all, mut length) = (Vec::new(), b);
    while all.iter().sum::<u64>() < 1 << b && all.len() < 256 {
        if bits.take(1)? == 1 {
            length = match (bits.take(1)?, length) {
                (1, _) => bits.take(4)?,
                (_, length) if bits.take(1)? == 0 => length + 1,
                (_, length) => length.checked_sub(1)?,
            };
        }
        (length <= b).then_some(())?;
        all.push(if length == 0 { 0 } else { (1 << (length - 1)) + bits.take(length as u32 - 1)? });
    }
    input.0 = bits.rest()?;
    (all.iter().sum::<u64>() == 1 << b).then_some(all)
}

fn coded(input: &mut Input, b: u64, length: u64, lanes: usize) -> Option<Vec<u8>> {
    let frequencies = frequencies(input, b)?;
    let mut words = input.number()?;
    let mut states = (0..lanes).map(|_| input.little_endian(4)).collect::<Option<Vec<u64>>>()?;
    let mut symbols = Vec::new();
    states.iter().all(|&state| state >= 65536).then_some(())?;
    for i in 0..length as usize {
        let state = &mut states[i % lanes];
        let (mut symbol, mut slot) = (0, *state % (1 << b));
        while slot >= frequencies[symbol] {
            slot -= frequencies[symbol];
            symbol += 1;
        }
        *state = frequencies[symbol] * (*state >> b) + slot;
        if *state < 65536 {
            words = words.checked_sub(1)?;
            *state = *state * 65536 + input.little_endian(2)?;
        }
        symbols.push(symbol as u8);
    }
    (words == 0 && states.iter().all(|&state| state == 65536)).then_some(symbols)
}

fn segment(input: &mut Input, packing: Packing, left: usize) -> Option<Vec<u8>> {
    let head = input.number()?;
    let kinds = if packing == Packing::Flat { 4 } else { 8 };
    let length = head / kinds;
    (0 < length && length <= left as u64).then_some(())?;
    let usual = if length < 1024 { 1 } else { 4 };
    match head % kinds {
        0 => (0..length).map(|_| input.byte()).collect(),
        1 => input.byte().map(|byte| vec![byte; length as usize]),
        2 => coded(input, 12, length, usual),
        3 => coded(input, 14, length, usual),
        4 => coded(input, 12, length, 32),
        5 => coded(input, 14, length, 32),
        _ => None,
    }
}

fn class(value: usize, thresholds: &[usize]) -> usize {
    thresholds.iter().filter(|&&threshold| value >= threshold).count()
}

fn value(symbol: u8, bits: &mut Bits) -> Option<i64> {
    let symbol = i64::from(symbol);
    let value = if symbol < 128 {
        symbol
    } else {
        let length = 8 + (symbol as u32 - 128) / 4;
        (length <= 32).then_some(())?;
        ((4 + symbol % 4) << (length - 3)) + bits.take(length - 3)? as i64
    };
    (value < (1 << 32) - 1).then_some(())?;
    let zigzag = value + 1;
    Some(if zigzag % 2 == 0 { zigzag / 2 } else { -(zigzag + 1) / 2 })
}

/// The codes of all boxes.
pub(super) fn unpack(raw: &[u8], packing: Packing, boxes: &[[usize; 4]]) -> Option<Vec<i32>> {
    let mut input = Input(raw);
    let lengths = (0..9).map(|_| input.number()).collect::<Option<Vec<u64>>>()?;
    let cells = boxes.iter().map(|b| b[0].div_ceil(2) * b[1].div_ceil(2) * b[2].div_ceil(2) * b[3]).sum::<usize>();
    let codes = boxes.iter().map(|b| b.iter().product::<usize>()).sum::<usize>();
    (lengths[..5].iter().sum::<u64>() == cells as u64).then_some(())?;
    (lengths[5..].iter().sum::<u64>() <= codes as u64).then_some(())?;
    let total = lengths.iter().sum::<u64>() as usize;
    let mut symbols = Vec::new();
    while symbols.len() < total {
        symbols.extend(segment(&mut input, packing, total - symbols.len())?);
    }
    let mut symbols = symbols.into_iter();
    let streams = lengths.iter().map(|&length| symbols.by_ref().take(length as usize).collect::<Vec<u8>>());
    let mut streams: Vec<_> = streams.map(Vec::into_iter).collect();
    let mut bits = Bits { bytes: input.0, at: 0 };
    let mut all = Vec::new();
    for extents in boxes {
        all.extend(unpack_box(*extents, &mut streams, &mut bits)?);
    }
    let ended = streams.iter_mut().all(|stream| stream.next().is_none()) && bits.rest()?.is_empty();
    ended.then_some(all)
}

fn unpack_box(
    [sx, sy, sz, st]: [usize; 4],
    streams: &mut [std::vec::IntoIter<u8>],
    bits: &mut Bits,
) -> Option<Vec<i32>> {
    let mut codes = vec![0; sx * sy * sz * st];
    let mut counts = std::collections::HashMap::new();
    let order = (0..st).flat_map(|t| (0..sz.div_ceil(2)).map(move |z| (t, z)));
    let order = order.flat_map(|(t, z)| (0..sy.div_ceil(2)).map(move |y| (t, z, y)));
    for (t, z, y, x) in order.flat_map(|(t, z, y)| (0..sx.div_ceil(2)).map(move |x| (t, z, y, x))) {
        let before = [
            (t, z, y, x.wrapping_sub(1)),
            (t, z, y.wrapping_sub(1), x),
            (t, z.wrapping_sub(1), y, x),
            (t.wrapping_sub(1), z, y, x),
        ];
        let activity: usize = before.iter().map(|cell| counts.get(cell).copied().unwrap_or(0)).sum();
        let byte = streams[class(activity, &[1, 3, 8, 16])].next()?;
        let count = byte.count_ones() as usize;
        counts.insert((t, z, y, x), count);
        for bit in (0..8).filter(|bit| byte >> bit & 1 == 1) {
            let symbol = streams[5 + class(2 * count + activity / 2, &[4, 10, 20])].next()?;
            let (x, y, z) = (2 * x + bit % 2, 2 * y + bit / 2 % 2, 2 * z + bit / 4);
            (x < sx && y < sy && z < sz).then_some(())?;
            codes[x + sx * (y + sy * (z + sz * t))] = value(symbol, bits)?.try_into().ok()?;
        }
    }
    Some(codes)
}
