//! Remedies of errors and notes, as arguments of Python.

use wavesplat::base::error::{Error, Note, Remedy};

/// The words of an error, with advice if there is some.
pub(crate) fn of_error(error: &Error) -> String {
    let words = match error {
        Error::Setting { setting: "request", problem, .. } => problem.replace('`', ""), // of one of its fields
        Error::Setting { .. } => error.to_string().replace('`', ""),                    // around names of arguments
        other => other.to_string(),
    };
    advised(words, error.remedy().as_ref())
}

/// The words of a note, with advice if there is some.
pub(crate) fn of_note(note: &Note) -> String {
    advised(note.text.clone(), note.remedy.as_ref())
}

fn advised(words: String, remedy: Option<&Remedy>) -> String {
    match remedy.and_then(advice) {
        Some(advice) => format!("{words}; {advice}"),
        None => words,
    }
}

/// Advice; `None` for remedies that Python handles otherwise.
fn advice(remedy: &Remedy) -> Option<String> {
    Some(match remedy {
        Remedy::Set("axes") => "axes=... changes this".into(),
        Remedy::ChooseVariable => "variable=... chooses one".into(),
        Remedy::ChooseComponent { .. } | Remedy::ChooseIndex { .. } => {
            "choose one item of the other axes by isel".into()
        }
        Remedy::MaskMissing => "missing='mask' keeps them as missing samples".into(),
        Remedy::DeclareMissing(value) => format!("if it means missing, give missing={value}"),
        Remedy::DeclareMissingOrError(value) => {
            format!("if it means missing, give missing={value}; if not, allow an error by max_error=...")
        }
        Remedy::Try(field, value) => format!("try {field}={value}"),
        Remedy::KeepRange => "keep='range' keeps decoded samples within the extremes of the source".into(),
        Remedy::Allow(field) => format!("allow a larger error by {field}"),
        Remedy::Replace => "overwrite=True replaces it".into(),
        Remedy::BeginAnew => "overwrite=True starts over".into(),
        Remedy::ResumeOrBeginAnew => "resume=True continues it, overwrite=True starts over".into(),
        Remedy::DownloadOrSkip => {
            "the server was asked twice; download the file, and check it: wavesplat verify".into()
        }
        Remedy::RecoverOrSkip => "the program wavesplat saves the undamaged blocks: wavesplat recover".into(),
        Remedy::ResumeOrRecover => "an unfinished conversion: resume=True continues it".into(),
        _ => return None,
    })
}
