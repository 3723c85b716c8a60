//! Priorities of requests: pictures for the user come first, then plots, then prefetched pictures.

use super::browser::Browser;
use super::converted;
use super::interaction::{FULL, opened};
use serde_json::json;

#[test]
fn prefetched_pictures_cancel_no_picture_of_the_user() {
    let Some(mut browser) = Browser::start([900, 600]) else { return };
    let work = converted("");
    let _served = opened(&work, &mut browser);
    for (mode, pause) in [("composite", 150), ("composite", 240), ("mean", 200), ("mip", 245)] {
        browser.set("mode", &json!(mode));
        browser.wait(FULL);
        browser.key("Home");
        browser.key("d"); // pictures of other views are not kept
        browser.wait("!steering.live.isMoving && document.documentElement.dataset.drawn === '0:0'");
        browser.key("End");
        browser.wait("document.documentElement.dataset.drawn === '0:11'");
        std::thread::sleep(std::time::Duration::from_millis(pause));
        browser.key("ArrowLeft");
        browser.wait("document.documentElement.dataset.drawn === '0:10'");
        browser.wait(FULL);
        assert_eq!(browser.js("element('label').textContent"), "frame 10", "{mode} {pause}");
        let (_, shown) = browser.picture();
        browser.key("End");
        browser.wait("document.documentElement.dataset.drawn === '0:11'");
        browser.key("ArrowLeft");
        browser.wait("document.documentElement.dataset.drawn === '0:10'");
        let (_, again) = browser.picture();
        // Frames rendered together may differ in rounding from those rendered alone; frame 11 differs far more.
        let is_same = shown.len() == again.len() && shown.iter().zip(&again).all(|(a, b)| a.abs_diff(*b) <= 4);
        assert!(is_same, "another picture than that of frame 10: {mode} {pause}");
    }
    assert!(browser.complaints.is_empty(), "{:?}", browser.complaints);
}

#[test]
fn prefetching_waits_for_requests_of_the_user() {
    let Some(mut browser) = Browser::start([900, 600]) else { return };
    let work = converted("");
    let _served = opened(&work, &mut browser);
    browser.js("window.fetch = (where, how) => { asked.push([where, how?.body, how?.signal]); return new Promise(next => { window.answer = next; }).then(() => ask(where, how)); }");
    browser.js("steering.live.kept.clear(); asked.length = 0; void player.show(4)");
    browser.wait("asked.length === 1");
    browser.js("void steering.live.fill(11).catch(() => {})");
    browser.js("void player.plot({ clientX: 300, clientY: 300 }).catch(() => {})");
    browser.wait("new Promise(next => setTimeout(() => next(true), 50))");
    assert_eq!(browser.js("asked[0][2].aborted"), false);
    browser.js("window.fetch = ask; answer()");
    browser.wait("document.documentElement.dataset.drawn === '0:4'");
    browser.wait("player.series?.values.length === 12");
}

#[test]
fn plotting_does_not_change_the_frame() {
    let Some(mut browser) = Browser::start([900, 600]) else { return };
    let work = converted("");
    let _served = opened(&work, &mut browser);
    browser.js("player.show(5)");
    browser.wait("document.documentElement.dataset.filled === '5'");
    browser.js("steering.live.kept.clear()");
    browser.click(&[1]);
    browser.wait("player.series?.values.length === 12");
    assert_eq!(
        browser.js("[player.index, steering.live.index, document.documentElement.dataset.filled]"),
        json!([5, 5, "5"])
    );
    let command = browser.js("steering.live.made('command', 'picture.png').then(textOf)");
    assert!(command.as_str().unwrap().contains("--frames=5 "), "{command}");
    browser.key("d");
    assert_eq!(browser.js("[player.series, element('series').hidden]"), json!([null, true]), "another view");
    browser.wait(FULL);
    browser.click(&[1, 2]);
    std::thread::sleep(std::time::Duration::from_millis(600));
    assert_eq!(browser.js("[player.series, element('side').value]"), json!([null, "default"]), "a double click");
    browser.set("mode", &json!("iso"));
    browser.wait(&format!("{FULL} && player.about.mode === 'iso'"));
    browser.click(&[1]);
    browser.wait("element('readout').textContent.includes('nothing is plotted')");
    assert!(browser.complaints.is_empty(), "{:?}", browser.complaints);
}
