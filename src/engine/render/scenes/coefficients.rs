//! Rendering from coefficients, the method of [Dobashi](wavesplat_core::bibliography): the coefficients of a file are splatted
//! once for all frames of a window (eq 9), and each pixel is inverted (eq 8). Decoded samples can be splatted instead
//! (eq 4).

use super::batch_plan::{BatchPlan, SplatSource};
use super::coded::{CodedBlock, ValuePlanes, values_of};
use super::needs::FileNeeds;
use super::overview;
use super::select::{BlockSelector, BlockView, KeptParts, RateAllocator, Rule};
use crate::file::promise::share_tolerance;
use crate::file::{BlockValues, CoefficientFile, DecodedBlock, Prefetch};
use crate::render::batches::{
    BatchOutcome, BatchRequest, BlockBytes, BlockPlanes, BlockRange, Expectation, FrameBatch, FrameBounds, Inverse,
    Layout, OverviewRequest, SampleErrors, Scene, Selection,
};
use crate::render::config::{Limit, RenderConfig};
use crate::render::report::LeftOut;
use std::sync::Arc;
use wavesplat_core::base::error::Result;
use wavesplat_core::base::grid::{BlockGrid, Grid, Region};
use wavesplat_core::base::progress::Progress;
use wavesplat_core::base::sample::{magnitude, rounding};
use wavesplat_core::wavelet::Lane;
use wavesplat_format::{BlockEntry, BlockStats, PartEntry, PartKind};

/// A coefficient file as a scene.
pub struct CoefficientScene {
    file: Arc<CoefficientFile>,
    what: SplatSource,
    needs: FileNeeds,
    /// The frame of each channel up to which parts of a remote file were fetched.
    fetched: Vec<usize>,
}

impl CoefficientScene {
    /// A scene of an open file.
    pub fn new(file: impl Into<Arc<CoefficientFile>>, what: SplatSource) -> Self {
        let file = file.into();
        Self { fetched: vec![0; file.channels()], needs: FileNeeds::new(&file, what), file, what }
    }

    /// Fetches the bytes of a remote file that the next frames of a request need: all of the first window, and as many
    /// later windows as fit.
    fn fetch_ahead(&mut self, request: &BatchRequest<'_>) -> Result<()> {
        let (channel, config) = (request.channel, request.config);
        let Some(mut prefetch) = self.fetch_leaves(channel, request.frames, config)? else { return Ok(()) };
        let later = later(request.frames, config);
        let mut fetched = self.fetched[channel];
        prefetch.gather(self.file.by_window(later), |frames, prefetch| {
            // In other modes, which blocks are hidden is known later. At coarse levels of detail, they share nearly all bytes.
            if self.knows_parts(config) {
                let batch = CoefficientBatch::open(&self.file, self.what, &BatchRequest { frames, ..*request })?;
                let mut blocks = batch.selection.blocks.clone();
                self.file.blocks.sort_nested(&mut blocks);
                batch.gather(&blocks, prefetch)?;
            }
            fetched = frames[frames.len() - 1] + 1;
            Ok(())
        })?;
        if self.knows_parts(config) {
            prefetch.finish()?;
        }
        self.fetched[channel] = fetched;
        Ok(())
    }

    /// Whether all parts to fetch are known before the first block is drawn.
    fn knows_parts(&self, config: &RenderConfig) -> bool {
        config.mode.is_projection() || self.file.lod() > 0
    }

    /// Fetches the leaves of a remote file for some frames and later ones, and returns what fetches their parts. None if the parts of
    /// these frames were fetched.
    fn fetch_leaves(&self, channel: usize, frames: &[usize], config: &RenderConfig) -> Result<Option<Prefetch<'_>>> {
        let prefetch = Prefetch::new(&self.file).filter(|_| self.fetched[channel] <= frames[0]);
        if let Some(prefetch) = &prefetch {
            prefetch.leaves(self.file.by_window(later(frames, config)), channel, &self.region(config))?;
        }
        Ok(prefetch)
    }

    /// The voxels that are wanted.
    fn region(&self, config: &RenderConfig) -> Region {
        config.region.unwrap_or(self.file.grid.whole())
    }
}

