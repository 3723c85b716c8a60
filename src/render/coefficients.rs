//! The paper's method: the coefficients of a file, splatted once for all frames of a window (eq 8 and 9).

use super::amounts::{Amounts, BlockPlanes, Room};
use super::expectation::Expectation;
use super::reading::{Allowance, Cheapest, Kept, Place, Rule, left_out};
use super::scene::{Contents, FrameBounds, Group, Inverse, LeftOut, Read, SampleErrors, Scene};
use super::terms::{Layout, Order, Terms};
use super::{Limit, RenderConfig};
use crate::codec::WindowCodec;
use crate::codec::buffer::Buffer;
use crate::codec::decode::Block;
use crate::codec::field::Field;
use crate::error::Result;
use crate::file::CoefficientFile;
use crate::sample::{SampleType, magnitude};
use crate::volume::{BlockGrid, Grid, Region};
use crate::wavelet::{Lane, needed};
use std::sync::{Arc, Mutex, PoisonError};
use wavesplat_format::{BlockEntry, PartEntry, PartKind, Window};

/// What of a file is splatted.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum What {
    /// Coefficients.
    Coefficients,
    /// The decoded samples of every frame: the conventional method.
    Samples,
}

/// A coefficient file as a scene.
pub struct CoefficientScene {
    file: CoefficientFile,
    what: What,
}

impl CoefficientScene {
    /// Of an open file.
    pub fn new(file: CoefficientFile, what: What) -> Self {
        Self { file, what }
    }
}

impl Scene for CoefficientScene {
    fn grid(&self) -> &Grid {
        &self.file.grid
    }

    fn blocks(&self) -> BlockGrid {
        self.file.blocks
    }

    fn frames(&self) -> Option<usize> {
        Some(self.file.frames())
    }

    fn group_end(&self, frame: usize) -> usize {
        self.file.window_range(self.file.window_of(frame)).end
    }

    fn most_planes(&self, frames: usize, config: &RenderConfig) -> usize {
        let windows = &self.file.metadata().windows;
        let most = windows.iter().map(|w| w.coefficients as usize + error_planes(config, w.parts())).max();
        most.unwrap_or(0) + 2 * frames + 1
    }

    fn block_bytes(&self, config: &RenderConfig) -> usize {
        let windows = &self.file.metadata().windows;
        let errors = windows.iter().map(|w| error_planes(config, w.parts())).max().unwrap_or(0);
        // Codes, payload and samples, and a term of ten bytes for each; what a pyramid gives; where samples are missing, a
        // mask and overrides.
        let refined = if windows.iter().any(|w| w.pyramid.is_some()) { 8 } else { 0 };
        let missing = if windows.iter().any(|w| w.missing > 0) { 1 + 32 + 24 } else { 0 };
        self.file.largest_block() * (4 + 5 + 8 + 10 + refined + missing)
            + self.blocks().region(0).voxels() * errors * 10
    }

    fn group<'a>(
        &'a mut self,
        frames: &[usize],
        config: &RenderConfig,
        expectation: &'a Expectation<'_>,
    ) -> Result<Box<dyn Group + 'a>> {
        let window = self.file.window_of(frames[0]);
        let first = self.file.window_range(window).start;
        let frames: Vec<usize> = frames.iter().map(|f| f - first).collect();
        Ok(Box::new(CoefficientGroup::new(&self.file, self.what, window, frames, config, expectation)?))
    }
}

/// What holds in every frame, and what each level part that is left out counts in a frame.
fn error_planes(config: &RenderConfig, levels: usize) -> usize {
    match (config.certify, config.allowed) {
        (false, _) => 0,
        (true, None) => 1,
        (true, Some(_)) => 1 + levels,
    }
}

/// Whether most coefficients are not zero. Measured: from about half of them on, all planes of a pixel are added faster.
fn is_dense(window: &Window, voxels: usize) -> bool {
    window.pyramid.is_some() || 2 * window.coded > voxels as u64 * u64::from(window.coefficients)
}

