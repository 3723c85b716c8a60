//! Describes the metadata of the source that a file keeps.

use serde_json::{Map, Value, json};
use std::fmt::Write;
use wavesplat_core::base::description::{Attribute, Description, NIFTI_HEADER, Values, Variable, coordinates};

/// Attributes that are listed without `--verbose`.
const MOST_ATTRIBUTES: usize = 6;

/// Characters of a value that are shown.
const LONGEST_VALUE: usize = 70;

/// Lines for people.
pub(super) fn text(description: &Description, verbose: bool) -> String {
    let mut text = format!("source     {}: {}\n", description.source, axes(description));
    for axis in 0..3 {
        if let Some(line) = axis_line(description, axis) {
            let _ = writeln!(text, "axis       {line}");
        }
    }
    if description.orientation.is_some() {
        let _ = writeln!(text, "           the directions of the axes are kept");
    }
    let has_line = |along: &usize| axis_line(description, *along).is_some();
    let shown_above = |name: &String| (0..3).filter(has_line).any(|along| name_along(description, along) == Some(name));
    let names = description.variables.iter().map(|variable| &variable.name);
    let others: Vec<&str> = names.filter(|name| !shown_above(name)).map(String::as_str).collect();
    if !others.is_empty() {
        let _ = writeln!(text, "beside     {}", others.join(", "));
    }
    text + &attributes("samples", &description.attributes, verbose) + &attributes("file", &description.global, verbose)
}

/// The axes of the source's array, slowest first.
fn axes(description: &Description) -> String {
    let axis = |axis: &wavesplat_core::base::description::ArrayAxis| {
        let dimension = &description.dimensions[axis.dimension as usize];
        let name = if dimension.name.is_empty() { "axis" } else { &dimension.name };
        let unlimited = if dimension.unlimited { " (unlimited)" } else { "" };
        let reversed = if axis.reversed { " (descending)" } else { "" };
        format!("{name} {}{unlimited}{reversed}", dimension.length)
    };
    description.axes.iter().map(axis).collect::<Vec<_>>().join(", ")
}

/// Name, coordinates and unit of an axis of voxels that has coordinates.
fn axis_line(description: &Description, along: usize) -> Option<String> {
    let at = coordinates(description, along)?;
    let name = name_along(description, along)?;
    let variable = description.variables.iter().find(|variable| variable.name == *name)?;
    let unit = variable.attributes.iter().find(|attribute| attribute.name == "units");
    let unit = unit.map_or(String::new(), |unit| format!(" {}", shown(&unit.value)));
    let (first, last) = (at.first()?, at.last()?);
    let steps: Vec<f64> = at.windows(2).map(|pair| (pair[1] - pair[0]).abs()).collect();
    let (least, largest) = steps.iter().fold((f64::INFINITY, 0.0_f64), |(a, b), step| (a.min(*step), b.max(*step)));
    let irregular = match largest > least * (1.0 + 1e-3) {
        true => format!(", irregular: steps of {least} to {largest}"),
        false => String::new(),
    };
    let letter = ["x", "y", "z"][along];
    let shown_name = if name == letter { letter.to_string() } else { format!("{letter} is {name}") };
    Some(format!("{shown_name}: {first} to {last}{unit}{irregular}"))
}

/// The name of an axis of voxels.
fn name_along(description: &Description, along: usize) -> Option<&String> {
    let dimension = description.axes.iter().find(|axis| axis.role.voxels() == Some(along))?.dimension;
    Some(&description.dimensions[dimension as usize].name)
}

fn attributes(owner: &str, all: &[Attribute], verbose: bool) -> String {
    let all: Vec<&Attribute> = all.iter().filter(|attribute| attribute.name != NIFTI_HEADER).collect();
    let count = if verbose { all.len() } else { all.len().min(MOST_ATTRIBUTES) };
    let mut text = String::new();
    for attribute in &all[..count] {
        let _ = writeln!(text, "{owner:<10} {} = {}", attribute.name, shown(&attribute.value));
    }
    if count < all.len() {
        let _ = writeln!(text, "           and {} more attributes; -v shows all", all.len() - count);
    }
    text
}

/// A value in one line, shortened.
fn shown(values: &Values) -> String {
    let words: String = match values {
        Values::Texts(texts) => texts.join(", "),
        Values::Numbers(numbers) => numbers.to_f64().iter().map(f64::to_string).collect::<Vec<_>>().join(", "),
        Values::Times(_) => "the times of the frames".into(),
    };
    let line: String = words.chars().map(|c| if c.is_control() { ' ' } else { c }).collect();
    match line.chars().count() > LONGEST_VALUE {
        true => line.chars().take(LONGEST_VALUE).chain("...".chars()).collect(),
        false => line,
    }
}

/// The key `description` of `--json`. Arrays of more than one dimension are described without their values.
pub(super) fn json(description: &Description) -> Value {
    let dimensions: Vec<Value> = description
        .dimensions
        .iter()
        .map(|d| json!({ "name": d.name, "length": d.length, "unlimited": d.unlimited }))
        .collect();
    let axes: Vec<Value> = description
        .axes
        .iter()
        .map(|a| json!({ "dimension": a.dimension, "counts": format!("{:?}", a.role).to_lowercase(), "reversed": a.reversed }))
        .collect();
    let orientation = description
        .orientation
        .as_ref()
        .map(|o| json!({ "space": o.space, "first": o.first, "directions": o.directions, "spacing": o.spacing }));
    json!({
        "source": description.source,
        "dimensions": dimensions,
        "axes": axes,
        "attributes": attributes_json(&description.attributes),
        "global": attributes_json(&description.global),
        "variables": description.variables.iter().map(variable_json).collect::<Vec<_>>(),
        "orientation": orientation,
    })
}

fn variable_json(variable: &Variable) -> Value {
    let mut object = Map::new();
    object.insert("name".into(), json!(variable.name));
    object.insert("dimensions".into(), json!(variable.dimensions));
    object.insert("attributes".into(), attributes_json(&variable.attributes));
    if variable.dimensions.len() < 2 && !matches!(variable.values, Values::Times(_)) {
        object.insert("values".into(), values_json(&variable.values));
    }
    Value::Object(object)
}

fn attributes_json(all: &[Attribute]) -> Value {
    all.iter().map(|attribute| (attribute.name.clone(), values_json(&attribute.value))).collect::<Map<_, _>>().into()
}

/// One value alone, several as a list.
fn values_json(values: &Values) -> Value {
    let all: Vec<Value> = match values {
        Values::Texts(texts) => texts.iter().map(|text| json!(text)).collect(),
        Values::Numbers(numbers) => numbers.to_f64().into_iter().map(|number| json!(number)).collect(),
        Values::Times(_) => Vec::new(),
    };
    if let [only] = all.as_slice() { only.clone() } else { Value::Array(all) }
}
