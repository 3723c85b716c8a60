//! What a process measured, and the least of several.

use crate::bench::size::clock;
use serde::{Deserialize, Serialize};
use std::time::Instant;

/// Seconds of the processor, all threads together, and of the clock on the wall.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct Time {
    /// All threads together.
    pub processor: f64,
    /// From beginning to end.
    pub wall: f64,
}

impl Time {
    /// The lesser of each.
    pub(super) fn least(self, other: Self) -> Self {
        Self { processor: self.processor.min(other.processor), wall: self.wall.min(other.wall) }
    }

    /// What counts: the processor's where there is one thread, since neighbours disturb it least, else the wall's.
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

    /// What `work` returns, and how long it took.
    pub(super) fn time<T, E>(work: impl FnOnce() -> Result<T, E>) -> Result<(T, Time), E> {
        let watch = Self::start();
        let result = work()?;
        Ok((result, watch.read()))
    }
}

/// What a process measured.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Measured {
    /// Of the whole; of a view from opening its input to its last picture.
    pub time: Time,
    /// Of a view: the least that all pictures took, with the input open.
    pub further: Option<Time>,
    /// Share of a view's time that went into decoding and splatting, as the library reports it.
    pub splatting: Option<f64>,
    /// How a view was splatted.
    pub method: Option<String>,
    /// Bytes that were made or read: of a coefficient file; of its blocks in a view or a bare decoding.
    pub bytes: u64,
    /// Nonzero codes for each sample of a file.
    pub codes_per_sample: Option<f64>,
    /// Share of the volume's voxels in the picture and the region, of a close-up.
    pub seen: Option<f64>,
    /// Of a cold view: bytes that came from the storage.
    pub from_storage: Option<u64>,
    /// The most memory of its own that the process was seen to have.
    pub peak_heap: Option<u64>,
    /// Of compared pictures: the largest error and the root mean square, as shares of the largest absolute pixel.
    pub errors: Vec<(f64, f64)>,
}

impl Measured {
    /// Joins what another round measured of the same.
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
