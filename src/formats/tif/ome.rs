//! The XML that the Open Microscopy Environment writes into the first page.

use super::stack::{Stack, positive};
use crate::shared::words::number;
use crate::shared::xml::{attribute, required};
use quick_xml::Reader;
use quick_xml::events::{BytesStart, Event};
use std::collections::BTreeMap;
use wavesplat_core::source::Parsed;

/// Units of length in micrometres, and their names here.
const LENGTHS: [(&str, &str, f64); 8] = [
    ("µm", "um", 1.0),
    ("μm", "um", 1.0),
    ("um", "um", 1.0),
    ("nm", "nm", 1e-3),
    ("Å", "angstrom", 1e-4),
    ("mm", "mm", 1e3),
    ("cm", "cm", 1e4),
    ("m", "m", 1e6),
];

/// Whether a text is such XML.
pub(super) fn is_ome(said: &str) -> bool {
    said.trim_start().starts_with('<') && said.contains("<OME") && said.contains("Pixels")
}

/// Reads the only image.
pub(super) fn parse(said: &str) -> Parsed<Stack> {
    let mut reader = Reader::from_str(said);
    let (mut stack, mut stamps) = (None, BTreeMap::new());
    loop {
        let event = reader.read_event();
        let failed = |e| format!("has OME-XML that is not well-formed at byte {}: {e}", reader.error_position());
        match event.map_err(failed)? {
            Event::Start(e) | Event::Empty(e) if e.local_name().as_ref() == "Plane" => stamp(&e, &mut stamps)?,
            Event::Start(e) | Event::Empty(e) => element(&e, &mut stack)?,
            Event::Eof => {
                let stack: Stack = stack.ok_or("has OME-XML without <Pixels>")?;
                return Ok(with_stamps(stack, &stamps));
            }
            _ => {}
        }
    }
}

/// The times of frames and their units, by their numbers.
type Stamps = BTreeMap<usize, (f64, String)>;

/// Takes the time of the first plane of a frame.
fn stamp(e: &BytesStart<'_>, stamps: &mut Stamps) -> Parsed<()> {
    let get = |name: &str| attribute(e, name)?.map(|text| number::<usize>(&text, name)).transpose();
    let (t, z, c) = (get("TheT")?, get("TheZ")?.unwrap_or(0), get("TheC")?.unwrap_or(0));
    let time = attribute(e, "DeltaT")?.and_then(|text| text.trim().parse::<f64>().ok()).filter(|time| time.is_finite());
    if let (Some(t), Some(time), (0, 0)) = (t, time, (z, c)) {
        let unit = attribute(e, "DeltaTUnit")?.unwrap_or_else(|| "s".into());
        stamps.insert(t, (time, unit));
    }
    Ok(())
}

/// Gives the frames the times of their planes, if no step is said and each has one that is later than the one before, in one
/// unit.
fn with_stamps(stack: Stack, stamps: &Stamps) -> Stack {
    let times: Vec<f64> = stamps.values().map(|(time, _)| *time).collect();
    let Some((_, unit)) = stamps.get(&0).filter(|_| stamps.keys().copied().eq(0..stack.frames)) else { return stack };
    let is_one_unit = stamps.values().all(|(_, other)| other == unit);
    if stack.interval.is_some() || !is_one_unit || times.windows(2).any(|pair| pair[1] <= pair[0]) {
        return stack;
    }
    Stack { interval: Some((1.0, unit.clone())), stamps: times, ..stack }
}

fn element(e: &BytesStart<'_>, stack: &mut Option<Stack>) -> Parsed<()> {
    match (e.local_name().as_ref(), stack) {
        ("Pixels", Some(_)) => Err("has several images in its OME-XML; one is supported".into()),
        ("Pixels", stack) => {
            *stack = Some(pixels(e)?);
            Ok(())
        }
        ("TiffData", Some(stack)) => check_place(e, stack),
        _ => Ok(()),
    }
}

fn pixels(e: &BytesStart<'_>) -> Parsed<Stack> {
    let order = required(e, "DimensionOrder")?;
    let axes: Option<Vec<char>> = order.strip_prefix("XY").map(|rest| rest.chars().collect());
    let axes: [char; 3] = axes
        .and_then(|axes| axes.try_into().ok())
        .ok_or_else(|| format!("has the DimensionOrder {order:?} in its OME-XML, which is not known"))?;
    let mut lengths = [0; 3];
    for (len, axis) in lengths.iter_mut().zip(axes) {
        let name = format!("Size{axis}");
        *len = number(&required(e, &name)?, &name)?;
    }
    let mut stack = Stack::new(axes, lengths)?;
    let steps = ["X", "Y", "Z"].map(|axis| step(e, axis));
    if let Some((unit, micrometres)) = steps.iter().find_map(|step| step.as_ref().map(|(_, unit, of)| (*unit, *of))) {
        stack.space_unit = Some(unit.into());
        stack.spacing = steps.map(|step| step.map_or(1.0, |(length, _, of)| length * of / micrometres));
    }
    let unit = attribute(e, "TimeIncrementUnit")?.unwrap_or_else(|| "s".into());
    let interval = attribute(e, "TimeIncrement")?.and_then(|text| text.trim().parse().ok()).and_then(positive);
    stack.interval = interval.map(|interval| (interval, unit));
    Ok(stack)
}

/// The distance of pixels along an axis, its unit, and how many micrometres this is. None in a unit of no length.
fn step(e: &BytesStart<'_>, axis: &str) -> Option<(f64, &'static str, f64)> {
    let get = |name: &str| attribute(e, name).ok().flatten();
    let length = get(&format!("PhysicalSize{axis}"))?.trim().parse().ok().and_then(positive)?;
    let unit = get(&format!("PhysicalSize{axis}Unit")).unwrap_or_else(|| "µm".into());
    LENGTHS.iter().find(|(name, ..)| *name == unit).map(|(_, called, of)| (length, *called, *of))
}

/// An error if a plane is on another page than the order of axes says.
fn check_place(e: &BytesStart<'_>, stack: &Stack) -> Parsed<()> {
    let get = |name: &str| attribute(e, name)?.map(|text| number::<usize>(&text, name)).transpose();
    let first = |name: &str| Parsed::Ok(get(name)?.unwrap_or(0));
    let (t, z, c) = (first("FirstT")?, first("FirstZ")?, first("FirstC")?);
    if t >= stack.frames || z >= stack.planes || c >= stack.channels {
        return Err(format!("names a plane in its OME-XML that is not there: T {t}, Z {z}, C {c}"));
    }
    let page = stack.page(t, z, c);
    match get("IFD")? {
        Some(found) if found != page => {
            Err(format!("has the plane T {t}, Z {z}, C {c} on page {found}, not {page} as its DimensionOrder says"))
        }
        _ => Ok(()),
    }
}
