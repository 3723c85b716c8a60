//! Pictures of the page are those of `wavesplat-render`, to one of 255 steps.

use super::browser::Browser;
use super::converted;
use super::interaction::FULL;
use super::running_viewer::Served;
use crate::cli::Work;
use crate::cli::render::decode_png;
use serde_json::{Value, json};

/// Shows a picture, and asserts that the copied command draws the same.
#[track_caller]
fn assert_agrees(browser: &mut Browser, work: &Work, frame: usize, what: &str) {
    browser.js(&format!("player.show({frame})"));
    browser.wait(&format!("!steering.live.isMoving && document.documentElement.dataset.filled === '{frame}'"));
    assert_shown(browser, work, what);
    let (_, found) = browser.picture();
    assert!(found.iter().any(|level| *level != found[0]), "{what}: nothing to see");
}

/// Asserts that the copied command draws what is shown.
#[track_caller]
pub(super) fn assert_shown(browser: &mut Browser, work: &Work, what: &str) {
    let command = browser.js("steering.live.made('command', 'picture.png').then(textOf)");
    let command = command.as_str().unwrap();
    work.shell(&format!("{} --force", command.replacen("wavesplat-render", "$RENDER", 1))).ok();
    let (size, found) = browser.picture();
    let expected = decode_png(&work.read("picture.png"));
    assert!(found.len() == expected.len() && found.len() == 3 * size[0] * size[1], "{what}: {size:?}");
    let off = found.iter().zip(&expected).map(|(a, b)| a.abs_diff(*b)).max().unwrap();
    assert!(off <= 1, "{what}: off by {off}: {command}");
}

/// Chooses a mode with its settings, and waits until its picture is there.
fn choose(browser: &mut Browser, settings: &[(&str, Value)]) {
    for (id, value) in settings {
        browser.set(id, value);
    }
}

#[test]
fn pictures_of_the_page_are_those_of_the_program() {
    let Some(mut browser) = Browser::start([760, 480]) else { return };
    for (basis, n) in [("haar", 0), ("multi", 1), ("learned", 2), ("pyramid", 3)] {
        let work = converted(&format!("--basis {basis}"));
        let served = Served::start(&work, "a.wspl");
        browser.open(&served.address);
        choose(&mut browser, &[("around", json!(false)), ("white", json!(n % 2 == 1))]);
        assert_agrees(&mut browser, &work, 0, &format!("{basis}, mean"));
        choose(&mut browser, &[("map", json!("turbo")), ("log", json!(n == 2))]);
        assert_agrees(&mut browser, &work, 7, &format!("{basis}, mean, turbo"));
        browser.drag([90.0, 40.0], &json!({}));
        choose(&mut browser, &[("mode", json!("mip"))]);
        assert_agrees(&mut browser, &work, 11, &format!("{basis}, largest"));
        let modes = [
            vec![("mode", json!("composite"))],
            vec![("mode", json!("composite")), ("map", json!("magma")), ("shade", json!(true))],
            vec![("mode", json!("iso")), ("iso", json!(0.6))],
            vec![("mode", json!("slice")), ("slice-x", json!(true))],
        ];
        choose(&mut browser, &modes[n]);
        assert_agrees(&mut browser, &work, 3, &format!("{basis}, {:?}", modes[n]));
    }
    assert!(browser.complaints.is_empty(), "{:?}", browser.complaints);
}

#[test]
fn frames_of_an_archive_show_as_well() {
    let Some(mut browser) = Browser::start([760, 480]) else { return };
    let work = converted("");
    let served = Served::start(&work, "a.npy");
    browser.open(&served.address);
    choose(&mut browser, &[("around", json!(false))]);
    assert_agrees(&mut browser, &work, 5, "mean");
    choose(&mut browser, &[("mode", json!("composite"))]);
    assert_agrees(&mut browser, &work, 6, "composite");
}

#[test]
fn certified_errors_hold_for_the_pictures() {
    let Some(mut browser) = Browser::start([760, 480]) else { return };
    let work = converted("--tolerance 0.05");
    let served = Served::start(&work, "a.wspl");
    browser.open(&served.address);
    choose(&mut browser, &[("mode", json!("error"))]);
    browser.wait(&format!("player.shown?.beneath && {FULL}"));
    let [coded, error] = ["beneath", "planes[0]"]
        .map(|of| browser.js(&format!("Array.from(player.shown.{of}, v => Number.isNaN(v) ? null : v)")));
    let look = browser.js("JSON.stringify(steering.live.request([player.index, player.index + 1], 'full').look)");
    let raw = Served::start(&work, "a.npy");
    browser.open(&raw.address);
    let read = format!(
        "steering.live.engine.ask('pictures', {{ look: {{ ...{}, range: null, clear: null }} }}).then(async b => \
         Array.from((await readBlock(b.subarray(4 + new DataView(b.buffer).getUint32(0, true)))).pictures[0][0], v => Number.isNaN(v) ? null : v))",
        look.as_str().unwrap()
    );
    let exact = browser.js(&read);
    let [coded, error, exact] = [&coded, &error, &exact].map(|all| all.as_array().unwrap());
    let mut seen = 0;
    for ((a, b), error) in coded.iter().zip(exact).zip(error) {
        if let (Some(a), Some(b), Some(error)) = (a.as_f64(), b.as_f64(), error.as_f64()) {
            seen += 1;
            assert!((a - b).abs() <= error * 1.0001 + 1e-6, "{a} {b} {error}");
        }
    }
    assert!(seen > 1000 && coded.len() == exact.len(), "{seen}");
}
