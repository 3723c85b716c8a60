//! Pages that need no server: the program within the page draws the same bits as the program itself.

use super::browser::Browser;
use super::interaction::FULL;
use super::running_viewer::Served;
use super::{converted, converted_from};
use crate::cli::{Archive, Work};
use crate::common::http::{Fate, Server};
use base64::Engine;
use base64::engine::general_purpose::STANDARD as BASE64;
use serde_json::{Value, json};
use std::sync::{Arc, Mutex};

/// What the engine of the page answers.
fn asked(browser: &mut Browser, name: &str, body: &Value) -> Vec<u8> {
    let ask = format!(
        "steering.live.engine.ask({}, {body}).then(bytes => {{ let text = ''; \
         for (let i = 0; i < bytes.length; i += 8192) text += String.fromCharCode(...bytes.subarray(i, i + 8192)); return btoa(text); }})",
        json!(name)
    );
    BASE64.decode(browser.js(&ask).as_str().unwrap()).unwrap()
}

/// The head of an answer, whose fields may be in any order, and the rest.
fn parts<'a>(name: &str, answer: &'a [u8]) -> (Value, &'a [u8]) {
    if name != "pictures" {
        return (Value::Null, answer);
    }
    let (length, rest) = answer.split_at(4);
    let (head, rest) = rest.split_at(u32::from_le_bytes(length.try_into().unwrap()) as usize);
    (serde_json::from_slice(head).unwrap(), rest)
}

/// Requests of every kind.
fn questions() -> Vec<(&'static str, Value)> {
    let look = |more: Value| {
        let mut look = json!({ "view": ["20,35"], "scale": 6.5, "center": "11.5,9.5,7.5", "size": "170x130", "frames": "3:6", "annotate": "box,axes" });
        look.as_object_mut().unwrap().extend(more.as_object().unwrap().clone());
        json!({ "look": look })
    };
    let certified = json!({ "look": look(json!({ "frames": "4:5" }))["look"], "certify": true });
    let views = [
        json!({}),
        json!({ "lod": 1, "size": "80x60" }),
        json!({ "view": ["200,-80"], "colormap": "turbo", "theme": "light", "frames": "0:12" }),
        json!({ "mode": "mip" }),
        json!({ "mode": "composite" }),
        json!({ "mode": "composite", "shade": true, "view": ["90,0"], "transfer_function": "magma" }),
        json!({ "mode": "iso", "iso": "0.6" }),
        json!({ "mode": "slice", "slice": ["z=50%", "x=20%"] }),
    ];
    let pictures = views.into_iter().map(|view| ("pictures", look(view)));
    pictures
        .chain([
            ("pictures", certified),
            ("histogram", json!({})),
            ("histogram", json!({ "frame": 7 })),
            ("series", json!([0.5, 0.25, 1.0])),
        ])
        .collect()
}

#[test]
fn pages_answer_as_the_program_does() {
    let Some(mut browser) = Browser::start([760, 480]) else { return };
    for options in
        ["--basis learned", "--basis pyramid --block 8", "--basis haar --tolerance 0", "--basis multi --max-error 0.01"]
    {
        let work = converted(options);
        work.wavesplat("page a.wspl -o a.html").ok();
        let served = Served::start(&work, "a.wspl");
        browser.open_file(&work.path("a.html"));
        for (name, body) in questions() {
            let expected = served.post(name, body.to_string().as_bytes());
            assert_eq!(expected.status, 200, "{}", expected.text());
            assert!(
                parts(name, &asked(&mut browser, name, &body)) == parts(name, &expected.body),
                "{options}: {name} {body}"
            );
        }
    }
    assert!(browser.complaints.is_empty(), "{:?}", browser.complaints);
}

