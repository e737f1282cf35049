//! Jobs packed into groups that are worth a process, or a place in a queue; pure.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::measure::Node;
use crate::measure::cache::Key;

/// Jobs that one process takes one after the other, since each by itself is short.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Group {
    /// Its name in the plan.
    pub id: String,
    /// Threads that each of its jobs takes.
    pub threads: usize,
    /// Memory that the largest of them takes, in MiB.
    pub memory_mib: u64,
    /// Seconds that it is expected to take, most of its jobs far less than they may.
    pub seconds: f64,
    /// Seconds that it takes at most.
    pub at_most_s: f64,
    /// Its jobs.
    pub jobs: Vec<Key>,
}

/// A job of one thread takes about as long as its engine takes to start, in seconds: direct light, and what our own solvers find at once.
const QUICK_S: f64 = 2.0;
/// Past its budget an engine is ended after so long; see [`crate::measure::Question::new`].
const PATIENCE_S: f64 = 120.0;

/// The jobs that nobody has read, packed by threads until a group takes so many seconds.
pub fn groups(nodes: &[Node], seconds: f64) -> Vec<Group> {
    let mut open: Vec<&Node> = nodes.iter().filter(|node| !node.is_read).collect();
    open.sort_by(|a, b| (a.threads, &a.id).cmp(&(b.threads, &b.id)));
    let mut groups: Vec<Group> = vec![];
    for node in open {
        let takes_s = if node.is_at_most && node.threads == 1 { node.seconds.min(QUICK_S) } else { node.seconds };
        let fits = |group: &&mut Group| group.threads == node.threads && group.seconds + takes_s <= seconds;
        let number = groups.len() + 1;
        let group = match groups.last_mut().filter(fits) {
            Some(group) => group,
            None => {
                let (id, threads) = (format!("g{number:05}"), node.threads);
                groups.push(Group { id, threads, memory_mib: 0, seconds: 0.0, at_most_s: 0.0, jobs: vec![] });
                let Some(last) = groups.last_mut() else { continue };
                last
            }
        };
        group.memory_mib = group.memory_mib.max(node.memory_mib);
        group.seconds += takes_s;
        group.at_most_s += 2.0 * node.seconds + PATIENCE_S;
        group.jobs.push(node.id.clone());
    }
    groups
}
