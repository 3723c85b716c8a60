//! The reader stage: reads windows of all sources in turn, and sends their blocks.

use super::coded_input::CodedInput;
use super::gather::{NextBlock, WindowReader};
use super::warnings::Findings;
use super::{Plan, WindowJob, WindowsDone};
use crossbeam_channel::Sender;
use std::sync::Arc;
use std::time::{Duration, Instant};
use wavesplat_core::base::description::Description;
use wavesplat_core::base::error::{Error, Result};
use wavesplat_core::source::FrameSource;
use wavesplat_format::Window;

/// Reads windows of all sources in turn until their frames end, and sends those that the files do not have yet. Returns the
/// time spent reading each source, and what it found.
pub(super) fn read(mut readers: Vec<SourceReader<'_>>, out: &Sender<NextBlock>) -> Vec<Result<Reading>> {
    let is_over = |reader: &SourceReader<'_>| reader.ended.is_some();
    while let Some(next) =
        readers.iter_mut().filter(|reader| !is_over(reader)).min_by_key(|reader| reader.frames_read())
    {
        match next.read_window(out) {
            Ok(Next::Window) => {}
            Ok(Next::End) => next.end(Ok(())),
            Ok(Next::Unwanted) => break,
            Err(error) => next.end(Err(error)),
        }
    }
    readers.into_iter().map(SourceReader::finish).collect()
}

/// The result of reading a source.
pub(super) struct Reading {
    /// The time that it took.
    pub(super) busy: Duration,
    pub(super) findings: Findings,
    /// The source's description, which is complete when all frames were read.
    pub(super) description: Option<Description>,
}

/// What follows a window.
enum Next {
    Window,
    /// The frames ended.
    End,
    /// A later stage failed, and reports why.
    Unwanted,
}

/// Reads the source of one conversion.
pub(super) struct SourceReader<'a> {
    source: &'a mut dyn FrameSource,
    reader: WindowReader<'a>,
    done: WindowsDone,
    /// The number of the next window.
    index: usize,
    busy: Duration,
    ended: Option<Result<()>>,
}

impl<'a> SourceReader<'a> {
    pub(super) fn new(
        conversion: usize,
        source: &'a mut dyn FrameSource,
        input: &'a CodedInput,
        plan: &'a Plan<'a>,
        done: WindowsDone,
    ) -> Self {
        let mut reader = WindowReader::new(input, plan, &done);
        reader.conversion = conversion;
        done.windows[..done.first_window].iter().for_each(|window| reader.continue_after(window));
        reader.before = reader.frames;
        Self { source, reader, index: done.first_window, done, busy: Duration::ZERO, ended: None }
    }

    /// The blocks of tier 0 of the file; none if the number of frames is not known.
    pub(super) fn blocks(&self) -> Option<u64> {
        let WindowReader { archive, config, plan, .. } = &self.reader;
        let windows = archive.frames?.div_ceil(config.window) + self.done.first_window;
        Some((windows * plan.blocks_of_window()) as u64)
    }

    /// The blocks of tier 0 that the file has already.
    pub(super) fn blocks_done(&self) -> u64 {
        (self.done.windows.len() * self.reader.plan.blocks_of_window()) as u64
    }

    fn frames_read(&self) -> usize {
        self.reader.first()
    }

    fn end(&mut self, how: Result<()>) {
        self.ended = Some(how);
    }

    fn finish(self) -> Result<Reading> {
        let Self { source, reader, busy, ended, .. } = self;
        let description = source.archive().description.clone();
        ended.unwrap_or(Ok(())).map(|()| Reading { busy, findings: reader.findings, description })
    }

    /// An error unless the frames of a window that the file has have its times. Those of a run that goes on are not known before.
    fn check_times(&self, Window { first_frame, frames, .. }: &Window) -> Result<()> {
        let (first, frames) = (*first_frame as usize, *frames as usize);
        let known = self.done.times.get(first..first + frames).unwrap_or_default();
        let own = self.source.archive().times_of(self.reader.first()..self.reader.first() + frames);
        match own.iter().map(|time| time.to_bits()).eq(known.iter().map(|time| time.to_bits())) {
            true => Ok(()),
            false => Err(Error::path(&self.done.name, "was begun with other times")),
        }
    }

    /// Reads the next window, and sends its blocks unless the file has it.
    fn read_window(&mut self, out: &Sender<NextBlock>) -> Result<Next> {
        let (started, full) = (Instant::now(), self.reader.config.window);
        let known = self.done.windows.get(self.index);
        let Some(window) = self.reader.next(self.source, known.map_or(full, |known| known.frames as usize))? else {
            return if known.is_some() { Err(self.reader.ended(&self.done)) } else { Ok(Next::End) };
        };
        let index = self.index;
        self.index += 1;
        if let Some(known) = known {
            self.check_times(known)?;
            self.reader.skip_done(window.as_ref(), known, &self.done)?;
            self.busy += started.elapsed();
            return Ok(Next::Window);
        }
        let is_short = |window: &Window| (window.frames as usize) < full;
        if index > self.done.first_window && self.done.windows.get(index - 1).is_some_and(is_short) {
            return Err(self.reader.has_grown(&self.done));
        }
        let first = self.reader.first();
        let times = self.source.archive().times_of(first..first + window.frames());
        let job = Arc::new(WindowJob { times, ..self.reader.prepare(window.as_ref(), index)? });
        self.busy += started.elapsed();
        match self.reader.send_blocks(window.as_ref(), &job, out, &mut self.busy)? {
            true if window.frames() < full => Ok(Next::End),
            true => Ok(Next::Window),
            false => Ok(Next::Unwanted),
        }
    }
}
