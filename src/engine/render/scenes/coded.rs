//! A decoded block of a file: its coefficients, samples or values in the planes of a batch plan.

use super::batch_plan::{BatchPlan, SplatSource};
use crate::file::{BlockValues, DecodedBlock};
use crate::render::batches::{BlockPlanes, PlaneValues, Scratch};
use std::sync::Arc;
use wavesplat_core::base::error::Result;
use wavesplat_core::codec::WindowCodec;
use wavesplat_core::codec::buffer::Buffer;
use wavesplat_core::codec::decode::{Block, WantedFrames};
use wavesplat_core::codec::field::Field;

/// A decoded block of a file.
pub(super) struct CodedBlock<'a> {
    plan: &'a BatchPlan,
    decoded: DecodedBlock,
    /// The error of its samples, for each error plane.
    errors: Vec<f64>,
    dense: Dense,
    /// For each plane, the values that correct the coefficients at single voxels; empty if there are none.
    few: Vec<Vec<(u32, f64)>>,
}

/// The dense values of a block.
enum Dense {
    /// Decoded samples of the plan's frames: `frame * voxels + voxel` in the window.
    Samples(Buffer<u8>),
    /// Coefficients, which are those of the decoded block.
    Coefficients,
}

impl<'a> CodedBlock<'a> {
    /// A block with the errors of its samples, one for each error plane.
    pub(super) fn new(plan: &'a BatchPlan, decoded: DecodedBlock, errors: Vec<f64>) -> Self {
        let DecodedBlock { block, field } = &decoded;
        if block.exact.is_some() || plan.what == SplatSource::Samples {
            let dense = Dense::Samples(block.samples_of(&plan.codec, &plan.wanted));
            return Self { plan, decoded, errors, dense, few: Vec::new() };
        }
        let few = overrides(plan, block, field.as_ref());
        Self { plan, decoded, errors, dense: Dense::Coefficients, few }
    }

    fn block(&self) -> &Block {
        &self.decoded.block
    }

    fn plane_of_samples<'r>(&self, samples: &[u8], plane: usize, scratch: &'r mut Scratch) -> PlaneValues<'r> {
        let (plan, block) = (self.plan, self.block());
        let Some((frame, absent)) = plan.layout.samples(plane) else { return PlaneValues::Nothing };
        let bytes = samples.len() / plan.codec.frames();
        scratch.bytes.clear();
        scratch.bytes.extend_from_slice(&samples[plan.wanted.frames[frame] * bytes..][..bytes]);
        let first = plan.wanted.frames[frame] * block.voxels;
        // An exact block may have no mask.
        let is_missing = |voxel: usize, v: f64| block.is_missing(first + voxel) || plan.codec.is_missing(v);
        match plan.layout.absent {
            true => scratch.masked(plan.codec.sample, absent, is_missing),
            false => scratch.samples(plan.codec.sample),
        }
    }

    /// The same error for every voxel; 0 for voxels without any sample.
    fn plane_of_errors<'r>(&self, error: f64, scratch: &'r mut Scratch) -> PlaneValues<'r> {
        if error == 0.0 {
            return PlaneValues::Nothing;
        }
        let coded = !matches!(self.dense, Dense::Samples(_));
        let error = |voxel| if coded && misses_all(self.plan, self.block(), voxel) { 0.0 } else { error };
        scratch.double.clear();
        scratch.double.extend((0..self.block().voxels).map(error));
        PlaneValues::Double(&scratch.double)
    }
}

impl BlockPlanes for CodedBlock<'_> {
    fn voxels(&self) -> usize {
        self.block().voxels
    }

    fn plane<'a>(&'a self, plane: usize, scratch: &'a mut Scratch) -> Result<PlaneValues<'a>> {
        let Self { plan, decoded, errors, dense, few } = self;
        let DecodedBlock { block, field } = decoded;
        if let Some(error) = plane.checked_sub(plan.layout.first_error()) {
            return Ok(self.plane_of_errors(errors[error], scratch));
        }
        let few =
            few.get(plane).filter(|few| !few.is_empty()).map_or(PlaneValues::Nothing, |few| PlaneValues::Few(few));
        Ok(match dense {
            Dense::Samples(samples) => self.plane_of_samples(samples, plane, scratch),
            Dense::Coefficients if plane < plan.layout.coefficients => {
                coefficients(plan, block, field.as_ref(), plan.kept[plane], scratch)
            }
            Dense::Coefficients => few,
        })
    }

    fn held(&self) -> [u64; 2] {
        let coded = !matches!(self.dense, Dense::Samples(_));
        let nonzero = if coded { self.block().codes.nonzero() } else { 0 };
        [nonzero as u64, self.block().bytes_read]
    }
}

