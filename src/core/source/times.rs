//! The times of an archive: those of its files, on the clock of the first one, or those that the user gives.

use super::file_header::{FileHeader, Units};
use super::{Archive, FrameSource, FrameWindow, OpenOptions};
use crate::base::clock::Clock;
use crate::base::error::{Error, Result};
use std::fmt;
use std::ops::Range;
use std::sync::Arc;

/// Times that replace those of the files.
#[derive(Debug, Clone, PartialEq)]
pub enum GivenTimes {
    /// One for each frame.
    List(Arc<[f64]>),
    /// In equal steps.
    Regular(RegularTimes),
}

/// Times in equal steps.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RegularTimes {
    start: f64,
    step: f64,
    /// Steps from `start` to the first frame, and from each to the next.
    first: usize,
    every: usize,
}

impl RegularTimes {
    /// `start`, `start` + `step`, `start` + 2 `step`, and so on.
    ///
    /// # Errors
    /// [`Error::Setting`] for numbers that are not finite, and a step that is not above 0.
    pub fn new(start: f64, step: f64) -> Result<Self> {
        if !(start.is_finite() && step.is_finite() && step > 0.0) {
            return Err(Error::setting(
                "times",
                format!("{start} and steps of {step}: give a start, and a step above 0"),
            ));
        }
        Ok(Self { start, step, first: 0, every: 1 })
    }

    /// The times of every `every`-th frame from `first` on.
    #[must_use]
    pub fn stepped(self, first: usize, every: usize) -> Self {
        let first = first.saturating_mul(self.every).saturating_add(self.first);
        Self { first, every: every.saturating_mul(self.every), ..self }
    }

    /// The times of every `every`-th frame from the one after `last` on.
    #[must_use]
    pub fn after(self, last: f64, every: usize) -> Self {
        let steps = ((last - self.start) / self.step).round().max(0.0) as usize;
        Self { first: steps.saturating_add(every), every, ..self }
    }

    /// The time of a frame.
    fn at(self, frame: usize) -> f64 {
        self.start + self.step * (self.first as f64 + self.every as f64 * frame as f64)
    }

    /// The times of frames.
    pub(crate) fn times(self, frames: Range<usize>) -> Vec<f64> {
        frames.map(|frame| self.at(frame)).collect()
    }
}

impl fmt::Display for RegularTimes {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "from {} on, in steps of {}", self.at(0), self.step * self.every as f64)
    }
}

/// Puts the times of a file onto the clock of the first one.
///
/// # Errors
/// Why that cannot be: a sentence that follows the name of the file.
pub(crate) fn onto_clock(file: &mut FileHeader, first: &Units) -> std::result::Result<(), String> {
    let converted = clock(&file.units).and_then(|own| own.convert(&mut file.times, clock(first)?));
    let refused =
        |why| format!("has times in {}, but the first file in {}: {why}", counted(&file.units), counted(first));
    converted.map_err(refused)
}

/// What times count, in words.
fn counted(units: &Units) -> String {
    let unit = units.times.as_ref().map_or("no unit".into(), |unit| format!("{unit:?}"));
    units.calendar.as_ref().map_or(unit.clone(), |calendar| format!("{unit} ({calendar})"))
}

fn clock(units: &Units) -> std::result::Result<Clock, String> {
    Clock::parse(units.times.as_deref().unwrap_or_default(), units.calendar.as_deref())
}

/// Puts the user's times in place of those of the files, and the files' onto the clock of an earlier archive.
pub fn settle(archive: &mut Archive, options: &OpenOptions) -> Result<()> {
    if let Some(given) = &options.times {
        (archive.units.times, archive.units.calendar) = (None, options.calendar.clone());
        match (given, archive.frames) {
            (GivenTimes::List(times), Some(frames)) => archive.times = listed(times, frames)?,
            (GivenTimes::List(_), None) => {
                let what = "a list is for a known number of frames; for a stream, give a start and a step";
                return Err(Error::setting("times", what));
            }
            (GivenTimes::Regular(times), Some(frames)) => archive.times = times.times(0..frames),
            (GivenTimes::Regular(times), None) => archive.regular_times = Some(*times),
        }
    }
    if let Some(unit) = &options.time_unit {
        match archive.has_times() {
            true => archive.units.times = Some(unit.clone()),
            false if options.clock.is_some() => {}
            false => archive.notes.push("frames have no times, so the unit of times is left out".into()),
        }
    }
    if let Some(earlier) = &options.clock {
        continue_clock(archive, earlier);
    }
    Ok(())
}

fn listed(times: &[f64], frames: usize) -> Result<Vec<f64>> {
    if times.len() != frames {
        return Err(Error::setting("times", format!("there are {} for {frames} frame(s)", times.len())));
    }
    match times.iter().position(|time| !time.is_finite()) {
        Some(at) => Err(Error::setting("times", format!("{} of frame {at} is not finite", times[at]))),
        None => Ok(times.to_vec()),
    }
}

