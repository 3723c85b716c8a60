//! Several variables of an archive, each converted to a file of its own.

use super::convert::{self, ConvertArgs};
use crate::InputArgs;
use std::collections::BTreeSet;
use std::path::PathBuf;
use wavesplat_core::base::error::{Error, Result};

/// The placeholder for a variable's name in the name of the output.
const NAME: &str = "%n";

/// The word for all variables.
const ALL: &str = "all";

/// Converts one variable, or several.
pub(super) fn run(args: &ConvertArgs) -> Result<()> {
    args.common.start()?;
    match commands(args)? {
        Some(commands) => commands.iter().try_for_each(convert::run),
        None => convert::run(args),
    }
}

/// The commands for each of several variables; none if one is meant.
fn commands(args: &ConvertArgs) -> Result<Option<Vec<ConvertArgs>>> {
    let Some(names) = names(args)? else { return Ok(None) };
    let mut outputs = BTreeSet::new();
    let command = |Chosen { variable, name }: Chosen| {
        let output = output(args, &name)?;
        if !outputs.insert(output.clone()) {
            return Err(Error::usage(format!("{}: two variables would be written here", output.display())));
        }
        let mut one = args.clone();
        one.input.variable = variable;
        one.output = output;
        Ok(one)
    };
    names.into_iter().map(command).collect::<Result<Vec<_>>>().map(Some)
}

/// A variable to convert.
struct Chosen {
    /// The value of `--variable`; none for the only variable of an archive.
    variable: Option<String>,
    name: String,
}

impl From<String> for Chosen {
    fn from(name: String) -> Self {
        Self { variable: Some(name.clone()), name }
    }
}

/// Several variables; none if one is meant.
fn names(args: &ConvertArgs) -> Result<Option<Vec<Chosen>>> {
    match args.input.variable.as_deref() {
        Some(ALL) => {
            let mut input = args.input.clone();
            input.variable = None;
            let all = input.undecided(&args.inputs, args.common.stream_memory())?;
            let components = |variable: &wavesplat_core::source::VariableInfo| match variable.components {
                1 => vec![variable.name.clone()],
                n => (0..n).map(|component| format!("{}[{component}]", variable.name)).collect(),
            };
            match all.is_empty() {
                true => only(args, &input).map(|only| Some(vec![only])),
                false => Ok(Some(all.iter().flat_map(components).map(Chosen::from).collect())),
            }
        }
        Some(list) if list.contains(',') => {
            Ok(Some(list.split(',').map(|name| Chosen::from(name.trim().to_string())).collect()))
        }
        _ => Ok(None),
    }
}

/// The only variable of an archive.
fn only(args: &ConvertArgs, input: &InputArgs) -> Result<Chosen> {
    let source = input.open_quietly(&args.inputs, args.common.stream_memory())?;
    Ok(Chosen { variable: None, name: source.archive().variable.clone().unwrap_or_else(|| "values".into()) })
}

/// The output for a variable. In its name, letters, digits, `-` and `.` stay, and all else becomes `_`.
fn output(args: &ConvertArgs, name: &str) -> Result<PathBuf> {
    let pattern = args.output.to_string_lossy();
    if !pattern.contains(NAME) {
        let what = "several variables need %n for the name of each, as in run_%n.wspl";
        return Err(Error::usage(format!("{pattern}: {what}")));
    }
    let plain: String = name.chars().map(|c| if c.is_alphanumeric() || "-.".contains(c) { c } else { '_' }).collect();
    Ok(pattern.replace(NAME, plain.trim_matches('_')).into())
}
