//! An object on an HTTP server: parallel requests for ranges, retried where that may help.

use super::address::Address;
use super::answer::{About, Failure, check};
use super::redirect::{MOST_REDIRECTS, is_redirect, is_same_server, target};
use super::retry::Retries;
use super::{Paged, RemoteOptions};
use std::io::{self, Read};
use std::ops::Range;
use std::panic::resume_unwind;
use std::path::Path;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering::Relaxed};
use std::sync::{Condvar, Mutex, PoisonError};
use std::thread;
use std::time::Duration;
use ureq::http::header::LOCATION;
use ureq::http::{Response, Uri};
use ureq::tls::{RootCerts, TlsConfig};
use ureq::{Agent, Body};
use wavesplat_core::base::address::public_name;
use wavesplat_core::base::error::{self, Error};
use wavesplat_format::Storage;

/// Bytes that are read when an object is opened. Small files are then complete.
const FIRST: u64 = 64 << 10;

/// Requests that are under way at once.
const SIDE_BY_SIDE: usize = 8;

/// How many times longer than its silence an answer of at most 4 MiB may take.
const SLOWEST: u32 = 20;

/// Bytes of a refusal that are looked at.
const MOST_WORDS: u64 = 4096;

/// Opens an object: asks for its first bytes, and finds the pages that a cache has of it.
pub(super) fn open(address: &Path, options: &RemoteOptions) -> error::Result<Paged<Object>> {
    let name = public_name(address);
    let of = Address::parse(&address.to_string_lossy()).map_err(|what| Error::path(&name, what))?;
    let doing = of.server().map_or("opening".into(), |server| format!("opening at {server}"));
    let retries = Retries::new(&name, options);
    let (object, first) = Object::open(of, options.timeout, retries).map_err(|e| Error::io(&name, doing, e))?;
    let version = options.cache.as_ref().zip(object.about.version());
    let on_disk = version.map(|(cache, version)| cache.object(&name, &first, version, object.about.len));
    Ok(Paged::new(object, on_disk).begun(&first))
}

/// An object of a server.
#[derive(Debug)]
pub(super) struct Object {
    address: Address,
    agent: Agent,
    about: About,
    limit: RequestLimit,
    retries: Retries,
    /// Whether bytes were wrong, so that none may come from something on the way that keeps them.
    distrusts: AtomicBool,
}

/// Limits the number of simultaneous requests, whatever the number of threads that make them.
#[derive(Debug)]
struct RequestLimit {
    free: Mutex<usize>,
    left: Condvar,
}

impl RequestLimit {
    fn new(free: usize) -> Self {
        Self { free: Mutex::new(free), left: Condvar::new() }
    }

    fn take<T>(&self, request: impl FnOnce() -> T) -> T {
        let free = self.free.lock().unwrap_or_else(PoisonError::into_inner);
        *self.left.wait_while(free, |free| *free == 0).unwrap_or_else(PoisonError::into_inner) -= 1;
        let answer = request();
        *self.free.lock().unwrap_or_else(PoisonError::into_inner) += 1;
        self.left.notify_one();
        answer
    }
}

impl Object {
    /// Opens an object, and returns its first bytes with it.
    fn open(address: Address, timeout: Duration, retries: Retries) -> io::Result<(Self, Vec<u8>)> {
        let agent = agent(&address, timeout);
        let (limit, distrusts) = (RequestLimit::new(SIDE_BY_SIDE), AtomicBool::new(false));
        let opening = Self { address, agent, about: About::default(), limit, retries, distrusts };
        let (about, first) = opening.retries.until_answered(|| opening.ask(&(0..FIRST), None))?;
        Ok((Self { about, ..opening }, first))
    }

    /// Reads a range within the object.
    fn read(&self, range: &Range<u64>) -> io::Result<Vec<u8>> {
        let ask = || self.limit.take(|| self.ask(range, Some(&self.about)));
        self.retries.until_answered(ask).map(|(_, bytes)| bytes)
    }