/// Puts times onto an earlier clock. Those that it cannot have stay as they are.
fn continue_clock(archive: &mut Archive, earlier: &Units) {
    let Units { times: unit, calendar, .. } = &archive.units;
    if archive.times.is_empty() || (unit, calendar) == (&earlier.times, &earlier.calendar) {
        return;
    }
    let (Ok(own), Ok(other)) = (clock(&archive.units), clock(earlier)) else { return };
    let mut times = archive.times.clone();
    if own.convert(&mut times, other).is_ok() {
        archive.times = times;
        (archive.units.times, archive.units.calendar) = (earlier.times.clone(), earlier.calendar.clone());
    }
}

/// A source with other times, in the units of an earlier archive.
pub fn with_times(source: Box<dyn FrameSource>, times: RegularTimes, units: &Units) -> Box<dyn FrameSource> {
    let mut archive = source.archive().clone();
    (archive.units.times, archive.units.calendar) = (units.times.clone(), units.calendar.clone());
    match archive.frames {
        Some(frames) => archive.times = times.times(0..frames),
        None => archive.regular_times = Some(times),
    }
    Box::new(Timed { source, archive })
}

struct Timed {
    source: Box<dyn FrameSource>,
    archive: Archive,
}

impl FrameSource for Timed {
    fn archive(&self) -> &Archive {
        &self.archive
    }

    fn window(&mut self, first: usize, count: usize) -> Result<Box<dyn FrameWindow>> {
        self.source.window(first, count)
    }

    fn window_of(&mut self, first: usize, count: usize, step: usize) -> Result<Box<dyn FrameWindow>> {
        self.source.window_of(first, count, step)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::grid::Grid;
    use crate::base::sample::SampleType;

    fn units(times: &str, calendar: Option<&str>) -> Units {
        Units { times: Some(times.into()), calendar: calendar.map(String::from), ..Units::default() }
    }

    #[test]
    fn regular_times_of_some_frames_are_those_of_all() {
        let all = RegularTimes::new(0.5, 0.1).expect("a step");
        let times = all.times(0..100);
        let some = all.stepped(3, 4).stepped(2, 5);
        assert_eq!(some.times(0..4), [11, 31, 51, 71].map(|frame| times[frame]));
        assert_eq!(some.after(some.at(3), 20).times(0..1), [times[91]]);
        assert_eq!(all.after(times[41], 1).times(0..50), times[42..92]);
        let refused = [(0.0, 0.0), (0.0, -1.0), (f64::NAN, 1.0), (0.0, f64::INFINITY)];
        assert!(refused.into_iter().all(|(start, step)| RegularTimes::new(start, step).is_err()));
    }

    #[test]
    fn the_users_times_have_the_users_unit_or_none() {
        let archive = |frames: Option<usize>| {
            let units = units("days since 2000-01-01", Some("noleap"));
            let times = frames.map_or(Vec::new(), |frames| vec![1.0; frames]);
            Archive { units, times, ..Archive::new(Grid::unit([1; 3]), SampleType::U8, frames) }
        };
        let settled = |frames, times: GivenTimes, unit: Option<&str>| {
            let (mut archive, time_unit) = (archive(frames), unit.map(String::from));
            let options = OpenOptions { times: Some(times), time_unit, ..OpenOptions::default() };
            settle(&mut archive, &options).map(|()| archive)
        };
        let steps = || GivenTimes::Regular(RegularTimes::new(1.0, 2.0).expect("a step"));
        let list = |times: &[f64]| GivenTimes::List(times.into());
        let found = settled(Some(2), steps(), None).expect("times");
        assert_eq!((found.times, found.units), (vec![1.0, 3.0], Units::default()));
        let found = settled(None, steps(), Some("s")).expect("times");
        assert!(found.has_times() && found.times.is_empty() && found.times_of(3..5) == [7.0, 9.0]);
        assert_eq!(found.units, units("s", None));
        assert_eq!(settled(Some(2), list(&[5.0, 4.0]), None).expect("times").times, [5.0, 4.0]);
        assert!(settled(Some(3), list(&[5.0, 4.0]), None).is_err() && settled(None, list(&[5.0]), None).is_err());
        assert!(settled(Some(1), list(&[f64::NAN]), None).is_err());
    }

    #[test]
    fn times_go_onto_an_earlier_clock_where_they_can() {
        let settled = |own: Units, earlier: Units| {
            let plain = Archive::new(Grid::unit([1; 3]), SampleType::U8, Some(2));
            let mut archive = Archive { units: own, times: vec![0.0, 0.5], ..plain };
            let options = OpenOptions { clock: Some(earlier), ..OpenOptions::default() };
            settle(&mut archive, &options).expect("nothing refused");
            (archive.times, archive.units)
        };
        let (days, hours) = (units("days since 2000-03-01", None), units("hours since 2000-02-28", Some("standard")));
        assert_eq!(settled(days.clone(), hours.clone()), (vec![48.0, 60.0], hours.clone()));
        for earlier in
            [units("months since 2000-01-01", None), units("s", None), units("hours since 2000-02-28", Some("noleap"))]
        {
            assert_eq!(settled(days.clone(), earlier), (vec![0.0, 0.5], days.clone()));
        }
    }
}
