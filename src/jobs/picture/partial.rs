//! Partial sums of pictures: what some voxels or frames add to them, and pictures of such sums.

use super::plan::annotations::{annotation, axes_of_region, note_scale, note_title};
use super::plan::colouring::ColouredPictures;
use super::plan::colouring::ColouringInput;
use super::plan::config::{frames_of, render_config};
use super::plan::modes::{check_slices, mode_name, unit};
use super::plan::opened::Opened;
use super::plan::pixels::rays;
use super::plan::provenance::provenance;
use super::plan::ranges::Needed;
use super::plan::ranges::{KnownSamples, Ranges};
use super::plan::sinks::SinkInput;
use super::plan::targets::AllTargets;
use super::report::Outcome;
use super::report::{Reported, note_errors, summary, written};
use super::reporter::Reporter;
use super::request::PictureRequest;
use super::session::Session;
use super::values::{BeyondSpec, ModeName};
use crate::report::report_text;
use serde::Serialize;
use std::path::PathBuf;
use wavesplat_core::base::error::{Error, Result};
use wavesplat_core::base::grid::Region;
use wavesplat_core::base::inputs::spare_inputs;
use wavesplat_core::base::memory;
use wavesplat_core::base::output::Output;
use wavesplat_engine::file::shard::ShardPlace;
use wavesplat_engine::file::{CoefficientFile, setting};
use wavesplat_engine::render::partial::{
    PartialFile, PartialSource, PartialTotal, PartialWriter, PictureSetup, is_partial,
};
use wavesplat_engine::render::sink::Provenance;
use wavesplat_engine::render::{Limit, PartialSums, RenderConfig, RenderReport, SplatSource, render_sums};

/// The report of `--json` about a part.
#[derive(Serialize)]
struct PartialReport<'a> {
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
    summed: Summed,
}

/// The parts that make up a sum.
#[derive(Serialize)]
struct Summed {
    parts: usize,
    /// The share of the lattice's voxels that the parts have.
    covered: f64,
}

impl Summed {
    fn new(total: &PartialTotal) -> Self {
        Self { parts: total.parts(), covered: total.covered() }
    }
}

/// A part before its first sums.
struct Planned {
    setup: PictureSetup,
    source: PartialSource,
    /// The settings, with frames as the file numbers them.
    config: RenderConfig,
    /// The numbers of the views in `config`, as the setup has them.
    views: Vec<usize>,
    voxels: Region,
}

/// Takes the settings of the pictures from the first of some partial sums.
pub(super) fn imply_setup(request: &PictureRequest, inputs: &[PathBuf], memory: usize) -> Result<PictureRequest> {
    let Some(first) = inputs.first() else { return Ok(request.clone()) };
    let setup = PartialFile::open(first, memory)?.head.look;
    let mut request = request.clone();
    request.size.0 = setup.views[0].size;
    request.tolerance = setup.tolerance.map(|(share, _)| share);
    request.method = if setup.direct { SplatSource::Samples } else { SplatSource::Coefficients };
    request.quantity = setup.quantity;
    Ok(request)
}

/// The file of a partial sum that is to be written.
fn partial_output(request: &PictureRequest, inputs: &[PathBuf]) -> Result<Output> {
    spare_inputs(inputs, &request.output)?;
    Output::create(&request.output, request.force || is_partial(&request.output))
}

