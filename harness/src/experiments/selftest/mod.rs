//! The self-test: every known fault is put into a witness's readings, and the harness must catch it and name it.

mod calibration;

use std::fmt;
use std::path::Path;

use serde::Serialize;

use super::tables;
use crate::diagnosis::{self, Effect, Fault, Readings};
use crate::judge::{Judge, Policy, Verdict};
use crate::procedures::{self, Task};
use crate::record::{ProcedureId, Reading, ReadingKey, Recording, Uncertainty};
use crate::spec::Case;
use crate::system::random::normal;

pub use calibration::{Calibrations, calibrations};

/// The specs and their luminaires, laid out as in the repository.
const FILES: [(&str, &str); 5] = [
    ("specs/axial.yaml", include_str!("../../../../reference/specs/axial.yaml")),
    ("luminaires/axial.ies", include_str!("../../../../reference/luminaires/axial.ies")),
    ("selftest/asymmetric.yaml", include_str!("../../../../reference/selftest/asymmetric.yaml")),
    ("selftest/openings.yaml", include_str!("../../../../reference/selftest/openings.yaml")),
    ("selftest/lopsided.ies", include_str!("../../../../reference/selftest/lopsided.ies")),
];
/// Relative standard error of a direct reading: read-out and rounding of a good renderer.
const DIRECT_NOISE: f64 = 1e-5;
/// Relative standard error of a reading that random paths were traced for.
const INDIRECT_NOISE: f64 = 1e-3;
/// Where highlights are cut, as a share of the brightest reading.
const CLAMP: f64 = 0.6;
/// What is added everywhere, as a share of the brightest reading.
const OFFSET: f64 = 0.05;
/// Faults below this size are listed and not counted.
pub const COUNTED: f64 = 0.02;
/// The part of the runs in which a fault has to be named.
const MOSTLY: f64 = 0.9;
/// The subject's name, of which no deviation is on record.
const SUBJECT: &str = "subject";

#[derive(Clone, Debug, Serialize)]
pub struct Scorecard {
    pub faults: Vec<Score>,
    pub clean_runs: usize,
    pub false_alarms: usize,
}

#[derive(Clone, Debug, Default, Serialize)]
pub struct Score {
    pub id: String,
    pub what: String,
    pub case: String,
    /// The largest deviation that it makes, relative to the reading, or to a hundredth of the brightest.
    pub size: f64,
    /// The procedures that fail in at least nine runs of ten.
    pub caught_by: Vec<ProcedureId>,
    /// Whether the first of them names it in at least nine runs of ten.
    pub diagnosed: bool,
    /// The part of the runs in which the first of them names it.
    pub named_in: f64,
    /// The least size of the same fault, mixed with the truth, that any procedure fails at.
    pub smallest_detectable: Option<f64>,
}

impl Score {
    pub fn is_good(&self) -> bool {
        self.size < COUNTED || (!self.caught_by.is_empty() && self.diagnosed)
    }
}

impl Scorecard {
    /// Whether all promises are kept: at most one false alarm in a hundred runs, every fault of some size caught and named.
    pub fn is_good(&self) -> bool {
        100 * self.false_alarms <= self.clean_runs && self.faults.iter().all(Score::is_good)
    }
}

#[derive(Debug, thiserror::Error)]
#[error("the self-test cannot run: {0}")]
pub struct SelftestError(String);

/// Runs the self-test: so many noisy runs a fault, and so many without one in each case.
pub fn selftest(runs: usize, clean_runs: usize, seed: u64) -> Result<Scorecard, SelftestError> {
    let wrong = |e: &dyn fmt::Display| SelftestError(e.to_string());
    let policy = Policy::built_in().map_err(|e| wrong(&e))?;
    let folder = tempfile::tempdir().map_err(|e| wrong(&e))?;
    let mut card = Scorecard { faults: vec![], clean_runs: 0, false_alarms: 0 };
    for case in cases(folder.path())? {
        let judge = policy.judge(&case, None);
        let mut random = fastrand::Rng::with_seed(seed);
        let subjects: Vec<Subject> = case.tasks().filter_map(|task| Subject::of(&case, task)).collect();
        card.faults.extend(scores(&case, &subjects, &judge, runs, &mut random));
        for _ in 0..clean_runs {
            let failed = |s: &Subject, random: &mut _| s.run(&judge, &s.right, random).is_some();
            card.clean_runs += 1;
            card.false_alarms += usize::from(subjects.iter().any(|s| failed(s, &mut random)));
        }
    }
    Ok(card)
}

