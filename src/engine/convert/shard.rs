//! Shards: runs of whole windows that are converted apart, perhaps on several machines. Merged (`crate::file::merge`) they
//! have the bytes of one conversion.
//!
//! No window may depend on a window of another shard. So a bound that refers to a range needs the range of the whole
//! archive ([`ArchiveScan`]), and shards begin where the choice of schemes starts afresh
//! ([`super::ConvertConfig::chain`]).

use crate::file::shard::{SHARD, SHARD_OF};
use serde::{Deserialize, Serialize};
use std::fmt;
use std::ops::Range;
use std::path::Path;
use std::str::FromStr;
use wavesplat_core::base::error::{Error, Note, Remedy, Result};
use wavesplat_core::base::files;
use wavesplat_core::base::progress::Progress;
use wavesplat_core::base::sample::{self, join_ranges};
use wavesplat_core::source::scan::scan;
use wavesplat_core::source::{Archive, FrameSource, Selection, select};

/// One of several shards.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(try_from = "String")]
pub struct Shard {
    /// Its number, from 1.
    pub number: usize,
    /// How many there are.
    pub of: usize,
}

impl FromStr for Shard {
    type Err = String;

    fn from_str(text: &str) -> std::result::Result<Self, String> {
        let parts = text.split_once('/').and_then(|(number, of)| Some((number.parse().ok()?, of.parse().ok()?)));
        let shard =
            parts.map(|(number, of)| Self { number, of }).filter(|shard| (1..=shard.of).contains(&shard.number));
        shard.ok_or_else(|| "takes I/N, the I-th of N shards: 1/8 to 8/8".into())
    }
}

impl TryFrom<String> for Shard {
    type Error = String;

    fn try_from(text: String) -> std::result::Result<Self, String> {
        text.parse()
    }
}

impl fmt::Display for Shard {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}/{}", self.number, self.of)
    }
}

impl Shard {
    /// Its part of so many items.
    fn part(self, items: usize) -> Range<usize> {
        let end = |number: usize| (items as u128 * number as u128 / self.of as u128) as usize;
        end(self.number - 1)..end(self.number)
    }

    /// Its frames, of windows of `window` frames that are chosen in chains of `chain`.
    ///
    /// # Errors
    /// The archive has fewer chains than shards.
    pub fn frames(self, frames: usize, window: usize, chain: usize) -> Result<Range<usize>> {
        let length = window.saturating_mul(chain).max(1);
        let chains = frames.div_ceil(length);
        if chains < self.of {
            let what =
                format!("{} shards need as many runs of {length} frames, but {frames} frames have {chains}", self.of);
            return Err(Error::setting("shard", Note::with(what, Remedy::Adjust(&["chain", "window"]))));
        }
        let part = self.part(chains);
        Ok(part.start * length..(part.end * length).min(frames))
    }
}

/// Names and values that a file keeps.
type Settings = Vec<(String, String)>;

/// The frames of a shard, and the settings that identify it.
///
/// # Errors The source is a stream, so its number of frames is unknown; or it has too few frames for that many shards.
pub fn sharded(
    source: Box<dyn FrameSource>,
    shard: Shard,
    window: usize,
    chain: usize,
) -> Result<(Box<dyn FrameSource>, Settings)> {
    let archive = source.archive();
    let Some(all) = archive.frames else {
        return Err(Error::setting("shard", "a pipe has no known number of frames, so it has no shards"));
    };
    let frames = shard.frames(all, window, chain)?;
    let settings = [(SHARD, shard.to_string()), (SHARD_OF, format!("{}:{}/{all}", frames.start, frames.end))];
    let selection =
        Selection { first: frames.start, step: 1, frames: Some(frames.len()), region: archive.grid.whole() };
    Ok((select(source, selection)?, settings.map(|(name, value)| (name.to_string(), value)).into()))
}

/// The facts about all frames that converting a part of them needs.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ArchiveScan {
    /// The version of this record.
    schema: u32,
    /// Voxels along x, y, z.
    dims: [usize; 3],
    /// The type of the samples.
    sample: String,
    /// Frames of the archive.
    frames: usize,
    /// The frames that were read, as a half-open range.
    read: [usize; 2],
    /// The least and the largest sample; none if all are missing.
    range: Option<(f64, f64)>,
    /// Missing samples.
    missing: u64,
}

