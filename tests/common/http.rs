//! A server of one file over HTTP that counts what it sends, and fails as it is told to.

use std::io::{BufRead, BufReader, Read, Write};
use std::net::{TcpListener, TcpStream};
use std::ops::Range;
use std::sync::{Arc, Mutex};
use std::thread;
use std::time::Duration;

/// What happens to a request.
#[derive(Clone, Debug)]
pub(crate) enum Fate {
    /// It is answered.
    Answer,
    /// It is refused: status, headers, body.
    Refuse(u16, String, String),
    /// The connection ends after some bytes of the body.
    Cut(usize),
    /// The body comes slowly, a byte at a time.
    Drip,
    /// There is no answer for a long time.
    Silent,
    /// The whole file comes, whatever was asked for.
    Whole,
    /// Other bytes come than those that were asked for.
    Shifted,
    /// A bit of the body is wrong.
    Flipped(usize),
    /// The file has another version now: bytes and ETag.
    Replaced(Vec<u8>, String),
    /// The ETag is left out.
    Nameless,
    /// Another file comes, of this type.
    Other(Vec<u8>, &'static str),
    /// Bytes come that are no HTTP.
    Nonsense,
    /// More bytes come than are announced, without a length.
    Endless,
}

/// A request for a range of the file.
#[derive(Clone, Debug)]
pub(crate) struct Asked {
    /// Its number, from 0.
    pub(crate) number: usize,
    pub(crate) range: Range<usize>,
    pub(crate) if_match: Option<String>,
    pub(crate) authorization: Option<String>,
    pub(crate) path: String,
}

/// The requests so far, and those that nobody has looked at.
#[derive(Default)]
struct Log {
    count: usize,
    asked: Vec<Asked>,
}

type Rule = dyn Fn(&Asked) -> Fate + Send + Sync;

/// A server that answers until the test ends.
pub(crate) struct Server {
    port: u16,
    log: Arc<Mutex<Log>>,
}

impl Server {
    /// Serves bytes as a file of any name.
    pub(crate) fn of(bytes: Vec<u8>) -> Self {
        Self::with(bytes, |_| Fate::Answer)
    }

    /// The same; `rule` says what happens to each request.
    pub(crate) fn with(bytes: Vec<u8>, rule: impl Fn(&Asked) -> Fate + Send + Sync + 'static) -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let port = listener.local_addr().unwrap().port();
        let log = Arc::new(Mutex::new(Log::default()));
        let (bytes, rule, log_of_server): (_, Arc<Rule>, _) = (Arc::new(bytes), Arc::new(rule), log.clone());
        thread::spawn(move || {
            for stream in listener.incoming().flatten() {
                let (bytes, rule, log) = (bytes.clone(), rule.clone(), log_of_server.clone());
                thread::spawn(move || serve(&stream, &bytes, &*rule, &log));
            }
        });
        Self { port, log }
    }

    pub(crate) fn address(&self) -> String {
        format!("http://127.0.0.1:{}/run.wspl", self.port)
    }

    pub(crate) fn port(&self) -> u16 {
        self.port
    }

    /// The requests since this was asked last.
    pub(crate) fn asked(&self) -> Vec<Asked> {
        std::mem::take(&mut self.log.lock().unwrap().asked)
    }

