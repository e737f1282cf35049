//! Why readings fail: known faults and kinds of fault with free parameters are tried on all that an engine read, and
//! named where one alone explains it.
//!
//! A fault explains readings where chi-squared of what is left is as small as chance makes it; a free parameter costs
//! what Schwarz's criterion (Ann. Statist. 6, 1978) asks for it. It must hold in every procedure and case of the
//! engine in which it would show, calibration included, whether that fails or passes. Where up to three explain them
//! equally well all are named, and where none does or more do, nothing is said; nor where the work that a search may
//! be runs out before all of a kind are tried.

mod cause;
mod exchange;
mod fault;
mod faults;
mod fit;
mod kinds;
mod rough;
mod search;
mod shape;
mod sheet;
mod slips;
mod tables;
mod wrong;

use std::collections::{BTreeMap, BTreeSet};

use crate::judge::{Basis, Comparison, Verdict};
use crate::procedures::Task;
use crate::record::{EngineName, ProcedureId, ReadingKey};
use crate::system::process;

pub use cause::{Aspect, Cause};
pub use exchange::exchanges;
pub use fault::{Fault, Parameter, shows};
pub use faults::faults;
pub use kinds::kinds;
pub use search::Bench;
pub use sheet::Sheet;
pub use wrong::{Model, truth};

/// Failing cases that are explained together at most.
const CASES_TOGETHER: usize = 6;
/// Cases that pass, those of the calibration first, that an explanation is held against besides.
const CASES_BESIDE: usize = 4;

/// What was read and judged in a case.
pub struct Examined<'a> {
    pub tasks: &'a [Task],
    /// How each engine was set, so that it is the same engine in another case.
    pub settings: BTreeMap<EngineName, String>,
    /// Engines of which nothing is explained: noise with a heavy tail looks like any fault.
    pub silent: BTreeSet<EngineName>,
    /// Whether reflected light is no finer than it must be: what is left of an explanation may be as much as half of what is allowed, whatever
    /// is stated.
    pub is_lenient: bool,
    /// How much of their noise the readings of an engine share, where that is known.
    pub design_effects: BTreeMap<ReadingKey, f64>,
    pub comparisons: &'a mut [Comparison],
}

/// An engine as it is set.
type Subject = (EngineName, String);
/// What is predicted once for every engine: the case, the procedure and what it is judged by.
type Place = (usize, ProcedureId, Basis);

impl<'a> Examined<'a> {
    /// Of engines that are all set alike, of which nothing more is known.
    pub fn new(tasks: &'a [Task], comparisons: &'a mut [Comparison]) -> Self {
        let (settings, silent, design_effects) = (BTreeMap::new(), BTreeSet::new(), BTreeMap::new());
        Self { tasks, settings, silent, is_lenient: false, design_effects, comparisons }
    }

    fn subject(&self, comparison: &Comparison) -> Subject {
        let engine = &comparison.key.engine;
        (engine.clone(), self.settings.get(engine).cloned().unwrap_or_default())
    }

    /// Whether somebody could say why it fails: printed values and calculators are off by more than a renderer's fault.
    fn is_about(comparison: &Comparison) -> bool {
        let basis = comparison.basis();
        matches!(basis, Some(Basis::ClosedForm | Basis::Exact)) && comparison.key.engine != EngineName::IESNA
    }
}

