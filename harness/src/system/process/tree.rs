//! What the system tells of processes: what they started, and their memory; of Linux alone, elsewhere nothing is known.

use rustix::process::{Pid, Signal, kill_process};

/// Ends a process, if it is still there.
pub(super) fn kill(process: u32) {
    Pid::from_raw(process.cast_signed()).map(|pid| kill_process(pid, Signal::KILL));
}

pub(super) struct Memory {
    pub(super) now_kib: u64,
    pub(super) peak_kib: u64,
}

#[cfg(target_os = "linux")]
mod linux {
    use procfs::process::Process;
    use procfs::{Current, Meminfo, ProcResult};

    use super::Memory;

    /// Where a container is told how much memory it may have.
    const CONTAINER: &str = "/sys/fs/cgroup/memory.max";

    fn open(process: u32) -> ProcResult<Process> {
        Process::new(process.cast_signed())
    }

    /// All that a process started and that these started in their turn, as long as none between has ended.
    pub(in super::super) fn descendants(of: u32) -> Vec<u32> {
        let (mut found, mut next) = (children(of), 0);
        while let Some(&process) = found.get(next) {
            found.extend(children(process));
            next += 1;
        }
        found
    }

    pub(in super::super) fn children(of: u32) -> Vec<u32> {
        let tasks = open(of).and_then(|process| process.tasks());
        tasks.into_iter().flatten().flatten().filter_map(|task| task.children().ok()).flatten().collect()
    }

    pub(in super::super) fn memory(process: u32) -> Option<Memory> {
        let status = open(process).and_then(|process| process.status()).ok()?;
        Some(Memory { now_kib: status.vmrss?, peak_kib: status.vmhwm? })
    }

    /// What a process has by itself, and its part of what it shares.
    pub(in super::super) fn proportional_kib(process: u32) -> Option<u64> {
        let rollup = open(process).and_then(|process| process.smaps_rollup()).ok()?;
        let bytes = rollup.memory_map_rollup.0.iter().filter_map(|map| map.extension.map.get("Pss")).sum::<u64>();
        Some(bytes / 1024)
    }

    /// Of this machine, or of the container where that has less.
    pub(in super::super) fn total_mib() -> Option<u64> {
        let machine = Meminfo::current().ok()?.mem_total;
        let container = std::fs::read_to_string(CONTAINER).ok().and_then(|text| text.trim().parse().ok());
        Some(container.map_or(machine, |most: u64| most.min(machine)) >> 20)
    }
}

#[cfg(not(target_os = "linux"))]
mod elsewhere {
    use super::Memory;

    pub(in super::super) fn children(_of: u32) -> Vec<u32> {
        vec![]
    }

    pub(in super::super) fn descendants(_of: u32) -> Vec<u32> {
        vec![]
    }

    pub(in super::super) fn memory(_process: u32) -> Option<Memory> {
        None
    }

    pub(in super::super) fn proportional_kib(_process: u32) -> Option<u64> {
        None
    }

    pub(in super::super) fn total_mib() -> Option<u64> {
        None
    }
}

#[cfg(not(target_os = "linux"))]
pub(super) use elsewhere::{children, descendants, memory, proportional_kib, total_mib};
#[cfg(target_os = "linux")]
pub(super) use linux::{children, descendants, memory, proportional_kib, total_mib};
