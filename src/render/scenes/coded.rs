//! A block of a file that has been read, as what it adds to the planes of its plan.

use super::batch_plan::{BatchPlan, SplatSource};
use crate::base::error::Result;
use crate::codec::WindowCodec;
use crate::codec::buffer::Buffer;
use crate::codec::decode::Block;
use crate::codec::field::Field;
use crate::render::plane_values::{BlockPlanes, PlaneValues, Scratch};

/// A block of a file that has been read.
pub(super) struct CodedBlock<'a> {
    plan: &'a BatchPlan,
    block: Block,
    /// What its samples may be off by, for each error plane.
    errors: Vec<f64>,
    dense: Dense,
    /// What overrides coefficients, for each plane; empty if nothing does.
    few: Vec<Vec<(u32, f64)>>,
}

/// What most voxels add.
enum Dense {
    /// Samples to frames; here those of the whole window.
    Samples(Buffer<u8>),
    /// What coefficients give to frames: `frame of the plan * voxels + voxel`; empty if all are zero.
    Values(Vec<f64>),
    /// Coefficients, here what all codes give if that was needed at once.
    Coefficients(Option<Field<'static>>),
}

impl<'a> CodedBlock<'a> {
    /// Of a block of a plan whose samples may be off by so much.
    pub(super) fn new(plan: &'a BatchPlan, block: Block, errors: Vec<f64>) -> Self {
        let codec = &plan.codec;
        if block.exact.is_some() || plan.what == SplatSource::Samples {
            let dense = Dense::Samples(block.samples(codec));
            return Self { plan, block, errors, dense, few: Vec::new() };
        }
        let field = block.field_at_once(codec);
        let mut few = overrides(plan, &block, field.as_ref());
        let dense = match plan.by_values {
            true => Dense::Values(values(plan, &block, field.as_ref(), &mut few)),
            false => Dense::Coefficients(field),
        };
        Self { plan, block, errors, dense, few }
    }

    fn plane_of_samples<'r>(&self, samples: &[u8], plane: usize, room: &'r mut Scratch) -> PlaneValues<'r> {
        let Self { plan, block, .. } = self;
        let Some((frame, absent)) = plan.layout.samples(plane) else { return PlaneValues::Nothing };
        let bytes = samples.len() / plan.codec.frames();
        room.bytes.clear();
        room.bytes.extend_from_slice(&samples[plan.frames[frame] * bytes..][..bytes]);
        let first = plan.frames[frame] * block.voxels;
        // An exact block may do without a mask.
        let is_missing = |voxel: usize, v: f64| block.is_missing(first + voxel) || plan.codec.is_missing(v);
        match plan.layout.absent {
            true => room.masked(plan.codec.sample, absent, is_missing),
            false => room.samples(plan.codec.sample),
        }
    }

    /// The same error for all voxels but those that have no sample.
    fn plane_of_errors<'r>(&self, error: f64, room: &'r mut Scratch) -> PlaneValues<'r> {
        if error == 0.0 {
            return PlaneValues::Nothing;
        }
        let coded = !matches!(self.dense, Dense::Samples(_));
        let error = |voxel| if coded && misses_all(self.plan, &self.block, voxel) { 0.0 } else { error };
        room.double.clear();
        room.double.extend((0..self.block.voxels).map(error));
        PlaneValues::Double(&room.double)
    }
}

impl BlockPlanes for CodedBlock<'_> {
    fn voxels(&self) -> usize {
        self.block.voxels
    }

    fn plane<'a>(&'a self, plane: usize, room: &'a mut Scratch) -> Result<PlaneValues<'a>> {
        let Self { plan, block, errors, dense, few } = self;
        let voxels = block.voxels;
        if let Some(error) = plane.checked_sub(plan.layout.first_error()) {
            return Ok(self.plane_of_errors(errors[error], room));
        }
        let few =
            few.get(plane).filter(|few| !few.is_empty()).map_or(PlaneValues::Nothing, |few| PlaneValues::Few(few));
        Ok(match dense {
            Dense::Samples(samples) => self.plane_of_samples(samples, plane, room),
            Dense::Values(values) => values.get(plane * voxels..(plane + 1) * voxels).map_or(few, PlaneValues::Double),
            Dense::Coefficients(field) if plane < plan.layout.coefficients => {
                coefficients(plan, block, field.as_ref(), plan.kept[plane], room)
            }
            Dense::Coefficients(_) => few,
        })
    }

    fn held(&self) -> [u64; 2] {
        let coded = !matches!(self.dense, Dense::Samples(_));
        let coefficients = self.block.codes.iter().filter(|code| coded && **code != 0).count();
        [coefficients as u64, self.block.bytes_read]
    }
}

