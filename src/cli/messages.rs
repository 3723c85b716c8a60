//! Words errors and notes of the library as options of the programs.

use clap::Command;
use std::borrow::Cow;
use std::io::{self, Write};
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use wavesplat_core::base::error::{Error, Note, Remedy};
use wavesplat_formats::extensions;
use wavesplat_jobs::picture::is_field;

/// The text of an error, with a tip if it has a remedy.
pub fn error_text(error: &Error, command: &Command) -> String {
    let text = match error {
        Error::Setting { setting, value, problem, .. } => {
            format!("error: {}{value}: {}", option(setting, command), with_options(problem, command))
        }
        other => format!("error: {}", with_options(&other.to_string(), command)),
    };
    error.remedy().map(|remedy| format!("{text}\n  tip: {}", advice(&remedy))).unwrap_or(text)
}

/// A text about pictures, with options in place of the fields that it has in backquotes.
pub(super) fn picture_text(text: &str) -> String {
    worded(text, |quoted| is_field(quoted).then(|| format!("--{}", name(quoted))))
}

/// Prints a line on standard error.
pub(super) fn note(text: impl std::fmt::Display) {
    let _ = writeln!(io::stderr().lock(), "{text}"); // a failure cannot be reported anywhere else
}

/// Whether notes about servers are left out.
static QUIET: AtomicBool = AtomicBool::new(false);

/// Leaves out notes about servers from now on.
pub(super) fn silence() {
    QUIET.store(true, Relaxed);
}

/// A note about a server, unless they are left out.
pub(super) fn remote_note(text: &str) {
    if !QUIET.load(Relaxed) {
        note(text);
    }
}

/// The text of a note, with advice if it has a remedy.
pub fn note_text(note: &Note) -> String {
    note.remedy.as_ref().map_or(note.text.clone(), |remedy| format!("{note}; {}", advice(remedy)))
}

/// Fields whose options have other names.
const OPTIONS: [(&str, &str); 6] = [
    ("sample", "dtype"),
    ("big_endian", "endian"),
    ("azimuth", "view"),
    ("elevation", "view"),
    ("certify", "error-image"),
    ("surfaces", "iso"),
];

/// The name of the option for a field.
fn name(field: &str) -> String {
    let other = OPTIONS.iter().find(|(known, _)| *known == field).map(|(_, option)| (*option).to_string());
    other.unwrap_or_else(|| field.replace('_', "-"))
}

/// The option that sets a field, or the field's name if the program has no such option.
fn option(setting: &str, command: &Command) -> String {
    long_option(setting, command).unwrap_or_else(|| setting.replace('_', " "))
}

/// The option that sets a field, if the program has it.
fn long_option(setting: &str, command: &Command) -> Option<String> {
    let name = name(setting);
    let mut commands = std::iter::once(command).chain(command.get_subcommands());
    let is_option = commands.any(|c| c.get_arguments().any(|arg| arg.get_long() == Some(name.as_str())));
    is_option.then(|| format!("--{name}"))
}

/// A text with the program's options in place of the fields that it has in backquotes.
fn with_options(text: &str, command: &Command) -> String {
    worded(text, |quoted| long_option(quoted, command))
}

/// A text with options in place of words in backquotes. A word without an option stays.
fn worded(text: &str, option: impl Fn(&str) -> Option<String>) -> String {
    let parts: Vec<&str> = text.split('`').collect();
    if parts.len().is_multiple_of(2) {
        return text.into();
    }
    let mut all = String::new();
    for (n, part) in parts.into_iter().enumerate() {
        let is_quoted = n % 2 == 1;
        all += &if is_quoted { option(part).unwrap_or_else(|| format!("`{part}`")) } else { part.into() };
    }
    all
}

