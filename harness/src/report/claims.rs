//! What is said of a renderer's readings of one procedure, and the sentence that is made of it.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::words::{rounded, trimmed};
use crate::record::{EngineName, ProcedureId};

/// A mean deviation is told where it takes this much of what the readings are within, so that it is worth a word.
const WORTH_TELLING: f64 = 0.25;

/// Of one renderer.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Sentence {
    pub engine: EngineName,
    pub text: String,
    /// What it says, procedure by procedure.
    pub claims: Vec<Claim>,
}

/// What holds of an engine's readings of one procedure, in all cases of a run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Claim {
    pub procedure: ProcedureId,
    /// How many readings were judged.
    pub readings: usize,
    /// Those that pass lie within this of their references, relative but for ratings, their intervals included; null where none does.
    pub within: Option<f64>,
    pub failed: usize,
    pub undecided: usize,
    pub known_deviations: usize,
    pub missing: usize,
    /// The mean deviation, relative, where chance does not explain it.
    pub bias: Option<f64>,
}

impl Claim {
    pub(super) fn is_sound(&self) -> bool {
        self.failed + self.undecided + self.missing == 0
    }

    pub(super) fn name(&self) -> String {
        let short = self.procedure.row().short.to_lowercase();
        // What people call it who do not know of bounces.
        if self.procedure == ProcedureId::IndirectIlluminance { "reflected".to_owned() } else { short }
    }

    /// How near readings lie, as a person says it: in per cent, or in units of a rating.
    pub(super) fn reach(&self, within: f64) -> String {
        let quantity = self.procedure.row().quantity;
        if quantity.has_zero() {
            return upward(within);
        }
        let shown = upward(0.01 * within);
        format!("{} {}", shown.trim_end_matches(" %"), quantity.unit())
    }

    /// `direct within 0.01 %`.
    pub(super) fn trusted(&self) -> String {
        let name = self.name();
        let mut text = match self.within {
            Some(within) => format!("{name} within {}", self.reach(within)),
            None => format!("{name} only as is on record"),
        };
        let bias = self.bias.filter(|b| self.within.is_some_and(|w| b.abs() > WORTH_TELLING * w));
        if let Some(bias) = bias {
            text += &format!(" ({} on the whole)", low_or_high(bias, bias));
        }
        if self.known_deviations > 0 && self.within.is_some() {
            text += &format!(" but for {} of {} known to deviate", self.known_deviations, self.readings);
        }
        text
    }
}

/// A range of relative deviations as a person says it.
pub(super) fn low_or_high(from: f64, to: f64) -> String {
    let size = |x: f64| trimmed(100.0 * digits(x.abs(), 2), 6);
    let range = |near: f64, far: f64| {
        let (near, far) = (size(near), size(far));
        if near == far { format!("{far} %") } else { format!("{near} to {far} %") }
    };
    match (from < 0.0, to > 0.0) {
        (true, false) => format!("{} low", range(to, from)),
        (false, true) => format!("{} high", range(from, to)),
        _ => format!("{} % low to {} % high", size(from), size(to)),
    }
}

fn digits(value: f64, digits: usize) -> f64 {
    rounded(value, digits).unwrap_or(value)
}

/// A bound in per cent with two digits, never less than it is.
pub(super) fn upward(within: f64) -> String {
    let percent = (100.0 * within).max(1e-4);
    let step = 10f64.powf(percent.log10().floor() - 1.0);
    format!("{} %", trimmed((percent / step - 1e-9).ceil() * step, 6))
}