/// Some frames of one window of a file.
struct CoefficientGroup<'a> {
    file: &'a CoefficientFile,
    what: What,
    window: u32,
    codec: WindowCodec,
    /// Counted from the first frame of the window.
    frames: Vec<usize>,
    /// Which coefficients the frames need, and those in order: what the planes hold.
    wanted: Vec<bool>,
    kept: Vec<usize>,
    layout: Layout,
    expectation: &'a Expectation<'a>,
    allowance: Allowance,
    errors: SampleErrors,
    /// The leaf that was read last: blocks come in order.
    leaf: Mutex<Arc<Vec<BlockEntry>>>,
}

impl<'a> CoefficientGroup<'a> {
    fn new(
        file: &'a CoefficientFile,
        what: What,
        window: u32,
        frames: Vec<usize>,
        config: &RenderConfig,
        expectation: &'a Expectation<'a>,
    ) -> Result<Self> {
        let codec = file.codec(window)?;
        let wanted = needed(&codec.synthesis, &frames);
        let kept: Vec<usize> = (0..wanted.len()).filter(|k| wanted[*k]).collect();
        let coded = file.leaves(window).iter().any(|leaf| leaf.coded > 0);
        let exact = file.leaves(window).iter().any(|leaf| leaf.exact > 0);
        let record = &file.metadata().windows[window as usize];
        let samples = what == What::Samples;
        let layout = Layout {
            coefficients: if samples || !coded { 0 } else { kept.len() },
            frames: frames.len(),
            values: samples || exact || record.outliers > 0 || record.missing > 0,
            absent: record.missing > 0,
            error_planes: error_planes(config, codec.parts()),
            order: if samples || is_dense(record, file.grid.whole().voxels()) { Order::Pixels } else { Order::Planes },
        };
        let allowance = Allowance::new(&codec, expectation);
        let (errors, leaf) = (SampleErrors::default(), Mutex::default());
        let mut group =
            Self { file, what, window, codec, frames, wanted, kept, layout, expectation, allowance, errors, leaf };
        // Decoded samples are rounded to their type, so that what parts leave out would not be all that they are off.
        if let Some(allowed) = config.allowed.filter(|_| !samples) {
            let rule = group.rule(allowed, config)?;
            group.allowance = group.allowance.by(rule);
        }
        if config.certify {
            group.errors = group.sample_errors()?;
        }
        Ok(group)
    }

    /// What may be left out so that an error keeps within what is allowed.
    fn rule(&self, allowed: f64, config: &RenderConfig) -> Result<Rule> {
        if config.limited == Limit::Certified {
            return Ok(Rule::Within(allowed));
        }
        let region = config.region.unwrap_or(self.file.grid.whole());
        let mut cheapest = Cheapest::new(&self.allowance);
        for entries in self.file.entries(self.window, &region) {
            entries?.iter().for_each(|entry| cheapest.add(&self.place(entry)));
        }
        Ok(cheapest.within(self.expectation.allowed(allowed)))
    }

    fn sample_errors(&self) -> Result<SampleErrors> {
        let record = &self.file.metadata().windows[self.window as usize];
        let range = ((record.min - record.reached).next_down(), (record.max + record.reached).next_up());
        let (mut sum, mut certified) = (0.0_f64, 0.0_f64);
        for leaf in self.file.leaves(self.window) {
            for entry in self.file.leaf(leaf)? {
                sum = sum.max(self.allowance.absolute_sum(&entry));
                certified = certified.max(self.keep(&entry).certified);
            }
        }
        let frame = FrameBounds {
            error: record.reached.max(certified),
            range,
            // What overrides a sample is the sample less what the coefficients give.
            absolute_sum: 2.0 * sum + magnitude(range),
        };
        let of_part = |gains: &Vec<f64>| self.frames.iter().map(|f| gains[*f]).collect();
        let factors = std::iter::once(vec![1.0; self.frames.len()]).chain(self.allowance.gains.iter().map(of_part));
        Ok(SampleErrors {
            factors: factors.take(self.layout.error_planes).collect(),
            frames: vec![frame; self.frames.len()],
        })
    }

    /// What is read of a block.
    fn keep(&self, entry: &BlockEntry) -> Kept {
        self.allowance.keep(&self.place(entry))
    }

