//! The self-test: inject every known fault into the readings of a reference engine and check that
//! luxproof detects and names it. It also checks whether stated errors are honest.

mod adapters;
mod calibration;
mod coverage;
mod naming;
pub mod repetitions;

use std::fmt;
use std::path::Path;

use serde::Serialize;

use super::tables;
use luxproof_model::{
    Comparison, EngineName, Estimate, ProcedureId, Reading, ReadingKey, Recording, Uncertainty, Verdict,
};
use luxproof_process::random::normal;
use luxproof_spec::Case;
use luxproof_spec::procedures::Task;
use luxproof_verdict::diagnosis::{self, Cause, EngineReadings, Fault, FaultCatalogue, Model};
use luxproof_verdict::{Judge, Policy};

pub use calibration::{Calibrations, calibrations};
pub use coverage::{Coverage, coverage};
pub use naming::{Naming, NamingScore, naming};

/// The specs and their luminaires, under the same paths as in the repository.
const FILES: [(&str, &str); 5] = [
    ("specs/axial.yaml", include_str!("../../data/axial.yaml")),
    ("luminaires/axial.ies", include_str!("../../data/axial.ies")),
    ("selftest/asymmetric.yaml", include_str!("../../data/asymmetric.yaml")),
    ("selftest/openings.yaml", include_str!("../../data/openings.yaml")),
    ("selftest/lopsided.ies", include_str!("../../data/lopsided.ies")),
];
/// The relative standard error of a direct reading: read-out and rounding of a good renderer.
const DIRECT_NOISE_REL: f64 = 1e-5;
/// The relative standard error of a reading by path tracing.
const INDIRECT_NOISE_REL: f64 = 1e-3;
/// The level at which highlights are cut, as a part of the brightest illuminance.
const CLAMP_PART: f64 = 0.1;
/// The constant added to all readings, as a part of the brightest illuminance.
const OFFSET_PART: f64 = 0.05;
/// Faults below this relative size are listed, but they do not count.
pub const COUNTED: f64 = 0.02;
/// The part of the runs in which a fault has to be named.
const MIN_NAMED_PART: f64 = 0.9;
/// The name of the engine under test; no deviation of it is on record.
const SUBJECT: &str = "subject";
/// The fault that makes all readings zero.
const DARK_FAULT: &str = "dark";

/// The readings of each procedure with a fault; `None` where the fault does not show.
type FaultyReadings = Vec<Option<Vec<f64>>>;

/// The result of a self-test.
#[derive(Clone, Debug, Serialize)]
pub struct Scorecard {
    pub faults: Vec<Score>,
    pub clean_runs: usize,
    pub false_alarms: usize,
}

/// How well a fault is detected in a case.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Score {
    pub id: String,
    pub what: String,
    pub case: String,
    /// The largest deviation that it causes, relative to the reading or to a hundredth of the
    /// brightest.
    pub size: f64,
    /// The procedures that fail in at least nine runs of ten.
    pub caught_by: Vec<ProcedureId>,
    /// Whether the diagnosis names it in at least nine runs of ten.
    pub diagnosed: bool,
    /// The part of the runs in which the diagnosis names it.
    pub named_in: f64,
    /// The least size of this fault, mixed with the right readings, at which a procedure fails.
    pub smallest_detectable: Option<f64>,
}

impl Score {
    /// Whether the fault is detected and named, or too small to count.
    pub fn is_good(&self) -> bool {
        self.size < COUNTED || (!self.caught_by.is_empty() && self.diagnosed)
    }
}

impl Scorecard {
    /// Whether there is at most one false alarm in a hundred runs, and every fault that counts is
    /// detected and named.
    pub fn is_good(&self) -> bool {
        100 * self.false_alarms <= self.clean_runs && self.faults.iter().all(Score::is_good)
    }
}

/// Why the self-test cannot run.
#[derive(Debug, thiserror::Error)]
#[error("the self-test cannot run: {0}")]
pub struct SelftestError(String);
impl SelftestError {
    fn new(error: impl fmt::Display) -> Self {
        Self(error.to_string())
    }
}

