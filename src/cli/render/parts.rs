//! Pictures in parts: what some voxels or frames add to them, and pictures of such parts.

use super::along::ModeName;
use super::args::{Cli, ErrorName, MethodName, QuantityName};
use super::colouring::ColouredPictures;
use super::conflicts;
use super::ranges::Ranges;
use super::report::{Reported, summary, unit};
use super::scene::Opened;
use super::targets::Targets;
use crate::base::error::{Error, Result};
use crate::base::grid::Region;
use crate::base::output::Output;
use crate::base::progress::Progress;
use crate::cli::spare_inputs;
use crate::file::shard::ShardPlace;
use crate::file::{CoefficientFile, setting};
use crate::render::annotate::AxisLabels;
use crate::render::parts::{Look, PartFile, PartWriter, Source, Total, is_part};
use crate::render::sink::Provenance;
use crate::render::{Quantity, RenderConfig, RenderReport, Scene, Sums, render_sums};
use clap::Args;
use serde::Serialize;

/// Options for pictures in parts.
#[derive(Debug, Args)]
pub(crate) struct PartArgs {
    /// Instead of pictures, write a file for --sum: the sums over the voxels of --region, or over the frames of a
    /// shard. Framing and splatting are those of the whole volume. Projections only
    #[arg(long, conflicts_with_all = conflicts::of_sums(), help_heading = "Parts")]
    pub(crate) partial: bool,
    /// Add the files that --partial wrote, and make pictures of the sums; with --partial, write one file of the sums.
    /// Give --annotate and --title to the parts too, since they move the volume aside
    #[arg(long, conflicts_with_all = conflicts::of_parts(), help_heading = "Parts")]
    pub(crate) sum: bool,
}

/// The report of `--json` about a part.
#[derive(Serialize)]
struct PartReport<'a> {
    #[serde(flatten)]
    report: &'a RenderReport,
    /// The voxels of the part: the first, and the end (exclusive), along x, y, z.
    voxels: Region,
    /// The frames of the part, as the archive numbers them.
    frame_numbers: &'a [usize],
    file_bytes_read: u64,
    file_bytes: u64,
}

/// The report of `--json` about a sum.
#[derive(Serialize)]
struct SumReport<'a> {
    #[serde(flatten)]
    pictures: &'a Reported<'a>,
    #[serde(flatten)]
    of: Summed,
}

/// The parts that make up a sum.
#[derive(Serialize)]
struct Summed {
    parts: usize,
    /// The share of the lattice's voxels that the parts have.
    covered: f64,
}

impl Summed {
    fn of(total: &Total) -> Self {
        Self { parts: total.parts(), covered: total.covered() }
    }
}

/// A part before its first sums.
struct Planned {
    look: Look,
    source: Source,
    /// The settings, with frames as the file numbers them.
    config: RenderConfig,
    /// The numbers of the views in `config`, as the look has them.
    views: Vec<usize>,
    voxels: Region,
}

impl Cli {
    /// Takes the settings of a sum from its first part.
    pub(crate) fn imply_look(&mut self) -> Result<()> {
        let Some(first) = self.inputs.first().filter(|_| self.parts.sum) else { return Ok(()) };
        let look = PartFile::open(first, self.common.memory.0)?.head.look;
        self.size.0 = look.views[0].size;
        self.tolerance = look.tolerance.map(|(share, _)| share);
        self.method = if look.direct { MethodName::Direct } else { MethodName::Coefficients };
        self.quantity = match look.quantity {
            Quantity::Mean => QuantityName::Mean,
            Quantity::Emission => QuantityName::Emission,
        };
        Ok(())
    }

    /// Whether the run writes or adds parts.
    pub(crate) fn is_of_parts(&self) -> bool {
        self.parts.partial || self.parts.sum
    }

    /// Writes a part, or the sum of parts.
    pub(crate) fn work_on_parts(&self, progress: Option<&dyn Progress>) -> Result<()> {
        match self.parts.sum {
            true => self.write_sum(progress),
            false => self.write_part(progress),
        }
    }

    /// The file of a part that is to be written.
    fn part_output(&self) -> Result<Output> {
        spare_inputs(&self.inputs, &self.output)?;
        Output::create(&self.output, self.force || is_part(&self.output))
    }