    /// Requests a range once. `known` is the result of earlier answers, if any.
    fn ask(&self, range: &Range<u64>, known: Option<&About>) -> Result<(About, Vec<u8>), Failure> {
        let (head, body) = self.answer(range, known)?.into_parts();
        let status = head.status.as_u16();
        match check(status, &head.headers, range, known) {
            Ok(about) => body_of(body, range.end.min(about.len) - range.start).map(|bytes| (about, bytes)),
            Err(Failure::Refused(error)) => Err(self.explained(&error, status, body)),
            Err(failure) => Err(failure),
        }
    }

    /// The answer to a request for a range, wherever redirects lead.
    fn answer(&self, range: &Range<u64>, known: Option<&About>) -> Result<Response<Body>, Failure> {
        let first: Uri = self.address.url().parse().map_err(|_| Failure::last("its address is not understood"))?;
        let mut to = first.clone();
        for _ in 0..=MOST_REDIRECTS {
            let authorization = self.address.authorization().filter(|_| is_same_server(&to, &first));
            let answer = self.send(&to, authorization, range, known)?;
            if !is_redirect(answer.status().as_u16()) {
                return Ok(answer);
            }
            to = next_address(&to, answer)?;
        }
        Err(Failure::last("the server sends elsewhere again and again"))
    }

    /// Sends a request to one address.
    fn send(
        &self,
        to: &Uri,
        authorization: Option<&str>,
        range: &Range<u64>,
        known: Option<&About>,
    ) -> Result<Response<Body>, Failure> {
        let bytes = format!("bytes={}-{}", range.start, range.end - 1);
        let fresh = self.distrusts.load(Relaxed).then_some("no-cache");
        let headers = [
            ("If-Match", known.and_then(About::strong_etag)),
            ("Authorization", authorization),
            ("Cache-Control", fresh),
        ];
        let request = self.agent.get(to.clone()).header("Range", bytes);
        let given = headers.into_iter().filter_map(|(name, value)| Some((name, value?)));
        given.fold(request, |request, (name, value)| request.header(name, value)).call().map_err(failure)
    }

    /// A refusal with the server's own words, and what helps.
    fn explained(&self, error: &io::Error, status: u16, body: Body) -> Failure {
        let mut words = String::new();
        let _ = body.into_reader().take(MOST_WORDS).read_to_string(&mut words); // without them, the status must do
        let message = words.split_once("<Message>").and_then(|(_, rest)| rest.split_once("</Message>"));
        let message = message.map_or(String::new(), |(message, _)| {
            let plain: String = message.chars().filter(|letter| !letter.is_control()).take(200).collect();
            format!(": {plain}")
        });
        let advice = if matches!(status, 400..404) { self.address.advice() } else { "" };
        Failure::Final(io::Error::new(error.kind(), format!("{error}{message}{advice}")))
    }
}

impl Storage for Object {
    fn len(&self) -> u64 {
        self.about.len
    }

    fn read_at(&self, offset: u64, out: &mut [u8]) -> io::Result<()> {
        let bytes = self.read(&(offset..offset + out.len() as u64))?;
        out.copy_from_slice(&bytes);
        Ok(())
    }

    fn read_many(&self, ranges: &[Range<u64>]) -> io::Result<Vec<Vec<u8>>> {
        side_by_side(ranges, |range| self.read(range))
    }

    fn forget(&self, _ranges: &[Range<u64>]) -> bool {
        self.distrusts.store(true, Relaxed);
        true
    }

    fn is_remote(&self) -> bool {
        true
    }
}

/// The address that an answer sends to.
fn next_address(from: &Uri, answer: Response<Body>) -> Result<Uri, Failure> {
    let (head, body) = answer.into_parts();
    let _ = io::copy(&mut body.into_reader().take(MOST_WORDS), &mut io::sink()); // the connection is used again
    let location = head.headers.get(LOCATION).ok_or_else(|| {
        Failure::last("the server says that it is elsewhere, but not where; AWS_REGION may not be that of the bucket")
    })?;
    let next = location.to_str().ok().and_then(|location| target(from, location));
    next.ok_or_else(|| Failure::last("the server sends to an address that is not of HTTP, which is not followed"))
}

