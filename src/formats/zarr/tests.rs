//! Tests of stores: what OME-Zarr says of axes, and links.

use crate::open;
use crate::testing::{DIMS, Folder, check_inputs, payload, refused};
use serde_json::{Value, json};
use std::fs;
use std::path::{Path, PathBuf};
use wavesplat_core::base::sample::SampleType;
use wavesplat_core::source::{Archive, OpenOptions};

const TY: SampleType = SampleType::I16;

fn put(path: &Path, value: &Value) {
    fs::write(path, value.to_string()).expect("writing");
}

/// An array of version 2 with a chunk for each item of its first axis.
fn array(folder: &Path, lengths: &[usize], bytes: &[u8]) {
    fs::create_dir_all(folder).expect("a folder");
    let mut chunks = lengths.to_vec();
    chunks[0] = 1;
    let said = json!({
        "zarr_format": 2, "shape": lengths, "chunks": chunks, "dtype": "<i2", "compressor": null, "fill_value": 0,
        "filters": null, "order": "C"
    });
    put(&folder.join(".zarray"), &said);
    for (t, chunk) in bytes.chunks(bytes.len() / lengths[0]).enumerate() {
        let rest = vec!["0"; lengths.len() - 1].join(".");
        fs::write(folder.join(format!("{t}.{rest}")), chunk).expect("writing");
    }
}

/// A store of these attributes.
fn store(folder: &Folder, name: &str, attributes: &Value) -> PathBuf {
    let store = folder.path(name);
    fs::create_dir_all(&store).expect("a folder");
    put(&store.join(".zgroup"), &json!({ "zarr_format": 2 }));
    put(&store.join(".zattrs"), attributes);
    store
}

fn space(unit: &str) -> Vec<Value> {
    ["z", "y", "x"].iter().map(|name| json!({ "name": name, "type": "space", "unit": unit })).collect()
}

fn axes(before: &[Value], unit: &str) -> Vec<Value> {
    before.iter().cloned().chain(space(unit)).collect()
}

fn named(variable: &str) -> OpenOptions {
    OpenOptions { variable: Some(variable.into()), ..OpenOptions::default() }
}

fn archive(store: &Path, options: &OpenOptions) -> Archive {
    open(&[store.to_path_buf()], options).expect("opening").archive().clone()
}

/// Frames with a second channel of zeros before the first.
fn channels(frames: usize) -> Vec<u8> {
    let all = payload(TY, 0..frames, false);
    all.chunks(all.len() / frames).flat_map(|frame| [vec![0; frame.len()], frame.to_vec()].concat()).collect()
}

#[test]
fn channels_scales_and_times_are_believed() {
    let folder = Folder::new();
    let [x, y, z] = DIMS;
    let before = [json!({ "name": "t", "type": "time", "unit": "second" }), json!({ "name": "c", "type": "channel" })];
    let transformations = json!([
        { "type": "scale", "scale": [2.0, 1.0, 0.5, 0.25, 0.25] },
        { "type": "translation", "translation": [10.0, 0.0, 1.0, 0.0, -4.0] }
    ]);
    let image = json!({
        "version": "0.4", "axes": axes(&before, "micrometer"),
        "datasets": [{ "path": "0", "coordinateTransformations": transformations }]
    });
    for (name, attributes) in
        [("a.zarr", json!({ "multiscales": [image] })), ("b.zarr", json!({ "ome": { "multiscales": [image] } }))]
    {
        let store = store(&folder, name, &attributes);
        array(&store.join("0"), &[4, 2, z, y, x], &channels(4));
        refused(
            std::slice::from_ref(&store),
            &OpenOptions::default(),
            "axis channel of length 2 counts neither voxels nor frames",
        );
        check_inputs(std::slice::from_ref(&store), &named("0[1]"), TY, 4);
        let found = archive(&store, &named("0[1]"));
        assert_eq!((found.grid.spacing, found.grid.origin), ([0.25, 0.25, 0.5], [-4.0, 0.0, 1.0]));
        assert_eq!(found.times, [10.0, 12.0, 14.0, 16.0]);
        assert_eq!((found.units.times.as_deref(), found.units.space.as_deref()), (Some("s"), Some("um")));
    }
}

