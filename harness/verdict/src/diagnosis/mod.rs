//! Why readings fail: known faults and kinds of faults with free parameters, compared with all readings of an engine.
//!
//! A fault explains readings where chi-squared of the residuals is as small as chance makes it. A free parameter has
//! the penalty of Schwarz's criterion (Ann. Statist. 6, 1978). A fault must hold in every procedure and case of the
//! engine in which it would show, calibration included, whether they fail or pass. Up to three equally good
//! explanations are all named; more leave the cause open. So does a search that exceeds its budget of work.

mod bounces;
mod cause;
mod distance_law;
mod edges;
mod engine_readings;
mod exchange;
mod fault;
mod faults;
mod faulty_task;
mod file_factors;
mod fit;
mod glare;
mod implementation_faults;
mod kinds;
mod laws;
mod lookups;
mod pattern;
mod radiosity;
mod readouts;
mod search;
mod shape;
mod tables;

use std::collections::{BTreeMap, BTreeSet};

use luxproof_model::{Basis, Comparison, Verdict};
use luxproof_model::{EngineName, ProcedureId, ReadingKey};
use luxproof_process::process;
use luxproof_spec::procedures::Task;

pub use cause::{Aspect, Cause};
pub use engine_readings::EngineReadings;
pub use exchange::exchanges;
pub use fault::{Fault, Parameter, shows};
pub use faults::faults;
pub use faulty_task::{Model, truth};
pub use kinds::kinds;
pub use search::FaultCatalogue;

/// Failing cases that one search explains together at most.
const MAX_FAILING_CASES: usize = 6;
/// Passing cases that an explanation is compared with as well, those of the calibration first.
const MAX_PASSING_CASES: usize = 4;

/// The readings and verdicts of a case.
pub struct Examined<'a> {
    pub tasks: &'a [Task],
    /// Settings of each engine, so that the same engine is recognized in another case.
    pub settings: BTreeMap<EngineName, String>,
    /// Engines without a diagnosis: noise with a heavy tail resembles any fault.
    pub silent: BTreeSet<EngineName>,
    /// Whether reflected light is only as fine as the tolerance needs. Residuals may then be as large as half of the
    /// tolerance, whatever the stated errors are.
    pub is_lenient: bool,
    /// How much noise the readings of an engine share, where that is known.
    pub design_effects: BTreeMap<ReadingKey, f64>,
    /// Procedures that fail by their bias, where no single reading does.
    pub failing_biases: BTreeSet<(ReadingKey, Basis)>,
    pub comparisons: &'a mut [Comparison],
}

/// An engine with its settings.
type Subject = (EngineName, String);
/// The case, the procedure and the basis that one prediction serves.
type SheetKey = (usize, ProcedureId, Basis);
/// The case and the index of a comparison.
type ComparisonIndex = (usize, usize);

impl<'a> Examined<'a> {
    /// A case with the same settings for all engines and no further properties.
    pub fn new(tasks: &'a [Task], comparisons: &'a mut [Comparison]) -> Self {
        Self {
            tasks,
            settings: BTreeMap::new(),
            silent: BTreeSet::new(),
            is_lenient: false,
            design_effects: BTreeMap::new(),
            failing_biases: BTreeSet::new(),
            comparisons,
        }
    }

    fn subject(&self, comparison: &Comparison) -> Subject {
        let engine = &comparison.key.engine;
        (engine.clone(), self.settings.get(engine).cloned().unwrap_or_default())
    }

    fn has_subject(&self, subject: &Subject) -> bool {
        self.comparisons.iter().any(|c| self.subject(c) == *subject)
    }

    fn is_of_known_answer(&self) -> bool {
        self.tasks.iter().all(|task| task.procedure.is_calibration())
    }

    /// Whether a comparison fails, by itself or by the bias of its procedure.
    fn fails(&self, c: &Comparison) -> bool {
        let is_of_bias = || c.basis().is_some_and(|basis| self.failing_biases.contains(&(c.key.clone(), basis)));
        c.verdict == Verdict::Fail || c.verdict == Verdict::Undecided && is_of_bias()
    }

    /// The engines with a failure to explain.
    fn failing_subjects(&self) -> BTreeSet<Subject> {
        self.comparisons
            .iter()
            .filter(|c| self.fails(c) && is_explainable(c) && !self.silent.contains(&c.key.engine))
            .map(|c| self.subject(c))
            .collect()
    }
}

/// Whether faults can explain a deviation: printed values and approximate methods deviate for other reasons.
fn is_explainable(comparison: &Comparison) -> bool {
    matches!(comparison.basis(), Some(Basis::ClosedForm | Basis::Simulator))
        && comparison.key.engine != EngineName::IESNA
}

