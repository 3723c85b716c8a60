//! Files on servers: the same results, few requests, and clear messages whatever the server does.

use super::{Archive, Run, Work};
use crate::common::http::{Fate, Server};
use std::collections::BTreeSet;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::sync::{Arc, OnceLock};
use std::thread;
use std::time::Instant;

/// A file of several windows, whose ends hold a small part of it.
fn bytes() -> &'static Vec<u8> {
    static BYTES: OnceLock<Vec<u8>> = OnceLock::new();
    BYTES.get_or_init(|| {
        let work = Work::new();
        let noise = |n: usize| ((n as u32).wrapping_mul(2_654_435_761) >> 16) as f32 / 65536.0;
        let archive = Archive::of([48, 32, 32], 80, |x, y, z, t| {
            (0.2 * x as f32 + 0.1 * t as f32).sin() + 0.1 * noise(x + 64 * (y + 64 * (z + 64 * t)))
        });
        work.write("a.npy", archive.npy());
        work.wavesplat("convert a.npy -o a.wspl --tolerance 1e-3 --window 16 --block 16").ok();
        let bytes = work.read("a.wspl");
        assert!(bytes.len() > 1 << 20, "{} bytes", bytes.len());
        bytes
    })
}

/// A folder with the file.
fn work() -> Work {
    let work = Work::new();
    work.write("run.wspl", bytes());
    work
}

impl Work {
    /// Runs a program with the address of a server's file, without any proxy.
    fn remote(&self, server: &Server, line: &str) -> Run {
        let address = server.address();
        self.shell(&format!("export NO_PROXY=127.0.0.1; {}", line.replace("URL", &address)))
    }
}

#[test]
fn results_are_those_of_a_local_file() {
    let (work, server) = (work(), Server::of(bytes().clone()));
    let text = |run: Run| run.ok().text().replace(&server.address(), "run.wspl");
    for line in ["$WAVESPLAT info URL", "$WAVESPLAT info URL --json", "$WAVESPLAT verify URL"] {
        assert_eq!(text(work.remote(&server, line)), text(work.shell(&line.replace("URL", "run.wspl"))), "{line}");
    }
    for (line, output) in [
        ("$WAVESPLAT extract URL -o OUT", "all.npy"),
        ("$WAVESPLAT extract URL --region 3:9,:,5:6 --frames 7:40 -o OUT", "some.raw"),
        ("$WAVESPLAT extract URL --lod 1 -o OUT", "coarse.npy"),
        ("$RENDER URL --size 64x48 -o OUT", "picture.npy"),
        ("$RENDER URL --size 64x48 --mode composite --frames 20 -o OUT", "composite.npy"),
        ("$RENDER URL --probe 3,4,5 -o OUT", "series.csv"),
    ] {
        work.remote(&server, &line.replace("OUT", &format!("far_{output}"))).ok();
        work.shell(&line.replace("URL", "run.wspl").replace("OUT", output)).ok();
        assert!(work.read(output) == work.read(&format!("far_{output}")), "{line}");
    }
}

#[test]
fn few_requests_bring_little_more_than_is_needed() {
    let (work, server) = (work(), Server::of(bytes().clone()));
    work.remote(&server, "$WAVESPLAT info URL").ok();
    let (requests, sent) = server.traffic();
    assert!(requests <= 2 && sent <= 192 << 10, "opening: {requests} requests, {sent} bytes");

    work.remote(&server, "$WAVESPLAT extract URL --region 20:21,9:10,7:8 --frames 20 -o voxel.npy").ok();
    let (requests, sent) = server.traffic();
    // those of opening, what is coarse in the window, its directory, and the block
    assert!(requests <= 5 && sent <= 320 << 10, "one voxel: {requests} requests, {sent} bytes");

    work.remote(&server, "$WAVESPLAT extract URL --region 20:21,9:10,7:8 -o series.npy").ok();
    let (requests, sent) = server.traffic();
    // what is coarse in a window comes with the directory of the window before
    assert!(requests <= 11 && sent <= 640 << 10, "a series: {requests} requests, {sent} bytes");

    work.remote(&server, "$RENDER URL --size 64x48 --range 0,1 -o f_%02d.png").ok();
    let (requests, sent) = server.traffic();
    // pages of directories that lie between blocks come twice, in fewer requests
    assert!(requests <= 8 && sent <= bytes().len() + (256 << 10), "a view: {requests} requests, {sent} bytes");
}

