//! Adds partial sums, and makes pictures of the total.

use super::head::{Head, MOST_BOXES, PartialSource, PictureRecord, PictureSetup};
use super::read::PartialFile;
use super::write::PartialWriter;
use crate::render::config::RenderConfig;
use crate::render::projection::Projection;
use crate::render::projection::partial_sums::PartialSums;
use crate::render::projection::reconstruct::finished;
use crate::render::projection::weight_sums::WeightSums;
use crate::render::renderer::Renderer;
use crate::render::report::{RenderReport, Rendered};
use crate::render::splat::ViewSetup;
use std::collections::{BTreeMap, HashSet};
use std::io::Write;
use std::path::{Path, PathBuf};
use wavesplat_core::base::error::{Error, Result};
use wavesplat_core::base::grid::Region;
use wavesplat_core::base::progress::Progress;
use wavesplat_core::base::system::Instant;
use wavesplat_core::base::time_labels::TimeLabels;

/// The parts of one picture, and the numbers of their records.
type Holders = Vec<(usize, usize)>;

/// Partial sums that make up pictures.
#[derive(Debug)]
pub struct PartialTotal {
    setup: PictureSetup,
    /// In the order of their voxels. Only `setup` has the axes.
    parts: Vec<PartialFile>,
    /// For each view and frame, the parts that add to the picture, and the numbers of their records.
    pictures: BTreeMap<(usize, usize), Holders>,
    /// The voxels of every picture.
    boxes: Vec<Region>,
    memory: usize,
}

impl PartialTotal {
    /// Opens parts in any order. Heads and sums take at most `memory` bytes.
    ///
    /// # Errors
    /// Parts that are damaged, given twice, of other views or archives, or with the same voxels; frames that lack voxels which
    /// others have; each is named.
    pub fn open(paths: &[PathBuf], memory: usize, progress: &dyn Progress) -> Result<Self> {
        progress.start(Some(paths.len() as u64));
        let (mut parts, mut setup, mut left): (Vec<PartialFile>, Option<PictureSetup>, _) = (Vec::new(), None, memory);
        for path in paths {
            progress.check()?;
            let mut part = PartialFile::open(path, left)?;
            left -= part.head_bytes;
            match (&setup, parts.first()) {
                (Some(setup), Some(first)) => check_alike(setup, first.path(), &part)?,
                _ => setup = Some(part.head.look.clone()),
            }
            part.head.look.axes = Default::default();
            parts.push(part);
            progress.advance(1);
        }
        progress.finish();
        parts.sort_by_cached_key(|part| {
            (first_voxel(&part.head.boxes), part.head.sources[0].frames, part.path().to_owned())
        });
        check_sources(&parts)?;
        let pictures = pictures(&parts)?;
        let (Some(first), Some(setup)) = (pictures.values().next(), setup) else {
            return Err(Error::setting("inputs", "none of the parts has a picture"));
        };
        let total = Self { setup, boxes: boxes(&parts, first), pictures, parts, memory: left };
        total.check_voxels()?;
        total.check_frames()?;
        Ok(total)
    }

    /// The settings that all parts share.
    pub fn setup(&self) -> &PictureSetup {
        &self.setup
    }

    /// The number of parts.
    pub fn parts(&self) -> usize {
        self.parts.len()
    }

    /// The share of the lattice's voxels that the parts have, 0 to 1.
    pub fn covered(&self) -> f64 {
        self.voxels() as f64 / self.setup().grid.whole().voxels() as f64
    }

    /// Whether the parts have all voxels of the lattice.
    pub fn is_whole(&self) -> bool {
        self.voxels() == self.setup().grid.whole().voxels()
    }

    /// The voxels of all boxes, which share none.
    fn voxels(&self) -> usize {
        self.boxes.iter().map(Region::voxels).sum()
    }

    /// The smallest box that holds all voxels of the parts.
    pub fn bounds(&self) -> Region {
        let join = |a: Region, b: Region| Region {
            start: std::array::from_fn(|axis| a.start[axis].min(b.start[axis])),
            end: std::array::from_fn(|axis| a.end[axis].max(b.end[axis])),
        };
        self.boxes.iter().copied().reduce(join).unwrap_or(self.setup().grid.whole())
    }

    /// The frames that the parts have pictures of, ascending, each once.
    pub fn frames(&self) -> Vec<usize> {
        let mut frames: Vec<usize> = self.pictures.keys().map(|(_, frame)| *frame).collect();
        frames.sort_unstable();
        frames.dedup();
        frames
    }

    /// The files that the parts were made of, in the order of their frames.
    pub fn sources(&self) -> Vec<PartialSource> {
        let mut sources: Vec<PartialSource> =
            self.parts.iter().flat_map(|part| part.head.sources.iter().cloned()).collect();
        sources.sort_by_key(|source| source.frames);
        sources.dedup();
        sources
    }

