//! Times that are an auxiliary coordinate: a variable along the axis of frames that is not called as the axis is.

use super::{FileArrays, Variable, axes, coordinates};
use wavesplat_core::base::description::{AxisRole, NumberType, Values};
use wavesplat_core::base::error::Note;
use wavesplat_core::base::time_labels::seconds_since;

/// Values of an array of texts that may be dates.
const MOST_TEXTS: usize = 1 << 24;

/// Times that were found.
pub(super) enum Auxiliary<'a> {
    /// A variable with times.
    Numbers(&'a Variable),
    /// Texts such as `2020-01-01_06:00:00`.
    Dates(Dates),
}

/// Dates as times.
pub(super) struct Dates {
    pub(super) times: Vec<f64>,
    pub(super) unit: String,
}

/// The times along an axis: of the variable that the samples' `coordinates` name, else of one whose standard name says
/// time, else of any whose unit says so, else dates.
///
/// # Errors
/// A note on several variables with different times.
pub(super) fn find<'a>(
    arrays: FileArrays<'a>,
    variable: &'a Variable,
    axis: usize,
) -> Result<Option<Auxiliary<'a>>, Note> {
    let dim = variable.dims[axis].as_str();
    let is_along = |v: &&Variable| v.dims.first().is_some_and(|d| d == dim) && v.lengths[0] == variable.lengths[axis];
    let along: Vec<_> =
        arrays.all.iter().filter(|v| !dim.is_empty() && v.path != variable.path && is_along(v)).collect();
    let times: Vec<_> = along.iter().copied().filter(|v| v.lengths.len() == 1 && is_time(v)).collect();
    let named = variable.text("coordinates").unwrap_or_default();
    let is_named = |v: &&Variable| named.split_whitespace().any(|name| name == v.name());
    let is_standard = |v: &&Variable| v.text("standard_name") == Some("time");
    let tiers =
        [times.iter().copied().filter(is_named).collect(), times.iter().copied().filter(is_standard).collect(), times];
    match tiers.into_iter().find(|tier: &Vec<&Variable>| !tier.is_empty()) {
        Some(tier) => the_same(arrays, &tier).map(|times| Some(Auxiliary::Numbers(times))),
        None => Ok(along.into_iter().find_map(|v| dates(arrays, v)).map(Auxiliary::Dates)),
    }
}

/// Whether a variable has the times of frames, and not those when forecasts began.
fn is_time(variable: &Variable) -> bool {
    let is_other = variable.text("standard_name").is_some_and(|name| name != "time");
    axes::role_of_coordinate(variable) == Some(AxisRole::Frames) && !is_other
}

/// The first of several variables, which must have the same times.
fn the_same<'a>(arrays: FileArrays<'a>, found: &[&'a Variable]) -> Result<&'a Variable, Note> {
    let times = |v: &Variable| (coordinates(arrays.file, v).ok(), v.text("units").map(String::from));
    match found[1..].iter().find(|other| times(other) != times(found[0])) {
        Some(other) => {
            let (first, other) = (found[0].shown(), other.shown());
            Err(format!("{first} and {other} give different times: frames are numbered").into())
        }
        None => Ok(found[0]),
    }
}

/// Dates of an array of texts, as WRF and MPAS write them.
fn dates(arrays: FileArrays<'_>, variable: &Variable) -> Option<Dates> {
    let count = variable.lengths.iter().fold(1, |count: usize, length| count.saturating_mul(*length));
    let is_text = matches!(&variable.sample, Err(kind) if kind == "text") && variable.lengths.len() <= 2;
    if !is_text || count > MOST_TEXTS {
        return None;
    }
    let texts = match arrays.file.values(&variable.path).ok()? {
        Values::Texts(texts) => texts,
        Values::Numbers(numbers) if numbers.ty == NumberType::Char => {
            let bytes = numbers.bytes();
            let texts = bytes.chunks(variable.lengths.get(1).copied().filter(|length| *length > 0)?);
            texts.map(|text| String::from_utf8_lossy(text).into_owned()).collect()
        }
        Values::Numbers(_) | Values::Times(_) => return None,
    };
    let date = |text: &String| text.trim_matches(['\0', ' ']).replace('_', " ");
    let dates: Vec<String> = texts.iter().map(date).collect();
    let first = dates.first()?;
    let times = dates.iter().map(|date| seconds_since(first, date)).collect::<Option<Vec<_>>>()?;
    Some(Dates { unit: format!("seconds since {first}"), times })
}
