//! Shards of an archive, merged over time: the windows of one file after those of another. Blocks are copied as they are
//! stored, with new checksums; nothing is coded anew. The merged file has the bytes of one conversion.

use super::CoefficientFile;
use crate::base::description::{Description, joined};
use crate::base::error::{Error, Result};
use crate::base::progress::Progress;
use serde::Serialize;
use std::io::Write;
use std::ops::Range;
use std::path::{Path, PathBuf};
use wavesplat_format::{
    BlockEntry, BlockId, CompletePrefix, EncodedBlock, Features, LeafEntry, Metadata, Window, WindowEnd, WindowRecord,
    Writer,
};

/// The settings of a shard: which of how many it is, and its frames of how many.
pub(crate) const SHARD: &str = "shard";
pub(crate) const SHARD_OF: &str = "shard-of";

/// What was merged.
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
    /// Blocks that are lost, since they are damaged.
    pub blocks_lost: u64,
    /// Bytes of the shards.
    pub input_bytes: u64,
    /// Bytes of the merged file.
    pub output_bytes: u64,
}

/// The place of a shard, as its settings say it.
#[derive(Debug, Clone, PartialEq, Eq)]
struct Place {
    number: usize,
    of: usize,
    frames: Range<u64>,
    all: u64,
}

impl Place {
    fn of(file: &CoefficientFile) -> Result<Self> {
        let named = |name| super::setting(file.metadata(), name);
        let place = named(SHARD).zip(named(SHARD_OF)).and_then(|(shard, frames)| {
            let (number, of) = shard.split_once('/')?;
            let (frames, all) = frames.split_once('/')?;
            let (start, end) = frames.split_once(':')?;
            let frames = start.parse().ok()?..end.parse().ok()?;
            Some(Self { number: number.parse().ok()?, of: of.parse().ok()?, frames, all: all.parse().ok()? })
        });
        let place = place.ok_or_else(|| Error::path(file.path(), "is no shard of an archive"))?;
        let frames = file.frames() as u64;
        match place.frames.end.checked_sub(place.frames.start) == Some(frames) {
            true => Ok(place),
            false => Err(Error::input(file.path(), format!("has {frames} frames, which are not those of its shard"))),
        }
    }
}

/// What of a shard stays in memory: the file is opened again when its turn comes.
struct Part {
    path: PathBuf,
    place: Place,
    windows: usize,
    bytes: u64,
}

/// Shards in order that make up a whole archive.
pub struct Shards {
    parts: Vec<Part>,
    /// The metadata of the merged file before its first frame.
    start: Metadata,
    features: Features,
    first_digest: u64,
    description: Option<Description>,
}

impl Shards {
    /// Opens the shards of an archive, in any order, one at a time.
    ///
    /// # Errors
    /// Files that are no shards, of another archive, made otherwise, missing, given twice or damaged; each is named.
    pub fn open(paths: &[PathBuf], progress: &dyn Progress) -> Result<Self> {
        progress.start(Some(paths.len() as u64));
        let mut opened = Vec::new();
        for path in paths {
            progress.check()?;
            opened.push(Opened::of(path, opened.first())?);
            progress.advance(1);
        }
        progress.finish();
        opened.sort_by_key(|shard: &Opened| shard.part.place.number);
        check_order(&opened)?;
        Self::of(opened).ok_or_else(|| Error::setting("inputs", "no shard was given"))
    }

    /// Shards in order.
    fn of(opened: Vec<Opened>) -> Option<Self> {
        let Opened { start, features, first_digest, .. } = opened.first()?;
        let (start, features, first_digest) = (start.clone(), *features, *first_digest);
        let (parts, descriptions): (Vec<_>, Vec<_>) =
            opened.into_iter().map(|shard| (shard.part, shard.description)).unzip();
        let mut descriptions = descriptions.into_iter().flatten();
        let first = descriptions.next();
        let rest: Vec<_> = descriptions.collect();
        let description = first.map(|first| joined(first, &rest).0);
        Some(Self { parts, start, features, first_digest, description })
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
        (name, out): (&Path, impl Write),
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
        let mut merger = Merger { writer, name, done, skip_damaged, report };
        let mut first_window = 0;
        for part in &self.parts {
            merger.add(part, first_window, progress)?;
            first_window += part.windows;
        }
        let Merger { writer, report, .. } = merger;
        let frames = writer.metadata().frames;
        let (mut out, summary) = writer.finish_described(self.description.as_ref()).map_err(failed)?;
        out.flush().map_err(|e| Error::io(name, "writing", e))?;
        progress.finish();
        let input_bytes = self.parts.iter().map(|part| part.bytes).sum();
        Ok(MergeReport { frames, input_bytes, output_bytes: summary.bytes, ..report })
    }
}

/// A shard that was opened, and what all shards must share.
struct Opened {
    part: Part,
    start: Metadata,
    features: Features,
    first_digest: u64,
    description: Option<Description>,
}