/// Writes a partial sum.
pub(super) fn write_partial(session: &Session, request: &PictureRequest, reporter: &dyn Reporter) -> Result<Outcome> {
    check_slices(request)?;
    refuse_for_partial(request)?;
    let opened = Opened::new(session, request, reporter)?;
    let Some(file) = opened.file.clone() else {
        return Err(Error::setting("partial", "takes a coefficient file, not frames; convert them first"));
    };
    let Planned { setup, source, config, views, voxels } = plan_partial(request, &opened, &file, session.memory)?;
    let first = source.frames[0];
    let frames: Vec<usize> = config.frames.iter().map(|frame| frame + first).collect();
    let output = partial_output(request, session.paths())?;
    let mut writer = PartialWriter::new(&request.output, output, setup, vec![voxels], vec![source])?;
    let (progress, mut scene) = (reporter.progress("render", unit(&config.mode)), opened.scene);
    let report = match frames.is_empty() {
        true => {
            reporter.note(format_args!("the file has none of these frames, so the part is empty"));
            RenderReport::default()
        }
        false => render_sums(scene.as_mut(), &config, progress.as_ref(), &mut |sums| {
            writer.put(numbered(sums, &views, first))
        })?,
    };
    let skipped = file.refuse_skipped();
    let damage = skipped.as_ref().err().map(ToString::to_string);
    writer.finish(report.certified_sample_error, damage)?.commit()?;
    reporter.detail(format_args!("{}", summary(&report)));
    reporter.detail_read(file.bytes_read(), file.bytes());
    let (file_bytes_read, file_bytes) = (file.bytes_read(), file.bytes());
    let report = PartialReport { report: &report, voxels, frame_numbers: &frames, file_bytes_read, file_bytes };
    Ok(Outcome { report: report_text(&report)?, is_on_stdout: false, end: skipped })
}

/// An error if the pictures are not sums.
fn refuse_for_partial(request: &PictureRequest) -> Result<()> {
    let instead = "render them whole, perhaps with `lod`, or each shard of time by itself: its frames are whole";
    let what = match mode_name(request) {
        ModeName::Projection if request.error == Limit::Expected && request.tolerance.is_some() => {
            return Err(Error::value(
                "error",
                "expected",
                "needs all blocks of a picture, and a part has only some; take certified",
            ));
        }
        ModeName::Projection => return Ok(()),
        ModeName::Mip => "largest values along rays are no sums, and lie between voxels on both sides of a border",
        ModeName::Composite => "near samples hide far ones, so composites are no sums",
        ModeName::Iso => "near surfaces hide far ones, so they are no sums",
        ModeName::Slice => "slices are no sums, and show single samples; `region` is not needed for them",
    };
    Err(Error::setting("partial", format!("{what}; {instead}")))
}

/// Plans a partial sum: the settings that all parts share, and its own views, frames and voxels.
fn plan_partial(request: &PictureRequest, opened: &Opened, file: &CoefficientFile, memory: usize) -> Result<Planned> {
    let (standing, scene) = (ShardPlace::from_file(file)?, opened.scene.as_ref());
    let mut config = render_config(request, scene, Some(file), &opened.axes, None, standing.all, memory)?;
    let setup = shared_setup(request, opened, file, &config, &standing);
    let frames = [standing.frames.start, standing.frames.end];
    let source = PartialSource { file: file.id().to_string(), frames, times: file.metadata().times.clone() };
    let voxels = config.region.unwrap_or(scene.grid().whole());
    let held = |frame: &usize| standing.frames.contains(frame);
    let is_held = |view: &usize| !config.paired || held(&config.frames[*view]);
    let views: Vec<usize> = (0..config.views.len()).filter(is_held).collect();
    config.views = views.iter().map(|view| config.views[*view]).collect();
    config.frames.retain(held);
    config.frames.iter_mut().for_each(|frame| *frame -= frames[0]);
    Ok(Planned { setup, source, config, views, voxels })
}