/// Runs the self-test: a number of noisy runs for each fault, and a number without a fault in each
/// case.
pub fn selftest(runs: usize, clean_runs: usize, seed: u64) -> Result<Scorecard, SelftestError> {
    let policy = Policy::built_in().map_err(SelftestError::new)?;
    let folder = tempfile::tempdir().map_err(SelftestError::new)?;
    let mut card = Scorecard { faults: vec![], clean_runs: 0, false_alarms: 0 };
    for case in load_cases(folder.path())? {
        let judge = policy.judge(&case, None);
        let mut random = fastrand::Rng::with_seed(seed);
        let catalogue = FaultBench::new(&case);
        card.faults.extend(catalogue.score_faults(&judge, runs, &mut random));
        for _ in 0..clean_runs {
            card.clean_runs += 1;
            let sheets = catalogue.read_noisily(&judge, None, &mut random);
            card.false_alarms += usize::from(sheets.iter().any(|sheet| sheet.fails));
        }
    }
    Ok(card)
}

/// Writes the files of the self-test to a folder and loads the cases.
fn load_cases(folder: &Path) -> Result<Vec<Case>, SelftestError> {
    for (name, text) in FILES {
        let path = folder.join(name);
        let made = path.parent().map_or(Ok(()), std::fs::create_dir_all);
        made.and_then(|()| std::fs::write(&path, text))
            .map_err(|e| SelftestError(format!("{}: {e}", path.display())))?;
    }
    let paths = FILES.iter().map(|(name, _)| folder.join(name));
    let specs = paths.filter(|path| path.extension().is_some_and(|e| e == "yaml"));
    specs.map(|path| Case::load(&path).map_err(SelftestError::new)).collect()
}

/// The tasks of a case and all faults that may show in them.
struct FaultBench {
    case: String,
    catalogue: FaultCatalogue,
}

impl FaultBench {
    fn new(case: &Case) -> Self {
        let tasks: Vec<Task> = case.tasks().collect();
        let models = tasks.iter().filter_map(|task| Some(Model::new(0, task, diagnosis::truth(task)?))).collect();
        Self { case: case.name.clone(), catalogue: FaultCatalogue::new(&[&tasks], models) }
    }

    fn models(&self) -> &[Model] {
        &self.catalogue.models
    }

    /// Noisy readings of every procedure, right or with a fault, in the form that the diagnosis
    /// takes.
    fn read_noisily(
        &self,
        judge: &Judge<'_>,
        wrong: Option<&FaultyReadings>,
        random: &mut fastrand::Rng,
    ) -> Vec<EngineReadings> {
        let mut sheets = vec![];
        for (k, model) in self.models().iter().enumerate() {
            let read = wrong.and_then(|wrong| wrong[k].as_ref()).unwrap_or(&model.right);
            let errors = standard_errors(model, read);
            let noisy: Vec<f64> = read.iter().zip(&errors).map(|(r, e)| (r + e * normal(random)).max(0.0)).collect();
            let comparisons = self.judge_subject(judge, model, &noisy, &errors);
            let fails = comparisons.iter().any(|c| c.verdict == Verdict::Fail);
            sheets.extend(EngineReadings::of(k, model, &comparisons.iter().collect::<Vec<_>>(), fails));
        }
        sheets
    }

    /// Judges readings of the subject against those of two exact engines.
    fn judge_subject(&self, judge: &Judge<'_>, model: &Model, read: &[f64], errors: &[f64]) -> Vec<Comparison> {
        let exact_errors = vec![0.0; read.len()];
        let subject = self.make_recording(model, SUBJECT, read, errors);
        let references = [EngineName::IESNA, EngineName::SIMULATOR]
            .map(|engine| self.make_recording(model, engine.as_str(), &model.right, &exact_errors));
        let all: Vec<&Recording> = references.iter().chain([&subject]).collect();
        let mut comparisons = judge.compare(&model.task, &all);
        comparisons.retain(|c| c.key.engine == SUBJECT);
        comparisons
    }

    /// The recording of an engine that reads these values.
    fn make_recording(&self, model: &Model, engine: &str, values: &[f64], errors: &[f64]) -> Recording {
        let task = &model.task;
        let readings = task.targets.iter().zip(values).zip(errors).map(|((target, value), error)| {
            let estimate = Estimate { value: *value, uncertainty: Uncertainty::sampled(*error, None) };
            Reading::new(target.id.clone(), task.quantity, estimate)
        });
        Recording {
            model: task.model(),
            light: task.light(),
            readings: readings.collect(),
            ..Recording::of(ReadingKey::new(&self.case, task.procedure, engine), task.light())
        }
    }

