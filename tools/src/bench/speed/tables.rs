//! The tables for people, in Markdown.

use super::measured::{Measured, Time, further};
use super::plan::{FINEST, LOOSER, WHOLE};
use super::results::{Archive, Results, Row};
use std::fmt::Write as _;

const HEAD: &str = "\
All pictures of a view: the weighted mean, 32-bit, seen from 30 degrees about z and 30 above the horizon, kernel of 0.75
voxels, no attenuation. Coefficient files keep every sample within the tolerance x value range; splatting may add half
of the tolerance, at most 1e-3. With one thread, times are processor seconds on one core, otherwise wall seconds. Each is the
least of all rounds; every measurement ran in its own process, in turns. *Textbook*: a table of footprints, frame by frame.
*Best conventional*: the textbook form or the library's own method for frames (*direct*), whichever is faster; frames are in
the system's cache. *View of decoded codes*: a view minus bare decoding of the bytes it read. *Splat stage*: decoding and
splatting as reported by the library, minus bare decoding; for the textbook form, everything after its set-up. Targets
refer to files of the default scheme at the first tolerance. ✗ marks missed targets.
";

pub(super) fn markdown(results: &Results) -> String {
    let mut text = format!("# Speed\n\n{}\n{HEAD}", made(results));
    let (judged, beside): (Vec<&Row>, Vec<&Row>) = results.rows.iter().partition(|r| r.wanted.is_some());
    text += &summary(&judged);
    for target in targets(&judged) {
        text += &details(target, judged.iter().filter(|r| r.target == target));
    }
    text += &matrix(&beside);
    for archive in &results.archives {
        text += &parts(archive);
    }
    text + &times(results)
}

fn made(results: &Results) -> String {
    let Results { made, rounds, size, .. } = results;
    let mut text = format!("{}; {rounds} round(s), {size}x{size} pixels.\n", made.words());
    for Archive { data, .. } in &results.archives {
        let _ = write!(text, "\n- {}", data.in_words());
    }
    for name in &results.left {
        let _ = write!(text, "\n- *{name}*: not measured, since the run was interrupted");
    }
    let _ = writeln!(text, "\n\n{}", noise(results));
    text
}

/// The ratio of wall time to processor time; far above 1, other programs used the processor, too.
fn noise(results: &Results) -> String {
    let one = |a: &&Archive| {
        let alone = a.measured.iter().filter(|(key, m)| key.ends_with(" x1") && m.from_storage.is_none());
        let ratios = alone.map(|(_, m)| m.time.wall / m.time.processor).filter(|r| r.is_finite());
        ratios.collect::<Vec<f64>>()
    };
    let mut ratios: Vec<f64> = results.archives.iter().flat_map(|a| one(&a)).collect();
    ratios.sort_by(f64::total_cmp);
    let Some(median) = ratios.get(ratios.len() / 2) else { return String::new() };
    let word = if *median > 1.1 { ": others used the processor, take all times as provisional." } else { "." };
    format!("With one thread the clock's times are {median:.2} times the processor's (median){word}")
}

/// All targets, in the order in which they first appear.
fn targets<'a>(rows: &[&'a Row]) -> Vec<&'a str> {
    let mut targets: Vec<&str> = Vec::new();
    for row in rows {
        if !targets.contains(&row.target.as_str()) {
            targets.push(&row.target);
        }
    }
    targets
}

/// A line for each target.
fn summary(rows: &[&Row]) -> String {
    let met = rows.iter().filter(|r| r.met == Some(true)).count();
    let (known, all) = (rows.iter().filter(|r| r.met.is_some()).count(), rows.len());
    let mut text = format!("\n## Targets\n\n{met} of {known} are met; {} more were not measured.\n\n", all - known);
    text += "| target | wanted | measured | met | not measured |\n|---|---|--:|--:|--:|\n";
    for target in targets(rows) {
        let of_target: Vec<&&Row> = rows.iter().filter(|r| r.target == target).collect();
        let values: Vec<f64> = of_target.iter().filter_map(|r| r.value).collect();
        let (least, most) = values.iter().fold((f64::INFINITY, 0.0_f64), |(a, b), v| (a.min(*v), b.max(*v)));
        let span = if values.is_empty() { "-".into() } else { format!("{} to {}", number(least), number(most)) };
        let mut wanted: Vec<&str> = of_target.iter().filter_map(|r| r.wanted.as_deref()).collect();
        wanted.dedup();
        let met = of_target.iter().filter(|r| r.met == Some(true)).count();
        let (known, all, wanted) = (values.len(), of_target.len(), few(wanted));
        let _ = writeln!(text, "| {target} | {wanted} | {span} | {met} of {known} | {} |", all - known);
    }
    text
}

/// Different words, each once.
fn few(mut words: Vec<&str>) -> String {
    words.sort_unstable();
    words.dedup();
    words.join(" or ")
}

/// Every row of a target.
fn details<'a>(target: &str, rows: impl Iterator<Item = &'a &'a Row>) -> String {
    let mut text =
        format!("\n### {target}\n\n| data | case | measured | wanted | met | note |\n|---|---|--:|--:|---|---|\n");
    for Row { data, case, value, wanted, met, note, .. } in rows {
        let value = value.map_or("-".into(), number);
        let met = met.map_or("not measured", |met| if met { "yes" } else { "✗" });
        let wanted = wanted.as_deref().unwrap_or_default();
        let _ = writeln!(text, "| {data} | {case} | {value} | {wanted} | {met} | {note} |");
    }
    text
}

