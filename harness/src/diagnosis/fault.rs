//! What a fault is: a change of what is asked of an engine, or of what it reads, with or without free parameters.

use std::sync::Arc;

use super::wrong::{Fidelity, Model, Wrong};

/// A fault that changes no reading by more than this share of the largest is not there in this task.
const INVISIBLE: f64 = 1e-3;

/// Makes a task wrong, with parameters; says whether there is anything to be wrong in it.
type Change = Arc<dyn Fn(&mut Wrong, &[f64]) -> bool + Send + Sync>;

#[derive(Clone)]
pub struct Fault {
    /// A short name, the same in every task.
    pub id: &'static str,
    /// In words; `{0}` stands for the first parameter.
    pub what: String,
    /// What it is a value of. A fault without parameters and one with are the same thing where they are about the same.
    pub about: String,
    /// The one case that it is in; otherwise it is the engine's, wherever it shows.
    pub case: Option<usize>,
    pub parameters: Vec<Parameter>,
    /// Whether everything is besides as bright as it may be: a parameter, too, the last.
    pub has_factor: bool,
    /// Whether it reflects light in a task of direct light, which is then no cheaper than others.
    pub reflects: bool,
    pub change: Change,
}

/// A number that is fitted.
#[derive(Clone, Debug, PartialEq)]
pub struct Parameter {
    /// Behind the number.
    pub unit: &'static str,
    /// Where fits start from; none where that is the brightest reading, in lux.
    pub starts: Vec<f64>,
    /// What changes readings by percents.
    pub step: f64,
    pub range: (f64, f64),
    /// What it comes back to itself by: a whole turn.
    pub period: Option<f64>,
}

impl Fault {
    pub fn new(
        id: &'static str,
        what: impl Into<String>,
        change: impl Fn(&mut Wrong, &[f64]) -> bool + Send + Sync + 'static,
    ) -> Self {
        let parameters = vec![];
        let (about, what, change) = (id.to_owned(), what.into(), Arc::new(change));
        Self { id, what, about, case: None, parameters, has_factor: false, reflects: false, change }
    }

    #[must_use]
    pub fn about(self, about: impl Into<String>) -> Self {
        Self { about: about.into(), ..self }
    }

    #[must_use]
    pub fn within(self, case: usize) -> Self {
        Self { case: Some(case), ..self }
    }

    #[must_use]
    pub fn with(self, parameters: impl Into<Vec<Parameter>>) -> Self {
        Self { parameters: parameters.into(), ..self }
    }

    #[must_use]
    pub fn as_bright_as_you_like(self) -> Self {
        Self { has_factor: true, ..self }
    }

    #[must_use]
    pub fn that_reflects(self) -> Self {
        Self { reflects: true, ..self }
    }

    /// This one and then another.
    #[must_use]
    pub fn and(&self, then: &Self) -> Self {
        let (one, other) = (Arc::clone(&self.change), Arc::clone(&then.change));
        // Both must have something to change in one task or the other, but not in every one.
        let both = move |wrong: &mut Wrong, _: &[f64]| {
            let first = one(wrong, &[]);
            other(wrong, &[]) || first
        };
        let case = self.case.or(then.case);
        Self {
            id: "two",
            what: format!("two faults: {}, and {}", self.what, then.what),
            about: format!("{} and {}", self.about, then.about),
            case,
            parameters: vec![],
            has_factor: self.has_factor || then.has_factor,
            reflects: self.reflects || then.reflects,
            change: Arc::new(both),
        }
    }

    /// Whether it says all by itself.
    pub fn is_plain(&self) -> bool {
        self.count_of_parameters() == 0 && self.id != "dark"
    }

    pub fn count_of_parameters(&self) -> usize {
        self.parameters.len() + usize::from(self.has_factor)
    }

    /// What a task reads with it, the free factor left out; nothing where it is not in this task, or nobody can say.
    pub fn readings(&self, model: &Model, parameters: &[f64]) -> Option<Vec<f64>> {
        model.readings(&self.wrong(model, parameters)?, Fidelity::Fine)
    }

    /// What an engine with it takes a task for; nothing where it is not in this task.
    pub fn wrong(&self, model: &Model, parameters: &[f64]) -> Option<Wrong> {
        if self.case.is_some_and(|case| case != model.case) {
            return None;
        }
        let mut wrong = Wrong::new(&model.task);
        (self.change)(&mut wrong, parameters).then_some(wrong)
    }

    /// Its words, with numbers and their standard errors.
    pub fn said(&self, fitted: &[(f64, f64)]) -> String {
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

/// Whether readings differ so that it can be seen.
pub fn shows(wrong: &[f64], right: &[f64]) -> bool {
    let largest = right.iter().copied().fold(0.0, f64::max);
    wrong.iter().zip(right).any(|(w, r)| (w - r).abs() > INVISIBLE * largest)
}

impl Parameter {
    pub fn new(unit: &'static str, start: f64, step: f64, range: (f64, f64)) -> Self {
        Self { unit, starts: vec![start], step, range, period: None }
    }

    /// The same value, as close to zero as its period allows.
    pub(super) fn least(&self, value: f64) -> f64 {
        self.period.map_or(value, |period| value - period * (value / period).round())
    }
}
