//! The program `wavesplat-demo`: the whole experiment, in the folder `demo-output`. It has no options, as a library for them
//! would take a tenth of the time to build; `wavesplat-tools demo` has some.

use std::io::{self, Write};
use std::process::ExitCode;
use wavesplat_core::base::error::{Error, Result};
use wavesplat_demo::experiment::{Demo, FOLDER, run};

/// Prints progress on standard error; ignores errors of a closed stream.
fn say(text: &str) {
    let _ = writeln!(io::stderr().lock(), "{text}");
}

fn demo() -> Result<()> {
    if std::env::args_os().len() > 1 {
        return Err(Error::usage("wavesplat-demo has no options; wavesplat-tools demo has"));
    }
    let demo = Demo::new(FOLDER.into());
    let told = run(&demo, &mut |step| say(&format!("{step} ...")))?;
    write!(io::stdout().lock(), "{told}").map_err(|e| Error::io("standard output", "writing", e))
}

fn main() -> ExitCode {
    demo().map_or_else(
        |error| {
            say(&format!("error: {error}"));
            ExitCode::from(error.exit_code())
        },
        |()| ExitCode::SUCCESS,
    )
}
