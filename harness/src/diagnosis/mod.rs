//! Why readings fail: every known fault is tried on them, and named where it alone explains all of them.
//!
//! A fault explains readings where chi-squared of what is left is as small as chance makes it; a free parameter costs
//! what Schwarz's criterion (Ann. Statist. 6, 1978) asks for it. Where several explain them equally well all are named,
//! and where none does, nothing is said.

mod faults;

use std::collections::{BTreeMap, BTreeSet};

use itertools::Itertools;

use crate::judge::{Basis, Comparison, Verdict};
use crate::procedures::Task;
use crate::record::{EngineName, ProcedureId, Uncertainty};

pub use faults::{Effect, Fault, faults, truth};

/// Error of a prediction that no uncertainty of a reading covers, relative: engines' own small biases.
const SLACK: f64 = 5e-4;
/// Likewise, as a share of the largest reading.
const FLOOR: f64 = 1e-6;
/// Explanations that are this much worse than the best, in chi-squared, are no rivals of it.
const RIVAL: f64 = 4.0;
const MAX_RIVALS: usize = 3;

#[derive(Clone, Debug, PartialEq)]
pub struct Cause {
    pub id: &'static str,
    /// What went wrong, with the evidence.
    pub text: String,
    /// What went wrong, without the evidence.
    pub what: String,
    /// The factor that was fitted, with its standard error, where one was.
    fitted: Option<(f64, f64)>,
    /// Chi-squared of what it leaves, and what its free parameter costs.
    score: f64,
}

/// Whose failures are explained together.
type Group = (ProcedureId, Basis, EngineName);

/// What explains the failed readings of one engine in one task.
struct Found {
    group: Group,
    /// The faults that its readings could show.
    offered: BTreeSet<&'static str>,
    causes: Vec<Cause>,
}

/// Says of the failures of a case why, task by task; a factor that is fitted to one task must hold in every other of the case
/// that fails, too.
pub fn diagnose(tasks: &[Task], comparisons: &mut [Comparison]) {
    let group = |c: &Comparison| -> Option<Group> {
        Some((c.key.procedure, c.reference.as_ref()?.basis, c.key.engine.clone()))
    };
    let failed = comparisons.iter().filter(|c| c.verdict == Verdict::Fail);
    let groups: BTreeSet<Group> = failed.filter_map(group).collect();
    // The same for every engine of a task.
    let mut predicted: BTreeMap<(ProcedureId, Basis), Vec<Fault>> = BTreeMap::new();
    let mut all = vec![];
    for group_of_one in groups {
        let (procedure, basis, engine) = &group_of_one;
        // Printed values and calculators are off by more than a renderer's fault.
        if !matches!(basis, Basis::ClosedForm | Basis::Exact) || *engine == EngineName::IESNA {
            continue;
        }
        let mine = |c: &&Comparison| group(c).as_ref() == Some(&group_of_one);
        let members: Vec<&Comparison> = comparisons.iter().filter(mine).collect();
        let task = tasks.iter().find(|task| task.procedure == *procedure);
        let Some((task, readings)) = task.zip(Readings::of(&members)) else { continue };
        let faults = predicted.entry((*procedure, *basis)).or_insert_with(|| faults(task, &readings.right));
        let offered = faults.iter().map(|f| f.id).chain([FACTOR]).collect();
        all.push(Found { offered, causes: causes(faults, &readings), group: group_of_one });
    }
    for found in &all {
        let rest = || all.iter().filter(|other| other.group.2 == found.group.2);
        let held = found.causes.iter().filter(|cause| rest().all(|other| cause.holds_in(other)));
        let text: Vec<&str> = held.map(|cause| cause.text.as_str()).collect();
        let is_mine = |c: &Comparison| c.verdict == Verdict::Fail && group(c).as_ref() == Some(&found.group);
        for comparison in comparisons.iter_mut().filter(|c| c.diagnosis.is_none() && is_mine(c)) {
            comparison.diagnosis = (!text.is_empty()).then(|| text.join("; or "));
        }
    }
}

impl Cause {
    /// Whether what was fitted explains what else failed, as far as that could show it.
    fn holds_in(&self, other: &Found) -> bool {
        let Some((value, error)) = self.fitted else { return true };
        let agrees = |c: &Cause| {
            let (same, its_error) = c.fitted.unwrap_or((value, 0.0));
            c.id == self.id && (value - same).abs() <= 3.0 * error.hypot(its_error) + 2.0 * SLACK * value
        };
        !other.offered.contains(self.id) || other.causes.iter().any(agrees)
    }
}

/// The id of a factor that is no fault's.
const FACTOR: &str = "factor";

#[derive(Clone, Debug)]
pub struct Readings {
    pub read: Vec<f64>,
    pub right: Vec<f64>,
    /// Combined standard uncertainty of each pair.
    pub uncertainty: Vec<f64>,
}

impl Readings {
    /// `None` where one of them is missing: what is not there cannot be explained.
    fn of(members: &[&Comparison]) -> Option<Self> {
        let mut readings = Self { read: vec![], right: vec![], uncertainty: vec![] };
        for comparison in members {
            let reference = comparison.reference.as_ref()?;
            readings.read.push(comparison.value.filter(|v| v.is_finite())?);
            readings.right.push(reference.value);
            let error = match comparison.uncertainty {
                // It bears out anything.
                Uncertainty::NotSeen => f64::INFINITY,
                other => other.standard_error().unwrap_or(0.0),
            };
            readings.uncertainty.push(error.hypot(reference.uncertainty));
        }
        Some(readings)
    }

    fn len(&self) -> usize {
        self.read.len()
    }