#[test]
fn the_preview_within_a_page_is_the_picture_of_the_program() {
    let Some(mut browser) = Browser::start([760, 480]) else { return };
    for (options, is_taken) in [("", true), ("-- --mode composite", true), ("-- --mode iso", false)] {
        let work = converted("");
        work.wavesplat(&format!("page a.wspl -o a.html {options}")).ok();
        browser.open_file(&work.path("a.html"));
        browser.wait(FULL);
        assert_eq!(browser.js("Boolean(steering.live.facts.file.preview)"), json!(is_taken), "{options}");
        if !is_taken {
            continue;
        }
        // As large as the page's own coarse picture, it has the same pixels.
        let compared = browser.js(
            "(async () => { const { live } = steering, { answer, scale } = live.facts.file.preview, { look } = live.request([live.opening, live.opening + 1], 'coarse'); \
             const own = partsOf(await live.engine.ask('pictures', { packed: true, look: { mode: look.mode, view: look.view, center: look.center, frames: look.frames, scale, size: '256x256' } })); \
             const [[mine], [its]] = await Promise.all([answer, own].map(async ({ blocks: [[, block]] }) => (await readBlock(block)).pictures)); \
             const same = cut(mine, 256, [256, 256], 1), half = cut(mine, 256, [128, 60], 2); \
             const at = (x, y) => its[0][(2 * y + 256 / 2 - 60 + 1) * 256 + 2 * x + 1]; \
             return [mine.length, mine.every((plane, p) => plane.every((n, i) => Object.is(n, its[p][i]) && Object.is(n, same[p][i]))), \
             half[0].every((n, i) => Object.is(n, at(i % 128, Math.floor(i / 128))))]; })()",
        );
        assert_eq!(compared, json!([if options.is_empty() { 1 } else { 4 }, true, true]), "{options}");
        browser.js("player.show(2)");
        browser.wait(&format!("document.documentElement.dataset.drawn === '0:2' && {FULL}"));
    }
    assert!(browser.complaints.is_empty(), "{:?}", browser.complaints);
}

#[test]
fn a_page_from_the_disk_does_what_the_viewer_does() {
    let Some(mut browser) = Browser::start([760, 480]) else { return };
    let work = converted("");
    let title = work.wavesplat("page a.wspl -o a.html -- --mode mip");
    title.ok();
    work.wavesplat("page a.wspl -o a.html").fails(2, &["a.html", "--force"]);
    browser.open_file(&work.path("a.html"));
    browser.wait(FULL);
    assert_eq!(browser.js("[steering.mode, element('save-movie').hidden]"), json!(["mip", true]));
    for mode in ["composite", "iso", "slice", "error", "mean"] {
        browser.set("mode", &json!(mode));
        browser.wait(&format!("player.about.mode === '{mode}' && {FULL}"));
        browser.drag([60.0, 20.0], &json!({}));
        browser.wait(FULL);
        browser.js("player.show(9)");
        browser.wait("document.documentElement.dataset.drawn === '0:9'");
    }
    browser.space();
    browser.wait("player.index !== 9");
    browser.space();
    browser.click(&[1]);
    browser.wait("player.series?.values.length === 12");
    let command = browser.js("steering.live.made('command', 'picture.png').then(textOf)");
    assert!(command.as_str().unwrap().starts_with("wavesplat-render a.wspl "), "{command}");
    let saved = browser.js("steering.live.made('save', 'picture.png').then(bytes => Array.from(bytes.subarray(1, 4)))");
    assert_eq!(saved, json!([80, 78, 71]));
    let movie = browser.js("steering.live.made('save', 'movie.mp4').catch(error => error.message)");
    assert!(!movie.as_str().unwrap().is_empty(), "{movie}");
    browser.wait("steering.live.made('command', 'picture.png').then(() => true)"); // it goes on
    browser.reload();
    browser.wait(FULL);
    assert_eq!(browser.js("steering.mode"), "mean");
    assert!(browser.complaints.is_empty(), "{:?}", browser.complaints);
}

