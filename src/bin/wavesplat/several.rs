//! Several variables of an archive, each converted to a file of its own.

use super::convert::ConvertArgs;
use std::collections::BTreeSet;
use std::path::PathBuf;
use wavesplat::base::error::{Error, Result};

/// What stands for the name of a variable in the name of the output.
const NAME: &str = "%n";

/// The word for all variables.
const ALL: &str = "all";

/// The commands for each of several variables; none if one is meant.
pub(super) fn commands(args: &ConvertArgs) -> Result<Option<Vec<ConvertArgs>>> {
    let Some(names) = names(args)? else { return Ok(None) };
    let mut outputs = BTreeSet::new();
    let command = |name: String| {
        let output = output(args, &name)?;
        if !outputs.insert(output.clone()) {
            return Err(Error::usage(format!("{}: two variables would be written here", output.display())));
        }
        let mut one = args.clone();
        one.input.variable = Some(name);
        one.output = output;
        Ok(one)
    };
    names.into_iter().map(command).collect::<Result<Vec<_>>>().map(Some)
}

/// The names of several variables; none if one is meant.
fn names(args: &ConvertArgs) -> Result<Option<Vec<String>>> {
    match args.input.variable.as_deref() {
        Some(ALL) => {
            let mut input = args.input.clone();
            input.variable = None;
            let all = input.undecided(&args.inputs, args.common.stream_memory())?;
            let components = |variable: &wavesplat::source::VariableInfo| match variable.components {
                1 => vec![variable.name.clone()],
                n => (0..n).map(|component| format!("{}[{component}]", variable.name)).collect(),
            };
            match all.is_empty() {
                true => Err(Error::usage("--variable all: the input has one variable; leave the option out")),
                false => Ok(Some(all.iter().flat_map(components).collect())),
            }
        }
        Some(list) if list.contains(',') => Ok(Some(list.split(',').map(|name| name.trim().into()).collect())),
        _ => Ok(None),
    }
}

/// The output for a variable, whose name has no separators and brackets there.
fn output(args: &ConvertArgs, name: &str) -> Result<PathBuf> {
    let pattern = args.output.to_string_lossy();
    if !pattern.contains(NAME) {
        let what = "several variables need %n for the name of each, as in run_%n.wspl";
        return Err(Error::usage(format!("{pattern}: {what}")));
    }
    let plain: String = name.chars().map(|c| if c.is_alphanumeric() || "-.".contains(c) { c } else { '_' }).collect();
    Ok(pattern.replace(NAME, plain.trim_matches('_')).into())
}
