//! The request for a conversion, in the words of the programs' options and of Python's arguments.

use super::plan::check_max_error;
use super::shard::{ArchiveScan, Shard, sharded};
use super::{BestFor, CHAIN, ConvertConfig, MaxError, MissingPolicy, SchemeConstraint, SpatialPredictor};
use serde::{Deserialize, Deserializer, de::Error as _};
use std::path::PathBuf;
use wavesplat_core::base::choice;
use wavesplat_core::base::error::{Error, Result};
use wavesplat_core::base::grid::Grid;
use wavesplat_core::base::memory;
use wavesplat_core::colour::TransferFunction;
use wavesplat_core::source::{Archive, FrameSource};
use wavesplat_core::wavelet::AnyBasis;
use wavesplat_format::{Basis, Bound, Keep};

/// The request for a conversion. [`run`](super::run()) completes it from the frames.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ConvertRequest {
    /// The error allowed, as a share of what the bound refers to, 0 to 1; 0 keeps every bit. Default: 0.01.
    #[serde(deserialize_with = "number")]
    pub tolerance: Option<f64>,
    /// Instead of `tolerance`: the error allowed in the samples' unit, for a pointwise or rms bound; 0 keeps every bit.
    pub max_error: Option<MaxError>,
    /// What is promised. Default: pointwise.
    #[serde(with = "BoundWords")]
    pub bound: Bound,
    /// The value range that a pointwise or rms tolerance refers to. Default: that of the frames so far.
    pub range: Option<(f64, f64)>,
    /// What to do with missing samples. Default: mask them if a value means "missing", by `missing_value` or by what the
    /// source declares; else refuse them.
    #[serde(with = "choice::optional")]
    pub missing: Option<MissingPolicy>,
    /// A value that means "missing", besides NaN and infinities. Default: the one that the source declares.
    #[serde(deserialize_with = "number")]
    pub missing_value: Option<f64>,
    /// What samples keep besides the bound: words such as `range sign side=0.5,2`. Default: nothing.
    #[serde(deserialize_with = "kept")]
    pub keep: Keep,
    /// Colours to convert samples to, over a range of values. In JSON, the text that files keep. Default: none.
    #[serde(deserialize_with = "colours")]
    pub transfer_function: Option<TransferFunction>,
    /// The transform along time: haar, multi, learned, pyramid or auto. Default: auto, the smallest.
    #[serde(with = "choice")]
    pub basis: AnyBasis,
    /// Prediction in space: none (for haar, multi and learned), linear, cubic or auto. Default: what suits the basis.
    #[serde(with = "choice::optional")]
    pub space: Option<SpatialPredictor>,
    /// What the file is made best for; it sets `window` and `block` where they are not given. Default: all.
    #[serde(with = "choice::optional")]
    pub best_for: Option<BestFor>,
    /// Frames in a window. Default: 32, up to 1024 for at most 256 voxels; one more for the basis multi.
    pub window: Option<usize>,
    /// Voxels a side of a block. Default: as many as suit the window.
    pub block: Option<usize>,
    /// zstd level, 1 to 19. Default: 3.
    pub level: i32,
    /// Number of consecutive windows that may reuse the previous window's scheme. Default: 8.
    pub chain: usize,
    /// Convert only this shard; in JSON `I/N`. Default: all frames.
    pub shard: Option<Shard>,
    /// The file of an [`ArchiveScan`]: it gives `range`. Default: none.
    pub scan: Option<PathBuf>,
    /// Whether the report tells the errors of what is computed from the samples. It takes reading up to three windows again. Default: no.
    pub measures: bool,
    /// Bytes that may be allocated. Default: 512 MiB.
    pub memory: usize,
    /// Names and values of the options that opened and narrowed the source, which the file keeps. Default: none.
    pub input: Vec<(String, String)>,
}

impl Default for ConvertRequest {
    fn default() -> Self {
        Self {
            tolerance: None,
            max_error: None,
            bound: Bound::Pointwise,
            range: None,
            missing: None,
            missing_value: None,
            keep: Keep::default(),
            transfer_function: None,
            basis: None,
            space: None,
            best_for: None,
            window: None,
            block: None,
            level: 3,
            chain: CHAIN,
            shard: None,
            scan: None,
            measures: false,
            memory: memory::DEFAULT,
            input: Vec::new(),
        }
    }
}

/// The default tolerance.
const TOLERANCE: f64 = 0.01;

