//! An open coefficient file: the format's reader over any storage, in this library's terms.

use crate::file::above::{AboveBlocks, bytes_above, most_within, nodes_above};
use crate::file::counted::Counted;
use crate::file::damage::Damage;
use crate::file::decoded::DecodedBlocks;
use crate::file::detail;
use crate::file::promise::{self, setting};
use crate::remote::{self, RemoteOptions};
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use wavesplat_core::base::address::{is_address, public_name};
use wavesplat_core::base::description::Description;
use wavesplat_core::base::error::{Error, Result};
use wavesplat_core::base::grid::{BlockGrid, Grid, Region};
use wavesplat_core::base::mapped::{Access, FileBytes, State};
use wavesplat_core::base::memory;
use wavesplat_core::base::sample::SampleType;
use wavesplat_core::base::time_labels::TimeLabels;
use wavesplat_core::codec::WindowCodec;
use wavesplat_core::codec::coarse;
use wavesplat_core::codec::decode::Block;
use wavesplat_core::source::{CHANNELS, ColourTransform, Units};
use wavesplat_format::{BlockEntry, BlockId, FileId, LeafEntry, Metadata, Reader, Storage, Window, from_bare};

/// An open coefficient file; several threads may read it. Clones share what is open.
#[derive(Debug, Clone)]
pub struct CoefficientFile {
    path: PathBuf,
    pub(super) reader: Arc<Reader<Counted>>,
    /// The state of a local file when it was opened.
    state: Option<State>,
    /// The lattice.
    pub grid: Grid,
    /// How it is cut into blocks.
    pub blocks: BlockGrid,
    /// The level of detail: the lattice has every 2^lod-th voxel along each axis.
    pub(super) lod: u32,
    /// The factor by which heights are multiplied.
    exaggeration: f64,
    /// What made samples into channels, if there are several.
    colour_transform: Option<ColourTransform>,
    /// Damaged blocks that are taken for missing samples, if they are.
    pub(super) skipped: Option<Arc<Damage>>,
    /// Decoded blocks of tiers above 0. They are dropped before `kept`, which returns the memory of all to the system.
    pub(super) above: Arc<AboveBlocks>,
    /// Decoded blocks that are kept, if there is room for some.
    pub(super) kept: Option<Arc<DecodedBlocks>>,
}

impl CoefficientFile {
    /// Opens a local file through a memory map.
    ///
    /// Checks header, footer, metadata and directory, but not the blocks.
    ///
    /// # Errors
    /// [`Error::Io`] if the file cannot be read, [`Error::CoefficientFile`] if it is damaged, unfinished or no coefficient
    /// file.
    pub fn open(path: impl AsRef<Path>) -> Result<Self> {
        Self::open_with(path, Access::Map)
    }

    /// As [`Self::open`], with a choice between a memory map and plain reads.
    pub fn open_with(path: impl AsRef<Path>, access: Access) -> Result<Self> {
        if is_address(path.as_ref()) {
            return Self::open_remote(path.as_ref(), &RemoteOptions::default());
        }
        let bytes = FileBytes::open(path.as_ref(), access)?;
        let state = Some(bytes.state());
        Ok(Self { state, ..Self::from_storage(path.as_ref(), bytes)? })
    }

    /// Opens a remote file by its address: `https://HOST/PATH`, `http://HOST/PATH` or `s3://BUCKET/KEY`. As a rule this takes
    /// two requests. Messages show the address without passwords and signatures.
    ///
    /// # Errors
    /// As [`Self::open`], and all that can be wrong on the way.
    pub fn open_remote(address: &Path, options: &RemoteOptions) -> Result<Self> {
        Self::from_kept(public_name(address), Box::new(remote::open(address, options)?))
    }

    /// Opens a file in any storage: memory, or bytes far away. `name` stands for it in messages. What is read of a
    /// [remote](Storage::is_remote) storage is kept, up to 64 MiB.
    ///
    /// # Errors
    /// As [`Self::open`].
    pub fn from_storage(name: impl Into<PathBuf>, storage: impl Storage + Send + Sync + 'static) -> Result<Self> {
        Self::from_kept(name.into(), remote::kept(Box::new(storage)))
    }

