//! Options for reading an archive.

use super::{CommonArgs, RemoteArgs, note_text};
use super::{Dims, FrameRange, Numbers, Pair, RegionSpec, TimesSpec, Triple, times};
use clap::{Args, ValueEnum};
use std::fmt;
use std::path::PathBuf;
use std::str::FromStr;
use wavesplat_core::base::error::{Error, Result};
use wavesplat_core::base::mapped::Access;
use wavesplat_core::base::sample::SampleType;
use wavesplat_core::source::follow::Follow;
use wavesplat_core::source::{self, FrameSource, OpenOptions, RegularTimes, Selection, VariableInfo, with_times};
use wavesplat_engine::file::CoefficientFile;
use wavesplat_engine::file::{setting, units};
use wavesplat_formats as formats;
use wavesplat_jobs::axes::Axes;
use wavesplat_jobs::picture::is_coefficient_name;

/// The order of a sample's bytes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Endian {
    /// Least significant byte first
    Little,
    /// Most significant byte first
    Big,
}

impl fmt::Display for Endian {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(if *self == Self::Big { "big" } else { "little" })
    }
}

impl FromStr for Endian {
    type Err = String;

    fn from_str(text: &str) -> std::result::Result<Self, String> {
        ValueEnum::from_str(text, false)
    }
}

/// Options for reading an archive.
#[derive(Debug, Clone, Args)]
pub struct InputArgs {
    /// Voxels (and frames) of headerless data, x fastest: NXxNYxNZ or NXxNYxNZxNT
    #[arg(long, value_name = "DIMS", help_heading = "Input")]
    pub dims: Option<Dims>,
    /// Sample type of headerless data: u8 i8 u16 i16 u32 i32 f16 f32 f64
    #[arg(long, value_name = "TYPE", help_heading = "Input")]
    pub dtype: Option<SampleType>,
    /// Byte order of headerless data [default: little]
    #[arg(long, value_enum, value_name = "ORDER", help_heading = "Input")]
    pub endian: Option<Endian>,
    /// Bytes before the first sample of each headerless file [default: 0]
    #[arg(long, value_name = "BYTES", help_heading = "Input")]
    pub offset: Option<u64>,
    /// Name of the array to read
    #[arg(long, value_name = "NAME", help_heading = "Input")]
    pub variable: Option<String>,
    /// Read the length of a vector: the names of its components' arrays, separated by commas
    #[arg(long, value_name = "NAMES", conflicts_with = "variable", value_delimiter = ',', help_heading = "Input")]
    pub magnitude: Vec<String>,
    /// Meaning of the axes of a file's array, slowest first: letters of tzyx, c for another axis
    #[arg(long, value_name = "LETTERS", help_heading = "Input")]
    pub axes: Option<String>,
    /// World units between voxels, instead of those in the files: SX,SY,SZ
    #[arg(long, value_name = "SX,SY,SZ", help_heading = "Input")]
    pub spacing: Option<Triple>,
    /// World position of the first voxel, instead of that in the files: X,Y,Z
    #[arg(long, value_name = "X,Y,Z", allow_hyphen_values = true, help_heading = "Input")]
    pub origin: Option<Triple>,
    /// Times of the frames, instead of the times in the files: START,STEP, or a text file with one number on each line
    #[arg(
        long,
        value_name = "FILE|START,STEP",
        allow_hyphen_values = true,
        conflicts_with = "dt",
        help_heading = "Input"
    )]
    pub times: Option<TimesSpec>,
    /// Time from frame to frame, from 0 on, instead of the times in the files
    #[arg(long, value_name = "STEP", value_parser = times::step, allow_hyphen_values = true, help_heading = "Input")]
    pub dt: Option<f64>,
    /// Unit of times, instead of that in the files: s, or "days since 2000-01-01"
    #[arg(long, value_name = "TEXT", help_heading = "Input")]
    pub time_unit: Option<String>,
    /// Accept gaps in the numbers of frame files
    #[arg(long, help_heading = "Input")]
    pub allow_gaps: bool,
    /// Read files instead of mapping them (for network file systems and files that may change)
    #[arg(long, help_heading = "Input")]
    pub no_mmap: bool,
    /// The run that writes the inputs, if it goes on
    #[arg(skip)]
    pub follow: Option<Follow>,
    /// The number of variables that are read in turn
    #[arg(skip = 1_usize)]
    pub in_turn: usize,
}

impl InputArgs {
    /// How the bytes of files are read.
    pub fn access(&self) -> Access {
        Access::unless(self.no_mmap)
    }

    /// How frames are read. Decoded or piped frames may take `memory` bytes.
    ///
    /// # Errors
    /// A list of times that cannot be read.
    pub fn open_options(&self, memory: usize) -> Result<OpenOptions> {
        Ok(OpenOptions { times: times::given(self.times.as_ref(), self.dt)?, ..self.options(memory) })
    }

    /// Opens an archive and prints no notes. Decoded or piped frames may take `memory` bytes.
    pub fn open_quietly(&self, inputs: &[PathBuf], memory: usize) -> Result<Box<dyn FrameSource>> {
        formats::open(inputs, &self.open_options(memory)?)
    }