impl ConvertRequest {
    /// Checks the settings without the frames: some contradict each other.
    ///
    /// # Errors
    /// [`Error::Setting`]; other fields that its text names are in backquotes.
    pub fn check(&self) -> Result<()> {
        let (has_range, is_exact) = (self.range.is_some(), self.max_error.is_some());
        let of_range = matches!(self.bound, Bound::Pointwise | Bound::Rms);
        let knows_range = has_range || self.scan.is_some() || is_exact;
        if is_exact && self.tolerance.is_some() {
            let what = "is a share of a range, and `max_error` is in the samples' unit; give one";
            return Err(Error::setting("tolerance", what));
        }
        if is_exact {
            check_max_error(self.bound, has_range, self.transfer_function.is_some())?;
        }
        let (setting, what) = match (&self.scan, self.shard) {
            _ if !(1..=19).contains(&self.level) => ("level", "takes 1 to 19"),
            _ if self.lacks_prediction() => ("space", "none takes `basis` haar, multi or learned"),
            _ if self.range.is_some_and(|(lo, hi)| lo > hi) => ("range", "give the lower end first"),
            (Some(_), _) if has_range || is_exact => {
                ("scan", "gives the range that a tolerance refers to; leave `range` and `max_error` out")
            }
            (Some(_), _) if !of_range => ("scan", "needs `bound` pointwise or rms"),
            (None, Some(_)) if !of_range && !has_range => ("shard", "needs `bound` pointwise or rms"),
            (_, Some(_)) if !knows_range => (
                "shard",
                "the tolerance refers to the range of all frames, which a shard does not know: give `scan`, `range` or \
                 `max_error`",
            ),
            _ => return Ok(()),
        };
        Err(Error::setting(setting, what))
    }

    /// Whether no prediction is asked for, with a basis that needs one.
    fn lacks_prediction(&self) -> bool {
        self.space == Some(SpatialPredictor::Alone) && matches!(self.basis, None | Some(Basis::Samples))
    }

    /// The frames to convert, which are those of the shard, and the configuration that suits them.
    pub(super) fn prepare(&self, source: Box<dyn FrameSource>) -> Result<(Box<dyn FrameSource>, ConvertConfig)> {
        self.check()?;
        let mut config = self.config(source.archive())?;
        if let Some(path) = &self.scan {
            let range = ArchiveScan::open(path)?.range_of(source.archive());
            config.range = Some(range.map_err(|what| Error::input(path, what))?);
        }
        let Some(shard) = self.shard else { return Ok((source, config)) };
        let (source, of_shard) = sharded(source, shard, config.window, config.chain)?;
        config.settings.extend(of_shard);
        Ok((source, config))
    }

    /// This request, completed from an archive's description. A scan and a shard are left out.
    ///
    /// # Errors
    /// The largest errors name variables, and the archive's is not among them.
    pub fn config(&self, archive: &Archive) -> Result<ConvertConfig> {
        let is_declared = archive.missing.is_some() || self.missing_value.is_some();
        let missing = if is_declared { MissingPolicy::Mask } else { MissingPolicy::Error };
        let of_variable = |error: &MaxError| error.for_variable(archive.variable.as_deref());
        let defaults = ConvertConfig::new(self.tolerance.unwrap_or(TOLERANCE));
        let window = self.window.unwrap_or_else(|| self.usual_window(defaults.window, archive.grid));
        Ok(ConvertConfig {
            coding: self.coding(),
            chain: self.chain,
            window,
            max_error: self.max_error.as_ref().map(of_variable).transpose()?,
            bound: self.bound,
            range: self.range,
            missing: self.missing.unwrap_or(missing),
            missing_value: archive.missing_value(self.missing_value),
            keep: self.keep.clone(),
            colours: self.transfer_function.clone(),
            block: self.block.or_else(|| self.best_for?.block(archive.grid.dims, window)),
            level: self.level,
            memory: self.memory,
            settings: self.input.clone(),
            ..defaults
        })
    }

    /// The default window: longer for a few series, which are small and predict each other little.
    fn usual_window(&self, usual: usize, grid: Grid) -> usize {
        let is_short = |window: &usize| window.saturating_mul(grid.whole().voxels()) <= FEW_SAMPLES;
        let usual = [1024, 512, 256, 128, 64].into_iter().find(is_short).unwrap_or(usual);
        let window = self.best_for.map_or(usual, |best_for| best_for.window(usual));
        window + usize::from(self.basis == Some(Basis::Multi))
    }

    fn coding(&self) -> SchemeConstraint {
        let suitable = self.basis.map_or(SchemeConstraint::AUTO, SchemeConstraint::from);
        SchemeConstraint { space: self.space.unwrap_or(suitable.space), ..suitable }
    }
}

/// The most samples of a window that is longer than usual.
const FEW_SAMPLES: usize = 1 << 14;

/// The words of a [`Bound`].
#[derive(Deserialize)]
#[serde(remote = "Bound", rename_all = "lowercase", deny_unknown_fields)]
enum BoundWords {
    Pointwise,
    Rms,
    Relative { floor: f64 },
    Sampled { samples: u32, seed: u64 },
}

