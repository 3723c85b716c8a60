//! Requests that no page of the viewer sends, and clients that are slow or gone.

use super::converted;
use super::running_viewer::Served;
use serde_json::{Value, json};
use std::io::{Read, Write};
use std::time::{Duration, Instant};
use wait_timeout::ChildExt;

fn request() -> Value {
    json!({ "look": { "view": ["30,30"], "scale": 5.0, "center": "12,10,8", "size": "80x60", "frames": "0:2", "range": null } })
}

fn bytes(request: &Value) -> Vec<u8> {
    request.to_string().into_bytes()
}

/// The request with other fields of its look.
fn with(changes: &Value) -> Vec<u8> {
    let mut request = request();
    request["look"].as_object_mut().unwrap().extend(changes.as_object().unwrap().clone());
    bytes(&request)
}

#[test]
fn only_the_page_at_the_secret_address_gets_answers() {
    let work = converted("");
    let served = Served::start(&work, "a.wspl");
    let (host, path) = (served.host().to_string(), served.path(""));
    assert!(host.starts_with("127.0.0.1:"), "{host}");
    assert_eq!(served.get("").status, 200);
    for wrong in
        ["/", "/pictures", "/0123456789abcdef0123456789abcdef/", "/..%2f..%2fetc/passwd", &format!("{path}../a.wspl")]
    {
        assert_eq!(served.ask(&format!("GET {wrong}"), &[("Host", &host)], b"").status, 404, "{wrong}");
    }
    let port = host.rsplit(':').next().unwrap();
    let foreign = format!("rebound.example:{port}");
    for head in [
        vec![("Host", foreign.as_str())],
        vec![("Host", host.as_str()), ("Origin", "http://other.example")],
        vec![("Host", host.as_str()), ("Origin", "null")],
        vec![],
    ] {
        let answer = served.ask(&format!("GET {path}"), &head, b"");
        assert!(matches!(answer.status, 400 | 403), "{head:?}: {}", answer.head);
        assert!(!answer.text().contains("a.wspl"));
    }
    let answer = served.get("");
    for word in ["content-security-policy", "nosniff", "no-referrer", "no-store", "same-origin"] {
        assert!(answer.head.to_lowercase().contains(word), "{word}: {}", answer.head);
    }
    assert!(!answer.head.to_lowercase().contains("access-control"));
    let text = answer.text();
    let policy = text.split("Content-Security-Policy\" content=\"").nth(1).unwrap().split('"').next().unwrap();
    assert!(policy.starts_with("default-src 'none'; connect-src 'self'; script-src 'nonce-"), "{policy}");
    assert!(served.get("").text() != text, "every page has a word of its own for its scripts");
}

