//! A running `wavesplat view`.

use crate::cli::Work;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::process::{Child, Command, Stdio};
use std::time::Duration;

pub(super) struct Served {
    pub(super) child: Child,
    /// The address of the page.
    pub(super) address: String,
}

/// An answer: its status, its head and its body.
pub(super) struct Answer {
    pub(super) status: u16,
    pub(super) head: String,
    pub(super) body: Vec<u8>,
}

impl Served {
    pub(super) fn start(work: &Work, args: &str) -> Self {
        Self::start_with(work, args, None)
    }

    pub(super) fn start_with(work: &Work, args: &str, token: Option<&str>) -> Self {
        Self::start_by(Command::new(env!("CARGO_BIN_EXE_wavesplat")), work, args, token)
    }

    /// As from a terminal, so that it heeds Ctrl-C, with a folder of the work for temporary files.
    pub(super) fn start_interruptible(work: &Work, args: &str) -> Self {
        let mut command = Command::new("env");
        command.args(["--default-signal=INT,TERM", env!("CARGO_BIN_EXE_wavesplat")]).env("TMPDIR", work.path("tmp"));
        Self::start_by(command, work, args, None)
    }

    fn start_by(mut command: Command, work: &Work, args: &str, token: Option<&str>) -> Self {
        command.args(["view", "--no-open"]).args(args.split_whitespace()).current_dir(work.path(""));
        command.stdout(Stdio::piped()).stderr(Stdio::null()).env_remove("WAVESPLAT_TOKEN");
        command.envs(token.map(|token| ("WAVESPLAT_TOKEN", token)));
        let mut child = command.spawn().unwrap();
        let mut address = String::new();
        BufReader::new(child.stdout.take().unwrap()).read_line(&mut address).unwrap();
        Self { child, address: address.trim().into() }
    }

    /// Host and port.
    pub(super) fn host(&self) -> &str {
        self.address.strip_prefix("http://").unwrap().split('/').next().unwrap()
    }

    /// The path of the page, or of something beside it.
    pub(super) fn path(&self, name: &str) -> String {
        format!("/{}/{name}", self.address.split('/').nth(3).unwrap())
    }

    pub(super) fn connect(&self) -> TcpStream {
        let stream = TcpStream::connect(self.host()).unwrap();
        stream.set_read_timeout(Some(Duration::from_secs(60))).unwrap();
        stream
    }

    /// Sends a request with more lines in its head.
    pub(super) fn ask(&self, line: &str, head: &[(&str, &str)], body: &[u8]) -> Answer {
        let mut stream = self.connect();
        let lines: String = head.iter().map(|(name, value)| format!("{name}: {value}\r\n")).collect();
        let length = body.len();
        let start = format!("{line} HTTP/1.1\r\n{lines}Content-Length: {length}\r\nConnection: close\r\n\r\n");
        stream.write_all(start.as_bytes()).unwrap();
        let _ = stream.write_all(body); // the server may refuse it before it is complete
        let mut bytes = Vec::new();
        let _ = stream.read_to_end(&mut bytes);
        let end = bytes.windows(4).position(|four| four == b"\r\n\r\n").unwrap_or(bytes.len());
        let head = String::from_utf8_lossy(&bytes[..end]).into_owned();
        let status = head.split(' ').nth(1).and_then(|word| word.parse().ok()).unwrap_or(0);
        Answer { status, head, body: bytes.get(end + 4..).unwrap_or_default().to_vec() }
    }

    pub(super) fn get(&self, name: &str) -> Answer {
        self.ask(&format!("GET {}", self.path(name)), &[("Host", self.host())], b"")
    }

    pub(super) fn post(&self, name: &str, body: &[u8]) -> Answer {
        self.ask(&format!("POST {}", self.path(name)), &[("Host", self.host())], body)
    }
}

impl Answer {
    pub(super) fn text(&self) -> String {
        String::from_utf8_lossy(&self.body).into_owned()
    }
}

impl Drop for Served {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
