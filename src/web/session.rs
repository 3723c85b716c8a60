//! The open file, and answers to what the page asks.

use crate::far::FarFile;
use serde::Deserialize;
use std::cell::RefCell;
use wavesplat_core::base::cancel::CancelToken;
use wavesplat_core::base::error::{Error, Result};
use wavesplat_engine::file::CoefficientFile;
use wavesplat_jobs::picture::{Inputs, PictureRequest, Question, Session, ViewerSession};

/// What the page opens.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Opening {
    /// The name of the file, for messages and the title.
    name: String,
    /// Its length, if it is elsewhere; else its bytes were given before.
    far: Option<u64>,
    /// Bytes of memory for pictures.
    memory: usize,
    /// The settings of all pictures.
    request: PictureRequest,
}

thread_local! {
    static OPEN: RefCell<Option<ViewerSession>> = const { RefCell::new(None) };
    static BYTES: RefCell<Vec<u8>> = const { RefCell::new(Vec::new()) };
}

/// The answer to a question.
///
/// # Errors
/// Those of the session, an unknown question, or a question before a file is open.
pub(crate) fn answer(question: &str, body: Vec<u8>) -> Result<Vec<u8>> {
    match question {
        "bytes" => {
            BYTES.set(body);
            Ok(Vec::new())
        }
        "open" => open(&body).map(|()| Vec::new()),
        question => OPEN.with_borrow(|open| {
            let session = open.as_ref().ok_or_else(|| Error::setting("question", "no file is open"))?;
            session.answer(&Question::read(question, &body)?, &CancelToken::default())
        }),
    }
}

fn open(body: &[u8]) -> Result<()> {
    let Opening { name, far, memory, request } =
        serde_json::from_slice(body).map_err(|e| Error::setting("open", e.to_string()))?;
    let file = match far {
        Some(len) => CoefficientFile::from_storage(&name, FarFile { len })?,
        None => CoefficientFile::from_storage(&name, BYTES.take())?,
    };
    let inputs = Inputs { paths: vec![name.into()], ..Inputs::default() };
    let session = Session::from_file(file, inputs, memory);
    OPEN.set(Some(ViewerSession::new(&session, request, Vec::new())));
    Ok(())
}
