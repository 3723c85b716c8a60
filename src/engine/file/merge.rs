//! Shards of an archive, merged over time: the windows of one file after those of another. Blocks are copied as they are
//! stored, with new checksums; nothing is coded anew. The merged file has the bytes of one conversion.

mod to_file;

pub use to_file::Merged;

use super::CoefficientFile;
use super::shard::{SHARD, ShardRange, without_shard};
use serde::Serialize;
use std::collections::BTreeSet;
use std::io::Write;
use std::ops::Range;
use std::path::{Path, PathBuf};
use wavesplat_core::base::description::{Description, extended, joined};
use wavesplat_core::base::error::{Error, Result};
use wavesplat_core::base::progress::Progress;
use wavesplat_format::limits::MAX_WINDOW_FRAMES;
use wavesplat_format::{
    BlockEntry, BlockId, CompletePrefix, EncodedBlock, Features, LeafEntry, Metadata, Window, WindowEnd, WindowRecord,
    Writer,
};

/// The report of a merge.
#[derive(Debug, Clone, Default, Serialize)]
pub struct MergeReport {
    /// Shards.
    pub shards: usize,
    /// Frames of the merged file.
    pub frames: u64,
    /// Windows that an earlier run had merged.
    pub windows_before: usize,
    /// Blocks that were copied.
    pub blocks: u64,
    /// Blocks that are lost, since they or their shards are damaged or missing.
    pub blocks_lost: u64,
    /// Windows of shards that are missing or cannot be opened: all their blocks are lost.
    pub windows_lost: usize,
    /// Shards that cannot be opened.
    pub unreadable: Vec<PathBuf>,
    /// Bytes of the shards.
    pub input_bytes: u64,
    /// Bytes of the merged file.
    pub output_bytes: u64,
}

/// The part of a shard kept in memory. Its file is reopened when it is merged.
struct Part {
    pub path: PathBuf,
    place: ShardRange,
    windows: usize,
    bytes: u64,
}

/// Shards in order that make up a whole archive.
pub struct Shards {
    parts: Vec<Part>,
    /// The metadata of the merged file before its first frame.
    start: Metadata,
    features: Features,
    /// The digest of the first window; 0 if it is lost.
    first_digest: u64,
    description: Option<Description>,
    /// How to record lost windows, if any.
    lost: Option<LostWindows>,
    /// Shards that cannot be opened.
    unreadable: Vec<PathBuf>,
}

/// The facts that are known about the windows of missing shards: their number of frames, and the value range, which all
/// shards share.
#[derive(Debug, Clone, Copy)]
struct LostWindows {
    length: u32,
    range: (f64, f64),
}

impl Shards {
    /// Opens the shards of an archive, in any order, one at a time. With `skip_damaged`, shards may be missing or too damaged
    /// to be opened; without it they are an error.
    ///
    /// # Errors
    /// Files that are no shards, of another archive, made otherwise, missing, given twice or damaged; each is named.
    pub fn open(paths: &[PathBuf], skip_damaged: bool, progress: &dyn Progress) -> Result<Self> {
        progress.start(Some(paths.len() as u64));
        let (mut opened, mut unreadable) = (Vec::new(), Vec::new());
        for path in paths {
            progress.check()?;
            match Opened::open(path, opened.first()) {
                Ok(shard) => opened.push(shard),
                Err(Error::CoefficientFile { source, .. }) if skip_damaged && !source.is_io() => {
                    unreadable.push(path.clone());
                }
                Err(failed) => return Err(failed),
            }
            progress.advance(1);
        }
        progress.finish();
        opened.sort_by_key(|shard: &Opened| shard.part.place.number);
        check_order(&opened, skip_damaged)?;
        let none = || Error::setting("inputs", "no shard can be read");
        let lost = opened.first().ok_or_else(none)?.lost_windows(&opened)?;
        let shards = Self::in_order(opened, lost).ok_or_else(none)?;
        Ok(Self { unreadable, ..shards })
    }

