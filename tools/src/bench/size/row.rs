//! The measurements of one coder.

use super::own::Measured;
use serde::{Deserialize, Serialize};

/// A coder on one archive at one tolerance.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Row {
    /// The name of the archive.
    pub data: String,
    /// As a share of the archive's value range.
    pub tolerance: f64,
    /// A scheme of wavesplat, or a peer.
    pub coder: String,
    /// Bytes of the whole file.
    pub bytes: u64,
    /// Bytes of samples divided by bytes of the file.
    pub ratio: f64,
    /// The largest error that a sample may have, in the units of the samples.
    pub bound: f64,
    /// The largest error of any sample, in the units of the samples; infinite (null in JSON) if a value is lost.
    #[serde(deserialize_with = "infinite_if_null")]
    pub largest_error: f64,
    /// Samples to bytes, seconds of one core.
    pub encode_seconds: f64,
    /// Bytes to samples in one array, seconds of one core.
    pub decode_seconds: f64,
    /// Additional measurements of wavesplat's rows.
    pub own: Option<Own>,
}

/// The measurements that only wavesplat's rows have.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Own {
    /// Bytes to codes, ready to be splatted, seconds of one core.
    pub codes_seconds: f64,
    /// Nonzero codes for each sample.
    pub codes_per_sample: f64,
    /// Samples stored exactly because their codes exceed the bound.
    pub outliers: u64,
    /// Samples of blocks that are stored exactly and so have no codes.
    pub exact_samples: u64,
}

/// JSON has no infinity: serde writes null.
fn infinite_if_null<'de, D: serde::Deserializer<'de>>(from: D) -> Result<f64, D::Error> {
    Ok(Option::deserialize(from)?.unwrap_or(f64::INFINITY))
}

impl Row {
    /// A row of wavesplat, for data of this name and number of bytes.
    pub(super) fn of_scheme(data: (&str, u64), tolerance: f64, scheme: &str, measured: &Measured) -> Self {
        Self {
            data: data.0.into(),
            tolerance,
            coder: scheme.into(),
            bytes: measured.bytes,
            ratio: data.1 as f64 / measured.bytes as f64,
            bound: measured.bound,
            largest_error: measured.largest_error,
            encode_seconds: measured.encode_seconds,
            decode_seconds: measured.decode_seconds,
            own: Some(Own {
                codes_seconds: measured.codes_seconds,
                codes_per_sample: measured.codes_per_sample,
                outliers: measured.outliers,
                exact_samples: measured.exact_samples,
            }),
        }
    }

    /// Whether every sample's error is within the bound.
    pub fn holds(&self) -> bool {
        self.largest_error <= self.bound
    }

    /// Whether two rows are of the same coder on the same data at the same tolerance.
    fn same(&self, other: &Self) -> bool {
        (&self.data, &self.coder) == (&other.data, &other.coder) && self.tolerance == other.tolerance
    }

    /// Takes the lesser of each time, and the larger of the errors.
    fn join(&mut self, other: &Self) {
        self.encode_seconds = self.encode_seconds.min(other.encode_seconds);
        self.decode_seconds = self.decode_seconds.min(other.decode_seconds);
        self.largest_error = self.largest_error.max(other.largest_error);
        if let (Some(own), Some(other)) = (&mut self.own, &other.own) {
            own.codes_seconds = own.codes_seconds.min(other.codes_seconds);
        }
    }
}

/// Adds rows to those of earlier rounds.
pub(super) fn merge(rows: &mut Vec<Row>, more: Vec<Row>) {
    for row in more {
        match rows.iter_mut().find(|r| r.same(&row)) {
            Some(known) => known.join(&row),
            None => rows.push(row),
        }
    }
}

#[cfg(test)]
impl Row {
    /// A row of a scheme, or of a peer.
    pub(super) fn example(coder: &str, bytes: u64, own: bool) -> Self {
        let own = own.then_some(Own { codes_seconds: 0.5, codes_per_sample: 0.25, outliers: 0, exact_samples: 0 });
        Self {
            data: "demo".into(),
            tolerance: 0.01,
            coder: coder.into(),
            bytes,
            ratio: 1000.0 / bytes as f64,
            bound: 1.0,
            largest_error: 0.5,
            encode_seconds: 2.0,
            decode_seconds: 1.0,
            own,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rounds_are_joined_by_the_least_times() {
        let mut rows = vec![Row::example("haar", 10, true)];
        let again = Row { encode_seconds: 1.0, decode_seconds: 3.0, largest_error: 0.75, ..rows[0].clone() };
        merge(&mut rows, vec![again, Row { tolerance: 0.1, ..Row::example("haar", 5, true) }]);
        assert_eq!(rows.len(), 2);
        assert_eq!((rows[0].encode_seconds, rows[0].decode_seconds, rows[0].largest_error), (1.0, 1.0, 0.75));
    }

    #[test]
    fn an_infinite_error_exceeds_every_bound_and_survives_json() {
        let row = Row { largest_error: f64::INFINITY, ..Row::example("sz3-4d", 10, false) };
        assert!(!row.holds());
        let text = serde_json::to_string(&row).expect("it is written");
        assert_eq!(serde_json::from_str::<Row>(&text).expect("it is read"), row);
    }
}
