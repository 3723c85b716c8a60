//! The place of a file in its archive: stated by the settings of a shard; any other file is the whole archive.

use super::CoefficientFile;
use std::ops::Range;
use wavesplat_core::base::error::{Error, Result};
use wavesplat_format::Metadata;

/// The settings of a shard: its number and the number of shards; its frames and the number of frames of the archive.
pub(crate) const SHARD: &str = "shard";
pub(crate) const SHARD_OF: &str = "shard-of";

/// The number of a shard and its frames, read from its settings.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct ShardRange {
    pub(super) number: usize,
    pub(super) of: usize,
    pub(super) frames: Range<u64>,
    pub(super) all: u64,
}

impl ShardRange {
    pub(super) fn from_file(file: &CoefficientFile) -> Result<Self> {
        let named = |name| super::setting(file.metadata(), name);
        let place = named(SHARD).zip(named(SHARD_OF)).and_then(|(shard, frames)| {
            let (number, of) = shard.split_once('/')?;
            let (frames, all) = frames.split_once('/')?;
            let (start, end) = frames.split_once(':')?;
            let frames = start.parse().ok()?..end.parse().ok()?;
            Some(Self { number: number.parse().ok()?, of: of.parse().ok()?, frames, all: all.parse().ok()? })
        });
        let possible = |place: &Self| (1..=place.of).contains(&place.number) && place.frames.end <= place.all;
        let place = place.filter(possible);
        let place = place.ok_or_else(|| Error::path(file.path(), "is no shard of an archive"))?;
        let frames = file.frames() as u64;
        match place.frames.end.checked_sub(place.frames.start) == Some(frames) {
            true => Ok(place),
            false => Err(Error::input(file.path(), format!("has {frames} frames, which are not those of its shard"))),
        }
    }
}

/// The frames of a shard, and how many its archive has; none of other files.
pub fn frames_of_shard(file: &CoefficientFile) -> Option<(Range<u64>, u64)> {
    ShardRange::from_file(file).ok().map(|place| (place.frames, place.all))
}

/// Where a file stands in its archive.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ShardPlace {
    /// The same for all shards of an archive, and for the merged file.
    pub archive: String,
    /// The frames of the archive that the file holds.
    pub frames: Range<usize>,
    /// Frames of the archive.
    pub all: usize,
}

impl ShardPlace {
    /// The place of a shard, or of a file that is a whole archive.
    ///
    /// # Errors
    /// A shard that contradicts itself.
    pub fn from_file(file: &CoefficientFile) -> Result<Self> {
        let metadata = file.metadata();
        let id = without_shard(metadata).file_id(0, file.reader.features()).map_err(|e| file.failed(e))?;
        let (frames, all) = match super::setting(metadata, SHARD) {
            Some(_) => {
                let ShardRange { frames, all, .. } = ShardRange::from_file(file)?;
                (frames.start as usize..frames.end as usize, all as usize)
            }
            None => (0..file.frames(), file.frames()),
        };
        if frames.end > all {
            return Err(Error::input(file.path(), format!("ends at frame {} of {all}", frames.end)));
        }
        Ok(Self { archive: id.to_string(), frames, all })
    }
}

/// The metadata that shards share: those with which one conversion would begin.
pub(super) fn without_shard(of: &Metadata) -> Metadata {
    let mut start = of.start();
    start.settings.retain(|(name, _)| name != SHARD && name != SHARD_OF);
    start
}
