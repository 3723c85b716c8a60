//! Renders a batch of frames from one view: reads layers of blocks front to back, and adds the slices between them.

use super::layer::Layers;
use super::needed::{Known, Need};
use super::probe::Probe;
use super::row::{Blend, LastMeans};
use super::stops::Stops;
use super::sweep::{Band, SweepScratch};
use super::view::{Slab, SlicedView};
use super::{GROUP, finish};
use crate::render::batches::{BlockSamples, SampleReader, Units};
use crate::render::report::{RenderReport, lap};
use rayon::prelude::*;
use wavesplat_core::base::error::Result;
use wavesplat_core::base::grid::{BlockGrid, Region};
use wavesplat_core::base::system::Instant;

/// A batch of frames, seen from one view.
pub(in crate::render) struct SlicePass<'a, B: Blend> {
    /// The number of the view.
    pub(in crate::render) number: usize,
    pub(in crate::render) view: &'a SlicedView,
    pub(in crate::render) blend: &'a B,
    /// Where rays end early, if any does.
    pub(in crate::render) stops: Option<&'a Stops>,
    pub(in crate::render) reader: &'a SampleReader<'a>,
}

/// A frame in work.
struct Frame<B: Blend> {
    units: Units,
    layers: Layers,
    groups: Vec<B::Group>,
    limits: Vec<f32>,
    /// The last means; none if every slab is one slice.
    last: Vec<LastMeans>,
}

impl<B: Blend> Frame<B> {
    fn new(view: &SlicedView, most: usize, units: Units, groups: Vec<B::Group>) -> Self {
        Self {
            units,
            layers: Layers::new(view, most),
            limits: vec![B::OPEN; groups.len()],
            last: vec![LastMeans::NONE; if view.has_parts() { groups.len() } else { 0 }],
            groups,
        }
    }
}

/// The number of groups of cells of a view.
fn groups(view: &SlicedView) -> usize {
    view.extent[0] / GROUP * view.extent[1] * view.cells * view.cells
}

/// The largest number of voxel layers at a time: those of a layer of blocks, and those before that slices still need.
fn most_layers(view: &SlicedView, blocks: BlockGrid) -> usize {
    (blocks.edges[view.shear.axes[2]] + 2 * (view.reach[2] + view.margin[2])).min(view.count[2])
}

/// Bytes of a batch of `frames` frames without decoded blocks.
pub(in crate::render) fn bytes<B: Blend>(
    view: &SlicedView,
    frames: usize,
    blocks: BlockGrid,
    is_shaded: bool,
) -> usize {
    let layers = Layers::bytes(view, most_layers(view, blocks));
    let last = if view.has_parts() { size_of::<LastMeans>() } else { 0 };
    let cells = groups(view) * (size_of::<B::Group>() + size_of::<f32>() + last);
    let picture = numbers::<B>(view) * size_of::<f32>();
    let sweep = rayon::current_num_threads() * SweepScratch::bytes(view, rows_of_band(view), is_shaded);
    frames * (layers + cells) + sweep.max(picture + finish::bytes::<B>(view)) + SLABS * Slab::bytes(view)
}

/// The numbers of a picture.
fn numbers<B: Blend>(view: &SlicedView) -> usize {
    view.camera.size.iter().product::<usize>() * B::NUMBERS
}

/// Rows of each band.
fn rows_of_band(view: &SlicedView) -> usize {
    let bands = rayon::current_num_threads().min(view.extent[1] / LEAST_ROWS).max(1);
    view.extent[1].div_ceil(bands)
}