#[test]
fn channels_alone_are_no_frames_and_units_are_converted() {
    let folder = Folder::new();
    let [x, y, z] = DIMS;
    let mut all = axes(&[json!({ "name": "c", "type": "channel" })], "nanometer");
    all[1]["unit"] = json!("micrometer");
    let image = json!({
        "version": "0.4", "axes": all, "coordinateTransformations": [{ "type": "scale", "scale": [1, 2, 2, 2] }],
        "datasets": [{ "path": "s0", "coordinateTransformations": [{ "type": "scale", "scale": [1, 1, 125, 125] }] }]
    });
    let store = store(&folder, "a.zarr", &json!({ "multiscales": [image] }));
    array(&store.join("s0"), &[2, z, y, x], &channels(1));
    refused(std::slice::from_ref(&store), &OpenOptions::default(), "counts neither voxels nor frames");
    check_inputs(std::slice::from_ref(&store), &named("s0[1]"), TY, 1);
    let found = archive(&store, &named("s0[1]"));
    assert_eq!((found.grid.spacing, found.units.space.as_deref()), ([250.0, 250.0, 2000.0], Some("nm")));
}

#[test]
fn the_finest_resolution_is_read_unless_another_is_named() {
    let folder = Folder::new();
    let [x, y, z] = DIMS;
    let dataset = |path: &str, scale: f64| json!({ "path": path, "coordinateTransformations": [{ "type": "scale", "scale": [1.0, 1.0, scale, scale] }] });
    let image = json!({
        "version": "0.4", "axes": axes(&[json!({ "name": "t", "type": "time" })], ""),
        "datasets": [dataset("0", 0.5), dataset("1", 1.5)]
    });
    let store = store(&folder, "a.zarr", &json!({ "multiscales": [image] }));
    array(&store.join("0"), &[4, z, y, x], &payload(TY, 0..4, false));
    array(&store.join("1"), &[4, z, y, x], &payload(TY, 0..4, false)); // as large, but elsewhere
    check_inputs(std::slice::from_ref(&store), &OpenOptions::default(), TY, 4);
    assert_eq!(archive(&store, &OpenOptions::default()).grid.spacing, [0.5, 0.5, 1.0]);
    assert_eq!(archive(&store, &named("1")).grid.spacing, [1.5, 1.5, 1.0]);
    assert_eq!(archive(&store, &named("0")).times, Vec::<f64>::new(), "no scale and no unit of time");
}

#[test]
fn axes_are_those_of_early_versions_or_of_the_names() {
    let folder = Folder::new();
    let [x, y, z] = DIMS;
    let early =
        store(&folder, "a.zarr", &json!({ "multiscales": [{ "version": "0.2", "datasets": [{ "path": "0" }] }] }));
    array(&early.join("0"), &[4, 2, z, y, x], &channels(4));
    check_inputs(&[early], &named("0[1]"), TY, 4);
    let names = json!([{ "version": "0.3", "axes": ["t", "z", "y", "x"], "datasets": [{ "path": "0" }] }]);
    let third = store(&folder, "b.zarr", &json!({ "multiscales": names }));
    array(&third.join("0"), &[4, z, y, x], &payload(TY, 0..4, false));
    check_inputs(std::slice::from_ref(&third), &OpenOptions::default(), TY, 4);
    assert!(archive(&third, &OpenOptions::default()).notes.is_empty(), "nothing is guessed");
    let wrong = store(&folder, "c.zarr", &json!({ "multiscales": [{ "axes": 7 }] }));
    refused(&[wrong], &OpenOptions::default(), "the multiscales of the group / cannot be read");
}

#[cfg(unix)]
#[test]
fn a_link_to_a_chunk_that_is_gone_is_named() {
    let folder = Folder::new();
    let [x, y, z] = DIMS;
    let store = store(&folder, "a.zarr", &json!({}));
    array(&store.join("u"), &[4, z, y, x], &payload(TY, 0..4, false));
    let chunk = store.join("u/2.0.0.0");
    fs::remove_file(&chunk).expect("removing");
    std::os::unix::fs::symlink("/moved/away", &chunk).expect("a link");
    refused(&[store], &OpenOptions::default(), "2.0.0.0: is a link to /moved/away, which cannot be opened");
}