    /// Opens the shards that follow a whole file without a gap. [`Self::merge`] appends their windows to the file's.
    ///
    /// # Errors
    /// As [`Self::open`], or the file is a shard itself.
    pub fn after(file: &CoefficientFile, paths: &[PathBuf], progress: &dyn Progress) -> Result<Self> {
        if super::setting(file.metadata(), SHARD).is_some() {
            return Err(Error::path(file.path(), "is a shard itself, and shards are merged"));
        }
        progress.start(Some(paths.len() as u64));
        let mut opened = Vec::new();
        let own = ShardRange { number: 0, of: 0, frames: 0..file.frames() as u64, all: 0 };
        let whole = Opened::at(own, file, None)?;
        for path in paths {
            progress.check()?;
            let shard = CoefficientFile::open(path)?;
            opened.push(Opened::at(ShardRange::from_file(&shard)?, &shard, Some(&whole))?);
            progress.advance(1);
        }
        progress.finish();
        opened.sort_by_key(|shard: &Opened| shard.part.place.number);
        check_order(&opened, true)?;
        opened.insert(0, whole);
        let shards = Self::in_order(opened, None).ok_or_else(|| Error::setting("inputs", "no shard can be read"))?;
        let gaps = shards.gaps().zip(&shards.parts).find(|(gap, _)| gap.start != gap.end);
        match gaps {
            Some((Range { start, end }, part)) => {
                Err(Error::path(&part.path, format!("begins at frame {end}, but frame {start} is next")))
            }
            None => Ok(shards),
        }
    }

    /// Shards in order.
    fn in_order(opened: Vec<Opened>, lost: Option<LostWindows>) -> Option<Self> {
        let Opened { part, start, features, first_digest, .. } = opened.first()?;
        let (start, features, all) = (start.clone(), *features, part.place.all);
        let first_digest = if part.place.frames.start == 0 { *first_digest } else { 0 };
        let (parts, descriptions): (Vec<_>, Vec<_>) =
            opened.into_iter().map(|shard| (shard.part, shard.description)).unzip();
        let mut descriptions = descriptions.into_iter().flatten();
        let first = descriptions.next();
        let rest: Vec<_> = descriptions.collect();
        let description = first.map(|first| match lost {
            None => joined(first, &rest).0,
            Some(_) => extended(first, all).0, // values of lost frames are in no shard
        });
        Some(Self { parts, start, features, first_digest, description, lost, unreadable: Vec::new() })
    }

    /// The frames that no shard has before each shard, and after the last.
    fn gaps(&self) -> impl Iterator<Item = Range<u64>> {
        let ends = std::iter::once(0).chain(self.parts.iter().map(|part| part.place.frames.end));
        let all = self.parts.last().map_or(0, |part| part.place.all);
        ends.zip(self.parts.iter().map(|part| part.place.frames.start).chain([all])).map(|(end, start)| end..start)
    }

    /// Writes the merged file to `out`, after the windows that it has `begun` with. With `skip_damaged`, damaged blocks are
    /// lost; without it they are an error. Messages call the new file `name`.
    ///
    /// # Errors
    /// A shard is damaged or has changed, the file was begun by other shards, or `out` cannot be written.
    pub fn merge(
        &self,
        begun: Option<CompletePrefix>,
        skip_damaged: bool,
        name: &Path,
        out: impl Write,
        progress: &dyn Progress,
    ) -> Result<MergeReport> {
        let failed = |source| Error::CoefficientFile { path: name.into(), source };
        let done = begun.as_ref().map_or(Vec::new(), |begun| begun.metadata().windows.clone());
        let id = self.start.file_id(self.first_digest, self.features).map_err(failed)?;
        let writer = match begun {
            Some(begun) if begun.id() != id => return Err(Error::path(name, "was begun by other shards")),
            Some(begun) => Writer::resume(out, begun),
            None => Writer::with_features(out, id, &self.start, self.features).map_err(failed)?,
        };
        let report = MergeReport { shards: self.parts.len(), windows_before: done.len(), ..MergeReport::default() };
        progress.start(Some(self.parts.iter().map(|part| part.windows as u64).sum()));
        progress.resume(done.len() as u64);
        let mut merger = Merger { writer, name, done, skip_damaged, report, next: 0 };
        for (gap, part) in self.gaps().zip(self.parts.iter().map(Some).chain([None])) {
            if let Some(lost) = self.lost {
                merger.add_lost(gap, lost, progress)?;
            }
            if let Some(part) = part {
                merger.add(part, progress)?;
            }
        }
        let Merger { writer, report, .. } = merger;
        let frames = writer.metadata().frames;
        let (mut out, summary) = writer.finish_described(self.description.as_ref()).map_err(failed)?;
        out.flush().map_err(|e| Error::io(name, "writing", e))?;
        progress.finish();
        let input_bytes = self.parts.iter().map(|part| part.bytes).sum();
        let unreadable = self.unreadable.clone();
        Ok(MergeReport { frames, input_bytes, output_bytes: summary.bytes, unreadable, ..report })
    }
}

