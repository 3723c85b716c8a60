//! The title: beside the time, in smaller letters if it is long, and cut at last.

use super::canvas::Canvas;
use super::layout::LEAST_LINE;
use super::text::{Letters, shortened};

/// How a title is written.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Title {
    pub(super) text: String,
    /// The height of its letters.
    pub(super) size: f64,
    /// The place of its middle across the picture.
    pub(super) middle: f64,
}

/// The least height of letters as a share of that of other texts.
const LEAST: f64 = 0.6;

/// A title that would be cut to this many letters or fewer is left out.
const FEW: usize = 4;

impl Title {
    /// Places a title in a picture between two columns, with the picture's letters; `None` if hardly any letter fits.
    pub(super) fn new(title: &str, letters: &Letters, width: f64, [left, right]: [f64; 2]) -> Option<Self> {
        let (full, room) = (letters.width(title), (right - left).max(0.0));
        let least = (LEAST * letters.size).max(LEAST_LINE).min(letters.size);
        let size = if full <= room { letters.size } else { (0.999 * letters.size * room / full).max(least) };
        let smaller = letters.with_size(size);
        let text = shortened(title, |text| smaller.width(text) <= room);
        let is_cut = text != title;
        if text.is_empty() || is_cut && text.chars().count() <= FEW {
            return None;
        }
        let half = smaller.width(&text) / 2.0;
        let middle = (width / 2.0).clamp(left + half, (right - half).max(left + half));
        Some(Self { text, size, middle })
    }

    /// Writes the title at a height.
    pub(super) fn write(&self, canvas: &mut Canvas<'_>, y: f64) -> bool {
        canvas.write_in(&canvas.letters.with_size(self.size), &self.text, [self.middle, y])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LONG: &str = "Reaction and diffusion of two substances in a cube with periodic faces";

    fn titled(size: f64, width: f64, left: f64) -> Option<Title> {
        Title::new(LONG, &Letters::new(size), width, [left, width - size])
    }

    #[test]
    fn titles_shrink_before_they_are_cut() {
        let wide = titled(20.0, 3000.0, 200.0).expect("room");
        assert_eq!((wide.text.as_str(), wide.size, wide.middle), (LONG, 20.0, 1500.0));
        let mut before = (LONG.len(), 20.0);
        for width in (100..900).rev().step_by(7) {
            let Some(title) = titled(20.0, f64::from(width), 60.0) else { continue };
            let (letters, is_cut) = (Letters::new(title.size), title.text != LONG);
            let half = letters.width(&title.text) / 2.0;
            assert!(title.middle - half >= 60.0 - 1e-9 && title.middle + half <= f64::from(width) - 20.0 + 1e-9);
            assert!(title.size >= 12.0 && (!is_cut || title.size == 12.0) && title.size <= before.1);
            assert!(title.text.len() <= before.0 + '…'.len_utf8() && (!is_cut || title.text.ends_with('…')));
            before = (title.text.len(), title.size);
        }
        assert!(before.0 < LONG.len() && before.1 == 12.0);
    }

    #[test]
    fn titles_without_room_are_left_out() {
        assert_eq!([titled(20.0, 100.0, 60.0), titled(10.0, 5.0, 60.0), titled(10.0, 70.0, 60.0)], [None, None, None]);
    }

    #[test]
    fn letters_of_small_pictures_do_not_shrink() {
        let title = titled(10.0, 300.0, 60.0).expect("some letters");
        assert!(title.size == 10.0 && title.text.ends_with('…'));
    }
}
