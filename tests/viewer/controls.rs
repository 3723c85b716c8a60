//! Controls of the page: colours, opacities, slices, keys and what is saved.

use super::browser::Browser;
use super::interaction::{FULL, opened};
use super::running_viewer::Served;
use super::{converted, converted_from};
use crate::cli::Archive;
use serde_json::{Value, json};

fn choose_mode(browser: &mut Browser, mode: &str) {
    browser.set("mode", &json!(mode));
    browser.wait(&format!("player.about.mode === '{mode}' && {FULL}"));
}

fn range(browser: &mut Browser) -> [f64; 2] {
    serde_json::from_value(browser.js("player.range")).unwrap()
}

#[test]
fn a_range_out_of_order_waits_for_its_other_end() {
    let Some(mut browser) = Browser::start([900, 600]) else { return };
    let work = converted("");
    let _served = opened(&work, &mut browser);
    let before = range(&mut browser);
    browser.set("low", &json!("50"));
    assert_eq!(range(&mut browser), before, "it waits");
    assert_eq!(browser.js("[element('low').value, element('low').validity.valid]"), json!(["50", false]));
    browser.set("high", &json!("90"));
    assert_eq!(range(&mut browser), [50.0, 90.0]);
    assert_eq!(browser.js("element('low').validity.valid"), true);
    browser.js("element('reset').click()");
    assert_eq!(range(&mut browser), before);
}

#[test]
fn colours_survive_other_modes() {
    let Some(mut browser) = Browser::start([900, 600]) else { return };
    let work = converted("");
    let _served = opened(&work, &mut browser);
    let chosen = [("map", json!("magma")), ("low", json!("0.5")), ("high", json!("0.75"))];
    chosen.iter().for_each(|(id, value)| browser.set(id, value));
    for mode in ["composite", "slice", "iso", "error", "mean"] {
        choose_mode(&mut browser, mode);
    }
    assert_eq!(
        browser.js("[element('map').value, element('low').value, element('high').value]"),
        json!(["magma", "0.5", "0.75"])
    );
    let is_of_range = "Math.abs(player.scale.clear[2] - 0.08 * 0.25) < 1e-9";
    assert_eq!(browser.js(&format!("!player.about.clear || {is_of_range}")), true);
    choose_mode(&mut browser, "composite");
    assert_eq!(browser.js("player.about.map"), "magma");
    let automatic = range(&mut browser);
    browser.set("high", &json!("1.5"));
    browser.wait(&format!("player.about.range[1] === 1.5 && {FULL}"));
    browser.js("element('reset').click()");
    browser.wait(&format!("player.about.map === 'viridis' && {FULL}"));
    assert!((range(&mut browser)[1] - automatic[1]).abs() < 1e-6 && browser.js("element('map').value") == "viridis");
    assert!(browser.complaints.is_empty(), "{:?}", browser.complaints);
}

#[test]
fn diverging_colours_have_zero_in_their_middle() {
    let Some(mut browser) = Browser::start([900, 600]) else { return };
    let waves = Archive::of([16, 14, 12], 3, |x, y, z, frame| {
        let [x, y, z, frame] = [x, y, z, frame].map(|n| n as f32);
        0.2 + 1.5 * (0.4 * x + 0.1 * frame).sin() * (0.1 * y).cos() * (0.1 * z).cos()
    });
    let work = converted_from(&waves, "");
    let _served = opened(&work, &mut browser);
    browser.set("map", &json!("coolwarm"));
    let [low, high] = range(&mut browser);
    assert_eq!(low, -high);
    browser.set("map", &json!("viridis"));
    let [low, high] = range(&mut browser);
    assert_ne!(low, -high);
    assert!(browser.js("element('log-control').title").as_str().unwrap().contains("above 0"));
}

#[test]
fn slices_take_the_range_of_their_position() {
    let Some(mut browser) = Browser::start([900, 600]) else { return };
    let ramp = Archive::of([16, 14, 12], 3, |x, y, z, _| (x * y) as f32 * 1e-3 + (z * z) as f32);
    let work = converted_from(&ramp, "");
    let _served = opened(&work, &mut browser);
    choose_mode(&mut browser, "slice");
    let middle = range(&mut browser);
    browser.set("place-z", &json!(1));
    browser.wait(FULL);
    assert!(range(&mut browser)[0] > middle[1], "{middle:?}");
    assert_eq!(browser.js("[element('name-z').textContent, element('at-z').textContent]"), json!(["z", "11"]));
    let ticks = "['x', 'y', 'z'].map(axis => [element(`slice-${axis}`).checked, element(`slice-${axis}`).disabled])";
    assert_eq!(browser.js(ticks), json!([[false, false], [false, false], [true, true]]), "the last slice stays");
    browser.set("slice-x", &json!(true));
    browser.set("slice-z", &json!(false));
    assert_eq!(browser.js(ticks), json!([[true, true], [false, false], [false, false]]));
}

