//! The measurements of a process, and the least of several.

use crate::bench::size::clock;
use serde::{Deserialize, Serialize};
use std::time::Instant;

/// Seconds of processor time, over all threads, and of wall time.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct Time {
    /// All threads together.
    pub processor: f64,
    /// From start to end.
    pub wall: f64,
}

impl Time {
    /// The lesser of each.
    pub(super) fn least(self, other: Self) -> Self {
        Self { processor: self.processor.min(other.processor), wall: self.wall.min(other.wall) }
    }

    /// The time that counts: processor time with one thread, because neighbours disturb it least; otherwise wall time.
    pub(super) fn of(&self, threads: usize) -> f64 {
        if threads == 1 { self.processor } else { self.wall }
    }
}

/// Measures times.
pub(super) struct Stopwatch {
    processor: f64,
    wall: Instant,
}

impl Stopwatch {
    pub(super) fn start() -> Self {
        Self { processor: clock::seconds(), wall: Instant::now() }
    }

    pub(super) fn read(&self) -> Time {
        Time { processor: clock::seconds() - self.processor, wall: self.wall.elapsed().as_secs_f64() }
    }

    /// The result of `work`, and its time.
    pub(super) fn time<T, E>(work: impl FnOnce() -> Result<T, E>) -> Result<(T, Time), E> {
        let watch = Self::start();
        let result = work()?;
        Ok((result, watch.read()))
    }
}

/// The measurements of a process.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Measured {
    /// Time of the whole; for a view, from opening its input to its last picture.
    pub time: Time,
    /// For a view: the least time of all pictures with the input open.
    pub further: Option<Time>,
    /// Share of a view's time for decoding and splatting, as the library reports it.
    pub splatting: Option<f64>,
    /// The splat method of a view.
    pub method: Option<String>,
    /// Bytes written or read: of a coefficient file, or of its blocks in a view or bare decoding.
    pub bytes: u64,
    /// Nonzero codes per sample of a file.
    pub codes_per_sample: Option<f64>,
    /// For a close-up: share of the volume's voxels in the picture and the region.
    pub seen: Option<f64>,
    /// For a cold view: bytes that came from storage.
    pub from_storage: Option<u64>,
    /// Peak memory observed for this process alone.
    pub peak_heap: Option<u64>,
    /// For compared pictures: the largest error and the root mean square, as shares of the largest absolute pixel.
    pub errors: Vec<(f64, f64)>,
}

impl Measured {
    /// Joins the measurements of another round.
    pub(super) fn join(&mut self, other: &Self) {
        if let (Some(mine), Some(others)) = (self.further, other.further) {
            // The share belongs to the faster view.
            self.splatting = if others.processor < mine.processor { other.splatting } else { self.splatting };
            self.further = Some(mine.least(others));
        }
        self.time = self.time.least(other.time);
        self.from_storage = self.from_storage.min(other.from_storage);
        self.peak_heap = self.peak_heap.max(other.peak_heap);
    }
}

/// The time of a view with its input open.
pub(super) fn further(view: &Measured) -> Time {
    view.further.unwrap_or(view.time)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rounds_are_joined_by_the_least_times() {
        let at = |seconds, splatting| Measured {
            time: Time { processor: seconds, wall: 2.0 * seconds },
            further: Some(Time { processor: seconds, wall: seconds }),
            splatting: Some(splatting),
            ..Measured::default()
        };
        let mut joined = at(2.0, 0.5);
        joined.join(&at(1.0, 0.25));
        joined.join(&at(3.0, 0.75));
        assert_eq!(joined, at(1.0, 0.25));
        assert_eq!((joined.time.of(1), joined.time.of(2)), (1.0, 2.0));
    }
}