impl Opened {
    /// Opens a shard; an error unless it was made like the first one.
    fn of(path: &Path, first: Option<&Self>) -> Result<Self> {
        let file = CoefficientFile::open(path)?;
        let (place, description, metadata) = (Place::of(&file)?, file.description()?, file.metadata());
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
        Ok(Self { part, start, features, first_digest, description })
    }
}

/// Where a file stands in its archive.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Standing {
    /// The same for all shards of an archive, and for the merged file.
    pub archive: String,
    /// The frames of the archive that the file holds.
    pub frames: Range<usize>,
    /// Frames of the archive.
    pub all: usize,
}

impl Standing {
    /// Of a shard, or of a file that is a whole archive.
    ///
    /// # Errors
    /// A shard that contradicts itself.
    pub fn of(file: &CoefficientFile) -> Result<Self> {
        let metadata = file.metadata();
        let id = without_shard(metadata).file_id(0, file.reader.features()).map_err(|e| file.failed(e))?;
        let (frames, all) = match super::setting(metadata, SHARD) {
            Some(_) => {
                let Place { frames, all, .. } = Place::of(file)?;
                (frames.start as usize..frames.end as usize, all as usize)
            }
            None => (0..file.frames(), file.frames()),
        };
        if frames.end > all {
            return Err(Error::input(file.path(), format!("ends at frame {} of {all}", frames.end)));
        }
        Ok(Self { archive: id.to_string(), frames, all })
    }

    /// Whether the file is a shard of a longer archive.
    pub fn is_part(&self) -> bool {
        self.frames != (0..self.all)
    }
}

/// The metadata that shards share: what one conversion would begin with.
fn without_shard(of: &Metadata) -> Metadata {
    let mut start = of.start();
    start.settings.retain(|(name, _)| name != SHARD && name != SHARD_OF);
    start
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

/// An error unless shards are all there, once each, with frames one after another.
fn check_order(shards: &[Opened]) -> Result<()> {
    let mut end = 0;
    for (n, Opened { part: Part { path, place, .. }, .. }) in shards.iter().enumerate() {
        let first = &shards[0].part;
        if (place.of, place.all) != (first.place.of, first.place.all) {
            let what = format!("is one of {} shards, but {} of {}", place.of, first.path.display(), first.place.of);
            return Err(Error::path(path, what));
        }
        if let Some(before) = n.checked_sub(1).map(|n| &shards[n].part).filter(|b| b.place.number == place.number) {
            return Err(Error::path(path, format!("is shard {}, as {} is", place.number, before.path.display())));
        }
        if place.number != n + 1 {
            return Err(Error::path(path, format!("shard {} of {} is missing before it", n + 1, place.of)));
        }
        if place.frames.start != end {
            return Err(Error::input(path, format!("begins at frame {}, not {end}", place.frames.start)));
        }
        end = place.frames.end;
    }
    match shards.last().map(|shard| &shard.part) {
        Some(last) if shards.len() < last.place.of => {
            let (next, of) = (shards.len() + 1, last.place.of);
            Err(Error::path(&last.path, format!("shard {next} of {of} is missing after it")))
        }
        Some(last) if end != last.place.all => {
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
}

impl<W: Write> Merger<'_, W> {
    /// Adds the windows of a shard, the first of which has this number.
    fn add(&mut self, part: &Part, first_window: usize, progress: &dyn Progress) -> Result<()> {
        if first_window + part.windows <= self.done.len() {
            return Ok(()); // the file's id and the order of shards say that they are these
        }
        let file = CoefficientFile::open(&part.path)?;
        if Place::of(&file)? != part.place || file.bytes() != part.bytes {
            return Err(Error::changed(&part.path, "changed while it was merged"));
        }
        for window in 0..part.windows {
            if self.has(first_window + window, &file.metadata().windows[window], &part.path)? {
                continue;
            }
            progress.check()?;
            self.add_window(&file, window as u32, (first_window + window, part.place.frames.start))?;
            progress.advance(1);
        }
        file.check_unchanged()
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

    /// Copies a window of a shard, which gets a number and later frames.
    fn add_window(&mut self, file: &CoefficientFile, window: u32, (number, frames): (usize, u64)) -> Result<()> {
        let number = number as u32;
        let mut record = WindowRecord { number, ..file.metadata().window_record(window) };
        record.window.first_frame += frames;
        self.written(|writer| writer.begin_window(record))?;
        let mut sums = WindowEnd::empty(number);
        for leaf in file.leaves(window) {
            for entry in self.entries(file, leaf)? {
                self.add_block(file, &entry, number, &mut sums)?;
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

    fn add_block(
        &mut self,
        file: &CoefficientFile,
        entry: &BlockEntry,
        window: u32,
        sums: &mut WindowEnd,
    ) -> Result<()> {
        let id = BlockId { window, ..entry.id };
        let stored = if entry.lost { None } else { self.stored(file, entry)? };
        self.report.blocks += 1;
        match stored {
            Some(block) => {
                let block = EncodedBlock { id, ..block };
                sums.add(&block);
                self.written(|writer| writer.append(&block))
            }
            None => {
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
