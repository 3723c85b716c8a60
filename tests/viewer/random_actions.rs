//! Users who do anything, in any order: what they see is always what the program draws.

use super::browser::Browser;
use super::converted;
use super::pixels_match_program::assert_shown;
use super::running_viewer::Served;
use serde_json::{Value, json};

const ACTIONS: usize = 1000;
/// Actions until the picture is compared.
const EVERY: usize = 40;

struct Random(u64);

impl Random {
    fn below(&mut self, end: usize) -> usize {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 33) as usize % end
    }

    fn share(&mut self) -> f64 {
        self.below(1001) as f64 / 1000.0
    }

    fn of<'a>(&mut self, names: &[&'a str]) -> &'a str {
        names[self.below(names.len())]
    }
}

/// Does one thing, and says what.
fn act(browser: &mut Browser, random: &mut Random) -> String {
    match random.below(15) {
        0 | 1 => {
            let by = [0; 2].map(|_| 300.0 * random.share() - 150.0);
            browser.drag(by, &json!({ "modifiers": 8 * random.below(2) }));
            format!("drag {by:?}")
        }
        2 | 3 => set(browser, "frame", &json!(random.below(12))),
        4 => {
            let key = random.of(&["ArrowLeft", "ArrowRight", "Home", "End", "d", "w", "+", "-", "0", "c"]);
            browser.key(key);
            key.into()
        }
        5 | 6 => set(browser, "mode", &json!(random.of(&["mean", "mip", "composite", "iso", "slice", "error"]))),
        7 => {
            let turn = json!({ "deltaX": 0, "deltaY": 200.0 * random.share() - 100.0, "button": "none" });
            browser.pointer("mouseWheel", [0.0; 2], &turn);
            "wheel".into()
        }
        8 => {
            let id = random.of(&["around", "white", "shade", "loop", "slice-x", "slice-y"]);
            set(browser, id, &json!(random.below(2) == 0))
        }
        9 => {
            let id = random.of(&["iso", "place-x", "place-y", "place-z", "gamma"]);
            set(browser, id, &json!(random.share()))
        }
        10 => {
            let id = random.of(&["low", "high", "map"]);
            let value =
                if id == "map" { json!(random.of(&["viridis", "turbo", "magma"])) } else { json!(random.share()) };
            set(browser, id, &value)
        }
        11 => {
            browser.resize([500 + 40 * random.below(10) as u32, 420 + 30 * random.below(8) as u32]);
            "resize".into()
        }
        12 => {
            browser.slow_network(random.below(2) == 0);
            "network".into()
        }
        13 if random.below(4) == 0 => {
            browser.reload();
            "reload".into()
        }
        _ => {
            browser.js("element('play').click()");
            "play or pause".into()
        }
    }
}

fn set(browser: &mut Browser, id: &str, value: &Value) -> String {
    // What is disabled cannot be set.
    if browser.js(&format!("element('{id}')?.disabled")) != true {
        browser.set(id, value);
    }
    format!("{id} {value}")
}

/// Waits until the page has what it was asked for.
fn settle(browser: &mut Browser, done: &[String]) {
    browser.slow_network(false);
    browser.js("if (player.time.isPlaying) element('play').click()");
    let shown = "document.documentElement.dataset";
    let is_settled = format!(
        "!steering.live.isMoving && {shown}.filled === String(player.index) && {shown}.drawn === `0:${{player.index}}` \
         && player.shown.about.mode === steering.mode && !document.documentElement.classList.contains('old')"
    );
    let found = browser.has(&is_settled);
    let state = browser.js("[document.documentElement.dataset.filled, document.documentElement.dataset.drawn, player.index, player.shown?.about.mode, steering.mode, steering.live.look, element('readout').textContent]");
    assert!(found, "not settled after {done:?}: {state} {:?}", browser.complaints);
}

#[test]
fn a_thousand_actions_lose_no_picture() {
    let Some(mut browser) = Browser::start([760, 520]) else { return };
    let work = converted("--tolerance 0.05");
    let served = Served::start(&work, "a.wspl");
    browser.open(&served.address);
    let (mut random, mut compared) = (Random(20_261_129), 0);
    for round in 0..ACTIONS / EVERY {
        let done: Vec<String> = (0..EVERY).map(|_| act(&mut browser, &mut random)).collect();
        settle(&mut browser, &done);
        let label = browser.js("[element('label').textContent, element('frame').value, player.index]");
        assert_eq!(label, json!([format!("frame {}", label[2]), label[2].to_string(), label[2]]), "{done:?}");
        if browser.js("steering.mode") != "error" {
            assert_shown(&mut browser, &work, &format!("round {round}: {done:?}"));
            compared += 1;
        }
    }
    assert!(compared > ACTIONS / EVERY / 2, "{compared}");
    assert!(browser.complaints.is_empty(), "{:?}", browser.complaints);
}

#[test]
fn the_address_brings_the_same_picture_back() {
    let Some(mut browser) = Browser::start([760, 520]) else { return };
    let work = converted("");
    let served = Served::start(&work, "a.wspl");
    browser.open(&served.address);
    let mut random = Random(7);
    for mode in ["mean", "mip", "composite", "iso", "slice"] {
        set(&mut browser, "mode", &json!(mode));
        browser.drag([70.0, 30.0], &json!({}));
        for id in ["iso", "place-z"].iter().filter(|id| id.starts_with(mode) || mode == "slice" && **id == "place-z") {
            set(&mut browser, id, &json!(0.625));
        }
        if mode == "mip" {
            for (id, value) in
                [("map", json!("magma")), ("low", json!(0.2)), ("high", json!(0.9)), ("gamma", json!(0.5))]
            {
                set(&mut browser, id, &value);
            }
        }
        set(&mut browser, "frame", &json!(random.below(12)));
        if mode == "composite" {
            browser.js("player.bar.points = [[0, 0], [0.5, 0.8], [1, 1]]; player.bar.give()");
        }
        settle(&mut browser, &[mode.into()]);
        let look =
            "[steering.live.look, player.index, player.range, player.scale.gamma, element('map').value, steering.mode]";
        let before = (browser.js(look), browser.picture());
        browser.wait("location.hash.includes('frame=')");
        std::thread::sleep(std::time::Duration::from_millis(300)); // the address follows after a moment
        browser.reload();
        settle(&mut browser, &["reload".into()]);
        let after = (browser.js(look), browser.picture());
        assert_eq!(before.0, after.0, "{mode}");
        let apart = before.1.1.iter().zip(&after.1.1).filter(|(a, b)| a.abs_diff(**b) > 4).count();
        assert!(before.1.0 == after.1.0 && apart == 0, "{mode}: {apart}");
    }
    for nonsense in [
        "mode=evil&view=x,y&zoom=-1&frame=99999999999&slices=q:9&opacity=1&range=2,1",
        "map=toString&gamma=9&box=7",
        "mode=composite&opacity=a:b,c:d",
        "%E0%A4%A",
        "=&&=",
    ] {
        browser.js("void (window.player = null)");
        browser.js(&format!("void (location.hash = '{nonsense}')")); // as a link that is opened in the same tab
        browser.wait("window.player && player.shown");
        settle(&mut browser, &[nonsense.into()]);
    }
    assert!(browser.complaints.is_empty(), "{:?}", browser.complaints);
}
