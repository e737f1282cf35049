//! The self-test: every known fault is put into a witness's readings, and the harness must catch it and name it; and are stated errors honest?

mod calibration;
mod coverage;
mod naming;
pub mod repetitions;

use std::fmt;
use std::path::Path;

use serde::Serialize;

use super::tables;
use crate::diagnosis::{self, Bench, Cause, Fault, Model, Sheet};
use crate::judge::{Comparison, Judge, Policy, Verdict};
use crate::procedures::{Target, Task};
use crate::record::{ProcedureId, Reading, ReadingKey, Recording, Uncertainty};
use crate::spec::Case;
use crate::system::random::normal;

pub use calibration::{Calibrations, calibrations};
pub use coverage::{Coverage, coverage};
pub use naming::{Named, Naming, naming};

/// The specs and their luminaires, laid out as in the repository.
const FILES: [(&str, &str); 5] = [
    ("specs/axial.yaml", include_str!("../../../data/axial.yaml")),
    ("luminaires/axial.ies", include_str!("../../../data/axial.ies")),
    ("selftest/asymmetric.yaml", include_str!("../../../data/asymmetric.yaml")),
    ("selftest/openings.yaml", include_str!("../../../data/openings.yaml")),
    ("selftest/lopsided.ies", include_str!("../../../data/lopsided.ies")),
];
/// Relative standard error of a direct reading: read-out and rounding of a good renderer.
const DIRECT_NOISE: f64 = 1e-5;
/// Relative standard error of a reading that random paths were traced for.
const INDIRECT_NOISE: f64 = 1e-3;
/// Where highlights are cut, as a share of the brightest reading.
const CLAMP: f64 = 0.1;
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
        let subjects = Subjects::of(&case);
        card.faults.extend(subjects.scores(&judge, runs, &mut random));
        for _ in 0..clean_runs {
            card.clean_runs += 1;
            card.false_alarms += usize::from(subjects.read(&judge, None, &mut random).iter().any(|sheet| sheet.fails));
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

/// What a case asks for, and all that may be wrong with it.
struct Subjects {
    case: String,
    bench: Bench,
}

impl Subjects {
    fn of(case: &Case) -> Self {
        let tasks: Vec<Task> = case.tasks().collect();
        let model = |task: &Task| Some(Model::new(0, task, diagnosis::truth(task)?));
        let models = tasks.iter().filter_map(model).collect();
        Self { case: case.name.clone(), bench: Bench::new(&[&tasks], models) }
    }

    fn models(&self) -> &[Model] {
        &self.bench.models
    }

    /// Noisy readings of every procedure, right or with what a fault makes of it, as the diagnosis gets them.
    fn read(&self, judge: &Judge<'_>, wrong: Option<&[Option<Vec<f64>>]>, random: &mut fastrand::Rng) -> Vec<Sheet> {
        let sheet = |(k, model): (usize, &Model)| {
            let read = wrong.and_then(|wrong| wrong[k].as_ref()).unwrap_or(&model.right);
            let errors: Vec<f64> = read.iter().map(|r| noise(model) * r).collect();
            let noisy = read.iter().zip(&errors).map(|(r, e)| (r + e * normal(random)).max(0.0)).collect::<Vec<f64>>();
            let comparisons = self.judged(judge, model, &noisy, &errors);
            Sheet::of(k, model, &comparisons.iter().collect::<Vec<_>>())
        };
        self.models().iter().enumerate().filter_map(sheet).collect()
    }

    fn judged(&self, judge: &Judge<'_>, model: &Model, read: &[f64], errors: &[f64]) -> Vec<Comparison> {
        let (zero, exact) = (vec![0.0; read.len()], ["iesna", "simulator"]);
        let subject = self.recording(model, SUBJECT, read, errors);
        let witnesses = exact.map(|engine| self.recording(model, engine, &model.right, &zero));
        let all: Vec<&Recording> = witnesses.iter().chain([&subject]).collect();
        let mut comparisons = judge.compare(&model.task, &all);
        comparisons.retain(|c| c.key.engine == SUBJECT);
        comparisons
    }

    fn recording(&self, model: &Model, engine: &str, values: &[f64], errors: &[f64]) -> Recording {
        let task = &model.task;
        let reading = |((target, value), error): ((&Target, &f64), &f64)| Reading {
            meter: target.id.clone(),
            quantity: task.quantity,
            value: *value,
            uncertainty: Uncertainty::sampled(*error, None),
        };
        Recording {
            model: task.model(),
            light: task.light(),
            readings: task.targets.iter().zip(values).zip(errors).map(reading).collect(),
            ..Recording::of(ReadingKey::new(&self.case, task.procedure, engine), task.light())
        }
    }

    fn scores(&self, judge: &Judge<'_>, runs: usize, random: &mut fastrand::Rng) -> Vec<Score> {
        let is_named = |f: &&Fault| f.id != "factor" && f.id != "dark";
        self.bench.listed.iter().filter(is_named).filter_map(|fault| self.score(fault, judge, runs, random)).collect()
    }

    /// `None` where a fault does not show in this case.
    fn score(&self, fault: &Fault, judge: &Judge<'_>, runs: usize, random: &mut fastrand::Rng) -> Option<Score> {
        let parameters = self.parameters(fault);
        let wrong = self.wrong(fault, &parameters);
        if wrong.iter().all(Option::is_none) {
            return None;
        }
        let pairs = || self.models().iter().zip(&wrong).filter_map(|(m, w)| Some((m, w.as_ref()?)));
        let what = fault.said(&parameters.iter().map(|p| (*p, 0.0)).collect::<Vec<_>>());
        let mut score = Score { id: fault.id.to_owned(), what, case: self.case.clone(), ..Score::default() };
        score.size = pairs().map(|(model, wrong)| size(model, wrong)).fold(0.0, f64::max);
        let (mut failed, mut named) = (vec![0; self.models().len()], 0);
        // Where nothing but zero is read, nobody can say more than that.
        let dark = self.bench.listed.iter().find(|f| f.id == "dark");
        for _ in 0..runs {
            let sheets = self.read(judge, Some(&wrong), random);
            sheets.iter().filter(|sheet| sheet.fails).for_each(|sheet| failed[sheet.model] += 1);
            let is_dark = sheets.iter().flat_map(|sheet| &sheet.read).all(|read| *read == 0.0);
            let meant = if is_dark { dark.unwrap_or(fault) } else { fault };
            named += usize::from(sheets.iter().any(|s| s.fails) && names(meant, &self.bench.causes(&sheets)));
        }
        let mostly = |count: usize| count as f64 >= MOSTLY * runs as f64;
        score.named_in = named as f64 / runs as f64;
        score.diagnosed = mostly(named);
        for (k, model) in self.models().iter().enumerate().filter(|(k, _)| mostly(failed[*k])) {
            score.caught_by.push(model.task.procedure);
            let smallest = wrong[k].as_ref().and_then(|wrong| self.smallest(judge, model, wrong));
            score.smallest_detectable = [score.smallest_detectable, smallest].into_iter().flatten().reduce(f64::min);
        }
        Some(score)
    }

    /// What a parameter of a fault is when it is put in: a share of the brightest illuminance.
    fn parameters(&self, fault: &Fault) -> Vec<f64> {
        let lux =
            |m: &Model| m.right.iter().zip(&m.task.targets).map(|(r, t)| r / t.aspects[0].weight).fold(0.0, f64::max);
        let brightest = self.models().iter().map(lux).fold(0.0, f64::max);
        let share = if fault.id == "clamp" { CLAMP } else { OFFSET };
        fault.parameters.iter().map(|_| share * brightest).collect()
    }

    /// What each procedure reads with a fault; `None` where it does not show there.
    fn wrong(&self, fault: &Fault, parameters: &[f64]) -> Vec<Option<Vec<f64>>> {
        let read = |m: &Model| fault.readings(m, parameters);
        let mut all: Vec<Option<Vec<f64>>> = self.models().iter().map(read).collect();
        if fault.has_factor {
            // As bright as before on the whole.
            let pairs = || self.models().iter().zip(&all).filter_map(|(m, w)| Some((m, w.as_ref()?)));
            let right: f64 = pairs().flat_map(|(m, _)| &m.right).sum();
            let factor = right / pairs().flat_map(|(_, w)| w).sum::<f64>();
            all.iter_mut().flatten().flatten().for_each(|r| *r *= factor);
        }
        for (model, wrong) in self.models().iter().zip(&mut all) {
            wrong.take_if(|wrong| !diagnosis::shows(wrong, &model.right));
        }
        all
    }

    fn smallest(&self, judge: &Judge<'_>, model: &Model, wrong: &[f64]) -> Option<f64> {
        let mix = |part: f64| -> Vec<f64> { model.right.iter().zip(wrong).map(|(r, w)| r + part * (w - r)).collect() };
        let fails = |part: f64| {
            let read = mix(part);
            let errors: Vec<f64> = read.iter().map(|r| noise(model) * r).collect();
            self.judged(judge, model, &read, &errors).iter().any(|c| c.verdict == Verdict::Fail)
        };
        if !fails(1.0) {
            return None;
        }
        let (mut passes, mut caught) = (0.0, 1.0);
        for _ in 0..20 {
            let middle = 0.5 * (passes + caught);
            if fails(middle) { caught = middle } else { passes = middle }
        }
        Some(size(model, &mix(caught)))
    }
}

fn noise(model: &Model) -> f64 {
    if model.task.transport == luminaire::scene::Transport::Direct { DIRECT_NOISE } else { INDIRECT_NOISE }
}

/// Whether a fault is among the causes of all that is explained, and something is.
fn names(fault: &Fault, causes: &[Vec<Cause>]) -> bool {
    let is_meant = |c: &Cause| c.id == fault.id && (!c.parameters.is_empty() || c.what == fault.what);
    let mut explained = causes.iter().filter(|causes| !causes.is_empty()).peekable();
    explained.peek().is_some() && explained.all(|causes| causes.iter().any(is_meant))
}

fn size(model: &Model, wrong: &[f64]) -> f64 {
    let largest = model.right.iter().copied().fold(0.0, f64::max);
    let relative = |(w, r): (&f64, &f64)| (w - r).abs() / r.max(0.01 * largest);
    wrong.iter().zip(&model.right).map(relative).fold(0.0, f64::max)
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
