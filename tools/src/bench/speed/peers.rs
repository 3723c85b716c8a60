//! Other programs, by the scripts in `tools/peers`.

use super::measured::{Measured, Time};
use super::plan::{Plan, key};
use super::results::Archive;
use super::settings::Config;
use crate::bench::size::Peers;
use crate::bench::size::peers::PeersTask;
use serde::Deserialize;
use wavesplat::base::error::Result;

/// SZ3, every frame by itself.
const SZ3: &str = "sz3-3d";
/// Renderers of `views.py`.
const RENDERERS: [&str; 2] = ["vtk-cpu", "vtk-mesa"];

/// A line of `views.py`; its help says what it means.
#[derive(Deserialize)]
struct Line {
    renderer: String,
    /// Of the processor, and of the clock; none: not measured.
    seconds: Option<(f64, f64)>,
    #[serde(default)]
    why: String,
}

/// Adds what other programs take, or why that is not known.
pub(super) fn add(config: &Config, plan: &Plan<'_>, found: &mut Archive, say: &mut dyn FnMut(&str)) -> Result<()> {
    let Some(peers) = &config.peers else {
        found.missing.extend(all_keys(plan).into_iter().map(|key| (key, "not measured: needs --peers".into())));
        return Ok(());
    };
    say(&format!("measuring other programs on {}", found.data.name));
    sz3(config, peers, plan, found)?;
    for (threads, spacing) in plan.threads.iter().flat_map(|t| plan.spacings.iter().map(|s| (*t, *s))) {
        views(config, peers, (threads, spacing), found)?;
    }
    Ok(())
}

fn sz3(config: &Config, peers: &Peers, plan: &Plan<'_>, found: &mut Archive) -> Result<()> {
    let task = PeersTask {
        data: &found.data.name,
        data_bytes: found.data.bytes,
        path: plan.data.path.as_path(),
        tolerances: &config.tolerances,
        repeats: config.repeats,
        only: Some(SZ3),
    };
    for row in peers.measure(&task)? {
        let time = Time { processor: row.decode_seconds, wall: row.decode_seconds };
        let measured = Measured { time, bytes: row.bytes, ..Measured::default() };
        found.measured.insert(format!("{SZ3} {:e}", row.tolerance), measured);
    }
    Ok(())
}

fn views(config: &Config, peers: &Peers, (threads, spacing): (usize, f64), found: &mut Archive) -> Result<()> {
    let numbers = [("--spacing", spacing), ("--size", config.size as f64), ("--threads", threads as f64)];
    let mut args: Vec<String> = numbers.iter().flat_map(|(name, n)| [(*name).into(), n.to_string()]).collect();
    args.extend(["--repeats".into(), config.repeats.to_string()]);
    let text = peers.views(&found.data.path, &args)?;
    for line in String::from_utf8_lossy(&text).lines() {
        let line: Line = serde_json::from_str(line).map_err(|e| crate::bench::json::bad_json(&peers.script, &e))?;
        let key = key(&line.renderer, None, Some(spacing), threads);
        match line.seconds {
            None => drop(found.missing.insert(key, format!("not measured: {}", line.why))),
            Some((processor, wall)) => {
                let time = Time { processor, wall };
                found.measured.insert(key, Measured { time, ..Measured::default() });
            }
        }
    }
    Ok(())
}

fn all_keys(plan: &Plan<'_>) -> Vec<String> {
    let views = plan.threads.iter().flat_map(|t| plan.spacings.iter().map(|s| (*t, *s)));
    let vtk = views.flat_map(|(t, s)| RENDERERS.map(|name| key(name, None, Some(s), t)));
    vtk.chain(plan.files.iter().map(|f| format!("{SZ3} {:e}", f.tolerance))).collect()
}
