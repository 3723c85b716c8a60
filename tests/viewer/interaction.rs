//! Dragging, the wheel, keys, sliders and playing.

use super::browser::Browser;
use super::converted;
use super::running_viewer::Served;
use crate::cli::Work;
use serde_json::{Value, json};

/// The picture is complete, and so are those around it.
pub(super) const FULL: &str = "!steering.live.isMoving && document.documentElement.dataset.filled !== undefined";

pub(super) fn opened(work: &Work, browser: &mut Browser) -> Served {
    let served = Served::start(work, "a.wspl");
    browser.open(&served.address);
    browser.wait(FULL);
    // Requests for progress come only while the machine is slow: they are not recorded.
    browser.js("window.asked = []; window.ask = window.fetch; window.fetch = (where, how) => { if (where !== 'progress') asked.push([where, how?.body]); return ask(where, how); }");
    served
}

fn look(browser: &mut Browser) -> Value {
    browser.js("steering.live.look")
}

#[test]
fn the_camera_follows_the_pointer() {
    let Some(mut browser) = Browser::start([900, 600]) else { return };
    let work = converted("");
    let _served = opened(&work, &mut browser);
    let height = browser.js("element('picture').getBoundingClientRect().height").as_f64().unwrap();
    browser.drag([100.0, 50.0], &json!({}));
    let view = &look(&mut browser)["view"];
    let degrees = 180.0 / height;
    let turned = [30.0 + 360.0 - 100.0 * degrees, 30.0 + 50.0 * degrees];
    assert!(
        (0..2).all(|n| ((view[n].as_f64().unwrap() - turned[n] + 180.0).rem_euclid(360.0) - 180.0).abs() < 0.1),
        "{view} {turned:?}"
    );
    let width = |browser: &mut Browser, asked: &str| {
        let size = browser.js(&format!("JSON.parse({asked}[1]).look.size"));
        size.as_str().unwrap().split_once('x').unwrap().0.parse::<u32>().unwrap()
    };
    let first = width(&mut browser, "asked[0]");
    assert!(first <= 288, "small while it moves: {first}");
    browser.wait(FULL);
    let most = width(&mut browser, "asked.at(-1)");
    assert!(most > 288, "full at rest: {most}");

    let before = look(&mut browser);
    browser.drag([30.0, 0.0], &json!({ "modifiers": 8 }));
    let after = look(&mut browser);
    assert!(before["view"] == after["view"] && before["center"] != after["center"], "{after}");

    // What is under the pointer stays there: the point beside the middle moves with the zoom about it.
    let under = "JSON.stringify(beside(steering.live.look.center, steering.live.look.view, [60 * steering.unit(), -40 * steering.unit()]))";
    let point = |text: Value| -> Vec<f64> { serde_json::from_str(text.as_str().unwrap()).unwrap() };
    let pixel = browser.js("steering.unit()").as_f64().unwrap(); // browsers round the pointer's place
    let before = point(browser.js(under));
    browser.pointer("mouseWheel", [60.0, 40.0], &json!({ "deltaX": 0, "deltaY": -400, "button": "none" }));
    browser.wait("steering.live.look.zoom > 1.5");
    let after = point(browser.js(under));
    assert!(before.iter().zip(&after).all(|(a, b)| (a - b).abs() < pixel), "{before:?} {after:?}");

    browser.click(&[1, 2]);
    browser.wait("steering.live.look.zoom === 1 && steering.live.look.view[0] === 30");
    assert!(browser.complaints.is_empty(), "{:?}", browser.complaints);
}

#[test]
fn changing_time_and_colours_sends_no_request() {
    let Some(mut browser) = Browser::start([900, 600]) else { return };
    let work = converted("");
    let _served = opened(&work, &mut browser);
    // A slow machine loads fewer frames ahead.
    browser.js("(async () => { for (let n = 0; n < 12; n++) await steering.live.whole(0, n, () => true); asked.length = 0; })()");
    let (_, first) = browser.picture();
    browser.set("frame", &json!(9));
    browser.wait("document.documentElement.dataset.drawn === '0:9'");
    let (_, ninth) = browser.picture();
    browser.set("map", &json!("magma"));
    browser.set("gamma", &json!(0.5));
    let (_, other) = browser.picture();
    assert!(first != ninth && ninth != other);
    for (key, frame) in [("Home", 0), ("ArrowRight", 1), ("End", 11), ("ArrowLeft", 10)] {
        browser.key(key);
        browser.wait(&format!("document.documentElement.dataset.drawn === '0:{frame}'"));
    }
    browser.key(" ");
    browser.wait("player.index < 10 && player.time.isPlaying");
    browser.key(" ");
    browser.wait("!player.time.isPlaying");
    assert_eq!(browser.js("asked.length"), 0);
    browser.key("d");
    browser.wait(&format!("asked.length > 0 && {FULL}"));
    assert!(look(&mut browser)["view"][0].as_f64().unwrap() != 30.0);
    browser.key("0");
    browser.wait("steering.live.look.view[0] === 30");
}

