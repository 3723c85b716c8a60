//! Reads and writes little-endian fields; reads are bounds-checked.

/// The result of a check or parser. The error is the reason; the caller adds the place in the file.
pub(crate) type ParseResult<T = ()> = std::result::Result<T, String>;

/// Returns the error `what()` unless `ok`.
pub(crate) fn ensure(ok: bool, what: impl FnOnce() -> String) -> ParseResult {
    if ok { Ok(()) } else { Err(what()) }
}

/// Reads the fields of a record in order.
pub(crate) struct FieldReader<'a>(&'a [u8]);

impl<'a> FieldReader<'a> {
    pub(crate) fn new(bytes: &'a [u8]) -> Self {
        Self(bytes)
    }

    pub(crate) fn remaining(&self) -> usize {
        self.0.len()
    }

    /// What is not read yet.
    pub(crate) fn rest(self) -> &'a [u8] {
        self.0
    }

    pub(crate) fn array<const N: usize>(&mut self) -> ParseResult<[u8; N]> {
        let Some((head, tail)) = self.0.split_first_chunk::<N>() else {
            return Err(format!("ends {} bytes early", N - self.0.len()));
        };
        self.0 = tail;
        Ok(*head)
    }

    pub(crate) fn take(&mut self, count: usize) -> ParseResult<&'a [u8]> {
        let short = || format!("ends {} bytes early", count - self.0.len());
        let (head, tail) = self.0.split_at_checked(count).ok_or_else(short)?;
        self.0 = tail;
        Ok(head)
    }

    pub(crate) fn u16(&mut self) -> ParseResult<u16> {
        Ok(u16::from_le_bytes(self.array()?))
    }

    pub(crate) fn u32(&mut self) -> ParseResult<u32> {
        Ok(u32::from_le_bytes(self.array()?))
    }

    pub(crate) fn u64(&mut self) -> ParseResult<u64> {
        Ok(u64::from_le_bytes(self.array()?))
    }

    pub(crate) fn f64(&mut self) -> ParseResult<f64> {
        Ok(f64::from_le_bytes(self.array()?))
    }

    /// Skips `N` reserved bytes; fails unless they are zero.
    pub(crate) fn reserved<const N: usize>(&mut self) -> ParseResult {
        let bytes = self.array::<N>()?;
        ensure(bytes.iter().all(|&b| b == 0), || "reserved bytes are not zero".into())
    }

    /// Fails if bytes remain.
    pub(crate) fn end(&self) -> ParseResult {
        ensure(self.0.is_empty(), || format!("{} bytes too many", self.0.len()))
    }
}

/// Appends fields to a record.
pub(crate) trait FieldWriter {
    fn put(&mut self, bytes: &[u8]);

    fn put_u16(&mut self, value: u16) {
        self.put(&value.to_le_bytes());
    }

    fn put_u32(&mut self, value: u32) {
        self.put(&value.to_le_bytes());
    }

    fn put_u64(&mut self, value: u64) {
        self.put(&value.to_le_bytes());
    }

    fn put_f64(&mut self, value: f64) {
        self.put(&value.to_le_bytes());
    }
}

impl FieldWriter for Vec<u8> {
    fn put(&mut self, bytes: &[u8]) {
        self.extend_from_slice(bytes);
    }
}

/// Whether the value is a possible sum of squares, which may overflow: not negative and not NaN.
pub(crate) fn is_amount(value: f64) -> bool {
    value >= 0.0
}

/// Whether the value is finite and not negative.
pub(crate) fn finite_amount(value: f64) -> bool {
    value >= 0.0 && value.is_finite()
}

/// Whether the range is finite and in order, or the empty range: infinity to minus infinity.
pub(crate) fn is_range(min: f64, max: f64) -> bool {
    min.is_finite() && max.is_finite() && min <= max || min == f64::INFINITY && max == f64::NEG_INFINITY
}
