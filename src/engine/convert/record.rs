//! The writer stage: appends coded blocks to the file, and sums up each window.

use super::coded_blocks::CodedBlocks;
use super::coded_input::CodedInput;
use super::reading::Reading;
use super::warnings;
use super::workers::CodedBlock;
use super::{ConvertConfig, ConvertReport, Plan, ResumePoint, Target, WindowJob};
use crate::file::promise::range_of_shares;
use crate::file::report::{BoundReport, WindowReport};
use std::collections::HashMap;
use std::io::Write;
use std::iter::Peekable;
use std::path::Path;
use std::time::{Duration, Instant};
use wavesplat_core::base::description::{Description, extended, frames_of, joined, with_frames};
use wavesplat_core::base::error::{Error, Result};
use wavesplat_format::{BlockId, EncodedBlock, Metadata, Window, WindowEnd, WindowRecord, Writer};

pub(super) struct WindowWriter<'a, W: Write> {
    name: &'a Path,
    config: &'a ConvertConfig,
    plan: &'a Plan<'a>,
    /// The file's writer, created when the first window gives the file its id.
    writer: Option<Writer<W>>,
    out: Option<W>,
    descriptions: Descriptions,
    /// The current window.
    window: Option<OpenWindow>,
    frames_before: u64,
    busy: Duration,
}

/// A window whose blocks arrive in any order.
struct OpenWindow {
    /// The sums over the blocks that were appended.
    end: WindowEnd,
    /// The blocks to append, in order.
    next: Peekable<Box<dyn Iterator<Item = BlockId>>>,
    early: Early,
}

/// Blocks that arrived before their turn.
enum Early {
    /// Without tiers, few blocks wait: those that overtook another.
    Few(HashMap<BlockId, EncodedBlock>),
    /// With tiers, a layer of blocks waits for the one before: one list for even pairs of layers, one for odd ones. A list drops its bytes
    /// when it is empty.
    Layers([CodedBlocks; 2]),
}

impl Early {
    fn add(&mut self, plan: &Plan<'_>, block: EncodedBlock) -> Result<()> {
        match self {
            Self::Few(blocks) => {
                blocks.insert(block.id, block);
                Ok(())
            }
            Self::Layers(lists) => lists[plan.pair_of_layers(block.id) % 2].add(&block).map_err(CodedBlocks::failed),
        }
    }

    /// Removes and returns a block if it has arrived.
    fn take(&mut self, plan: &Plan<'_>, id: BlockId) -> Result<Option<EncodedBlock>> {
        match self {
            Self::Few(blocks) => Ok(blocks.remove(&id)),
            Self::Layers(lists) => lists[plan.pair_of_layers(id) % 2].take(id).map_err(CodedBlocks::failed),
        }
    }
}

impl OpenWindow {
    fn new(plan: &Plan<'_>, job: &WindowJob) -> Self {
        let tiers = job.codec.tiers();
        let next: Box<dyn Iterator<Item = BlockId>> = Box::new(plan.ids(job.index, tiers));
        let early = if tiers > 0 { Early::Layers(Default::default()) } else { Early::Few(HashMap::new()) };
        Self { end: WindowEnd::empty(job.index), next: next.peekable(), early }
    }

    /// Whether all its blocks were appended.
    fn is_complete(&mut self) -> bool {
        self.next.peek().is_none()
    }

    /// Takes a block that arrived. If it is its turn, appends it and the blocks that waited for it; else keeps it.
    fn add(
        &mut self,
        plan: &Plan<'_>,
        mut block: EncodedBlock,
        mut append: impl FnMut(&EncodedBlock) -> Result<()>,
    ) -> Result<()> {
        if self.next.peek() != Some(&block.id) {
            return self.early.add(plan, block);
        }
        loop {
            self.next.next();
            self.end.add(&block);
            append(&block)?;
            let Some(id) = self.next.peek().copied() else { return Ok(()) };
            let Some(early) = self.early.take(plan, id)? else { return Ok(()) };
            block = early;
        }
    }
}

/// The description of the frames already in the file.
struct Descriptions {
    before: Option<Description>,
    /// Whether the file has a description.
    is_told: bool,
}

impl Descriptions {
    fn new(resume_from: Option<&ResumePoint>) -> Self {
        let before = resume_from.and_then(|point| point.description.clone());
        Self { before, is_told: resume_from.is_none_or(|point| point.complete.features().described) }
    }

    /// The description of the whole file, from that of the added frames, and the names of the variables left out because some
    /// frames lack them.
    fn joined(&self, added: Option<Description>, frames: u64) -> (Option<Description>, Vec<String>) {
        let added = added.filter(|_| self.is_told);
        let Some(before) = self.before.clone() else { return (added, Vec::new()) };
        let before = with_frames(before, 1); // if there is no axis of frames, there is one
        let added = added.map(|added| joined(before.clone(), &[with_frames(added, 1)]));
        let is_whole =
            |(all, _): &(Description, _)| frames_of(all).is_some_and(|d| all.dimensions[d as usize].length == frames);
        let (all, not_kept) = added.filter(is_whole).unwrap_or_else(|| extended(before, frames));
        (Some(all), not_kept)
    }
}