    /// Opens the [bare stream](wavesplat_format::from_bare) at the start of `bytes` as a file in memory. Returns the bytes after
    /// it, too.
    ///
    /// # Errors
    /// The stream is damaged, or none.
    pub fn from_bare(name: impl Into<PathBuf>, bytes: &[u8]) -> Result<(Self, &[u8])> {
        let name = name.into();
        let made = from_bare(bytes).map_err(|source| Error::CoefficientFile { path: name.clone(), source });
        let (file, rest) = made?;
        Ok((Self::from_storage(name, file)?, rest))
    }

    /// Opens a file in a storage that keeps what was read, if it is remote.
    fn from_kept(path: PathBuf, storage: Box<dyn Storage + Send + Sync>) -> Result<Self> {
        let failed = |source| Error::CoefficientFile { path: path.clone(), source };
        let storage = Counted::new(storage);
        let ends = [0..1, storage.len().saturating_sub(tail(storage.len()))..storage.len()];
        storage.fetch(&ends).map_err(|e| failed(e.into()))?;
        let reader = Reader::open(storage).map_err(failed)?;
        let m = reader.metadata();
        let (grid, blocks) = detail::whole(m);
        let colour_transform = colour_transform(m).map_err(failed)?;
        let above = Arc::new(AboveBlocks::new(most_within(memory::DEFAULT, bytes_above(m), 0)));
        Ok(Self {
            path,
            grid,
            blocks,
            lod: 0,
            exaggeration: 1.0,
            colour_transform,
            reader: reader.into(),
            state: None,
            skipped: None,
            kept: None,
            above,
        })
    }

    /// The file as a coarser lattice: every 2^lod-th voxel along each axis, with all frames and the same first voxel.
    /// Decoding reads the coarse levels alone, so it takes about 8^lod times less work and fewer bytes. Samples are those
    /// of the file; what lies between them is left out.
    ///
    /// # Errors
    /// [`Error::Setting`] if blocks do not begin on the lattice, or a window's pyramid does not refine all three axes.
    pub fn with_detail(mut self, lod: u32) -> Result<Self> {
        let (grid, blocks) = detail::coarse(self.metadata(), lod)?;
        (self.grid, self.blocks, self.lod) = (grid.exaggerated(self.exaggeration), blocks, lod);
        Ok(self)
    }

    /// The coarsest level of detail that [`Self::with_detail`] takes.
    pub fn coarsest_detail(&self) -> u32 {
        (0..32).take_while(|lod| detail::coarse(self.metadata(), *lod).is_ok()).last().unwrap_or(0)
    }

    /// The lattice of all voxels, whatever the level of detail.
    pub fn whole_grid(&self) -> Grid {
        detail::whole(self.metadata()).0.exaggerated(self.exaggeration)
    }

    /// The file with heights multiplied by a factor, finite and positive, for pictures of volumes that are nearly flat.
    pub fn with_exaggeration(mut self, factor: f64) -> Self {
        self.grid = self.grid.exaggerated(factor);
        self.exaggeration *= factor;
        self
    }

    /// The level of detail of [`Self::with_detail`]; 0 for all voxels.
    pub fn lod(&self) -> u32 {
        self.lod
    }

    /// Its path, or the name of its storage.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Its identity.
    pub fn id(&self) -> FileId {
        self.reader.id()
    }

    /// The version of the format that a reader needs, such as 1.2.
    pub fn format_version(&self) -> String {
        let (major, minor) = self.reader.features().version();
        format!("{major}.{minor}")
    }

    /// Its length in bytes.
    pub fn bytes(&self) -> u64 {
        self.reader.storage().len()
    }