    fn place<'b>(&self, entry: &'b BlockEntry) -> Place<'b> {
        let region = self.file.blocks.region(entry.id.block as usize);
        Place { entry, voxels: region.voxels(), seen: self.expectation.of_block(&region) }
    }

    /// The parts that say nothing of the group's frames.
    fn of_other_frames(&self, entry: &BlockEntry) -> LeftOut {
        let needs = |part: &PartEntry| match part.kind {
            PartKind::Level(level) => self.codec.needs_part(level.into(), &self.wanted),
            _ => true,
        };
        let parts = entry.parts.iter().filter(|part| needs(part)).copied().collect();
        left_out(entry, &BlockEntry { parts, ..entry.clone() })
    }

    /// Whether a block adds nothing to any plane.
    fn adds_nothing(&self, kept: &Kept) -> bool {
        kept.entry.parts.is_empty() && (self.layout.error_planes == 0 || kept.errors.iter().all(|e| *e == 0.0))
    }

    /// The entries of the directory's leaf that lists a block.
    fn leaf_of(&self, block: u32) -> Result<Arc<Vec<BlockEntry>>> {
        let mut last = self.leaf.lock().unwrap_or_else(PoisonError::into_inner);
        if !last.iter().any(|entry| entry.id.block == block) {
            let leaves = self.file.leaves(self.window);
            let leaf = &leaves[leaves.partition_point(|l| l.first_block <= block) - 1];
            *last = Arc::new(self.file.leaf(leaf)?);
        }
        Ok(last.clone())
    }

    /// Reads a block, and what its samples may be off by.
    fn read(&self, block: usize) -> Result<(Block, Vec<f64>)> {
        let leaf = self.leaf_of(block as u32)?;
        let Kept { entry, errors, .. } = self.keep(&leaf[block - leaf[0].id.block as usize]);
        Ok((self.file.block(&self.codec, &entry, &self.wanted)?, errors))
    }

    /// The samples of the group's frames out of those of the whole window.
    fn of_frames(&self, samples: &[u8]) -> Vec<u8> {
        let frame_bytes = samples.len() / self.codec.frames();
        self.frames.iter().flat_map(|f| &samples[f * frame_bytes..(f + 1) * frame_bytes]).copied().collect()
    }

    fn terms_of_samples(&self, block: &Block, samples: &[u8], errors: &[f64]) -> Terms {
        let ty: SampleType = self.codec.sample;
        let is_missing = |i: usize, value| self.misses(block, i / block.voxels, i % block.voxels, value);
        let mut terms = Terms::of_samples(&self.layout, ty, &self.of_frames(samples), errors, is_missing);
        terms.bytes_read = block.bytes_read;
        terms
    }

    /// Whether a sample of a frame of the group is missing.
    fn misses(&self, block: &Block, frame: usize, voxel: usize, value: f64) -> bool {
        let at = self.frames[frame] * block.voxels + voxel;
        block.is_missing(at) || self.codec.is_missing(value) // an exact block may do without a mask
    }

    /// Terms of the coefficients, and of what overrides them; without the former, of the latter alone.
    fn terms_of_codes(&self, block: &Block, field: &Field<'_>, errors: &[f64], coefficients: bool) -> Terms {
        let mut terms = Terms::new(block.bytes_read);
        terms.coefficients = block.codes.iter().filter(|c| **c != 0).count() as u64;
        let overrides = Overrides::of(block, &self.codec, field, &self.frames);
        let mut next = overrides.values.iter().peekable();
        for voxel in 0..block.voxels {
            if coefficients && !field.is_zero() {
                self.add_coefficients(field, block.voxels, voxel, &mut terms);
            }
            while let Some((_, frame, amount)) = next.next_if(|(v, _, _)| *v == voxel) {
                terms.add(self.layout.value(*frame), *amount);
            }
            // Judged by the window, not by the group, whose frames depend on the memory that there is.
            let in_all = (0..self.codec.frames()).all(|f| block.is_missing(f * block.voxels + voxel));
            if self.layout.absent {
                let missing = |f: usize| block.is_missing(self.frames[f] * block.voxels + voxel);
                terms.add_absent(&self.layout, in_all, missing);
            }
            if !in_all {
                terms.add_errors(&self.layout, errors);
            }
            terms.end_voxel();
        }
        terms
    }

    fn add_coefficients(&self, field: &Field<'_>, voxels: usize, voxel: usize, terms: &mut Terms) {
        for (plane, k) in self.kept.iter().enumerate() {
            let c = field.at(k * voxels + voxel);
            if c != 0.0 {
                terms.add(plane, c);
            }
        }
    }
}