/// The wanted frames from the first of some on.
fn later<'a>(frames: &[usize], config: &'a RenderConfig) -> &'a [usize] {
    &config.frames[config.frames.partition_point(|frame| *frame < frames[0])..]
}

impl From<CoefficientFile> for CoefficientScene {
    /// Splats the file's coefficients.
    fn from(file: CoefficientFile) -> Self {
        Self::new(file, SplatSource::Coefficients)
    }
}

impl Scene for CoefficientScene {
    fn grid(&self) -> &Grid {
        &self.file.grid
    }

    fn blocks(&self) -> BlockGrid {
        self.file.blocks
    }

    fn channels(&self) -> usize {
        self.file.channels()
    }

    fn frames(&self) -> Option<usize> {
        Some(self.file.frames())
    }

    fn tolerance(&self) -> Option<f64> {
        Some(share_tolerance(self.file.metadata()))
    }

    fn batch_end(&self, frame: usize) -> usize {
        self.file.window_range(self.file.window_of(frame)).end
    }

    fn most_planes(&self, frames: usize, config: &RenderConfig) -> usize {
        if !config.mode.is_projection() {
            return 2 * frames + 1; // values, not coefficients
        }
        self.needs.most_planes(frames, config)
    }

    fn block_bytes(&self, frames: usize, config: &RenderConfig) -> usize {
        let asked = self.file.by_window(&config.frames).map(<[usize]>::len);
        self.needs.of_all().bytes(frames, asked, config.mode.is_projection())
    }

    fn block_bytes_of(&mut self, frames: &[usize], config: &RenderConfig) -> Result<Box<BlockBytes>> {
        let (window, region) = (self.file.window_of(frames[0]), self.region(config));
        for channel in 0..self.file.channels() {
            self.fetch_leaves(channel, frames, config)?;
        }
        let needs = self.needs.of_window(&self.file, window, &region)?.clone();
        let asked: Vec<usize> = self.file.by_window(&config.frames).map(<[usize]>::len).collect();
        let is_projection = config.mode.is_projection();
        Ok(Box::new(move |frames| needs.bytes(frames, asked.iter().copied(), is_projection)))
    }

    fn shared_bytes(&self, memory: usize) -> usize {
        self.file.shared_bytes(memory)
    }

    fn overview(&mut self, request: &OverviewRequest<'_>, progress: &dyn Progress) -> Result<Option<Vec<f32>>> {
        self.file.limit_shared(request.memory);
        overview::overview(&self.file, request, progress).map(Some)
    }

    fn open<'a>(&'a mut self, request: &BatchRequest<'a>) -> Result<Box<dyn FrameBatch + 'a>> {
        self.file.limit_shared(request.config.memory);
        self.fetch_ahead(request)?;
        Ok(Box::new(CoefficientBatch::open(&self.file, self.what, request)?))
    }
}

/// A batch of frames of one window of a file.
pub(super) struct CoefficientBatch<'a> {
    file: &'a CoefficientFile,
    window: u32,
    channel: usize,
    plan: BatchPlan,
    views: &'a [Expectation<'a>],
    selector: BlockSelector,
    selection: Selection,
    errors: SampleErrors,
}

impl<'a> CoefficientBatch<'a> {
    fn open(file: &'a CoefficientFile, what: SplatSource, request: &BatchRequest<'a>) -> Result<Self> {
        let window = file.window_of(request.frames[0]);
        let plan = BatchPlan::new(file, what, window, request)?;
        let above =
            if request.config.certify { file.largest_above(&plan.codec, window, request.channel)? } else { 0.0 };
        let mut batch = Self {
            file,
            window,
            channel: request.channel,
            selector: BlockSelector::new(&plan.codec, above, request.config, &file.grid),
            plan,
            views: request.views,
            selection: Selection::default(),
            errors: SampleErrors::default(),
        };
        batch.select(request.config)?;
        Ok(batch)
    }

