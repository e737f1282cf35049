use std::sync::Arc;
use std::time::Duration;

use super::*;
use luxproof_audit::measure::Machine;
use luxproof_engines::fixtures::{Fake, S1_INDIRECT_LX};
use luxproof_engines::{EngineError, EngineRoot, Measurement, Setting, Version};
use luxproof_model::{Estimate, Uncertainty};

const BIAS: f64 = 1e-3;

/// An engine with a known error: .02 / sqrt(seconds) with a sign that depends on the seed, plus a
/// bias of .1 %.
#[allow(clippy::unnecessary_wraps, reason = "as an engine reads")]
fn known_law(job: &Job) -> Result<Measurement, EngineError> {
    let gain = job.settings.get("gain").and_then(serde_json::Value::as_f64).unwrap_or(1.0);
    let noise = 0.02 / job.budget.seconds.max(1e-6).sqrt();
    let sign = if job.seed.is_multiple_of(2) { 1.0 } else { -1.0 };
    let estimates = S1_INDIRECT_LX.iter().map(|x| Estimate {
        value: x * gain * (1.0 + BIAS + sign * noise),
        uncertainty: Uncertainty::sampled(x * noise, None),
    });
    Ok(Measurement { estimates: estimates.collect(), ..Measurement::default() })
}

const SETTINGS: &[Setting] =
    &[Setting { key: "gain", values: &["1", "2"] }, Setting { key: "idle", values: &["true", "false"] }];

fn benched(settings: SettingEffects) -> BenchReport {
    let folder = tempfile::tempdir().unwrap();
    let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../reference/specs/axial.yaml");
    let options = Options {
        reader: Reader::bare(&EngineRoot::at(folder.path()), Machine::new(1)),
        repetitions: 2,
        time: Duration::from_secs(100),
        seconds: &[0.5, 5.0, 50.0, 500.0, 5000.0, 50000.0],
        procedures: &[ProcedureId::IndirectIlluminance],
        seed: 1,
        settings,
    };
    let engine = Arc::new(Fake { settings: SETTINGS, ..Fake::new("known", known_law) });
    let subjects = [Instrument { engine, version: Version::without_fingerprint("1") }];
    let mut report = BenchReport::default();
    bench(&Case::load(&path).unwrap(), &subjects, &options, &(), &mut report);
    report
}

#[test]
fn errors_and_variances_of_an_engine_of_known_law_are_recovered() {
    let report = benched(SettingEffects::Omitted);
    let [curve] = &report.curves[..] else { panic!("{:?}", report.left_out) };
    assert_eq!(curve.points.len(), 6);
    for point in &curve.points {
        let noise = 0.02 / point.effort.sqrt();
        assert!((point.relative_error / noise.hypot(BIAS) - 1.0).abs() < 1e-3, "{point:?}");
        assert!((point.variance / (2.0 * noise * noise) - 1.0).abs() < 1e-6, "{point:?}");
        assert!(point.relative_error_low < point.relative_error && point.relative_error < point.relative_error_high);
    }
    // The synthetic engine takes no time, so the curve is fitted over its effort.
    let over_effort: Vec<(f64, f64)> = curve.points.iter().map(|p| (p.effort, p.relative_error)).collect();
    let found = fit::fit_power_law(&over_effort).unwrap();
    assert!((found.slope + 0.5).abs() < 0.03, "{found:?}");
    assert!((found.floor.unwrap() / BIAS - 1.0).abs() < 0.05, "{found:?}");
}

#[test]
fn a_knob_that_changes_the_result_differs_from_one_that_does_nothing() {
    let report = benched(SettingEffects::Measured);
    let effects = ["gain", "idle"].map(|setting| report.settings.iter().find(|k| k.setting == setting).unwrap().effect);
    assert_eq!(effects, [setting_effects::Effect::Result, setting_effects::Effect::Nothing]);
}

#[test]
fn views_name_the_machine_and_draw_every_point() {
    let report = benched(SettingEffects::Omitted);
    assert!(report.terminal().contains("known") && report.markdown().contains("| known |"));
    assert_eq!(report.csv().lines().count(), 7);
    assert_eq!(report.svg().matches("<circle").count(), 6);
    let svg = report.svg();
    let name = format!(">{}<", report.curves[0].name());
    for part in [">wall-clock seconds<", ">1 %<", ">0.1 %<", &name] {
        assert!(svg.contains(part), "no `{part}` in {svg}");
    }
    assert_eq!(svg.matches("class=\"bar\"").count(), 3 * 6, "an error bar and its two ends at each point");
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

/// The curve of an engine without start-up.
fn curve(engine: &str, reference_floor: f64, points: Vec<BenchPoint>) -> Curve {
    let key = ReadingKey::new("c", ProcedureId::DirectIlluminance, engine);
    Curve::new(key, Default::default(), (0.0, 0.0), reference_floor, points)
}

/// Seconds and errors of the Pareto front.
fn front(curves: &[Curve], floor: f64) -> Vec<(f64, f64)> {
    let pareto = Pareto::from_curves("c", ProcedureId::DirectIlluminance, curves, floor);
    pareto.front.iter().map(|(_, wall_s, error)| (*wall_s, *error)).collect()
}

#[test]
fn the_front_contains_what_no_other_point_beats() {
    let curves = [
        curve("a", 0.0, vec![point(1.0, 0.1), point(4.0, 0.05)]),
        curve("b", 0.0, vec![point(2.0, 0.2), point(3.0, 0.01)]),
    ];
    assert_eq!(front(&curves, 0.0), [(1.0, 0.1), (3.0, 0.01)]);
    // A difference below the uncertainty of the reference is no gain.
    assert_eq!(front(&curves, 0.2), [(1.0, 0.2)]);
}

#[test]
fn no_time_is_reported_to_an_error_below_the_references_floor() {
    for (reference_floor, expected) in [(0.0, [true, true, true]), (2e-3, [true, true, false])] {
        let curve = curve("e", reference_floor, vec![point(1.0, 0.05), point(2.0, 5e-4)]);
        assert_eq!(["0.1", "0.01", "0.001"].map(|t| curve.time_to[t].is_some()), expected);
    }
}
