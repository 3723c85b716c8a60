//! Decoding blocks of a file that keeps some decoded.

use super::coefficient_file::CoefficientFile;
use super::decoded::{BlockValues, DecodedBlock, DecodedBlocks, DecodedForm, DecodedKey, FramesRead, PartsRead, Rank};
use std::ops::Range;
use std::sync::Arc;
use wavesplat_core::base::error::Result;
use wavesplat_core::base::grid::Region;
use wavesplat_core::codec::WindowCodec;
use wavesplat_core::codec::buffer::Buffer;
use wavesplat_core::codec::decode::{Block, WantedFrames};
use wavesplat_core::codec::part::{decoded_together, is_divisible};
use wavesplat_format::BlockEntry;

/// A small part takes the time of at most one voxel in so many of a block.
const SMALL: usize = 4;

/// A tiny part takes the time of at most one in so many: it is decoded from coefficients even if its block is read often.
const TINY: usize = 64;

/// Values are few if coefficients take this many times their bytes.
const FEW_VALUES: usize = 4;

/// Frames of a picture, counted from the first of their window.
#[derive(Debug, Clone, Copy)]
pub(crate) struct FramesDrawn<'a> {
    pub(crate) frames: &'a [usize],
    /// Whether coefficients are added one by one, which rounds otherwise than the inverse transform.
    pub(crate) by_coefficients: bool,
}

/// Samples of a block.
pub struct SamplesOfBlock {
    /// `frame * voxels + voxel`.
    pub samples: Arc<Buffer<u8>>,
    /// The number of the first frame in its window.
    pub first: usize,
    /// The stored bytes read.
    pub bytes_read: u64,
}

impl CoefficientFile {
    /// The file with up to so many bytes of blocks that stay decoded for later pictures and reads. Clones share them.
    pub fn keeping_decoded(mut self, bytes: usize) -> Self {
        self.kept = (bytes > 0).then(|| Arc::new(DecodedBlocks::new(bytes)));
        self
    }

    /// Whether blocks stay decoded.
    pub fn keeps_decoded(&self) -> bool {
        self.kept.is_some()
    }

    /// Begins a picture or a read of samples, which uses blocks that earlier ones decoded.
    pub fn begin_run(&self) {
        self.kept.iter().for_each(|kept| kept.begin_run(Rank::Now));
    }

    /// Begins a picture that is drawn before a user asks for it. It replaces no block that is kept.
    pub fn begin_run_ahead(&self) {
        self.kept.iter().for_each(|kept| kept.begin_run(Rank::Ahead));
    }

    /// A block with the coefficients that are marked, if they have to be decoded together and `has_field` asks for them. Uses codes that
    /// were unpacked, and keeps them if `keeps`.
    pub(crate) fn decoded(
        &self,
        codec: &WindowCodec,
        entry: &BlockEntry,
        wanted: &[bool],
        has_field: bool,
        keeps: bool,
    ) -> Result<DecodedBlock> {
        let block = self.unpacked(codec, entry, wanted, keeps)?;
        let has_field = has_field && block.exact.is_none();
        let field = if has_field { block.field_at_once(codec, wanted) } else { None };
        Ok(DecodedBlock { block, field })
    }

    /// As [`Self::block`]. Uses what was unpacked, and keeps it if `keeps`: codes take less memory than coefficients, and unpacking takes
    /// most of the time.
    fn unpacked(&self, codec: &WindowCodec, entry: &BlockEntry, wanted: &[bool], keeps: bool) -> Result<Arc<Block>> {
        let unpack = || self.block(codec, entry, wanted);
        let Some(kept) = &self.kept else { return unpack().map(Arc::new) };
        let key = self.key_of_codes(codec, entry, wanted);
        if let Some(block) = kept.unpacked(&key) {
            return Ok(block);
        }
        if !keeps {
            return unpack().map(Arc::new);
        }
        let block = Arc::new(unpack()?.to_keep());
        kept.keep_unpacked(key, &block);
        Ok(block)
    }

