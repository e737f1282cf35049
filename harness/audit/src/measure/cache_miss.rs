//! What a reader does when the cache has no reading, and the list of requested readings, which other processes may
//! take.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use parking_lot::Mutex;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::cache::Key;
use super::question::Question;
use luxproof_engines::share;
use luxproof_model::{EngineName, ProcedureId};
use luxproof_process::slots::Slots;

/// What a reader does when the cache has no reading.
#[derive(Clone, Debug, Default)]
pub enum CacheMissPolicy {
    /// It asks the engine at once.
    #[default]
    AskEngine,
    /// It asks the engine for these readings only; others stay open.
    AskFor { wanted: Arc<BTreeSet<Key>>, failures: Failures },
    /// The reading stays open, so that another process or machine may take it.
    LeaveOpen,
}

impl CacheMissPolicy {
    /// Whether the reader may ask the engine for a reading.
    pub(super) fn admits(&self, key: &Key) -> bool {
        match self {
            Self::AskEngine => true,
            Self::AskFor { wanted, .. } => wanted.contains(key),
            Self::LeaveOpen => false,
        }
    }

    /// Whether other processes read, too: a failure that they stored counts as an answer.
    pub(super) const fn is_shared(&self) -> bool {
        !matches!(self, Self::AskEngine)
    }

    /// Whether a failure is stored as the answer.
    pub(super) const fn keeps_failures(&self) -> bool {
        matches!(self, Self::AskFor { failures: Failures::Kept, .. })
    }
}

/// What happens to a reading that fails.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Failures {
    /// It stays open, to be tried again.
    TriedAgain,
    /// The failure is the answer, and appears in reports.
    Kept,
}

/// A reading to take. It is the same in every process and on every machine that has the same engine.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Node {
    /// Engine and hash of everything that the reading depends on, including the engine's own files.
    pub id: Key,
    /// The engine that reads.
    pub engine: EngineName,
    /// The procedure.
    pub procedure: ProcedureId,
    /// The cases that use the reading: equal jobs of several cases are one.
    pub cases: BTreeSet<String>,
    /// The part of the procedure: its first stage, a spot check, a further stage or a repetition.
    pub part: String,
    /// The number of meters.
    pub meters: usize,
    /// The number of threads that it takes.
    pub threads: usize,
    /// Memory that it takes, in MiB.
    pub memory_mib: u64,
    /// The expected processor seconds, or the largest number of seconds.
    pub seconds: f64,
    /// Whether `seconds` is the largest number: the cost of reflected light is unknown for renderers.
    pub is_at_most: bool,
    /// The engine that has to be installed.
    pub needs: Needs,
    /// Whether it has been read.
    pub is_read: bool,
}

/// The version of the engine and the hash of its files.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct Needs {
    pub version: String,
    pub fingerprint: String,
}

/// The requested readings by key; clones share one list.
#[derive(Clone, Debug, Default)]
pub struct RequestedReadings(Arc<Mutex<BTreeMap<Key, Node>>>);

impl RequestedReadings {
    /// Adds a request, or updates whether it has been read.
    pub(super) fn note(&self, key: &Key, question: &Question<'_>, slots: &Slots, is_read: bool) {
        let mut all = self.0.lock();
        all.entry(key.clone()).or_insert_with(|| Node::from_question(key, question, slots)).is_read = is_read;
    }

    /// Whether any reading is still open.
    pub fn leaves_open(&self) -> bool {
        self.0.lock().values().any(|node| !node.is_read)
    }

    /// Moves the requests of a case into this list.
    pub fn join(&self, case: &str, other: &Self) {
        let mut all = self.0.lock();
        for (key, node) in std::mem::take(&mut *other.0.lock()) {
            all.entry(key).or_insert(node).cases.insert(case.to_owned());
        }
    }

    /// All requested readings, sorted by engine and hash.
    pub fn nodes(&self) -> Vec<Node> {
        self.0.lock().values().cloned().collect()
    }
}

impl Node {
    fn from_question(key: &Key, question: &Question<'_>, slots: &Slots) -> Self {
        let (instrument, job) = (question.instrument, question.job);
        let engine = instrument.engine.as_ref();
        let share = share(engine, job, slots);
        let expected = engine.expected_s(job);
        let version = &instrument.version;
        Self {
            id: key.clone(),
            engine: engine.name(),
            procedure: job.procedure,
            cases: BTreeSet::new(),
            part: question.folder.to_owned(),
            meters: job.sensors.len(),
            threads: share.threads.max(1),
            memory_mib: share.memory_mib,
            seconds: expected.unwrap_or(job.budget.seconds),
            is_at_most: expected.is_none(),
            needs: Needs { version: version.text.clone(), fingerprint: version.fingerprint.clone() },
            is_read: false,
        }
    }
}
