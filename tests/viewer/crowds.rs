//! Many clients at once: those without the token keep nobody out, and those that do not read take little memory.

use super::running_viewer::Served;
use super::{converted, converted_from};
use crate::cli::Archive;
use serde_json::json;
use std::fs;
use std::io::{Read, Write};
use std::net::TcpStream;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::time::{Duration, Instant};
use wait_timeout::ChildExt;

/// The longest time that a holder of the token waits for an answer that costs nothing.
const SOON: Duration = Duration::from_secs(3);

/// Asserts that holders of the token get answers, over several connections.
fn assert_open(served: &Served, when: &str) {
    for name in ["progress", "", "progress"] {
        let asked = Instant::now();
        assert_eq!(served.get(name).status, 200, "{when}");
        assert!(asked.elapsed() < SOON, "{when}: {:?}", asked.elapsed());
    }
}

fn connections(served: &Served, count: usize, sent: &str) -> Vec<TcpStream> {
    let connection = |_| {
        let mut stream = served.connect();
        let _ = stream.write_all(sent.as_bytes()); // an older one may be closed already
        stream
    };
    (0..count).map(connection).collect()
}

/// Whether a connection ends, within a time.
fn ends(stream: &mut TcpStream, within: Duration) -> bool {
    stream.set_read_timeout(Some(within)).unwrap();
    let mut bytes = Vec::new();
    match stream.read_to_end(&mut bytes) {
        Ok(_) => true,
        Err(e) => e.kind() == std::io::ErrorKind::ConnectionReset,
    }
}

#[test]
fn clients_without_the_token_keep_nobody_out() {
    let work = converted("");
    let served = Served::start(&work, "a.wspl");
    let host = served.host();
    let wrong = format!("GET /x HTTP/1.1\r\nHost: {host}\r\n\r\n");
    let slow = format!("POST /x/pictures HTTP/1.1\r\nHost: {host}\r\nContent-Length: 1000\r\n\r\n");
    let near =
        format!("POST {}x HTTP/1.1\r\nHost: other.example\r\nContent-Length: 9\r\n\r\n", served.path("pictures"));
    for (what, count, sent) in [
        ("silent", 400, ""),
        ("slow heads", 400, "GET / HT"),
        ("wrong requests", 300, wrong.as_str()),
        ("slow bodies", 300, slow.as_str()),
        ("another host", 300, near.as_str()),
        ("many wrong requests", 300, &wrong.repeat(50)),
    ] {
        let open = connections(&served, count, sent);
        assert_open(&served, what);
        std::thread::sleep(Duration::from_millis(300));
        assert_open(&served, what);
        drop(open);
    }
}

#[test]
fn requests_that_come_again_and_again_keep_nobody_out() {
    let work = converted("");
    let served = Served::start(&work, "a.wspl");
    let wrong = format!("GET /x HTTP/1.1\r\nHost: {}\r\n\r\n", served.host());
    let (mut open, done) = (connections(&served, 300, &wrong), AtomicBool::new(false));
    std::thread::scope(|scope| {
        scope.spawn(|| {
            while !done.load(Relaxed) {
                for stream in &mut open {
                    if stream.write_all(wrong.as_bytes()).is_err() {
                        *stream = served.connect();
                    }
                }
            }
        });
        for _ in 0..5 {
            std::thread::sleep(Duration::from_millis(200));
            assert_open(&served, "they come back");
        }
        done.store(true, Relaxed);
    });
}

#[test]
fn refused_connections_close() {
    let work = converted("");
    let served = Served::start(&work, "a.wspl");
    let (host, path) = (served.host(), served.path("progress"));
    for sent in [
        format!("GET /x HTTP/1.1\r\nHost: {host}\r\n\r\n"),
        format!("GET {path} HTTP/1.1\r\nHost: other.example\r\n\r\n"),
        format!("GET {path} HTTP/1.1\r\nHost: {host}\r\nOrigin: http://other.example\r\n\r\n"),
        format!("POST /x HTTP/1.1\r\nHost: {host}\r\nContent-Length: 10\r\n\r\n"),
    ] {
        let mut stream = served.connect();
        stream.write_all(sent.as_bytes()).unwrap();
        assert!(ends(&mut stream, SOON), "{sent}");
    }
    let mut stream = served.connect();
    for _ in 0..3 {
        stream.write_all(format!("GET {path} HTTP/1.1\r\nHost: {host}\r\n\r\n").as_bytes()).unwrap();
        assert!(stream.read(&mut [0; 4096]).unwrap() > 0, "a holder goes on");
    }
    stream.write_all(format!("GET /x HTTP/1.1\r\nHost: {host}\r\n\r\n").as_bytes()).unwrap();
    assert!(ends(&mut stream, SOON), "a holder without the token");
}