/// A line for each case, and a column for each comparison.
fn matrix(rows: &[&Row]) -> String {
    let targets = targets(rows);
    let mut text = String::from("\n## Beside them, without targets\n\n");
    targets.iter().zip('a'..).for_each(|(target, letter)| text += &format!("- {letter}: {target}\n"));
    let letters: String = targets.iter().zip('a'..).map(|(_, letter)| format!(" {letter} |")).collect();
    let _ = writeln!(text, "\n| data | case |{letters}\n|---|---|{}", "--:|".repeat(targets.len()));
    let mut cases: Vec<(&str, &str)> = Vec::new();
    for row in rows {
        if !cases.contains(&(&row.data, &row.case)) {
            cases.push((&row.data, &row.case));
        }
    }
    for (data, case) in cases {
        let at = |target: &&str| rows.iter().find(|r| (&*r.data, &*r.case, &*r.target) == (data, case, *target));
        let cell = |target| at(target).map_or(String::new(), |r| r.value.map_or("-".into(), number));
        let cells: Vec<String> = targets.iter().map(cell).collect();
        let _ = writeln!(text, "| {data} | {case} | {} |", cells.join(" | "));
    }
    text
}

/// Three digits.
fn number(value: f64) -> String {
    match value.abs() {
        0.0 => "0".into(),
        small if small < 0.01 => format!("{value:.2e}"),
        small if small < 10.0 => format!("{value:.2}"),
        _ => format!("{value:.0}"),
    }
}

/// The curves of time against share, and of time against true error.
fn parts(archive: &Archive) -> String {
    let Archive { data, measured, .. } = archive;
    let mut text = format!("\n## Parts of a view: {}\n\n", data.name);
    text += "For the first file, with the input open: *frames* of a window, a *region* with a share of the voxels, a *close-up*\n";
    text += "this many times larger in a picture of the same size. *Seen*: the voxels in the region and in the picture.\n\n";
    text += "| part | seen | bytes read | seconds | of the whole |\n|---|--:|--:|--:|--:|\n";
    let whole = measured.get(WHOLE);
    let all = whole.map_or(f64::NAN, |m| further(m).processor);
    let mut lines: Vec<(&str, f64, &Measured)> = measured.iter().filter_map(|(key, m)| part(key, m)).collect();
    lines.sort_by(|a, b| a.0.cmp(b.0).then(a.1.total_cmp(&b.1)));
    lines.extend(whole.map(|m| ("whole", 1.0, m)));
    for (name, number, m) in lines {
        let (seen, of_whole) = (100.0 * m.seen.unwrap_or(f64::NAN), 100.0 * further(m).processor / all);
        let _ = writeln!(text, "| {name} {number} | {seen:.2} % | {} | {} | {of_whole:.1} % |", m.bytes, seconds(m));
    }
    text + &looser(archive)
}

/// The kind of a part and its number, if it is one.
fn part<'a>(key: &'a str, m: &'a Measured) -> Option<(&'a str, f64, &'a Measured)> {
    let (name, number) = key.split_once(' ')?;
    ["frames", "region", "close-up"].contains(&name).then_some((name, number.parse().ok()?, m))
}

fn seconds(measured: &Measured) -> String {
    format!("{:.4}", further(measured).processor)
}

/// The keys of the conventional forms' views.
const CONVENTIONAL: [&str; 2] = ["whole direct", "whole textbook"];

fn looser(archive: &Archive) -> String {
    let Archive { data, measured, .. } = archive;
    let empty = Vec::new();
    let errors = measured.get("true errors").map_or(&empty, |m| &m.errors);
    let mut text = format!("\n## Looser views: {}\n\n", data.name);
    text +=
        "For the finest file, limited by the expected error (share of the value range); then the conventional forms.\n";
    text += "Errors are true errors of a few frames, relative to exact pictures of the archive, as shares of the largest pixel.\n\n";
    text += "| limit | seconds | bytes read | largest | rms |\n|---|--:|--:|--:|--:|\n";
    let names = LOOSER.iter().map(|limit| format!("looser {limit:e}"));
    let names = std::iter::once(FINEST.to_string()).chain(names).chain(CONVENTIONAL.map(Into::into));
    for (name, (largest, rms)) in names.zip(errors) {
        let (time, bytes) = measured.get(&name).map_or_else(Default::default, |m| (seconds(m), m.bytes.to_string()));
        let _ = writeln!(text, "| {name} | {time} | {bytes} | {largest:.1e} | {rms:.1e} |");
    }
    text
}

/// Everything that was measured.
fn times(results: &Results) -> String {
    let mut text = String::from("\n## All times\n\n`x1`: one thread. *First*: from opening the input.\n\n");
    text += "| data | what | first, processor | first, clock | further, processor | further, clock | splatting | method | bytes |\n";
    text += "|---|---|--:|--:|--:|--:|--:|---|--:|\n";
    for (data, key, m) in results.archives.iter().flat_map(|a| a.measured.iter().map(|(k, m)| (&a.data.name, k, m))) {
        if m.time.wall > 0.0 {
            let two = |t: Time| format!("{:.4} | {:.4}", t.processor, t.wall);
            let further = m.further.map_or(" | ".into(), two);
            let share = m.splatting.map_or(String::new(), |s| format!("{:.0} %", 100.0 * s));
            let method = m.method.as_deref().unwrap_or_default();
            let _ =
                writeln!(text, "| {data} | {key} | {} | {further} | {share} | {method} | {} |", two(m.time), m.bytes);
        }
    }
    text
}