    /// How many these are, and the bytes that were sent.
    pub(crate) fn traffic(&self) -> (usize, usize) {
        let asked = self.asked();
        (asked.len(), asked.iter().map(|asked| asked.range.len()).sum())
    }
}

/// Answers the requests of a connection.
fn serve(stream: &TcpStream, bytes: &[u8], rule: &Rule, log: &Mutex<Log>) {
    let mut lines = BufReader::new(stream);
    while let Some(asked) = read(&mut lines, bytes.len()) {
        let asked = numbered(asked, log);
        if answer(stream, bytes, &asked, rule(&asked)).is_none() {
            return;
        }
    }
    send(stream, "HTTP/1.1 400 Bad Request\r\nContent-Length: 0\r\n\r\n", &[]);
}

/// Remembers a request, and gives it its number.
fn numbered(asked: Asked, log: &Mutex<Log>) -> Asked {
    let mut log = log.lock().unwrap();
    let asked = Asked { number: log.count, ..asked };
    log.count += 1;
    log.asked.push(asked.clone());
    asked
}

/// Reads a request.
fn read(lines: &mut BufReader<&TcpStream>, len: usize) -> Option<Asked> {
    let mut line = String::new();
    lines.read_line(&mut line).ok().filter(|read| *read > 0)?;
    let path = line.split(' ').nth(1)?.to_string();
    let mut asked = Asked { number: 0, range: 0..len, if_match: None, authorization: None, path };
    loop {
        line.clear();
        lines.read_line(&mut line).ok()?;
        let Some((name, value)) = line.trim().split_once(": ") else { return Some(asked) };
        match name.to_ascii_lowercase().as_str() {
            "range" => {
                let (first, last) = value.strip_prefix("bytes=")?.split_once('-')?;
                asked.range = first.parse().ok()?..(last.parse::<usize>().ok()? + 1).min(len);
            }
            "if-match" => asked.if_match = Some(value.into()),
            "authorization" => asked.authorization = Some(value.into()),
            _ => {}
        }
    }
}

/// Answers a request; none if the connection ends.
fn answer(mut out: &TcpStream, bytes: &[u8], asked: &Asked, fate: Fate) -> Option<()> {
    let Asked { range, .. } = asked;
    let head = |range: &Range<usize>, len: usize, etag: &str| {
        format!(
            "HTTP/1.1 206 Partial Content\r\nContent-Range: bytes {}-{}/{len}\r\nContent-Length: {}\r\n{etag}\r\n",
            range.start,
            range.end.max(1) - 1,
            range.len(),
        )
    };
    let etag = "ETag: \"one\"\r\n";
    match fate {
        Fate::Answer => send(out, &head(range, bytes.len(), etag), &bytes[range.clone()]),
        Fate::Nameless => send(out, &head(range, bytes.len(), ""), &bytes[range.clone()]),
        Fate::Refuse(status, headers, body) => {
            let length = body.len();
            send(out, &format!("HTTP/1.1 {status} No\r\nContent-Length: {length}\r\n{headers}\r\n"), body.as_bytes())
        }
        Fate::Cut(after) => {
            let sent = &bytes[range.clone()];
            send(out, &head(range, bytes.len(), etag), &sent[..after.min(sent.len())]);
            None
        }
        Fate::Drip => {
            send(out, &head(range, bytes.len(), etag), &[])?;
            for byte in &bytes[range.clone()] {
                thread::sleep(Duration::from_millis(20));
                out.write_all(&[*byte]).ok()?;
            }
            Some(())
        }
        Fate::Silent => {
            let _ = out.set_read_timeout(Some(Duration::from_secs(20)));
            let _ = out.read(&mut [0]); // until the client goes away
            None
        }
        Fate::Whole => send(out, &format!("HTTP/1.1 200 OK\r\nContent-Length: {}\r\n\r\n", bytes.len()), bytes),
        Fate::Shifted => {
            let start = range.start + 1;
            let shifted = start..range.end.max(start + 1).min(bytes.len());
            send(out, &head(&shifted, bytes.len(), etag), &bytes[shifted.clone()])
        }
        Fate::Flipped(bit) => {
            let mut sent = bytes[range.clone()].to_vec();
            let at = bit / 8 % sent.len();
            sent[at] ^= 1 << (bit % 8);
            send(out, &head(range, bytes.len(), etag), &sent)
        }
        Fate::Replaced(others, etag) => {
            let range = range.start.min(others.len())..range.end.min(others.len());
            send(out, &head(&range, others.len(), &format!("ETag: {etag}\r\n")), &others[range.clone()])
        }
        Fate::Other(others, kind) => {
            let head = format!("HTTP/1.1 200 OK\r\nContent-Type: {kind}\r\nContent-Length: {}\r\n\r\n", others.len());
            send(out, &head, &others)
        }
        Fate::Nonsense => {
            send(out, "220 mail server ready\r\n", &[]);
            None
        }
        Fate::Endless => {
            let head = head(range, bytes.len(), etag).replace("Content-Length", "X-Length");
            send(out, &head, &bytes[range.clone()])?;
            while out.write_all(&[0; 4096]).is_ok() {}
            None
        }
    }
}

fn send(mut out: &TcpStream, head: &str, body: &[u8]) -> Option<()> {
    out.write_all(&[head.as_bytes(), body].concat()).ok()
}
