//! Whom a reader asks for what nobody has read yet, and which readings were asked for: what one process plans, others may take.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use parking_lot::Mutex;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::cache::Key;
use super::question::Question;
use crate::engines::share;
use crate::record::{EngineName, ProcedureId};
use crate::system::slots::Slots;

/// Whom a reader asks for what the cache does not hold.
#[derive(Clone, Debug, Default)]
pub enum Asking {
    /// The engines, at once.
    #[default]
    Engines,
    /// The engines, for these readings alone; others stay open.
    Only { wanted: Arc<BTreeSet<Key>>, failures: Failures },
    /// Nobody: what the cache does not hold stays open, so that another process or machine may take it.
    Nobody,
}

impl Asking {
    pub(super) fn admits(&self, key: &Key) -> bool {
        match self {
            Self::Engines => true,
            Self::Only { wanted, .. } => wanted.contains(key),
            Self::Nobody => false,
        }
    }

    /// Whether others read, too: what has failed for good elsewhere is no longer open.
    pub(super) const fn is_shared(&self) -> bool {
        !matches!(self, Self::Engines)
    }

    pub(super) const fn keeps_failures(&self) -> bool {
        matches!(self, Self::Only { failures: Failures::Kept, .. })
    }
}

/// What becomes of a reading that fails.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Failures {
    /// It stays open, to be tried again.
    TriedAgain,
    /// That it failed is the answer, which reports tell.
    Kept,
}

/// A reading to take: the same in every process and on every machine that has the same engine.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Node {
    /// Engine and hash of everything that the reading depends on, the engine's own files among it.
    pub id: Key,
    /// Who reads.
    pub engine: EngineName,
    /// What is read.
    pub procedure: ProcedureId,
    /// Whose reading it is: equal jobs of several cases are one.
    pub cases: BTreeSet<String>,
    /// Which part of the procedure: its first look, a spot check, a further look, a repetition.
    pub part: String,
    /// Meters that are read.
    pub meters: usize,
    /// Threads that it takes.
    pub threads: usize,
    /// Memory that it takes, in MiB.
    pub memory_mib: u64,
    /// Processor seconds that it is expected to take, or seconds that it takes at most.
    pub seconds: f64,
    /// Which of the two: nobody has measured what renderers take for reflected light.
    pub is_at_most: bool,
    /// What has to be there.
    pub needs: Needs,
    /// Whether it has been read.
    pub is_read: bool,
}

/// What a reading needs: this engine, in the very files that the hash is of.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct Needs {
    pub version: String,
    pub fingerprint: String,
}

/// What was asked for, by key.
#[derive(Clone, Debug, Default)]
pub struct Asked(Arc<Mutex<BTreeMap<Key, Node>>>);

impl Asked {
    pub(super) fn note(&self, key: &Key, question: &Question<'_>, slots: &Slots, is_read: bool) {
        let mut all = self.0.lock();
        all.entry(key.clone()).or_insert_with(|| Node::of(key, question, slots)).is_read = is_read;
    }

    /// Whether anything was left open.
    pub fn leaves_open(&self) -> bool {
        self.0.lock().values().any(|node| !node.is_read)
    }

    /// Takes in what a case asked for.
    pub fn join(&self, case: &str, other: &Self) {
        let mut all = self.0.lock();
        for (key, node) in std::mem::take(&mut *other.0.lock()) {
            all.entry(key).or_insert(node).cases.insert(case.to_owned());
        }
    }

    /// All of it, by engine and hash.
    pub fn nodes(&self) -> Vec<Node> {
        self.0.lock().values().cloned().collect()
    }
}

impl Node {
    fn of(key: &Key, question: &Question<'_>, slots: &Slots) -> Self {
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
            meters: job.stations.len(),
            threads: share.threads.max(1),
            memory_mib: share.memory_mib,
            seconds: expected.unwrap_or(job.budget.seconds),
            is_at_most: expected.is_none(),
            needs: Needs { version: version.text.clone(), fingerprint: version.fingerprint.clone() },
            is_read: false,
        }
    }
}
