//! Memory of a process and all that it started: what it took at most, and how much it may take.

use std::sync::Arc;
use std::sync::OnceLock;
use std::sync::atomic::{AtomicU64, Ordering};

use super::tree;

/// The part of the machine's memory that an engine may have.
const SHARE: f64 = 0.8;

/// The environment variable that says how much an engine may have, in MiB.
const VARIABLE: &str = "LUXPROOF_ENGINE_MEMORY_MIB";

/// The largest resident memory of any process of a job so far; clones share it.
#[derive(Clone, Debug, Default)]
pub struct PeakMemory(Arc<AtomicU64>);

impl PeakMemory {
    /// In MiB; `None` where no process was seen, or the system does not tell.
    pub fn mib(&self) -> Option<f64> {
        let kib = self.0.load(Ordering::Relaxed);
        (kib > 0).then_some(kib as f64 / 1024.0)
    }

    /// Looks at this process.
    pub fn look_at_self(&self) {
        self.heed(std::process::id());
    }

    /// Looks at processes that run; MiB that they have together where that is more than the limit.
    pub(super) fn look_at(&self, processes: &[u32]) -> Option<u64> {
        let together: u64 = processes.iter().map(|process| self.heed(*process)).sum();
        // What forks share with their parents was counted for each: a closer look takes longer.
        let really = exceeds_limit(together).then(|| processes.iter().filter_map(|p| tree::proportional_kib(*p)).sum());
        really.filter(|kib| exceeds_limit(*kib)).map(|kib| kib / 1024)
    }

    /// KiB that a process has now.
    fn heed(&self, process: u32) -> u64 {
        // rusage would do after the end, but counts what a fork shares with its parent as the child's own.
        let Some(tree::Memory { now_kib, peak_kib }) = tree::memory(process) else { return 0 };
        self.0.fetch_max(peak_kib, Ordering::Relaxed);
        now_kib
    }
}

/// What an engine and all that it starts may have together, in MiB.
pub fn limit_mib() -> u64 {
    static LIMIT: OnceLock<u64> = OnceLock::new();
    *LIMIT.get_or_init(|| {
        let Ok(text) = std::env::var(VARIABLE) else { return machine_share_mib() };
        text.parse().unwrap_or_else(|_| {
            tracing::warn!("{VARIABLE} is `{text}`, no number of MiB: it does not count");
            machine_share_mib()
        })
    })
}

/// The part of the machine's memory that an engine may have.
fn machine_share_mib() -> u64 {
    tree::total_mib().map_or(u64::MAX, |total| (SHARE * total as f64) as u64)
}

/// Whether an amount of memory is over the limit.
fn exceeds_limit(kib: u64) -> bool {
    kib / 1024 > limit_mib()
}