/// Advice that names options of the programs.
pub fn advice(remedy: &Remedy) -> Cow<'static, str> {
    let fixed = match remedy {
        Remedy::Set(field) => return format!("--{} changes this", name(field)).into(),
        Remedy::ChooseVariable => "--variable chooses one",
        Remedy::ChooseComponent { name, components } => {
            return format!("--variable '{name}[0]' takes the first, up to [{}]", components.saturating_sub(1)).into();
        }
        Remedy::ChooseIndex { name } => return index(name).into(),
        Remedy::ChooseFrames => "--frames a:b chooses the frames that the file holds",
        Remedy::DescribeSamples => return known_formats().into(),
        Remedy::Adjust(fields) => return format!("adjust {}", or(fields)).into(),
        Remedy::SetDims { dims: [x, y, z], frames: 1 } => return format!("give --dims {x}x{y}x{z}").into(),
        Remedy::SetDims { dims: [x, y, z], frames } => return format!("give --dims {x}x{y}x{z}x{frames}").into(),
        Remedy::AllowGaps => "--allow-gaps accepts them",
        Remedy::MaskMissing => "--missing mask keeps them as missing samples",
        Remedy::DeclareMissing(value) => return format!("if it means missing, add --missing-value {value}").into(),
        Remedy::DeclareMissingOrError(value) => {
            return format!("if it means missing, add --missing-value {value}; if not, allow an error by --max-error")
                .into();
        }
        Remedy::Try(field, value) => return format!("try --{} {value}", name(field)).into(),
        Remedy::KeepRange => "--keep range promises decoded samples within the extremes of the source",
        Remedy::Allow(field) => return format!("allow a larger error by --{}", name(field)).into(),
        Remedy::BuildWith(feature) => {
            return format!("build with cargo build --release --features {feature}").into();
        }
        Remedy::Replace => "--force replaces it",
        Remedy::ReplaceOrAppend => "--force replaces it, append adds frames",
        Remedy::BeginAnew => "--force starts over",
        Remedy::ResumeOrBeginAnew => "--resume continues it, --force starts over",
        Remedy::AppendOrBeginAnew { frames } => return append(*frames).into(),
        Remedy::RecoverOrSkip => {
            "wavesplat recover saves the undamaged blocks; if only blocks are damaged, --skip-damaged reads the rest"
        }
        Remedy::DownloadOrSkip => {
            "the server was asked twice; if a downloaded copy is damaged, too, wavesplat recover saves its undamaged blocks; \
             --skip-damaged reads them from here"
        }
        Remedy::ResumeOrRecover => {
            "an unfinished conversion: its command with --resume continues it, wavesplat recover saves its finished blocks"
        }
        Remedy::RangeAboveZero => "give --range, or --norm linear",
        Remedy::Project => "leave it out, or make projections with --mode projection",
        Remedy::ProjectOrConvertSamples => "leave --mode out, or convert without --transfer-function",
    };
    fixed.into()
}

/// Lists options, with "or" before the last.
fn or(fields: &[&str]) -> String {
    let options: Vec<String> = fields.iter().map(|field| format!("--{}", name(field))).collect();
    match &options[..] {
        [before @ .., last] if !before.is_empty() => format!("{} or {last}", before.join(", ")),
        _ => options.concat(),
    }
}

fn index(name: &str) -> String {
    format!(
        "--variable '{name}[0]' takes its first index; --axes gives the meaning of each axis, slowest first: \
         one of the letters t z y x, or c for another axis"
    )
}

fn append(frames: u64) -> String {
    format!("--frames 0:{frames} converts the first frames, and wavesplat append adds the others; --force starts over")
}

/// The options for headerless data, and the formats that need no options.
fn known_formats() -> String {
    let known: Vec<String> = extensions().map(|extension| format!(".{extension}")).collect();
    format!("for headerless data type --dims NXxNYxNZ --dtype TYPE. Known formats: {}", known.join(", "))
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::Arg;

    fn command() -> Command {
        let arg = |name: &'static str| Arg::new(name).long(name);
        Command::new("wavesplat").subcommand(Command::new("convert").args(["splat-error", "dtype"].map(arg)))
    }

    #[test]
    fn fields_are_options_where_a_program_has_them() {
        let found = ["splat_error", "sample", "inputs", "some_field"].map(|field| option(field, &command()));
        assert_eq!(found, ["--splat-error", "--dtype", "inputs", "some field"]);
        let error = Error::setting("sample", Note::with("is wrong", Remedy::Adjust(&["dims", "sample", "offset"])));
        let text = error_text(&error, &command());
        assert_eq!(text, "error: --dtype: is wrong\n  tip: adjust --dims, --dtype or --offset");
        let text = error_text(&Error::setting("splat_error", "needs `sample`, not `a b`"), &command());
        assert_eq!(text, "error: --splat-error: needs --dtype, not `a b`");
    }

    #[test]
    fn notes_end_with_what_can_be_done() {
        assert_eq!(note_text(&"a".into()), "a");
        assert_eq!(note_text(&Note::with("a", Remedy::Set("axes"))), "a; --axes changes this");
    }
}