    /// All its bytes.
    ///
    /// # Errors
    /// They cannot be read.
    pub fn stored(&self) -> Result<Vec<u8>> {
        let mut all = vec![0; usize::try_from(self.bytes()).unwrap_or(usize::MAX)];
        let read = self.reader.storage().read_at(0, &mut all);
        read.map(|()| all).map_err(|e| Error::CoefficientFile { path: self.path.clone(), source: e.into() })
    }

    /// The source's description; `None` if the file has none.
    ///
    /// # Errors
    /// The description is damaged, or cannot be read.
    pub fn description(&self) -> Result<Option<Description>> {
        self.reader.description().map_err(|source| Error::CoefficientFile { path: self.path.clone(), source })
    }

    /// Everything about the archive but its samples.
    pub fn metadata(&self) -> &Metadata {
        self.reader.metadata()
    }

    /// The type of the samples.
    pub fn sample(&self) -> SampleType {
        self.metadata().sample
    }

    /// Number of channels: 1, or of colours 3.
    pub fn channels(&self) -> usize {
        self.metadata().channels.into()
    }

    /// What made the samples of the source into the file's channels, if it holds colours.
    pub fn colour_transform(&self) -> Option<&ColourTransform> {
        self.colour_transform.as_ref()
    }

    /// The type of the source's samples, and what stands for a missing one.
    #[doc(hidden)]
    pub fn of_source(&self) -> (SampleType, Option<f64>) {
        let plain = (self.sample(), self.metadata().missing_value);
        self.colour_transform
            .as_ref()
            .map_or(plain, |colour_transform| (colour_transform.sample, colour_transform.missing_value))
    }

    /// Number of frames.
    pub fn frames(&self) -> usize {
        self.metadata().frames as usize
    }

    /// Range of the decoded samples of all windows; (0, 0) if all are missing.
    pub fn value_range(&self) -> (f64, f64) {
        promise::value_range(self.metadata())
    }

    /// The value range, clamped to the range that shares refer to: decoded samples may exceed the source's.
    #[doc(hidden)]
    pub fn source_range(&self) -> (f64, f64) {
        let ((lo, hi), (least, most)) = (self.value_range(), promise::range_of_shares(self.metadata()));
        if least <= most { (lo.max(least).min(most), hi.min(most).max(least)) } else { (lo, hi) }
    }

    /// The number of samples or coefficients, whichever is larger, of the largest block.
    #[doc(hidden)]
    pub fn largest_block(&self) -> usize {
        let windows = &self.metadata().windows;
        let longest = windows.iter().map(|w| w.coefficients.max(w.frames) as usize).max().unwrap_or(0);
        self.blocks.region(0).voxels() * longest
    }

    /// The codes of the largest block, ghost nodes included, whatever the level of detail.
    pub(crate) fn most_codes(&self) -> usize {
        nodes_above(detail::whole(self.metadata()).1) * self.most_coefficients()
    }

    /// The most coefficients of a voxel.
    pub(crate) fn most_coefficients(&self) -> usize {
        self.metadata().windows.iter().map(|window| window.coefficients as usize).max().unwrap_or(0)
    }

    /// Bytes of a decoded coefficient.
    pub(crate) fn coefficient_size(&self) -> usize {
        self.metadata().windows.iter().map(Window::coefficient_size).max().unwrap_or(0)
    }

    /// Bytes of memory to read and refine the largest block: payload, codes, coefficients, the mask of missing samples,
    /// and exactly stored samples.
    pub fn block_bytes(&self) -> usize {
        let payload = 5;
        let refined = payload + size_of::<i32>() + self.coefficient_size();
        let unshifted = if self.metadata().keep().sum { 2 } else { 0 }; // a quarter of the samples, in lists that grow
        self.largest_block() * (refined + 1 + self.sample().size() + unshifted) + self.bytes_to_begin(refined)
    }

    /// The window that holds a frame; the last one for frames past the end.
    pub fn window_of(&self, frame: usize) -> u32 {
        self.metadata().windows.partition_point(|w| w.first_frame as usize <= frame) as u32 - 1
    }

