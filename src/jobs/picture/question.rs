//! What a page asks, by a name and a body in JSON. The server of the viewer and a page without a server answer alike.

use super::request::wrong;
use super::view_request::{Saved, ViewRequest};
use super::viewer::ViewerSession;
use serde::Deserialize;
use serde::de::DeserializeOwned;
use wavesplat_core::base::cancel::CancelToken;
use wavesplat_core::base::error::{Error, Result};

/// What a page asks.
#[derive(Debug)]
pub enum Question {
    /// Pictures: a description, and blocks of their numbers.
    Pictures(ViewRequest),
    /// How common samples of a frame are, or samples of some frames.
    Histogram(Option<usize>),
    /// The time series of a point, given as shares of the axes.
    Series([f64; 3]),
    /// The command that makes a file.
    Command(ViewRequest, Saved),
    /// A file.
    Save(ViewRequest, Saved),
}

/// The body of a question about how common samples are.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct OfFrame {
    frame: Option<usize>,
}

impl Question {
    /// Reads a question. Nothing of it is trusted.
    ///
    /// # Errors
    /// An unknown name, a body that is no such question, or one for too much.
    pub fn read(name: &str, body: &[u8]) -> Result<Self> {
        let view = || ViewRequest::read(body);
        let file = |view: ViewRequest| {
            let file = view.file.ok_or_else(|| wrong("file: takes picture.png, page.html or movie.mp4"))?;
            Ok::<_, Error>((view, file))
        };
        Ok(match name {
            "pictures" => Self::Pictures(view()?),
            "histogram" => Self::Histogram(json::<OfFrame>(body)?.frame),
            "series" => Self::Series(json(body)?),
            "command" => view().and_then(file).map(|(view, file)| Self::Command(view, file))?,
            "save" => view().and_then(file).map(|(view, file)| Self::Save(view, file))?,
            _ => return Err(wrong(format!("unknown question `{name}`"))),
        })
    }

    /// Whether the answer takes no work, so that it need not wait for other work.
    pub fn is_quick(&self) -> bool {
        matches!(self, Self::Command(..))
    }
}

fn json<T: DeserializeOwned>(body: &[u8]) -> Result<T> {
    serde_json::from_slice(body).map_err(|e| wrong(format!("not a question: {e}")))
}

impl ViewerSession {
    /// The answer to a question.
    ///
    /// # Errors
    /// Those of rendering or reading, or [`Error::Cancelled`].
    pub fn answer(&self, question: &Question, work: &CancelToken) -> Result<Vec<u8>> {
        match question {
            Question::Pictures(view) => self.pictures(view, work),
            Question::Histogram(frame) => {
                let histogram = self.histogram(*frame, work)?;
                serde_json::to_vec(&histogram).map_err(|e| Error::setting("histogram", e.to_string()))
            }
            Question::Series(shares) => self.series(*shares, work),
            Question::Command(view, saved) => self.command(view, *saved).map(String::into_bytes),
            Question::Save(view, saved) => self.save(view, *saved, work),
        }
    }
}