    /// Selects the parts to read: first decides the rule, then applies it to every block.
    fn select(&mut self, config: &RenderConfig) -> Result<()> {
        let region = config.region.unwrap_or(self.file.grid.whole());
        // Decoded samples are rounded to their type, so the bound for left-out parts would not cover their whole error.
        if let Some(allowed) = config.allowed.filter(|_| self.plan.what != SplatSource::Samples) {
            let rule = self.rule(allowed, config.error, &region)?;
            self.selector.rule = rule;
        }
        let with_ranges = !config.mode.is_projection();
        let expected = vec![0.0; self.views.len()];
        let mut found = Selection { empty: self.file.blocks.len() as u64, expected, ..Selection::default() };
        let mut absolute_sum = 0.0_f64;
        for entries in self.file.entries(self.window, self.channel, &region) {
            for entry in entries? {
                let kept = self.keep(&entry);
                absolute_sum = absolute_sum.max(self.selector.absolute_sum(&entry));
                if with_ranges {
                    let (block, range) = (entry.id.block as usize, self.range(&entry, &kept));
                    found.ranges.push(BlockRange { block, range, error: kept.certified });
                }
                self.expect(&entry, &kept, &mut found.expected);
                self.add(&entry, &kept, &mut found);
            }
        }
        if config.certify {
            self.errors = self.sample_errors(found.certified, absolute_sum);
        }
        self.selection = found;
        Ok(())
    }

    /// The rule that leaves out as much as the allowed error permits.
    fn rule(&self, allowed: f64, error: Limit, region: &Region) -> Result<Rule> {
        let (Limit::Expected, [view, ..]) = (error, self.views) else { return Ok(Rule::Within(allowed)) };
        let mut cheapest = RateAllocator::new(&self.selector);
        for entries in self.file.entries(self.window, self.channel, region) {
            entries?.iter().for_each(|entry| cheapest.add(&self.view_of(entry, Some(view))));
        }
        Ok(cheapest.within(view.allowed(allowed)))
    }

    /// Adds a block to a selection.
    fn add(&self, entry: &BlockEntry, kept: &KeptParts, found: &mut Selection) {
        found.left_out += kept.left_out;
        found.other_frames += self.of_other_frames(&kept.entry);
        found.certified = found.certified.max(kept.certified);
        found.empty -= u64::from(!self.selector.is_nothing(entry) || entry.lost);
        if !self.adds_nothing(kept) {
            found.blocks.push(entry.id.block as usize);
        }
    }

    /// A range that holds the samples of a block as splatted.
    fn range(&self, entry: &BlockEntry, kept: &KeptParts) -> (f64, f64) {
        let BlockStats { min, max, reached, .. } = entry.stats;
        // Without all parts, samples differ from the source by `certified`, and the source differs from the stored
        // range by `reached`.
        let is_whole = kept.left_out.parts == 0 && kept.left_out.blocks == 0 && kept.certified == reached;
        let off = if !is_whole { kept.certified + reached } else { 0.0 };
        let off = off + rounding(self.plan.codec.sample, magnitude((min, max)));
        (min - off, max + off)
    }

    /// Adds the expected mean square error that a block causes in each view.
    fn expect(&self, entry: &BlockEntry, kept: &KeptParts, sums: &mut [f64]) {
        let [first, others @ ..] = sums else { return };
        *first += kept.expected;
        for (sum, view) in others.iter_mut().zip(&self.views[1..]) {
            *sum += self.selector.keep(&self.view_of(entry, Some(view))).expected;
        }
    }