/// Says of the failures of all cases of a run why.
pub fn diagnose(cases: &mut [Examined<'_>]) {
    explain(cases);
}

/// The same; gives what explains each procedure of an engine in a case.
pub fn explain(cases: &mut [Examined<'_>]) -> Vec<Vec<Cause>> {
    explained(cases).into_iter().map(|explained| explained.causes).collect()
}

/// What explains the readings of an engine in a procedure of a case.
pub struct Explained {
    pub key: ReadingKey,
    pub causes: Vec<Cause>,
}

/// The same, with what it is of.
pub fn explained(cases: &mut [Examined<'_>]) -> Vec<Explained> {
    let mut all = vec![];
    let fails = |c: &&Comparison| c.verdict == Verdict::Fail && Examined::is_about(c);
    let of_case = |case: &Examined<'_>| {
        let told = |c: &&Comparison| fails(c) && !case.silent.contains(&c.key.engine);
        case.comparisons.iter().filter(told).map(|c| case.subject(c)).collect()
    };
    let failing: Vec<BTreeSet<Subject>> = cases.iter().map(of_case).collect();
    for subject in failing.iter().flatten().collect::<BTreeSet<_>>() {
        let (mine, mut beside): (Vec<usize>, Vec<usize>) =
            (0..cases.len()).partition(|k| failing[*k].contains(subject));
        beside.retain(|k| cases[*k].comparisons.iter().any(|c| cases[*k].subject(c) == *subject));
        beside.sort_by_key(|k| !cases[*k].tasks.iter().all(|t| t.procedure.is_known()));
        for together in mine.chunks(CASES_TOGETHER).take_while(|_| !process::is_interrupted()) {
            let chosen: Vec<usize> = together.iter().chain(beside.iter().take(CASES_BESIDE)).copied().collect();
            all.extend(explain_subject(cases, &chosen, subject));
        }
    }
    all
}

/// Explains what one engine fails in the cases chosen.
fn explain_subject(cases: &mut [Examined<'_>], chosen: &[usize], subject: &Subject) -> Vec<Explained> {
    let mut groups: BTreeMap<Place, Vec<(usize, usize)>> = BTreeMap::new();
    for (place, &case) in chosen.iter().enumerate() {
        for (k, c) in cases[case].comparisons.iter().enumerate() {
            let is_mine = cases[case].subject(c) == *subject && Examined::is_about(c);
            if let Some(basis) = c.basis().filter(|_| is_mine) {
                groups.entry((place, c.key.procedure, basis)).or_default().push((case, k));
            }
        }
    }
    let (mut models, mut sheets, mut members) = (vec![], vec![], vec![]);
    for ((place, procedure, _), group) in groups {
        let case = &cases[chosen[place]];
        // Faults are told by sums of light; a rating is none.
        let mut tasks = case.tasks.iter().filter(|t| t.quantity.has_zero());
        let Some(task) = tasks.find(|t| t.procedure == procedure) else { continue };
        let readings: Vec<&Comparison> = group.iter().map(|(_, k)| &case.comparisons[*k]).collect();
        let right = readings.iter().filter_map(|c| Some(c.reference.as_ref()?.value)).collect();
        let model = Model::new(place, task, right);
        let shared = readings.first().and_then(|c| case.design_effects.get(&c.key).copied());
        if let Some(sheet) = Sheet::of(models.len(), &model, &readings).filter(|s| s.right.len() == task.targets.len())
        {
            let sheet = sheet.sharing(shared);
            let sheet = if case.is_lenient { sheet.leniently() } else { sheet };
            models.push(model);
            sheets.push(sheet);
            members.push(group);
        }
    }
    let tasks: Vec<&[Task]> = chosen.iter().map(|case| cases[*case].tasks).collect();
    let causes = Bench::new(&tasks, models).causes(&sheets);
    let key = |group: &Vec<(usize, usize)>| group.first().map(|(case, k)| cases[*case].comparisons[*k].key.clone());
    let explained = members
        .iter()
        .zip(&causes)
        .filter_map(|(group, causes)| Some(Explained { key: key(group)?, causes: causes.clone() }));
    let explained = explained.collect();
    for (group, causes) in members.into_iter().zip(&causes).filter(|(_, causes)| !causes.is_empty()) {
        let text = causes.iter().map(Cause::text).collect::<Vec<_>>().join("; or ");
        for (case, k) in group {
            let comparison = &mut cases[case].comparisons[k];
            if comparison.verdict == Verdict::Fail {
                comparison.diagnosis.get_or_insert_with(|| text.clone());
            }
        }
    }
    explained
}

#[cfg(test)]
mod tests;