fn cases(folder: &Path) -> Result<Vec<Case>, SelftestError> {
    for (name, text) in FILES {
        let path = folder.join(name);
        let made = path.parent().map_or(Ok(()), std::fs::create_dir_all);
        made.and_then(|()| std::fs::write(&path, text))
            .map_err(|e| SelftestError(format!("{}: {e}", path.display())))?;
    }
    let is_spec = |name: &str| Path::new(name).extension().is_some_and(|e| e == "yaml");
    let specs = FILES.iter().filter(|(name, _)| is_spec(name));
    specs.map(|(name, _)| Case::load(&folder.join(name)).map_err(|e| SelftestError(e.to_string()))).collect()
}

struct Subject {
    case: String,
    task: Task,
    right: Vec<f64>,
    faults: Vec<Fault>,
}

impl Subject {
    fn of(case: &Case, task: Task) -> Option<Self> {
        let right = diagnosis::truth(&task)?;
        let faults = diagnosis::faults(&task, &right);
        Some(Self { case: case.name.clone(), task, right, faults })
    }

    /// Judges noisy readings: `None` where nothing fails, else what is named.
    fn run(&self, judge: &Judge<'_>, read: &[f64], random: &mut fastrand::Rng) -> Option<Vec<diagnosis::Cause>> {
        let errors: Vec<f64> = read.iter().map(|r| self.noise() * r).collect();
        let noisy: Vec<f64> = read.iter().zip(&errors).map(|(r, e)| (r + e * normal(random)).max(0.0)).collect();
        self.fails(judge, &noisy, &errors).then(|| {
            let readings = Readings { read: noisy, right: self.right.clone(), uncertainty: errors };
            diagnosis::causes(&self.faults, &readings)
        })
    }

    fn fails(&self, judge: &Judge<'_>, read: &[f64], errors: &[f64]) -> bool {
        let (zero, exact) = (vec![0.0; read.len()], ["iesna", "simulator"]);
        let subject = self.recording(SUBJECT, read, errors);
        let witnesses = exact.map(|engine| self.recording(engine, &self.right, &zero));
        let all: Vec<&Recording> = witnesses.iter().chain([&subject]).collect();
        judge.compare(&self.task, &all).iter().any(|c| c.key.engine == SUBJECT && c.verdict == Verdict::Fail)
    }

    fn noise(&self) -> f64 {
        if self.task.transport == luminaire::scene::Transport::Direct { DIRECT_NOISE } else { INDIRECT_NOISE }
    }

    fn recording(&self, engine: &str, values: &[f64], errors: &[f64]) -> Recording {
        let reading = |((target, value), error): ((&procedures::Target, &f64), &f64)| Reading {
            meter: target.id.clone(),
            quantity: self.task.quantity,
            value: *value,
            uncertainty: Uncertainty::sampled(*error, None),
        };
        Recording {
            model: self.task.model(),
            light: self.task.light(),
            readings: self.task.targets.iter().zip(values).zip(errors).map(reading).collect(),
            ..Recording::of(ReadingKey::new(&self.case, self.task.procedure, engine), self.task.light())
        }
    }

    /// What this procedure reads with a fault; `None` where the fault does not show in it.
    fn wrong(&self, id: &str, what: &str) -> Option<Vec<f64>> {
        let fault = self.faults.iter().find(|f| f.id == id && f.what == what)?;
        let largest = self.right.iter().copied().fold(0.0, f64::max);
        Some(match &fault.effect {
            Effect::Clamp => self.right.iter().map(|r| r.min(CLAMP * largest)).collect(),
            Effect::Offset => self.right.iter().map(|r| r + OFFSET * largest).collect(),
            // As bright as before on the whole.
            Effect::Shape(shape) => {
                let total: f64 = self.right.iter().zip(shape).map(|(r, s)| r * s).sum();
                let factor = self.right.iter().sum::<f64>() / total;
                self.right.iter().zip(shape).map(|(r, s)| factor * r * s).collect()
            }
            Effect::Factor(_) | Effect::Values(_) => fault.readings(&self.right)?,
        })
    }

    fn size(&self, wrong: &[f64]) -> f64 {
        let largest = self.right.iter().copied().fold(0.0, f64::max);
        let relative = |(w, r): (&f64, &f64)| (w - r).abs() / r.max(0.01 * largest);
        wrong.iter().zip(&self.right).map(relative).fold(0.0, f64::max)
    }