#[test]
fn new_questions_do_not_wait_for_what_nobody_wants() {
    let Some(mut browser) = Browser::start([760, 480]) else { return };
    let work = converted_from(&Archive::smooth([64, 60, 56], 8), "");
    work.wavesplat("page a.wspl -o a.html").ok();
    browser.open_file(&work.path("a.html"));
    browser.wait(FULL);
    let slow = json!({ "look": { "view": ["1,1"], "scale": 30.0, "center": "30,30,30", "size": "1600x1600", "frames": "0:1", "mode": "composite", "shade": true, "range": "0,1" } });
    let quick = json!({ "frame": 1 });
    let waited = browser.js(&format!(
        "(async () => {{ const stop = new AbortController(), {{ engine }} = steering.live, before = engine.full.worker, slow = engine.ask('pictures', {slow}, {{ signal: stop.signal }}).catch(error => error.name); \
         await pause(50); stop.abort(); const begun = performance.now(); await engine.ask('histogram', {quick}); return [await slow, performance.now() - begun, before !== engine.full.worker]; }})()"
    ));
    assert_eq!(waited[0], "AbortError");
    assert_eq!(waited[2], true, "another worker answers: {waited}");
    assert!(browser.complaints.is_empty(), "{:?}", browser.complaints);
}

/// A site on a server whose archive meets a fate.
fn site(work: &Work, archive: &Arc<Mutex<Fate>>) -> Server {
    let [page, program, file, other] =
        ["index.html", "wavesplat.zz", "a.wspl", "b.wspl"].map(|name| work.read(&format!("site/{name}")));
    let archive = archive.clone();
    Server::with(file, move |asked| match asked.path.as_str() {
        "/" => Fate::Other(page.clone(), "text/html"),
        path if path.starts_with("/wavesplat.zz?") => Fate::Other(program.clone(), "application/octet-stream"),
        path if path.starts_with("/b.wspl?") => Fate::Replaced(other.clone(), "b".into()),
        path if path.starts_with("/a.wspl?") => archive.lock().unwrap().clone(),
        _ => Fate::Refuse(404, String::new(), String::new()),
    })
}

#[test]
fn a_site_reads_the_parts_that_it_shows() {
    let Some(mut browser) = Browser::start([760, 480]) else { return };
    let work = converted_from(&Archive::smooth([64, 60, 56], 64), "--window 16 --tolerance 0.00001");
    work.write("b.npy", Archive::smooth([12, 10, 8], 4).npy());
    work.wavesplat("convert b.npy -o b.wspl").ok();
    work.wavesplat("page a.wspl b.wspl --beside -o site/").ok();
    work.wavesplat("page a.wspl --beside -o site").fails(2, &["site", "--force"]);
    work.wavesplat("page a.wspl b.wspl --beside -o site --force").ok();
    for name in ["empty", "other"] {
        std::fs::create_dir(work.path(name)).unwrap();
    }
    work.wavesplat("page a.wspl --beside -o empty").ok();
    work.write("other/mine.wspl", work.read("a.wspl"));
    work.wavesplat("page a.wspl --beside -o other --force").fails(2, &["other", "no folder of a page"]);
    work.write("empty/mine.wspl", work.read("a.wspl"));
    work.wavesplat("page a.wspl --beside -o empty --force").fails(2, &["mine.wspl", "not a part of the page"]);
    work.wavesplat("page a.wspl a.wspl --beside -o twice").fails(2, &["two have the name a.wspl"]);
    work.wavesplat("page s3://bucket/a.wspl --beside -o far").fails(2, &["s3://bucket/a.wspl", "https://"]);
    work.wavesplat("page https://me:secret@host/a.wspl --beside -o far").fails(2, &["host/a.wspl", "user name"]);
    work.write("empty.html", "<script>player = {}</script>");
    assert!(work.read("site/a.wspl") == work.read("a.wspl") && work.read("site/b.wspl") == work.read("b.wspl"));
    let fate = Arc::new(Mutex::new(Fate::Answer));
    let server = site(&work, &fate);
    browser.open(&format!("http://127.0.0.1:{}/", server.port()));
    browser.wait("player.shown?.quality === 'full'");
    let asked = server.asked();
    let mut read = vec![false; work.read("a.wspl").len()];
    asked
        .iter()
        .filter(|asked| asked.path.starts_with("/a.wspl"))
        .for_each(|asked| read[asked.range.clone()].fill(true));
    let share = read.iter().filter(|read| **read).count() as f64 / read.len() as f64;
    assert!(share > 0.0 && share < 0.7, "{share} of the file for a few frames");
    browser.wait(FULL);
    assert_eq!(browser.js("[element('archives').hidden, element('archive').value]"), json!([false, "a.wspl"]));

    for (told, words) in [
        (Fate::Whole, "sends whole files only"),
        (Fate::Refuse(403, String::new(), String::new()), "answers 403"),
        (Fate::Replaced(vec![0; 77], "two".into()), "has changed since this page was made"),
        (Fate::Flipped(5), "a.wspl"),
    ] {
        *fate.lock().unwrap() = told;
        browser.open(&format!("http://127.0.0.1:{}/", server.port()));
        browser.wait(&format!(
            "element('readout').textContent.includes('a.wspl') && element('readout').textContent.includes({})",
            json!(words)
        ));
        browser.wait("player.shown.quality === 'coarse'"); // the preview within the page
    }
    *fate.lock().unwrap() = Fate::Answer;
    browser.open_file(&work.path("empty.html"));
    browser.open(&format!("http://127.0.0.1:{}/#archive=b.wspl", server.port()));
    browser.wait(FULL);
    assert_eq!(browser.js("element('title').textContent"), "b.wspl");
}

