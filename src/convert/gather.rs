//! The reader's stage: windows of frames in, batches of blocks out.

use super::choose::{Chooser, most_samples};
use super::sampled::{self, Pixel};
use super::{ConvertConfig, Idle, MissingPolicy, Plan, WindowJob};
use crate::bound::{self, Bound, Promise};
use crate::codec::WindowCodec;
use crate::codec::scheme::Scheme;
use crate::error::{Error, Result};
use crate::sample;
use crate::scan::{Scan, join_ranges, scan};
use crate::source::{Archive, FrameSource, FrameWindow, read_frames_into};
use crate::volume::Grid;
use crossbeam::channel::Sender;
use std::sync::Arc;
use std::time::{Duration, Instant};
use wavesplat_format::{BlockId, FileId};
use xxhash_rust::xxh3::xxh3_128;

/// Some blocks of one window: their samples, frame by frame.
#[derive(Debug)]
pub(super) struct Batch {
    pub(super) window: Arc<WindowJob>,
    pub(super) blocks: Vec<(BlockId, Vec<u8>)>,
}

/// Reads all windows in order until the frames end. Returns the time spent reading.
pub(super) fn read(
    source: &mut dyn FrameSource,
    config: &ConvertConfig,
    plan: &Plan,
    idle: &Idle<Vec<u8>>,
    out: &Sender<Batch>,
) -> Result<Duration> {
    let archive = source.archive().clone();
    let pixels = match config.bound {
        Bound::Sampled { samples, seed } => sampled::pixels(archive.grid.dims, samples, seed),
        _ => Vec::new(),
    };
    let mut reader = WindowReader { config, plan, idle, archive, pixels, range: None, id: None, scheme: None };
    let mut busy = Duration::ZERO;
    for index in 0.. {
        let started = Instant::now();
        let first = index * config.window;
        let count = reader.archive.frames.map_or(config.window, |all| config.window.min(all.saturating_sub(first)));
        if count == 0 {
            break;
        }
        let window = source.window(first, count)?;
        if window.frames() == 0 {
            break;
        }
        let job = Arc::new(reader.prepare(window.as_ref(), index, first)?);
        busy += started.elapsed();
        if !reader.send_blocks(window.as_ref(), &job, out, &mut busy)? {
            break; // a later stage failed and says why
        }
        window.check_unchanged()?;
        if window.frames() < config.window {
            break;
        }
    }
    Ok(busy)
}

struct WindowReader<'a> {
    config: &'a ConvertConfig,
    plan: &'a Plan,
    /// Room for the samples of blocks.
    idle: &'a Idle<Vec<u8>>,
    archive: Archive,
    /// Where a sampled bound looks.
    pixels: Vec<Pixel>,
    /// Range of the frames so far.
    range: Option<(f64, f64)>,
    id: Option<FileId>,
    /// Of the window before.
    scheme: Option<Scheme>,
}

