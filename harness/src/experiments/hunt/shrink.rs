//! Delta debugging of a spec and its tables (Zeller & Hildebrandt, IEEE TSE 28, 2002), noise-aware: a step counts only if the same engine
//! still does the same thing wrong, by more than chance brings about in as many looks.

use std::collections::HashSet;
use std::time::Instant;

use sha2::{Digest, Sha256};

use super::draft::Draft;
use super::oracle::{Look, Sighting, Tribunal};
use super::steps::{self, Step};
use crate::audit::{AuditError, StatedErrors};
use crate::system::process;

/// The chance that all looks of a shrinking share of taking chance for a failure.
const ERROR: f64 = 1e-3;
/// Candidates that are tried at a time: the first that still fails is taken.
const BATCH: usize = 6;

/// What remains of a spec.
pub(super) struct Shrunk {
    pub(super) draft: Draft,
    pub(super) sighting: Sighting,
    /// How many specs were tried.
    pub(super) looks: usize,
    /// Whether nothing more can go; else time was up.
    pub(super) is_minimal: bool,
}

pub(super) struct Shrinker<'a> {
    tribunal: &'a Tribunal<'a>,
    seed: u64,
    until: Instant,
    best: Draft,
    sighting: Sighting,
    looks: usize,
    tried: HashSet<Vec<u8>>,
    stated_errors: StatedErrors,
}

impl<'a> Shrinker<'a> {
    /// From a draft in which something was sighted.
    pub(super) fn new(
        tribunal: &'a Tribunal<'a>,
        (draft, sighting): (Draft, Sighting),
        seed: u64,
        until: Instant,
    ) -> Self {
        Self {
            tribunal,
            seed,
            until,
            best: draft,
            sighting,
            looks: 0,
            tried: HashSet::new(),
            stated_errors: StatedErrors::LookedInto,
        }
    }

    /// What claims no chance is taken by its word meanwhile, since to ask again costs as much as to ask; what is left must show with
    /// open eyes, or else all of it is done again so.
    pub(super) fn run(mut self) -> Result<Shrunk, AuditError> {
        let claims_chance = self.sighting.comparison.as_ref().is_some_and(|c| c.uncertainty.is_sampled());
        let start = (self.best.clone(), self.sighting.clone());
        if !claims_chance {
            self.stated_errors = StatedErrors::Believed;
        }
        let shrunk = self.descend()?;
        if claims_chance || process::is_interrupted() || self.shows_again(&shrunk)? {
            return Ok(shrunk);
        }
        (self.best, self.sighting) = start;
        self.tried.clear();
        self.stated_errors = StatedErrors::LookedInto;
        self.descend()
    }

    fn shows_again(&mut self, shrunk: &Shrunk) -> Result<bool, AuditError> {
        self.looks += 1;
        let look = Look::with(self.seed.wrapping_add(self.looks as u64));
        let again = self.tribunal.shows(&[&shrunk.draft], &shrunk.sighting.symptom, look)?.pop().flatten();
        Ok(again.is_some_and(|s| s.p_value <= level(self.looks)))
    }

    fn descend(&mut self) -> Result<Shrunk, AuditError> {
        // What is left out first makes all further looks cheaper; it may take more digits than it saves.
        self.take_first(steps::focused(&self.best, &self.sighting))?;
        let mut is_minimal = false;
        while !self.is_over() && !is_minimal {
            is_minimal = true;
            for step in steps::ALL {
                while self.take(*step)? {
                    is_minimal = false;
                }
            }
        }
        let is_minimal = is_minimal && !self.is_over();
        let (draft, sighting) = (self.best.clone().tidied(), self.sighting.clone());
        Ok(Shrunk { draft, sighting, looks: self.looks, is_minimal })
    }

    fn is_over(&self) -> bool {
        process::is_interrupted() || Instant::now() >= self.until
    }

    /// Takes the first candidate of a step that is smaller and fails all the same.
    fn take(&mut self, step: Step) -> Result<bool, AuditError> {
        let size = size(&self.best);
        let mut smaller: Vec<Draft> = step(&self.best).into_iter().map(Draft::tidied).collect();
        smaller.retain(|draft| self::size(draft) < size);
        self.take_first(smaller)
    }

    fn take_first(&mut self, mut candidates: Vec<Draft>) -> Result<bool, AuditError> {
        candidates.retain(|draft| self.tried.insert(identity(draft)));
        for batch in candidates.chunks(BATCH) {
            if self.is_over() {
                return Ok(false);
            }
            let seed = self.seed.wrapping_add(self.looks as u64);
            let drafts: Vec<&Draft> = batch.iter().collect();
            let look = Look { stated_errors: self.stated_errors, ..Look::with(seed) };
            let found = self.tribunal.shows(&drafts, &self.sighting.symptom, look)?;
            for (draft, found) in batch.iter().zip(found) {
                self.looks += 1;
                if let Some(sighting) = found.filter(|s| s.p_value <= level(self.looks)) {
                    (self.best, self.sighting) = (draft.clone(), sighting);
                    return Ok(true);
                }
            }
        }
        Ok(false)
    }
}

/// What the `k`-th look may take chance for a failure by: all of them add up to [`ERROR`].
pub(super) fn level(k: usize) -> f64 {
    ERROR / (k as f64 * (k as f64 + 1.0))
}

/// Characters of the spec and of all that it names, by which smaller is told.
fn size(draft: &Draft) -> usize {
    crate::spec::yaml(&draft.spec).len() + draft.files.values().map(|f| f.bytes.len()).sum::<usize>()
}

fn identity(draft: &Draft) -> Vec<u8> {
    let mut hash = Sha256::new();
    hash.update(crate::spec::yaml(&draft.spec));
    for file in draft.files.values() {
        hash.update(&file.bytes);
    }
    hash.finalize().to_vec()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_looks_together_take_chance_for_a_failure_as_seldom_as_one_may() {
        let all: f64 = (1..100_000).map(level).sum();
        assert!(all < ERROR && all > 0.99 * ERROR, "{all}");
    }
}