impl<B: Blend> SlicePass<'_, B> {
    /// Sweeps the slices of all frames.
    pub(in crate::render) fn sweep(&self, report: &mut RenderReport) -> Result<Swept<B>> {
        let is_probed = report.views[self.number].probed.is_none() && self.stops.is_none();
        let probe = is_probed.then(|| Probe::new(self.view, self.blend));
        let empty = |_| vec![B::EMPTY; groups(self.view)];
        self.sweep_from((0..self.reader.batch.layout().frames).map(empty).collect(), probe, report)
    }

    /// The same from the given groups of each frame on.
    pub(super) fn sweep_from(
        &self,
        groups: Vec<Vec<B::Group>>,
        mut probe: Option<Probe<B>>,
        report: &mut RenderReport,
    ) -> Result<Swept<B>> {
        let SampleReader { batch, blocks, progress, .. } = *self.reader;
        let known = Known::new(self.view, blocks, batch.selection(), self.blend.reads_beside());
        let (units, most) = (self.units(&known)?, most_layers(self.view, blocks));
        let of_frame = |(units, groups): (&Units, _)| Frame::new(self.view, most, *units, groups);
        let mut frames: Vec<Frame<B>> = units.par_iter().zip(groups).map(of_frame).collect();
        let mut next = 0;
        for layer in self.layers() {
            let met = layer.iter().map(|at| self.view.met_at(*at) + 1).max().unwrap_or(0);
            let mut clock = Instant::now();
            frames.par_iter_mut().for_each(|frame| frame.layers.advance(self.view.first_needed(next), met));
            self.read(&known, layer, &mut frames, report)?;
            lap(&mut clock, &mut report.decode_seconds);
            let ready = self.view.ready(next, met);
            next = ready.end;
            for first in ready.clone().step_by(SLABS) {
                progress.check()?;
                let numbers = first..ready.end.min(first + SLABS);
                let slabs: Vec<Slab> = numbers.filter_map(|number| self.view.slab(number)).collect();
                frames.par_iter_mut().for_each(|frame| self.add(&slabs, frame));
            }
            if let (Some(probe), Some(frame)) = (&mut probe, frames.first()) {
                probe.add(self.blend, &frame.units, &frame.layers, met);
            }
            lap(&mut clock, &mut report.splat_seconds);
            progress.advance((ready.len() * self.view.parts() * units.len()) as u64);
        }
        progress.advance(((self.view.slab_count() - next) * self.view.parts() * units.len()) as u64);
        let swept = |frame: Frame<B>| SweptFrame { units: frame.units, groups: frame.groups };
        Ok(Swept { frames: frames.into_iter().map(swept).collect(), probe })
    }

    /// The first and the last voxel along a of each layer of blocks, in the order in which rays meet them.
    fn layers(&self) -> Vec<[usize; 2]> {
        let (axis, clip) = (self.view.shear.axes[2], &self.view.clip);
        let edge = self.reader.blocks.edges[axis];
        if self.view.extent.contains(&0) {
            return Vec::new();
        }
        let (first, last) = (clip.start[axis], clip.end[axis] - 1);
        let ends = |n: usize| [(n * edge).max(first), (n * edge + edge - 1).min(last)];
        let layers = first / edge..last / edge + 1;
        if self.view.is_reversed() { layers.rev().map(ends).collect() } else { layers.map(ends).collect() }
    }

    /// The units of each frame.
    fn units(&self, known: &Known<'_>) -> Result<Vec<Units>> {
        let frames = self.reader.batch.layout().frames;
        match known.middle() {
            Some(middle) => Ok(vec![self.blend.units(middle); frames]),
            None if B::CENTRED => self.middles(frames),
            None => Ok(vec![self.blend.units(0.0); frames]),
        }
    }

    /// Units around the middle of the first block of each frame that has any sample.
    fn middles(&self, frames: usize) -> Result<Vec<Units>> {
        let mut middles = vec![None; frames];
        for block in &self.reader.batch.selection().blocks {
            let all = self.reader.read_one(*block, &vec![Units { zero: 0.0, per: 1.0 / 16.0 }; frames])?;
            for (middle, samples) in middles.iter_mut().zip(all).filter(|(middle, _)| middle.is_none()) {
                let present = || samples.iter().copied().filter(|sample| !sample.is_nan());
                let ends = [present().fold(f32::INFINITY, f32::min), present().fold(f32::NEG_INFINITY, f32::max)];
                *middle = (ends[0] <= ends[1]).then(|| 16.0 * (f64::from(ends[0]) + f64::from(ends[1])) / 2.0);
            }
            if middles.iter().all(Option::is_some) {
                break;
            }
        }
        Ok(middles.into_iter().map(|middle| self.blend.units(middle.unwrap_or(0.0))).collect())
    }

    /// Reads the blocks of a layer that are needed, and fills the others with one value.
    fn read(
        &self,
        known: &Known<'_>,
        [first, last]: [usize; 2],
        frames: &mut [Frame<B>],
        report: &mut RenderReport,
    ) -> Result<()> {
        let (view, axis, blocks) = (self.view, self.view.shear.axes[2], self.reader.blocks);
        let units: Vec<Units> = frames.iter().map(|frame| frame.units).collect();
        let mut region = view.clip;
        (region.start[axis], region.end[axis]) = (first, last + 1);
        let limits: Vec<&[f32]> = frames.iter().map(|frame| frame.limits.as_slice()).collect();
        let need = |block: usize| (block, known.need(self.blend, &units[0], &limits, block));
        let needs: Vec<(usize, Need)> = blocks.touching(&region).map(need).collect();
        let hidden: Vec<Vec<(Region, f64)>> = limits.iter().map(|limits| known.hidden::<B>(limits, &needs)).collect();
        let (read, others): (Vec<_>, Vec<_>) = needs.into_iter().partition(|(_, need)| *need == Need::Read);
        for (block, need) in others {
            let region = blocks.region(block);
            match need {
                Need::Read => {}
                Need::Missing | Need::Fill(_) => report.blocks_transparent += 1,
                Need::Hidden(_) => report.blocks_hidden += 1,
            }
            let fill = |units: &Units| match need {
                Need::Fill(value) | Need::Hidden(value) => units.number(value),
                Need::Read | Need::Missing => f32::NAN,
            };
            frames.par_iter_mut().for_each(|frame| frame.layers.fill(view, &region, fill(&frame.units)));
        }
        let mut read: Vec<usize> = read.into_iter().map(|(block, _)| block).collect();
        blocks.sort_nested(&mut read); // so blocks that share those above follow each other
        let stats = self.reader.read(&read, &units, |read: &[BlockSamples]| {
            frames.par_iter_mut().enumerate().for_each(|(n, frame)| {
                read.iter().for_each(|(region, samples)| frame.layers.put(view, region, &samples[n]));
            });
        })?;
        report.count_read(&stats);
        frames.par_iter_mut().zip(hidden).for_each(|(frame, hidden)| {
            let Frame { units, layers, .. } = frame;
            hidden.iter().for_each(|(region, value)| layers.fill(view, region, units.number(*value)));
            layers.seal(view.count[0]);
        });
        Ok(())
    }

    /// Adds slabs to all cells of a frame, in bands of rows.
    fn add(&self, slabs: &[Slab], frame: &mut Frame<B>) {
        let view = self.view;
        let (rows, of_row) = (rows_of_band(view), view.cells * view.cells * view.extent[0] / GROUP);
        let size = rows * of_row;
        let mut last: Vec<&mut [LastMeans]> = frame.last.chunks_mut(size).collect();
        // None for any band if every slab is one slice.
        last.resize_with(frame.groups.len().div_ceil(size), Default::default);
        let chunks = frame.groups.par_chunks_mut(size).zip(frame.limits.par_chunks_mut(size));
        chunks.zip(last).enumerate().for_each(|(n, ((groups, limits), last))| {
            let scratch = SweepScratch::new(view, rows, self.blend.is_shaded());
            let rows = n * rows..((n + 1) * rows).min(view.extent[1]);
            let first = n * size;
            let stops = self.stops.map_or(&[][..], |stops| stops.groups(first..first + groups.len()));
            let mut band = Band { view, blend: self.blend, rows, groups, limits, last, stops, scratch };
            slabs.iter().for_each(|slab| band.add(slab, &frame.layers));
        });
    }
}

