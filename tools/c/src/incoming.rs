//! Frames on their way from the caller to a conversion, as a stream of bytes.

use std::io::{self, Read};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, Sender, SyncSender, channel, sync_channel};

/// Frames that wait: while one is taken, the next one is copied.
const WAITING: usize = 1;

/// The end of the caller.
pub(crate) struct Outgoing {
    frames: SyncSender<Vec<u8>>,
    spare: Receiver<Vec<u8>>,
    is_abandoned: Arc<AtomicBool>,
}

/// The end of the conversion.
pub(crate) struct Incoming {
    frames: Receiver<Vec<u8>>,
    spare: Sender<Vec<u8>>,
    is_abandoned: Arc<AtomicBool>,
    current: Vec<u8>,
    at: usize,
}

/// Both ends.
pub(crate) fn stream() -> (Outgoing, Incoming) {
    let ((to_conversion, frames), (back, spare)) = (sync_channel(WAITING), channel());
    let is_abandoned = Arc::<AtomicBool>::default();
    let incoming = Incoming { frames, spare: back, is_abandoned: is_abandoned.clone(), current: Vec::new(), at: 0 };
    (Outgoing { frames: to_conversion, spare, is_abandoned }, incoming)
}

impl Outgoing {
    /// Memory for a frame: that of an earlier one, if there is one.
    pub(crate) fn room(&self) -> Vec<u8> {
        self.spare.try_recv().unwrap_or_default()
    }

    /// Waits until the conversion can take a frame. Says whether it still does.
    pub(crate) fn send(&self, frame: Vec<u8>) -> bool {
        self.frames.send(frame).is_ok()
    }

    /// Ends the stream by an error.
    pub(crate) fn abandon(self) {
        self.is_abandoned.store(true, Ordering::SeqCst);
    }
}

impl Read for Incoming {
    fn read(&mut self, out: &mut [u8]) -> io::Result<usize> {
        if self.at == self.current.len() {
            let _ = self.spare.send(std::mem::take(&mut self.current)); // nobody may want it any more
            self.at = 0;
            match self.frames.recv() {
                Ok(frame) => self.current = frame,
                Err(_) if self.is_abandoned.load(Ordering::SeqCst) => return Err(io::Error::other("was abandoned")),
                Err(_) => return Ok(0),
            }
        }
        let count = out.len().min(self.current.len() - self.at);
        out[..count].copy_from_slice(&self.current[self.at..][..count]);
        self.at += count;
        Ok(count)
    }
}
