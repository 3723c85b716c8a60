//! Values of settings as texts: numbers and frames.

use super::choice::serde_as_text;
use super::error::{Error, Result};
use std::fmt;
use std::ops::Range;
use std::str::FromStr;

/// `N` whole numbers with x between them, like `512x512`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Whole<const N: usize>(pub [usize; N]);

impl<const N: usize> FromStr for Whole<N> {
    type Err = String;

    fn from_str(text: &str) -> std::result::Result<Self, String> {
        let numbers: Option<Vec<usize>> = text.split('x').map(|n| n.parse().ok()).collect();
        let numbers = numbers.and_then(|n| n.try_into().ok());
        numbers.map(Self).ok_or_else(|| format!("takes {N} whole numbers with x between them, like 512x512"))
    }
}

impl<const N: usize> fmt::Display for Whole<N> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0.map(|number| number.to_string()).join("x"))
    }
}

/// `N` numbers with commas between them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Numbers<const N: usize>(pub [f64; N]);

/// Two numbers, like `0,1.5`.
pub type Pair = Numbers<2>;
/// Three numbers, like `1,1,2.5`.
pub type Triple = Numbers<3>;

impl<const N: usize> FromStr for Numbers<N> {
    type Err = String;

    fn from_str(text: &str) -> std::result::Result<Self, String> {
        let numbers: Option<Vec<f64>> =
            text.split(',').map(|n| n.trim().parse().ok().filter(|n: &f64| n.is_finite())).collect();
        let numbers = numbers.and_then(|n| n.try_into().ok());
        numbers.map(Self).ok_or_else(|| format!("takes {N} numbers with commas between them"))
    }
}

impl<const N: usize> fmt::Display for Numbers<N> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0.map(|number| format!("{number:?}")).join(","))
    }
}

/// A share, as a number like 0.05 or in percent like `5%`. The caller checks its limits.
///
/// # Errors
/// The text is no number.
pub fn share(text: &str) -> std::result::Result<f64, String> {
    let (number, whole) = text.trim().strip_suffix('%').map_or((text.trim(), 1.0), |percent| (percent, 100.0));
    let number = number.trim_end().parse::<f64>().ok().filter(|number| number.is_finite());
    number.map(|number| number / whole).ok_or_else(|| "takes a share, 0 to 1, like 0.02 or 2%".into())
}

/// A range of frames: `a:b` or `a:b:step`, without b, or one number. a and b are optional, and count from the end if
/// negative.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct FrameRange {
    start: Option<i64>,
    end: Option<i64>,
    step: usize,
}

impl From<Range<u64>> for FrameRange {
    fn from(frames: Range<u64>) -> Self {
        Self { start: i64::try_from(frames.start).ok(), end: i64::try_from(frames.end).ok(), step: 1 }
    }
}

impl FromStr for FrameRange {
    type Err = String;

    fn from_str(text: &str) -> std::result::Result<Self, String> {
        let wrong = || format!("'{text}' is not a range of frames: give a:b or a:b:step (without b), or one number");
        let end = |t: &str| if t.is_empty() { Ok(None) } else { t.parse::<i64>().map(Some).map_err(|_| wrong()) };
        let parts: Vec<&str> = text.split(':').collect();
        match parts.as_slice() {
            [one] => {
                let first: i64 = one.parse().map_err(|_| wrong())?;
                Ok(Self { start: Some(first), end: (first != -1).then_some(first.saturating_add(1)), step: 1 })
            }
            [a, b] => Ok(Self { start: end(a)?, end: end(b)?, step: 1 }),
            [a, b, s] => {
                let step = if s.is_empty() { 1 } else { s.parse().map_err(|_| wrong())? };
                if step == 0 { Err(wrong()) } else { Ok(Self { start: end(a)?, end: end(b)?, step }) }
            }
            _ => Err(wrong()),
        }
    }
}

impl fmt::Display for FrameRange {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let end = |e: Option<i64>| e.map_or(String::new(), |n| n.to_string());
        write!(f, "{}:{}:{}", end(self.start), end(self.end), self.step)
    }
}

impl FrameRange {
    /// Whether the range is open and begins at `frames`, just after the last frame of an archive of `frames` frames.
    pub fn begins_at_end(&self, frames: usize) -> bool {
        self.end.is_none() && self.start.is_some_and(|start| start == frames as i64)
    }