    /// Error bounds of the samples. Every sample in the region has an error of at most `certified` and a sum of
    /// absolute terms of at most `absolute_sum`.
    fn sample_errors(&self, certified: f64, absolute_sum: f64) -> SampleErrors {
        let record = &self.file.metadata().windows[self.window as usize];
        let range = ((record.min - record.reached).next_down(), (record.max + record.reached).next_up());
        let frame = FrameBounds {
            error: record.reached.max(certified),
            range,
            // An outlier adds its sample minus the value from the coefficients.
            absolute_sum: 2.0 * absolute_sum + magnitude(range),
        };
        let of_part = |gains: &Vec<f64>| self.plan.wanted.frames.iter().map(|f| gains[*f]).collect();
        let factors =
            std::iter::once(vec![1.0; self.plan.wanted.frames.len()]).chain(self.selector.gains.iter().map(of_part));
        SampleErrors {
            factors: factors.take(self.plan.layout.error_planes).collect(),
            frames: vec![frame; self.plan.wanted.frames.len()],
        }
    }

    /// The parts of a block to read.
    fn keep(&self, entry: &BlockEntry) -> KeptParts {
        self.selector.keep(&self.view_of(entry, self.views.first()))
    }

    /// A block with its influence on a view; without a view, it influences no pixel.
    fn view_of<'b>(&self, entry: &'b BlockEntry, view: Option<&Expectation<'_>>) -> BlockView<'b> {
        let region = self.file.blocks.region(entry.id.block as usize);
        let influence = view.map(|view| view.of_block(&region)).unwrap_or_default();
        BlockView { entry, voxels: region.voxels(), influence }
    }

    /// The parts that the batch's frames do not need.
    fn of_other_frames(&self, entry: &BlockEntry) -> LeftOut {
        let needs = |part: &PartEntry| match part.kind {
            PartKind::Level(level) => self.plan.codec.needs_part(level.into(), &self.plan.wanted.coefficients),
            _ => true,
        };
        let parts = entry.parts.iter().filter(|part| needs(part)).copied().collect();
        self.selector.left_out(entry, &BlockEntry { parts, ..entry.clone() })
    }

    /// Whether a block adds nothing to any plane.
    fn adds_nothing(&self, kept: &KeptParts) -> bool {
        self.selector.is_nothing(&kept.entry)
            && !kept.entry.lost
            && (self.plan.layout.error_planes == 0 || kept.errors.iter().all(|e| *e == 0.0))
    }

    /// The entries of the directory's leaf that lists a block.
    fn leaf_of(&self, block: u32) -> Result<Arc<Vec<BlockEntry>>> {
        let leaves = self.file.leaves_of(self.window, self.channel);
        self.file.kept_leaf(&leaves[leaves.partition_point(|l| l.first_block <= block) - 1])
    }

    /// Looks up a block in the directory, and selects its parts to read.
    fn kept(&self, block: usize) -> Result<KeptParts> {
        let leaf = self.leaf_of(block as u32)?;
        Ok(self.keep(&leaf[block - leaf[0].id.block as usize]))
    }

    /// Gathers the parts to read of some blocks, in order, until there are as many as should be fetched together.
    fn gather(&self, blocks: &[usize], prefetch: &mut Prefetch<'_>) -> Result<()> {
        let BatchPlan { codec, wanted, .. } = &self.plan;
        for block in blocks {
            if prefetch.is_full() {
                break;
            }
            prefetch.add(codec, &self.kept(*block)?.entry, &wanted.coefficients)?;
        }
        Ok(())
    }

    /// Decodes a block. The file keeps its codes if `keeps`.
    fn decoded(&self, entry: &BlockEntry, keeps: bool) -> Result<DecodedBlock> {
        let BatchPlan { codec, wanted, what, .. } = &self.plan;
        self.file.decoded(codec, entry, &wanted.coefficients, *what == SplatSource::Coefficients, keeps)
    }

