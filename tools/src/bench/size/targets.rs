//! What wavesplat is to reach beside its peers, and whether it does.

use super::peers::TIMED;
use super::row::Row;
use super::schemes::BASELINE;
use serde::{Deserialize, Serialize};

/// A number of a scheme beside another coder's, and what it is to be.
pub(super) struct Target {
    /// What is compared.
    pub(super) name: &'static str,
    /// The other coder.
    against: &'static str,
    /// From this coder's row and the other's.
    value: fn(&Row, &Row) -> Option<f64>,
    /// Which values are good.
    wanted: Wanted,
}

#[derive(Clone, Copy)]
enum Wanted {
    Below(f64),
    AtMost(f64),
    AtLeast(f64),
}

impl Wanted {
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

const fn size(name: &'static str, against: &'static str, wanted: Wanted) -> Target {
    let value = |own: &Row, other: &Row| Some(own.bytes as f64 / other.bytes as f64);
    Target { name, against, value, wanted }
}

/// All targets. Sizes are shares of the other's; codes and times are how many times fewer or shorter.
pub(super) const TARGETS: [Target; 8] = [
    size("bytes / sz3-3d", "sz3-3d", Wanted::Below(1.0)),
    size("bytes / sz3-4d", "sz3-4d", Wanted::AtMost(1.0)),
    size("bytes / zfp-4d", "zfp-4d", Wanted::Below(1.0)),
    size("bytes / sperr-3d", "sperr-3d", Wanted::Below(1.0)),
    Target {
        name: "fewer codes than haar",
        against: BASELINE,
        value: |own, haar| Some(haar.own.as_ref()?.codes_per_sample / own.own.as_ref()?.codes_per_sample),
        wanted: Wanted::AtLeast(3.0),
    },
    Target {
        name: "faster conversion than sz3-4d",
        against: TIMED,
        value: |own, peer| Some(peer.encode_seconds / own.encode_seconds),
        wanted: Wanted::AtLeast(1.0),
    },
    Target {
        name: "faster to values than sz3-4d",
        against: TIMED,
        value: |own, peer| Some(peer.decode_seconds / own.decode_seconds),
        wanted: Wanted::AtLeast(1.5),
    },
    Target {
        name: "faster to codes than sz3-4d",
        against: TIMED,
        value: |own, peer| Some(peer.decode_seconds / own.own.as_ref()?.codes_seconds),
        wanted: Wanted::AtLeast(3.0),
    },
];

impl Target {
    /// What is wanted, as "<= 1".
    pub(super) fn wanted(&self) -> String {
        self.wanted.words()
    }
}

/// A target and what became of it.
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
    /// What was reached.
    pub value: f64,
    /// What was wanted, in words.
    pub wanted: String,
    /// Whether it was reached.
    pub met: bool,
}

/// Judges every scheme but the baseline wherever there is something to compare it with.
pub(super) fn judge(rows: &[Row]) -> Vec<Verdict> {
    let schemes = rows.iter().filter(|r| r.own.is_some() && r.coder != BASELINE);
    schemes.flat_map(|row| TARGETS.iter().filter_map(|target| verdict(row, target, rows))).collect()
}

fn verdict(row: &Row, target: &Target, rows: &[Row]) -> Option<Verdict> {
    let beside = |r: &&Row| r.coder == target.against && r.data == row.data && r.tolerance == row.tolerance;
    // Nothing by nothing is no number, where neither has codes: nothing to compare.
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