    /// The times of frames.
    pub fn time_labels(&self) -> TimeLabels {
        Head::time_labels(self.setup(), &self.sources())
    }

    /// What a part left out as damaged, if any did.
    pub fn damage(&self) -> Option<String> {
        let damage = |part: &PartialFile| Some(format!("{}: {}", part.path().display(), part.head.damage.as_ref()?));
        self.parts.iter().find_map(damage)
    }

    /// Error bound of every splatted sample.
    pub fn sample_error(&self) -> f64 {
        self.parts.iter().map(|part| part.head.sample_error).fold(0.0, f64::max)
    }

    /// The views, by their numbers, that show some of the frames.
    fn views(&self, frames: &[usize]) -> Vec<usize> {
        let shown = self.pictures.keys().filter(|(_, frame)| frames.binary_search(frame).is_ok());
        let mut views: Vec<usize> = shown.map(|(view, _)| *view).collect();
        views.dedup();
        views
    }

    /// The settings of the pictures of these frames, with a limit of memory in bytes.
    ///
    /// # Errors
    /// A frame that no part has.
    pub fn config(&self, frames: &[usize], memory: usize) -> Result<RenderConfig> {
        let known = self.frames();
        if let Some(frame) = frames.iter().find(|frame| known.binary_search(frame).is_err()) {
            return Err(Error::setting("frames", format!("no part has a picture of frame {frame}")));
        }
        let views = self.views(frames);
        let frames = match &self.setup().paired {
            Some(paired) => views.iter().map(|view| paired[*view]).collect(),
            None => frames.to_vec(),
        };
        Ok(self.setup().config(&views, frames, memory))
    }

    /// The least memory in bytes that sums take, without the memory of the sink.
    pub fn least_memory(&self) -> usize {
        let buffers = 5 + 5 * self.setup().planes(true); // weights; sums, a record as read and unpacked, and the picture
        self.setup().pixels().saturating_mul(buffers * size_of::<f64>())
    }

