//! What explains readings, in words and numbers.

/// How well a cause explains readings.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Evidence {
    /// How many.
    pub(super) readings: usize,
    /// How far they are off with it, in percent at most.
    pub(super) left: f64,
    /// How far they are off without.
    pub(super) before: f64,
    /// What all are times the reference, with its standard error, where that is all there is.
    pub(super) factor: Option<(f64, f64)>,
}

/// One explanation.
#[derive(Clone, Debug, PartialEq)]
pub struct Cause {
    pub id: &'static str,
    /// What it is a value of.
    pub about: String,
    /// What went wrong, with its parameters, without the evidence.
    pub what: String,
    /// What was fitted, each with its standard error, a free factor last.
    pub parameters: Vec<(f64, f64)>,
    pub(super) evidence: Evidence,
    /// Chi-squared of what it leaves, and what its free parameters cost.
    pub(super) score: f64,
}

impl Cause {
    /// What went wrong, with the evidence.
    pub fn text(&self) -> String {
        let Evidence { readings, left, before, factor } = self.evidence;
        match factor {
            Some((factor, error)) => {
                format!("{}: all {readings} readings are {factor:.4} ± {error:.4} times the reference", self.what)
            }
            None => format!(
                "{}: that explains all {readings} readings to {left:.2} %, which are up to {before:.1} % off otherwise",
                self.what
            ),
        }
    }

    pub(super) fn renamed(self, id: &'static str, what: String) -> Self {
        Self { id, about: what.clone(), what, ..self }
    }
}