impl WindowReader<'_> {
    /// Looks at the window's samples and fixes its bound.
    fn prepare(&mut self, window: &dyn FrameWindow, index: usize, first: usize) -> Result<WindowJob> {
        let (config, ty) = (self.config, self.archive.sample);
        let seen = scan(window, &self.archive.grid, ty, config.missing_value)?;
        self.refuse_missing(window, first, &seen)?;
        let range = self.range.map_or(seen.range, |r| join_ranges(r, seen.range));
        self.range = Some(range);
        let delta = self.delta(window, seen.range, config.range.unwrap_or(range))?;
        let promise = Promise { bound: config.bound, tolerance: config.tolerance, delta };
        let magnitude = sample::magnitude(seen.range);
        let before = self.scheme.as_ref().filter(|scheme| !index.is_multiple_of(ANEW) && scheme.pyramid.is_some());
        let most = most_samples(self.plan.blocks.region(0).voxels() * window.frames());
        let scheme = Chooser { config, archive: &self.archive, window, promise, magnitude, most, before }.choose()?;
        self.scheme = Some(scheme.clone());
        let mut codec = WindowCodec::new(scheme, window.frames(), ty, promise, self.plan.blocks.edge);
        codec.missing_value = config.missing_value;
        let id = *self.id.get_or_insert_with(|| file_id(config, &self.archive, self.plan, seen.digest));
        let index = u32::try_from(index).map_err(|_| Error::usage("too many windows: choose a longer --window"))?;
        Ok(WindowJob { index, first_frame: first as u64, id, codec, range })
    }

    /// The window's bound; its samples are in the range `seen`, and all up to its end in `range`.
    fn delta(&self, window: &dyn FrameWindow, seen: (f64, f64), range: (f64, f64)) -> Result<f64> {
        let ConvertConfig { tolerance, missing_value, .. } = *self.config;
        let magnitude = sample::magnitude(seen);
        match self.config.bound {
            Bound::Pointwise | Bound::Rms => Ok(bound::range_bound(tolerance, range)),
            Bound::Relative { floor } => Ok(bound::relative_bound(tolerance, floor, magnitude)),
            Bound::Sampled { .. } => {
                let Archive { ref grid, sample, .. } = self.archive;
                sampled::View { window, grid, sample, missing_value, magnitude }.bound(tolerance, &self.pixels)
            }
        }
    }

    fn refuse_missing(&self, window: &dyn FrameWindow, first: usize, seen: &Scan) -> Result<()> {
        let (MissingPolicy::Error, Some((frame, voxel))) = (self.config.missing, seen.first_missing) else {
            return Ok(());
        };
        let [x, y, z] = self.archive.grid.whole().voxel(voxel);
        Err(Error::input(
            window.name(frame),
            format!(
                "frame {} has a missing value (NaN, infinite or as declared) at x {x}, y {y}, z {z}, the first of {} in \
                 frames {first}..{}; --missing mask keeps them as they are",
                first + frame,
                seen.missing,
                first + window.frames()
            ),
        ))
    }

    /// Gathers and sends the window's blocks. False if nobody listens any more.
    fn send_blocks(
        &self,
        window: &dyn FrameWindow,
        job: &Arc<WindowJob>,
        out: &Sender<Batch>,
        busy: &mut Duration,
    ) -> Result<bool> {
        let (all, batch) = (self.plan.blocks.len(), self.plan.batch);
        for first in (0..all).step_by(batch) {
            let started = Instant::now();
            let blocks: Result<_> = (first..all.min(first + batch)).map(|b| self.gather(window, job, b)).collect();
            let batch = Batch { window: job.clone(), blocks: blocks? };
            *busy += started.elapsed();
            if out.send(batch).is_err() {
                return Ok(false);
            }
        }
        Ok(true)
    }

    /// The samples of one block, frame by frame.
    fn gather(&self, window: &dyn FrameWindow, job: &WindowJob, block: usize) -> Result<(BlockId, Vec<u8>)> {
        let region = self.plan.blocks.region(block);
        let mut samples = self.idle.take().unwrap_or_default();
        read_frames_into(window, 0..window.frames(), &region, self.archive.sample, &mut samples)?;
        Ok((BlockId { window: job.index, block: block as u32, channel: 0 }, samples))
    }
}

/// Every so many windows a scheme is chosen anew; the others begin with that of the window before.
const ANEW: usize = 8;

/// A name for the file that follows from settings and data: the same conversion has the same one everywhere.
fn file_id(config: &ConvertConfig, archive: &Archive, plan: &Plan, digest: u64) -> FileId {
    let Grid { dims, spacing, origin } = archive.grid;
    let ConvertConfig { coding, window, tolerance, bound, range, missing, missing_value, level, settings, .. } = config;
    let bound: &Bound = bound;
    let all = format!(
        "{dims:?} {spacing:?} {origin:?} {} {coding:?} {window} {tolerance:?} {bound:?} {range:?} {missing:?} \
         {missing_value:?} {} {level} {settings:?} {digest}",
        archive.sample, plan.blocks.edge
    );
    FileId(xxh3_128(all.as_bytes()).to_le_bytes())
}