    fn write_part(&self, progress: Option<&dyn Progress>) -> Result<()> {
        self.refuse_for_parts()?;
        let Opened { mut scene, file, exaggeration, annotation, axes, .. } = self.scene()?;
        let file =
            file.ok_or_else(|| Error::usage("--partial: takes a coefficient file, not frames; convert them first"))?;
        let labels = (annotation.values, axes.labels(), exaggeration);
        let Planned { look, source, config, views, voxels } = self.plan_part(scene.as_ref(), &file, labels)?;
        let frames: Vec<usize> = config.frames.iter().map(|frame| frame + source.frames[0]).collect();
        let first = source.frames[0];
        let mut writer = PartWriter::new((&self.output, self.part_output()?), look, (vec![voxels], vec![source]))?;
        let terminal = self.common.progress("render", unit(&config.mode));
        let report = match frames.is_empty() {
            true => {
                self.common.note("the file has none of these frames, so the part is empty");
                RenderReport::default()
            }
            false => render_sums(scene.as_mut(), &config, progress.unwrap_or(&terminal), &mut |sums| {
                writer.put(numbered(sums, &views, first))
            })?,
        };
        let skipped = file.refuse_skipped();
        let damage = skipped.as_ref().err().map(ToString::to_string);
        writer.finish(report.certified_sample_error, damage)?.commit()?;
        self.common.detail(summary(&report));
        self.common.detail_read(file.bytes_read(), file.bytes());
        let (file_bytes_read, file_bytes) = (file.bytes_read(), file.bytes());
        let of_part = PartReport { report: &report, voxels, frame_numbers: &frames, file_bytes_read, file_bytes };
        self.common.report(&of_part, false)?;
        skipped
    }

    /// An error if the pictures are not sums.
    fn refuse_for_parts(&self) -> Result<()> {
        let instead = "render them whole, perhaps with --lod, or each shard of time by itself: its frames are whole";
        let what = match self.along.mode_name() {
            ModeName::Projection if self.error == ErrorName::Expected && self.tolerance.is_some() => {
                return Err(Error::usage(
                    "--error expected: weighs all blocks of a picture, and a part has some; take certified",
                ));
            }
            ModeName::Projection => return Ok(()),
            ModeName::Mip => "largest values along rays are no sums, and lie between voxels on both sides of a border",
            ModeName::Composite => "near samples hide far ones, so composites are no sums",
            ModeName::Iso => "near surfaces hide far ones, so they are no sums",
            ModeName::Slice => "slices are no sums, and show single samples; --region is not needed for them",
        };
        Err(Error::usage(format!("--partial: {what}; {instead}")))
    }

    /// Plans a part: the settings that all parts share, and its own views, frames and voxels.
    fn plan_part(
        &self,
        scene: &dyn Scene,
        file: &CoefficientFile,
        (values, axes, exaggeration): (String, [AxisLabels; 3], f64),
    ) -> Result<Planned> {
        let (standing, m) = (ShardPlace::from_file(file)?, file.metadata());
        let mut config = self.config_of(scene, Some(file), None, standing.all)?;
        let tolerance = self.tolerance.zip(config.allowed);
        let look = Look {
            archive: standing.archive,
            frames: standing.all,
            channels: scene.channels(),
            grid: *scene.grid(),
            block: scene.blocks().edges,
            whole: file.whole_grid(),
            lod: file.lod(),
            exaggeration,
            direct: self.method == MethodName::Direct,
            quantity: config.quantity,
            kernel: config.kernel,
            splat_error: config.splat_error,
            quick: config.quick,
            tolerance,
            views: config.views.clone(),
            paired: config.paired.then(|| config.frames.clone()),
            values,
            axes,
            time_unit: setting(m, "time-units").unwrap_or_default().into(),
            calendar: setting(m, "calendar").map(Into::into),
        };
        let frames = [standing.frames.start, standing.frames.end];
        let source = Source { file: file.id().to_string(), frames, times: m.times.clone() };
        let voxels = config.region.unwrap_or(scene.grid().whole());
        let held = |frame: &usize| standing.frames.contains(frame);
        let of_view = |view: &usize| !config.paired || held(&config.frames[*view]);
        let views: Vec<usize> = (0..config.views.len()).filter(of_view).collect();
        config.views = views.iter().map(|view| config.views[*view]).collect();
        config.frames.retain(held);
        config.frames.iter_mut().for_each(|frame| *frame -= frames[0]);
        Ok(Planned { look, source, config, views, voxels })
    }

    fn write_sum(&self, progress: Option<&dyn Progress>) -> Result<()> {
        let terminal = self.common.progress("parts", "parts");
        let total = Total::open(&self.inputs, self.common.memory.0, progress.unwrap_or(&terminal))?;
        let all = || Ok(total.frames());
        let frames = self.frames.as_ref().map_or_else(all, |frames| frames.resolve(total.look().frames))?;
        self.note_gaps(&total);
        let terminal = self.common.progress("sum", "pictures");
        let progress = progress.unwrap_or(&terminal);
        if self.parts.partial {
            total.join(&frames, (&self.output, self.part_output()?), progress)?.commit()?;
            self.common.report(&Summed::of(&total), false)?;
        } else {
            self.write_pictures(&total, &frames, progress)?;
        }
        let lacks = |damage| Err(Error::input(&self.output, format!("lacks what a part left out: {damage}")));
        total.damage().map_or(Ok(()), lacks)
    }

