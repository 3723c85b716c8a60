//! The targets for wavesplat compared with its peers, and whether it meets them.

use super::peers::TIMED;
use super::row::Row;
use super::schemes::BASELINE;
use serde::{Deserialize, Serialize};

/// A number of a scheme compared with another coder's, and its target.
pub(super) struct Target {
    /// The quantity that is compared.
    pub(super) name: &'static str,
    /// The other coder.
    against: &'static str,
    /// Computes the number from this coder's row and the other's.
    value: fn(&Row, &Row) -> Option<f64>,
    /// The values that meet the target.
    wanted: Threshold,
}

#[derive(Clone, Copy)]
enum Threshold {
    Below(f64),
    AtMost(f64),
    AtLeast(f64),
}

impl Threshold {
    fn met(self, value: f64) -> bool {
        match self {
            Self::Below(limit) => value < limit,
            Self::AtMost(limit) => value <= limit,
            Self::AtLeast(limit) => value >= limit,
        }
    }

    fn words(self) -> String {
        match self {
            Self::Below(limit) => format!("< {limit}"),
            Self::AtMost(limit) => format!("<= {limit}"),
            Self::AtLeast(limit) => format!(">= {limit}"),
        }
    }
}

const fn size(name: &'static str, against: &'static str, wanted: Threshold) -> Target {
    let value = |own: &Row, other: &Row| Some(own.bytes as f64 / other.bytes as f64);
    Target { name, against, value, wanted }
}

/// All targets. Sizes are shares of the other coder's; codes and times are factors by which there are fewer or they
/// are shorter.
pub(super) const TARGETS: [Target; 8] = [
    size("bytes / sz3-3d", "sz3-3d", Threshold::Below(1.0)),
    size("bytes / sz3-4d", "sz3-4d", Threshold::AtMost(1.0)),
    size("bytes / zfp-4d", "zfp-4d", Threshold::Below(1.0)),
    size("bytes / sperr-3d", "sperr-3d", Threshold::Below(1.0)),
    Target {
        name: "fewer codes than haar",
        against: BASELINE,
        value: |own, haar| Some(haar.own.as_ref()?.codes_per_sample / own.own.as_ref()?.codes_per_sample),
        wanted: Threshold::AtLeast(3.0),
    },
    Target {
        name: "faster conversion than sz3-4d",
        against: TIMED,
        value: |own, peer| Some(peer.encode_seconds / own.encode_seconds),
        wanted: Threshold::AtLeast(1.0),
    },
    Target {
        name: "faster to values than sz3-4d",
        against: TIMED,
        value: |own, peer| Some(peer.decode_seconds / own.decode_seconds),
        wanted: Threshold::AtLeast(1.5),
    },
    Target {
        name: "faster to codes than sz3-4d",
        against: TIMED,
        value: |own, peer| Some(peer.decode_seconds / own.own.as_ref()?.codes_seconds),
        wanted: Threshold::AtLeast(3.0),
    },
];

impl Target {
    /// The threshold in words, such as "<= 1".
    pub(super) fn wanted(&self) -> String {
        self.wanted.words()
    }
}

/// A target and its result.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Verdict {
    /// The name of the archive.
    pub data: String,
    /// As a share of the archive's value range.
    pub tolerance: f64,
    /// The scheme of wavesplat.
    pub scheme: String,
    /// The name of the target.
    pub target: String,
    /// The result.
    pub value: f64,
    /// The target, in words.
    pub wanted: String,
    /// Whether it was reached.
    pub met: bool,
}

/// Compares every scheme except the baseline with the coders that were measured.
pub(super) fn judge(rows: &[Row]) -> Vec<Verdict> {
    let schemes = rows.iter().filter(|r| r.own.is_some() && r.coder != BASELINE);
    schemes.flat_map(|row| TARGETS.iter().filter_map(|target| verdict(row, target, rows))).collect()
}

fn verdict(row: &Row, target: &Target, rows: &[Row]) -> Option<Verdict> {
    let beside = |r: &&Row| r.coder == target.against && r.data == row.data && r.tolerance == row.tolerance;
    // If neither has codes, the ratio is not a number: there is nothing to compare.
    let value = (target.value)(row, rows.iter().find(beside)?).filter(|v| v.is_finite())?;
    Some(Verdict {
        data: row.data.clone(),
        tolerance: row.tolerance,
        scheme: row.coder.clone(),
        target: target.name.into(),
        value,
        wanted: target.wanted(),
        met: target.wanted.met(value),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_series_coder_may_be_equalled_and_the_others_must_be_beaten() {
        let own = Row::example("default", 10, true);
        let rows = [own, Row::example("sz3-3d", 10, false), Row::example("sz3-4d", 10, false)];
        let met = |target: &str| judge(&rows).iter().find(|v| v.target == target).map(|v| v.met);
        assert_eq!(
            (met("bytes / sz3-3d"), met("bytes / sz3-4d"), met("bytes / zfp-4d")),
            (Some(false), Some(true), None)
        );
        assert_eq!(
            (met("faster conversion than sz3-4d"), met("faster to values than sz3-4d")),
            (Some(true), Some(false))
        );
        assert_eq!(met("fewer codes than haar"), None, "there is no such row");
    }

    #[test]
    fn codes_are_counted_against_haar_alone() {
        let mut few = Row::example("default", 10, true);
        few.own.as_mut().expect("it is ours").codes_per_sample /= 3.0;
        let verdicts = judge(&[Row::example(BASELINE, 20, true), few]);
        assert_eq!(verdicts.len(), 1);
        assert!(verdicts[0].met && verdicts[0].value == 3.0, "{verdicts:?}");
    }
}
