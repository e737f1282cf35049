//! What of a deviation between an approximate method and a renderer is the method's, and what the renderer's.

use luminaire::calculators::{DeviationSplit, Uncertain};
use luminaire::units::Lux;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::engines;
use crate::procedures::Task;
use crate::record::{EngineName, MeterId, ProcedureId, Reading, Recording, Role, Uncertainty};

/// One method against one renderer at one meter; every share is relative to the renderer's value, and they add up.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Split {
    pub case: String,
    pub procedure: ProcedureId,
    pub method: String,
    pub engine: EngineName,
    pub model: String,
    pub meter: MeterId,
    /// Method over renderer, less 1.
    pub whole: f64,
    /// What the method's own error makes of it.
    pub of_method: f64,
    /// What the renderer's error makes of it.
    pub of_renderer: f64,
    /// Half width of the interval of both shares.
    pub uncertainty: f64,
    /// The same as a sentence.
    pub text: String,
}

/// Splits at every meter of a task where the IESNA method, the exact solution and a renderer gave a reading; none where the
/// IESNA method is itself what others are judged by.
pub(super) fn splits(task: &Task, recordings: &[&Recording], coverage: f64) -> Vec<Split> {
    let of = |engine: EngineName| recordings.iter().find(|r| r.key.engine == engine);
    let (Some(method), Some(exact)) = (of(EngineName::IESNA), of(EngineName::SIMULATOR)) else { return vec![] };
    if task.reference().engine() != Some(&EngineName::SIMULATOR) {
        return vec![];
    }
    let uncertain = |reading: &Reading| Uncertain {
        value: Lux(reading.value),
        half_width: Lux(coverage * reading.uncertainty.standard()),
    };
    let mut splits = vec![];
    for renderer in recordings.iter().filter(|r| r.role == Role::Renderer) {
        for rendered in renderer.readings.iter().filter(|r| r.uncertainty != Uncertainty::NotSeen) {
            let at = |r: &Recording| r.readings.iter().find(|reading| reading.meter == rendered.meter).cloned();
            let (Some(method), Some(exact)) = (at(method), at(exact)) else { continue };
            let split = DeviationSplit::new(Lux(method.value), uncertain(&exact), uncertain(rendered));
            // Light next to nothing may have shares that are no numbers.
            let is_number =
                |s: &DeviationSplit| [s.whole, s.method, s.renderer, s.uncertainty].iter().all(|v| v.is_finite());
            let Some(split) = split.filter(is_number) else { continue };
            let (method, name) =
                (engines::method_of_iesna(task.transport), engines::display_name(&renderer.key.engine));
            splits.push(Split {
                case: renderer.key.case.clone(),
                procedure: task.procedure,
                method: method.to_owned(),
                engine: renderer.key.engine.clone(),
                model: renderer.model.clone(),
                meter: rendered.meter.clone(),
                whole: split.whole,
                of_method: split.method,
                of_renderer: split.renderer,
                uncertainty: split.uncertainty,
                text: format!("{method} differs from {name} by {split}"),
            });
        }
    }
    splits
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::judge::tests;
    use crate::record::{Estimate, Uncertainty};
    use luminaire::scene::{Bounces, Transport};

    fn recording(engine: &str, value: f64, std_error: f64) -> Recording {
        tests::recording(engine, &[Estimate { value, uncertainty: Uncertainty::sampled(std_error, None) }])
    }

    fn task(transport: Transport) -> Task {
        Task { procedure: crate::engines::fixtures::procedure_of(transport), transport, ..tests::task(0) }
    }

    #[test]
    fn a_deviation_is_told_apart_with_its_uncertainty() {
        let all =
            [recording("iesna", 1.089, 0.0), recording("simulator", 1.002, 0.0), recording("radiance", 1.0, 5e-4)];
        let all: Vec<&Recording> = all.iter().collect();
        let found = splits(&task(Transport::Indirect(Bounces::Converged)), &all, 2.0);
        assert_eq!(found.len(), 1);
        assert_eq!(
            found[0].text,
            "IP-ED differs from Radiance by +8.9 %: +8.7 % is the method's, +0.2 % the renderer's, +-0.1 %"
        );
        assert!((found[0].whole - found[0].of_method - found[0].of_renderer).abs() < 1e-15);
    }

    #[test]
    fn where_the_method_is_exact_there_is_nothing_to_split() {
        let all = [recording("iesna", 1.0, 0.0), recording("simulator", 1.0, 0.0), recording("radiance", 1.0, 0.0)];
        let all: Vec<&Recording> = all.iter().collect();
        assert!(splits(&task(Transport::Direct), &all, 2.0).is_empty());
        assert!(splits(&task(Transport::Indirect(Bounces::Converged)), &all[..2], 2.0).is_empty());
    }
}
