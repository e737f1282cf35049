//! The state that all cases of a run share: the machine's slots, and the answers of engines so far.

use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::sync::Arc;

use super::cache::{Cache, Entry, Key};
use super::running_jobs::RunningJobs;
use parking_lot::Mutex;

use luxproof_engines::Sensor;
use luxproof_process::process::ProcessPool;
use luxproof_process::slots::Slots;

/// The slots of the machine and the answers of this run.
#[derive(Debug)]
pub struct Machine {
    pub slots: Slots,
    /// The jobs that run now, for progress displays.
    pub running: Arc<RunningJobs>,
    /// The answers of this run; without them, every request is rendered.
    answers: Option<Mutex<BTreeMap<Key, Arc<Answered>>>>,
    before: Mutex<EarlierAnswers>,
    /// The precomputed data of the most recent scenes, the oldest first.
    grounds: Mutex<VecDeque<(Key, Arc<Ground>)>>,
    /// Drivers that wait for their next job.
    pub(super) idle: ProcessPool,
}

/// The number of scenes with precomputed data. Few are enough: cases that share a scene follow each other.
const MAX_GROUNDS: usize = 16;

/// Which answers are from before this run. Only those are joined, so that results do not depend on the order of cases.
#[derive(Debug, Default)]
struct EarlierAnswers {
    /// The meters of earlier answers, by question.
    listed: BTreeMap<Key, Arc<Vec<Vec<Sensor>>>>,
    /// The answers of this run.
    new: BTreeSet<Key>,
}

/// An answer of this run; it is locked while an engine works on it.
pub(super) type Answered = Mutex<Option<Entry>>;

/// The precomputed data of a scene; it is locked while an engine computes it.
pub(super) type Ground = Mutex<Option<Arc<Vec<f64>>>>;

impl Machine {
    /// A machine on which equal jobs of a run are rendered once.
    pub fn new(threads: usize) -> Arc<Self> {
        Arc::new(Self::with_answers(threads, Some(Mutex::default())))
    }

    /// A machine that renders every request, also where an equal job has an answer.
    pub fn rendering_everything(threads: usize) -> Arc<Self> {
        Arc::new(Self::with_answers(threads, None))
    }

    fn with_answers(threads: usize, answers: Option<Mutex<BTreeMap<Key, Arc<Answered>>>>) -> Self {
        let (slots, before, grounds, idle) =
            (Slots::new(threads), Mutex::default(), Mutex::default(), ProcessPool::default());
        Self { slots, running: Arc::default(), answers, before, grounds, idle }
    }

    /// The shared place of a scene's precomputed data; a new place where every request is rendered.
    pub(super) fn ground(&self, key: &Key) -> Arc<Ground> {
        if self.answers.is_none() {
            return Arc::default();
        }
        let mut all = self.grounds.lock();
        if let Some((_, ground)) = all.iter().find(|(other, _)| other == key) {
            return Arc::clone(ground);
        }
        if all.len() == MAX_GROUNDS {
            all.pop_front();
        }
        let ground = Arc::<Ground>::default();
        all.push_back((key.clone(), Arc::clone(&ground)));
        ground
    }

    /// The shared place of the answer to all equal jobs of this run.
    pub(super) fn answered(&self, key: &Key) -> Option<Arc<Answered>> {
        let mut all = self.answers.as_ref()?.lock();
        Some(Arc::clone(all.entry(key.clone()).or_default()))
    }

    /// The meters of each answer from before this run; none where every request is rendered.
    pub(super) fn listed(&self, cache: &Cache, question: &Key) -> Arc<Vec<Vec<Sensor>>> {
        if self.answers.is_none() {
            return Arc::default();
        }
        let mut before = self.before.lock();
        let listed = before.listed.entry(question.clone());
        Arc::clone(listed.or_insert_with(|| Arc::new(cache.listed(question))))
    }

    /// Marks an answer as one of this run.
    pub(super) fn note_new(&self, key: &Key) {
        self.before.lock().new.insert(key.clone());
    }

    /// Whether an answer is one of this run.
    pub(super) fn is_new(&self, key: &Key) -> bool {
        self.before.lock().new.contains(key)
    }
}