    /// The values of a block that is not stored exactly.
    fn values(&self, entry: &BlockEntry) -> Result<Arc<BlockValues>> {
        let (plan, blocks) = (&self.plan, self.selection.blocks.len());
        if !self.file.keeps_values(blocks, plan.wanted.frames.len()) {
            return Ok(Arc::new(values_of(plan, &self.decoded(entry, true)?)));
        }
        self.file.values(&plan.codec, entry, plan.drawn(), || {
            let keeps = self.file.keeps_codes_too(entry);
            Ok(values_of(plan, &self.decoded(entry, keeps)?))
        })
    }
}

impl FrameBatch for CoefficientBatch<'_> {
    fn layout(&self) -> Layout {
        self.plan.layout
    }

    fn selection(&self) -> &Selection {
        &self.selection
    }

    fn fetch(&self, blocks: &[usize]) -> Result<()> {
        if let Some(mut prefetch) = Prefetch::new(self.file) {
            self.gather(blocks, &mut prefetch)?;
            prefetch.finish()?;
        }
        let BatchPlan { codec, wanted, .. } = &self.plan;
        if codec.tiers() == 0 || blocks.len() > rayon::current_num_threads() {
            return Ok(()); // a plan has room for few blocks above at a time
        }
        let next = blocks.iter().map(|block| Ok(self.kept(*block)?.entry)).collect::<Result<Vec<_>>>()?;
        let is_kept = |entry: &BlockEntry| {
            self.file.keeps_codes(codec, entry, &wanted.coefficients)
                || self.plan.by_values && self.file.keeps_values_of(codec, entry, self.plan.drawn())
        };
        let decoded_now = next.iter().filter(|entry| !is_kept(entry));
        self.file.decode_shared(codec, decoded_now, &wanted.coefficients)
    }

    fn planes(&self, block: usize) -> Result<Box<dyn BlockPlanes + '_>> {
        let KeptParts { entry, errors, .. } = self.kept(block)?;
        if self.plan.by_values && !entry.is_exact() {
            return Ok(Box::new(ValuePlanes(self.values(&entry)?)));
        }
        Ok(Box::new(CodedBlock::new(&self.plan, self.decoded(&entry, true)?, errors)))
    }

    fn errors(&self) -> &SampleErrors {
        &self.errors
    }

    fn inverse(&self, used: &[usize]) -> Box<Inverse<'_>> {
        let mut marked = vec![false; self.plan.codec.basis.coefficients()];
        used.iter().filter(|p| **p < self.plan.layout.coefficients).for_each(|p| marked[self.plan.kept[*p]] = true);
        let only = self.plan.codec.basis.only(&marked);
        let places: Vec<usize> = match &only {
            Some(_) => (0..self.plan.layout.coefficients).filter(|p| marked[self.plan.kept[*p]]).collect(),
            None => (0..self.plan.layout.coefficients).collect(),
        };
        let to: Vec<usize> = if only.is_some() { (0..places.len()).collect() } else { self.plan.kept.clone() };
        let mut coefficients = vec![Lane::default(); only.as_ref().map_or(marked.len(), |b| b.coefficients())];
        let mut series = vec![Lane::default(); self.plan.codec.frames()];
        Box::new(move |planes, frames| {
            if !places.is_empty() {
                coefficients.fill(Lane::default());
                places.iter().zip(&to).for_each(|(plane, k)| coefficients[*k] = planes[*plane]);
                only.as_deref().unwrap_or(self.plan.codec.basis.as_ref()).inverse(&mut coefficients, &mut series);
            }
            for (f, out) in frames.iter_mut().enumerate() {
                *out = series[self.plan.wanted.frames[f]];
                if self.plan.layout.values {
                    let value = planes[self.plan.layout.value(f)];
                    out.iter_mut().zip(value).for_each(|(o, v)| *o += v);
                }
            }
        })
    }

    fn finish(&self) -> Result<BatchOutcome> {
        self.file.check_unchanged().map(|()| BatchOutcome::Complete)
    }
}
