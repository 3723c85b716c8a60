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
    /// If it is larger than the room, nothing is rendered meanwhile.
    _turn: Option<OwnedSemaphorePermit>,
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

    /// Waits until an answer fits beside those that are being sent, and ends its turn to render. One that is larger than
    /// all room waits for all, and keeps its turn. It leaves the room when it is sent, or when its client is gone.
    pub(super) async fn hold(&self, mut bytes: Vec<u8>, turn: OwnedSemaphorePermit) -> Bytes {
        bytes.shrink_to_fit();
        let units = u32::try_from(bytes.len().div_ceil(UNIT)).unwrap_or(u32::MAX);
        let part = self.free.clone().acquire_many_owned(units.min(self.units)).await.ok(); // the room is never closed
        let turn = (units > self.units).then_some(turn);
        Bytes::from_owner(Held { bytes, _part: part, _turn: turn })
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
            let (room, turns) = (AnswerRoom::new(10 * UNIT), Arc::new(Semaphore::new(1)));
            let fits = async |bytes: usize| {
                let turn = turns.clone().try_acquire_owned().expect("a turn");
                tokio::time::timeout(Duration::from_millis(20), room.hold(vec![1; bytes], turn)).await.ok()
            };
            let (a, b) = (fits(4 * UNIT).await.expect("room"), fits(5 * UNIT + 1).await.expect("room"));
            assert!(fits(1).await.is_none() && a.len() == 4 * UNIT);
            drop(a);
            let part = fits(UNIT).await.expect("room").slice(3..4);
            assert!(fits(100 * UNIT).await.is_none(), "it needs all room");
            drop(b);
            assert!(fits(100 * UNIT).await.is_none(), "a part keeps all of its answer");
            drop(part);
            let large = fits(100 * UNIT).await.expect("room");
            assert!(large.len() == 100 * UNIT && turns.available_permits() == 0, "nothing is rendered beside it");
            drop(large);
            assert_eq!(turns.available_permits(), 1);
        });
    }
}
