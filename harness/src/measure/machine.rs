//! What all cases of a run share: the machine's slots, and what engines have answered so far.

use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::sync::Arc;

use super::cache::{Cache, Entry, Key};
use parking_lot::Mutex;

use crate::engines::Station;
use crate::system::process::Idle;
use crate::system::slots::Slots;

#[derive(Debug)]
pub struct Machine {
    pub slots: Slots,
    /// `None`: equal jobs are rendered as often as they are asked.
    answers: Option<Mutex<BTreeMap<Key, Arc<Answered>>>>,
    before: Mutex<Before>,
    /// What engines found of the scenes that were asked for last, before they read any meter.
    grounds: Mutex<VecDeque<(Key, Arc<Ground>)>>,
    /// Where drivers wait for the next job.
    pub(super) idle: Idle,
}

/// So many scenes' are kept: cases that share one follow each other.
const GROUNDS: usize = 16;

/// What was there before this run: what is put together of earlier answers must not depend on which case of a run comes first.
#[derive(Debug, Default)]
struct Before {
    /// Meters of earlier answers, by question.
    listed: BTreeMap<Key, Arc<Vec<Vec<Station>>>>,
    /// Answers of this run.
    new: BTreeSet<Key>,
}

/// An answer of this run, locked while it is being found.
pub(super) type Answered = Mutex<Option<Entry>>;

/// What is found of a scene in this run, locked while it is being found.
pub(super) type Ground = Mutex<Option<Arc<Vec<f64>>>>;

impl Machine {
    pub fn new(threads: usize) -> Arc<Self> {
        Arc::new(Self::of(threads, Some(Mutex::default())))
    }

    /// The same, where every job is rendered as often as it is asked.
    pub fn rendering_everything(threads: usize) -> Arc<Self> {
        Arc::new(Self::of(threads, None))
    }

    fn of(threads: usize, answers: Option<Mutex<BTreeMap<Key, Arc<Answered>>>>) -> Self {
        let (slots, before, grounds, idle) = (Slots::new(threads), Mutex::default(), Mutex::default(), Idle::default());
        Self { slots, answers, before, grounds, idle }
    }

    /// Where what is found of a scene is, or will be; of its own where everything is rendered as often as it is asked.
    pub(super) fn ground(&self, key: &Key) -> Arc<Ground> {
        if self.answers.is_none() {
            return Arc::default();
        }
        let mut all = self.grounds.lock();
        if let Some((_, ground)) = all.iter().find(|(other, _)| other == key) {
            return Arc::clone(ground);
        }
        if all.len() == GROUNDS {
            all.pop_front();
        }
        let ground = Arc::<Ground>::default();
        all.push_back((key.clone(), Arc::clone(&ground)));
        ground
    }

    /// Where the answer to an equal job of this run is, or will be.
    pub(super) fn answered(&self, key: &Key) -> Option<Arc<Answered>> {
        let mut all = self.answers.as_ref()?.lock();
        Some(Arc::clone(all.entry(key.clone()).or_default()))
    }

    /// The meters of each answer to a question that was there before this run asked for the first; none where equal jobs are rendered
    /// as often as they are asked.
    pub(super) fn listed(&self, cache: &Cache, question: &Key) -> Arc<Vec<Vec<Station>>> {
        if self.answers.is_none() {
            return Arc::default();
        }
        let mut before = self.before.lock();
        let listed = before.listed.entry(question.clone());
        Arc::clone(listed.or_insert_with(|| Arc::new(cache.listed(question))))
    }

    pub(super) fn note_new(&self, key: &Key) {
        self.before.lock().new.insert(key.clone());
    }

    pub(super) fn is_new(&self, key: &Key) -> bool {
        self.before.lock().new.contains(key)
    }
}