    /// Whether pictures should keep the values of so many blocks in so many frames first: they fit, and coefficients do not, or take
    /// several times as much.
    pub(crate) fn keeps_values(&self, blocks: usize, frames: usize) -> bool {
        let [values, coefficients] = [frames * size_of::<f64>(), self.bytes_of_coefficients()];
        let fits = |each: usize| self.kept.as_ref().is_some_and(|kept| kept.fits(each * self.voxels_of(blocks)));
        fits(values) && (FEW_VALUES * values <= coefficients || !fits(coefficients))
    }

    /// Whether pictures should keep the codes of a block after all: other frames of it were drawn before.
    pub(crate) fn keeps_codes_too(&self, entry: &BlockEntry) -> bool {
        self.kept.as_ref().is_some_and(|kept| kept.is_drawn_again(entry.id, self.lod))
    }

    /// Bytes of the coefficients of a voxel.
    fn bytes_of_coefficients(&self) -> usize {
        self.most_coefficients() * self.coefficient_size()
    }

    /// The most voxels of so many blocks.
    fn voxels_of(&self, blocks: usize) -> usize {
        blocks * self.blocks.region(0).voxels()
    }

    /// The values of a block in some frames, kept or as `make` gives them.
    pub(crate) fn values(
        &self,
        codec: &WindowCodec,
        entry: &BlockEntry,
        frames: FramesDrawn<'_>,
        make: impl FnOnce() -> Result<BlockValues>,
    ) -> Result<Arc<BlockValues>> {
        let Some(kept) = &self.kept else { return make().map(Arc::new) };
        let key = self.key_of_values(codec, entry, frames);
        if let Some(values) = kept.values(&key) {
            return Ok(values);
        }
        let values = Arc::new(make()?);
        kept.keep_values(key, &values);
        Ok(values)
    }

    /// The frames of a window, as numbers in it, that a read of some of them should decode together: more than are read, if the reads
    /// go on from frame to frame, and the window does not fit in the cache.
    pub fn read_ahead(&self, window: u32, channel: usize, region: &Region, frames: &[usize]) -> Option<Range<usize>> {
        let (kept, of_window) = (self.kept.as_ref()?, self.window_range(window));
        let voxels: usize = self.blocks.touching(region).map(|block| self.blocks.region(block).voxels()).sum();
        let (first, last) = (*frames.first()?, *frames.last()?);
        if frames.len() != last + 1 - first {
            return None;
        }
        let read = FramesRead { channel, region: *region, frames: first..last + 1 };
        let ahead = kept.ahead(&read, voxels * self.sample().size(), &of_window)?;
        Some(ahead.start - of_window.start..ahead.end - of_window.start)
    }

    /// The samples of a block. Only `wanted` frames have their samples. Uses the cache, and adds blocks that are read again, and the
    /// frames that are [ahead](Self::read_ahead). If the caller needs all frames of a part of the block (`is_part`), the cache takes it
    /// at the first read.
    pub fn samples(
        &self,
        codec: &WindowCodec,
        entry: &BlockEntry,
        wanted: &WantedFrames,
        ahead: Option<&WantedFrames>,
        is_part: bool,
    ) -> Result<SamplesOfBlock> {
        let decode = |wanted: &WantedFrames| {
            let block = self.block(codec, entry, &wanted.coefficients)?;
            let samples = Arc::new(block.samples_of(codec, wanted));
            Ok(SamplesOfBlock { samples, first: 0, bytes_read: block.bytes_read })
        };
        let Some(kept) = &self.kept else { return decode(wanted) };
        let key = self.key(entry, DecodedForm::Samples);
        if let Some(samples) = kept.samples(&key) {
            return Ok(SamplesOfBlock { samples, first: 0, bytes_read: 0 });
        }
        if let Some(ahead) = ahead {
            return self.samples_ahead(codec, entry, kept, [wanted, ahead], decode);
        }
        let is_whole = wanted.frames.len() == codec.frames();
        let is_again = kept.is_read_again(entry.id, self.lod);
        let bytes = self.decoded_voxels(codec, entry)? * codec.frames() * codec.sample.size();
        if !(is_again || is_part && is_whole) || !kept.has_room(bytes) {
            return decode(wanted);
        }
        let decoded = decode(&WantedFrames::all(codec))?;
        kept.keep_samples(key, &decoded.samples);
        Ok(decoded)
    }