/// Reads ranges by several threads; the first error ends it.
fn side_by_side(
    ranges: &[Range<u64>],
    read: impl Fn(&Range<u64>) -> io::Result<Vec<u8>> + Sync,
) -> io::Result<Vec<Vec<u8>>> {
    if let [only] = ranges {
        return Ok(vec![read(only)?]);
    }
    let next = AtomicUsize::new(0);
    let work = || {
        let mut found = Vec::new();
        loop {
            let at = next.fetch_add(1, Relaxed);
            let Some(range) = ranges.get(at) else { return Ok(found) };
            found.push((at, read(range).inspect_err(|_| next.store(ranges.len(), Relaxed))?));
        }
    };
    let found = thread::scope(|scope| {
        let threads: Vec<_> = (0..ranges.len().min(SIDE_BY_SIDE)).map(|_| scope.spawn(work)).collect();
        threads.into_iter().map(|thread| thread.join().unwrap_or_else(|panic| resume_unwind(panic))).collect()
    });
    let found: io::Result<Vec<Vec<_>>> = found;
    let mut all: Vec<(usize, Vec<u8>)> = found?.into_iter().flatten().collect();
    all.sort_by_key(|(at, _)| *at);
    Ok(all.into_iter().map(|(_, bytes)| bytes).collect())
}

/// The HTTP client: connections that stay open, proxies from the environment, the certificates of the system.
fn agent(address: &Address, timeout: Duration) -> Agent {
    let tls = TlsConfig::builder().root_certs(RootCerts::PlatformVerifier).build();
    let config = Agent::config_builder()
        .http_status_as_error(false)
        .https_only(address.is_encrypted())
        .max_redirects(0) // followed here: a password is for one server alone
        .tls_config(tls)
        .user_agent(concat!("wavesplat/", env!("CARGO_PKG_VERSION")))
        .accept_encoding("identity")
        .max_idle_connections_per_host(SIDE_BY_SIDE)
        .timeout_connect(Some(timeout))
        .timeout_recv_response(Some(timeout))
        .timeout_per_read(Some(timeout))
        .timeout_recv_body(Some(timeout * SLOWEST));
    config.build().into()
}

/// The body of an answer, which must have `length` bytes.
fn body_of(body: Body, length: u64) -> Result<Vec<u8>, Failure> {
    let mut bytes = Vec::with_capacity(length as usize);
    let read = body.into_reader().take(length + 1).read_to_end(&mut bytes);
    let cut = |what: String| Failure::Temporary(io::Error::new(io::ErrorKind::UnexpectedEof, what), None);
    match (read, bytes.len() as u64) {
        (Err(error), _) => Err(failure(error.into())),
        (Ok(_), found) if found == length => Ok(bytes),
        (Ok(_), found) if found < length => {
            Err(cut(format!("the server's answer ends after {found} of {length} bytes")))
        }
        (Ok(_), _) => Err(Failure::last(format!("the server sends more than the {length} bytes that it announced"))),
    }
}

/// Classifies the failure of a request that got no answer.
fn failure(error: ureq::Error) -> Failure {
    match error {
        ureq::Error::Timeout(_) => {
            Failure::Temporary(io::Error::new(io::ErrorKind::TimedOut, "the server does not answer in time"), None)
        }
        ureq::Error::HostNotFound => Failure::last("there is no host of this name, or no network"),
        ureq::Error::RequireHttpsOnly(_) => {
            Failure::last("the server sends to an address that is not encrypted, which is not followed")
        }
        ureq::Error::Rustls(_) | ureq::Error::Tls(_) => Failure::last(format!("no encrypted connection: {error}")),
        // Bad certificates and answers that are no HTTP.
        ureq::Error::Io(error) if error.kind() == io::ErrorKind::InvalidData => {
            Failure::last(format!("no encrypted connection: {error}"))
        }
        ureq::Error::Io(error) => Failure::Temporary(error, None),
        ureq::Error::ConnectionFailed => Failure::Temporary(io::Error::other("no connection to the server"), None),
        _ => Failure::last("the server's answer is not understood"), // its text may hold a signed address
    }
}
