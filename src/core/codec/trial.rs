//! Estimates the bytes of a box of samples coded by a pyramid, without packing codes and with few series compared.

use super::WindowCodec;
use super::block_with_ghosts::{BlockWithGhosts, SampleBytes};
use super::box_samples::BoxSamples;
use super::buffer::Buffer;
use super::encode::listed;
use super::error_weights::QuantizerSetup;
use super::load::{Missing, Source};
use super::pyramid::Nodes;
use super::real::Real;
use wavesplat_format::Pyramid;

/// A box of samples, and its nodes for pyramids. All schemes with the same transform along time share them.
pub struct Trial<'a, R: Real> {
    size: [usize; 3],
    /// The samples of the voxels of all nodes.
    samples: SampleBytes<'a>,
    missing: Missing,
    weighing: Option<QuantizerSetup>,
    /// The nodes of the box, and the nodes beyond it that may predict them: `[k][voxel]`.
    nodes: Buffer<R>,
    /// An upper bound of the magnitudes of each k.
    largest: Vec<R>,
    /// The voxels of these nodes along x, y, z.
    outer: [usize; 3],
}

impl<'a, R: Real> Trial<'a, R> {
    /// Pyramids may use the nodes of `outer` voxels.
    pub fn new(codec: &WindowCodec, of: BlockWithGhosts, outer: [usize; 3], samples: &'a [u8]) -> Self {
        let (size, samples) = (of.size, of.extended(codec, outer, SampleBytes::Lent(samples)));
        let around = Missing::find(codec, &samples);
        let own = BoxSamples::new(codec.sample, &samples, outer, size);
        let missing = Missing::within(codec, &own, &around);
        let weighing = QuantizerSetup::new(codec, &own, missing.magnitude);
        let extended = BoxSamples::whole(codec.sample, &samples, outer);
        let extended = Source { codec, samples: extended, missing: &around };
        let mut nodes = Buffer::with_len(codec.basis.coefficients() * extended.voxels());
        let largest = weighing.as_ref().map(|weighing| extended.load(weighing, &mut nodes)).unwrap_or_default();
        Self { size, samples, missing, weighing, nodes, largest, outer }
    }

    /// The samples of the box.
    fn own(&self, codec: &WindowCodec) -> BoxSamples<'_> {
        BoxSamples::new(codec.sample, &self.samples, self.outer, self.size)
    }

    /// The number of voxels in the box.
    pub fn voxels(&self) -> usize {
        self.size.iter().product()
    }

    /// An estimate of the bytes of the box. Missing samples are left out, because they take the same bytes under every
    /// scheme.
    pub fn bytes(&self, codec: &WindowCodec, pyramid: &Pyramid) -> usize {
        self.coded(codec, pyramid).unwrap_or_else(|| self.all_bytes(codec))
    }

    /// The bytes of the box's samples.
    fn all_bytes(&self, codec: &WindowCodec) -> usize {
        self.own(codec).len() * codec.sample.size()
    }

    /// About the bytes of the box by its list of values; none if it may not be listed, or if that takes no less than `bytes`.
    pub fn listed_bytes(&self, codec: &WindowCodec, bytes: usize) -> Option<usize> {
        let listed = listed(codec, &self.own(codec), bytes)?;
        Some(listed.estimate(&mut Vec::new())).filter(|listed| *listed < bytes)
    }

    /// As [`Self::bytes`]; none if the box must be stored exactly.
    fn coded(&self, codec: &WindowCodec, pyramid: &Pyramid) -> Option<usize> {
        let source = Source { codec, samples: self.own(codec), missing: &self.missing };
        let weighing = self.weighing.as_ref()?;
        let step = source.step::<R>(pyramid, weighing)?;
        let passes = codec.passes(pyramid, self.size);
        let mut field = Buffer::with_len(passes.nodes().iter().product());
        let mut codes = Buffer::with_len(passes.codes());
        let marked = passes.may_have_codes(step, &self.largest);
        let nodes = Nodes { values: &self.nodes[..], size: self.outer, marked: Some(&marked) };
        if !passes.encode(step, nodes, None, &mut field, &mut codes) {
            return None;
        }
        let outliers = source.estimate_outliers(weighing, &field, &passes.marked_codes::<R>(&codes, None));
        let packed = |part| pyramid.packing.estimate(&passes.part_of(part, &codes));
        let packed: usize = (0..Pyramid::PARTS).map(packed).sum();
        // With too many outliers, all is stored exactly; the count still shows how near a better step is.
        let rest = if source.outliers_affordable(outliers) { packed } else { self.all_bytes(codec) };
        Some(rest + outliers * (GAP + codec.sample.size()))
    }
}

/// Bytes for the position of an outlier, less the bytes that packing its sample saves.
const GAP: usize = 1;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::sample::{self, SampleType};
    use crate::codec::bound::{Bound, ErrorBound};
    use crate::codec::encode::Encoder;
    use crate::codec::scheme::{Axis, Basis, Scheme, Stencil};
    use wavesplat_format::{BlockId, Packing};

    const SIZE: [usize; 3] = [20, 18, 16];
    const FRAMES: usize = 16;

    /// Waves with a little noise.
    fn samples() -> Vec<u8> {
        let noise = |i: usize| f64::from((i as u32).wrapping_mul(0x9E37_79B1) >> 16) / 65536.0 - 0.5;
        let voxels: usize = SIZE.iter().product();
        let value = |i: usize| ((i % 20) as f64 / 5.0 + (i / voxels) as f64 / 9.0).sin() + 0.02 * noise(i);
        let values: Vec<f64> = (0..voxels * FRAMES).map(value).collect();
        let mut bytes = vec![0; 4 * values.len()];
        sample::store(SampleType::F32, &values, &mut bytes);
        bytes
    }

    #[test]
    fn estimates_are_close_to_what_is_stored() {
        let (samples, xyzt) = (samples(), [Axis::X, Axis::Y, Axis::Z, Axis::T]);
        let bound = ErrorBound::new(Bound::Pointwise, 0.01, 0.01);
        for (basis, coarseness, order) in [(Basis::Haar, 1.5, &xyzt[..3]), (Basis::Samples, 1.0, &xyzt[..])] {
            let (order, stencil) = (order.to_vec(), Stencil::Cubic);
            let pyramid = Pyramid {
                order,
                stencil,
                growth: 1.5,
                most: 3.0,
                single: true,
                packing: Packing::Nested,
                ghosts: true,
                tiers: 0,
            };
            let scheme = Scheme { pyramid: Some(pyramid.clone()), coarseness, ..Scheme::along_time(basis) };
            let codec = WindowCodec::new(scheme, FRAMES, SampleType::F32, bound, 32);
            let mut encoder = Encoder::new(3).expect("a usual level");
            let id = BlockId::new(0, 0, 0);
            let encoded = encoder.block(&codec, id, SIZE, samples[..].into(), None).expect("a small block");
            let stored: usize = encoded.block.parts.iter().map(|part| part.stored.len()).sum();
            let trial = Trial::<f32>::new(&codec, SIZE.into(), codec.outer_size(SIZE), &samples);
            let estimate = trial.bytes(&codec, &pyramid);
            assert!(estimate.abs_diff(stored) * 20 < stored, "{basis:?}: {estimate} for {stored}");
        }
    }
}
