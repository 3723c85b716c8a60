//! The writer's stage: coded blocks into the file, and the metadata that the run adds up to.

use super::{ConvertConfig, ConvertReport, EncodedBatch, Plan, WindowJob};
use crate::error::{Error, Result};
use crate::progress::Progress;
use crate::report::{PromiseReport, WindowReport};
use crate::scan::join_ranges;
use crate::source::Archive;
use crossbeam::channel::Receiver;
use std::io::Write;
use std::path::Path;
use std::time::{Duration, Instant};
use wavesplat_format::{BlockStats, Metadata, Window, Writer};

pub(super) struct Recorder<'a, W: Write> {
    name: &'a Path,
    config: &'a ConvertConfig,
    metadata: Metadata,
    sample_size: u64,
    /// The file's writer; made when the first window gives the file its id.
    writer: Option<Writer<W>>,
    out: Option<W>,
    busy: Duration,
}

impl<'a, W: Write> Recorder<'a, W> {
    pub(super) fn new(config: &'a ConvertConfig, archive: &Archive, plan: &Plan, name: &'a Path, out: W) -> Self {
        let metadata = Metadata {
            dims: archive.grid.dims.map(|n| n as u64),
            spacing: archive.grid.spacing,
            origin: archive.grid.origin,
            sample: archive.sample,
            block_edge: plan.blocks.edge as u32,
            channels: 1,
            frames: 0,
            times: archive.times.clone(),
            variable: archive.variable.clone(),
            bound: config.bound,
            tolerance: config.tolerance,
            range: config.range.unwrap_or((f64::INFINITY, f64::NEG_INFINITY)),
            missing_value: config.missing_value,
            windows: Vec::new(),
            settings: config.settings.clone(),
            program: format!("wavesplat {}", env!("CARGO_PKG_VERSION")),
        };
        let sample_size = archive.sample.size() as u64;
        Self { name, config, metadata, sample_size, writer: None, out: Some(out), busy: Duration::ZERO }
    }

    /// Appends batches as they come until the workers end.
    pub(super) fn write(&mut self, batches: Receiver<EncodedBatch>, progress: &dyn Progress) -> Result<()> {
        for batch in batches {
            let started = Instant::now();
            self.append(&batch)?;
            progress.advance(batch.blocks.len() as u64);
            self.busy += started.elapsed();
        }
        Ok(())
    }

    fn append(&mut self, batch: &EncodedBatch) -> Result<()> {
        let failed = |source| Error::CoefficientFile { path: self.name.into(), source };
        if let Some(out) = self.out.take() {
            self.writer = Some(Writer::new(out, batch.window.id).map_err(failed)?);
        }
        let new = self.metadata.windows.len() <= batch.window.index as usize;
        if new {
            self.metadata.windows.push(window_record(&batch.window));
        }
        let window = self.metadata.windows.last_mut().expect("a window was just there");
        let writer = self.writer.as_mut().expect("made with the first batch");
        for encoded in &batch.blocks {
            add_stats(window, &encoded.block.stats);
            window.share = window.share.max(encoded.share);
            window.coded += encoded.coded;
            window.outliers += encoded.outliers;
            window.missing += encoded.missing;
            writer.append(&encoded.block).map_err(failed)?;
        }
        if new {
            self.metadata.frames += u64::from(window.frames);
            if self.config.range.is_none() && batch.window.range.0 <= batch.window.range.1 {
                self.metadata.range = batch.window.range;
            }
        }
        Ok(())
    }

    /// Ends the file and says what was done.
    pub(super) fn finish(mut self, started: Instant, read: Duration, encode: Duration) -> Result<ConvertReport> {
        let failed = |source| Error::CoefficientFile { path: self.name.into(), source };
        let Some(writer) = self.writer.take() else {
            return Err(Error::input(self.name, "nothing to convert: the input has no frames"));
        };
        self.metadata.times.truncate(self.metadata.frames as usize);
        let last = Instant::now();
        let (mut out, summary) = writer.finish(&self.metadata).map_err(failed)?;
        out.flush().map_err(|e| Error::io(self.name, "writing", e))?;
        self.busy += last.elapsed();
        Ok(self.report(summary.bytes, [read, encode, self.busy, started.elapsed()]))
    }

    fn report(&self, output_bytes: u64, seconds: [Duration; 4]) -> ConvertReport {
        let Metadata { dims, frames, windows, range, .. } = &self.metadata;
        let voxels = dims.iter().product::<u64>();
        let samples = voxels * frames;
        let sum = |part: fn(&Window) -> u64| windows.iter().map(part).sum::<u64>();
        let largest = |part: fn(&Window) -> f64| windows.iter().map(part).fold(0.0, f64::max);
        let [read_seconds, encode_seconds, write_seconds, seconds] = seconds.map(|d| d.as_secs_f64());
        ConvertReport {
            frames: *frames,
            windows: windows.len(),
            input_bytes: samples * self.sample_size,
            output_bytes,
            coefficients: sum(|w| w.coded),
            coefficients_per_sample: sum(|w| w.coded) as f64 / samples as f64,
            outliers: sum(|w| w.outliers),
            missing: sum(|w| w.missing),
            promise: PromiseReport::new(self.config.bound, self.config.tolerance, *range),
            range: *range,
            delta: largest(|w| w.delta),
            reached: largest(|w| w.reached),
            share: largest(|w| w.share),
            per_window: windows.iter().map(|w| WindowReport::new(w, voxels)).collect(),
            read_seconds,
            encode_seconds,
            write_seconds,
            seconds,
        }
    }
}

fn window_record(job: &WindowJob) -> Window {
    Window {
        first_frame: job.first_frame,
        frames: job.codec.frames() as u32,
        basis: job.codec.scheme.basis,
        coefficients: job.codec.basis.coefficients() as u32,
        levels: job.codec.levels.iter().map(|r| r.len() as u32).collect(),
        functions: job.codec.scheme.functions.clone(),
        pyramid: job.codec.scheme.pyramid.clone(),
        delta: job.codec.promise.delta,
        reached: 0.0,
        share: 0.0,
        squared_error: 0.0,
        min: f64::INFINITY,
        max: f64::NEG_INFINITY,
        missing: 0,
        coded: 0,
        outliers: 0,
    }
}

fn add_stats(window: &mut Window, block: &BlockStats) {
    window.reached = window.reached.max(block.reached);
    window.squared_error += block.squared_error;
    (window.min, window.max) = join_ranges((window.min, window.max), (block.min, block.max));
}
