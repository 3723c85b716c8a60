//! Opens the browser of the desktop.

use std::process::{Command, Stdio};
use std::thread;

const OPENER: &str = if cfg!(target_os = "macos") { "open" } else { "xdg-open" };

/// Opens an address, if the machine has a desktop. Otherwise the printed address has to do.
pub(super) fn open(address: &str) {
    let silent =
        Command::new(OPENER).arg(address).stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null()).spawn();
    if let Ok(mut opener) = silent {
        thread::spawn(move || opener.wait());
    }
}