const SCHEMA: u32 = 1;

/// Most bytes of a scan's file.
const MOST_BYTES: u64 = 1 << 20;

impl ArchiveScan {
    /// Scans all frames of an archive, or those of a shard. `declared` is the value that means "missing".
    ///
    /// # Errors
    /// A stream, or frames that cannot be read.
    pub fn scan(
        source: &mut dyn FrameSource,
        shard: Option<Shard>,
        declared: Option<f64>,
        progress: &dyn Progress,
    ) -> Result<Self> {
        let Archive { grid, sample, frames, .. } = source.archive().clone();
        let frames = frames.ok_or_else(|| Error::setting("inputs", "a pipe is read once, and needs no scan"))?;
        let declared = sample::missing_value(sample, declared);
        let read = shard.map_or(0..frames, |shard| shard.part(frames));
        progress.start(Some(read.len() as u64));
        let (mut range, mut missing) = ((f64::INFINITY, f64::NEG_INFINITY), 0);
        for frame in read.clone() {
            progress.check()?;
            let window = source.window(frame, 1)?;
            let seen = scan(window.as_ref(), &grid, sample, declared)?;
            window.check_unchanged()?;
            range = join_ranges(range, seen.range);
            missing += seen.missing;
            progress.advance(1);
        }
        progress.finish();
        let range = Some(range).filter(|(lo, hi)| lo <= hi);
        let read = [read.start, read.end];
        Ok(Self { schema: SCHEMA, dims: grid.dims, sample: sample.to_string(), frames, read, range, missing })
    }

    /// Merges the scans of all shards, given in any order, into one.
    ///
    /// # Errors The scans are of different archives, leave out frames, or overlap. Messages use the given names.
    pub fn merged(scans: &[(String, Self)]) -> Result<Self> {
        let mut ordered: Vec<_> = scans.iter().collect();
        ordered.sort_by_key(|(_, scan)| scan.read);
        let Some(((first, merged), rest)) = ordered.split_first() else {
            return Err(Error::setting("inputs", "no scan was given"));
        };
        let mut merged = merged.clone();
        let (name, mut before) = (first, first);
        for (other, scan) in rest {
            let alike = |scan: &Self| (scan.dims, scan.sample.clone(), scan.frames);
            if alike(scan) != alike(&merged) {
                return Err(Error::path(other, format!("is a scan of another archive than {name}")));
            }
            if scan.read[0] != merged.read[1] {
                let what = if scan.read[0] < merged.read[1] { "have both read" } else { "leave out" };
                let (from, to) = (scan.read[0].min(merged.read[1]), scan.read[0].max(merged.read[1]));
                return Err(Error::path(other, format!("and {before} {what} frames {from}..{to}")));
            }
            let joined = merged.range.into_iter().chain(scan.range).reduce(join_ranges);
            (merged.range, merged.missing, merged.read[1]) = (joined, merged.missing + scan.missing, scan.read[1]);
            before = other;
        }
        match merged.read == [0, merged.frames] {
            true => Ok(merged),
            false => Err(Error::path(before, format!("frames {}..{} are in no scan", merged.read[1], merged.frames))),
        }
    }

    /// The text of a file.
    pub fn to_json(&self) -> String {
        serde_json::to_string_pretty(self).map(|text| text + "\n").unwrap_or_default()
    }

    /// Opens the file of a scan.
    ///
    /// # Errors
    /// The file cannot be read, or is no scan.
    pub fn open(path: &Path) -> Result<Self> {
        let failed = |e| Error::io(path, "reading", e);
        if path.metadata().map_err(failed)?.len() > MOST_BYTES {
            return Err(Error::input(path, "is no scan: it is too long"));
        }
        let bytes = files::read(path)?;
        Self::from_json(&String::from_utf8_lossy(&bytes)).map_err(|what| Error::input(path, what))
    }