/// A request for pictures of all frames.
fn pictures(side: usize) -> Vec<u8> {
    json!({ "look": {
        "view": ["30,30"], "scale": 5.0, "center": "12,10,8", "size": format!("{side}x{side}"), "frames": "0:12", "range": "0,1"
    } })
    .to_string()
    .into_bytes()
}

/// Most memory that a process has taken, in MiB.
fn peak(served: &Served) -> usize {
    let status = fs::read_to_string(format!("/proc/{}/status", served.child.id())).unwrap();
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:")).unwrap();
    line.trim().trim_end_matches(" kB").parse::<usize>().unwrap() >> 10
}

#[test]
#[cfg(target_os = "linux")]
fn answers_that_nobody_reads_stay_within_the_memory_and_are_dropped() {
    let work = converted_from(&Archive::smooth([24, 20, 16], 12), "");
    let served = Served::start(&work, "a.wspl --memory 384MiB --threads 2");
    let body = pictures(600);
    let one = served.post("pictures", &body);
    assert!(one.status == 200 && one.body.len() > 12 << 20, "{} {}", one.status, one.body.len());
    // The allocator keeps more of the memory after some answers than after one.
    (0..3).for_each(|_| assert!(served.post("pictures", &body).body == one.body));
    let most = peak(&served) + 384 / 8 + 2 * 17; // the room for answers, and one in the making beside its picture
    let unread: Vec<TcpStream> = (0..16)
        .map(|_| {
            let mut stream = served.connect();
            let path = served.path("pictures");
            let length = body.len();
            let head = format!("POST {path} HTTP/1.1\r\nHost: {}\r\nContent-Length: {length}\r\n\r\n", served.host());
            stream.write_all(&[head.as_bytes(), &body].concat()).unwrap();
            stream
        })
        .collect();
    let begin = Instant::now();
    while begin.elapsed() < Duration::from_secs(8) {
        std::thread::sleep(Duration::from_millis(200));
        assert!(peak(&served) <= most, "{} MiB, at most {most}", peak(&served));
        assert_open(&served, "others are answered");
    }
    drop(unread.into_iter().skip(1).collect::<Vec<_>>());
    let again = served.post("pictures", &body); // after the first was let go, since it does not read
    assert!(again.body == one.body && begin.elapsed() < Duration::from_secs(40), "{:?}", begin.elapsed());
}

#[test]
#[cfg(target_os = "linux")]
fn a_signal_while_a_file_is_saved_leaves_nothing() {
    if std::process::Command::new("ffmpeg").arg("-version").output().is_err() {
        return; // its own tests say that it is not installed
    }
    let work = converted_from(&Archive::smooth([24, 20, 16], 120), "");
    for (file, signal, code) in
        [("movie.mp4", "INT", 130), ("movie.mp4", "TERM", 143), ("page.html", "INT", 130), ("picture.png", "TERM", 143)]
    {
        fs::create_dir_all(work.path("tmp")).unwrap();
        let mut served = Served::start_interruptible(&work, "a.wspl --threads 1");
        let body = String::from_utf8(pictures(900)).unwrap().replace("0:12", "0:120");
        let body = body.replacen('{', &format!(r#"{{"file":"{file}","#), 1);
        let (path, mut stream) = (served.path("save"), served.connect());
        let head = format!("POST {path} HTTP/1.1\r\nHost: {}\r\nContent-Length: {}\r\n\r\n", served.host(), body.len());
        stream.write_all(format!("{head}{body}").as_bytes()).unwrap();
        let begin = Instant::now();
        let is_there = || fs::read_dir(work.path("tmp")).unwrap().next().is_some();
        while !is_there() && begin.elapsed() < Duration::from_secs(if file == "movie.mp4" { 20 } else { 1 }) {
            std::thread::sleep(Duration::from_millis(1));
        }
        assert_eq!(is_there(), file == "movie.mp4", "ffmpeg alone needs a file");
        std::thread::sleep(Duration::from_millis(200));
        work.shell(&format!("kill -{signal} {}", served.child.id())).ok();
        let ended = served.child.wait_timeout(Duration::from_secs(10)).unwrap().unwrap();
        assert_eq!(ended.code(), Some(code), "{file}");
        std::thread::sleep(Duration::from_millis(500)); // ffmpeg ends, too
        assert!(!is_there(), "{file} {signal}: {:?}", fs::read_dir(work.path("tmp")).unwrap().next());
    }
}
