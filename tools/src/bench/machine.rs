//! Where and when it ran.

use serde::{Deserialize, Serialize};
use std::fs;
use std::time::{SystemTime, UNIX_EPOCH};
use wavesplat_core::base::time_labels::TimeLabels;

/// What times depend on besides the program.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Machine {
    /// The processor's name, if the system reports it.
    pub cpu: Option<String>,
    /// The number of threads that can run at once; all stages use this number.
    pub cores: usize,
    /// Operating system and architecture.
    pub system: String,
}

impl Machine {
    /// The machine that this runs on.
    pub(super) fn this() -> Self {
        let cores = std::thread::available_parallelism().map_or(1, usize::from);
        Self { cpu: cpu(), cores, system: format!("{} {}", std::env::consts::OS, std::env::consts::ARCH) }
    }
}

/// The first entries of every file of results.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Provenance {
    /// The number of the file's layout.
    pub schema: u32,
    /// The version of the tools.
    pub version: String,
    /// Where it ran.
    pub machine: Machine,
    /// The day it was written.
    pub date: String,
}

impl Provenance {
    /// Here; by default today.
    pub(super) fn here(schema: u32, date: Option<&String>) -> Self {
        let date = date.cloned().unwrap_or_else(today);
        Self { schema, version: env!("CARGO_PKG_VERSION").into(), machine: Machine::this(), date }
    }

    /// The version, the machine and the day.
    pub(super) fn words(&self) -> String {
        let cpu = self.machine.cpu.as_deref().unwrap_or("unknown processor");
        format!("wavesplat {} on {cpu}, {}, {}", self.version, self.machine.system, self.date)
    }
}

fn cpu() -> Option<String> {
    let info = fs::read_to_string("/proc/cpuinfo").ok()?;
    let line = info.lines().find(|line| line.starts_with("model name"))?;
    line.split_once(':').map(|(_, name)| name.trim().into())
}

/// The day of the clock in UTC, as 2024-02-29.
pub(super) fn today() -> String {
    let seconds = SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |d| d.as_secs());
    let day = vec![(seconds / (24 * 60 * 60)) as f64];
    TimeLabels::new(day, Some("days since 1970-01-01"), None).date(0).unwrap_or_default()
}
