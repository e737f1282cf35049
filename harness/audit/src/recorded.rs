//! Adds recorded readings to what the engines of a case read: they are judged like any, and nothing else is done with them.

use luxproof_model::{EngineName, EngineStatus, Reading, ReadingKey, Recording, Role, Scope, Status};
use luxproof_spec::procedures::Task;
use luxproof_spec::{Case, RecordedReadings, content};

use crate::jobs::Outcome;
use crate::plan::{Plan, Selection, skip_of};

/// Adds the recorded readings of a case that are selected, one recording per procedure that has any.
pub(crate) fn add_recorded(case: &Case, plan: &Plan, selection: &Selection, outcome: &mut Outcome) {
    for (name, readings) in &case.recorded {
        if !selection.engines.is_empty() && !selection.engines.contains(name) {
            continue;
        }
        let engine = EngineName::from(name.as_str());
        let mut status = Status::Skipped;
        for task in &plan.tasks {
            if readings.has_any(&case.name, task.procedure) {
                outcome.recordings.push(recording(case, task, &engine, readings));
                status = Status::Ran;
            } else {
                let reason = "its recorded readings have no value of this procedure";
                outcome.skips.push(skip_of(case, task, engine.clone(), Scope::Procedure, reason));
            }
        }
        outcome.engines.push(EngineStatus {
            id: engine,
            version: Some(version(readings)),
            release: None,
            package: None,
            role: Role::Recorded,
            fingerprint: None,
            status,
            is_required: false,
            reason: (status == Status::Skipped).then(|| "it has no value of what was asked".to_owned()),
            wall_s: 0.0,
            mark: None,
        });
    }
}

/// The version that reports show: no reader should take it for a program that ran.
fn version(readings: &RecordedReadings) -> String {
    if readings.version.is_empty() { "recorded".to_owned() } else { format!("recorded, {}", readings.version) }
}

/// The recording of a procedure. A point without a value has no reading, which the verdict calls missing.
fn recording(case: &Case, task: &Task, engine: &EngineName, readings: &RecordedReadings) -> Recording {
    let values = task.targets.iter().filter_map(|target| {
        let estimate = readings.value(&case.name, task.procedure, &target.id)?;
        Some(Reading::new(target.id.clone(), task.quantity, estimate))
    });
    let source = (!readings.source.is_empty()).then(|| format!("recorded in {}", readings.source));
    Recording {
        version: version(readings),
        role: Role::Recorded,
        model: task.model(),
        input_sha256: case.sha256.clone(),
        content_sha256: content(task),
        notes: source.into_iter().collect(),
        readings: values.collect(),
        ..Recording::of(ReadingKey::new(&case.name, task.procedure, engine.clone()), task.light())
    }
}
