//! Connections. Newer ones replace those that have not shown the token yet, so that clients without it cannot keep its
//! holders out. Slow clients are disconnected.

use std::collections::VecDeque;
use std::io;
use std::pin::Pin;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::task::{Context, Poll};
use std::time::Duration;
use tokio::io::{AsyncRead, AsyncWrite, ReadBuf};
use tokio::net::TcpStream;
use tokio::sync::{OwnedSemaphorePermit, Semaphore};
use tokio::task::AbortHandle;
use tokio::time::{Sleep, sleep};

/// Most connections of holders of the token at a time.
const MOST_HOLDERS: usize = 256;
/// Most other connections at a time. For one more, the oldest is closed.
const MOST_STRANGERS: usize = 256;
/// The time that a client has to send the head of a request, then its body, and to take each part of an answer.
pub(super) const PATIENCE: Duration = Duration::from_secs(10);
/// Bytes of a part.
const PART: usize = 64 << 10;

/// The open connections.
#[derive(Debug, Clone)]
pub(super) struct Connections {
    /// Those that have not shown the token, the oldest first.
    strangers: Arc<Mutex<VecDeque<(u64, AbortHandle)>>>,
    /// Places for the others.
    places: Arc<Semaphore>,
}

/// One connection.
#[derive(Debug)]
pub(super) struct Connection {
    all: Connections,
    number: u64,
    /// Its place, if it has shown the token.
    place: Mutex<Option<OwnedSemaphorePermit>>,
}

impl Connections {
    pub(super) fn new() -> Self {
        Self { strangers: Arc::default(), places: Arc::new(Semaphore::new(MOST_HOLDERS)) }
    }

    /// A connection with a number of its own.
    pub(super) fn connection(&self, number: u64) -> Connection {
        Connection { all: self.clone(), number, place: Mutex::default() }
    }

    fn strangers(&self) -> MutexGuard<'_, VecDeque<(u64, AbortHandle)>> {
        self.strangers.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Adds a connection that has not begun yet, with what ends it.
    pub(super) fn add(&self, number: u64, end: AbortHandle) {
        self.strangers().push_back((number, end));
        if self.strangers().len() > MOST_STRANGERS {
            self.close_oldest();
        }
    }

    /// Closes the oldest connection that has not shown the token.
    pub(super) fn close_oldest(&self) {
        let oldest = self.strangers().pop_front();
        oldest.into_iter().for_each(|(_, end)| end.abort());
    }

    fn forget(&self, number: u64) {
        self.strangers().retain(|(other, _)| *other != number);
    }
}

impl Connection {
    /// Gives a connection that has shown the token a place among its holders. Returns whether there is one.
    pub(super) fn is_placed(&self) -> bool {
        let mut place = self.place.lock().unwrap_or_else(PoisonError::into_inner);
        if place.is_none() {
            *place = self.all.places.clone().try_acquire_owned().ok();
            self.all.forget(self.number);
        }
        place.is_some()
    }
}

impl Drop for Connection {
    fn drop(&mut self) {
        self.all.forget(self.number);
    }
}

/// A stream whose reader must take a part of what is sent every so often.
#[derive(Debug)]
pub(super) struct Patient {
    stream: TcpStream,
    /// Ends the wait for the reader.
    deadline: Option<Pin<Box<Sleep>>>,
    /// Bytes that it has taken since the wait began.
    taken: usize,
}

impl Patient {
    pub(super) fn new(stream: TcpStream) -> Self {
        Self { stream, deadline: None, taken: 0 }
    }

    /// All is sent, or a part: the next wait begins anew.
    fn begin_anew(&mut self) {
        (self.deadline, self.taken) = (None, 0);
    }

    /// The result of sending bytes; an error if that has taken too long.
    fn in_time(&mut self, context: &mut Context<'_>, sent: Poll<io::Result<usize>>) -> Poll<io::Result<usize>> {
        if let Poll::Ready(Ok(bytes)) = sent {
            self.taken += bytes;
            if self.taken >= PART {
                self.begin_anew();
            }
        }
        if sent.is_ready() {
            return sent;
        }
        let deadline = self.deadline.get_or_insert_with(|| Box::pin(sleep(PATIENCE)));
        deadline.as_mut().poll(context).map(|()| Err(io::ErrorKind::TimedOut.into()))
    }
}

impl AsyncRead for Patient {
    fn poll_read(mut self: Pin<&mut Self>, context: &mut Context<'_>, to: &mut ReadBuf<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.stream).poll_read(context, to)
    }
}

impl AsyncWrite for Patient {
    fn poll_write(mut self: Pin<&mut Self>, context: &mut Context<'_>, bytes: &[u8]) -> Poll<io::Result<usize>> {
        let sent = Pin::new(&mut self.stream).poll_write(context, bytes);
        self.in_time(context, sent)
    }

    fn poll_write_vectored(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        parts: &[io::IoSlice<'_>],
    ) -> Poll<io::Result<usize>> {
        let sent = Pin::new(&mut self.stream).poll_write_vectored(context, parts);
        self.in_time(context, sent)
    }

    fn is_write_vectored(&self) -> bool {
        self.stream.is_write_vectored()
    }

    fn poll_flush(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<io::Result<()>> {
        self.begin_anew();
        Pin::new(&mut self.stream).poll_flush(context)
    }

    fn poll_shutdown(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.stream).poll_shutdown(context)
    }
}