/// A shard that was opened, and what all shards must share.
struct Opened {
    part: Part,
    start: Metadata,
    features: Features,
    first_digest: u64,
    description: Option<Description>,
    range: (f64, f64),
    has_times: bool,
}

/// The largest share of windows that may be lost: a forged shard may claim any number of frames.
const MOST_LOST: u64 = 64;

impl Opened {
    /// How to record the windows of missing shards; `None` if no shard is missing.
    fn lost_windows(&self, all: &[Self]) -> Result<Option<LostWindows>> {
        let held: u64 = all.iter().map(|shard| shard.part.place.frames.end - shard.part.place.frames.start).sum();
        let (path, missing) = (&self.part.path, self.part.place.all.saturating_sub(held));
        let length = super::setting(&self.start, "window").and_then(|window| window.parse().ok());
        let length = length.filter(|length| (1..=MAX_WINDOW_FRAMES).contains(length));
        match (missing, length) {
            (0, _) => Ok(None),
            (missing, _) if missing > held.saturating_mul(MOST_LOST) => {
                Err(Error::input(path, format!("shards with {missing} of {} frames are missing", missing + held)))
            }
            (missing, _) if self.has_times => {
                let what =
                    format!("shards with {missing} frames are missing, and no other shard knows the times of these");
                Err(Error::path(path, what))
            }
            (_, Some(length)) => Ok(Some(LostWindows { length, range: self.range })),
            (_, None) => Err(Error::input(path, "does not say how long its windows are, and shards are missing")),
        }
    }

    /// Opens a shard; an error unless it was made like the first one.
    fn open(path: &Path, first: Option<&Self>) -> Result<Self> {
        let file = CoefficientFile::open(path)?;
        Self::at(ShardRange::from_file(&file)?, &file, first)
    }

    /// A file with a known place; an error unless it was made like the first one.
    fn at(place: ShardRange, file: &CoefficientFile, first: Option<&Self>) -> Result<Self> {
        let (path, description, metadata) = (file.path(), file.description()?, file.metadata());
        let features = file.reader.features();
        let start = without_shard(metadata);
        if let Some(first) = first
            && let Some(what) =
                difference(&first.start, &start).or((first.features != features).then(|| "features".into()))
        {
            let other = first.part.path.display();
            return Err(Error::path(
                path,
                format!("is of another archive than {other}, or was made otherwise: {what}"),
            ));
        }
        let first_digest = metadata.windows.first().map_or(0, |window| window.digest);
        let part = Part { path: path.into(), windows: metadata.windows.len(), bytes: file.bytes(), place };
        let range = metadata.windows.first().map_or((f64::INFINITY, f64::NEG_INFINITY), |window| window.range);
        let has_times = !metadata.times.is_empty();
        Ok(Self { part, start, features, first_digest, description, range, has_times })
    }
}

/// What differs between two shards, in a few words.
fn difference(first: &Metadata, other: &Metadata) -> Option<String> {
    let setting = |(a, b): (&(String, String), &(String, String))| (a != b).then(|| a.0.clone());
    let differ = first.settings.iter().zip(&other.settings).find_map(setting);
    let named = [
        (first.dims != other.dims, "size"),
        (first.sample != other.sample, "type of samples"),
        (first.variable != other.variable, "variable"),
        (first.tolerance.to_bits() != other.tolerance.to_bits(), "tolerance"),
        (first.block_edge != other.block_edge, "block"),
        (first.program != other.program, "version of the program"),
    ];
    let named = named.into_iter().find(|(differs, _)| *differs).map(|(_, what)| what.to_string());
    named.or(differ).or((first != other).then(|| "settings".into()))
}

