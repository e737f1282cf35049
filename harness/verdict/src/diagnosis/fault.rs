//! A fault: a change of an engine's task or of its readings, with or without free parameters.

use std::sync::Arc;

use super::faulty_task::{FaultyTask, Fidelity, Model};

/// A fault shows in a task where it changes a reading by more than this part of the largest.
const MIN_VISIBLE_SHARE: f64 = 1e-3;

/// Applies a fault to a task, with parameters; returns whether the task has anything to change.
type Change = Arc<dyn Fn(&mut FaultyTask, &[f64]) -> bool + Send + Sync>;

#[derive(Clone)]
pub struct Fault {
    /// A short name, the same in every task.
    pub id: &'static str,
    /// A description in which `{0}` stands for the first parameter.
    pub what: String,
    /// The quantity that is wrong. Two faults about the same quantity are one, with or without parameters.
    pub about: String,
    /// The one case that the fault is in; `None` where it is the engine's, in every case.
    pub case: Option<usize>,
    pub parameters: Vec<Parameter>,
    /// Whether all light has a free factor besides: it is the last parameter.
    pub has_factor: bool,
    /// Whether it adds reflected light to a task of direct light, so that the task is no longer cheap.
    pub reflects: bool,
    pub change: Change,
}

/// A fitted number.
#[derive(Clone, Debug, PartialEq)]
pub struct Parameter {
    /// The unit behind the number.
    pub unit: &'static str,
    /// Where fits start; empty where they start at the brightest reading, in lux.
    pub starts: Vec<f64>,
    /// A step that changes readings by percents.
    pub step: f64,
    pub range: (f64, f64),
    /// The period of a rotation.
    pub period: Option<f64>,
}

impl Fault {
    pub fn new(
        id: &'static str,
        what: impl Into<String>,
        change: impl Fn(&mut FaultyTask, &[f64]) -> bool + Send + Sync + 'static,
    ) -> Self {
        let parameters = vec![];
        let (about, what, change) = (id.to_owned(), what.into(), Arc::new(change));
        Self { id, what, about, case: None, parameters, has_factor: false, reflects: false, change }
    }

    /// Sets the quantity that is wrong.
    #[must_use]
    pub fn about(self, about: impl Into<String>) -> Self {
        Self { about: about.into(), ..self }
    }

    #[must_use]
    pub fn in_case(self, case: usize) -> Self {
        Self { case: Some(case), ..self }
    }

    #[must_use]
    pub fn with_parameters(self, parameters: impl Into<Vec<Parameter>>) -> Self {
        Self { parameters: parameters.into(), ..self }
    }

    #[must_use]
    pub fn with_free_factor(self) -> Self {
        Self { has_factor: true, ..self }
    }

    #[must_use]
    pub fn with_reflections(self) -> Self {
        Self { reflects: true, ..self }
    }

    /// Combines this fault with another that follows it.
    #[must_use]
    pub fn and(&self, then: &Self) -> Self {
        let (one, other) = (Arc::clone(&self.change), Arc::clone(&then.change));
        Self {
            id: "two",
            what: format!("two faults: {}, and {}", self.what, then.what),
            about: format!("{} and {}", self.about, then.about),
            case: self.case.or(then.case),
            parameters: vec![],
            has_factor: self.has_factor || then.has_factor,
            reflects: self.reflects || then.reflects,
            // A task needs to have something to change for one of the two, not for both.
            change: Arc::new(move |faulty: &mut FaultyTask, _: &[f64]| {
                let has_first = one(faulty, &[]);
                other(faulty, &[]) || has_first
            }),
        }
    }

    /// Whether its description is complete without parameters.
    pub fn is_plain(&self) -> bool {
        self.count_of_parameters() == 0 && self.id != "dark"
    }

    pub fn count_of_parameters(&self) -> usize {
        self.parameters.len() + usize::from(self.has_factor)
    }

    /// Predicts the readings of a task without the free factor; `None` where the fault does not concern it.
    pub fn readings(&self, model: &Model, parameters: &[f64]) -> Option<Vec<f64>> {
        model.predict(&self.apply(model, parameters)?, Fidelity::Fine)
    }

    /// Applies the fault to a task; `None` where it does not concern the task.
    pub fn apply(&self, model: &Model, parameters: &[f64]) -> Option<FaultyTask> {
        if self.case.is_some_and(|case| case != model.case) {
            return None;
        }
        let mut faulty = FaultyTask::new(&model.task);
        (self.change)(&mut faulty, parameters).then_some(faulty)
    }

    /// The description, with fitted values and their standard errors.
    pub fn describe(&self, fitted: &[(f64, f64)]) -> String {
        let mut text = self.what.clone();
        for (k, (value, error)) in fitted.iter().enumerate() {
            let unit = self.parameters.get(k).map_or("", |p| p.unit);
            text = text.replace(&format!("{{{k}}}"), &format!("{value:.4} ± {error:.4}{unit}"));
            let digits = if value.abs() < 0.01 { format!("{value:.3e}") } else { format!("{value:.4}") };
            text = text.replace(&format!("{{{k}:}}"), &digits);
        }
        text
    }
}

/// Whether readings differ visibly from the right ones.
pub fn shows(wrong: &[f64], right: &[f64]) -> bool {
    let largest = right.iter().copied().fold(0.0, f64::max);
    wrong.iter().zip(right).any(|(w, r)| (w - r).abs() > MIN_VISIBLE_SHARE * largest)
}

impl Parameter {
    pub fn new(unit: &'static str, start: f64, step: f64, range: (f64, f64)) -> Self {
        Self { unit, starts: vec![start], step, range, period: None }
    }

    /// Reduces a value by whole periods, as close to zero as possible.
    pub(super) fn reduce(&self, value: f64) -> f64 {
        self.period.map_or(value, |period| value - period * (value / period).round())
    }
}