#[test]
fn clicks_plot_the_series_of_a_point_on_a_slice() {
    let Some(mut browser) = Browser::start([900, 600]) else { return };
    let work = converted("");
    let _served = opened(&work, &mut browser);
    browser.click(&[1]);
    browser.wait("player.series?.values.length === 12");
    browser.set("side", &json!("top"));
    browser.set("mode", &json!("slice"));
    browser.wait(FULL);
    browser.js("player.series = null");
    browser.pointer("mouseMoved", [1.0, 0.0], &json!({ "button": "none" }));
    browser.wait("/at x 11|at x 12/.test(element('readout').textContent)");
    browser.click(&[1]);
    browser.wait("player.series?.values.length === 12");
    let plotted = browser.js(
        "[player.series.values, asked.filter(([where]) => where === 'series').map(([_, body]) => JSON.parse(body))]",
    );
    let share: Vec<f64> = serde_json::from_value(plotted[1][0].clone()).unwrap();
    let [x, y, z] = share.try_into().unwrap();
    let [a, b, c] = [x, y, z].map(|share| 100.0 * share);
    let csv = work.render(&format!("a.wspl --probe={a}%,{b}%,{c}% -o -")).ok().text().to_string();
    let expected: Vec<f64> =
        csv.lines().skip(1).map(|line| line.rsplit(',').next().unwrap().parse().unwrap()).collect();
    assert_eq!(plotted[0], json!(expected));
    assert!((x - 0.5).abs() < 0.1 && (y - 0.5).abs() < 0.1 && (z - 0.5).abs() < 1e-9, "{x} {y} {z}");
}

#[test]
fn opacities_are_drawn_by_hand() {
    let Some(mut browser) = Browser::start([900, 600]) else { return };
    let work = converted("");
    let _served = opened(&work, &mut browser);
    browser.set("mode", &json!("composite"));
    browser.wait("document.querySelectorAll('#bar-plot rect').length === 64");
    browser.wait(FULL);
    let (_, before) = browser.picture();
    browser.js("player.bar.points = [[0, 0], [0.5, 1], [1, 1]]; player.bar.give()");
    browser.wait(FULL);
    let (_, after) = browser.picture();
    assert!(before != after);
    let command = browser.js("steering.live.made('command', 'picture.png').then(textOf)");
    assert!(command.as_str().unwrap().contains("--opacity=0:0,0.5:1,1:1"), "{command}");
}

#[test]
fn the_page_waits_for_a_server_that_comes_back() {
    let Some(mut browser) = Browser::start([900, 600]) else { return };
    let (work, token) = (converted(""), Some("0123456789abcdef"));
    let served = Served::start_with(&work, "a.wspl", token);
    browser.open(&served.address);
    browser.wait(FULL);
    let (address, port) = (served.address.clone(), served.host().rsplit(':').next().unwrap().to_string());
    drop(served);
    browser.key("d");
    browser.wait("element('status').textContent.includes('does not answer')");
    let again = Served::start_with(&work, &format!("a.wspl --port {port}"), token);
    assert_eq!(again.address, address);
    browser.wait(&format!("{FULL} && element('status').textContent === ''"));
    let is_wanted = "steering.live.kept.get(steering.live.key('full')).get(player.index).planes[0].every((value, n) => !(Math.abs(value - player.shown.planes[0][n]) > 1e-4))";
    assert!(browser.js("steering.live.look.view[0]") != 30 && browser.js(is_wanted) == true);
}

#[test]
fn a_narrow_window_holds_everything() {
    let Some(mut browser) = Browser::start([390, 844]) else { return };
    let work = converted("");
    let _served = opened(&work, &mut browser);
    assert_eq!(browser.js("document.documentElement.scrollWidth <= 390"), true);
    browser.resize([1200, 700]);
    browser.wait("element('picture').width > 500");
}
