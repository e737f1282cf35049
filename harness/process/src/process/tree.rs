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
    use std::fs::{read_dir, read_to_string};

    use super::Memory;

    /// Where a container finds how much memory it may have.
    const CONTAINER: &str = "/sys/fs/cgroup/memory.max";

    /// The KiB that a file of `/proc` states in the line that begins so.
    fn kib(file: &str, line: &str) -> Option<u64> {
        stated_kib(&read_to_string(file).ok()?, line)
    }

    fn stated_kib(text: &str, line: &str) -> Option<u64> {
        let rest = text.lines().find_map(|l| l.strip_prefix(line)?.strip_prefix(':'))?;
        rest.trim().strip_suffix(" kB")?.trim().parse().ok()
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
        let tasks = read_dir(format!("/proc/{of}/task")).into_iter().flatten().flatten();
        tasks
            .map(|task| read_to_string(task.path().join("children")).unwrap_or_default())
            .flat_map(|all| all.split_whitespace().filter_map(|id| id.parse().ok()).collect::<Vec<_>>())
            .collect()
    }

    pub(in super::super) fn memory(process: u32) -> Option<Memory> {
        let status = read_to_string(format!("/proc/{process}/status")).ok()?;
        Some(Memory { now_kib: stated_kib(&status, "VmRSS")?, peak_kib: stated_kib(&status, "VmHWM")? })
    }

    /// What a process has by itself, and its part of what it shares.
    pub(in super::super) fn proportional_kib(process: u32) -> Option<u64> {
        kib(&format!("/proc/{process}/smaps_rollup"), "Pss")
    }

    /// Of this machine, or of the container where that has less.
    pub(in super::super) fn total_mib() -> Option<u64> {
        let machine = kib("/proc/meminfo", "MemTotal")? >> 10;
        let container = read_to_string(CONTAINER).ok().and_then(|text| text.trim().parse::<u64>().ok());
        Some(container.map_or(machine, |most| machine.min(most >> 20)))
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