impl Group for CoefficientGroup<'_> {
    fn layout(&self) -> Layout {
        self.layout
    }

    fn blocks(&self, region: &Region) -> Result<Contents> {
        let mut found = Contents { empty: self.file.blocks.len() as u64, ..Contents::default() };
        for entries in self.file.entries(self.window, region) {
            for entry in entries? {
                let kept = self.keep(&entry);
                found.left_out += kept.left_out;
                found.other_frames += self.of_other_frames(&kept.entry);
                found.certified = found.certified.max(kept.certified);
                found.expected += kept.expected;
                found.empty -= u64::from(!entry.parts.is_empty());
                if !self.adds_nothing(&kept) {
                    found.blocks.push(entry.id.block as usize);
                }
            }
        }
        Ok(found)
    }

    fn terms(&self, block: usize) -> Result<Terms> {
        let (block, errors) = self.read(block)?;
        Ok(match (&block.exact, self.what) {
            (Some(exact), _) => self.terms_of_samples(&block, exact, &errors),
            (None, What::Samples) => self.terms_of_samples(&block, &block.samples(&self.codec), &errors),
            (None, What::Coefficients) => self.terms_of_codes(&block, &block.field(&self.codec), &errors, true),
        })
    }

    fn planes(&self, block: usize) -> Result<Box<dyn BlockPlanes + '_>> {
        let (block, _) = self.read(block)?;
        Ok(Box::new(CodedBlock::new(self, block)))
    }

    fn errors(&self) -> &SampleErrors {
        &self.errors
    }

    fn inverse(&self, used: &[usize]) -> Box<Inverse<'_>> {
        let mut marked = vec![false; self.codec.basis.coefficients()];
        used.iter().filter(|p| **p < self.layout.coefficients).for_each(|p| marked[self.kept[*p]] = true);
        let only = self.codec.basis.only(&marked);
        let places: Vec<usize> = match &only {
            Some(_) => (0..self.layout.coefficients).filter(|p| marked[self.kept[*p]]).collect(),
            None => (0..self.layout.coefficients).collect(),
        };
        let to: Vec<usize> = if only.is_some() { (0..places.len()).collect() } else { self.kept.clone() };
        let mut coefficients = vec![Lane::default(); only.as_ref().map_or(marked.len(), |b| b.coefficients())];
        let mut series = vec![Lane::default(); self.codec.frames()];
        Box::new(move |planes, frames| {
            if !places.is_empty() {
                coefficients.fill(Lane::default());
                places.iter().zip(&to).for_each(|(plane, k)| coefficients[*k] = planes[*plane]);
                only.as_deref().unwrap_or(self.codec.basis.as_ref()).inverse(&mut coefficients, &mut series);
            }
            for (f, out) in frames.iter_mut().enumerate() {
                *out = series[self.frames[f]];
                if self.layout.values {
                    let value = planes[self.layout.value(f)];
                    out.iter_mut().zip(value).for_each(|(o, v)| *o += v);
                }
            }
        })
    }

    fn finish(&self) -> Result<Read> {
        self.file.check_unchanged().map(|()| Read::AsExpected)
    }
}

/// A block of a file that has been read.
struct CodedBlock<'a> {
    group: &'a CoefficientGroup<'a>,
    block: Block,
    /// Samples that are splatted frame by frame.
    samples: Option<Buffer<u8>>,
    /// What the codes give, where it was needed at once.
    field: Option<Field<'static>>,
    coefficients: u64,
    /// What overrides coefficients, for each plane behind theirs.
    few: Vec<Vec<(u32, f64)>>,
}

impl<'a> CodedBlock<'a> {
    fn new(group: &'a CoefficientGroup<'a>, block: Block) -> Self {
        let codec = &group.codec;
        let samples = (block.exact.is_some() || group.what == What::Samples).then(|| block.samples(codec));
        let mut new = Self { group, block, samples, field: None, coefficients: 0, few: Vec::new() };
        if new.samples.is_none() {
            new.field = new.block.field_at_once(codec);
            new.add_overrides();
        }
        new
    }