    /// Reads the text of a file; the error follows its name.
    ///
    /// # Errors
    /// A text that is no scan, or one of a newer version.
    pub fn from_json(text: &str) -> std::result::Result<Self, String> {
        let scan: Self = serde_json::from_str(text).map_err(|e| format!("is no scan: {e}"))?;
        let is_range = scan.range.is_none_or(|(lo, hi)| lo.is_finite() && hi.is_finite() && lo <= hi);
        match scan.schema == SCHEMA && is_range && scan.read[0] <= scan.read[1] && scan.read[1] <= scan.frames {
            true => Ok(scan),
            false if scan.schema > SCHEMA => {
                Err(format!("is a scan of version {}, newer than this program", scan.schema))
            }
            false => Err("is no scan: its numbers contradict each other".into()),
        }
    }

    /// The range of all samples; 0 to 0 if all are missing.
    ///
    /// # Errors
    /// The scan is of another archive, or of some of its frames; the message follows the scan's name.
    pub fn range_of(&self, archive: &Archive) -> std::result::Result<(f64, f64), String> {
        let own = (archive.grid.dims, archive.sample.to_string(), archive.frames);
        if own != (self.dims, self.sample.clone(), Some(self.frames)) {
            let [x, y, z] = self.dims;
            return Err(format!(
                "is a scan of {} frames of {x} x {y} x {z} {} samples, not of these",
                self.frames, self.sample
            ));
        }
        match self.read == [0, self.frames] {
            true => Ok(self.range.unwrap_or((0.0, 0.0))),
            false => {
                Err(format!("has read frames {}..{} alone: merge the scans of all shards", self.read[0], self.read[1]))
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shard(text: &str) -> Shard {
        text.parse().expect("a shard")
    }

    #[test]
    fn shards_are_whole_chains_that_cover_all_frames() {
        for (frames, of) in [(1000, 3), (256, 1), (512, 2), (4097, 16), (10_000, 39)] {
            let parts = (1..=of).map(|number| Shard { number, of }.frames(frames, 32, 8).expect("enough"));
            let mut at = 0;
            for part in parts {
                assert!(part.start == at && part.start % 256 == 0 && !part.is_empty(), "{part:?}");
                at = part.end;
            }
            assert_eq!(at, frames);
        }
        assert!(shard("1/5").frames(1024, 32, 8).is_err() && shard("1/4").frames(1024, 32, 8).is_ok());
    }

    #[test]
    fn other_texts_are_no_shards() {
        for text in ["", "1", "0/4", "5/4", "1/0", "a/b", "-1/4", "1/4/2"] {
            assert!(text.parse::<Shard>().is_err(), "{text}");
        }
        assert_eq!(shard("3/16").to_string(), "3/16");
    }

    fn scan(read: [usize; 2], range: Option<(f64, f64)>) -> ArchiveScan {
        ArchiveScan { schema: SCHEMA, dims: [4, 3, 2], sample: "f32".into(), frames: 10, read, range, missing: 1 }
    }

    #[test]
    fn scans_of_shards_are_merged_in_any_order() {
        let named = |parts: &[ArchiveScan]| {
            let named: Vec<_> = parts.iter().enumerate().map(|(n, part)| (format!("{n}.json"), part.clone())).collect();
            ArchiveScan::merged(&named)
        };
        let (a, b, c) = (scan([0, 4], Some((0.0, 2.0))), scan([4, 4], None), scan([4, 10], Some((-1.0, 1.0))));
        let merged = named(&[c.clone(), a.clone(), b.clone()]).expect("all frames");
        assert_eq!(merged, ArchiveScan { missing: 3, ..scan([0, 10], Some((-1.0, 2.0))) });
        assert_eq!(ArchiveScan::from_json(&merged.to_json()), Ok(merged));
        let words = |parts: &[ArchiveScan]| named(parts).expect_err("refused").to_string();
        assert!(words(&[a.clone(), b.clone()]).contains("4..10 are in no scan"));
        assert!(words(&[a.clone(), a.clone(), c.clone()]).contains("have both read"));
        assert!(words(&[a.clone(), scan([5, 10], None)]).contains("leave out frames 4..5"));
        assert!(words(&[a, ArchiveScan { frames: 11, ..c }]).contains("another archive"));
        for text in ["", "{}", "[]", "{\"schema\":1}", "nan"] {
            assert!(ArchiveScan::from_json(text).is_err(), "{text}");
        }
    }
}
