//! What a block adds to the planes of a picture: a value for each of its voxels, one plane at a time.

use crate::base::error::Result;
use crate::base::sample::{SampleType, load_as};
use crate::codec::field::Plane;
use crate::codec::real::Real;

/// The values of a block's voxels in one plane.
#[derive(Debug, Clone, Copy)]
pub enum PlaneValues<'a> {
    /// All are zero.
    Nothing,
    /// One for each voxel: x fastest, then y, z.
    Single(&'a [f32]),
    /// As [`Self::Single`].
    Double(&'a [f64]),
    /// Those that are not zero, ascending: (place of the voxel in the block's array, value).
    Few(&'a [(u32, f64)]),
}

impl PlaneValues<'_> {
    /// Calls `visit(voxel, amount)` for all that are not zero, ascending.
    pub(super) fn for_each(&self, mut visit: impl FnMut(usize, f64)) {
        let mut all = |amounts: &mut dyn Iterator<Item = f64>| {
            amounts.enumerate().filter(|(_, amount)| *amount != 0.0).for_each(|(voxel, amount)| visit(voxel, amount));
        };
        match self {
            Self::Nothing => {}
            Self::Single(amounts) => all(&mut amounts.iter().map(|amount| f64::from(*amount))),
            Self::Double(amounts) => all(&mut amounts.iter().copied()),
            Self::Few(amounts) => amounts.iter().for_each(|(voxel, amount)| visit(*voxel as usize, *amount)),
        }
    }

    /// Adds `factor` times each to the sums of the voxels.
    pub(super) fn add_to(&self, factor: f64, sums: &mut [f64]) {
        match self {
            Self::Nothing => {}
            Self::Single(amounts) => add_scaled(amounts, factor, sums),
            Self::Double(amounts) => add_scaled(amounts, factor, sums),
            Self::Few(amounts) => amounts.iter().for_each(|(voxel, amount)| sums[*voxel as usize] += factor * amount),
        }
    }
}

#[cfg_attr(not(feature = "portable"), multiversion::multiversion(targets("x86_64+avx512f", "x86_64+avx2")))]
fn add_scaled<R: Real>(amounts: &[R], factor: f64, sums: &mut [f64]) {
    sums.iter_mut().zip(amounts).for_each(|(sum, amount)| *sum += factor * amount.to_f64());
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

/// A block that has been read, or is read plane by plane.
pub trait BlockPlanes: Send + Sync {
    /// Number of voxels of the block.
    fn voxels(&self) -> usize;

    /// The values of a plane (0 to [`Layout::planes`](super::Layout::planes)), which may lie in `room`.
    ///
    /// # Errors
    /// Whatever keeps the block from being read; it ends the rendering.
    fn plane<'a>(&'a self, plane: usize, room: &'a mut Scratch) -> Result<PlaneValues<'a>>;

    /// Number of nonzero coefficients, and of stored bytes that were read for them; for the report.
    fn held(&self) -> [u64; 2];
}

/// Where blocks come from.
pub(super) trait BlockSource: Sync {
    /// Prepares for these blocks, which are read next.
    fn fetch(&self, _blocks: &[usize]) -> Result<()> {
        Ok(())
    }

    /// Reads a block.
    fn planes(&self, block: usize) -> Result<Box<dyn BlockPlanes + '_>>;
}

/// Room for the values of a plane while they are made; each worker has its own.
#[derive(Debug, Default)]
pub struct Scratch {
    pub(super) bytes: Vec<u8>,
    pub(super) single: Vec<f32>,
    pub(super) double: Vec<f64>,
}

impl Scratch {
    /// Room for one value of each of so many voxels; its content is of an earlier block.
    pub fn room(&mut self, voxels: usize) -> &mut [f64] {
        self.double.resize(voxels, 0.0);
        &mut self.double
    }

    /// The samples that lie in `bytes`, of which none is missing.
    pub(super) fn samples(&mut self, ty: SampleType) -> PlaneValues<'_> {
        let count = self.bytes.len() / ty.size();
        if matches!(ty, SampleType::U32 | SampleType::I32 | SampleType::F64) {
            // Singles do not hold them.
            self.double.resize(count, 0.0);
            load_as(ty, &self.bytes, &mut self.double, |v| v);
            return PlaneValues::Double(&self.double);
        }
        self.single.resize(count, 0.0);
        load_as(ty, &self.bytes, &mut self.single, |v| v as f32);
        PlaneValues::Single(&self.single)
    }

    /// Those with zeros for what is missing; or, if `absent`, a 1 for that and zeros else.
    pub(super) fn masked(
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

/// A 1 for each of so many voxels.
#[derive(Debug)]
pub(super) struct UnitValues(pub(super) usize);

impl BlockPlanes for UnitValues {
    fn voxels(&self) -> usize {
        self.0
    }

    fn plane<'a>(&'a self, _: usize, room: &'a mut Scratch) -> Result<PlaneValues<'a>> {
        room.single.clear();
        room.single.resize(self.0, 1.0);
        Ok(PlaneValues::Single(&room.single))
    }

    fn held(&self) -> [u64; 2] {
        [0; 2]
    }
}