/// The settings that all parts of a picture share.
fn shared_setup(
    request: &PictureRequest,
    opened: &Opened,
    file: &CoefficientFile,
    config: &RenderConfig,
    standing: &ShardPlace,
) -> PictureSetup {
    let (scene, m) = (opened.scene.as_ref(), file.metadata());
    PictureSetup {
        archive: standing.archive.clone(),
        frames: standing.all,
        channels: scene.channels(),
        grid: *scene.grid(),
        block: scene.blocks().edges,
        whole: file.whole_grid(),
        lod: file.lod(),
        exaggeration: opened.exaggeration,
        direct: request.method == SplatSource::Samples,
        quantity: config.quantity,
        kernel: config.kernel,
        splat_error: config.splat_error,
        fast: config.fast,
        tolerance: request.tolerance.zip(config.allowed),
        views: config.views.clone(),
        paired: config.paired.then(|| config.frames.clone()),
        values: opened.annotation.values.clone(),
        axes: opened.axes.labels(),
        time_unit: setting(m, "time-units").unwrap_or_default().into(),
        calendar: setting(m, "calendar").map(Into::into),
    }
}

/// Adds partial sums: to pictures, or to one partial sum.
pub(super) fn add_partials(session: &Session, request: &PictureRequest, reporter: &dyn Reporter) -> Result<Outcome> {
    let progress = reporter.progress("parts", "parts");
    let total = PartialTotal::open(session.paths(), session.memory, progress.as_ref())?;
    let frames = match request.frames {
        Some(_) => frames_of(request, total.setup().frames)?,
        None => total.frames(),
    };
    note_gaps(request, &total, reporter);
    let sum = Sum { session, request, reporter, total: &total, frames: &frames };
    let report = if request.partial { sum.write_partial()? } else { sum.write_pictures()? };
    let lacks = |damage| Err(Error::input(&request.output, format!("lacks what a part left out: {damage}")));
    let is_on_stdout = !request.partial && request.writes_to_stdout();
    Ok(Outcome { report, is_on_stdout, end: total.damage().map_or(Ok(()), lacks) })
}

/// Notes which voxels and frames the parts lack.
fn note_gaps(request: &PictureRequest, total: &PartialTotal, reporter: &dyn Reporter) {
    if !total.is_whole() {
        let percent = 100.0 * total.covered();
        reporter.note(format_args!("the parts have {percent:.3} % of the voxels; pictures show these alone"));
    }
    let mut next = 0;
    let ends = [total.setup().frames; 2];
    for [first, behind] in total.sources().iter().map(|source| source.frames).chain([ends]) {
        if next < first && request.frames.is_none() {
            reporter.note(format_args!("no part was made of the frames {next}:{first}"));
        }
        next = next.max(behind);
    }
}

/// Partial sums that are added.
struct Sum<'a> {
    session: &'a Session,
    request: &'a PictureRequest,
    reporter: &'a dyn Reporter,
    total: &'a PartialTotal,
    frames: &'a [usize],
}

