//! Packs jobs into groups that are large enough for a process or a place in a queue.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::measure::Node;
use crate::measure::cache::Key;

/// Jobs that one process takes one after the other, since each of them is short.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Group {
    /// Its name in the plan.
    pub id: String,
    /// Threads that each of its jobs takes.
    pub threads: usize,
    /// Memory that the largest of them takes, in MiB.
    pub memory_mib: u64,
    /// The expected seconds; most jobs take far less than their limit.
    pub seconds: f64,
    /// The seconds after which a queue may end the group: one job hangs, and all others are far slower than expected.
    pub at_most_s: f64,
    /// Its jobs.
    pub jobs: Vec<Key>,
}

/// The seconds of a job with one thread, about the start of its engine: direct light, and what built-in solvers find at
/// once.
const QUICK_S: f64 = 2.0;
/// The seconds past its budget after which an engine is killed; see [`crate::measure::Question::new`].
const PATIENCE_S: f64 = 120.0;
/// How many times its expected duration a job may take on a slow and busy node.
const SLOWDOWN_FACTOR: f64 = 10.0;

/// Packs the open jobs by their threads, until a group takes this many seconds.
pub fn groups(nodes: &[Node], seconds: f64) -> Vec<Group> {
    let mut open: Vec<&Node> = nodes.iter().filter(|node| !node.is_read).collect();
    open.sort_by(|a, b| (a.threads, &a.id).cmp(&(b.threads, &b.id)));
    let mut groups: Vec<Group> = vec![];
    for node in open {
        let takes_s = if node.is_at_most && node.threads == 1 { node.seconds.min(QUICK_S) } else { node.seconds };
        let last = groups.pop_if(|last| last.threads == node.threads && last.seconds + takes_s <= seconds);
        let mut group = last.unwrap_or_else(|| Group {
            id: format!("g{:05}", groups.len() + 1),
            threads: node.threads,
            memory_mib: 0,
            seconds: 0.0,
            at_most_s: PATIENCE_S,
            jobs: vec![],
        });
        group.memory_mib = group.memory_mib.max(node.memory_mib);
        group.seconds += takes_s;
        group.at_most_s +=
            if node.is_at_most { 2.0 * node.seconds + PATIENCE_S } else { SLOWDOWN_FACTOR * node.seconds + 1.0 };
        group.jobs.push(node.id.clone());
        groups.push(group);
    }
    groups
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;
    use crate::measure::Needs;
    use luxproof_model::{EngineName, ProcedureId};

    fn node(number: usize, threads: usize, seconds: f64, is_at_most: bool) -> Node {
        Node {
            id: format!("mine/{number:064x}").parse().unwrap(),
            engine: EngineName::from("mine"),
            procedure: ProcedureId::DirectIlluminance,
            cases: BTreeSet::new(),
            part: "direct_illuminance".to_owned(),
            meters: 1,
            threads,
            memory_mib: 100 + number as u64,
            seconds,
            is_at_most,
            needs: Needs { version: "1".to_owned(), fingerprint: String::new() },
            is_read: number == 0,
        }
    }

    #[test]
    fn every_open_job_is_in_one_group_of_its_threads_and_short_ones_share() {
        let mut nodes: Vec<Node> = (0..20).map(|k| node(k, 1, 60.0, true)).collect();
        nodes.extend([node(20, 2, 45.0, true), node(21, 2, 10.0, false), node(22, 2, 40.0, true)]);
        let groups = groups(&nodes, 30.0);
        let jobs: Vec<&Key> = groups.iter().flat_map(|group| &group.jobs).collect();
        assert_eq!(jobs, nodes[1..].iter().map(|node| &node.id).collect::<Vec<_>>());
        let summary: Vec<_> = groups.iter().map(|g| (g.id.as_str(), g.threads, g.jobs.len(), g.memory_mib)).collect();
        assert_eq!(
            summary,
            [
                ("g00001", 1, 15, 115),
                ("g00002", 1, 4, 119),
                ("g00003", 2, 1, 120),
                ("g00004", 2, 1, 121),
                ("g00005", 2, 1, 122)
            ]
        );
        assert_eq!(groups[0].at_most_s, PATIENCE_S + 15.0 * (2.0 * 60.0 + PATIENCE_S));
        assert_eq!(groups[3].at_most_s, PATIENCE_S + SLOWDOWN_FACTOR * 10.0 + 1.0);
    }
}