    /// The frames of a window.
    pub fn window_range(&self, window: u32) -> Range<usize> {
        let w = &self.metadata().windows[window as usize];
        w.first_frame as usize..w.first_frame as usize + w.frames as usize
    }

    /// The codec that decodes a window's blocks.
    #[doc(hidden)]
    pub fn codec(&self, window: u32) -> Result<WindowCodec> {
        Ok(WindowCodec { lod: self.lod, ..self.codec_of_all(window)? })
    }

    /// As [`Self::codec`], for all voxels.
    fn codec_of_all(&self, window: u32) -> Result<WindowCodec> {
        WindowCodec::from_metadata(self.metadata(), &self.metadata().windows[window as usize])
            .map_err(|e| self.failed(e))
    }

    /// The directory's leaves of a window, of all channels.
    #[doc(hidden)]
    pub fn leaves(&self, window: u32) -> &[LeafEntry] {
        self.reader.leaves(window)
    }

    /// The directory's leaves of one channel of a window.
    pub(crate) fn leaves_of(&self, window: u32, channel: usize) -> &[LeafEntry] {
        self.reader.leaves_of(window, 0, channel as u16)
    }

    /// The entries of a leaf's blocks.
    #[doc(hidden)]
    pub fn leaf(&self, leaf: &LeafEntry) -> Result<Vec<BlockEntry>> {
        let Some(skipped) = self.skipped() else { return self.reader.leaf(leaf).map_err(|e| self.failed(e)) };
        let is_lost = |id: &BlockId| skipped.has(*id);
        if leaf.ids().all(|id| is_lost(&id)) {
            return Ok(leaf.ids().map(BlockEntry::lost).collect());
        }
        let entries = self.reader.leaf(leaf).map_err(|e| self.failed(e))?.into_iter();
        Ok(entries.map(|entry| if is_lost(&entry.id) { BlockEntry::lost(entry.id) } else { entry }).collect())
    }