#[test]
fn a_cache_saves_requests_and_is_not_taken_for_another_file() {
    let (work, server) = (work(), Server::of(bytes().clone()));
    let line = "$WAVESPLAT extract URL --cache kept -o OUT.npy --force";
    work.remote(&server, &line.replace("OUT", "first")).ok();
    assert!(server.traffic().0 > 2);
    work.remote(&server, &line.replace("OUT", "again")).ok();
    assert_eq!(server.traffic().0, 1, "one request finds out whether the file is the same");
    assert!(work.read("first.npy") == work.read("again.npy"));

    let mut other = bytes().clone();
    let middle = other.len() / 2;
    other[middle] ^= 1;
    let changed = Server::with(other.clone(), move |_| Fate::Replaced(other.clone(), "\"two\"".into()));
    work.remote(&changed, &line.replace("OUT", "bad")).fails(3, &["damaged at byte"]);

    work.shell("for page in kept/*/*.page; do printf x | dd of=$page bs=1 seek=100 conv=notrunc 2>/dev/null; done")
        .ok();
    work.remote(&server, &line.replace("OUT", "mended")).ok();
    assert!(work.read("first.npy") == work.read("mended.npy"), "damaged pages are read again");

    work.remote(&server, "$WAVESPLAT extract URL --cache kept --cache-size 1MiB -o small.npy").ok();
    work.shell("test $(du -sk kept | cut -f1) -le 1200").ok();
    work.remote(&server, "$WAVESPLAT info URL --cache run.wspl/x").fails(1, &["run.wspl/x"]);
}

#[test]
fn several_programs_share_a_cache() {
    let (work, server) = (work(), Server::of(bytes().clone()));
    let each = "$WAVESPLAT extract URL --cache kept --cache-size 1MiB -o $n.npy || echo failed $n";
    let found = work.remote(&server, &format!("for n in 1 2 3 4; do ({each}) & done; wait"));
    assert_eq!(found.ok().text(), "");
    let all: BTreeSet<Vec<u8>> = (1..=4).map(|n| work.read(&format!("{n}.npy"))).collect();
    assert_eq!(all.len(), 1);
}

#[test]
fn passing_faults_are_retried() {
    let work = work();
    work.wavesplat("extract run.wspl -o right.npy").ok();
    let busy = || Fate::Refuse(503, "Retry-After: 0\r\n".into(), String::new());
    let rules: [fn(usize) -> Fate; 5] = [
        |n| if n % 3 == 1 { Fate::Refuse(429, "Retry-After: 0\r\n".into(), String::new()) } else { Fate::Answer },
        |n| if n % 4 == 2 { Fate::Cut(1000) } else { Fate::Answer },
        |n| if n == 0 || n == 3 { Fate::Cut(0) } else { Fate::Answer },
        |n| if n % 5 == 4 { Fate::Silent } else { Fate::Answer },
        |_| Fate::Nameless,
    ];
    for (number, rule) in rules.into_iter().enumerate() {
        let server = Server::with(bytes().clone(), move |asked| rule(asked.number));
        let line = format!("$WAVESPLAT extract URL -o {number}.npy --timeout 0.5");
        work.remote(&server, &line).ok();
        assert!(work.read("right.npy") == work.read(&format!("{number}.npy")), "rule {number}");
    }
    let server = Server::with(bytes().clone(), move |asked| if asked.number < 4 { busy() } else { Fate::Answer });
    work.remote(&server, "$WAVESPLAT info URL").ok();
}