impl<'a, W: Write> WindowWriter<'a, W> {
    pub(super) fn new(input: &'a CodedInput, plan: &'a Plan<'a>, target: Target<'a, W>) -> Self {
        let (config, Target { name, out, resume_from }) = (&input.config, target);
        let descriptions = Descriptions::new(resume_from.as_ref());
        let frames_before = resume_from.as_ref().map_or(0, |point| point.complete.metadata().frames);
        let (writer, out) = match resume_from {
            Some(point) => (Some(Writer::resume(out, point.complete)), None),
            None => (None, Some(out)),
        };
        Self { name, config, plan, writer, out, descriptions, window: None, frames_before, busy: Duration::ZERO }
    }

    /// Appends a block when it is its turn; after the last of a window, the window's end.
    pub(super) fn append(&mut self, CodedBlock { window: job, coded }: CodedBlock) -> Result<()> {
        let started = Instant::now();
        let failed = |source| Error::CoefficientFile { path: self.name.into(), source };
        if let Some(out) = self.out.take() {
            self.writer = Some(Writer::with_features(out, job.id, &self.plan.start, job.features).map_err(failed)?);
        }
        let writer = self.writer.as_mut().expect("created with the first block");
        if self.window.is_none() {
            writer.begin_window(window_record(&job)).map_err(failed)?;
        }
        let window = self.window.get_or_insert_with(|| OpenWindow::new(self.plan, &job));
        window.end.share = window.end.share.max(coded.share);
        window.add(self.plan, coded.block, |block| writer.append(block).map_err(failed))?;
        if let Some(window) = self.window.take_if(OpenWindow::is_complete) {
            writer.end_window(&window.end).map_err(failed)?;
            writer.out().flush().map_err(|e| Error::io(self.name, "writing", e))?;
        }
        self.busy += started.elapsed();
        Ok(())
    }

    /// Completes the file and returns the report.
    pub(super) fn finish(
        mut self,
        started: Instant,
        Reading { busy: read, findings, description }: Reading,
        encode: Duration,
    ) -> Result<ConvertReport> {
        let failed = |source| Error::CoefficientFile { path: self.name.into(), source };
        let Some(writer) = self.writer.take() else {
            return Err(Error::input(self.name, "nothing to convert: the input has no frames"));
        };
        let last = Instant::now();
        let metadata = writer.metadata().clone();
        let (description, not_kept) = self.descriptions.joined(description, metadata.frames);
        let (mut out, summary) = writer.finish_described(description.as_ref()).map_err(failed)?;
        out.flush().map_err(|e| Error::io(self.name, "writing", e))?;
        self.busy += last.elapsed();
        let report = self.report(&metadata, summary.bytes, [read, encode, self.busy, started.elapsed()]);
        let warnings = warnings::warnings(self.config, &report, &findings);
        Ok(ConvertReport { typical_variation: findings.variation.median(), warnings, not_kept, ..report })
    }

    fn report(&self, metadata: &Metadata, output_bytes: u64, seconds: [Duration; 4]) -> ConvertReport {
        let (Metadata { dims, frames, windows, .. }, range) = (metadata, range_of_shares(metadata));
        let voxels = dims.iter().product::<u64>();
        let (samples, voxels) = (voxels * frames, voxels * u64::from(metadata.channels));
        let of_source = self.plan.colour_transform.map_or(metadata.sample, |colour_transform| colour_transform.sample);
        let sum = |part: fn(&Window) -> u64| windows.iter().map(part).sum::<u64>();
        let largest = |part: fn(&Window) -> f64| windows.iter().map(part).fold(0.0, f64::max);
        let [read_seconds, encode_seconds, write_seconds, seconds] = seconds.map(|d| d.as_secs_f64());
        ConvertReport {
            results: None,
            frames: *frames,
            frames_before: self.frames_before,
            windows: windows.len(),
            samples,
            input_bytes: samples * of_source.size() as u64,
            output_bytes,
            coefficients: sum(|w| w.coded),
            coefficients_per_sample: sum(|w| w.coded) as f64 / samples as f64,
            outliers: sum(|w| w.outliers),
            missing: sum(|w| w.missing),
            promise: BoundReport::from_metadata(metadata),
            range,
            delta: largest(|w| w.delta),
            reached: largest(|w| w.reached),
            share: largest(|w| w.share),
            typical_variation: None,
            warnings: Vec::new(),
            per_window: windows.iter().map(|w| WindowReport::new(w, voxels)).collect(),
            read_seconds,
            encode_seconds,
            write_seconds,
            seconds,
            not_kept: Vec::new(),
        }
    }
}

/// The record that begins a window.
pub(super) fn window_record(job: &WindowJob) -> WindowRecord {
    let (scheme, WindowEnd { number, reached, share, squared_error, min, max, missing, coded, outliers }) =
        (&job.codec.scheme, WindowEnd::empty(job.index));
    let window = Window {
        first_frame: job.first_frame,
        frames: job.codec.frames() as u32,
        basis: scheme.basis,
        coefficients: job.codec.basis.coefficients() as u32,
        levels: job.codec.levels.iter().map(|r| r.len() as u32).collect(),
        functions: scheme.functions.clone(),
        pyramid: scheme.pyramid.clone(),
        coarseness: scheme.coarseness,
        range: job.range,
        digest: job.digest,
        delta: job.codec.bound.delta,
        reached,
        share,
        squared_error,
        min,
        max,
        missing,
        coded,
        outliers,
    };
    WindowRecord { number, window, times: job.times.clone() }
}