    /// The samples of the frames ahead of a block, kept or decoded now; of the wanted frames if there is no room for all.
    fn samples_ahead(
        &self,
        codec: &WindowCodec,
        entry: &BlockEntry,
        kept: &DecodedBlocks,
        [wanted, ahead]: [&WantedFrames; 2],
        decode: impl FnOnce(&WantedFrames) -> Result<SamplesOfBlock>,
    ) -> Result<SamplesOfBlock> {
        let (first, count) = (ahead.frames[0], ahead.frames.len());
        let key = self.key(entry, form_of(ahead));
        if let Some(samples) = kept.samples(&key) {
            return Ok(SamplesOfBlock { samples, first, bytes_read: 0 });
        }
        let size = self.decoded_voxels(codec, entry)? * codec.sample.size();
        if !kept.has_room(count * size) {
            return decode(wanted);
        }
        let SamplesOfBlock { samples, bytes_read, .. } = decode(ahead)?;
        let samples = Arc::new(Buffer::to_keep(&samples[first * size..(first + count) * size]));
        kept.keep_samples(key, &samples);
        Ok(SamplesOfBlock { samples, first, bytes_read })
    }

    /// The samples of some frames in a part of a block, frame after frame, x fastest, and the stored bytes read. None if the part is
    /// not small, the block not [divisible](is_divisible), or its samples are kept, and if frames repeat. Uses the cache. It takes the
    /// block's coefficients if samples are read again, or at once for all frames of a part that is not tiny.
    pub fn samples_of_part(
        &self,
        codec: &WindowCodec,
        entry: &BlockEntry,
        wanted: &WantedFrames,
        part: &Region,
    ) -> Result<Option<(Vec<u8>, u64)>> {
        let repeats = wanted.frames.windows(2).any(|two| two[0] == two[1]);
        if repeats || !self.is_small(codec, entry, part, SMALL)? || self.keeps(entry, DecodedForm::Samples) {
            return Ok(None);
        }
        let is_alone = self.reads_alone(codec, entry, part)?;
        let is_again = self.kept.as_ref().is_some_and(|kept| kept.is_read_again(entry.id, self.lod));
        if is_again && !self.is_small(codec, entry, part, TINY)? {
            return Ok(None); // several such parts take longer than all samples
        }
        let keeps = is_again || !is_alone && wanted.coefficients.iter().all(|wanted| *wanted);
        let (decoded, bytes_read) = match self.all_coefficients(codec, entry, keeps)? {
            Some(all) => all,
            None => self.coefficients_of_part(codec, entry, &wanted.coefficients, part, is_alone)?,
        };
        let DecodedBlock { block, field } = decoded.as_ref();
        let samples = field.as_ref().map(|field| block.samples_of_part(codec, field, &wanted.frames, part));
        Ok(samples.map(|samples| (samples, bytes_read)))
    }

    /// Whether [`Self::samples_of_part`] decodes only what the part depends on, in the block and in those above: it is tiny, and the
    /// first one read of the block.
    pub fn reads_alone(&self, codec: &WindowCodec, entry: &BlockEntry, part: &Region) -> Result<bool> {
        let was_read = |kept: &Arc<DecodedBlocks>| kept.was_read(entry.id, self.lod);
        let is_first = !self.keeps_samples(entry, None) && !self.kept.as_ref().is_some_and(was_read);
        Ok(is_first && self.is_small(codec, entry, part, TINY)?)
    }

    /// Whether a part of a [divisible](is_divisible) block takes the time of at most one voxel in so many of it.
    fn is_small(&self, codec: &WindowCodec, entry: &BlockEntry, part: &Region, one_in: usize) -> Result<bool> {
        let voxels = self.decoded_voxels(codec, entry)?;
        Ok(one_in * decoded_together(part) <= voxels && is_divisible(codec, entry))
    }