/// The frames of a batch after all slices, and the rays that probe the first of them.
pub(in crate::render) struct Swept<B: Blend> {
    frames: Vec<SweptFrame<B>>,
    probe: Option<Probe<B>>,
}

struct SweptFrame<B: Blend> {
    units: Units,
    groups: Vec<B::Group>,
}

impl<B: Blend> Swept<B> {
    /// The groups of each frame.
    pub(super) fn groups(&self) -> impl Iterator<Item = &[B::Group]> {
        self.frames.iter().map(|frame| frame.groups.as_slice())
    }

    /// Gives the pictures of view `number` one after another, with their places in the batch.
    pub(in crate::render) fn pictures(
        self,
        view: &SlicedView,
        number: usize,
        report: &mut RenderReport,
        mut give: impl FnMut(usize, &mut [f32]) -> Result<()>,
    ) -> Result<()> {
        let (mut probe, mut picture) = (self.probe, vec![0.0; numbers::<B>(view)]);
        for (n, SweptFrame { units, groups }) in self.frames.into_iter().enumerate() {
            let mut clock = Instant::now();
            finish::finish::<B>(view, &units, &groups, &mut picture);
            if let Some(probe) = probe.take() {
                report.views[number].probed = probe.errors(&picture);
            }
            lap(&mut clock, &mut report.inverse_seconds);
            give(n, &mut picture)?;
        }
        Ok(())
    }
}

/// Slabs that are weighed at a time.
const SLABS: usize = 32;

/// The least rows of a band: the rows at its edges are filtered for both bands.
const LEAST_ROWS: usize = 32;