    /// Makes the pictures of [`Self::config`] with these frames, and gives each to `sink`, view after view.
    ///
    /// # Errors
    /// Too little memory, damaged parts, or an error of `sink`.
    pub fn render(
        &self,
        frames: &[usize],
        progress: &dyn Progress,
        sink: &mut dyn FnMut(Rendered<'_>) -> Result<()>,
    ) -> Result<RenderReport> {
        let (started, config) = (Instant::now(), self.config(frames, self.memory)?);
        self.check_memory()?;
        let projection = Projection::new(&self.setup().grid, self.setup().blocks(), &config)?;
        let reports = projection.reports(&config);
        let steps = config.shown().len();
        progress.start(Some(steps as u64));
        for (n, (view, setup)) in self.views(frames).into_iter().zip(&projection.setups).enumerate() {
            let mut weights: Option<(Vec<usize>, WeightSums<'_>)> = None;
            for (frame, holders) in self.pictures_of_view(view, frames) {
                progress.check()?;
                let parts: Vec<usize> = holders.iter().map(|(part, _)| *part).collect();
                if weights.as_ref().is_none_or(|(weighed, _)| *weighed != parts) {
                    let own = self.weights(setup, &config, view, &parts)?;
                    weights = Some((parts, own));
                }
                let Some((_, weights)) = &weights else { continue };
                let (planes, missing) = self.sums(holders)?;
                let picture = picture(&config, weights, &planes, missing);
                sink(Rendered { views: &reports, view: n, frame, picture: &picture, error: None })?;
                progress.advance(1);
            }
        }
        progress.finish();
        let none = f64::NAN;
        let mut report = RenderReport { frames: config.frames.len(), views: reports, ..RenderReport::default() };
        report.views.iter_mut().for_each(|view| view.expected_error = none);
        (report.expected_error, report.certified_sample_error) = (none, self.sample_error());
        report.seconds = started.elapsed().as_secs_f64();
        Ok(report)
    }

    /// Writes the total of these frames as one partial sum, called `name` in messages.
    ///
    /// # Errors
    /// Frames that no part has, too little memory, damaged parts, or failed writes.
    pub fn join<W: Write>(&self, frames: &[usize], name: &Path, out: W, progress: &dyn Progress) -> Result<W> {
        self.config(frames, self.memory)?;
        self.check_memory()?;
        let mut writer = PartialWriter::new(name, out, self.setup().clone(), self.boxes.clone(), self.sources())?;
        let all =
            self.views(frames).into_iter().map(|view| (view, self.pictures_of_view(view, frames).collect::<Vec<_>>()));
        let all: Vec<_> = all.collect();
        progress.start(Some(all.iter().map(|(_, pictures)| pictures.len() as u64).sum()));
        for (view, pictures) in all {
            let parts = pictures.iter().take(1).flat_map(|(_, holders)| holders.iter().map(|(part, _)| *part));
            writer.put(PartialSums::Weights { view, sums: &self.weight_sums(view, &parts.collect::<Vec<_>>())? })?;
            for (frame, holders) in pictures {
                progress.check()?;
                let (planes, missing) = self.sums(holders)?;
                let planes: Vec<&[f64]> = planes.iter().map(Vec::as_slice).collect();
                writer.put(PartialSums::Picture { view, frame, planes: &planes, missing })?;
                progress.advance(1);
            }
        }
        progress.finish();
        writer.finish(self.sample_error(), self.damage())
    }

    /// The pictures of a view that show some of the frames.
    fn pictures_of_view<'a>(&'a self, view: usize, frames: &'a [usize]) -> impl Iterator<Item = (usize, &'a Holders)> {
        let all = self.pictures.range((view, 0)..=(view, usize::MAX));
        all.map(|((_, frame), holders)| (*frame, holders)).filter(|(frame, _)| frames.binary_search(frame).is_ok())
    }

    /// The sums of a picture, in the order of a record, and whether samples are missing.
    fn sums(&self, holders: &Holders) -> Result<(Vec<Vec<f64>>, bool)> {
        let record = |(part, n): &(usize, usize)| &self.parts[*part].head.pictures[*n];
        let missing = holders.iter().any(|holder| record(holder).missing);
        let mut planes = vec![vec![0.0; self.setup().pixels()]; self.setup().planes(missing)];
        for holder in holders {
            self.parts[holder.0].add_picture(record(holder), &mut planes, missing)?;
        }
        Ok((planes, missing))
    }

    /// The sums of weights of some parts.
    fn weight_sums(&self, view: usize, parts: &[usize]) -> Result<Vec<f64>> {
        let mut sums = vec![0.0; self.setup().pixels()];
        parts.iter().try_for_each(|part| self.parts[*part].add_weights(view, &mut sums))?;
        Ok(sums)
    }

    /// The weights of a view, with its background.
    fn weights<'a>(
        &self,
        setup: &'a ViewSetup,
        config: &RenderConfig,
        view: usize,
        parts: &[usize],
    ) -> Result<WeightSums<'a>> {
        let whole = [setup.clip];
        let boxes = if self.is_whole() { &whole[..] } else { &self.boxes };
        WeightSums::new(setup, self.weight_sums(view, parts)?, None).with_background(config, boxes)
    }

    fn check_memory(&self) -> Result<()> {
        let (least, [width, height]) = (self.least_memory(), self.setup().views[0].size);
        if least <= self.memory {
            return Ok(());
        }
        let mib = least.div_ceil(1 << 20);
        Err(Error::setting("memory", format!("sums of pictures of {width}x{height} pixels need at least {mib}MiB")))
    }

    /// An error unless every picture has the same voxels, each once.
    fn check_voxels(&self) -> Result<()> {
        let mut checked = HashSet::new();
        for ((_, frame), holders) in &self.pictures {
            let parts: Vec<usize> = holders.iter().map(|(part, _)| *part).collect();
            if !checked.insert(parts) {
                continue;
            }
            check_apart(&self.parts, holders)?;
            let own = boxes(&self.parts, holders);
            if own != self.boxes {
                return Err(self.uneven(*frame, holders, &own));
            }
        }
        Ok(())
    }

    /// The error of a frame that has other voxels than the first.
    fn uneven(&self, frame: usize, holders: &Holders, own: &[Region]) -> Error {
        let first = self.frames()[0];
        let name = |holders: &Holders| self.parts[holders[0].0].path().display().to_string();
        let lacking = self.boxes.iter().find(|voxels| !own.contains(voxels));
        let other = self.pictures.values().next().map(name).unwrap_or_default();
        let what = match lacking {
            Some(voxels) => {
                format!("frame {frame} lacks the voxels {voxels} that frame {first} has in {other}; a part is missing")
            }
            None => format!("frame {frame} has voxels that frame {first} lacks in {other}; a part is missing"),
        };
        Error::path(self.parts[holders[0].0].path(), what)
    }

    /// An error unless every view shows the same frames, if views are not paired with frames.
    fn check_frames(&self) -> Result<()> {
        if self.setup().paired.is_some() {
            return Ok(());
        }
        let frames = self.frames();
        let lacks =
            |view: usize| frames.iter().find(|frame| !self.pictures.contains_key(&(view, **frame))).map(|f| (view, *f));
        match (0..self.setup().views.len()).find_map(lacks) {
            None => Ok(()),
            Some((view, frame)) => {
                let path = self.parts[0].path();
                Err(Error::input(path, format!("neither this nor another part has frame {frame} from view {view}")))
            }
        }
    }
}

