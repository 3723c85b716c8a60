//! Arrays stored uncompressed: they are read in place, without decoding.

use wavesplat_core::base::description::AxisRole;
use wavesplat_core::base::stored::StoredType;
use wavesplat_core::source::Parsed;
use wavesplat_core::source::layout::{Axis, Layout};
use wavesplat_core::source::parts::Stored;

/// Where the numbers of an array are. The last axis is the fastest.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct InPlace {
    /// The first byte.
    pub(crate) start: u64,
    /// Bytes from one index of the first axis to the next, if other data lie in between.
    pub(crate) record: Option<u64>,
    /// Whether numbers have their most significant byte first.
    pub(crate) big_endian: bool,
}

impl InPlace {
    /// The storage of an array with these axes. All its numbers must be within the `file` bytes of the file.
    pub(crate) fn stored(self, axes: Vec<Axis>, ty: StoredType, file: u64) -> Parsed<Stored> {
        let Some(first) = axes.first().copied() else { return Err("an array without axes is no volume".into()) };
        let mut stored = Stored::new(&Layout(axes), ty, self.big_endian)?;
        let inner = (stored.bytes / first.len) as u64;
        let record = self.record.unwrap_or(inner);
        let last = (first.len as u64 - 1).checked_mul(record).filter(|last| i64::try_from(*last).is_ok());
        let end = last.and_then(|last| self.start.checked_add(last)?.checked_add(inner));
        match end {
            Some(end) if end <= file && record >= inner => {}
            _ => return Err(format!("is cut short: its array does not end within the {file} bytes")),
        }
        let wider = record - inner; // between records
        let strides = &mut stored.strides;
        let skipped = match (first.role, first.role.voxels()) {
            (AxisRole::Frames, _) => {
                strides.frame = record;
                0
            }
            (_, Some(along)) => {
                strides.voxel[along] = if first.backwards { -(record as i64) } else { record as i64 };
                if first.backwards { first.len as u64 - 1 } else { 0 }
            }
            (_, None) => first.index as u64,
        };
        strides.first += skipped * wider;
        Ok(stored)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use wavesplat_core::base::sample::SampleType;

    fn place(record: Option<u64>) -> InPlace {
        InPlace { start: 100, record, big_endian: true }
    }

    #[test]
    fn records_of_other_arrays_are_stepped_over() {
        let axis = |role| Axis::new(role, 3);
        let (frames, z) = (axis(AxisRole::Frames), axis(AxisRole::Z));
        for first in [frames, z, Axis { backwards: true, ..z }, Axis::single(2, 3)] {
            let axes = vec![first, axis(AxisRole::Y), axis(AxisRole::X)];
            let plain = place(None).stored(axes.clone(), SampleType::I16.into(), 154).expect("54 bytes");
            assert_eq!(place(Some(18)).stored(axes.clone(), SampleType::I16.into(), 154), Ok(plain));
            let strides = place(Some(30)).stored(axes, SampleType::I16.into(), 178).expect("three records").strides;
            assert_eq!(strides.voxel[..2], [2, 6]);
            let expected = match (first.role, first.backwards) {
                (AxisRole::Frames, _) => (0, 30, 0),
                (AxisRole::Single, _) => (60, 0, 0),
                (_, true) => (60, 0, -30),
                (_, false) => (0, 0, 30),
            };
            assert_eq!((strides.first, strides.frame, strides.voxel[2]), expected);
        }
    }

    #[test]
    fn arrays_that_are_not_all_there_are_refused() {
        let stored =
            |record, file| place(record).stored(vec![Axis::new(AxisRole::Frames, 3)], SampleType::U8.into(), file);
        assert!(stored(None, 103).is_ok() && stored(Some(5), 111).is_ok());
        for (record, file) in [(None, 102), (Some(5), 110), (Some(0), 200), (Some(u64::MAX / 2), u64::MAX)] {
            assert!(stored(record, file).is_err(), "{record:?} of {file}");
        }
        assert!(place(None).stored(Vec::new(), SampleType::U8.into(), 200).is_err());
    }
}
