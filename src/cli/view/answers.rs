//! Memory for finished answers, which may wait for slow clients.

use axum::body::Bytes;
use std::sync::Arc;
use tokio::sync::{OwnedSemaphorePermit, Semaphore};

/// Bytes that are counted together.
const UNIT: usize = 1024;

/// Room for answers until they are sent.
#[derive(Debug)]
pub(super) struct AnswerRoom {
    free: Arc<Semaphore>,
    units: u32,
}

/// An answer, and its part of the room.
struct Held {
    bytes: Vec<u8>,
    _part: Option<OwnedSemaphorePermit>,
}

impl AsRef<[u8]> for Held {
    fn as_ref(&self) -> &[u8] {
        &self.bytes
    }
}

impl AnswerRoom {
    pub(super) fn new(bytes: usize) -> Self {
        let units = u32::try_from(bytes / UNIT).unwrap_or(u32::MAX).max(1);
        Self { free: Arc::new(Semaphore::new(units as usize)), units }
    }

    /// Waits until an answer fits beside those that are being sent; one that needs more than all room waits for all. It
    /// leaves the room when it is sent, or when its client is gone.
    pub(super) async fn hold(&self, mut bytes: Vec<u8>) -> Bytes {
        bytes.shrink_to_fit();
        let units = u32::try_from(bytes.len().div_ceil(UNIT)).unwrap_or(u32::MAX).min(self.units);
        let part = self.free.clone().acquire_many_owned(units).await.ok(); // the room is never closed
        Bytes::from_owner(Held { bytes, _part: part })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Duration;

    #[test]
    fn answers_wait_for_room() {
        let runtime = tokio::runtime::Builder::new_current_thread().enable_time().build().expect("a runtime");
        runtime.block_on(async {
            let room = AnswerRoom::new(10 * UNIT);
            let fits = async |bytes: usize| {
                tokio::time::timeout(Duration::from_millis(20), room.hold(vec![1; bytes])).await.ok()
            };
            let (a, b) = (fits(4 * UNIT).await.expect("room"), fits(5 * UNIT + 1).await.expect("room"));
            assert!(fits(1).await.is_none() && a.len() == 4 * UNIT);
            drop(a);
            let part = fits(UNIT).await.expect("room").slice(3..4);
            assert!(fits(100 * UNIT).await.is_none(), "it needs all room");
            drop(b);
            assert!(fits(100 * UNIT).await.is_none(), "a part keeps all of its answer");
            drop(part);
            assert_eq!(fits(100 * UNIT).await.map(|all| all.len()), Some(100 * UNIT));
        });
    }
}