    /// A divisible block with all its coefficients, and the stored bytes read: if they are kept, or `keeps` asks for that and there is
    /// room.
    fn all_coefficients(
        &self,
        codec: &WindowCodec,
        entry: &BlockEntry,
        keeps: bool,
    ) -> Result<Option<(Arc<DecodedBlock>, u64)>> {
        let Some(kept) = &self.kept else { return Ok(None) };
        let key = self.key(entry, DecodedForm::All);
        if let Some(decoded) = kept.block(&key) {
            return Ok(Some((decoded, 0)));
        }
        let all = vec![true; codec.basis.coefficients()];
        let bytes = self.decoded_voxels(codec, entry)? * all.len() * self.coefficient_size();
        if !keeps || !kept.has_room(bytes) {
            return Ok(None);
        }
        let block = self.block(codec, entry, &all)?.to_keep();
        let (field, bytes_read) = (Some(block.refined(codec, &all)), block.bytes_read);
        let decoded = Arc::new(DecodedBlock { block: Arc::new(block), field });
        kept.keep_block(key, &decoded);
        Ok(Some((decoded, bytes_read)))
    }

    /// A divisible block with the coefficients that are marked of a part, and the stored bytes read. If `is_alone`, blocks above are
    /// decoded for the part only.
    fn coefficients_of_part(
        &self,
        codec: &WindowCodec,
        entry: &BlockEntry,
        wanted: &[bool],
        part: &Region,
        is_alone: bool,
    ) -> Result<(Arc<DecodedBlock>, u64)> {
        let block =
            if is_alone { self.block_part(codec, entry, wanted, part) } else { self.block(codec, entry, wanted) }?;
        let (field, bytes_read) = (Some(block.refined_in(codec, wanted, part)), block.bytes_read);
        Ok((Arc::new(DecodedBlock { block: Arc::new(block), field }), bytes_read))
    }

    /// The voxels of a block that are decoded at the level of detail.
    fn decoded_voxels(&self, codec: &WindowCodec, entry: &BlockEntry) -> Result<usize> {
        Ok(codec.decoded_size(self.all_voxels(entry)?).iter().product())
    }

    /// Whether samples of a block, or of the frames `ahead`, can be read without decoding it.
    pub fn keeps_samples(&self, entry: &BlockEntry, ahead: Option<&WantedFrames>) -> bool {
        let forms = [DecodedForm::Samples, DecodedForm::All].into_iter();
        forms.chain(ahead.map(form_of)).any(|form| self.keeps(entry, form))
    }

    fn keeps(&self, entry: &BlockEntry, form: DecodedForm) -> bool {
        self.kept.as_ref().is_some_and(|kept| kept.has(&self.key(entry, form)))
    }

    /// Whether the codes of a block are kept.
    pub(crate) fn keeps_codes(&self, codec: &WindowCodec, entry: &BlockEntry, wanted: &[bool]) -> bool {
        self.kept.as_ref().is_some_and(|kept| kept.has(&self.key_of_codes(codec, entry, wanted)))
    }

    /// Whether the values of a block are kept.
    pub(crate) fn keeps_values_of(&self, codec: &WindowCodec, entry: &BlockEntry, frames: FramesDrawn<'_>) -> bool {
        self.kept.as_ref().is_some_and(|kept| kept.has(&self.key_of_values(codec, entry, frames)))
    }

    fn key_of_values(&self, codec: &WindowCodec, entry: &BlockEntry, frames: FramesDrawn<'_>) -> DecodedKey {
        let FramesDrawn { frames, by_coefficients } = frames;
        let (frames, of) = (frames.to_vec(), PartsRead::new(codec, entry));
        self.key(entry, DecodedForm::Values { frames, by_coefficients, of })
    }

    fn key_of_codes(&self, codec: &WindowCodec, entry: &BlockEntry, wanted: &[bool]) -> DecodedKey {
        let (wanted, of) = (wanted.to_vec(), PartsRead::new(codec, entry));
        self.key(entry, DecodedForm::Codes { wanted, of })
    }

    fn key(&self, entry: &BlockEntry, form: DecodedForm) -> DecodedKey {
        DecodedKey { id: entry.id, lod: self.lod, form }
    }
}

/// What is kept of frames that a loop reads soon.
fn form_of(ahead: &WantedFrames) -> DecodedForm {
    DecodedForm::Frames(ahead.frames[0]..ahead.frames[0] + ahead.frames.len())
}