    /// Scores every fault that the diagnosis lists. A constant factor and darkness are not faults
    /// of one kind.
    fn score_faults(&self, judge: &Judge<'_>, runs: usize, random: &mut fastrand::Rng) -> Vec<Score> {
        let faults = self.catalogue.listed.iter().filter(|f| f.id != "factor" && f.id != DARK_FAULT);
        faults.filter_map(|fault| self.score_fault(fault, judge, runs, random)).collect()
    }

    /// Scores one fault; `None` where it does not show in this case.
    fn score_fault(&self, fault: &Fault, judge: &Judge<'_>, runs: usize, random: &mut fastrand::Rng) -> Option<Score> {
        let parameters = self.choose_parameters(fault);
        let wrong = self.inject_fault(fault, &parameters);
        if wrong.iter().all(Option::is_none) {
            return None;
        }
        let what = fault.describe(&parameters.iter().map(|p| (*p, 0.0)).collect::<Vec<_>>());
        let mut score = Score { id: fault.id.to_owned(), what, case: self.case.clone(), ..Score::default() };
        let pairs = self.models().iter().zip(&wrong).filter_map(|(m, w)| Some((m, w.as_ref()?)));
        score.size = pairs.map(|(model, wrong)| relative_size(model, wrong)).fold(0.0, f64::max);
        let (mut failed, mut named) = (vec![0_usize; self.models().len()], 0_usize);
        // Where an engine reads only zeros, darkness is all that a diagnosis can name.
        let dark = self.catalogue.listed.iter().find(|f| f.id == DARK_FAULT);
        for _ in 0..runs {
            let sheets = self.read_noisily(judge, Some(&wrong), random);
            sheets.iter().filter(|sheet| sheet.fails).for_each(|sheet| failed[sheet.model] += 1);
            let is_dark = sheets.iter().flat_map(|sheet| &sheet.read).all(|read| *read == 0.0);
            let expected = if is_dark { dark.unwrap_or(fault) } else { fault };
            let fails = sheets.iter().any(|sheet| sheet.fails);
            named += usize::from(fails && names_fault(expected, &self.catalogue.causes(&sheets)));
        }
        let least = MIN_NAMED_PART * runs as f64;
        score.named_in = named as f64 / runs as f64;
        score.diagnosed = named as f64 >= least;
        for (k, model) in self.models().iter().enumerate().filter(|(k, _)| failed[*k] as f64 >= least) {
            score.caught_by.push(model.task.procedure);
            let smallest = wrong[k].as_ref().and_then(|wrong| self.find_smallest(judge, model, wrong));
            score.smallest_detectable = [score.smallest_detectable, smallest].into_iter().flatten().reduce(f64::min);
        }
        Some(score)
    }

    /// The parameters with which a fault is injected: parts of the brightest illuminance.
    fn choose_parameters(&self, fault: &Fault) -> Vec<f64> {
        let brightest = self.models().iter().map(brightest_illuminance).fold(0.0, f64::max);
        let share = if fault.id == "clamp" { CLAMP_PART } else { OFFSET_PART };
        fault.parameters.iter().map(|_| share * brightest).collect()
    }

    /// The readings of each procedure with a fault; `None` where it does not show.
    fn inject_fault(&self, fault: &Fault, parameters: &[f64]) -> FaultyReadings {
        let mut all: FaultyReadings = self.models().iter().map(|m| fault.readings(m, parameters)).collect();
        if fault.has_factor {
            // A fault with a free factor is scaled to the same total, so that only its pattern
            // shows.
            let pairs = self.models().iter().zip(&all).filter_map(|(m, w)| Some((m, w.as_ref()?)));
            let readings = pairs.flat_map(|(model, wrong)| model.right.iter().zip(wrong));
            let (right, faulty) = readings.fold((0.0, 0.0), |(right, faulty), (r, w)| (right + r, faulty + w));
            let factor = right / faulty;
            all.iter_mut().flatten().flatten().for_each(|r| *r *= factor);
        }
        for (model, wrong) in self.models().iter().zip(&mut all) {
            wrong.take_if(|wrong| !diagnosis::shows(wrong, &model.right));
        }
        all
    }