    /// The variables among which `--variable` must choose; none if the archive can be opened without it.
    pub fn undecided(&self, inputs: &[PathBuf], memory: usize) -> Result<Vec<VariableInfo>> {
        formats::undecided(inputs, &self.options(memory))
    }

    /// The variables that `--variable` can choose.
    pub fn variables(&self, inputs: &[PathBuf], memory: usize) -> Result<Vec<VariableInfo>> {
        formats::variables(inputs, &self.options(memory))
    }

    /// All options but times, which may be in a file.
    fn options(&self, memory: usize) -> OpenOptions {
        OpenOptions {
            access: self.access(),
            dims: self.dims.as_ref().map(|d| d.0.clone()),
            sample: self.dtype,
            big_endian: self.endian == Some(Endian::Big),
            offset: self.offset.unwrap_or(0),
            dims_are_remembered: false,
            variable: self.variable.clone(),
            variable_is_remembered: false,
            magnitude: self.magnitude.clone(),
            axes: self.axes.clone(),
            spacing: self.spacing.map(|s| s.0),
            origin: self.origin.map(|o| o.0),
            times: None,
            time_unit: self.time_unit.clone(),
            calendar: None,
            clock: None,
            allow_gaps: self.allow_gaps,
            memory,
            follow: self.follow.clone(),
            in_turn: self.in_turn,
        }
    }

    /// Opens an archive, and prints notes on how it is read.
    pub fn open(&self, inputs: &[PathBuf], common: &CommonArgs) -> Result<Box<dyn FrameSource>> {
        let source = self.open_quietly(inputs, common.stream_memory())?;
        source.archive().notes.iter().for_each(|n| common.note(note_text(n)));
        Ok(source)
    }

    /// The given options, as words of a command.
    pub(super) fn words(&self) -> Vec<String> {
        let times = match &self.times {
            Some(TimesSpec::File(path)) => Some(path.display().to_string()),
            Some(TimesSpec::Regular(times)) => Some(times.to_string()),
            None => None,
        };
        let own = [("times", times), ("dt", self.dt.map(|step| step.to_string()))];
        let own = own.into_iter().filter_map(|(name, value)| Some((name, value?)));
        let stored = self.settings().filter(|(name, _)| *name != times::TIMES);
        let mut words: Vec<String> = stored.chain(own).map(|(name, value)| format!("--{name}={value}")).collect();
        words.extend(self.allow_gaps.then(|| "--allow-gaps".into()));
        words.extend(self.no_mmap.then(|| "--no-mmap".into()));
        words
    }

    /// The given options, to be stored in a file. [`Self::open_again`] needs them to read the same samples.
    pub fn settings(&self) -> impl Iterator<Item = (&'static str, String)> {
        let given = [
            ("variable", self.variable.clone()),
            ("magnitude", (!self.magnitude.is_empty()).then(|| self.magnitude.join(","))),
            ("axes", self.axes.clone()),
            ("dims", self.dims.as_ref().map(ToString::to_string)),
            ("dtype", self.dtype.map(|ty| ty.to_string())),
            ("endian", self.endian.map(|order| order.to_string())),
            ("offset", self.offset.map(|bytes| bytes.to_string())),
            ("spacing", self.spacing.map(|s| s.to_string())),
            ("origin", self.origin.map(|o| o.to_string())),
            (times::TIMES, times::setting_value(self.times.as_ref(), self.dt)),
            ("time-unit", self.time_unit.clone()),
        ];
        given.into_iter().filter_map(|(name, value)| Some((name, value?)))
    }

    /// An error if an option is given that a coefficient file does not need.
    pub fn refuse_for_coefficients(&self) -> Result<()> {
        let option = |name| if name == times::TIMES && self.dt.is_some() { "dt" } else { name };
        let given = self.settings().map(|(name, _)| option(name)).chain(self.allow_gaps.then_some("allow-gaps")).next();
        let refused = |name| format!("--{name}: is for frames; a coefficient file does not need it");
        given.map_or(Ok(()), |name| Err(Error::usage(refused(name))))
    }

    /// The coefficient file, if that is the only input; none if the inputs are frames.
    pub fn coefficients(&self, inputs: &[PathBuf], remote: &RemoteArgs) -> Result<Option<CoefficientFile>> {
        let [only] = inputs else { return Ok(None) };
        let named_so = is_coefficient_name(only) || only.extension().is_some_and(|ending| ending == "part");
        if !named_so && !only.is_file() {
            return Ok(None);
        }
        let foreign =
            |e: &Error| matches!(e, Error::CoefficientFile { source: wavesplat_format::Error::Foreign(_), .. });
        match remote.open(only, self.access()) {
            Err(e) if !named_so && foreign(&e) => Ok(None),
            file => file.map(Some),
        }
    }