    /// Standard deviation of a reading from a prediction that is right.
    fn sigma(&self, k: usize, predicted: f64) -> f64 {
        let largest = self.right.iter().chain(&self.read).copied().fold(0.0, f64::max);
        self.uncertainty[k].hypot(SLACK * predicted).hypot(FLOOR * largest).max(f64::MIN_POSITIVE)
    }

    fn chi_squared(&self, predicted: &[f64]) -> f64 {
        let term = |k: usize| ((self.read[k] - predicted[k]) / self.sigma(k, predicted[k])).powi(2);
        (0..self.len()).map(term).sum()
    }

    /// The factor that makes `shape` fit best, and its standard error.
    fn factor(&self, shape: &[f64]) -> Option<(f64, f64)> {
        let weight = |k: usize| self.sigma(k, self.read[k]).powi(-2);
        let square: f64 = (0..self.len()).map(|k| weight(k) * shape[k] * shape[k]).sum();
        let product: f64 = (0..self.len()).map(|k| weight(k) * shape[k] * self.read[k]).sum();
        let factor = product / square;
        (factor.is_finite() && factor > 0.0).then(|| (factor, square.sqrt().recip()))
    }

    /// The largest relative distance from a prediction, in percent.
    fn worst_percent(&self, predicted: &[f64]) -> f64 {
        let largest = predicted.iter().copied().fold(0.0, f64::max);
        let told = (0..self.len()).filter(|k| self.uncertainty[*k].is_finite());
        let off = told.map(|k| (self.read[k] - predicted[k]).abs() / predicted[k].max(FLOOR * largest));
        100.0 * off.filter(|x| x.is_finite()).fold(0.0, f64::max)
    }
}

/// The faults that explain readings, the best first; empty where none does or none is needed.
pub fn causes(faults: &[Fault], readings: &Readings) -> Vec<Cause> {
    if readings.len() < 2 || is_chance(readings.chi_squared(&readings.right), readings.len()) {
        return vec![];
    }
    let found = faults.iter().filter_map(|fault| explanation(fault, readings));
    let mut found: Vec<Cause> = found.sorted_by(|a, b| a.score.total_cmp(&b.score)).collect();
    let best = found.first().map_or(0.0, |c| c.score);
    found.retain(|c| c.score <= best + RIVAL);
    found.truncate(MAX_RIVALS);
    if found.is_empty() {
        found.extend(unnamed_factor(readings));
    }
    found
}

/// Whether chi-squared is no larger than chance makes it, but for one time in a thousand or so.
fn is_chance(chi_squared: f64, freedom: usize) -> bool {
    let freedom = freedom as f64;
    chi_squared <= freedom + 3.1 * (2.0 * freedom).sqrt() + 6.0
}

fn explanation(fault: &Fault, readings: &Readings) -> Option<Cause> {
    let (n, mut fitted) = (readings.len(), None);
    let (predicted, parameters, found) = match &fault.effect {
        Effect::Factor(_) => {
            let (factor, error) = readings.factor(&readings.right)?;
            let found = format!("all {n} readings are {factor:.4} ± {error:.4} times the reference");
            (fault.readings(&readings.right)?, 0, Some(found))
        }
        Effect::Values(values) => (values.clone(), 0, None),
        Effect::Shape(_) => {
            let shape = fault.readings(&readings.right)?;
            let (factor, error) = readings.factor(&shape)?;
            fitted = Some((factor, error));
            (shape.iter().map(|s| factor * s).collect(), 1, None)
        }
        Effect::Clamp => {
            let level = readings.read.iter().copied().fold(0.0, f64::max);
            let cut = readings.right.iter().filter(|r| **r > level * (1.0 + 10.0 * SLACK)).count();
            if cut < 2 || cut == n {
                return None;
            }
            let found = format!("{cut} of {n} readings stop at {level:.6}");
            (readings.right.iter().map(|r| r.min(level)).collect(), 1, Some(found))
        }
        Effect::Offset => {
            let weight = |k: usize| readings.sigma(k, readings.right[k]).powi(-2);
            let total: f64 = (0..n).map(weight).sum();
            let offset = (0..n).map(|k| weight(k) * (readings.read[k] - readings.right[k])).sum::<f64>() / total;
            let found = format!("all {n} readings are {offset:.6} more than the reference");
            (readings.right.iter().map(|r| r + offset).collect(), 1, Some(found))
        }
    };
    if n < 2 + parameters || predicted.iter().any(|p| !p.is_finite()) {
        return None;
    }
    let chi_squared = readings.chi_squared(&predicted);
    is_chance(chi_squared, n - parameters).then(|| Cause {
        id: fault.id,
        fitted,
        what: fault.what.clone(),
        text: match found {
            Some(found) => format!("{}: {found}", fault.what),
            None => format!(
                "{}: that explains all {n} readings to {:.2} %, which are up to {:.1} % off otherwise",
                fault.what,
                readings.worst_percent(&predicted),
                readings.worst_percent(&readings.right)
            ),
        },
        score: chi_squared + parameters as f64 * (n as f64).ln().max(1.0),
    })
}

fn unnamed_factor(readings: &Readings) -> Option<Cause> {
    let n = readings.len();
    let (factor, error) = readings.factor(&readings.right)?;
    let predicted: Vec<f64> = readings.right.iter().map(|r| factor * r).collect();
    let chi_squared = readings.chi_squared(&predicted);
    let what = format!("factor {factor:.4}, none of those known");
    (n >= 3 && is_chance(chi_squared, n - 1)).then(|| Cause {
        id: FACTOR,
        fitted: Some((factor, error)),
        text: format!("{what}: all {n} readings are {factor:.4} ± {error:.4} times the reference"),
        what,
        score: chi_squared,
    })
}

#[cfg(test)]
mod tests;
