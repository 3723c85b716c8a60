//! `wavesplat.h` is what cbindgen makes of the sources.

use cbindgen::{Builder, Config, DocumentationStyle, Language, Style};
use std::fs;
use std::path::Path;

const BEGIN: &str = "/* wavesplat for C and C++: frames in from a running simulation, samples out.
 *
 * Functions that return a number return WAVESPLAT_OK or an error code; wavesplat_message then has the reason in words. They can be
 * called from any thread, but only from one at a time for the same writer. Several threads may read the same file. A process that was
 * forked after the library was used cannot use it.
 *
 * tools/c/tests/header.rs makes this file of the sources. */
";

/// After a change: `WAVESPLAT_WRITE_HEADER=1 cargo test -p wavesplat-c --test header`.
#[test]
fn the_header_is_that_of_the_sources() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR"));
    let config = Config {
        language: Language::C,
        header: Some(BEGIN.trim_end().into()),
        include_guard: Some("WAVESPLAT_H".into()),
        cpp_compat: true,
        style: Style::Both,
        documentation_style: DocumentationStyle::C99,
        usize_is_size_t: true,
        line_length: 120,
        ..Config::default()
    };
    let sources = ["status", "frames", "write", "read"].map(|name| folder.join(format!("src/{name}.rs")));
    let builder = sources.iter().fold(Builder::new().with_config(config), Builder::with_src);
    let mut made = Vec::new();
    builder.generate().expect("the sources are read").write(&mut made);
    let made = String::from_utf8(made).expect("text").replace("// # Safety\n", "");
    let path = folder.join("wavesplat.h");
    if std::env::var_os("WAVESPLAT_WRITE_HEADER").is_some() {
        fs::write(&path, &made).expect("the header is written");
    }
    assert_eq!(fs::read_to_string(&path).unwrap_or_default(), made, "see the comment of this test");
}