#[test]
fn lasting_faults_are_explained() {
    let work = work();
    let refuse = |status, body: &str| Fate::Refuse(status, "Retry-After: 0\r\n".into(), body.into());
    let s3 = "<?xml version=\"1.0\"?><Error><Code>NoSuchKey</Code><Message>The key\nis not there.</Message></Error>";
    let fates = [
        (Fate::Whole, vec!["cannot send parts of a file"]),
        (refuse(404, s3), vec!["no such file (404)", "The keyis not there."]),
        (refuse(403, ""), vec!["does not allow reading it (403)"]),
        (refuse(401, ""), vec!["a name and a password (401)"]),
        (refuse(416, ""), vec!["empty (416)"]),
        (refuse(503, ""), vec!["cannot answer now (503)", "asked 5 times"]),
        (refuse(302, ""), vec!["elsewhere, but not where"]),
        (Fate::Refuse(302, "Location: /run.wspl\r\n".into(), String::new()), vec!["again and again"]),
        (Fate::Cut(100), vec!["asked 5 times"]),
        (Fate::Shifted, vec!["sends bytes 1.."]),
        (Fate::Silent, vec!["does not answer in time", "asked 5 times"]),
        (Fate::Drip, vec!["does not answer in time"]),
        (Fate::Nonsense, vec!["not understood"]),
        (Fate::Endless, vec!["sends more than"]),
    ];
    let is_explained = |fate: Fate, words: Vec<&str>| {
        let (shown, begin) = (format!("{fate:?}"), Instant::now());
        let server = Server::with(bytes().clone(), move |_| fate.clone());
        let run = work.remote(&server, "$WAVESPLAT info URL --timeout 0.1");
        assert!(begin.elapsed().as_secs() < 30, "{shown}");
        run.fails(1, &[&words[..], &["/run.wspl: opening: "]].concat());
    };
    // Side by side: most of them wait.
    thread::scope(|scope| {
        for (fate, words) in fates {
            scope.spawn(|| is_explained(fate, words));
        }
    });
    let closed = "http://127.0.0.1:9/run.wspl";
    work.shell(&format!("NO_PROXY=127.0.0.1 $WAVESPLAT info {closed}")).fails(1, &[closed, "asked 5 times"]);
}

#[test]
fn a_file_that_changes_is_noticed() {
    let work = work();
    for (others, etag) in [
        (bytes().clone(), "\"two\""),
        ([bytes().as_slice(), &[0; 64]].concat(), "\"one\""),
        (bytes()[..bytes().len() - 64].to_vec(), "\"one\""),
    ] {
        let later = Fate::Replaced(others, etag.into());
        let server =
            Server::with(bytes().clone(), move |asked| if asked.number < 3 { Fate::Answer } else { later.clone() });
        work.remote(&server, "$WAVESPLAT extract URL -o a.npy").fails(4, &["changed while it was being read"]);
    }
    let gone = |number| if number < 3 { Fate::Answer } else { Fate::Refuse(412, String::new(), String::new()) };
    let server = Server::with(bytes().clone(), move |asked| gone(asked.number));
    work.remote(&server, "$RENDER URL --size 64x48 -o a_%02d.png").fails(4, &["another version"]);
    assert!(server.asked().iter().skip(1).all(|asked| asked.if_match.as_deref() == Some("\"one\"")));
    assert_eq!(work.names(), ["run.wspl"]);
}

#[test]
fn wrong_bits_are_noticed() {
    let work = work();
    for seed in 0..40_usize {
        let bit = seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) >> 20;
        let mut wrong = bytes().clone();
        let at = bit / 8 % wrong.len();
        wrong[at] ^= 1 << (bit % 8);
        let server = Server::with(bytes().clone(), move |_| Fate::Replaced(wrong.clone(), "\"one\"".into()));
        work.remote(&server, "$WAVESPLAT verify URL").fails_or_finds(3, &["/run.wspl: "]);
    }
}