    /// Opens the archive that a file was converted from, or one that continues it. Options that are not given are those
    /// stored in the file. The archive is narrowed to the file's region and to `frames`.
    pub fn open_again(
        &self,
        file: &CoefficientFile,
        inputs: &[PathBuf],
        frames: Option<FrameRange>,
        common: &CommonArgs,
    ) -> Result<Box<dyn FrameSource>> {
        let options = OpenOptions {
            dims_are_remembered: !self.describes_layout(),
            variable_is_remembered: self.variable.is_none(),
            clock: Some(units(file.metadata())),
            times: times::given(self.times.as_ref(), self.dt)?,
            ..self.completed(file)?.options(common.stream_memory())
        };
        let source = formats::open(inputs, &options)?;
        source.archive().notes.iter().for_each(|n| common.note(note_text(n)));
        narrow(source, frames, remembered(file, "region")?.as_ref())
    }

    /// Gives frames that are appended to a file the times that follow in its steps, if it was converted with regular
    /// times. `source` has every `every`-th frame of its archive.
    pub(super) fn go_on_in_time(
        &self,
        file: &CoefficientFile,
        source: Box<dyn FrameSource>,
        every: usize,
    ) -> Result<Box<dyn FrameSource>> {
        let last = file.metadata().times.last();
        let (Some(stored), Some(last), None, None) =
            (setting(file.metadata(), times::TIMES), last, &self.times, self.dt)
        else {
            return Ok(source);
        };
        if stored == times::LIST {
            return Err(Error::usage("the times of the file are from a list: --times gives those of the new frames"));
        }
        let Some(Numbers([start, step])) = remembered::<Pair>(file, times::TIMES)? else { return Ok(source) };
        Ok(with_times(source, RegularTimes::new(start, step)?.after(*last, every), &units(file.metadata())))
    }

    /// Whether an option that describes headerless data is given.
    fn describes_layout(&self) -> bool {
        self.dims.is_some() || self.dtype.is_some() || self.endian.is_some() || self.offset.is_some()
    }

    /// These options, completed with those stored in a file.
    fn completed(&self, file: &CoefficientFile) -> Result<Self> {
        let mut input = self.clone();
        complete(&mut input.variable, file, "variable")?;
        if input.magnitude.is_empty() && self.variable.is_none() {
            let names = setting(file.metadata(), "magnitude").unwrap_or_default();
            input.magnitude = names.split(',').filter(|name| !name.is_empty()).map(String::from).collect();
        }
        complete(&mut input.axes, file, "axes")?;
        complete(&mut input.spacing, file, "spacing")?;
        complete(&mut input.origin, file, "origin")?;
        complete(&mut input.time_unit, file, "time-unit")?;
        // Without dims, dtype is the type of the samples before they were coloured.
        if setting(file.metadata(), "dims").is_some() {
            complete(&mut input.dims, file, "dims")?;
            complete(&mut input.dtype, file, "dtype")?;
            complete(&mut input.endian, file, "endian")?;
            complete(&mut input.offset, file, "offset")?;
        }
        Ok(input)
    }
}

/// Fills an option that was not given with the value stored in a file.
fn complete<T: FromStr<Err: fmt::Display>>(option: &mut Option<T>, file: &CoefficientFile, name: &str) -> Result<()> {
    if option.is_none() {
        *option = remembered(file, name)?;
    }
    Ok(())
}

/// A setting of the conversion that is stored in a file.
pub fn remembered<T: FromStr<Err: fmt::Display>>(file: &CoefficientFile, name: &str) -> Result<Option<T>> {
    let parsed = |what: T::Err| Error::input(file.path(), format!("its setting {name} is not understood: {what}"));
    setting(file.metadata(), name).map(str::parse).transpose().map_err(parsed)
}

/// Options that choose frames and voxels of an archive.
#[derive(Debug, Clone, Args)]
pub struct SelectArgs {
    /// Only these frames: a:b or a:b:step, without b
    #[arg(long, value_name = "RANGE", allow_hyphen_values = true, help_heading = "Input")]
    pub frames: Option<FrameRange>,
    /// Only these voxels: x0:x1,y0:y1,z0:z1, as numbers, shares like 10%:50%, or coordinates like @30:@45m
    #[arg(long, value_name = "BOX", allow_hyphen_values = true, help_heading = "Input")]
    pub region: Option<RegionSpec>,
}

impl SelectArgs {
    /// Narrows an archive to the chosen frames and voxels.
    pub fn narrow(&self, source: Box<dyn FrameSource>) -> Result<Box<dyn FrameSource>> {
        narrow(source, self.frames, self.region.as_ref())
    }
}

/// Narrows an archive to some frames and voxels.
pub fn narrow(
    source: Box<dyn FrameSource>,
    frames: Option<FrameRange>,
    region: Option<&RegionSpec>,
) -> Result<Box<dyn FrameSource>> {
    if frames.is_none() && region.is_none() {
        return Ok(source);
    }
    let archive = source.archive();
    let all = || ":".parse::<FrameRange>().expect("a range of all frames");
    let (first, step, count) = frames.unwrap_or_else(all).resolve(archive.frames)?;
    let axes = || Axes::new(&archive.grid, archive.units.space.as_deref(), archive.description.as_ref());
    let region = region.map_or(Ok(archive.grid.whole()), |region| axes().region("region", region))?;
    source::select(source, Selection { first, step, frames: count, region })
}