/// Reads a number, or the text of one: JSON has no NaN.
fn number<'de, D: Deserializer<'de>>(from: D) -> std::result::Result<Option<f64>, D::Error> {
    #[derive(Deserialize)]
    #[serde(untagged)]
    enum Number {
        Plain(f64),
        Text(String),
    }
    match Option::deserialize(from)? {
        Some(Number::Plain(number)) => Ok(Some(number)),
        Some(Number::Text(text)) => text.parse().map(Some).map_err(D::Error::custom),
        None => Ok(None),
    }
}

/// Reads what is kept from its words.
fn kept<'de, D: Deserializer<'de>>(from: D) -> std::result::Result<Keep, D::Error> {
    let words = Option::<String>::deserialize(from)?.unwrap_or_default();
    Keep::parse(&words).map_err(D::Error::custom)
}

/// Reads colours from the text that files keep.
fn colours<'de, D: Deserializer<'de>>(from: D) -> std::result::Result<Option<TransferFunction>, D::Error> {
    let Some(text) = Option::<String>::deserialize(from)? else { return Ok(None) };
    TransferFunction::parse(&text).map(Some).ok_or_else(|| D::Error::custom(format!("no colours: {text}")))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(json: &str) -> std::result::Result<ConvertRequest, String> {
        serde_json::from_str(json).map_err(|e| e.to_string())
    }

    #[test]
    fn a_request_is_read_from_json() {
        let json = r#"{"bound": {"relative": {"floor": 0.5}}, "range": [-1, 2], "missing": "mask", "basis": "multi",
            "space": "cubic", "shard": "2/3", "max_error": [["u", 0.1]], "transfer_function": "viridis 0 2",
            "missing_value": "nan", "tolerance": null}"#;
        let found = read(json).expect("a request");
        assert_eq!((found.bound, found.range), (Bound::Relative { floor: 0.5 }, Some((-1.0, 2.0))));
        assert_eq!((found.missing, found.basis), (Some(MissingPolicy::Mask), Some(Basis::Multi)));
        assert_eq!((found.shard, found.level), (Some(Shard { number: 2, of: 3 }), 3));
        assert_eq!(found.max_error, Some(MaxError::Named(vec![("u".into(), 0.1)])));
        assert_eq!(found.transfer_function.map(|colours| colours.range()), Some((0.0, 2.0)));
        assert!(found.missing_value.is_some_and(f64::is_nan) && found.tolerance.is_none());
        assert_eq!(read("{}").expect("a request"), ConvertRequest::default());
        for wrong in [r#"{"tolerence": 1}"#, r#"{"shard": "3/2"}"#, r#"{"basis": "fourier"}"#, r#"{"bound": "best"}"#] {
            assert!(read(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn windows_of_few_voxels_are_long() {
        let multi = ConvertRequest { basis: Some(Basis::Multi), ..ConvertRequest::default() };
        let grid = |dims| Grid { dims, spacing: [1.0; 3], origin: [0.0; 3] };
        for (dims, frames) in
            [([2, 2, 2], 1024), ([4, 4, 2], 512), ([4, 4, 4], 256), ([16, 16, 1], 64), ([16, 17, 1], 32)]
        {
            assert_eq!(ConvertRequest::default().usual_window(32, grid(dims)), frames, "{dims:?}");
            assert_eq!(multi.usual_window(32, grid(dims)), frames + 1, "{dims:?}");
        }
    }

    #[test]
    fn contradictions_are_named() {
        for (json, setting, words) in [
            (r#"{"tolerance": 0.1, "max_error": 0.1}"#, "tolerance", "give one"),
            (r#"{"range": [0, 1], "max_error": 0.1}"#, "range", "give one"),
            (r#"{"range": [1, 0]}"#, "range", "lower end first"),
            (r#"{"level": 20}"#, "level", "1 to 19"),
            (r#"{"scan": "a.json", "range": [0, 1]}"#, "scan", "leave `range`"),
            (r#"{"scan": "a.json", "bound": {"relative": {"floor": 0}}}"#, "scan", "needs `bound`"),
            (r#"{"shard": "1/2", "bound": {"relative": {"floor": 0}}}"#, "shard", "needs `bound`"),
            (r#"{"shard": "1/2"}"#, "shard", "range of all frames"),
            (r#"{"space": "none"}"#, "space", "takes `basis` haar"),
            (r#"{"space": "none", "basis": "pyramid"}"#, "space", "takes `basis` haar"),
        ] {
            let error = read(json).expect("a request").check().expect_err(json);
            assert!(error.to_string().starts_with(setting) && error.to_string().contains(words), "{json}: {error}");
        }
        for fine in [r#"{"shard": "1/2", "range": [0, 1], "bound": {"relative": {"floor": 0}}}"#, r#"{"max_error": 0}"#]
        {
            assert!(read(fine).expect("a request").check().is_ok(), "{fine}");
        }
    }
}