    /// Notes which voxels and frames the parts lack.
    fn note_gaps(&self, total: &Total) {
        if !total.is_whole() {
            let percent = 100.0 * total.covered();
            self.common.note(format_args!("the parts have {percent:.3} % of the voxels; pictures show these alone"));
        }
        let mut next = 0;
        let ends = [total.look().frames; 2];
        for [first, behind] in total.sources().iter().map(|of| of.frames).chain([ends]) {
            if next < first && self.frames.is_none() {
                self.common.note(format_args!("no part was made of the frames {next}:{first}"));
            }
            next = next.max(behind);
        }
    }

    fn write_pictures(&self, total: &Total, frames: &[usize], progress: &dyn Progress) -> Result<()> {
        let config = total.config(frames, self.common.memory.0)?;
        let targets = self.targets(&config)?;
        self.check_memory_of_sum(total, &targets.0, &config)?;
        let (look, pictures) = (total.look(), &targets.0);
        let ranges = |(needed, _)| if needed { self.ranges_of(total, frames) } else { Ok(Ranges::default()) };
        let colouring = self.colouring(look.channels, &config, (pictures, None), None, ranges)?;
        let annotation = self.annotation(look.values.clone(), total.time_labels());
        let provenance = Provenance {
            annotate: self.around.words(),
            title: Some(annotation.title.clone()).filter(|title| !title.is_empty()),
            bar_title: self.around.bar_title(),
            ..self.provenance(&look.grid, &config, (None, &annotation.times), &colouring)
        };
        let provenance = of_parts(provenance, total);
        let mut annotation = annotation;
        annotation.axes = Some(self.axes_in(look.axes.clone(), &look.whole, (&config, whole_voxels(total))));
        self.note_title(&annotation, &config);
        let mut sinks = self.sinks(&config, (pictures, None), &colouring, (&provenance, annotation))?;
        let report = total.render(frames, progress, &mut |rendered| sinks.picture(&rendered))?;
        sinks.finish()?;
        let (parts, shown, seconds) = (total.parts(), config.shown().len(), report.seconds);
        self.common.detail(format_args!("{parts} parts added to {shown} pictures in {seconds:.3} s"));
        self.note_errors(&report);
        self.report_sum(total, &report, (&provenance, colouring.coloured()))
    }

    fn report_sum(
        &self,
        total: &Total,
        report: &RenderReport,
        (picture, coloured): (&Provenance, ColouredPictures),
    ) -> Result<()> {
        let pictures = &Reported { report, picture, coloured, file_bytes_read: None, file_bytes: None };
        self.report(&SumReport { pictures, of: Summed::of(total) })
    }

    fn check_memory_of_sum(&self, total: &Total, targets: &Targets, config: &RenderConfig) -> Result<()> {
        let needed = total.least_memory().saturating_add(targets.memory(self.depth, config)?);
        if needed <= self.common.memory.0 {
            return Ok(());
        }
        let mib = needed.div_ceil(1 << 20);
        Err(Error::setting("memory", format!("sums and their pictures need at least {mib}MiB")))
    }

    /// The ranges of the pictures of a few frames.
    fn ranges_of(&self, total: &Total, frames: &[usize]) -> Result<Ranges> {
        let progress = self.common.progress("range", "pictures");
        Ranges::of_pictures(frames, |some, give| {
            total.render(some, &progress, &mut |rendered| {
                give(rendered.picture);
                Ok(())
            })?;
            Ok(())
        })
    }
}

/// Sums with the numbers that views and frames have in the archive.
fn numbered<'a>(sums: Sums<'a>, views: &[usize], first: usize) -> Sums<'a> {
    match sums {
        Sums::Weights { view, sums } => Sums::Weights { view: views[view], sums },
        Sums::Picture { view, frame, planes, missing } => {
            Sums::Picture { view: views[view], frame: frame + first, planes, missing }
        }
    }
}

/// The voxels of a sum, on the lattice of all voxels.
fn whole_voxels(total: &Total) -> Region {
    let (look, Region { start, end }) = (total.look(), total.bounds());
    let step = 1 << look.lod;
    let last = |axis: usize| (end[axis] * step).min(look.whole.dims[axis]);
    Region { start: start.map(|n| n * step), end: [0, 1, 2].map(last) }
}

/// Adds the settings stored in the parts.
fn of_parts(provenance: Provenance, total: &Total) -> Provenance {
    let (look, sources) = (total.look(), total.sources());
    Provenance {
        lod: Some(look.lod).filter(|lod| *lod > 0),
        exaggerate: Some(look.exaggeration).filter(|factor| *factor != 1.0),
        region: (!total.is_whole()).then(|| total.bounds().to_string()),
        sample_error: Some(total.sample_error()),
        file_id: (sources.len() == 1).then(|| sources[0].file.clone()),
        ..provenance
    }
}
