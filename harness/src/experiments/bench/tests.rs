use std::sync::Arc;
use std::time::Duration;

use super::*;
use crate::engines::fixtures::{Fake, S1_INDIRECT_LX};
use crate::engines::{EngineError, Knob, Measurement, Site, Version};
use crate::measure::Machine;
use crate::record::{Estimate, Uncertainty};

const BIAS: f64 = 1e-3;

/// An engine of known law: error .02 / sqrt(seconds) of either sign by seed, above a bias of .1 %.
#[allow(clippy::unnecessary_wraps, reason = "as an engine reads")]
fn known_law(job: &Job) -> Result<Measurement, EngineError> {
    let gain = job.settings.get("gain").and_then(serde_json::Value::as_f64).unwrap_or(1.0);
    let noise = 0.02 / job.budget.seconds.max(1e-6).sqrt();
    let sign = if job.seed.is_multiple_of(2) { 1.0 } else { -1.0 };
    let estimate = |x: &f64| Estimate {
        value: x * gain * (1.0 + BIAS + sign * noise),
        uncertainty: Uncertainty::sampled(x * noise, None),
    };
    Ok(Measurement { estimates: S1_INDIRECT_LX.iter().map(estimate).collect(), ..Measurement::default() })
}

const KNOBS: &[Knob] = &[Knob { key: "gain", values: &["1", "2"] }, Knob { key: "idle", values: &["true", "false"] }];

fn benched(knobs: Knobs) -> BenchReport {
    let folder = tempfile::tempdir().unwrap();
    let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../reference/specs/axial.yaml");
    let options = Options {
        reader: Reader::bare(&Site::at(folder.path()), Machine::new(1)),
        repetitions: 2,
        time: Duration::from_secs(100),
        seconds: &[0.5, 5.0, 50.0, 500.0, 5000.0, 50000.0],
        procedures: &[ProcedureId::IndirectIlluminance],
        seed: 1,
        knobs,
    };
    let engine = Arc::new(Fake { knobs: KNOBS, ..Fake::new("known", known_law) });
    let subjects = [Instrument { engine, version: Version::told("1") }];
    let mut report = BenchReport::default();
    bench(&Case::load(&path).unwrap(), &subjects, &options, &(), &mut report);
    report
}

#[test]
fn errors_and_variances_of_an_engine_of_known_law_are_recovered() {
    let report = benched(Knobs::Left);
    let [curve] = &report.curves[..] else { panic!("{:?}", report.left_out) };
    assert_eq!(curve.points.len(), 6);
    for point in &curve.points {
        let noise = 0.02 / point.effort.sqrt();
        assert!((point.relative_error / noise.hypot(BIAS) - 1.0).abs() < 1e-3, "{point:?}");
        assert!((point.variance / (2.0 * noise * noise) - 1.0).abs() < 1e-6, "{point:?}");
        assert!(point.relative_error_low < point.relative_error && point.relative_error < point.relative_error_high);
    }
    // The synthetic engine takes no time: over its effort the curve is what it was made of.
    let over_effort: Vec<(f64, f64)> = curve.points.iter().map(|p| (p.effort, p.relative_error)).collect();
    let found = fit::fit(&over_effort).unwrap();
    assert!((found.slope + 0.5).abs() < 0.03, "{found:?}");
    assert!((found.floor.unwrap() / BIAS - 1.0).abs() < 0.05, "{found:?}");
}

#[test]
fn a_knob_that_changes_the_result_is_told_from_one_that_does_nothing() {
    let report = benched(Knobs::Tried);
    let effect = |knob: &str| report.knobs.iter().find(|k| k.knob == knob).unwrap().effect;
    assert_eq!((effect("gain"), effect("idle")), (knobs::Effect::Result, knobs::Effect::Nothing));
}

#[test]
fn views_name_the_machine_and_draw_every_point() {
    let report = benched(Knobs::Left);
    assert!(report.terminal().contains("known") && report.markdown().contains("| known |"));
    assert_eq!(report.csv().lines().count(), 7);
    assert_eq!(report.svg().matches("<circle").count(), 6);
    let svg = report.svg();
    let (opened, closed) = (svg.matches('<').count() - 2 * svg.matches("</").count(), svg.matches("/>").count());
    assert_eq!(opened, closed, "{svg}");
}

fn point(wall_s: f64, relative_error: f64) -> BenchPoint {
    BenchPoint {
        effort: 1.0,
        wall_s,
        cpu_s: 1.0,
        peak_mib: None,
        relative_error,
        relative_error_low: 0.0,
        relative_error_high: 1.0,
        worst_error: 1.0,
        variance: 0.0,
        repetitions: 1,
    }
}

#[test]
fn the_front_holds_what_no_other_point_beats() {
    let key = |engine: &str| ReadingKey::new("c", ProcedureId::DirectIlluminance, engine);
    let curve =
        |engine: &str, points: Vec<BenchPoint>| Curve::of(key(engine), Default::default(), (0.0, 0.0), 0.0, points);
    let curves =
        [curve("a", vec![point(1.0, 0.1), point(4.0, 0.05)]), curve("b", vec![point(2.0, 0.2), point(3.0, 0.01)])];
    let front = |floor: f64| Pareto::of("c", ProcedureId::DirectIlluminance, &curves, floor).front;
    assert_eq!(front(0.0).iter().map(|f| f.1).collect::<Vec<_>>(), [1.0, 3.0]);
    // What the reference cannot tell apart is no gain.
    assert_eq!(front(0.2).iter().map(|f| (f.1, f.2)).collect::<Vec<_>>(), [(1.0, 0.2)]);
}

#[test]
fn no_time_is_told_to_an_error_below_the_references_floor() {
    let concluded = |reference_floor: f64| {
        let key = ReadingKey::new("c", ProcedureId::DirectIlluminance, "e");
        let points = vec![point(1.0, 0.05), point(2.0, 5e-4)];
        let curve = Curve::of(key, Default::default(), (0.0, 0.0), reference_floor, points);
        ["0.1", "0.01", "0.001"].map(|t| curve.time_to[t].is_some())
    };
    assert_eq!(concluded(0.0), [true, true, true]);
    assert_eq!(concluded(2e-3), [true, true, false]);
}