/// The coefficients of one k of a block.
fn coefficients<'a>(
    plan: &BatchPlan,
    block: &'a Block,
    field: Option<&'a Field<'_>>,
    k: usize,
    room: &'a mut Scratch,
) -> PlaneValues<'a> {
    match field {
        Some(field) => field.plane(k, block.voxels, &mut room.double).into(),
        None => block.plane(&plan.codec, k, (&mut room.single, &mut room.double)).into(),
    }
}

/// What coefficients give in each frame of a plan, and what overrides that, which is taken out of `few`.
fn values(plan: &BatchPlan, block: &Block, field: Option<&Field<'_>>, few: &mut [Vec<(u32, f64)>]) -> Vec<f64> {
    if block.codes.is_empty() && few.is_empty() {
        return Vec::new();
    }
    let mut values = vec![0.0; plan.frames.len() * block.voxels];
    let room = &mut Scratch::default();
    for k in &plan.kept {
        let amounts = coefficients(plan, block, field, *k, room);
        for (frame, values) in plan.frames.iter().zip(values.chunks_exact_mut(block.voxels)) {
            amounts.add_to(plan.codec.synthesis[*k][*frame], values);
        }
    }
    for (few, values) in few.iter_mut().zip(values.chunks_exact_mut(block.voxels)) {
        few.drain(..).for_each(|(voxel, amount)| values[voxel as usize] += amount);
    }
    values
}

/// What overrides the coefficients of a block, for each plane of a plan; empty if nothing does.
fn overrides(plan: &BatchPlan, block: &Block, field: Option<&Field<'_>>) -> Vec<Vec<(u32, f64)>> {
    let (layout, codec) = (&plan.layout, &plan.codec);
    if !block.overrides() {
        return Vec::new();
    }
    let mut few = vec![Vec::new(); layout.planes()];
    let whole = field.is_none().then(|| block.field(codec));
    let samples = field.or(whole.as_ref()).map(|field| overridden_samples(block, codec, field, &plan.frames));
    for (voxel, frame, amount) in samples.into_iter().flatten() {
        few[layout.value(frame)].push((voxel as u32, amount));
    }
    for voxel in (0..block.voxels).filter(|_| layout.absent) {
        let mut add = |plane: usize| few[plane].push((voxel as u32, 1.0));
        if misses_all(plan, block, voxel) {
            add(layout.absent_in_all());
        } else {
            let missing = |f: &usize| block.is_missing(plan.frames[*f] * block.voxels + voxel);
            (0..layout.frames).filter(missing).for_each(|f| add(layout.absent(f)));
        }
    }
    few
}

/// Whether a voxel has no sample, judged by the window and not by the plan, whose frames depend on the memory there is.
fn misses_all(plan: &BatchPlan, block: &Block, voxel: usize) -> bool {
    (0..plan.codec.frames()).all(|f| block.is_missing(f * block.voxels + voxel))
}

/// What must be added to single frames because coefficients don't give it: an outlier's sample less what they give,
/// and for a missing sample minus what they give. (voxel, frame of the plan, amount), ascending.
fn overridden_samples(
    block: &Block,
    codec: &WindowCodec,
    field: &Field<'_>,
    frames: &[usize],
) -> Vec<(usize, usize, f64)> {
    let mut wanted = vec![None; codec.frames()];
    frames.iter().enumerate().for_each(|(i, f)| wanted[*f] = Some(i));
    let place = |index: usize| wanted[index / block.voxels].map(|f| (index % block.voxels, f, index / block.voxels));
    let mut samples = vec![0.0; block.outliers.positions.len()];
    crate::base::sample::load(codec.sample, &block.outliers.samples, &mut samples);
    let outliers = block.outliers.positions.iter().map(|p| *p as usize).zip(samples);
    let missing = block.missing.0.iter().enumerate().filter(|(_, m)| **m).map(|(i, _)| (i, 0.0));
    let mut targets: Vec<_> = outliers
        .chain(missing)
        .filter_map(|(index, sample)| place(index).map(|(voxel, f, t)| (voxel, f, t, sample)))
        .collect();
    targets.sort_unstable_by_key(|(voxel, f, _, _)| (*voxel, *f));
    subtract_series(block, codec, field, &targets)
}

/// Turns (voxel, frame of the plan, frame of the window, sample) into (voxel, frame, sample - what the codes give).
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