/// An error unless shards are all there, once each, with frames one after another. With `may_lack` some may be missing.
fn check_order(shards: &[Opened], may_lack: bool) -> Result<()> {
    let (mut before, mut end) = (0, 0);
    for (n, Opened { part: Part { path, place, .. }, .. }) in shards.iter().enumerate() {
        let first = &shards[0].part;
        if (place.of, place.all) != (first.place.of, first.place.all) {
            let what = format!("is one of {} shards, but {} of {}", place.of, first.path.display(), first.place.of);
            return Err(Error::path(path, what));
        }
        if let Some(twin) = n.checked_sub(1).map(|n| &shards[n].part).filter(|_| before == place.number) {
            return Err(Error::path(path, format!("is shard {}, as {} is", place.number, twin.path.display())));
        }
        let follows = place.number == before + 1;
        if !follows && !may_lack {
            return Err(Error::path(path, format!("shard {} of {} is missing before it", before + 1, place.of)));
        }
        if place.frames.start < end || follows && place.frames.start != end {
            return Err(Error::input(path, format!("begins at frame {}, not {end}", place.frames.start)));
        }
        (before, end) = (place.number, place.frames.end);
    }
    match shards.last().map(|shard| &shard.part) {
        Some(last) if before < last.place.of && !may_lack => {
            Err(Error::path(&last.path, format!("shard {} of {} is missing after it", before + 1, last.place.of)))
        }
        Some(last) if before == last.place.of && end != last.place.all => {
            Err(Error::input(&last.path, format!("ends at frame {end} of {}", last.place.all)))
        }
        _ => Ok(()),
    }
}

/// A merged file that is being written.
struct Merger<'a, W: Write> {
    writer: Writer<W>,
    name: &'a Path,
    /// The windows that an earlier run wrote.
    done: Vec<Window>,
    skip_damaged: bool,
    report: MergeReport,
    /// The number of the next window.
    next: usize,
}