#[test]
fn bits_that_are_wrong_once_are_read_again() {
    let work = work();
    let info = work.wavesplat("info run.wspl").ok().text().to_string();
    work.wavesplat("extract run.wspl -o right.npy").ok();
    work.render("run.wspl --size 64x48 --frames 20 -o right.png").ok();
    for seed in 0..7_usize {
        let bit = seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) >> 20;
        let serve = || {
            let fate = move |number| if number == seed { Fate::Flipped(bit) } else { Fate::Answer };
            Server::with(bytes().clone(), move |asked| fate(asked.number))
        };
        let server = serve();
        let found = work.remote(&server, "$WAVESPLAT info URL").ok();
        assert_eq!(found.text().replace(&server.address(), "run.wspl"), info, "{seed}");
        for (line, output) in [
            ("$WAVESPLAT extract URL -o out.npy --force", "npy"),
            ("$WAVESPLAT extract URL --cache kept -o out.npy --force", "npy"),
            ("$RENDER URL --size 64x48 --frames 20 -o out.png --force", "png"),
        ] {
            work.remote(&serve(), line).ok();
            assert!(work.read(&format!("out.{output}")) == work.read(&format!("right.{output}")), "{seed}: {line}");
        }
        work.shell("rm -rf kept").ok();
    }
}

#[test]
fn what_a_wrong_answer_left_in_a_cache_is_mended() {
    let work = work();
    work.wavesplat("extract run.wspl -o right.npy").ok();
    for (from, to) in [(200_000, 300_000), (bytes().len() - 30_000, bytes().len()), (90_000, bytes().len())] {
        let wrong = move || {
            let mut wrong = bytes().clone();
            wrong[from..to].iter_mut().for_each(|byte| *byte ^= 0x55);
            wrong
        };
        let is_sound = Arc::new(AtomicBool::new(false));
        let sound = is_sound.clone();
        let server = Server::with(bytes().clone(), move |asked| match asked.range.start == 0 || sound.load(Relaxed) {
            true => Fate::Answer,
            false => Fate::Replaced(wrong(), "\"one\"".into()),
        });
        let line = "$WAVESPLAT extract URL --cache kept -o out.npy --force";
        let failed = work.remote(&server, line).fails(3, &["damaged at byte", "asked twice"]);
        assert!(!failed.message().contains("--skip-damaged reads the rest"), "{}", failed.message());
        work.shell("ls kept/*/*.page").ok();
        is_sound.store(true, Relaxed);
        work.remote(&server, line).ok();
        assert!(work.read("out.npy") == work.read("right.npy"), "{from}..{to}");
        work.shell("rm -rf kept").ok();
    }
}

#[test]
fn a_cache_deletes_and_follows_nothing_of_others() {
    let (work, server) = (work(), Server::of(bytes().clone()));
    let line = "$WAVESPLAT extract URL --cache kept --cache-size 500kB -o out.npy --force";
    for name in ["mine/0000000000.page", "kept/wavesplat-notes/0000000001.page", "kept/0000000002.page"] {
        work.write(name, vec![1; 900_000]);
        work.shell(&format!("touch -d 1980-01-01 {name}")).ok();
    }
    work.shell("ln -s $PWD/mine kept/wavesplat-0123456789abcdef0123456789abcdef").ok();
    work.remote(&server, line).ok();
    for name in ["mine/0000000000.page", "kept/wavesplat-notes/0000000001.page", "kept/0000000002.page"] {
        assert_eq!(work.read(name).len(), 900_000, "{name}");
    }
    work.shell("rm kept/wavesplat-0123*; f=$(ls -d kept/wavesplat-????????????????????????????????); rm -r $f; ln -s $PWD/mine $f").ok();
    work.remote(&server, line).ok();
    assert_eq!(work.shell("ls mine").ok().text(), "0000000000.page\n", "nothing is written through a link");
}

