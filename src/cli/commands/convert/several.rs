//! Several variables of an archive, each converted to a file of its own.

use super::{ConvertArgs, Files, error_of, speed};
use crate::{CommonArgs, InputArgs};
use std::collections::BTreeSet;
use std::path::PathBuf;
use std::time::Instant;
use wavesplat_core::base::error::{Error, Result};
use wavesplat_core::source::VariableInfo;
use wavesplat_engine::convert::{Task, run_together};

/// The placeholder for a variable's name in the name of the output.
const NAME: &str = "%n";

/// The word for all variables.
const ALL: &str = "all";

/// Converts variables side by side, each as its own command would. One that fails does not end the others.
pub(super) fn run(several: &Several) -> Result<()> {
    let started = Instant::now();
    let (opened, mut failed) = several.open()?;
    let (commands, tasks): (Vec<_>, Vec<_>) = opened.into_iter().unzip();
    let requests: Vec<_> = tasks.iter().map(|task| task.request.clone()).collect();
    let common = &several.asked.common;
    let progress = common.progress("convert", "blocks");
    let outcomes = run_together(tasks, several.asked.force, several.asked.if_unfinished(), &progress);
    drop(progress); // clears its bar before notes are printed
    let outcomes = outcomes.map_err(|failure| error_of(failure, common))?;
    let bytes: u64 = outcomes.iter().filter_map(|outcome| Some(outcome.as_ref().ok()?.as_ref()?.input_bytes)).sum();
    for ((args, request), outcome) in commands.iter().zip(&requests).zip(outcomes) {
        failed.extend(args.report(outcome, request, Files::Several).err().map(|error| (&args.output, error)));
    }
    if bytes > 0 {
        let count = several.commands.len() - failed.len();
        common.note(format_args!("{count} variable(s){}", speed(bytes as f64, started.elapsed().as_secs_f64())));
    }
    several.report(failed)
}

/// The commands for several variables.
pub(super) struct Several {
    /// The command that asks for all of them.
    asked: ConvertArgs,
    commands: Vec<ConvertArgs>,
}

/// Commands whose frames were opened, and the outputs of those that failed.
type Opened<'a> = (Vec<(&'a ConvertArgs, Task)>, Vec<(&'a PathBuf, Error)>);

impl Several {
    /// Opens the frames of each variable. A variable that was named must have some; of all, those without frames fail alone.
    fn open(&self) -> Result<Opened<'_>> {
        let (mut opened, mut failed) = (Vec::new(), Vec::new());
        for args in &self.commands {
            match args.task() {
                Ok(task) => opened.push((args, task)),
                Err(error @ Error::Input { .. }) if self.are_all() => failed.push((&args.output, error)),
                Err(error) => return Err(error),
            }
        }
        Ok((opened, failed))
    }

    fn are_all(&self) -> bool {
        self.asked.input.variable.as_deref() == Some(ALL)
    }

    /// Names the outputs that failed. The last error is that of the command.
    fn report(&self, mut failed: Vec<(&PathBuf, Error)>) -> Result<()> {
        let Some((output, last)) = failed.pop() else { return Ok(()) };
        for (output, error) in failed {
            self.asked.common.note(format_args!("{}: not converted: {error}", output.display()));
        }
        self.asked.common.note(format_args!("{}: not converted", output.display()));
        Err(last)
    }
}

/// The commands for each of several variables; none if one is meant.
pub(super) fn several(args: &ConvertArgs) -> Result<Option<Several>> {
    let Some(names) = names(args)? else { return Ok(None) };
    let in_turn = names.len();
    let mut outputs = BTreeSet::new();
    let command = |Chosen { variable, name }: Chosen| {
        let output = output(args, &name)?;
        if !outputs.insert(output.clone()) {
            return Err(Error::usage(format!("{}: two variables would be written here", output.display())));
        }
        let mut one = args.clone();
        (one.input.variable, one.input.in_turn) = (variable, in_turn);
        one.output = output;
        Ok(one)
    };
    let commands = names.into_iter().map(command).collect::<Result<_>>()?;
    Ok(Some(Several { asked: args.clone(), commands }))
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
            let mut all = input.variables(&args.inputs, args.common.stream_memory())?;
            all.retain(|variable| is_supported(variable, &args.common));
            let components = |variable: &VariableInfo| match variable.components {
                1 => vec![variable.name.clone()],
                n => (0..n).map(|component| format!("{}[{component}]", variable.name)).collect(),
            };
            let names: Vec<String> = all.iter().flat_map(components).collect();
            match names.len() {
                0 | 1 => only(args, &input).map(|only| Some(vec![only])),
                _ => Ok(Some(names.into_iter().map(Chosen::from).collect())),
            }
        }
        Some(list) if list.contains(',') => {
            Ok(Some(list.split(',').map(|name| Chosen::from(name.trim().to_string())).collect()))
        }
        _ => Ok(None),
    }
}

/// Whether a variable has samples of a supported type; if not, a note says so.
fn is_supported(variable: &VariableInfo, common: &CommonArgs) -> bool {
    if !variable.has_samples() {
        common.note(format_args!("{}: left out, since {} is no type of samples", variable.name, variable.sample));
    }
    variable.has_samples()
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
