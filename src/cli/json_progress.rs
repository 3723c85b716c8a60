//! Progress as lines of JSON.

use super::messages::note;
use serde::Serialize;
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// Writes JSON objects to standard error, one per line: up to two a second, and one at the end of the stage.
#[derive(Debug)]
pub struct JsonProgress {
    stage: &'static str,
    unit: &'static str,
    state: Mutex<State>,
}

#[derive(Debug)]
struct State {
    total: Option<u64>,
    done: u64,
    /// Steps that an earlier run did, included in `done`.
    before: u64,
    /// None before the stage begins.
    started: Option<Instant>,
    /// Time of the last line, and its number of steps.
    written: Option<(Instant, u64)>,
}

/// One line.
#[derive(Debug, Serialize)]
struct Line {
    stage: &'static str,
    done: u64,
    total: Option<u64>,
    unit: &'static str,
    per_second: Option<f64>,
    seconds_left: Option<f64>,
}

const BETWEEN_LINES: Duration = Duration::from_millis(500);

impl JsonProgress {
    pub(super) fn new(stage: &'static str, unit: &'static str) -> Self {
        let state = State { total: None, done: 0, before: 0, started: None, written: None };
        Self { stage, unit, state: Mutex::new(state) }
    }

    pub(super) fn start(&self, total: Option<u64>) {
        let mut state = self.state();
        (state.total, state.started) = (total, Some(Instant::now()));
        self.write(&mut state);
    }

    pub(super) fn resume(&self, steps: u64) {
        let mut state = self.state();
        (state.done, state.before) = (steps, steps);
    }

    pub(super) fn advance(&self, steps: u64) {
        let mut state = self.state();
        state.done += steps;
        if state.written.is_none_or(|(when, _)| when.elapsed() >= BETWEEN_LINES) {
            self.write(&mut state);
        }
    }

    /// Writes the number of steps, unless the last line has it.
    pub(super) fn write_last(&self) {
        let mut state = self.state();
        if state.started.is_some() && state.written.is_none_or(|(_, done)| done != state.done) {
            self.write(&mut state);
        }
    }

    fn write(&self, state: &mut State) {
        let State { total, done, before, started, .. } = *state;
        let seconds = started.map_or(0.0, |started| started.elapsed().as_secs_f64());
        let per_second = Some((done - before) as f64 / seconds).filter(|speed| speed.is_finite() && *speed > 0.0);
        let left = total.map(|total| total.saturating_sub(done) as f64);
        let seconds_left = left.and_then(|left| per_second.map(|speed| left / speed));
        let line = Line { stage: self.stage, done, total, unit: self.unit, per_second, seconds_left };
        if let Ok(line) = serde_json::to_string(&line) {
            note(line);
        }
        state.written = Some((Instant::now(), done));
    }

    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Drop for JsonProgress {
    fn drop(&mut self) {
        self.write_last();
    }
}