#[test]
fn pauses_that_a_server_asks_for_are_noted_and_limited() {
    let work = work();
    let busy = |wait: &str| Fate::Refuse(503, format!("Retry-After: {wait}\r\n"), String::new());
    for (wait, shown) in [("3600", "asks for 3600 s"), ("Fri, 31 Dec 9999 23:59:59 GMT", "asks for 2")] {
        let (begin, wait) = (Instant::now(), wait.to_string());
        let rule = move |number| if number < 2 { busy(&wait) } else { Fate::Answer };
        let server = Server::with(bytes().clone(), move |asked| rule(asked.number));
        let run = work.remote(&server, "$WAVESPLAT info URL --timeout 1").ok();
        assert!(run.message().contains(shown) && run.message().contains("/run.wspl: "), "{}", run.message());
        assert!(run.message().contains("asking again in 1.0 s") && begin.elapsed().as_secs() < 20);
    }
    let server = Server::with(bytes().clone(), move |asked| if asked.number < 1 { busy("60") } else { Fate::Answer });
    assert_eq!(work.remote(&server, "$WAVESPLAT info URL --timeout 0.5 -q").ok().message(), "");
    let server = Server::with(bytes().clone(), move |_| busy("90"));
    work.remote(&server, "$RENDER URL -o a.png --timeout 0.1")
        .fails(1, &["asks for 90 s, more than the 0.1 s of --timeout"]);
}

#[test]
fn a_password_goes_to_no_other_server() {
    let work = work();
    let other = Server::of(bytes().clone());
    let ask = |server: &Server| {
        let address = format!("http://me:hidden@127.0.0.1:{}/old/run.wspl?sig=hidden", server.port());
        work.shell(&format!("NO_PROXY=127.0.0.1,localhost $WAVESPLAT info '{address}'")).ok()
    };
    for place in ["http://127.0.0.1:PORT/run.wspl", "http://localhost:PORT/x", "//other:word@127.0.0.1:PORT/run.wspl"] {
        let to = format!("Location: {}\r\n", place.replace("PORT", &other.port().to_string()));
        let server = Server::with(bytes().clone(), move |_| Fate::Refuse(307, to.clone(), String::new()));
        ask(&server);
        assert!(server.asked().iter().all(|asked| asked.authorization.is_some()));
        let asked = other.asked();
        assert!(!asked.is_empty() && asked.iter().all(|asked| asked.authorization.is_none()), "{place}: {asked:?}");
        assert!(asked.iter().all(|asked| !asked.path.contains("hidden")), "{place}: {asked:?}");
    }
    for place in ["/new/run.wspl", "../new/run.wspl"] {
        let moved = move |path: &str| match path.starts_with("/old") {
            true => Fate::Refuse(302, format!("Location: {place}\r\n"), "moved".into()),
            false => Fate::Answer,
        };
        let server = Server::with(bytes().clone(), move |asked| moved(&asked.path));
        ask(&server);
        let asked = server.asked();
        assert!(asked.iter().all(|asked| asked.authorization.is_some()), "{asked:?}");
        assert!(asked.iter().any(|asked| asked.path == "/new/run.wspl"), "{asked:?}");
    }
    for place in ["file:///etc/passwd", "ftp://127.0.0.1/run.wspl"] {
        let to = format!("Location: {place}\r\n");
        let server = Server::with(bytes().clone(), move |_| Fate::Refuse(302, to.clone(), String::new()));
        work.remote(&server, "$WAVESPLAT info URL").fails(1, &["not of HTTP"]);
    }
}

