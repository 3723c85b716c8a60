//! Times of frames that programs write beside the samples: time stamps of planes (Plus), and values of an axis (Slicer).

use wavesplat_core::base::error::{Note, Remedy};

/// A note on planes that are frames because they have time stamps.
pub(crate) fn stamped_note() -> Note {
    Note::with("planes have time stamps, and are taken as frames", Remedy::Set("axes"))
}

/// The times of a sequence.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct SequenceTimes {
    pub(crate) times: Vec<f64>,
    pub(crate) unit: Option<String>,
}

impl SequenceTimes {
    /// The times of `count` frames along an axis, by the texts of a header.
    pub(crate) fn find<'a>(get: impl Fn(&str) -> Option<&'a str>, axis: usize, count: usize) -> Option<Self> {
        let number = |text: &str| text.trim().parse::<f64>().ok().filter(|time| time.is_finite());
        let stamp = |frame: usize| get(&format!("Seq_Frame{frame:04}_Timestamp")).and_then(number);
        if stamp(0).is_some() {
            let times: Option<Vec<f64>> = (0..count).map(stamp).collect();
            return times.map(|times| Self { times, unit: Some("s".into()) });
        }
        let split = |text: &str| text.split([' ', ',', '\t']).filter(|word| !word.is_empty()).map(number).collect();
        let list = |text: &str| -> Option<Vec<f64>> { split(text) };
        let values =
            get(&format!("axis {axis} index values")).map(|text| (text, get(&format!("axis {axis} index unit"))));
        let labels = || Some((get("MultiVolume.FrameLabels")?, get("MultiVolume.FrameIdentifyingDICOMTagUnits")));
        let (text, unit) = values.or_else(labels)?;
        let times = list(text).filter(|times| times.len() == count)?;
        Some(Self { times, unit: unit.map(str::trim).filter(|unit| !unit.is_empty()).map(String::from) })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stamps_values_and_labels_are_times() {
        let find = |texts: &[(&str, &'static str)], axis, count| {
            let get = |name: &str| texts.iter().find(|(known, _)| *known == name).map(|(_, text)| *text);
            SequenceTimes::find(get, axis, count).map(|found| (found.times, found.unit))
        };
        let stamps = [("Seq_Frame0000_Timestamp", "10"), ("Seq_Frame0001_Timestamp", " 10.5 ")];
        assert_eq!(find(&stamps, 2, 2), Some((vec![10.0, 10.5], Some("s".into()))));
        assert_eq!(find(&stamps, 2, 3), None);
        assert_eq!(find(&[("axis 0 index values", "0 1 2.5")], 0, 3), Some((vec![0.0, 1.0, 2.5], None)));
        assert_eq!(find(&[("axis 0 index values", "a b")], 0, 2), None);
        let labels = [("MultiVolume.FrameLabels", "0,500"), ("MultiVolume.FrameIdentifyingDICOMTagUnits", "ms")];
        assert_eq!(find(&labels, 3, 2), Some((vec![0.0, 500.0], Some("ms".into()))));
    }
}
