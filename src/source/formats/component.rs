//! One component of a vector, as `--variable` names it.

use crate::source::Parsed;

/// A variable's name, and the component that is meant, if any is: `velocity[1]` and `velocity[y]` are the second one.
pub(in crate::source) fn named(variable: &str) -> (&str, Option<usize>) {
    let Some((name, index)) = variable.strip_suffix(']').and_then(|text| text.rsplit_once('[')) else {
        return (variable, None);
    };
    let letter = ["x", "y", "z"].iter().position(|letter| *letter == index);
    match letter.or(index.parse().ok()) {
        Some(index) => (name, Some(index)),
        None => (variable, None),
    }
}

/// Which of some components is meant; an error that says how to say it.
pub(in crate::source) fn chosen(name: &str, components: usize, index: Option<usize>) -> Parsed<usize> {
    match index {
        Some(index) if index < components => Ok(index),
        Some(index) => Err(format!("{name} has {components} component(s), none with number {index}")),
        None if components == 1 => Ok(0),
        None => {
            let last = components - 1;
            Err(format!("{name} has {components} components: --variable '{name}[0]' takes the first, up to [{last}]"))
        }
    }
}

/// Which component of a file's only array `--variable` means, and what that is called. An array without a name is called
/// `samples` where it needs one.
pub(in crate::source) fn of_only(
    own: Option<&str>,
    components: usize,
    variable: Option<&str>,
) -> Parsed<(usize, Option<String>)> {
    let name = own.unwrap_or("samples");
    let (asked, index) = match variable {
        None => (name, None),
        Some(text) if text == name => (name, None),
        Some(text) => named(text),
    };
    if asked != name && !asked.is_empty() {
        return Err(format!("has no array {asked}; its only one is called {name}"));
    }
    let index = chosen(name, components, index)?;
    let called = if components > 1 { Some(format!("{name}[{index}]")) } else { own.map(String::from) };
    Ok((index, called))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn components_have_numbers_and_letters() {
        assert_eq!(named("v"), ("v", None));
        assert_eq!(named("v[2]"), ("v", Some(2)));
        assert_eq!(named("a[1][y]"), ("a[1]", Some(1)));
        assert_eq!(named("v[w]"), ("v[w]", None));
        assert_eq!((chosen("v", 1, None), chosen("v", 3, Some(2))), (Ok(0), Ok(2)));
        assert!(chosen("v", 3, None).is_err() && chosen("v", 3, Some(3)).is_err());
    }

    #[test]
    fn the_only_array_may_go_unnamed() {
        let found = |own, components, variable| of_only(own, components, variable).map_err(|_| ());
        assert_eq!(found(None, 1, None), Ok((0, None)));
        assert_eq!(found(Some("a[1]"), 1, Some("a[1]")), Ok((0, Some("a[1]".into()))));
        assert_eq!(found(None, 3, Some("samples[z]")), Ok((2, Some("samples[2]".into()))));
        assert_eq!(found(Some("v"), 3, Some("[1]")), Ok((1, Some("v[1]".into()))));
        for refused in [found(None, 3, None), found(None, 1, Some("a")), found(Some("v"), 3, Some("w[0]"))] {
            assert_eq!(refused, Err(()));
        }
    }
}