#[test]
fn wrong_requests_get_their_reason_and_no_picture() {
    let work = converted("");
    let served = Served::start(&work, "a.wspl");
    let good = served.post("pictures", &bytes(&request()));
    assert_eq!(good.status, 200, "{}", good.text());
    for (body, word) in [
        (b"".to_vec(), "EOF"),
        (b"{".to_vec(), "EOF"),
        (b"\xff\xfe\0".to_vec(), "not a request"),
        ([b"[".repeat(30000), b"]".repeat(30000)].concat(), "not a request"),
        (br#"{"look": {}, "output": "/tmp/stolen"}"#.to_vec(), "unknown field `output`"),
        (with(&json!({ "output": "/tmp/stolen" })), "unknown field `output`"),
        (with(&json!({ "key_frames": "/etc/passwd" })), "unknown field `key_frames`"),
        (with(&json!({ "colormap": "/etc/passwd" })), "colormap"),
        (with(&json!({ "transfer_function": ["/etc/passwd"] })), "transfer_function"),
        (with(&json!({ "mode": "--output=x" })), "not one of"),
        (with(&json!({ "size": "1000000x1000000" })), "size"),
        (with(&json!({ "size": "0x10" })), "size"),
        (with(&json!({ "frames": "5:5" })), "frame"),
        (with(&json!({ "frames": "100:101" })), "frame"),
        (with(&json!({ "frames": "0:,".repeat(9000) })), "at most"),
        (with(&json!({ "view": vec!["0,0"; 3] })), "at most"),
        (with(&json!({ "slice": [format!("x={}x{0}", "0".repeat(30_000))] })), "at most"),
        (with(&json!({ "size": "4096x4096", "frames": "0:4000000000" })), "memory"),
        (with(&json!({ "lod": 4_000_000_000_u32 })), "lod"),
        (with(&json!({ "view": ["1e308,-1e308"], "scale": -1 })), "scale"),
        (with(&json!({ "scale": 1e300 })), "scale"),
        (with(&json!({ "iso": "1,".repeat(100) })), "at most"),
        (with(&json!({ "range": "3,1" })), "range"),
        (with(&json!({ "mode": "composite", "opacity": "2:7" })), "opacity"),
        (with(&json!({ "mode": "slice", "slice": ["x=7e300%"] })), "slice"),
    ] {
        let answer = served.post("pictures", &body);
        let text = answer.text();
        let start = String::from_utf8_lossy(&body[..body.len().min(90)]).into_owned();
        assert!(answer.status == 400 && text.contains(word), "{start}: {} {text}", answer.status);
        assert!(answer.head.contains("text/plain") && text.len() < 1000, "{text}");
    }
    assert_eq!(served.post("pictures", &vec![b' '; 1 << 20]).status, 400);
    let mut elsewhere = request();
    elsewhere["file"] = json!("../a.png");
    for question in ["save", "command", "pages", "%2e%2e"] {
        assert_eq!(served.post(question, &bytes(&elsewhere)).status, 400, "{question}");
    }
    assert_eq!(served.post("series", b"[1,2]").status, 400);
    assert_eq!(served.post("pictures", &bytes(&request())).body, good.body, "and goes on as before");
}

#[test]
fn slow_and_vanishing_clients_block_no_other_client() {
    let work = converted("");
    let served = Served::start(&work, "a.wspl");
    let (host, path) = (served.host().to_string(), served.path("pictures"));
    let slow: Vec<_> = (0..100)
        .map(|n| {
            let mut stream = served.connect();
            let head = format!("POST {path} HTTP/1.1\r\nHost: {host}\r\nContent-Length: 1000\r\n");
            let part = if n % 2 == 0 { head } else { format!("{head}\r\n{{") };
            stream.write_all(part.as_bytes()).unwrap();
            stream
        })
        .collect();
    let started = Instant::now();
    for n in 0..20 {
        let mut stream = served.connect();
        let body = with(&json!({ "size": "1500x1500", "frames": "0:12", "mode": "composite" }));
        let head = format!("POST {path} HTTP/1.1\r\nHost: {host}\r\nContent-Length: {}\r\n\r\n", body.len());
        stream.write_all(&[head.as_bytes(), &body].concat()).unwrap();
        std::thread::sleep(Duration::from_millis(5 * n));
    }
    assert_eq!(served.get("").status, 200);
    assert!(started.elapsed() < Duration::from_secs(5), "work for clients that are gone goes on");
    let status = loop {
        let status = served.post("pictures", &bytes(&request())).status;
        if status != 503 || started.elapsed() > Duration::from_secs(30) {
            break status;
        }
        std::thread::sleep(Duration::from_millis(100));
    };
    assert_eq!(status, 200);
    let mut rest = Vec::new();
    let mut slow = slow;
    slow[0].read_to_end(&mut rest).unwrap();
    assert!(started.elapsed() < Duration::from_secs(40), "slow clients are let go");
}

#[test]
fn the_server_starts_and_ends_as_asked() {
    let work = converted("");
    for (args, words) in [
        ("view none.wspl --no-open", vec!["none.wspl"]),
        ("view a.wspl --no-open --port 99999", vec!["--port"]),
        ("view a.wspl --no-open -- --mode iso -o x.png", vec!["--output"]),
    ] {
        let run = work.wavesplat(args);
        assert!(!run.message().is_empty() && words.iter().all(|word| run.message().contains(word)), "{args}: {run:?}");
    }
    let mut served = Served::start(&work, "a.wspl");
    let port = served.host().rsplit(':').next().unwrap().to_string();
    work.wavesplat(&format!("view a.wspl --no-open --port {port}")).fails(1, &["listening", &port]);
    let _open = served.connect();
    let id = served.child.id();
    work.shell(&format!("kill -TERM {id}")).ok(); // background jobs ignore the signal of Ctrl-C
    assert!(served.child.wait_timeout(Duration::from_secs(5)).unwrap().is_some(), "a signal ends it");
}
