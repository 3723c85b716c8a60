//! The header of an `.npy` file or stream, written without a seek; the payload follows as raw little-endian bytes.

use crate::base::sample::SampleType;
use npyz::{DType, TypeStr, WriteOptions, WriterBuilder};
use std::io::{self, Write};

/// Writes the header of a C-order array, last axis fastest. The shape must be final: there is one header for all frames.
pub fn write_header(ty: SampleType, shape: &[usize], out: &mut impl Write) -> io::Result<()> {
    let shape: Vec<u64> = shape.iter().map(|n| *n as u64).collect();
    WriteOptions::new_header_only().dtype(dtype(ty)?).shape(&shape).writer(out).write_header_only().map(|_| ())
}

/// NumPy's name of a type, as `<f4`.
fn dtype(ty: SampleType) -> io::Result<DType> {
    let order = if ty.size() == 1 { '|' } else { '<' };
    let name = format!("{order}{}{}", &ty.name()[..1], ty.size());
    name.parse::<TypeStr>().map(DType::Plain).map_err(|e| io::Error::other(e.to_string()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_type_has_a_numpy_name() {
        let names = SampleType::ALL.map(|ty| dtype(ty).expect("a type").descr());
        assert_eq!(names, ["'|u1'", "'|i1'", "'<u2'", "'<i2'", "'<u4'", "'<i4'", "'<f2'", "'<f4'", "'<f8'"]);
    }

    #[test]
    fn a_header_reads_back() {
        for ty in SampleType::ALL {
            let mut bytes = Vec::new();
            write_header(ty, &[2, 3, 4], &mut bytes).expect("written");
            let file = npyz::NpyFile::new(bytes.as_slice()).expect("read");
            assert_eq!((file.shape(), file.dtype().num_bytes()), (&[2, 3, 4][..], Some(ty.size())), "{ty}");
        }
    }
}
