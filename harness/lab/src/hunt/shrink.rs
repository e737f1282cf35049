//! Delta debugging of a spec and its tables (Zeller & Hildebrandt, IEEE TSE 28, 2002) under noise.
//! A step counts only if the same engine still shows the same symptom, by more than chance explains
//! in that many attempts.

use std::collections::HashSet;
use std::time::Instant;

use sha2::{Digest, Sha256};

use super::draft::Draft;
use super::oracle::{AuditSettings, OracleRunner, Sighting};
use super::steps::{self, Step};
use luxproof_audit::{AuditError, Repetition};
use luxproof_process::process;

/// The probability that any look of a shrinking takes chance for a fault.
const MAX_ERROR_P: f64 = 1e-3;
/// The number of candidates in one audit; the first that still fails is taken.
const BATCH_DRAFTS: usize = 6;

/// The result of shrinking a spec.
pub(super) struct ShrinkResult {
    pub(super) draft: Draft,
    pub(super) sighting: Sighting,
    /// The number of specs that were tried.
    pub(super) attempts: usize,
    /// Whether no step makes it smaller; otherwise time was up.
    pub(super) is_minimal: bool,
}

/// A running shrink.
pub(super) struct Shrinker<'a> {
    runner: &'a OracleRunner<'a>,
    seed: u64,
    until: Instant,
    /// The smallest draft so far that shows the symptom.
    best: Draft,
    sighting: Sighting,
    attempts: usize,
    /// The hashes of all drafts that were tried.
    tried: HashSet<Vec<u8>>,
    stated_errors: Repetition,
}

impl<'a> Shrinker<'a> {
    /// Starts from a draft with a sighting.
    pub(super) fn new(
        runner: &'a OracleRunner<'a>,
        (draft, sighting): (Draft, Sighting),
        seed: u64,
        until: Instant,
    ) -> Self {
        Self {
            runner,
            seed,
            until,
            best: draft,
            sighting,
            attempts: 0,
            tried: HashSet::new(),
            stated_errors: Repetition::Examined,
        }
    }

    /// Shrinks the draft. Where an engine states no sampling error, its stated errors are trusted
    /// meanwhile, because checking them costs as much as the reading. The result must show the
    /// symptom with that check; otherwise the shrink runs again with it.
    pub(super) fn run(mut self) -> Result<ShrinkResult, AuditError> {
        let claims_chance = self.sighting.comparison.as_ref().is_some_and(|c| c.uncertainty.is_sampled());
        let start = (self.best.clone(), self.sighting.clone());
        if !claims_chance {
            self.stated_errors = Repetition::LeftOut;
        }
        let shrunk = self.descend()?;
        if claims_chance || process::is_interrupted() || self.shows_again(&shrunk)? {
            return Ok(shrunk);
        }
        (self.best, self.sighting) = start;
        self.tried.clear();
        self.stated_errors = Repetition::Examined;
        self.descend()
    }

    /// Whether a shrunk draft shows the symptom again with all checks.
    fn shows_again(&mut self, shrunk: &ShrinkResult) -> Result<bool, AuditError> {
        self.attempts += 1;
        let settings = AuditSettings::for_verdict(self.seed.wrapping_add(self.attempts as u64));
        let found = self.runner.find_symptom(&[&shrunk.draft], &shrunk.sighting.symptom, settings)?;
        let repeated = found.into_iter().next().flatten();
        Ok(repeated.is_some_and(|s| s.p_value <= allowed_p_value(self.attempts)))
    }

    /// Applies all steps until none of them helps or time is up.
    fn descend(&mut self) -> Result<ShrinkResult, AuditError> {
        // A focused draft may be longer, but it makes all further attempts cheaper.
        self.take_first(steps::focused(&self.best, &self.sighting))?;
        let mut is_minimal = false;
        while !self.is_over() && !is_minimal {
            is_minimal = true;
            for step in steps::ALL {
                while self.take_step(*step)? {
                    is_minimal = false;
                }
            }
        }
        let is_minimal = is_minimal && !self.is_over();
        let (draft, sighting) = (self.best.clone().without_unused_files(), self.sighting.clone());
        Ok(ShrinkResult { draft, sighting, attempts: self.attempts, is_minimal })
    }

    fn is_over(&self) -> bool {
        process::is_interrupted() || Instant::now() >= self.until
    }

    /// Takes the first candidate of a step that is smaller and still fails.
    fn take_step(&mut self, step: Step) -> Result<bool, AuditError> {
        let best_size = count_bytes(&self.best);
        let mut smaller: Vec<Draft> = step(&self.best).into_iter().map(Draft::without_unused_files).collect();
        smaller.retain(|draft| count_bytes(draft) < best_size);
        self.take_first(smaller)
    }

    /// Takes the first candidate that still fails, and returns whether there is one.
    fn take_first(&mut self, mut candidates: Vec<Draft>) -> Result<bool, AuditError> {
        candidates.retain(|draft| self.tried.insert(hash_draft(draft)));
        for batch in candidates.chunks(BATCH_DRAFTS) {
            if self.is_over() {
                return Ok(false);
            }
            let seed = self.seed.wrapping_add(self.attempts as u64);
            let drafts: Vec<&Draft> = batch.iter().collect();
            let settings = AuditSettings { stated_errors: self.stated_errors, ..AuditSettings::for_verdict(seed) };
            let found = self.runner.find_symptom(&drafts, &self.sighting.symptom, settings)?;
            for (draft, found) in batch.iter().zip(found) {
                self.attempts += 1;
                if let Some(sighting) = found.filter(|s| s.p_value <= allowed_p_value(self.attempts)) {
                    (self.best, self.sighting) = (draft.clone(), sighting);
                    return Ok(true);
                }
            }
        }
        Ok(false)
    }
}

/// The p-value up to which the `k`-th look counts as a fault. All of them add up to
/// [`MAX_ERROR_P`].
pub(super) fn allowed_p_value(k: usize) -> f64 {
    MAX_ERROR_P / (k as f64 * (k as f64 + 1.0))
}

/// The bytes of a spec and of all files that it names: the measure of its size.
fn count_bytes(draft: &Draft) -> usize {
    luxproof_spec::yaml(&draft.spec).len() + draft.files.values().map(|f| f.bytes.len()).sum::<usize>()
}

/// A hash that identifies a draft.
fn hash_draft(draft: &Draft) -> Vec<u8> {
    let mut hash = Sha256::new();
    hash.update(luxproof_spec::yaml(&draft.spec));
    for file in draft.files.values() {
        hash.update(&file.bytes);
    }
    hash.finalize().to_vec()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_looks_together_rarely_take_chance_for_a_fault() {
        let all: f64 = (1..100_000).map(allowed_p_value).sum();
        assert!(all < MAX_ERROR_P && all > 0.99 * MAX_ERROR_P, "{all}");
    }
}