    /// Whether a mixture of right and wrong readings fails without noise.
    fn mixture_fails(&self, judge: &Judge<'_>, model: &Model, wrong: &[f64], part: f64) -> bool {
        let read = mix_readings(model, wrong, part);
        let errors = standard_errors(model, &read);
        self.judge_subject(judge, model, &read, &errors).iter().any(|c| c.verdict == Verdict::Fail)
    }

    /// Finds the least size of a fault that fails, by bisecting its part in a mixture with the
    /// right readings.
    fn find_smallest(&self, judge: &Judge<'_>, model: &Model, wrong: &[f64]) -> Option<f64> {
        if !self.mixture_fails(judge, model, wrong, 1.0) {
            return None;
        }
        let (mut passing, mut failing) = (0.0, 1.0);
        for _ in 0..20 {
            let middle = 0.5 * (passing + failing);
            if self.mixture_fails(judge, model, wrong, middle) { failing = middle } else { passing = middle }
        }
        Some(relative_size(model, &mix_readings(model, wrong, failing)))
    }
}

/// The standard errors that a good renderer states of readings.
fn standard_errors(model: &Model, read: &[f64]) -> Vec<f64> {
    let is_direct = model.task.transport == luxproof_scene::Transport::Direct;
    let noise = if is_direct { DIRECT_NOISE_REL } else { INDIRECT_NOISE_REL };
    read.iter().map(|r| noise * r).collect()
}

/// The brightest illuminance of a procedure, whatever its quantity.
fn brightest_illuminance(model: &Model) -> f64 {
    model.right.iter().zip(&model.task.targets).map(|(r, t)| r / t.aspects[0].weight).fold(0.0, f64::max)
}

/// The right readings with a part of the fault.
fn mix_readings(model: &Model, wrong: &[f64], part: f64) -> Vec<f64> {
    model.right.iter().zip(wrong).map(|(r, w)| r + part * (w - r)).collect()
}

/// Whether a fault is among the causes of everything that is explained, and something is explained.
fn names_fault(fault: &Fault, causes: &[Vec<Cause>]) -> bool {
    let mut explained = causes.iter().filter(|causes| !causes.is_empty()).peekable();
    explained.peek().is_some() && explained.all(|causes| causes.iter().any(|c| is_cause(fault, c)))
}

/// Whether a cause is a fault; one without fitted parameters is recognised by its description.
fn is_cause(fault: &Fault, cause: &Cause) -> bool {
    cause.id == fault.id && (!cause.parameters.is_empty() || cause.what == fault.what)
}

/// The largest deviation of wrong readings, relative to the right ones or to a hundredth of the
/// brightest.
fn relative_size(model: &Model, wrong: &[f64]) -> f64 {
    let brightest = model.right.iter().copied().fold(0.0, f64::max);
    let pairs = wrong.iter().zip(&model.right);
    pairs.map(|(w, r)| (w - r).abs() / r.max(0.01 * brightest)).fold(0.0, f64::max)
}

/// A relative size in percent, or as a multiple where it is large.
fn format_size(x: f64) -> String {
    if x < 10.0 { format!("{:.2} %", 100.0 * x) } else { format!("{x:.0} times") }
}

/// The row of a fault in the table.
fn score_row(score: &Score) -> Vec<String> {
    let caught_by: Vec<&str> = score.caught_by.iter().map(|p| p.name()).collect();
    vec![
        if score.is_good() { "ok" } else { "MISSED" }.to_owned(),
        score.case.clone(),
        score.what.clone(),
        format_size(score.size),
        score.smallest_detectable.map_or("-".to_owned(), format_size),
        format!("{:.0} %", 100.0 * score.named_in),
        if caught_by.is_empty() { "-".to_owned() } else { caught_by.join(", ") },
    ]
}

impl fmt::Display for Scorecard {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let head = ["", "case", "fault", "size", "smallest seen", "named", "caught by"].map(str::to_owned);
        let rows = self.faults.iter().map(score_row).collect();
        writeln!(f, "{}", tables::format_terminal(head.into(), rows))?;
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
