//! Makes the report of a case, and joins those of several cases.

use glam::DVec3;
use luxproof_process::clock::timestamp;
use std::collections::HashMap;
use std::time::SystemTime;

use luxproof_model::{
    CaseRecord, Comparison, FloorPlan, MAX_DRAWN, PlanLuminaire, REPORT_VERSION, ReadingKey, ReadingRecord, Recording,
    Report, Skip, SpecRecord, Summary, Verdict,
};
use luxproof_scene::{Luminaire, LuminaireModel, Obstacle, Scene, Shape, flush};
use luxproof_spec::Case;
use luxproof_verdict::{Policy, paper_splits};

/// The report's record of the spec that a case comes from.
pub(crate) fn spec_record(case: &Case) -> SpecRecord {
    SpecRecord { path: case.path.display().to_string(), sha256: case.sha256.clone(), title: case.title.clone() }
}

/// The report of a case from its readings and skips; the caller adds everything else.
pub(crate) fn report_of_case(
    case: &Case,
    policy: &Policy,
    started: SystemTime,
    recordings: &[Recording],
    comparisons: Vec<Comparison>,
    skips: Vec<Skip>,
) -> Report {
    let spec = spec_record(case);
    Report {
        luxproof: REPORT_VERSION,
        tool_version: env!("CARGO_PKG_VERSION").to_owned(),
        started: timestamp(started),
        cases: vec![CaseRecord {
            name: case.name.clone(),
            spec: spec.clone(),
            policy: policy.record.clone(),
            decision_rule: policy.tolerances.decision_rule(),
            is_calibration: case.is_calibration(),
            hidden_variant: case.hidden_variant.clone(),
            has_bodies: case.scene.obstacles.iter().any(|o| !flush::is_plate(o)),
            luminaire_models: case.grouped_models(),
            plan: (!case.is_calibration()).then(|| floor_plan(&case.scene)).flatten(),
        }],
        spec,
        readings: recordings.iter().flat_map(readings).collect(),
        recordings: recordings.iter().map(|r| Recording { readings: vec![], ..r.clone() }).collect(),
        comparisons,
        skips,
        ..Report::default()
    }
}

/// The scene seen from above; `None` where it has too many parts to draw.
fn floor_plan(scene: &Scene) -> Option<FloorPlan> {
    let bodies: Vec<&Obstacle> = scene.obstacles.iter().filter(|body| !flush::is_plate(body)).collect();
    (scene.luminaires.len() + bodies.len() <= MAX_DRAWN).then(|| FloorPlan {
        room_m: scene.room.as_ref().map(|room| [room.size_m.x, room.size_m.y]),
        luminaires: scene.luminaires.iter().map(plan_luminaire).collect(),
        bodies_m: bodies.into_iter().map(bounding_rectangle).collect(),
    })
}

fn plan_luminaire(luminaire: &Luminaire) -> PlanLuminaire {
    let half_m = match luminaire.model {
        LuminaireModel::Point => DVec3::ZERO,
        LuminaireModel::Area | LuminaireModel::Impostor => {
            let [width, length, height] = luminaire.photometry.opening.bounding_box_m();
            0.5 * DVec3::new(length, width, height)
        }
    };
    let corners = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]];
    PlanLuminaire {
        name: luminaire.id.clone(),
        at_m: luminaire.position_m.to_array(),
        corners_m: corners.map(|[x, y]| {
            let corner = luminaire.position_m + luminaire.orientation * (half_m * DVec3::new(x, y, 0.0));
            [corner.x, corner.y]
        }),
    }
}

/// Opposite corners of a body, seen from above.
fn bounding_rectangle(body: &Obstacle) -> [[f64; 2]; 2] {
    let (low, high) = match &body.shape {
        Shape::Box { min_m, max_m } => (*min_m, *max_m),
        Shape::Mesh { vertices_m, .. } => vertices_m
            .iter()
            .fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), vertex| (low.min(*vertex), high.max(*vertex))),
    };
    [[low.x, low.y], [high.x, high.y]]
}

/// Explains failures without a diagnosis by the errors that their engines declare.
pub(crate) fn explain_by_declared_errors(report: &mut Report) {
    let recordings: HashMap<&ReadingKey, &Recording> = report.recordings.iter().map(|r| (&r.key, r)).collect();
    for comparison in &mut report.comparisons {
        if comparison.verdict == Verdict::Fail && comparison.diagnosis.is_none() {
            let declared = recordings.get(&comparison.key).and_then(|recording| recording.declared(comparison));
            comparison.diagnosis = declared.map(|why| format!("as it declares: {why}"));
        }
    }
}

/// Joins the reports of one or more cases.
pub(crate) fn join_reports(spec: SpecRecord, reports: Vec<Report>) -> Report {
    let joined = reports.into_iter().reduce(|mut all, one| {
        all.wall_s += one.wall_s;
        all.comparisons.extend(one.comparisons);
        all.readings.extend(one.readings);
        all.recordings.extend(one.recordings);
        all.skips.extend(one.skips);
        all.splits.extend(one.splits);
        all.bias.extend(one.bias);
        all.statistics.extend(one.statistics);
        all.known_deviations.extend(one.known_deviations);
        all.consensus.extend(one.consensus);
        all.curves.extend(one.curves);
        all.cases.extend(one.cases);
        for table in one.published {
            match all.published.iter_mut().find(|t| t.is_the_same(&table)) {
                Some(same) => same.cases.extend(table.cases),
                None => all.published.push(table),
            }
        }
        for engine in one.engines {
            match all.engines.iter_mut().find(|e| e.id == engine.id) {
                Some(same) => same.join(engine),
                None => all.engines.push(engine),
            }
        }
        all
    });
    let Some(mut joined) = joined else { unreachable!("a suite without cases is refused") };
    joined.engines.sort_by_key(|e| luxproof_engines::place(&e.id));
    let joined = Report { spec, summary: Summary::of(&joined), ..joined };
    Report { paper_splits: paper_splits(&joined), ..joined }
}

/// The readings of a recording, each with the key of the recording.
fn readings(recording: &Recording) -> impl Iterator<Item = ReadingRecord> {
    recording.readings.iter().map(|reading| ReadingRecord {
        key: recording.key.clone(),
        model: recording.model.clone(),
        reading: reading.clone(),
    })
}
