//! Pages that hold their pictures, from the disk.

use super::browser::Browser;
use super::converted;
use crate::cli::render::decode_png;
use serde_json::json;

#[test]
fn pages_show_the_pictures_of_the_program() {
    let Some(mut browser) = Browser::start([900, 600]) else { return };
    let work = converted("");
    for (n, options) in [
        "",
        "--mode composite --view 10,20",
        "--colormap turbo --norm log",
        "--mode slice --slice z=50%",
        "--iso 1 --theme light",
        "--orbit 5",
    ]
    .into_iter()
    .enumerate()
    {
        work.render(&format!("a.wspl {options} --size 150x110 -o page_{n}.html")).ok();
        browser.open_file(&work.path(format!("page_{n}.html")));
        let views = browser.js("player.source.sequences.length").as_u64().unwrap();
        let bar = browser.js("element('bar').hidden");
        assert_eq!(bar == true, options.contains("--iso"), "{options}: {bar}");
        let (view, frame) = (views - 1, 6);
        browser.js(&format!("player.choose({view}); player.show({frame})"));
        browser.wait(&format!("document.documentElement.dataset.drawn === '{view}:{frame}'"));
        work.render(&format!("a.wspl {options} --size 150x110 -o one_{n}_%v_%d.png")).ok();
        let (_, found) = browser.picture();
        let expected = decode_png(&work.read(&format!("one_{n}_{view}_{frame}.png")));
        assert_eq!(found.len(), expected.len(), "{options}");
        let off = found.iter().zip(&expected).map(|(a, b)| a.abs_diff(*b)).max().unwrap();
        assert!(off <= 1, "{options}: off by {off}");
    }
    assert!(browser.complaints.is_empty(), "{:?}", browser.complaints);
}

#[test]
fn texts_of_files_never_become_markup() {
    let Some(mut browser) = Browser::start([900, 600]) else { return };
    let work = converted("");
    let title = "</script><script>window.hacked=1</script><img/src=x/onerror=window.hacked=1>&lt;{script}{blocks}";
    work.render(&format!("a.wspl --size 60x50 --title {title} -o page.html")).ok();
    browser.open_file(&work.path("page.html"));
    browser.wait("document.documentElement.dataset.drawn === '0:6'"); // in the middle
    assert_eq!(browser.js("[window.hacked ?? null, element('title').textContent]"), json!([null, title]));
    assert!(browser.complaints.is_empty(), "{:?}", browser.complaints);
}
