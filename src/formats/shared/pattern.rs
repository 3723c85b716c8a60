//! File names from a printf pattern and a range of numbers.

use wavesplat_core::source::Parsed;

/// The count of numbers from the first to the last, both included.
pub(crate) fn count(first: i64, last: i64, step: i64) -> Parsed<usize> {
    let wrong = || format!("data file numbers from {first} to {last} in steps of {step} make no sense");
    let span = last.checked_sub(first).ok_or_else(wrong)?;
    let steps = span.checked_div(step).filter(|n| *n >= 0).ok_or_else(wrong)?;
    usize::try_from(steps).ok().and_then(|n| n.checked_add(1)).ok_or_else(wrong)
}

/// Names from a pattern with one `%d`, perhaps with a width such as `%03d`: of `count` numbers from the first on. There
/// are as many as [`count`] says.
pub(crate) fn names(
    pattern: &str,
    first: i64,
    count: usize,
    step: i64,
) -> Parsed<impl Iterator<Item = String> + use<>> {
    let wrong = || format!("data file pattern {pattern:?} needs one number such as %d or %03d");
    let (before, rest) = pattern.split_once('%').ok_or_else(wrong)?;
    let end = rest.find(|c: char| !c.is_ascii_digit()).ok_or_else(wrong)?;
    let (digits, after) = rest.split_at(end);
    let after = after.strip_prefix(['d', 'i', 'u']).filter(|a| !a.contains('%')).ok_or_else(wrong)?;
    let width: usize = if digits.is_empty() { 0 } else { digits.parse().map_err(|_| wrong())? };
    if width > 64 {
        return Err(wrong());
    }
    let (before, after, zeros) = (before.to_string(), after.to_string(), digits.starts_with('0'));
    let name = move |number: i64| match zeros {
        true => format!("{before}{number:0width$}{after}"),
        false => format!("{before}{number:width$}{after}"),
    };
    Ok((0..count as i64).map(move |i| name(first + i * step)))
}