    /// The shortest text of the range.
    fn shortest(&self) -> String {
        match (self.start, self.end, self.step) {
            (Some(start), Some(end), 1) if start >= 0 && end == start + 1 => start.to_string(),
            (_, _, step) => {
                let text = self.to_string();
                text.strip_suffix(":1").filter(|_| step == 1).map(String::from).unwrap_or(text)
            }
        }
    }

    /// From one frame to the next.
    pub fn step(&self) -> usize {
        self.step
    }

    /// First frame, step and number of frames in an archive of `frames` frames. The number is None for an open range of
    /// a stream.
    pub fn resolve(&self, frames: Option<usize>) -> Result<(usize, usize, Option<usize>)> {
        let from_end = |n: i64| match frames {
            Some(all) => Ok((all as i64).saturating_add(n).max(0)),
            None => Err(Error::setting("frames", "a stream cannot be counted from its end")),
        };
        let place = |n: i64| if n < 0 { from_end(n) } else { Ok(n) };
        let start = self.start.map_or(Ok(0), place)? as usize;
        let end = self.end.map(place).transpose()?.map(|e| e as usize).or(frames);
        let end = end.map(|e| frames.map_or(e, |all| e.min(all)));
        let count = end.map(|e| e.saturating_sub(start).div_ceil(self.step));
        if count == Some(0) {
            let all = match frames {
                None | Some(0) => String::new(),
                Some(n) => format!("; frames are numbered 0 to {}", n - 1),
            };
            return Err(Error::setting("frames", format!("there is no such frame{all}")));
        }
        Ok((start, self.step, count))
    }
}

/// Ranges of frames with commas between them.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FrameList(Vec<FrameRange>);

impl FromStr for FrameList {
    type Err = String;

    fn from_str(text: &str) -> std::result::Result<Self, String> {
        text.split(',').map(str::parse).collect::<std::result::Result<_, _>>().map(Self)
    }
}

impl From<Range<usize>> for FrameList {
    fn from(frames: Range<usize>) -> Self {
        Self(vec![(frames.start as u64..frames.end as u64).into()])
    }
}

impl fmt::Display for FrameList {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0.iter().map(FrameRange::shortest).collect::<Vec<_>>().join(","))
    }
}

impl FrameList {
    /// The numbers of the frames in an archive of `frames` frames, ascending, each once.
    pub fn resolve(&self, frames: usize) -> Result<Vec<usize>> {
        let mut all = Vec::new();
        for range in &self.0 {
            let (start, step, count) = range.resolve(Some(frames))?;
            all.extend((0..count.unwrap_or(0)).map(|i| start + i * step));
        }
        all.sort_unstable();
        all.dedup();
        Ok(all)
    }
}

serde_as_text!(Whole<2>, Numbers<2>, Numbers<3>, FrameRange, FrameList);

#[cfg(test)]
mod tests {
    use super::*;

    fn frames(text: &str, all: usize) -> Option<Vec<usize>> {
        text.parse::<FrameList>().ok()?.resolve(all).ok()
    }

    #[test]
    fn shares_may_be_in_percent() {
        assert_eq!(["0.05", "5%", " 5 % ", "-1%", "2"].map(share), [0.05, 0.05, 0.05, -0.01, 2.0].map(Ok));
        assert!(["", "%", "5%%", "nan", "inf%", "5 percent"].into_iter().all(|text| share(text).is_err()));
    }

    #[test]
    fn ranges_of_frames_are_numpys() {
        assert_eq!(frames("2:5", 10), Some(vec![2, 3, 4]));
        assert_eq!(frames(":", 3), Some(vec![0, 1, 2]));
        assert_eq!(frames("::4", 10), Some(vec![0, 4, 8]));
        assert_eq!(frames("-2:", 10), Some(vec![8, 9]));
        assert_eq!(frames("-1", 10), Some(vec![9]));
        assert_eq!(frames("8:99", 10), Some(vec![8, 9]));
        assert_eq!(frames("5,1,5,2:4", 10), Some(vec![1, 2, 3, 5]));
        for wrong in ["", "a", "1:2:0", "5:5", "10", "1:2:3:4", "3:1"] {
            assert_eq!(frames(wrong, 10), None, "{wrong}");
        }
    }

    #[test]
    fn a_streams_frames_may_be_open_ended_but_not_counted_back() {
        assert_eq!("2::3".parse::<FrameRange>().expect("a range").resolve(None).expect("open"), (2, 3, None));
        assert!("-2:".parse::<FrameRange>().expect("a range").resolve(None).is_err());
    }
}
