//! Coders of other programs, run by the script in `tools/peers`.

use super::clock::IN_A_ROW;
use super::row::Row;
use serde::Deserialize;
use std::ffi::OsStr;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use wavesplat::base::error::{Error, Result};

/// The peer whose times the targets refer to. The other peers are timed once.
pub(super) const TIMED: &str = "sz3-4d";

/// The script and its interpreter.
#[derive(Debug, Clone)]
pub struct Peers {
    /// Python with the packages of `tools/peers/requirements.txt`.
    pub python: PathBuf,
    /// `peers.py`.
    pub script: PathBuf,
}

impl Peers {
    /// The script among these sources.
    pub fn usual_script() -> PathBuf {
        Path::new(env!("CARGO_MANIFEST_DIR")).join("peers").join("peers.py")
    }

    /// Writes an archive of a kind into a folder.
    pub(super) fn generate(&self, kind: &str, folder: &Path, small: bool) -> Result<()> {
        let size: &[&str] = if small { &["--frames", "8", "--edge", "16"] } else { &[] };
        let fixed = [OsStr::new("generate"), OsStr::new(kind), OsStr::new("--out"), folder.as_os_str()];
        self.run(fixed.into_iter().chain(size.iter().map(OsStr::new))).map(|_| ())
    }

    /// Measures all peers on a file, or only the timed one.
    pub(super) fn measure(&self, task: &PeersTask) -> Result<Vec<Row>> {
        let tolerances: Vec<String> = task.tolerances.iter().map(|t| format!("{t:e}")).collect();
        let (tolerances, repeats) = (tolerances.join(","), IN_A_ROW.to_string());
        let mut args = vec![OsStr::new("measure"), task.path.as_os_str()];
        args.extend(["--tolerances", &tolerances, "--repeats", &repeats].map(OsStr::new));
        if let Some(only) = task.only {
            args.extend(["--peers", only].map(OsStr::new));
        }
        let text = self.run(args)?;
        let lines = String::from_utf8_lossy(&text);
        lines.lines().map(|line| self.line(line)?.row(task)).collect()
    }

    fn line(&self, text: &str) -> Result<Line> {
        serde_json::from_str(text).map_err(|e| crate::bench::json::bad_json(&self.script, &e))
    }

    /// The output of the script.
    fn run<'a>(&self, args: impl IntoIterator<Item = &'a OsStr>) -> Result<Vec<u8>> {
        let mut command = Command::new(&self.python);
        command.arg(&self.script).args(args).stderr(Stdio::inherit());
        let output = command.output().map_err(|e| Error::io(&self.python, "running", e))?;
        if output.status.success() {
            return Ok(output.stdout);
        }
        Err(Error::input(&self.script, format!("failed under {} ({})", self.python.display(), output.status)))
    }
}

/// The settings of a measurement by the script.
pub(super) struct PeersTask<'a> {
    /// The name of the data.
    pub(super) data: &'a str,
    /// Bytes of its samples.
    pub(super) data_bytes: u64,
    pub(super) path: &'a Path,
    pub(super) tolerances: &'a [f64],
    /// One of the peers; none: all.
    pub(super) only: Option<&'a str>,
}

/// A line of the script's output; see `peers.py --help`.
#[derive(Deserialize)]
struct Line {
    tolerance: f64,
    peer: String,
    bytes: u64,
    bound: f64,
    largest_error: Option<f64>,
    encode_seconds: f64,
    decode_seconds: f64,
}

impl Line {
    fn row(self, task: &PeersTask<'_>) -> Result<Row> {
        // Restores the exact tolerance, without its conversion to text.
        let asked = task.tolerances.iter().find(|t| (*t / self.tolerance - 1.0).abs() < 1e-12);
        let unasked = || Error::input(task.path, format!("the peers' script measured {:e}", self.tolerance));
        Ok(Row {
            data: task.data.into(),
            tolerance: *asked.ok_or_else(unasked)?,
            coder: self.peer,
            bytes: self.bytes,
            ratio: task.data_bytes as f64 / self.bytes as f64,
            bound: self.bound,
            largest_error: self.largest_error.unwrap_or(f64::INFINITY),
            encode_seconds: self.encode_seconds,
            decode_seconds: self.decode_seconds,
            own: None,
        })
    }
}