/// The values of a block in the planes of a plan by values.
pub(super) struct ValuePlanes(pub(super) Arc<BlockValues>);

impl BlockPlanes for ValuePlanes {
    fn voxels(&self) -> usize {
        self.0.voxels
    }

    fn plane<'a>(&'a self, plane: usize, _: &'a mut Scratch) -> Result<PlaneValues<'a>> {
        let BlockValues { voxels, dense, few, .. } = &*self.0;
        let few = few.get(plane).filter(|few| !few.is_empty());
        let dense = dense.get(plane * voxels..(plane + 1) * voxels).map(PlaneValues::Double);
        Ok(dense.or(few.map(|few| PlaneValues::Few(few))).unwrap_or(PlaneValues::Nothing))
    }

    fn held(&self) -> [u64; 2] {
        self.0.held
    }
}

/// The values of a block that is not stored exactly, in the frames of a plan.
pub(super) fn values_of(plan: &BatchPlan, DecodedBlock { block, field }: &DecodedBlock) -> BlockValues {
    let mut few = overrides(plan, block, field.as_ref());
    let dense = values(plan, block, field.as_ref(), &mut few);
    BlockValues { voxels: block.voxels, dense, few, held: [block.codes.nonzero() as u64, block.bytes_read] }
}

/// The coefficients of one k of a block.
fn coefficients<'a>(
    plan: &BatchPlan,
    block: &'a Block,
    field: Option<&'a Field<'_>>,
    k: usize,
    scratch: &'a mut Scratch,
) -> PlaneValues<'a> {
    match field {
        Some(field) => field.plane(k, block.voxels, &mut scratch.double).into(),
        None => block.plane(&plan.codec, k, &mut scratch.single, &mut scratch.double).into(),
    }
}

/// The values of each frame of a plan: computed from the coefficients, plus the corrections in `few`, which are removed
/// from there.
fn values(plan: &BatchPlan, block: &Block, field: Option<&Field<'_>>, few: &mut [Vec<(u32, f64)>]) -> Vec<f64> {
    if block.is_zero() && few.is_empty() {
        return Vec::new();
    }
    let mut values = vec![0.0; plan.wanted.frames.len() * block.voxels];
    if plan.few {
        add_coefficients(plan, block, field, &mut values);
    } else if !block.is_zero() {
        put_runs(plan, block, field, &mut values);
    }
    for (few, values) in few.iter_mut().zip(values.chunks_exact_mut(block.voxels)) {
        std::mem::take(few).into_iter().for_each(|(voxel, value)| values[voxel as usize] += value);
    }
    values
}

/// Adds the coefficients of each k to the values of a plan's frames.
fn add_coefficients(plan: &BatchPlan, block: &Block, field: Option<&Field<'_>>, values: &mut [f64]) {
    let scratch = &mut Scratch::default();
    for k in &plan.kept {
        let coefficients = coefficients(plan, block, field, *k, scratch);
        for (frame, values) in plan.wanted.frames.iter().zip(values.chunks_exact_mut(block.voxels)) {
            coefficients.add_to(plan.codec.synthesis[*k][*frame], values);
        }
    }
}

