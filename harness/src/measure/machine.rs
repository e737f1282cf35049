//! What all cases of a run share: the machine's slots, and what engines have answered so far.

use std::collections::BTreeMap;
use std::sync::Arc;

use super::cache::{Entry, Key};
use parking_lot::Mutex;

use crate::system::slots::Slots;

#[derive(Debug)]
pub struct Machine {
    pub slots: Slots,
    /// `None`: equal jobs are rendered as often as they are asked.
    answers: Option<Mutex<BTreeMap<Key, Arc<Answered>>>>,
}

/// An answer of this run, locked while it is being found.
pub(super) type Answered = Mutex<Option<Entry>>;

impl Machine {
    pub fn new(threads: usize) -> Arc<Self> {
        Arc::new(Self { slots: Slots::new(threads), answers: Some(Mutex::default()) })
    }

    /// The same, where every job is rendered as often as it is asked.
    pub fn rendering_everything(threads: usize) -> Arc<Self> {
        Arc::new(Self { slots: Slots::new(threads), answers: None })
    }

    /// Where the answer to an equal job of this run is, or will be.
    pub(super) fn answered(&self, key: &Key) -> Option<Arc<Answered>> {
        let mut all = self.answers.as_ref()?.lock();
        Some(Arc::clone(all.entry(key.clone()).or_default()))
    }
}
