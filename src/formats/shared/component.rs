//! One component of a vector, as the option `variable` names it.

use wavesplat_core::base::error::{Note, Remedy};
use wavesplat_core::source::Advised;

/// A variable's name, and its component if one is given: `velocity[1]` and `velocity[y]` are the second component.
pub(crate) fn named(variable: &str) -> (&str, Option<usize>) {
    let Some((name, index)) = variable.strip_suffix(']').and_then(|text| text.rsplit_once('[')) else {
        return (variable, None);
    };
    let letter = ["x", "y", "z"].iter().position(|letter| *letter == index);
    match letter.or(index.parse().ok()) {
        Some(index) => (name, Some(index)),
        None => (variable, None),
    }
}

/// The index of a component; the error lists the valid forms.
pub(crate) fn chosen(name: &str, components: usize, index: Option<usize>) -> Advised<usize> {
    match index {
        _ if components == 0 => Err(format!("{name} has no component").into()),
        Some(index) if index < components => Ok(index),
        Some(index) => Err(format!("{name} has {components} component(s), none with number {index}").into()),
        None if components == 1 => Ok(0),
        None => {
            let remedy = Remedy::ChooseComponent { name: name.into(), components };
            Err(Note::with(format!("{name} has {components} components"), remedy))
        }
    }
}

/// Finds the component of a file's only array that the option `variable` names, and its name. If an array without a
/// name needs one, it is `samples`.
pub(crate) fn only_array(
    own: Option<&str>,
    components: usize,
    variable: Option<&str>,
) -> Advised<(usize, Option<String>)> {
    let name = own.unwrap_or("samples");
    let (asked, index) = match variable {
        None => (name, None),
        Some(text) if text == name => (name, None),
        Some(text) => named(text),
    };
    if asked != name && !asked.is_empty() {
        return Err(format!("has no array {asked}; its only one is called {name}").into());
    }
    let index = chosen(name, components, index)?;
    let called = if components > 1 { Some(label(name, components, index)) } else { own.map(String::from) };
    Ok((index, called))
}

/// The number of an array, and of a component of it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Chosen {
    /// Which of the arrays.
    pub(crate) array: usize,
    /// Which of its components.
    pub(crate) component: usize,
}

/// The array that the option `variable` names, else the active one, else the only one. Arrays have a name and some
/// components.
pub(crate) fn choose(arrays: &[(&str, usize)], active: Option<usize>, variable: Option<&str>) -> Advised<Chosen> {
    let names = || arrays.iter().map(|(name, _)| *name).collect::<Vec<_>>().join(", ");
    let find = |wanted: &str| arrays.iter().position(|(name, _)| *name == wanted);
    let (array, index) = match (variable, active, arrays) {
        (_, _, []) => return Err("has no point or cell array".into()),
        (Some(variable), ..) => match (find(variable), named(variable)) {
            (Some(array), _) => (array, None),
            (None, (name, index)) => {
                (find(name).ok_or_else(|| format!("has no array {name}; it has {}", names()))?, index)
            }
        },
        (None, Some(array), _) => (array, None),
        (None, None, [_]) => (0, None),
        (None, None, _) => {
            let what = format!("has several arrays and none is active: {}", names());
            return Err(Note::with(what, Remedy::ChooseVariable));
        }
    };
    let (name, components) = arrays[array];
    Ok(Chosen { array, component: chosen(name, components, index)? })
}

/// Whether [`choose`] cannot choose an array and its component without the option `variable`.
pub(crate) fn is_undecided(arrays: &[(&str, usize)], active: Option<usize>) -> bool {
    match (active, arrays) {
        (_, []) => false,
        (Some(array), _) => arrays[array].1 > 1,
        (None, [(_, components)]) => *components > 1,
        (None, _) => true,
    }
}

/// The name of a component: that of its array, if the array has only one.
pub(crate) fn label(name: &str, components: usize, component: usize) -> String {
    if components == 1 { name.into() } else { format!("{name}[{component}]") }
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
        assert!(chosen("v", 3, None).is_err() && chosen("v", 3, Some(3)).is_err() && chosen("v", 0, None).is_err());
        assert_eq!([label("v", 1, 0), label("v", 3, 1)], ["v", "v[1]"]);
    }

    #[test]
    fn an_array_is_the_named_the_active_or_the_only_one() {
        let arrays = [("p", 1), ("v", 3), ("v[1]", 1)];
        let ok = |array, component| Ok(Chosen { array, component });
        assert_eq!(choose(&arrays, Some(0), None), ok(0, 0));
        assert_eq!(choose(&arrays, None, Some("v[z]")), ok(1, 2));
        assert_eq!(choose(&arrays, None, Some("v[1]")), ok(2, 0));
        assert_eq!(choose(&arrays[..1], None, None), ok(0, 0));
        for (active, variable) in [(None, None), (Some(1), None), (None, Some("q")), (None, Some("v[3]"))] {
            assert!(choose(&arrays, active, variable).is_err());
        }
        assert!(choose(&[], None, Some("p")).is_err());
        for (arrays, active) in [(&arrays[..], None), (&arrays, Some(0)), (&arrays, Some(1)), (&arrays[..1], None)] {
            assert_eq!(is_undecided(arrays, active), choose(arrays, active, None).is_err());
        }
        assert!(!is_undecided(&[], None) && !is_undecided(&[], Some(0)));
    }

    #[test]
    fn the_only_array_may_go_unnamed() {
        let found = |own, components, variable| only_array(own, components, variable).map_err(|_| ());
        assert_eq!(found(None, 1, None), Ok((0, None)));
        assert_eq!(found(Some("a[1]"), 1, Some("a[1]")), Ok((0, Some("a[1]".into()))));
        assert_eq!(found(None, 3, Some("samples[z]")), Ok((2, Some("samples[2]".into()))));
        assert_eq!(found(Some("v"), 3, Some("[1]")), Ok((1, Some("v[1]".into()))));
        for refused in [found(None, 3, None), found(None, 1, Some("a")), found(Some("v"), 3, Some("w[0]"))] {
            assert_eq!(refused, Err(()));
        }
    }
}