    /// The entries of the blocks of a channel and window that touch a region, in order, a leaf of the directory at a time.
    #[doc(hidden)]
    pub fn entries<'a>(
        &'a self,
        window: u32,
        channel: usize,
        region: &'a Region,
    ) -> impl Iterator<Item = Result<Vec<BlockEntry>>> + use<'a> {
        let fetched = self.fetch_leaves_of(std::iter::once(window), channel, region);
        let entries = move |leaf| {
            let touches = |entry: &BlockEntry| self.touches(entry.id.block, region);
            Ok(self.kept_leaf(leaf)?.iter().filter(|entry| touches(entry)).cloned().collect())
        };
        fetched.err().map(Err).into_iter().chain(self.reached(window, channel, region).map(entries))
    }

    /// The leaves of a channel and window that list blocks of a region.
    pub(super) fn reached<'a>(
        &'a self,
        window: u32,
        channel: usize,
        region: &'a Region,
    ) -> impl Iterator<Item = &'a LeafEntry> + use<'a> {
        let lists =
            move |l: &&LeafEntry| (l.first_block..).take(l.count.into()).any(|block| self.touches(block, region));
        self.leaves_of(window, channel).iter().filter(lists)
    }

    fn touches(&self, block: u32, region: &Region) -> bool {
        !self.blocks.region(block as usize).intersect(region).is_empty()
    }

    /// Whether samples keep their sides of some values at the level of detail.
    pub fn keeps_sides(&self) -> bool {
        self.lod == 0 && !self.metadata().keep().sides.is_empty()
    }

    /// Reads the block of a directory entry; only the coefficients that `wanted` marks.
    #[doc(hidden)]
    pub fn block(&self, codec: &WindowCodec, entry: &BlockEntry, wanted: &[bool]) -> Result<Block> {
        let size = self.all_voxels(entry)?;
        if let Some(skipped) = self.skipped.as_ref().filter(|_| entry.lost) {
            skipped.meet(entry.id);
            return Ok(Block::missing(codec, size));
        }
        let all = codec.decodes_sides(entry).then(|| vec![true; codec.basis.coefficients()]);
        let wanted = all.as_deref().unwrap_or(wanted);
        let above = if entry.begins_above(codec.tiers()) { self.above(codec, entry.id, wanted)? } else { None };
        Block::read(&self.reader, codec, entry, size, wanted, None, above).map_err(|e| self.failed(e))
    }

    /// All voxels of a block, decoded or not.
    pub(super) fn all_voxels(&self, entry: &BlockEntry) -> Result<[usize; 3]> {
        self.reader.geometry(entry.id).map(|of| of.size).map_err(|e| self.failed(e))
    }

    /// The codec for [`Self::coarse`] of every `stride`-th voxel.
    pub(crate) fn coarse_codec(&self, window: u32, stride: usize) -> Result<WindowCodec> {
        let refined = detail::refines_space(&self.metadata().windows[window as usize]);
        let codec = self.codec_of_all(window)?;
        // Blocks must begin on the lattice of those above.
        let on_lattice = if codec.tiers() > 0 { self.metadata().block_edge.trailing_zeros() } else { u32::MAX };
        let lod = if refined { coarse::level_of(&codec, stride << self.lod).min(on_lattice) } else { 0 };
        Ok(WindowCodec { lod, ..codec })
    }

    /// Every n-th sample along each axis of a block, in some frames of its window: frame after frame, x
    /// fastest. NaN stands for missing samples, and for those of lost and damaged blocks that are skipped.
    pub(crate) fn coarse(
        &self,
        codec: &WindowCodec,
        entry: &BlockEntry,
        stride: usize,
        frames: &[usize],
    ) -> Result<Vec<f32>> {
        let (size, stride) = (self.all_voxels(entry)?, stride << self.lod);
        coarse::thinned(codec, entry, size, stride, frames, |wanted| self.block(codec, entry, wanted))
    }

    /// Bytes of the file that were read so far.
    pub fn bytes_read(&self) -> u64 {
        self.reader.storage().bytes_read()
    }

    /// An error if a local file has changed since it was opened. Other storages report changes as they are read.
    pub fn check_unchanged(&self) -> Result<()> {
        self.state.map_or(Ok(()), |state| state.check_path(&self.path))
    }

    /// The error of a file whose parts contradict each other.
    pub(crate) fn contradiction(&self, what: String) -> Error {
        self.failed(wavesplat_format::Error::Invalid(what))
    }

    pub(super) fn failed(&self, source: wavesplat_format::Error) -> Error {
        Error::CoefficientFile { path: self.path.clone(), source }
    }
}

/// Bytes at the end of a file of `len` bytes that likely hold its metadata and the root of its directory.
fn tail(len: u64) -> u64 {
    (len / 512).clamp(64 << 10, 4 << 20)
}

/// The units of a file's samples, times and places, and the calendar of its times.
pub fn units(file: &Metadata) -> Units {
    let text = |name| setting(file, name).map(String::from);
    let [samples, times, space, calendar] = Units::SETTINGS.map(text);
    Units { samples, times, space, calendar }
}

/// The times of a file's frames, and how they are written.
pub fn time_labels(file: &Metadata) -> TimeLabels {
    TimeLabels::new(file.times.clone(), setting(file, "time-units"), setting(file, "calendar"))
}

/// The transform from samples to the file's channels; an error if the file has several channels and does not state a
/// transform.
fn colour_transform(m: &Metadata) -> std::result::Result<Option<ColourTransform>, wavesplat_format::Error> {
    if m.channels == 1 {
        return Ok(None);
    }
    let coloured = usize::from(m.channels) == CHANNELS.len() && m.sample == ColourTransform::SAMPLE;
    let colour_transform = if coloured && m.missing_value.is_none() {
        ColourTransform::of_settings(|name| setting(m, name))
    } else {
        None
    };
    let unsupported = || wavesplat_format::Error::Unsupported(format!("{} channels of no known colours", m.channels));
    colour_transform.map(Some).ok_or_else(unsupported)
}
