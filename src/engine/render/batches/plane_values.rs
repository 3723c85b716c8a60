//! The values that the voxels of a block add to the planes of a picture, one plane at a time.

use wavesplat_core::base::error::Result;
use wavesplat_core::base::sample::{SampleType, load_as};
use wavesplat_core::base::vectors::dispatch;
use wavesplat_core::codec::field::Plane;
use wavesplat_core::codec::real::Real;

/// The values of a block's voxels in one plane.
#[derive(Debug, Clone, Copy)]
pub enum PlaneValues<'a> {
    /// All are zero.
    Nothing,
    /// One value for each voxel: x fastest, then y, z.
    Single(&'a [f32]),
    /// The same as [`Self::Single`], in f64.
    Double(&'a [f64]),
    /// The nonzero values: (voxel, value), ascending by voxel.
    Few(&'a [(u32, f64)]),
}

impl PlaneValues<'_> {
    /// Calls `visit(voxel, value)` for all nonzero values, ascending by voxel.
    pub(in crate::render) fn for_each(&self, mut visit: impl FnMut(usize, f64)) {
        let mut all = |values: &mut dyn Iterator<Item = f64>| {
            values.enumerate().filter(|(_, value)| *value != 0.0).for_each(|(voxel, value)| visit(voxel, value));
        };
        match self {
            Self::Nothing => {}
            Self::Single(values) => all(&mut values.iter().map(|value| f64::from(*value))),
            Self::Double(values) => all(&mut values.iter().copied()),
            Self::Few(values) => values.iter().for_each(|(voxel, value)| visit(*voxel as usize, *value)),
        }
    }

    /// Adds `factor` times each value to the sum of its voxel.
    pub(in crate::render) fn add_to(&self, factor: f64, sums: &mut [f64]) {
        match self {
            Self::Nothing => {}
            Self::Single(values) => dispatch!(add_scaled(values, factor, sums)),
            Self::Double(values) => dispatch!(add_scaled(values, factor, sums)),
            Self::Few(values) => values.iter().for_each(|(voxel, value)| sums[*voxel as usize] += factor * value),
        }
    }
}

#[inline(always)]
fn add_scaled<R: Real>(values: &[R], factor: f64, sums: &mut [f64]) {
    sums.iter_mut().zip(values).for_each(|(sum, value)| *sum += factor * value.to_f64());
}

impl<'a> From<Plane<'a>> for PlaneValues<'a> {
    fn from(plane: Plane<'a>) -> Self {
        match plane {
            Plane::Zero => Self::Nothing,
            Plane::Single(values) => Self::Single(values),
            Plane::Double(values) => Self::Double(values),
        }
    }
}

/// A block that is ready to be splatted.
pub trait BlockPlanes: Send + Sync {
    /// Number of voxels in the block.
    fn voxels(&self) -> usize;

    /// The values of a plane, 0 to [`Layout::planes`](crate::render::Layout::planes). They may be stored in `scratch`.
    ///
    /// # Errors
    /// Any error ends the rendering.
    fn plane<'a>(&'a self, plane: usize, scratch: &'a mut Scratch) -> Result<PlaneValues<'a>>;

    /// Number of nonzero coefficients, and stored bytes that were read; for the report.
    fn held(&self) -> [u64; 2];
}

/// Buffers for the values of a plane, reused from call to call.
#[derive(Debug, Default)]
pub struct Scratch {
    pub(in crate::render) bytes: Vec<u8>,
    pub(in crate::render) single: Vec<f32>,
    pub(in crate::render) double: Vec<f64>,
}

impl Scratch {
    /// A buffer for one value of each voxel. It holds values of an earlier plane.
    pub fn values(&mut self, voxels: usize) -> &mut [f64] {
        self.double.resize(voxels, 0.0);
        &mut self.double
    }

    /// The samples in `bytes`; none of them is missing.
    pub(in crate::render) fn samples(&mut self, ty: SampleType) -> PlaneValues<'_> {
        let count = self.bytes.len() / ty.size();
        if matches!(ty, SampleType::U32 | SampleType::I32 | SampleType::F64) {
            // f32 cannot represent these exactly.
            self.double.resize(count, 0.0);
            load_as(ty, &self.bytes, &mut self.double, |v| v);
            return PlaneValues::Double(&self.double);
        }
        self.single.resize(count, 0.0);
        load_as(ty, &self.bytes, &mut self.single, |v| v as f32);
        PlaneValues::Single(&self.single)
    }

    /// The samples in `bytes`, with zeros for missing samples. If `absent`, ones for missing samples and zeros
    /// elsewhere instead.
    pub(in crate::render) fn masked(
        &mut self,
        ty: SampleType,
        absent: bool,
        is_missing: impl Fn(usize, f64) -> bool,
    ) -> PlaneValues<'_> {
        self.double.resize(self.bytes.len() / ty.size(), 0.0);
        load_as(ty, &self.bytes, &mut self.double, |v| v);
        for (index, v) in self.double.iter_mut().enumerate() {
            *v = match (is_missing(index, *v), absent) {
                (missing, true) => f64::from(u8::from(missing)),
                (true, false) => 0.0,
                (false, false) => *v,
            };
        }
        PlaneValues::Double(&self.double)
    }
}

/// A block of this many voxels with the value 1.
#[derive(Debug)]
pub(in crate::render) struct UnitValues(pub(in crate::render) usize);

impl BlockPlanes for UnitValues {
    fn voxels(&self) -> usize {
        self.0
    }

    fn plane<'a>(&'a self, _: usize, scratch: &'a mut Scratch) -> Result<PlaneValues<'a>> {
        scratch.single.clear();
        scratch.single.resize(self.0, 1.0);
        Ok(PlaneValues::Single(&scratch.single))
    }

    fn held(&self) -> [u64; 2] {
        [0; 2]
    }
}