/// Stores the values of a plan's frames by the inverse transform.
fn put_runs(plan: &BatchPlan, block: &Block, field: Option<&Field<'_>>, values: &mut [f64]) {
    let mut places = vec![None; plan.codec.frames()];
    plan.wanted.frames.iter().enumerate().for_each(|(i, frame)| places[*frame] = Some(i));
    let put = |first: usize, run: &[f64]| {
        if let Some(place) = places[first / block.voxels] {
            values[place * block.voxels + first % block.voxels..][..run.len()].copy_from_slice(run);
        }
    };
    match field {
        Some(field) => block.for_each_run_of(&plan.codec, field, &plan.wanted, put),
        None => block.for_each_run(&plan.codec, &plan.wanted, put),
    }
}

/// For each plane of a plan, the values that correct the coefficients at single voxels; empty if there are none.
fn overrides(plan: &BatchPlan, block: &Block, field: Option<&Field<'_>>) -> Vec<Vec<(u32, f64)>> {
    let (layout, codec) = (&plan.layout, &plan.codec);
    if !block.overrides() && !block.keeps_sides(codec) {
        return Vec::new();
    }
    let mut few = vec![Vec::new(); layout.planes()];
    let whole = field.is_none().then(|| block.field(codec));
    let samples = field.or(whole.as_ref()).map(|field| overridden_samples(block, codec, field, &plan.wanted));
    for (voxel, frame, value) in samples.into_iter().flatten() {
        few[layout.value(frame)].push((voxel as u32, value));
    }
    for voxel in (0..block.voxels).filter(|_| layout.absent) {
        let mut add = |plane: usize| few[plane].push((voxel as u32, 1.0));
        if misses_all(plan, block, voxel) {
            add(layout.absent_in_all());
        } else {
            let missing = |f: &usize| block.is_missing(plan.wanted.frames[*f] * block.voxels + voxel);
            (0..layout.frames).filter(missing).for_each(|f| add(layout.absent(f)));
        }
    }
    few
}

/// Whether a voxel has no sample in the whole window. This does not use the plan's frames, which depend on the memory.
fn misses_all(plan: &BatchPlan, block: &Block, voxel: usize) -> bool {
    (0..plan.codec.frames()).all(|f| block.is_missing(f * block.voxels + voxel))
}

/// The corrections of single frames, as (voxel, frame of the plan, value), ascending. For an outlier, and for a sample that goes to its
/// side of a value, the correction is the sample minus the value from the coefficients; for a missing sample it is minus that value.
fn overridden_samples(
    block: &Block,
    codec: &WindowCodec,
    field: &Field<'_>,
    frames: &WantedFrames,
) -> Vec<(usize, usize, f64)> {
    let mut wanted = vec![None; codec.frames()];
    frames.frames.iter().enumerate().for_each(|(i, f)| wanted[*f] = Some(i));
    let locate = |index: usize| wanted[index / block.voxels].map(|f| (index % block.voxels, f, index / block.voxels));
    let mut samples = vec![0.0; block.outliers.positions.len()];
    wavesplat_core::base::sample::load(codec.sample, &block.outliers.samples, &mut samples);
    let outliers = block.outliers.positions.iter().map(|p| *p as usize).zip(samples);
    let missing = block.missing.0.iter().enumerate().filter(|(_, m)| **m).map(|(i, _)| (i, 0.0));
    let mut targets: Vec<_> = outliers
        .chain(missing)
        .chain(block.moved(codec, field, frames))
        .filter_map(|(index, sample)| locate(index).map(|(voxel, f, t)| (voxel, f, t, sample)))
        .collect();
    targets.sort_unstable_by_key(|(voxel, f, _, _)| (*voxel, *f));
    subtract_series(block, codec, field, &targets)
}

/// Turns (voxel, frame of the plan, frame of the window, sample) into (voxel, frame of the plan, sample - decoded
/// value).
fn subtract_series(
    block: &Block,
    codec: &WindowCodec,
    field: &Field<'_>,
    targets: &[(usize, usize, usize, f64)],
) -> Vec<(usize, usize, f64)> {
    let mut out = Vec::new();
    for of_voxel in targets.chunk_by(|a, b| a.0 == b.0) {
        let series = block.series(codec, field, of_voxel[0].0);
        out.extend(of_voxel.iter().map(|(v, f, t, sample)| (*v, *f, sample - series[*t])).filter(|o| o.2 != 0.0));
    }
    out
}