/// The picture of a total.
fn picture(config: &RenderConfig, weights: &WeightSums<'_>, planes: &[Vec<f64>], missing: bool) -> Vec<f32> {
    let channels = planes.chunks(1 + usize::from(missing));
    let finish =
        |channel: &[Vec<f64>]| finished(config.quantity, weights, &channel[0], channel.get(1).map(Vec::as_slice));
    let channels: Vec<Vec<f32>> = channels.map(finish).collect();
    match <[Vec<f32>; 1]>::try_from(channels) {
        Ok([only]) => only,
        Err(channels) => {
            (0..channels[0].len()).flat_map(|at| channels.iter().map(move |channel| channel[at])).collect()
        }
    }
}

/// An error unless two parts are of the same pictures.
fn check_alike(setup: &PictureSetup, first: &Path, part: &PartialFile) -> Result<()> {
    let Some(what) = setup.difference(&part.head.look) else { return Ok(()) };
    let first = first.display();
    Err(Error::path(part.path(), format!("is not of the same pictures as {first}: they differ in {what}")))
}

/// An error unless files with the same frames are the same.
fn check_sources(parts: &[PartialFile]) -> Result<()> {
    let mut all: Vec<(&PartialSource, &PartialFile)> =
        parts.iter().flat_map(|part| part.head.sources.iter().map(move |source| (source, part))).collect();
    all.sort_by_key(|(source, _)| source.frames);
    all.dedup_by(|(a, _), (b, _)| a == b);
    for pair in all.windows(2) {
        let [(a, first), (b, part)] = pair else { continue };
        if b.frames[0] < a.frames[1] {
            let first = first.path().display();
            let what = format!("was made of another file than {first}, with the same frames");
            return Err(Error::path(part.path(), what));
        }
    }
    Ok(())
}

/// The pictures of all parts, with the parts that add to each.
fn pictures(parts: &[PartialFile]) -> Result<BTreeMap<(usize, usize), Holders>> {
    let mut pictures: BTreeMap<(usize, usize), Holders> = BTreeMap::new();
    for (part, file) in parts.iter().enumerate() {
        for (n, PictureRecord { view, frame, .. }) in file.head.pictures.iter().enumerate() {
            let holders = pictures.entry((*view, *frame)).or_default();
            if holders.last().is_some_and(|(last, _)| *last == part) {
                return Err(Error::input(file.path(), format!("has frame {frame} from view {view} twice")));
            }
            holders.push((part, n));
        }
    }
    Ok(pictures)
}

/// The boxes of some parts, in the order of their voxels.
fn boxes(parts: &[PartialFile], holders: &Holders) -> Vec<Region> {
    let mut boxes: Vec<Region> = holders.iter().flat_map(|(part, _)| parts[*part].head.boxes.iter().copied()).collect();
    boxes.sort_by_key(order);
    boxes
}

/// An error if parts of a picture share voxels.
fn check_apart(parts: &[PartialFile], holders: &Holders) -> Result<()> {
    let boxes =
        |(part, _): &(usize, usize)| parts[*part].head.boxes.iter().map(|voxels| (*voxels, *part)).collect::<Vec<_>>();
    let mut all: Vec<(Region, usize)> = holders.iter().flat_map(boxes).collect();
    if all.len() > MOST_BOXES {
        return Err(Error::setting(
            "inputs",
            format!("hold more than {MOST_BOXES} boxes of voxels; take fewer, larger regions"),
        ));
    }
    all.sort_by_key(|(voxels, part)| (order(voxels), *part));
    for (n, (a, first)) in all.iter().enumerate() {
        let near = all[n + 1..].iter().take_while(|(b, _)| b.start[2] < a.end[2]);
        if let Some((b, other)) = near.into_iter().find(|(b, _)| !a.intersect(b).is_empty()) {
            let (part, before) = (&parts[*other.max(first)], parts[*other.min(first)].path().display());
            let what = match a == b {
                true => format!("has the same voxels and frames as {before}: {a}"),
                false => format!("shares voxels with {before}: {}", a.intersect(b)),
            };
            return Err(Error::path(part.path(), what));
        }
    }
    Ok(())
}

/// The key by which boxes are sorted: z, then y, then x.
fn order(voxels: &Region) -> [usize; 6] {
    let Region { start: [x, y, z], end: [u, v, w] } = *voxels;
    [z, y, x, w, v, u]
}

fn first_voxel(boxes: &[Region]) -> Option<[usize; 6]> {
    boxes.iter().map(order).min()
}
