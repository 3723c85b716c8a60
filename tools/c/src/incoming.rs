//! Frames on their way from the caller to a conversion: as a stream of bytes, or by windows in memory.

use crate::frames::Frames;
use std::io::{self, Read};
use std::ops::{Deref, DerefMut};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, Sender, SyncSender, channel, sync_channel};
use wavesplat::base::zeroed::Zeroed;
use wavesplat::source::{Archive, FrameSource, FrameWindow, copy_box};
use wavesplat::{Error, Grid, Region, Result};

/// Frames that wait: while one is taken, the next one is copied.
const WAITING: usize = 1;

/// The samples of a frame, at an address that suits every type of samples.
#[derive(Default)]
pub(crate) struct FrameMemory {
    numbers: Zeroed<u64>,
    bytes: usize,
}

impl FrameMemory {
    /// Memory for a frame of so many bytes; none if the system has none.
    fn new(bytes: usize) -> Option<Self> {
        Some(Self { numbers: Zeroed::try_in_small_pages(bytes.div_ceil(size_of::<u64>()))?, bytes })
    }
}

impl Deref for FrameMemory {
    type Target = [u8];

    fn deref(&self) -> &[u8] {
        &self.numbers.bytes()[..self.bytes]
    }
}

impl DerefMut for FrameMemory {
    fn deref_mut(&mut self) -> &mut [u8] {
        &mut self.numbers.bytes_mut()[..self.bytes]
    }
}

/// The end of the caller.
pub(crate) struct Outgoing {
    frames: SyncSender<FrameMemory>,
    times: Sender<f64>,
    spare: Receiver<FrameMemory>,
    is_abandoned: Arc<AtomicBool>,
}

/// The end of the conversion.
pub(crate) struct Incoming {
    frames: Receiver<FrameMemory>,
    spare: Sender<FrameMemory>,
    is_abandoned: Arc<AtomicBool>,
    current: FrameMemory,
    at: usize,
}

/// Both ends. The times of frames come beside them.
pub(crate) fn stream() -> (Outgoing, Incoming, Receiver<f64>) {
    let ((to_conversion, frames), (back, spare)) = (sync_channel(WAITING), channel());
    let (times, times_of_frames) = channel();
    let is_abandoned = Arc::<AtomicBool>::default();
    let current = FrameMemory::default();
    let incoming = Incoming { frames, spare: back, is_abandoned: is_abandoned.clone(), current, at: 0 };
    (Outgoing { frames: to_conversion, times, spare, is_abandoned }, incoming, times_of_frames)
}

impl Outgoing {
    /// Memory for a frame: that of an earlier one, if there is one. An error if the system has none.
    pub(crate) fn room(&self, bytes: usize) -> io::Result<FrameMemory> {
        let spare = self.spare.try_iter().find(|spare| spare.len() == bytes);
        spare.or_else(|| FrameMemory::new(bytes)).ok_or_else(|| io::ErrorKind::OutOfMemory.into())
    }

    /// Waits until the conversion can take a frame. Says whether it still does.
    pub(crate) fn send(&self, frame: FrameMemory, time: Option<f64>) -> bool {
        let is_timed = time.is_none_or(|time| self.times.send(time).is_ok()); // it comes before the frame
        is_timed && self.frames.send(frame).is_ok()
    }

    /// Ends the stream by an error.
    pub(crate) fn abandon(self) {
        self.is_abandoned.store(true, Ordering::SeqCst);
    }
}

impl Incoming {
    /// The next frame; none after the last one.
    fn next(&self) -> io::Result<Option<FrameMemory>> {
        match self.frames.recv() {
            Ok(frame) => Ok(Some(frame)),
            Err(_) if self.is_abandoned.load(Ordering::SeqCst) => Err(io::Error::other("was abandoned")),
            Err(_) => Ok(None),
        }
    }
}

impl Read for Incoming {
    fn read(&mut self, out: &mut [u8]) -> io::Result<usize> {
        if self.at == self.current.len() {
            let _ = self.spare.send(std::mem::take(&mut self.current)); // the caller's end may be gone
            self.at = 0;
            self.current = self.next()?.unwrap_or_default();
        }
        let count = out.len().min(self.current.len() - self.at);
        out[..count].copy_from_slice(&self.current[self.at..][..count]);
        self.at += count;
        Ok(count)
    }
}

/// Frames whose windows are in memory.
pub(crate) struct InMemory {
    archive: Archive,
    incoming: Incoming,
    /// The number of the next frame.
    next: usize,
}

impl InMemory {
    /// `memory` is what a window takes.
    pub(crate) fn new(incoming: Incoming, of: &Frames, memory: usize) -> Self {
        Self { archive: Archive { memory, ..of.archive() }, incoming, next: 0 }
    }
}

impl FrameSource for InMemory {
    fn archive(&self) -> &Archive {
        &self.archive
    }

    fn window(&mut self, first: usize, count: usize) -> Result<Box<dyn FrameWindow>> {
        if first < self.next {
            return Err(Error::setting("frames", format!("frame {first} is over, and frame {} comes next", self.next)));
        }
        let mut frames = Vec::new();
        while self.next < first + count {
            let Some(frame) = self.incoming.next().map_err(|e| Error::io("frames", "receiving", e))? else { break };
            if self.next >= first {
                frames.push(frame);
            }
            self.next += 1;
        }
        let (grid, size, spare) = (self.archive.grid, self.archive.sample.size(), self.incoming.spare.clone());
        Ok(Box::new(Window { frames, grid, size, spare }))
    }
}

/// Some frames, whose memory goes back to the caller's end.
struct Window {
    frames: Vec<FrameMemory>,
    grid: Grid,
    /// Bytes of a sample.
    size: usize,
    spare: Sender<FrameMemory>,
}

impl FrameWindow for Window {
    fn frames(&self) -> usize {
        self.frames.len()
    }

    fn read_box(&self, frame: usize, region: &Region, out: &mut [u8]) -> Result<()> {
        copy_box(&self.frames[frame], &self.grid, self.size, region, out);
        Ok(())
    }

    fn name(&self, _frame: usize) -> String {
        "frames".into() // messages say which
    }

    fn check_unchanged(&self) -> Result<()> {
        Ok(())
    }
}

impl Drop for Window {
    fn drop(&mut self) {
        self.frames.drain(..).for_each(|frame| drop(self.spare.send(frame))); // the caller's end may be gone
    }
}
