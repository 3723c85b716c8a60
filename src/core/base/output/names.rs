//! Names of the files of frames and views.

use super::STANDARD;
use crate::base::error::{Error, Result};
use std::path::{Path, PathBuf};

/// Names of numbered files, one for each frame.
#[derive(Debug)]
pub struct Numbered {
    before: String,
    after: String,
    /// Digits of the number; None if there is only one file.
    pub digits: Option<usize>,
}

impl Numbered {
    /// From a name with one `%d` or `%0Nd`, or a plain name if there is only one frame.
    pub fn new(path: &Path, frames: usize) -> Result<Self> {
        let name = path.to_string_lossy().into_owned();
        let Some((before, digits, after)) = place_of_number(&name, 'd') else {
            if name.contains('%') {
                return Err(misplaced(path));
            }
            if frames != 1 {
                let ending = path.extension().unwrap_or_default().to_string_lossy();
                let what = format!("{frames} frames need a numbered name, like frame_%04d.{ending}");
                return Err(Error::path(path, what));
            }
            return Ok(Self { before: name, after: String::new(), digits: None });
        };
        if before.contains('%') || after.contains('%') {
            return Err(misplaced(path));
        }
        Ok(Self { before: before.into(), after: after.into(), digits: Some(digits) })
    }

    /// Names made from `name`, in which % has no meaning, with a number and an extension.
    pub fn after(name: &str, ending: &str) -> Self {
        Self { before: format!("{name}_"), after: format!(".{ending}"), digits: Some(4) }
    }

    /// The name of a frame's file.
    pub fn path(&self, frame: usize) -> PathBuf {
        match self.digits {
            Some(digits) => format!("{}{frame:0digits$}{}", self.before, self.after).into(),
            None => PathBuf::from(&self.before),
        }
    }
}

fn misplaced(path: &Path) -> Error {
    Error::path(path, "write %d or %04d for the number of a frame, and %v or %03v for that of a view")
}

/// The text before the first `%d` or `%0Nd` of a name (`%v` or `%0Nv` for the letter v), N, and the text after it.
fn place_of_number(name: &str, letter: char) -> Option<(&str, usize, &str)> {
    name.match_indices('%').find_map(|(at, _)| {
        let (digits, after) = name[at + 1..].split_once(letter).filter(|(digits, _)| digits.len() < 4)?;
        let number = if digits.is_empty() { Some(1) } else { digits.parse().ok() };
        number.map(|number| (&name[..at], number, after))
    })
}

/// A name for the pictures of each view, with its number for `%v` or, with zeros, `%03v`. A name without `%v` is for
/// all views, if there is one view or if they may be `joined`.
pub fn names_of_views(path: &Path, views: usize, joined: bool) -> Result<Vec<PathBuf>> {
    let name = path.to_string_lossy();
    match place_of_number(&name, 'v') {
        Some((_, _, after)) if place_of_number(after, 'v').is_some() => Err(misplaced(path)),
        Some((before, digits, after)) => {
            Ok((0..views).map(|view| format!("{before}{view:0digits$}{after}").into()).collect())
        }
        None if views == 1 || joined => Ok(vec![path.into()]),
        None if path == Path::new(STANDARD) => Err(Error::path(
            path,
            format!("standard output takes one view, not {views}; write files with %v in their name"),
        )),
        None => Err(Error::path(path, format!("{views} views need %v in the name, like view%v_%04d.png"))),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn patterns_number_files() {
        let name = |pattern: &str, frame| Numbered::new(Path::new(pattern), 2).map(|n| n.path(frame));
        assert_eq!(name("a_%04d.png", 7).expect("a pattern"), Path::new("a_0007.png"));
        assert_eq!(name("a_%d.png", 12).expect("a pattern"), Path::new("a_12.png"));
        for bad in ["a.png", "a_%x.png", "a_%4d_%d.png", "a%"] {
            assert!(name(bad, 0).is_err(), "{bad}");
        }
        assert_eq!(Numbered::after("100%", "vti").path(7), Path::new("100%_0007.vti"));
        assert_eq!(Numbered::new(Path::new("a.png"), 1).expect("one picture").path(5), Path::new("a.png"));
    }

    #[test]
    fn views_have_names_of_their_own() {
        let names = |path: &str, views| names_of_views(Path::new(path), views, false).map_err(|e| e.to_string());
        assert_eq!(names("v%02v_%04d.png", 2).expect("a pattern"), ["v00_%04d.png", "v01_%04d.png"].map(PathBuf::from));
        assert_eq!(names("a_%d.npy", 1).expect("one view"), [PathBuf::from("a_%d.npy")]);
        for bad in ["a.npy", "-", "a%dv.npy", "%v%v.npy"] {
            assert!(names(bad, 2).is_err(), "{bad}");
        }
        let joined = names_of_views(Path::new("a.y4m"), 2, true).expect("one for both");
        assert_eq!(joined, [PathBuf::from("a.y4m")]);
    }
}
