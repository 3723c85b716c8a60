//! About how many bytes a box of samples takes with a pyramid. No bytes are made, and few series compared.

use super::WindowCodec;
use super::encode::clear;
use super::load::Missing;
use super::pyramid::Passes;
use super::real::Real;
use super::refine::Source;
use super::weigh::Weighing;
use wavesplat_format::{Pyramid, estimate_cells};

/// A box of samples, and the nodes that pyramids refine: the same for all schemes with one transform along time.
pub(crate) struct Trial<'a, R> {
    size: [usize; 3],
    samples: &'a [u8],
    missing: Missing,
    weighing: Option<Weighing>,
    nodes: Vec<R>,
}

/// What trials reuse.
#[derive(Default)]
pub(crate) struct Scratch<R> {
    field: Vec<R>,
    codes: Vec<i32>,
}

impl<'a, R: Real> Trial<'a, R> {
    pub(crate) fn new(codec: &WindowCodec, size: [usize; 3], samples: &'a [u8]) -> Self {
        let missing = Missing::find(codec, samples);
        let weighing = Weighing::of(codec, samples, missing.magnitude);
        let mut nodes = Vec::new();
        if let Some(weighing) = &weighing {
            Source { codec, size, samples, missing: &missing }.load(weighing, &mut nodes);
        }
        Self { size, samples, missing, weighing, nodes }
    }

    /// Voxels of the box.
    pub(crate) fn voxels(&self) -> usize {
        self.size.iter().product()
    }

    /// About how many bytes the box takes; those of missing samples, which are always the same, are left out.
    pub(crate) fn bytes(&self, codec: &WindowCodec, pyramid: &Pyramid, scratch: &mut Scratch<R>) -> usize {
        self.coded(codec, pyramid, scratch).map_or(self.samples.len(), |bytes| bytes.min(self.samples.len()))
    }

    /// None if the box must be stored exactly.
    fn coded(
        &self,
        codec: &WindowCodec,
        pyramid: &Pyramid,
        Scratch { field, codes }: &mut Scratch<R>,
    ) -> Option<usize> {
        let source = Source { codec, size: self.size, samples: self.samples, missing: &self.missing };
        let weighing = self.weighing.as_ref()?;
        let step = source.step::<R>(pyramid, weighing)?;
        clear(field).extend_from_slice(&self.nodes);
        codes.resize(field.len(), 0);
        let passes = Passes::new(pyramid, codec.shape(self.size));
        if !passes.encode(step, field, codes) {
            return None;
        }
        let outliers = source.estimate_outliers(weighing, field);
        let parts = (0..).zip(codec.part_ranges(self.size));
        let packed: usize = parts.map(|(part, range)| estimate_cells(&codes[range], &passes.boxes(part))).sum();
        Some(packed + outliers * (GAP + codec.sample.size()))
    }
}

/// Bytes of the place of an outlier, and what packing its sample saves: about as many.
const GAP: usize = 1;