/// Diagnoses the failures of all cases of a run.
pub fn diagnose(cases: &mut [Examined<'_>]) {
    explain(cases);
}

/// Describes failures without a known cause: glare ratings by their formula, all else by what the deviations have in common.
///
/// It comes after everything that may give a cause.
pub fn describe_unexplained(cases: &mut [Examined<'_>]) {
    for case in cases {
        let mut groups: BTreeMap<(ReadingKey, Option<Basis>), Vec<usize>> = BTreeMap::new();
        for (k, c) in case.comparisons.iter().enumerate() {
            groups.entry((c.key.clone(), c.basis())).or_default().push(k);
        }
        for ((key, _), group) in groups {
            let Some(task) = case.tasks.iter().find(|t| t.procedure == key.procedure) else { continue };
            let comparisons: Vec<&Comparison> = group.iter().map(|k| &case.comparisons[*k]).collect();
            let is_open = |c: &Comparison| c.verdict == Verdict::Fail && c.diagnosis.is_none();
            if !comparisons.iter().any(|c| is_open(c)) {
                continue;
            }
            let of_rating = if task.quantity.has_zero() { None } else { glare::explain_ratings(&comparisons) };
            let Some(text) = of_rating.or_else(|| pattern::describe(task, &comparisons)) else { continue };
            for k in group {
                let comparison = &mut case.comparisons[k];
                if is_open(comparison) {
                    comparison.diagnosis = Some(text.clone());
                }
            }
        }
    }
}

/// Diagnoses failures; returns the causes for each procedure of an engine in a case.
pub fn explain(cases: &mut [Examined<'_>]) -> Vec<Vec<Cause>> {
    explained(cases).into_iter().map(|explained| explained.causes).collect()
}

/// The causes for the readings of an engine in a procedure of a case.
pub struct Explained {
    pub key: ReadingKey,
    pub causes: Vec<Cause>,
}

/// Diagnoses failures; returns the causes with the readings that they explain.
pub fn explained(cases: &mut [Examined<'_>]) -> Vec<Explained> {
    let mut all = vec![];
    let failing: Vec<BTreeSet<Subject>> = cases.iter().map(Examined::failing_subjects).collect();
    for subject in failing.iter().flatten().collect::<BTreeSet<_>>() {
        let (failing_cases, mut passing): (Vec<usize>, Vec<usize>) =
            (0..cases.len()).partition(|k| failing[*k].contains(subject));
        passing.retain(|k| cases[*k].has_subject(subject));
        passing.sort_by_key(|k| !cases[*k].is_of_known_answer());
        for together in failing_cases.chunks(MAX_FAILING_CASES).take_while(|_| !process::is_interrupted()) {
            let chosen: Vec<usize> = together.iter().chain(passing.iter().take(MAX_PASSING_CASES)).copied().collect();
            all.extend(explain_subject(cases, &chosen, subject));
        }
    }
    all
}

/// The sheets of one engine, with their models and the comparisons that they come from.
#[derive(Default)]
struct SubjectSheets {
    models: Vec<Model>,
    sheets: Vec<EngineReadings>,
    members: Vec<Vec<ComparisonIndex>>,
}

/// Explains what one engine fails in the cases chosen.
fn explain_subject(cases: &mut [Examined<'_>], chosen: &[usize], subject: &Subject) -> Vec<Explained> {
    let SubjectSheets { models, sheets, members } = collect_sheets(cases, chosen, subject);
    let tasks: Vec<&[Task]> = chosen.iter().map(|case| cases[*case].tasks).collect();
    let causes = FaultCatalogue::new(&tasks, models).causes(&sheets);
    let mut explained = vec![];
    for (group, causes) in members.into_iter().zip(causes) {
        let Some(&(case, first)) = group.first() else { continue };
        if !causes.is_empty() {
            let text = cause::describe_all(&causes);
            for &(case, k) in &group {
                if !cases[case].fails(&cases[case].comparisons[k]) {
                    continue;
                }
                let diagnosis = &mut cases[case].comparisons[k].diagnosis;
                // An undecided reading already says that its procedure fails.
                *diagnosis = Some(diagnosis.take().map_or_else(|| text.clone(), |known| format!("{known}; {text}")));
            }
        }
        explained.push(Explained { key: cases[case].comparisons[first].key.clone(), causes });
    }
    explained
}

/// Groups the comparisons of one engine by case, procedure and basis.
fn group_comparisons(
    cases: &[Examined<'_>],
    chosen: &[usize],
    subject: &Subject,
) -> BTreeMap<SheetKey, Vec<ComparisonIndex>> {
    let mut groups: BTreeMap<SheetKey, Vec<ComparisonIndex>> = BTreeMap::new();
    for (place, &case) in chosen.iter().enumerate() {
        for (k, c) in cases[case].comparisons.iter().enumerate() {
            let is_included = cases[case].subject(c) == *subject && is_explainable(c);
            if let Some(basis) = c.basis().filter(|_| is_included) {
                groups.entry((place, c.key.procedure, basis)).or_default().push((case, k));
            }
        }
    }
    groups
}

fn collect_sheets(cases: &[Examined<'_>], chosen: &[usize], subject: &Subject) -> SubjectSheets {
    let mut all = SubjectSheets::default();
    for ((place, procedure, _), group) in group_comparisons(cases, chosen, subject) {
        let case = &cases[chosen[place]];
        // Faults add up light; a rating is no sum of light.
        let mut tasks = case.tasks.iter().filter(|t| t.quantity.has_zero());
        let Some(task) = tasks.find(|t| t.procedure == procedure) else { continue };
        let comparisons: Vec<&Comparison> = group.iter().map(|(_, k)| &case.comparisons[*k]).collect();
        let right = comparisons.iter().filter_map(|c| Some(c.reference.as_ref()?.value)).collect();
        let model = Model::new(place, task, right);
        let fails = comparisons.iter().any(|c| case.fails(c));
        let Some(sheet) = EngineReadings::of(all.models.len(), &model, &comparisons, fails) else { continue };
        if sheet.right.len() != task.targets.len() {
            continue;
        }
        let design_effect = comparisons.first().and_then(|c| case.design_effects.get(&c.key).copied());
        let sheet = sheet.with_design_effect(design_effect);
        all.sheets.push(if case.is_lenient { sheet.with_lenient_slack() } else { sheet });
        all.models.push(model);
        all.members.push(group);
    }
    all
}

#[cfg(test)]
mod fault_tests;
#[cfg(test)]
mod implementation_tests;
#[cfg(test)]
mod law_tests;
#[cfg(test)]
mod lookup_tests;
#[cfg(test)]
mod table_tests;
#[cfg(test)]
mod tests;