    fn add_overrides(&mut self) {
        let Self { group, block, .. } = self;
        if !block.overrides() {
            self.coefficients = block.codes.iter().filter(|c| **c != 0).count() as u64;
            return;
        }
        let terms = match &self.field {
            Some(field) => group.terms_of_codes(block, field, &[], false),
            None => group.terms_of_codes(block, &block.field(&group.codec), &[], false),
        };
        self.coefficients = terms.coefficients;
        self.few.resize_with(group.layout.planes() - group.layout.coefficients, Vec::new);
        for voxel in 0..block.voxels {
            let (planes, amounts) = terms.of_voxel(voxel);
            for (plane, amount) in planes.iter().zip(amounts) {
                self.few[usize::from(*plane) - group.layout.coefficients].push((voxel as u32, *amount));
            }
        }
    }
}

impl BlockPlanes for CodedBlock<'_> {
    fn plane<'a>(&'a self, plane: usize, room: &'a mut Room) -> Result<Amounts<'a>> {
        let (group, block) = (self.group, &self.block);
        if let Some(samples) = &self.samples {
            return Ok(self.plane_of_samples(samples, plane, room));
        }
        if let Some(behind) = plane.checked_sub(group.layout.coefficients) {
            return Ok(self.few.get(behind).map_or(Amounts::Nothing, |few| Amounts::Few(few)));
        }
        let k = group.kept[plane];
        Ok(match &self.field {
            Some(field) => field.plane(k, block.voxels, &mut room.double).into(),
            None => block.plane(&group.codec, k, (&mut room.single, &mut room.double)).into(),
        })
    }

    fn held(&self) -> [u64; 2] {
        [self.coefficients, self.block.bytes_read]
    }
}

impl CodedBlock<'_> {
    fn plane_of_samples<'a>(&self, samples: &[u8], plane: usize, room: &'a mut Room) -> Amounts<'a> {
        let Self { group, block, .. } = self;
        let Some((frame, absent)) = group.layout.samples(plane) else { return Amounts::Nothing };
        let bytes = samples.len() / group.codec.frames();
        room.bytes.clear();
        room.bytes.extend_from_slice(&samples[group.frames[frame] * bytes..][..bytes]);
        match group.layout.absent {
            true => room.masked(group.codec.sample, absent, |voxel, v| group.misses(block, frame, voxel, v)),
            false => room.samples(group.codec.sample),
        }
    }
}

/// What must be added to single frames because coefficients don't give it: an outlier's sample less what they give,
/// and for a missing sample minus what they give.
struct Overrides {
    /// (voxel, frame of the group, amount), ascending.
    values: Vec<(usize, usize, f64)>,
}

impl Overrides {
    fn of(block: &Block, codec: &WindowCodec, field: &Field<'_>, frames: &[usize]) -> Self {
        let mut wanted = vec![None; codec.frames()];
        frames.iter().enumerate().for_each(|(i, f)| wanted[*f] = Some(i));
        let place =
            |index: usize| wanted[index / block.voxels].map(|f| (index % block.voxels, f, index / block.voxels));
        let mut samples = vec![0.0; block.outliers.positions.len()];
        crate::sample::load(codec.sample, &block.outliers.samples, &mut samples);
        let outliers = block.outliers.positions.iter().map(|p| *p as usize).zip(samples);
        let missing = block.missing.0.iter().enumerate().filter(|(_, m)| **m).map(|(i, _)| (i, 0.0));
        let mut targets: Vec<_> = outliers
            .chain(missing)
            .filter_map(|(index, sample)| place(index).map(|(voxel, f, t)| (voxel, f, t, sample)))
            .collect();
        targets.sort_unstable_by_key(|(voxel, f, _, _)| (*voxel, *f));
        Self { values: subtract_series(block, codec, field, &targets) }
    }
}

/// Turns (voxel, frame of the group, frame of the window, sample) into (voxel, frame, sample - what the codes give).
fn subtract_series(
    block: &Block,
    codec: &WindowCodec,
    field: &Field<'_>,
    targets: &[(usize, usize, usize, f64)],
) -> Vec<(usize, usize, f64)> {
    let mut out = Vec::new();
    for of_voxel in targets.chunk_by(|a, b| a.0 == b.0) {
        let series = block.series(codec, field, of_voxel[0].0);
        out.extend(of_voxel.iter().map(|(v, f, t, sample)| (*v, *f, sample - series[*t])).filter(|o| o.2 != 0.0));
    }
    out
}