#[test]
fn passwords_and_signatures_are_not_shown() {
    let (work, server) = (work(), Server::of(bytes().clone()));
    let address = format!("http://me:hidden@127.0.0.1:{}/a/run.wspl?sig=hidden", server.port());
    let shown = work.shell(&format!("NO_PROXY=127.0.0.1 $WAVESPLAT info '{address}' --json")).ok();
    assert!(!shown.text().contains("hidden"));
    let asked = server.asked();
    assert_eq!(asked[0].authorization.as_deref(), Some("Basic bWU6aGlkZGVu"));
    assert_eq!(asked[0].path, "/a/run.wspl?sig=hidden");
    let both = format!("NO_PROXY=127.0.0.1 $WAVESPLAT info '{address}' '{address}'");
    let shown = work.shell(&format!("{both} --json")).ok();
    assert_eq!(shown.json()["files"].as_array().unwrap().len(), 2);
    assert!(!shown.text().contains("hidden"));
    let message = work.shell(&format!("{both} --frames 1:2")).fails(2, &["--frames is for frames"]);
    assert!(!message.message().contains("hidden"), "{}", message.message());
    let refused = Server::with(bytes().clone(), |_| Fate::Refuse(403, String::new(), String::new()));
    let address = address.replace(&server.port().to_string(), &refused.port().to_string());
    let message = work.shell(&format!("NO_PROXY=127.0.0.1 $WAVESPLAT info '{address}'")).fails(1, &["403"]);
    assert!(!message.message().contains("hidden"), "{}", message.message());
}

#[test]
fn requests_to_s3_are_signed() {
    let (work, server) = (work(), Server::of(bytes().clone()));
    let endpoint = format!("export NO_PROXY=127.0.0.1 HOME=/ AWS_ENDPOINT_URL=http://127.0.0.1:{};", server.port());
    let keys = "AWS_ACCESS_KEY_ID=KEY AWS_SECRET_ACCESS_KEY=secret AWS_REGION=eu-west-3";
    work.shell(&format!("{endpoint} {keys} $WAVESPLAT verify 's3://lab/my runs/run.wspl'")).ok();
    let asked = server.asked();
    for part in ["/lab/my%20runs/run.wspl?", "X-Amz-Credential=KEY", "eu-west-3", "X-Amz-Signature="] {
        assert!(asked.iter().all(|asked| asked.path.contains(part)), "{part}: {:?}", asked[0].path);
    }
    work.shell(&format!("{endpoint} $WAVESPLAT info s3://lab/run.wspl")).ok();
    assert!(server.asked().iter().all(|asked| asked.path == "/lab/run.wspl"), "without credentials, it must be public");

    let refused = Server::with(bytes().clone(), |_| Fate::Refuse(403, String::new(), String::new()));
    let endpoint = endpoint.replace(&server.port().to_string(), &refused.port().to_string());
    let public = format!("{endpoint} $WAVESPLAT info s3://lab/run.wspl");
    work.shell(&public).fails(1, &["s3://lab/run.wspl", "no credentials were found"]);
    for (line, words) in [
        ("$WAVESPLAT info s3://lab", "s3://BUCKET/KEY"),
        ("AWS_PROFILE=gone $WAVESPLAT info s3://lab/run.wspl", "AWS_PROFILE names"),
        ("AWS_ACCESS_KEY_ID=K $WAVESPLAT info s3://lab/run.wspl", "no secret"),
    ] {
        work.shell(&format!("{endpoint} {line}")).fails(2, &[words]);
    }
}

#[test]
fn an_unencrypted_answer_is_not_taken_for_an_encrypted_one() {
    let (work, server) = (work(), Server::of(bytes().clone()));
    let address = server.address().replace("http:", "https:");
    work.shell(&format!("NO_PROXY=127.0.0.1 $WAVESPLAT info {address}")).fails(1, &["no encrypted connection"]);
}

#[test]
fn commands_that_need_local_files_say_so() {
    let work = work();
    for (line, words) in [
        ("convert https://127.0.0.1:9/a.npy -o a.wspl", vec!["frames are not read from servers"]),
        ("convert run.wspl -o s3://lab/run.wspl", vec!["s3://lab/run.wspl", "aws s3 cp -"]),
        ("recover https://127.0.0.1:9/run.wspl -o a.wspl", vec!["file of this machine"]),
        ("append https://127.0.0.1:9/run.wspl run.wspl", vec!["not written to servers"]),
        ("info gs://lab/run.wspl", vec!["is no address of a kind that is known"]),
        ("extract run.wspl -o https://127.0.0.1/a.npy", vec!["not written to servers"]),
    ] {
        work.wavesplat(line).fails(2, &words);
    }
}