#[test]
fn the_opacity_editor_shows_the_opacities_of_the_picture() {
    let Some(mut browser) = Browser::start([900, 600]) else { return };
    let work = converted("");
    let _served = opened(&work, &mut browser);
    choose_mode(&mut browser, "composite");
    browser.wait("document.querySelectorAll('#bar-plot rect').length === 64");
    let suggested = browser.js("player.bar.line");
    assert!(suggested.as_array().unwrap().len() > 10, "{suggested}");
    let handles = "[...document.querySelectorAll('#bar-plot circle')].map(dot => dot.getBoundingClientRect()).every(dot => \
        dot.width >= 11.9 && dot.left >= 0 && dot.right <= innerWidth)";
    assert_eq!(browser.js(handles), true);
    browser.js("player.bar.points = [[0, 0], [1, 1]]; player.bar.give()");
    browser.wait(FULL);
    assert_eq!(browser.js("[player.bar.line, steering.live.look.opacity]"), json!([null, [[0, 0], [1, 1]]]));
    browser.js("element('opacity-auto').click()");
    browser.wait(&format!("player.bar.line && {FULL}"));
    let drawn: Vec<[f64; 2]> = serde_json::from_value(browser.js("player.bar.line")).unwrap();
    let first: Vec<[f64; 2]> = serde_json::from_value(suggested).unwrap();
    assert!(drawn.iter().zip(&first).all(|(a, b)| (a[1] - b[1]).abs() < 0.02), "{drawn:?} {first:?}");
    let end = "parseFloat(element('high-end').style.left)";
    assert_eq!(browser.js(end), 100.0);
    browser.set("high", &json!("0.75"));
    browser.wait(&format!("player.about.range[1] === 0.75 && {FULL}"));
    assert!(browser.js(end).as_f64().unwrap() < 99.0, "the handle stands at the end of the range");
}

#[test]
fn errors_are_not_saved_as_means() {
    let Some(mut browser) = Browser::start([900, 600]) else { return };
    let work = converted("--tolerance 0.05");
    let _served = opened(&work, &mut browser);
    choose_mode(&mut browser, "error");
    assert_eq!(
        browser.js("['save-page', 'save-movie', 'copy', 'save'].map(id => element(id).disabled)"),
        json!([true, true, false, false])
    );
    assert!(browser.js("element('save-page').title").as_str().unwrap().contains("not its error"));
    let command = browser.js("steering.live.made('command', 'picture.png').then(textOf)");
    let command: &str = command.as_str().unwrap();
    assert!(command.contains("--error-image=error.npy"), "{command}");
    work.shell(&command.replacen("wavesplat-render", "$RENDER", 1)).ok();
    assert!(!work.read("error.npy").is_empty() && !work.read("picture.png").is_empty());
    choose_mode(&mut browser, "mean");
    assert_eq!(browser.js("element('save-page').disabled"), false);
}

#[test]
fn isosurfaces_begin_at_a_value_of_the_frame() {
    let Some(mut browser) = Browser::start([900, 600]) else { return };
    let growing = Archive::of([16, 14, 12], 6, |x, y, z, frame| {
        let away = [x as f32 - 8.0, y as f32 - 7.0, z as f32 - 6.0].iter().map(|d| d * d).sum::<f32>();
        10f32.powi(frame as i32) * (-away / 9.0).exp()
    });
    let work = converted_from(&growing, "");
    let _served = opened(&work, &mut browser);
    browser.js("player.show(4)");
    browser.wait("document.documentElement.dataset.filled === '4'");
    choose_mode(&mut browser, "iso");
    assert_eq!(
        browser.js("[player.index, player.shown.planes[3].some(opacity => opacity > 0.5), element('iso-note').hidden]"),
        json!([4, true, true])
    );
    browser.js("player.show(0)");
    browser.wait("document.documentElement.dataset.drawn === '0:0'");
    assert_eq!(browser.js("element('iso-note').hidden"), false);
}

#[test]
fn keys_act_on_the_focused_control() {
    let Some(mut browser) = Browser::start([900, 600]) else { return };
    let work = converted("");
    let _served = opened(&work, &mut browser);
    let is_playing = |browser: &mut Browser, focus: &str| -> Value {
        browser.js(&format!("element('{focus}').focus()"));
        browser.space();
        browser.js("player.time.isPlaying")
    };
    assert_eq!(is_playing(&mut browser, "reset"), false);
    assert_eq!(is_playing(&mut browser, "frame"), true);
    assert_eq!(is_playing(&mut browser, "play"), false);
    for (key, side) in [("d", "free"), ("0", "default")] {
        browser.key(key);
        assert_eq!(browser.js("element('side').value"), side);
    }
    browser.set("side", &json!("top"));
    browser.key("d");
    browser.set("side", &json!("top"));
    assert_eq!(browser.js("steering.live.look.view"), json!([180, 90]));
    assert!(browser.complaints.is_empty(), "{:?}", browser.complaints);
}

#[test]
fn long_messages_do_not_resize_the_picture() {
    let Some(mut browser) = Browser::start([390, 844]) else { return };
    let work = converted("");
    let _served = opened(&work, &mut browser);
    let height = "element('frame-of-picture').clientHeight";
    let before = browser.js(height);
    browser.js("say('readout', 'long words '.repeat(99))");
    assert_eq!(browser.js(height), before);
    assert_eq!(browser.js("element('readout').title.length"), 1089);
    for mode in ["composite", "slice", "iso", "mean"] {
        choose_mode(&mut browser, mode);
        assert_eq!(browser.js("document.documentElement.scrollWidth <= 390"), true, "{mode}");
    }
}

#[test]
fn the_viewer_opens_as_its_options_say() {
    let Some(mut browser) = Browser::start([900, 600]) else { return };
    let work = converted("");
    let served = Served::start(&work, "a.wspl -- --mode mip --range 0,0.5");
    browser.open(&served.address);
    browser.wait(FULL);
    let seen = "[steering.mode, player.about.mode, player.range]";
    assert_eq!(browser.js(seen), json!(["mip", "mip", [0, 0.5]]));
    choose_mode(&mut browser, "mean");
    browser.wait(FULL);
    assert_eq!(browser.js(seen), json!(["mean", "mean", [0, 0.5]]));
}