#[test]
fn damaged_files_end_in_a_message() {
    let Some(mut browser) = Browser::start([760, 480]) else { return };
    let work = converted("");
    work.wavesplat("page a.wspl -o a.html").ok();
    browser.open_file(&work.path("a.html"));
    browser.wait(FULL);
    let file = work.read("a.wspl");
    let page = String::from_utf8(work.read("a.html")).unwrap();
    for (part, told) in [("program", "the program is incomplete"), ("file", "a.wspl is incomplete")] {
        let cut = page.find(&format!("id=\"{part}\"")).unwrap() + 100;
        work.write(&format!("{part}.html"), &page[..cut]);
        browser.open_file(&work.path(format!("{part}.html")));
        browser.wait(&format!("element('readout').textContent.includes('{told}')"));
    }
    browser.open_file(&work.path("a.html"));
    browser.wait(FULL);
    for n in 0..24 {
        let mut bytes = file.clone();
        match n % 3 {
            0 => bytes.truncate(bytes.len() * (n + 1) / 30),
            1 => bytes.iter_mut().skip(n * 131 % file.len()).step_by(977).for_each(|byte| *byte ^= 0x41),
            _ => bytes.rotate_left(n),
        }
        let told = told_of(&mut browser, &bytes);
        assert!(!told.is_empty() || n % 3 == 1, "{n}: a truncated or shifted file is no file");
    }
    for folder in ["corpus/file", "seeds"] {
        for seed in std::fs::read_dir(format!("{}/tools/fuzz/{folder}", env!("CARGO_MANIFEST_DIR"))).unwrap() {
            told_of(&mut browser, &std::fs::read(seed.unwrap().path()).unwrap());
        }
    }
}

/// What a page says instead of pictures of a file; empty if it draws them.
fn told_of(browser: &mut Browser, bytes: &[u8]) -> String {
    let told = browser.js(&format!(
        "(async () => {{ const {{ facts }} = steering.live, file = document.createElement('script'); [file.type, file.id, file.textContent] = ['text/plain', 'file', '{}']; \
         document.body.append(file); return new Workers({{ ...facts.file, length: {} }}).ask('pictures', {{ look: {{ scale: 3, size: '60x50', center: '12,10,8', frames: '0:12' }} }}).then(() => '', error => error.message); }})()",
        BASE64.encode(bytes),
        bytes.len()
    ));
    let told = told.as_str().unwrap().to_string();
    assert!(told.is_empty() || told.contains("a.wspl") && !told.contains("panicked"), "{told}");
    told
}