impl<W: Write> Merger<'_, W> {
    /// Adds the windows of a shard.
    fn add(&mut self, part: &Part, progress: &dyn Progress) -> Result<()> {
        let first_window = self.next;
        self.next += part.windows;
        if self.next <= self.done.len() {
            return Ok(()); // the file's id and the order of shards say that they are these
        }
        let file = CoefficientFile::open(&part.path)?;
        if ShardRange::from_file(&file)? != part.place || file.bytes() != part.bytes {
            return Err(Error::changed(&part.path, "changed while it was merged"));
        }
        for window in 0..part.windows {
            if self.has(first_window + window, &file.metadata().windows[window], &part.path)? {
                continue;
            }
            progress.check()?;
            self.add_window(&file, window as u32, first_window + window, part.place.frames.start)?;
            progress.advance(1);
        }
        file.check_unchanged()
    }

    /// Adds lost windows for frames that are in no shard.
    fn add_lost(&mut self, frames: Range<u64>, lost: LostWindows, progress: &dyn Progress) -> Result<()> {
        for first in frames.clone().step_by(lost.length as usize) {
            progress.check()?;
            let length = u64::from(lost.length).min(frames.end - first) as u32;
            let window = Window { range: lost.range, ..Window::lost(first, length) };
            self.report.windows_lost += 1;
            let metadata = self.writer.metadata();
            self.report.blocks_lost += u64::from(metadata.blocks_per_channel(0)) * u64::from(metadata.channels);
            if !self.has(self.next, &window, Path::new("a missing shard"))? {
                self.add_lost_window(window)?;
            }
            self.next += 1;
        }
        Ok(())
    }

    fn add_lost_window(&mut self, window: Window) -> Result<()> {
        let number = self.next as u32;
        self.written(|writer| writer.begin_window(WindowRecord { number, window, times: Vec::new() }))?;
        let (channels, blocks) = (self.writer.metadata().channels, self.writer.metadata().blocks_per_channel(0));
        for id in (0..channels).flat_map(|channel| (0..blocks).map(move |block| BlockId::new(number, channel, block))) {
            self.report.blocks += 1;
            self.written(|writer| writer.append_lost(id))?;
        }
        self.written(|writer| writer.end_window(&WindowEnd::empty(number)))?;
        self.writer.out().flush().map_err(|e| Error::io(self.name, "writing", e))
    }

    /// Whether an earlier run wrote a window; an error if it wrote another.
    fn has(&self, number: usize, window: &Window, shard: &Path) -> Result<bool> {
        match self.done.get(number) {
            Some(known) if known.digest != window.digest => {
                Err(Error::path(self.name, format!("window {number} is not that of {}", shard.display())))
            }
            known => Ok(known.is_some()),
        }
    }

    /// Copies a window of a shard. In the merged file it has the number `number`, and its first frame is later by
    /// `frames`, the frames before the shard.
    fn add_window(&mut self, file: &CoefficientFile, window: u32, number: usize, frames: u64) -> Result<()> {
        let number = number as u32;
        let mut record = WindowRecord { number, ..file.metadata().window_record(window) };
        record.window.first_frame += frames;
        self.written(|writer| writer.begin_window(record))?;
        let (mut sums, mut lost) = (WindowEnd::empty(number), BTreeSet::new());
        for leaf in file.leaves(window) {
            for entry in self.entries(file, leaf)? {
                self.add_block(file, &entry, number, &mut lost, &mut sums)?;
            }
        }
        let WindowEnd { coded, outliers, .. } = sums; // fewer than in the shard if blocks are lost
        let end = WindowEnd { number, coded, outliers, ..file.metadata().window_end(window) };
        self.written(|writer| writer.end_window(&end))?;
        self.writer.out().flush().map_err(|e| Error::io(self.name, "writing", e))
    }

    /// The entries of a leaf; if it is damaged and may be, lost blocks.
    fn entries(&self, file: &CoefficientFile, leaf: &LeafEntry) -> Result<Vec<BlockEntry>> {
        match file.leaf(leaf) {
            Err(Error::CoefficientFile { source, .. }) if self.skip_damaged && !source.is_io() => {
                Ok(leaf.ids().map(BlockEntry::lost).collect())
            }
            entries => entries,
        }
    }

    /// Copies a block. Adds it to the `lost` blocks above others if it is one.
    fn add_block(
        &mut self,
        file: &CoefficientFile,
        entry: &BlockEntry,
        window: u32,
        lost: &mut BTreeSet<BlockId>,
        sums: &mut WindowEnd,
    ) -> Result<()> {
        let id = BlockId { window, ..entry.id };
        let begins_lost = entry.block_above(file.metadata()).is_some_and(|above| lost.contains(&above));
        let stored = if entry.lost || begins_lost { None } else { self.stored(file, entry)? };
        self.report.blocks += 1;
        match stored {
            Some(block) => {
                let block = EncodedBlock { id, ..block };
                sums.add(&block);
                self.written(|writer| writer.append(&block))
            }
            None => {
                if entry.id.tier > 0 {
                    lost.insert(entry.id);
                }
                self.report.blocks_lost += 1;
                self.written(|writer| writer.append_lost(id))
            }
        }
    }

    /// A block as it is stored; none if it is damaged and may be.
    fn stored(&self, file: &CoefficientFile, entry: &BlockEntry) -> Result<Option<EncodedBlock>> {
        match file.reader.stored(entry) {
            Ok(block) => Ok(Some(block)),
            Err(damaged) if self.skip_damaged && !damaged.is_io() => Ok(None),
            Err(damaged) => Err(file.failed(damaged)),
        }
    }

    fn written(&mut self, write: impl FnOnce(&mut Writer<W>) -> wavesplat_format::Result<()>) -> Result<()> {
        write(&mut self.writer).map_err(|source| Error::CoefficientFile { path: self.name.into(), source })
    }
}