impl Sum<'_> {
    /// Writes one partial sum. Returns its report.
    fn write_partial(&self) -> Result<String> {
        let progress = self.reporter.progress("sum", "pictures");
        let output = partial_output(self.request, self.session.paths())?;
        self.total.join(self.frames, &self.request.output, output, progress.as_ref())?.commit()?;
        report_text(&Summed::new(self.total))
    }

    /// Writes pictures. Returns their report.
    fn write_pictures(&self) -> Result<String> {
        let Self { request, reporter, total, .. } = *self;
        let progress = reporter.progress("sum", "pictures");
        let config = total.config(self.frames, self.session.memory)?;
        let targets = AllTargets::new(request, self.session.paths(), &config)?;
        self.check_memory(&targets, &config)?;
        let setup = total.setup();
        // Rays are those through the voxels that are there.
        let seen = RenderConfig { region: Some(total.bounds()), ..config.clone() };
        let input = ColouringInput {
            request,
            channels: setup.channels,
            config: &config,
            pictures: &targets.pictures,
            errors: None,
            colours: None,
            known: KnownSamples { least: None, are_of_body: setup.axes.iter().any(|axis| axis.sides.is_some()) },
        };
        let ranges =
            |needed: Needed| if needed.pictures { self.ranges(&seen, needed.beyond) } else { Ok(Ranges::default()) };
        let colouring = input.colouring(ranges, reporter)?;
        let mut annotation = annotation(request, setup.values.clone(), total.time_labels());
        let provenance = provenance(request, &setup.grid, &config, None, &annotation.times, &colouring);
        let provenance = with_parts(provenance, total);
        annotation.axes =
            Some(axes_of_region(setup.axes.clone(), &setup.whole, whole_voxels(total), &config, setup.exaggeration));
        note_scale(&annotation, reporter);
        note_title(request, &annotation, &config, reporter);
        let (targets, annotation) = (&targets, &annotation);
        let (grid, colouring, provenance) = (&setup.grid, &colouring, &provenance);
        let mut sinks =
            SinkInput { request, grid, config: &seen, targets, colouring, provenance, annotation }.open()?;
        let report = total.render(self.frames, progress.as_ref(), &mut |rendered| sinks.picture(&rendered))?;
        sinks.finish()?;
        let (parts, shown, seconds) = (total.parts(), config.shown().len(), report.seconds);
        reporter.detail(format_args!("{parts} parts added to {shown} pictures in {seconds:.3} s"));
        note_errors(request, &report, reporter);
        self.report(&report, provenance, colouring.coloured())
    }

    fn report(&self, report: &RenderReport, picture: &Provenance, coloured: ColouredPictures) -> Result<String> {
        let peak_bytes = memory::peak();
        let pictures = &Reported { report, picture, coloured, peak_bytes, file_bytes_read: None, file_bytes: None };
        written(self.request, &SumReport { pictures, summed: Summed::new(self.total) })
    }

    fn check_memory(&self, targets: &AllTargets, config: &RenderConfig) -> Result<()> {
        let for_targets = targets.pictures.memory(self.request.depth, config)?;
        let needed = self.total.least_memory().saturating_add(for_targets);
        if needed <= self.session.memory {
            return Ok(());
        }
        let mib = needed.div_ceil(1 << 20);
        Err(Error::setting("memory", format!("sums and their pictures need at least {mib}MiB")))
    }

    /// The ranges of the pictures of a few frames.
    fn ranges(&self, config: &RenderConfig, beyond: BeyondSpec) -> Result<Ranges> {
        let progress = self.reporter.progress("range", "pictures");
        let (rays, size) = (rays(config, &self.total.setup().grid), config.views[0].size);
        Ranges::from_pictures(self.frames, beyond, &rays, size, |some, give| {
            self.total.render(some, progress.as_ref(), &mut |rendered| {
                give(&rendered);
                Ok(())
            })?;
            Ok(())
        })
    }
}

/// Partial sums with the numbers that views and frames have in the archive.
fn numbered<'a>(sums: PartialSums<'a>, views: &[usize], first: usize) -> PartialSums<'a> {
    match sums {
        PartialSums::Weights { view, sums } => PartialSums::Weights { view: views[view], sums },
        PartialSums::Picture { view, frame, planes, missing } => {
            PartialSums::Picture { view: views[view], frame: frame + first, planes, missing }
        }
    }
}

/// The voxels of a sum, on the lattice of all voxels.
fn whole_voxels(total: &PartialTotal) -> Region {
    let (setup, Region { start, end }) = (total.setup(), total.bounds());
    let step = 1 << setup.lod;
    let last = |axis: usize| (end[axis] * step).min(setup.whole.dims[axis]);
    Region { start: start.map(|n| n * step), end: [0, 1, 2].map(last) }
}

/// Adds the settings stored in the parts.
fn with_parts(provenance: Provenance, total: &PartialTotal) -> Provenance {
    let (setup, sources) = (total.setup(), total.sources());
    Provenance {
        lod: Some(setup.lod).filter(|lod| *lod > 0),
        exaggerate: Some(setup.exaggeration).filter(|factor| *factor != 1.0),
        region: (!total.is_whole()).then(|| total.bounds().to_string()),
        sample_error: Some(total.sample_error()),
        file_id: (sources.len() == 1).then(|| sources[0].file.clone()),
        ..provenance
    }
}