    fn smallest(&self, judge: &Judge<'_>, wrong: &[f64]) -> Option<f64> {
        let mix = |part: f64| -> Vec<f64> { self.right.iter().zip(wrong).map(|(r, w)| r + part * (w - r)).collect() };
        let fails = |part: f64| {
            let read = mix(part);
            let errors: Vec<f64> = read.iter().map(|r| self.noise() * r).collect();
            self.fails(judge, &read, &errors)
        };
        if !fails(1.0) {
            return None;
        }
        let (mut passes, mut caught) = (0.0, 1.0);
        for _ in 0..20 {
            let middle = 0.5 * (passes + caught);
            if fails(middle) { caught = middle } else { passes = middle }
        }
        Some(self.size(&mix(caught)))
    }
}

fn scores(case: &Case, subjects: &[Subject], judge: &Judge<'_>, runs: usize, random: &mut fastrand::Rng) -> Vec<Score> {
    let mut names: Vec<(&str, &str)> = vec![];
    for fault in subjects.iter().flat_map(|s| &s.faults) {
        if !names.contains(&(fault.id, fault.what.as_str())) {
            names.push((fault.id, &fault.what));
        }
    }
    let mut one = |(id, what): (&str, &str)| {
        let case = case.name.clone();
        let mut score = Score { id: id.to_owned(), what: what.to_owned(), case, ..Score::default() };
        for subject in subjects {
            let Some(wrong) = subject.wrong(id, what) else { continue };
            score.size = score.size.max(subject.size(&wrong));
            let found: Vec<_> = (0..runs).filter_map(|_| subject.run(judge, &wrong, random)).collect();
            let of_runs = |n: usize| n as f64 / runs as f64;
            if of_runs(found.len()) < MOSTLY {
                continue;
            }
            if score.caught_by.is_empty() {
                let named = |causes: &&Vec<diagnosis::Cause>| causes.iter().any(|c| c.id == id && c.what == what);
                score.named_in = of_runs(found.iter().filter(named).count());
                score.diagnosed = score.named_in >= MOSTLY;
            }
            score.caught_by.push(subject.task.procedure);
            let smallest = subject.smallest(judge, &wrong);
            score.smallest_detectable = [score.smallest_detectable, smallest].into_iter().flatten().reduce(f64::min);
        }
        score
    };
    names.into_iter().map(&mut one).collect()
}

impl fmt::Display for Scorecard {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let head = ["", "case", "fault", "size", "smallest seen", "named", "caught by"].map(str::to_owned);
        let percent = |x: f64| if x < 10.0 { format!("{:.2} %", 100.0 * x) } else { format!("{x:.0} times") };
        let row = |score: &Score| {
            let caught_by: Vec<&str> = score.caught_by.iter().map(|p| p.name()).collect();
            vec![
                if score.is_good() { "ok" } else { "MISSED" }.to_owned(),
                score.case.clone(),
                score.what.clone(),
                percent(score.size),
                score.smallest_detectable.map_or("-".to_owned(), percent),
                format!("{:.0} %", 100.0 * score.named_in),
                if caught_by.is_empty() { "-".to_owned() } else { caught_by.join(", ") },
            ]
        };
        writeln!(f, "{}", tables::terminal(head.into(), self.faults.iter().map(row).collect()))?;
        let counted: Vec<&Score> = self.faults.iter().filter(|s| s.size >= COUNTED).collect();
        let good = counted.iter().filter(|s| s.is_good()).count();
        let kinds: std::collections::BTreeSet<&str> = self.faults.iter().map(|s| s.id.as_str()).collect();
        let (kinds, counted) = (kinds.len(), counted.len());
        writeln!(f, "{kinds} kinds of fault; {good} of {counted} faults of 2 % and more caught and named")?;
        writeln!(f, "{} false alarms in {} runs without a fault", self.false_alarms, self.clean_runs)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_fault_of_two_percent_is_caught_and_named_and_the_truth_is_not() {
        let card = selftest(10, 40, 7).unwrap();
        assert!(card.is_good(), "{card}");
        let kinds: std::collections::BTreeSet<&str> = card.faults.iter().map(|s| s.id.as_str()).collect();
        assert!(kinds.len() >= 25, "{kinds:?}");
    }
}
